"""Mounting of control moment gyroscopes on a robot: MJCF in, a plant out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.features.mounting.attach import add_sensors, attach_modules, module_names, site_names
from cmg_mj.features.mounting.axes import AxisLike
from cmg_mj.features.mounting.clearance import check_room
from cmg_mj.features.mounting.existing_axes import ExistingAxes, find_existing_axes
from cmg_mj.features.mounting.fall_check import SLOWEST, TRIED_DEG, overlap, simulated_pole
from cmg_mj.features.mounting.held_joints import Hold, hold_joints
from cmg_mj.features.mounting.keyframes import Poses, as_qpos, pop_keyframes, poses_of, write_keyframe
from cmg_mj.features.mounting.mounted import MountedRobot
from cmg_mj.features.mounting.request import Base, MountRequest
from cmg_mj.features.mounting.robot import (
    body_of,
    check_chains,
    check_names,
    free_base,
    pose_of,
    read_robot,
    set_physics_options,
)
from cmg_mj.features.mounting.stance import axes_along, check_unturned, find_place, stand_upright, under_and_height
from cmg_mj.inputs.files import folder
from cmg_mj.plant.axis import find_axis
from cmg_mj.plant.elements import EQUILIBRIUM_KEY, axes_of
from cmg_mj.plant.mjcf import compile_model, parse, posed, quiet, set_control_callback


def mount(
    robot: str | Path | mujoco.MjSpec,
    body: str,
    *,
    axis: AxisLike = "y",
    position: Sequence[float] | None = None,
    modules: int = 2,
    scale: float = 1.0,
    name: str = "",
    keyframe: str | None = None,
    hold: Hold = "constraints",
    release: Sequence[str] = (),
    base: Base = "as_is",
) -> MountedRobot:
    """Mount control moment gyroscopes on a robot, so that they balance it about one axis.

    Args:
        robot: Its MJCF, or a model being edited, which is not changed.
        body: The body that carries the modules and the sensors.
        axis: Tilt axis: a hinge name, or a direction in the body frame (`x`, `y` or three numbers). A direction
            selects the hinge parallel to it, or, for a free body, the contact line.
        position: Middle of the row of modules in the body frame [m]; by default the body's centre of mass.
        modules: Number of modules.
        scale: Scale of the modules' lengths: see `attach.scaled_module`.
        name: Name of the axis, with which its elements' names begin, as `roll/tilt`. A second axis needs one.
        keyframe: Keyframe in which the robot stands; by default its reference pose.
        hold: `constraints` hold all joints that do not tilt the robot; `servos`: the robot's own servos hold theirs.
        release: Joints that nothing holds.
        base: `as_is`, or `free`: a free joint replaces the joints of the robot's root.

    Returns:
        The robot with the pair on it.

    Raises:
        InputError: The robot or an argument does not allow it; the message says why.
    """
    return mount_on_request(
        robot, MountRequest(body, axis, position, modules, scale, name, keyframe, hold, release, base)
    )


@quiet()
def mount_on_request(robot: str | Path | mujoco.MjSpec, request: MountRequest) -> MountedRobot:
    """Mount control moment gyroscopes on a robot; see `mount`."""
    with set_control_callback(None):
        return _mount_on_spec(*read_robot(robot), request)


def _mount_on_spec(spec: mujoco.MjSpec, path: Path, request: MountRequest) -> MountedRobot:
    """Mount a pair on a model, which is changed."""
    body = body_of(spec, request.body, path)
    check_chains(spec, path)
    if request.base == "free":
        free_base(spec, body, path)
    names = module_names(request.prefix, request.modules)
    model = compile_model(spec, path)
    existing = find_existing_axes(spec, model, request.name, path)
    check_names(
        spec,
        [
            *site_names(request.prefix).values(),
            *(f"{module}/half" for module in names),
            *(f"{module}_mount" for module in names),
        ],
        path,
    )

    # The robot as it is to stand.
    keyframe = request.keyframe or (EQUILIBRIUM_KEY if existing.drives else None)
    pose = pose_of(model, keyframe, path)
    place = find_place(model, pose, request, path)
    if place.joint in existing.lines:
        raise InputError(f"{path}: the hinge {place.joint!r} has an axis already: another one needs another hinge")
    keyframes = pop_keyframes(spec, model)
    held = hold_joints(
        spec, model, pose, request.hold, {place.joint, *existing.lines, *existing.drives}, request.release, path
    )

    # With the modules on it.
    mounts = attach_modules(spec, body, names, request.scale)
    notes = set_physics_options(spec)
    gimbals = {f"{module}/gimbal": np.array([math.pi / 2.0]) for module in names}
    others = [line for line in existing.lines if line != place.joint]
    poses = poses_of(model, pose) | gimbals
    model, (qpos, point, direction) = stand_upright(spec, poses, place, mounts, others, request, path)

    # With sensors, and a keyframe to start from.
    check_unturned(model, poses, qpos, [*others, place.joint] if others else [], path)
    data = posed(model, qpos)
    check_room(model, data, names, float(point[2]) if place.free else None, path)
    under, height = under_and_height(model, data, model.joint(place.joint).id, point, direction)
    frame = model.body(request.body).id
    turn, origin = data.xmat[frame].reshape(3, 3), data.xpos[frame]
    add_sensors(spec, body, request.prefix, turn.T @ (under - origin), turn.T @ axes_along(direction), height)
    model = _with_keyframes(spec, names, qpos, [(name, poses | gimbals) for name, poses in keyframes], existing, path)
    key = model.key(EQUILIBRIUM_KEY).id
    line = find_axis(model, key, request.name, axes_of(model)[request.name]).line
    pole = simulated_pole(model, key, line)
    if pole < SLOWEST:
        touching = overlap(model, key, line, pole)
        if pole and not touching:
            raise InputError(
                f"{path}: falls too slowly, with {pole:.2g} 1/s; a pair is for robots that fall with {SLOWEST:.2g} "
                "1/s or faster (--position is in metres; a mass far up falls slowly)"
            )
        reason = f"{touching}; let them not collide (<exclude>)" if touching else "it stands by itself"
        raise InputError(f"{path}: does not start to fall from a tilt of {TRIED_DEG:g} deg: {reason}")
    return MountedRobot(spec, path, tuple(held), tuple(notes))


def _with_keyframes(
    spec: mujoco.MjSpec,
    names: Sequence[str],
    qpos: np.ndarray,
    keyframes: Sequence[tuple[str, Poses]],
    existing: ExistingAxes,
    path: Path,
) -> mujoco.MjModel:
    """Compile the model with the equilibrium, in which all flywheels turn, and the robot's own keyframes."""
    model = compile_model(spec, path)
    speed = nominal_speed()
    speeds = {f"{module}/flywheel": speed * (-1.0) ** i for i, module in enumerate(names)}
    controls = {f"{wheel}_motor": speed for wheel, speed in speeds.items()}
    speeds, controls = {**existing.speeds, **speeds}, {**existing.controls, **controls}
    write_keyframe(spec, model, EQUILIBRIUM_KEY, qpos, speeds, controls)
    for name, poses in keyframes:
        write_keyframe(spec, model, name, as_qpos(model, poses), speeds, controls)
    return compile_model(spec, path)


def nominal_speed() -> float:
    """Return the speed of the papers' flywheels [rad/s]."""
    rig = parse(folder("models") / "scissored_pair.xml")
    names = [actuator.name for actuator in rig.actuators]
    return abs(float(rig.key(EQUILIBRIUM_KEY).ctrl[names.index("cube1/flywheel_motor")]))
