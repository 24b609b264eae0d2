"""A user's robot, made ready to carry modules: read, looked at, its joints named."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from cmg_mj.errors import InputError, nearest
from cmg_mj.mjcf import compile_model, parse

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
    off = [flag for name, flag in NEEDED.items() if spec.option.disableflags & int(getattr(mujoco.mjtDisableBit, name))]
    if off:
        raise InputError(
            f'{path}: <flag {off[0]}="disable"/> switches off what a mounted pair needs; take it out of the file'
        )
    _bake_total_mass(spec, path)
    for body in spec.bodies:
        for i, joint in enumerate(body.joints):
            joint.name = joint.name or f"{body.name or f'body{body.id}'}_joint{i or ''}"
    return spec, path


def _bake_total_mass(spec: mujoco.MjSpec, path: Path) -> None:
    """Write masses out that the compiler would scale to a total: the modules are not to be scaled with them."""
    if not spec.compiler.settotalmass > 0.0:
        return
    model = compile_model(spec, path)
    spec.compiler.settotalmass = -1.0
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    for body in spec.bodies:
        if body.name != "world":
            body.mass, body.inertia = float(model.body_mass[body.id]), model.body_inertia[body.id]
            body.ipos, body.iquat = model.body_ipos[body.id], model.body_iquat[body.id]
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
        for kind in (spec.bodies, spec.joints, spec.sites, spec.sensors, spec.actuators)
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
        if kind:
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
    name = f"{root.name}_free"
    root.add_freejoint(name=name)
    root.pos, root.quat = at
    for key in list(spec.keys):  # they have the joints that are gone
        spec.delete(key)
    return name


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
