"""A user's robot made ready to carry modules: read, checked, its joints named, its physics options set."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError, nearest
from cmg_mj.features.mounting.hold import joint_held, relative_pose, unused_name
from cmg_mj.inputs.files import expanded, require_file
from cmg_mj.plant.axis import find_axis
from cmg_mj.plant.checks import STEPS_S
from cmg_mj.plant.elements import EQUILIBRIUM_KEY, axes_in, axis_modules, missing_elements
from cmg_mj.plant.mjcf import compile_model, parse, posed
from cmg_mj.plant.settings import FLAGS_OFF
from cmg_mj.plant.tilt_line import HingeLine

BAD_CONNECTIONS = {mujoco.mjtEq.mjEQ_CONNECT: "connect", mujoco.mjtEq.mjEQ_WELD: "weld"}
UNNAMED = "MuJoCo Model"
"""The name that MuJoCo gives to a model without one."""
FLOORS = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD
NEEDED = ("constraint", "equality", "gravity", "actuation", "sensor")
"""Names in MJCF's <flag> of flags that must not be switched off."""
MAX_ASLANT = 1e-3
"""Gravity farther from straight down is no inaccuracy of the file [rad]."""
MAX_STEP_S = 0.005
"""Largest physics step; the gimbals' servos need it [s]."""
SLOW_STEP_S = 1e-4
"""With smaller physics steps the trials of the robot's stance and fall take half a minute and longer [s]."""
ITERATIONS, TOLERANCE = 100, 1e-8
"""MuJoCo's defaults for the solver; with less, held joints creep."""


def read_robot(robot: str | Path | mujoco.MjSpec) -> tuple[mujoco.MjSpec, Path]:
    """Read a robot into a model that can be changed.

    Args:
        robot: A file, or a model being edited, of which a copy is taken.

    Returns:
        The model, all joints named, and the path to call it by in messages.

    Raises:
        InputError: The file is no MJCF, does not compile, disables what mounting needs, or has a closed chain.
    """
    if isinstance(robot, (str, Path)):
        path = expanded(robot, "ROBOT")
        require_file(path)
        spec = parse(path)
    else:
        spec, path = robot.copy(), Path("robot" if robot.modelname in ("", UNNAMED) else robot.modelname)
    # Neither may take the modules' frames away, nor fuse them with what they hang on.
    spec.compiler.discardvisual = spec.compiler.fusestatic = False
    model = compile_model(spec, path)
    if not spec.option.timestep >= STEPS_S[0]:
        raise InputError(f'{path}: <option timestep="{spec.option.timestep:g}"/>: must be at least {STEPS_S[0]:g} s')
    for flag in NEEDED:
        if spec.option.disableflags & getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag.upper()}"):
            raise InputError(
                f'{path}: <flag {flag}="disable"/> switches off what a mounted pair needs; take it out of the file'
            )
    x, y, z = spec.option.gravity
    aslant = math.atan2(math.hypot(x, y), -z)
    if aslant > MAX_ASLANT:
        raise InputError(
            f'{path}: <option gravity="{x:g} {y:g} {z:g}"/>: pulls {math.degrees(aslant):.3g} deg off straight down; '
            "let it pull down, and turn the floor instead"
        )
    _bake_masses(spec, model)
    _name_all(spec)
    for equality in spec.equalities:
        kind = BAD_CONNECTIONS.get(equality.type) if equality.active else None
        if kind and not joint_held(spec, equality):
            raise InputError(
                f"<{kind}> ties {equality.name1!r} and {equality.name2 or 'the world'!r} together: a closed "
                "chain, whose joints cannot be held one by one"
            )
    return spec, path


def _bake_masses(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Write masses and inertias out that the compiler would change: it is not to change the modules' with them.

    It scales to a total (settotalmass), or raises to a bound (boundmass, boundinertia).
    """
    compiler = spec.compiler
    if max(compiler.settotalmass, compiler.boundmass, compiler.boundinertia) <= 0.0:
        return
    compiler.settotalmass, compiler.boundmass, compiler.boundinertia = -1.0, 0.0, 0.0
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    for body in spec.bodies:
        if body.name != "world":
            body.mass, body.inertia = model.body_mass[body.id], model.body_inertia[body.id]
            body.ipos, body.iquat = model.body_ipos[body.id], model.body_iquat[body.id]
            body.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
            body.fullinertia = np.full(6, np.nan)
            body.explicitinertial = True


def _name_all(spec: mujoco.MjSpec) -> None:
    """Name every body and every joint; a constraint that holds a ball joint needs the names of its bodies."""
    bodies, joints = ({element.name for element in kind} for kind in (spec.bodies, spec.joints))
    for body in spec.bodies:
        if not body.name:
            body.name = unused_name(f"body{body.id}", bodies)
            bodies.add(body.name)
        for i, joint in enumerate(body.joints):
            if not joint.name:
                joint.name = unused_name(f"{body.name}_joint{i or ''}", joints)
                joints.add(joint.name)


def set_physics_options(spec: mujoco.MjSpec) -> list[str]:
    """Set the integrator, solver and step that a pair needs, and return the changes as clauses.

    Fast flywheels need RK4, and servos need small steps.
    """
    notes = []
    option = spec.option
    gravity = np.asarray(option.gravity)
    down = [0.0, 0.0, -np.linalg.norm(gravity)]
    if gravity.tolist() != down:
        notes.append(f"its gravity of {' '.join(f'{part:g}' for part in gravity)} is now straight down")
        option.gravity = down
    if option.integrator != mujoco.mjtIntegrator.mjINT_RK4:
        option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        notes.append("its integrator is now RK4, which fast flywheels need")
    if option.solver != mujoco.mjtSolver.mjSOL_NEWTON:
        option.solver = mujoco.mjtSolver.mjSOL_NEWTON
        notes.append("its solver is now Newton: another does not hold joints stiffly")
    option.iterations, option.tolerance = max(option.iterations, ITERATIONS), min(option.tolerance, TOLERANCE)
    if np.any(option.wind):
        option.wind = np.zeros(3)
        notes.append("its wind is now 0, against which it would lean")
    if option.enableflags & FLAGS_OFF:
        option.enableflags &= ~FLAGS_OFF
        notes.append("its flags sleep, ipc and invdiscrete are now off: RK4 and worlds stepped together have them not")
    if option.timestep > MAX_STEP_S:
        notes.append(f"its physics steps of {option.timestep * 1e3:g} ms are now {MAX_STEP_S * 1e3:g} ms")
        option.timestep = MAX_STEP_S
    if option.timestep < SLOW_STEP_S:
        logging.getLogger("cmg_mj").warning(
            "hint: <option timestep> = %g: so many physics steps may take minutes; 0.0005 or more is quick",
            option.timestep,
        )
    return notes


def body_of(spec: mujoco.MjSpec, name: str) -> mujoco.MjsBody:
    """Return the body that carries the modules.

    Raises:
        InputError: There is no such body, or it is the world.
    """
    body = spec.body(name) if name != "world" else None
    if body is None:
        names = [body.name for body in spec.bodies if body.name != "world"]
        fused = any(geom.type not in FLOORS for geom in spec.worldbody.geoms)
        cure = '; MuJoCo made the root of a URDF a part of the world: save it with <compiler fusestatic="false"/>'
        raise InputError(f"--body {name}: no such body; {nearest(name, names, 'its bodies')}{cure if fused else ''}")
    for part in (root_of(body), *root_of(body).find_all("body")):
        if part.gravcomp:
            raise InputError(
                f"body {part.name!r} has gravcomp = {part.gravcomp:g}: what bears a robot's weight so takes the torque "
                "away that it falls by, which the pair's reduced model has; take gravcomp out of the file"
            )
    return body


def root_of(body: mujoco.MjsBody) -> mujoco.MjsBody:
    """Return the child of the world that a body is part of."""
    while body.parent.name != "world":
        body = body.parent
    return body


def free_base(spec: mujoco.MjSpec, body: mujoco.MjsBody, path: Path) -> None:
    """Let the tree that a body belongs to move freely: its root gets a free joint instead of its own.

    Args:
        spec: The model, which is changed.
        body: The body.
        path: The file, for messages.

    Raises:
        InputError: Another element of the file refers to a joint that is removed.
    """
    root = root_of(body)
    joints = list(root.joints)
    if len(joints) == 1 and joints[0].type == mujoco.mjtJoint.mjJNT_FREE:
        return
    names = {joint.name for joint in joints}
    for kind, elements, field in (
        ("actuator", spec.actuators, "target"),
        ("sensor", spec.sensors, "objname"),
        ("equality", spec.equalities, "name1"),
    ):
        for element in elements:
            if getattr(element, field) in names:
                raise InputError(
                    f"{kind} {element.name!r} refers to the joint {getattr(element, field)!r}, which a free base "
                    "replaces: take it out of the file"
                )
    model = compile_model(spec, path)
    stands = posed(model, model.qpos0).body(root.name)
    for element in (*joints, *spec.keys):  # keyframes have the joints that are gone
        spec.delete(element)
    root.add_freejoint(name=unused_name(f"{root.name}_free", {joint.name for joint in spec.joints}))
    # A child of the world is placed in world coordinates, whatever <frame> it is in.
    root.pos, root.quat, root.alt.type = np.zeros(3), [1.0, 0.0, 0.0, 0.0], mujoco.mjtOrientation.mjORIENTATION_QUAT
    frame = compile_model(spec, path).body(root.name)
    root.pos, root.quat = relative_pose(stands, frame.pos, frame.quat)


def pose_of(model: mujoco.MjModel, keyframe: str | None) -> np.ndarray:
    """Return the joint positions in which a robot stands.

    Args:
        model: The robot.
        keyframe: The name or number of one of its keyframes; None for its reference pose.

    Returns:
        (nq,).

    Raises:
        InputError: There is no such keyframe.
    """
    if keyframe is None:
        return model.qpos0.copy()
    names = [model.key(i).name or str(i) for i in range(model.nkey)]
    if keyframe not in names:
        raise InputError(f"--keyframe {keyframe}: no such keyframe; {nearest(keyframe, names, 'it has')}")
    return model.key_qpos[names.index(keyframe)].copy()


class ExistingAxes(NamedTuple):
    """Axes that a robot has already."""

    lines: Sequence[str]
    """The hinges that it tilts about."""
    drives: Sequence[str]
    """The gimbal and flywheel joints of the modules."""
    speeds: Mapping[str, float]
    """Flywheel joint -> speed [rad/s]."""


def find_existing_axes(spec: mujoco.MjSpec, model: mujoco.MjModel, name: str) -> ExistingAxes:
    """Find the axes that a robot has already.

    Args:
        spec: The robot.
        model: The same, compiled.
        name: Name of the new axis.

    Returns:
        The hinges, joints and speeds of these axes.

    Raises:
        InputError: It has an axis and the new one has no name; it has half of an axis; or its keyframe of that name
            does not fit.
    """
    names = axes_in(element.name for kind in (spec.joints, spec.sites, spec.sensors) for element in kind)
    is_key = any(key.name == EQUILIBRIUM_KEY for key in spec.keys)
    if not (names and is_key):
        if is_key:
            raise InputError(f"has a keyframe {EQUILIBRIUM_KEY!r} already, which a mounted pair brings: rename it")
        return ExistingAxes([], [], {})
    missing = missing_elements(spec)
    if missing:
        raise InputError(f"the robot has an axis already, and yet {missing[0]}")
    if not name:
        raise InputError("the robot has an axis already: give the new one a name, such as --name pitch")
    key, names_of = model.key(EQUILIBRIUM_KEY).id, axis_modules(model)
    axes = [find_axis(model, key, axis, names_of[axis]) for axis in names]
    modules = [module for axis in axes for module in axis.modules]
    return ExistingAxes(
        [model.joint(axis.line.joint).name for axis in axes if isinstance(axis.line, HingeLine)],
        [f"{module.name}/{joint}" for module in modules for joint in ("gimbal", "flywheel")],
        {f"{module.name}/flywheel": module.speed for module in modules},
    )
