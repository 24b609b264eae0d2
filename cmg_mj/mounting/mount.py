"""Pairs mounted on a robot: any MJCF in, a rig out."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from cmg_mj.axis import find_axis
from cmg_mj.engine import control_callback, quiet
from cmg_mj.errors import InputError
from cmg_mj.mjcf import check_rig, compile_model, parse
from cmg_mj.mounting.axes import AxisLike, hinge_or_direction
from cmg_mj.mounting.falling import TRIED_DEG, falls_with
from cmg_mj.mounting.holding import Hold, hold_joints
from cmg_mj.mounting.keyframes import as_qpos, poses_of, taken_out, write_keyframe
from cmg_mj.mounting.parts import add_sensors, attach_cubes, cube_names, place_cubes, site_names
from cmg_mj.mounting.robot import body_of, check_chains, check_names, free_base, pose_of, read_robot
from cmg_mj.mounting.settling import UP, stand
from cmg_mj.resources import folder
from cmg_mj.rig_parts import KEYFRAME
from cmg_mj.trajectory import whole_file

LARGEST_STEP_S = 0.005
"""A robot's file that asks for larger steps is given these: the gimbals' servos need them [s]."""
ITERATIONS, TOLERANCE = 100, 1e-8
"""Of the solver, MuJoCo's own: a file that is content with less lets held joints creep."""
SMALLEST_HEIGHT_M = 1e-3
"""Less far above the line a robot's mass is not above it [m]."""
SCALES = 0.05, 20.0
MOST_CUBES = 16
MOST_TRIES = 5
"""So often a robot is put on the floor, its modules turned along the line that it then stands on."""


@dataclass(frozen=True)
class Mounted:
    """A robot with a pair on it.

    Attributes:
        spec: The model, which can be edited further.
        path: What to call the robot it was made from.
        held: Joints that an equality constraint holds where they stand.
        notes: What was changed in the robot besides, in clauses.
    """

    spec: mujoco.MjSpec
    path: Path
    held: tuple[str, ...]
    notes: tuple[str, ...]

    def save(self, path: str | Path) -> Path:
        """Write it as MJCF, which plain MuJoCo loads and `plant.model` takes; whole or not at all.

        Args:
            path: The file. Meshes and textures are not copied: it names them from where it lies.

        Returns:
            The file.

        Raises:
            InputError: It cannot be written, or would lie in place of the robot itself.
        """
        target = Path(path).expanduser()
        if target.exists() and self.path.exists() and target.samefile(self.path):
            raise InputError(f"-o {path}: is the robot's own file; give another name")
        spec = self.spec.copy()
        for field in ("meshdir", "texturedir"):
            setattr(spec, field, _seen_from(target.resolve().parent, spec.modelfiledir, getattr(spec, field)))
        try:
            with whole_file(target, ".xml") as temporary:
                temporary.write_text(spec.to_xml(), encoding="utf-8")
                check_rig(temporary, target)
        except OSError as error:
            raise InputError(f"-o {path}: cannot be written: {error.strerror}") from error
        return target


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
) -> Mounted:
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
    with control_callback(None):
        return _mount(
            robot,
            body,
            axis,
            at=at,
            cubes=cubes,
            scale=scale,
            name=name,
            keyframe=keyframe,
            hold=hold,
            free=free,
            base=base,
        )


def _mount(
    robot: str | Path | mujoco.MjSpec,
    body_name: str,
    axis: AxisLike,
    *,
    at: Sequence[float] | None,
    cubes: int,
    scale: float,
    name: str,
    keyframe: str | None,
    hold: Hold,
    free: Sequence[str],
    base: str,
) -> Mounted:
    _check_numbers(cubes, scale, name, at)
    spec, path = read_robot(robot)
    body = body_of(spec, body_name, path)
    check_chains(spec, path)
    if base == "free":
        free_base(spec, body, path)
    prefix = f"{name}/" if name else ""
    names = cube_names(prefix, cubes)
    check_names(spec, [*site_names(prefix).values(), *(f"{cube}/half" for cube in names)], path)

    # The robot as it is to stand.
    model = compile_model(spec, path)
    if not model.body_subtreemass[model.body(body_name).id] > 0.0:
        raise InputError(f"--body {body_name}: {path}: has no mass, nor has anything on it")
    pose = pose_of(model, keyframe, path)
    data = _posed(model, pose)
    tree = model.body(body_name).id
    hinge, direction = hinge_or_direction(model, data, tree, axis, path)
    root = None if hinge is not None else _free_joint(model, tree)
    turn = data.xmat[tree].reshape(3, 3)
    middle = model.body_ipos[tree] if at is None else np.array(at, dtype=float)
    tilts = [model.joint(hinge if root is None else root).name]
    poses = poses_of(model, pose)
    own = taken_out(spec, model)
    held = hold_joints(spec, model, pose, hold, tilts, free, path)

    # With the modules on it.
    mounts = attach_cubes(spec, body, names, scale)
    place_cubes(mounts, middle, turn.T @ _axes_along(direction), scale)
    notes = _set_options(spec)
    model = compile_model(spec, path)
    gimbals = {f"{cube}/gimbal": np.array([math.pi / 2.0]) for cube in names}
    qpos = as_qpos(model, poses | gimbals)
    if root is None:
        qpos, point = _balanced(model, qpos, model.joint(tilts[0]).id, direction, path)
    else:
        qpos, point, direction = stand(model, qpos, model.joint(tilts[0]).id, direction, path)
        for left in reversed(range(MOST_TRIES)):
            turn = _posed(model, qpos).xmat[tree].reshape(3, 3)
            if place_cubes(mounts, middle, turn.T @ _axes_along(direction), scale):
                break
            model = compile_model(spec, path)
            if left:
                qpos, point, direction = stand(model, qpos, model.joint(tilts[0]).id, direction, path)

    # With sensors, and a keyframe to start from.
    data = _posed(model, qpos)
    joint = model.joint(tilts[0]).id
    under = point + ((data.subtree_com[int(model.jnt_bodyid[joint])] - point) @ direction) * direction
    height = _top(model, data, int(model.jnt_bodyid[joint])) - float(point[2])
    turn, origin = data.xmat[tree].reshape(3, 3), data.xpos[tree]
    add_sensors(spec, body, prefix, turn.T @ (under - origin), turn.T @ _axes_along(direction), height)
    model = compile_model(spec, path)
    speed = nominal_speed()
    turning = {f"{cube}/flywheel": speed * (-1.0) ** i for i, cube in enumerate(names)}
    commands = {f"{wheel}_motor": speed for wheel, speed in turning.items()}
    write_keyframe(spec, model, KEYFRAME, qpos, turning, commands)
    for own_name, own_poses in own:
        write_keyframe(spec, model, own_name, as_qpos(model, own_poses | gimbals), turning, commands)
    model = compile_model(spec, path)
    key = model.key(KEYFRAME).id
    if not falls_with(model, key, find_axis(model, key, name).line):
        raise InputError(f"{path}: does not start to fall from a tilt of {TRIED_DEG:g} deg: it stands by itself")
    return Mounted(spec, path, tuple(held), tuple(notes))


def _check_numbers(cubes: Any, scale: Any, name: Any, at: Any) -> None:
    if not (isinstance(cubes, int) and 1 <= cubes <= MOST_CUBES):
        raise InputError(f"--cubes {cubes}: must be from 1 to {MOST_CUBES}")
    if not (isinstance(scale, (int, float)) and SCALES[0] <= scale <= SCALES[1]):
        raise InputError(f"--scale {scale}: must be from {SCALES[0]:g} to {SCALES[1]:g}")
    if not (isinstance(name, str) and (not name or name.isidentifier())):
        raise InputError(f"--name {name}: must be a word, such as roll")
    if at is not None and not (len(at) == 3 and np.isfinite(np.array(at, dtype=float)).all()):
        raise InputError(f"--at {at}: must be three numbers, a point in the body's frame [m]")


def _set_options(spec: mujoco.MjSpec) -> list[str]:
    """Fast flywheels need RK4, servos steps that they can follow; what was changed, in clauses."""
    notes = []
    option = spec.option
    gravity = np.asarray(option.gravity)
    down = [0.0, 0.0, -float(np.linalg.norm(gravity))]
    if gravity.tolist() != down and gravity[2] < 0.0 and np.linalg.norm(gravity[:2]) < 1e-3 * -gravity[2]:
        notes.append(f"its gravity of {' '.join(f'{part:g}' for part in gravity)} is now straight down")
        option.gravity = down
    if int(option.integrator) != int(mujoco.mjtIntegrator.mjINT_RK4):
        option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        notes.append("its integrator is now RK4, which fast flywheels need")
    if int(option.solver) != int(mujoco.mjtSolver.mjSOL_NEWTON):
        option.solver = mujoco.mjtSolver.mjSOL_NEWTON
        notes.append("its solver is now Newton: another does not hold joints stiffly")
    option.iterations, option.tolerance = max(option.iterations, ITERATIONS), min(option.tolerance, TOLERANCE)
    if option.timestep > LARGEST_STEP_S:
        notes.append(f"its physics steps of {option.timestep * 1e3:g} ms are now {LARGEST_STEP_S * 1e3:g} ms")
        option.timestep = LARGEST_STEP_S
    return notes


def nominal_speed() -> float:
    """At which the papers' flywheels turn [rad/s]."""
    rig = parse(folder("models") / "scissored_pair.xml")
    names = [actuator.name for actuator in rig.actuators]
    return abs(float(rig.key(KEYFRAME).ctrl[names.index("cube1/flywheel_motor")]))


def _axes_along(direction: np.ndarray) -> np.ndarray:
    """A line's axes in the world, by columns: y along it, z upward."""
    return np.stack([np.cross(direction, UP), direction, UP], axis=1)


def _posed(model: mujoco.MjModel, qpos: np.ndarray) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    return data


def _free_joint(model: mujoco.MjModel, body: int) -> int:
    """The free joint of the tree that a body belongs to."""
    return int(model.body_jntadr[int(model.body_rootid[body])])


def _balanced(
    model: mujoco.MjModel, qpos: np.ndarray, joint: int, direction: np.ndarray, path: Path
) -> tuple[np.ndarray, np.ndarray]:
    """Turn a hinge so that the mass on it is above it: the pose, and a point of its axis in the world."""
    data = _posed(model, qpos)
    point = data.xanchor[joint].copy()
    arm = data.subtree_com[int(model.jnt_bodyid[joint])] - point
    radial = arm - (arm @ direction) * direction
    if float(np.linalg.norm(radial)) < SMALLEST_HEIGHT_M:
        raise InputError(
            f"{path}: the mass on the hinge {model.joint(joint).name!r} lies on its axis: there is nothing to balance"
        )
    lean = math.atan2(float(radial @ np.cross(direction, UP)), float(radial @ UP))
    sign = math.copysign(1.0, float(data.xaxis[joint] @ direction))
    address = int(model.jnt_qposadr[joint])
    upright = float(qpos[address]) - sign * lean
    low, high = model.jnt_range[joint]
    if model.jnt_limited[joint] and not low <= upright <= high:
        raise InputError(
            f"{path}: the hinge {model.joint(joint).name!r} would stand upright at {upright:.4g} rad, beyond its range "
            f"of {low:.4g} to {high:.4g}"
        )
    qpos = qpos.copy()
    qpos[address] = upright
    return qpos, point


def _top(model: mujoco.MjModel, data: mujoco.MjData, root: int) -> float:
    """The highest point of all that a body carries [m]."""
    highest = -math.inf
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        while body not in (0, root):
            body = int(model.body_parentid[body])
        if body == root:
            centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
            turn = data.geom_xmat[geom].reshape(3, 3)
            middle = data.geom_xpos[geom] + turn @ centre
            highest = max(highest, float(middle[2] + np.abs(turn[2]) @ half))
    return highest


def _seen_from(folder_: Path, model_folder: str, assets: str) -> str:
    """A folder of assets, which the robot's file names from where it lies, from another folder."""
    return os.path.relpath(Path(model_folder or ".").resolve() / assets, folder_)
