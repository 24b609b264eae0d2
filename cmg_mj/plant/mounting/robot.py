"""A user's robot, made ready to carry modules: read, looked at, its joints named."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from cmg_mj.errors import InputError, nearest
from cmg_mj.plant.mjcf import compile_model, parse
from cmg_mj.plant.mounting.element_names import free_name, name_all
from cmg_mj.plant.mounting.held_joints import joint_held

BAD_CONNECTIONS = {
    int(mujoco.mjtEq.mjEQ_CONNECT): "connect",
    int(mujoco.mjtEq.mjEQ_WELD): "weld",
}
UNNAMED = "MuJoCo Model"
"""What MuJoCo calls a model that has no name."""
NEEDED = {
    "mjDSBL_CONSTRAINT": "constraint",
    "mjDSBL_EQUALITY": "equality",
    "mjDSBL_GRAVITY": "gravity",
    "mjDSBL_ACTUATION": "actuation",
    "mjDSBL_SENSOR": "sensor",
}
"""What must not be switched off, and what MJCF's <flag> calls it."""


def read_robot(robot: str | Path | mujoco.MjSpec) -> tuple[mujoco.MjSpec, Path]:
    """A model of the caller's own, which can be changed.

    Args:
        robot: A file, or a model being edited, of which a copy is taken.

    Returns:
        The model, every joint of which has a name, and what to call it in messages.

    Raises:
        InputError: It is no MJCF, does not compile, or has something switched off that mounting needs.
    """
    if isinstance(robot, (str, Path)):
        path = Path(robot).expanduser()
        if not path.is_file():
            raise InputError(f"{path}: no such file")
        spec = parse(path)
    else:
        spec, path = robot.copy(), Path("robot" if robot.modelname in ("", UNNAMED) else robot.modelname)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what is deprecated in the user's file
        compile_model(spec, path)
    # Neither may take the modules' frames away, nor fuse them with what they hang on.
    spec.compiler.discardvisual = spec.compiler.fusestatic = False
    compile_model(spec, path)
    off = [flag for name, flag in NEEDED.items() if spec.option.disableflags & int(getattr(mujoco.mjtDisableBit, name))]
    if off:
        raise InputError(
            f'{path}: <flag {off[0]}="disable"/> switches off what a mounted pair needs; take it out of the file'
        )
    if not spec.option.gravity[2] < 0.0:
        said = " ".join(f"{part:g}" for part in spec.option.gravity)
        raise InputError(f'{path}: <option gravity="{said}"/> does not pull down: there is nothing to balance')
    _bake_masses(spec, path)
    name_all(spec)
    return spec, path


def _bake_masses(spec: mujoco.MjSpec, path: Path) -> None:
    """Write masses and inertias out that the compiler would change: it is not to change the modules' with them.

    It scales to a total (settotalmass), or raises to a bound (boundmass, boundinertia).
    """
    compiler = spec.compiler
    if not (compiler.settotalmass > 0.0 or compiler.boundmass > 0.0 or compiler.boundinertia > 0.0):
        return
    model = compile_model(spec, path)
    compiler.settotalmass, compiler.boundmass, compiler.boundinertia = -1.0, 0.0, 0.0
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    for body in spec.bodies:
        if body.name != "world":
            body.mass, body.inertia = float(model.body_mass[body.id]), model.body_inertia[body.id]
            body.ipos, body.iquat = model.body_ipos[body.id], model.body_iquat[body.id]
            body.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
            body.fullinertia = np.full(6, np.nan)
            body.explicitinertial = True


def body_of(spec: mujoco.MjSpec, name: str, path: Path) -> mujoco.MjsBody:
    """The body that is to carry the modules.

    Raises:
        InputError: There is none of that name, it is the world, or it weighs nothing.
    """
    body = spec.body(name) if name != "world" else None
    if body is None:
        names = [body.name for body in spec.bodies if body.name and body.name != "world"]
        raise InputError(f"--body {name}: {path} has no such body; {nearest(name, names, 'its bodies')}")
    return body


def check_names(spec: mujoco.MjSpec, names: Sequence[str], path: Path) -> None:
    """What is added must not bear a name that is taken.

    Raises:
        InputError: One is.
    """
    taken = {
        element.name
        for kind in (spec.bodies, spec.frames, spec.joints, spec.sites, spec.sensors, spec.actuators)
        for element in kind
    }
    for name in names:
        if name in taken:
            raise InputError(f"{path}: has an element {name!r} already, which a mounted pair brings: rename it")


def check_chains(spec: mujoco.MjSpec, path: Path) -> None:
    """What carries the modules must be a tree: of a closed chain no rigid body is left if its joints are held.

    Raises:
        InputError: Two bodies are tied together by a constraint.
    """
    for equality in spec.equalities:
        kind = BAD_CONNECTIONS.get(int(equality.type))
        if kind and not joint_held(spec, equality):
            raise InputError(
                f"{path}: <{kind}> ties {equality.name1!r} and {equality.name2 or 'the world'!r} together: a closed "
                "chain, whose joints cannot be held one by one"
            )


def free_base(spec: mujoco.MjSpec, body: mujoco.MjsBody, path: Path) -> str:
    """Let the tree that a body belongs to move freely: its root gets a free joint instead of its own.

    Args:
        spec: The model, which is changed.
        body: The body.
        path: The file, for messages.

    Returns:
        The free joint's name.

    Raises:
        InputError: Something else in the file speaks of a joint that goes.
    """
    root = body
    while root.parent.name != "world":
        root = root.parent
    joints = list(root.joints)
    if len(joints) == 1 and int(joints[0].type) == int(mujoco.mjtJoint.mjJNT_FREE):
        return joints[0].name
    names = {joint.name for joint in joints}
    for kind, elements, of in (
        ("actuator", spec.actuators, "target"),
        ("sensor", spec.sensors, "objname"),
        ("equality", spec.equalities, "name1"),
    ):
        for element in elements:
            if getattr(element, of) in names:
                raise InputError(
                    f"{path}: {kind} {element.name!r} speaks of the joint {getattr(element, of)!r}, which a free base "
                    "takes the place of: take it out of the file"
                )
    model = compile_model(spec, path)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    at = data.xpos[model.body(root.name).id].copy(), data.xquat[model.body(root.name).id].copy()
    for joint in joints:
        spec.delete(joint)
    name = free_name(f"{root.name}_free", {joint.name for joint in spec.joints})
    root.add_freejoint(name=name)
    _place(spec, root, *at, path)
    return name


def _place(spec: mujoco.MjSpec, root: mujoco.MjsBody, pos: np.ndarray, quat: np.ndarray, path: Path) -> None:
    """Put a body of the world's where it is to be, in the world: a <frame> that it is in is taken off first."""
    for key in list(spec.keys):  # they have the joints that are gone
        spec.delete(key)
    root.pos, root.quat, root.alt.type = np.zeros(3), [1.0, 0.0, 0.0, 0.0], mujoco.mjtOrientation.mjORIENTATION_QUAT
    model = compile_model(spec, path)
    frame = model.body(root.name)
    back_pos, back_quat, inner_pos, inner_quat = np.empty(3), np.empty(4), np.empty(3), np.empty(4)
    mujoco.mju_negPose(back_pos, back_quat, frame.pos, frame.quat)
    mujoco.mju_mulPose(inner_pos, inner_quat, back_pos, back_quat, pos, quat)
    root.pos, root.quat = inner_pos, inner_quat


def joint_sizes(kind: int) -> tuple[int, int]:
    """Of a joint's kind, how many numbers it has in qpos and in qvel."""
    return {0: (7, 6), 1: (4, 3)}.get(kind, (1, 1))


def pose_of(model: mujoco.MjModel, keyframe: str | None, path: Path) -> np.ndarray:
    """The joints' positions that a robot is to stand in.

    Args:
        model: The robot.
        keyframe: The name or number of one of its keyframes; None for its reference pose.
        path: The file, for messages.

    Returns:
        (nq,).

    Raises:
        InputError: There is no such keyframe.
    """
    if keyframe is None:
        return model.qpos0.copy()
    names = [model.key(i).name or str(i) for i in range(model.nkey)]
    if keyframe not in names:
        raise InputError(f"--keyframe {keyframe}: {path} has no such keyframe; {nearest(keyframe, names, 'it has')}")
    return model.key_qpos[names.index(keyframe)].copy()
