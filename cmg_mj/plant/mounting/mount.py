"""Pairs mounted on a robot: any MJCF in, a rig out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from cmg_mj.errors import InputError
from cmg_mj.inputs.bundled import folder
from cmg_mj.plant.axis import find_axis
from cmg_mj.plant.mjcf import compile_model, parse
from cmg_mj.plant.mounting.attach import add_sensors, attach_cubes, cube_names, site_names
from cmg_mj.plant.mounting.axes import AxisLike
from cmg_mj.plant.mounting.clearance import check_room
from cmg_mj.plant.mounting.existing_axes import ExistingAxes, earlier_axes
from cmg_mj.plant.mounting.fall_check import TRIED_DEG, falls_with
from cmg_mj.plant.mounting.held_joints import Hold, hold_joints
from cmg_mj.plant.mounting.keyframes import Poses, as_qpos, pop_keyframes, poses_of, write_keyframe
from cmg_mj.plant.mounting.mounted import MountedRobot
from cmg_mj.plant.mounting.physics_options import set_options
from cmg_mj.plant.mounting.request import MountRequest
from cmg_mj.plant.mounting.robot import body_of, check_chains, check_names, free_base, pose_of, read_robot
from cmg_mj.plant.mounting.stance import axes_along, check_unturned, find_place, posed, stand_upright, under_and_height
from cmg_mj.plant.mujoco_state import quiet, set_control_callback
from cmg_mj.plant.parts import EQUILIBRIUM_KEY, axes_of


@quiet()
def mount(
    robot: str | Path | mujoco.MjSpec,
    body: str,
    *,
    axis: AxisLike = "y",
    at: Sequence[float] | None = None,
    cubes: int = 2,
    scale: float = 1.0,
    name: str = "",
    keyframe: str | None = None,
    hold: Hold = "constraints",
    free: Sequence[str] = (),
    base: str = "as_is",
) -> MountedRobot:
    """Mount control moment gyroscopes on a robot, so that they balance it about one axis.

    Args:
        robot: Its MJCF, or a model being edited, which is not changed.
        body: The body that carries the modules and the sensors.
        axis: About what it tilts: the name of a hinge, or a direction in the body's frame, `x`, `y` or three numbers.
            Of a body that hangs on a hinge along it, that hinge; of a free one, a line through what it stands on.
        at: Where the middle of the row of modules is, in the body's frame; the body's centre of mass if left out [m].
        cubes: How many modules.
        scale: Of the modules' lengths: see `mounting.module`.
        name: Of the axis, needed for the second one: it begins the names of its elements, as `roll/tilt`.
        keyframe: A keyframe of the robot's in which it is to stand; its reference pose if left out.
        hold: Whether joints that do not tilt it are all held by constraints, or by the robot's servos where it has any.
        free: Joints that are held by nothing.
        base: `as_is`; or `free`: the root of the robot gets a free joint in the place of its own joints.

    Returns:
        The robot with the pair on it.

    Raises:
        InputError: The robot, or what is asked for, does not admit it; why, in one line.
    """
    asked = MountRequest(body, axis, at, cubes, scale, name, keyframe, hold, free, base)
    with set_control_callback(None):
        return _mount_on_spec(*read_robot(robot), asked)


def _mount_on_spec(spec: mujoco.MjSpec, path: Path, asked: MountRequest) -> MountedRobot:
    """The robot's model, which is changed, with the pair on it."""
    body = body_of(spec, asked.body, path)
    check_chains(spec, path)
    if asked.base == "free":
        free_base(spec, body, path)
    names = cube_names(asked.prefix, asked.cubes)
    model = compile_model(spec, path)
    earlier = earlier_axes(spec, model, asked.name, path)
    check_names(
        spec,
        [*site_names(asked.prefix).values(), *(f"{cube}/half" for cube in names), *(f"{cube}_mount" for cube in names)],
        path,
    )

    # The robot as it is to stand.
    keyframe = asked.keyframe or (EQUILIBRIUM_KEY if earlier.drives else None)
    pose = pose_of(model, keyframe, path)
    place = find_place(model, pose, asked, path)
    if place.joint in earlier.lines:
        raise InputError(f"{path}: the hinge {place.joint!r} has an axis already: another one needs another hinge")
    own = pop_keyframes(spec, model)
    held = hold_joints(spec, model, pose, asked.hold, {place.joint, *earlier.lines, *earlier.drives}, asked.free, path)

    # With the modules on it.
    mounts = attach_cubes(spec, body, names, asked.scale)
    notes = set_options(spec)
    gimbals = {f"{cube}/gimbal": np.array([math.pi / 2.0]) for cube in names}
    others = [line for line in earlier.lines if line != place.joint]
    poses = poses_of(model, pose) | gimbals
    model, (qpos, point, direction) = stand_upright(spec, poses, place, mounts, others, asked, path)

    # With sensors, and a keyframe to start from.
    check_unturned(model, poses, qpos, [*others, place.joint] if others else [], path)
    data = posed(model, qpos)
    check_room(model, data, names, float(point[2]) if place.free else None, path)
    under, height = under_and_height(model, data, model.joint(place.joint).id, point, direction)
    frame = model.body(asked.body).id
    turn, origin = data.xmat[frame].reshape(3, 3), data.xpos[frame]
    add_sensors(spec, body, asked.prefix, turn.T @ (under - origin), turn.T @ axes_along(direction), height)
    model = _with_keyframes(spec, names, qpos, [(name, poses | gimbals) for name, poses in own], earlier, path)
    key = model.key(EQUILIBRIUM_KEY).id
    if not falls_with(model, key, find_axis(model, key, asked.name, axes_of(model)[asked.name]).line):
        raise InputError(f"{path}: does not start to fall from a tilt of {TRIED_DEG:g} deg: it stands by itself")
    return MountedRobot(spec, path, tuple(held), tuple(notes))


def _with_keyframes(
    spec: mujoco.MjSpec,
    names: Sequence[str],
    qpos: np.ndarray,
    own: Sequence[tuple[str, Poses]],
    earlier: ExistingAxes,
    path: Path,
) -> mujoco.MjModel:
    """The model compiled with a keyframe in which the robot stands and all flywheels turn, and with the robot's own."""
    model = compile_model(spec, path)
    speed = nominal_speed()
    speeds = {f"{cube}/flywheel": speed * (-1.0) ** i for i, cube in enumerate(names)}
    controls = {f"{wheel}_motor": speed for wheel, speed in speeds.items()}
    speeds, controls = {**earlier.speeds, **speeds}, {**earlier.controls, **controls}
    write_keyframe(spec, model, EQUILIBRIUM_KEY, qpos, speeds, controls)
    for name, poses in own:
        write_keyframe(spec, model, name, as_qpos(model, poses), speeds, controls)
    return compile_model(spec, path)


def nominal_speed() -> float:
    """At which the papers' flywheels turn [rad/s]."""
    rig = parse(folder("models") / "scissored_pair.xml")
    names = [actuator.name for actuator in rig.actuators]
    return abs(float(rig.key(EQUILIBRIUM_KEY).ctrl[names.index("cube1/flywheel_motor")]))
