"""Records the moving mechanism: MuJoCo's geoms as static shapes, poses over time, pushes as an arrow."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import rerun as rr

from cmg_mj.plant.elements import Module
from cmg_mj.plant.plant import Plant
from cmg_mj.view.recording.run import recorded_poses, torque_steps
from cmg_mj.view.recording.shapes import drawn_shapes, enclosing_ball
from cmg_mj.view.recording.signals import TIMELINE, Branch, instant, time_column

FLYWHEEL_SLOWDOWN = 100.0
"""Flywheels are drawn turning this many times slower.

At 314 rad/s a mark on the disc makes half a turn between two poses and seems to stand still. The recorded pose of
the flywheel is the true one; its shapes hang from a child entity, `slowed`, that turns them back.
"""

PUSH_COLOR = (213, 94, 0)
PUSH_LENGTH, PUSH_RADIUS = 0.8, 0.047
"""Length and radius of the strongest push's arrow, in radii of the rig."""


def log_poses(rec: rr.RecordingStream, branch: Branch) -> None:
    """Record poses of all bodies under `<branch>/rig`."""
    plant = branch.plant
    time, qpos = recorded_poses(plant, branch.run.trajectory)
    times = time_column(time)
    positions, quaternions = body_poses(plant, qpos)
    for body in range(1, plant.model.nbody):
        poses = rr.Transform3D.columns(translation=positions[:, body], quaternion=quaternions[:, body])
        rec.send_columns(body_path(branch, body), [times], poses)
    for module in plant.axis.modules:
        translation, quaternion = _turn_back(plant, module, qpos)
        poses = rr.Transform3D.columns(translation=translation, quaternion=quaternion)
        rec.send_columns(_slowed_path(branch, module), [times], poses)


def body_path(branch: Branch, body: int) -> str:
    """Name a body's entity: `cube1/gimbal` is `cube1.gimbal`, flat under the rig, as poses are in the world's frame."""
    name = branch.plant.model.body(body).name or f"body{body}"
    return f"{branch.path}/rig/{rr.escape_entity_path_part(name.replace('/', '.'))}"


def body_poses(plant: Plant, qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute the poses of all bodies in the world by MuJoCo's forward kinematics.

    Args:
        plant: The plant.
        qpos: Joint angles, (n, n_joints) [rad].

    Returns:
        Positions, (n, n_bodies, 3) [m], and quaternions in rerun's order xyzw, (n, n_bodies, 4).
    """
    model = plant.model
    data = mujoco.MjData(model)
    positions = np.empty((len(qpos), model.nbody, 3))
    quaternions = np.empty((len(qpos), model.nbody, 4))
    for k, angles in enumerate(qpos):
        data.qpos[:] = angles
        mujoco.mj_kinematics(model, data)
        positions[k], quaternions[k] = data.xpos, data.xquat
    return positions, np.roll(quaternions, -1, axis=-1)


def _turn_back(plant: Plant, module: Module, qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute the motion, in the flywheel's frame, from its true angle to the slowed one: translation, quaternion."""
    model = plant.model
    joint = int(model.dof_jntid[module.flywheel_dof])
    axis, anchor = model.jnt_axis[joint], model.jnt_pos[joint]
    turn = (qpos[:, module.flywheel] * (1.0 / FLYWHEEL_SLOWDOWN - 1.0))[:, None]
    quaternion = np.concatenate([np.sin(turn / 2.0) * axis, np.cos(turn / 2.0)], axis=1)
    axis_part = axis * (axis @ anchor)
    rotated_anchor = axis_part + np.cos(turn) * (anchor - axis_part) + np.sin(turn) * np.cross(axis, anchor)
    return anchor - rotated_anchor, quaternion


def _slowed_path(branch: Branch, module: Module) -> str:
    return f"{body_path(branch, int(branch.plant.model.dof_bodyid[module.flywheel_dof]))}/slowed"


def log_shapes(rec: rr.RecordingStream, branch: Branch) -> None:
    """Record the plant's shapes: one static entity for each geom and site, under its body."""
    plant, model = branch.plant, branch.plant.drawn_model
    parents = {body: body_path(branch, body) for body in range(model.nbody)}
    for module in plant.axis.modules:
        parents[int(model.dof_bodyid[module.flywheel_dof])] = _slowed_path(branch, module)
    for body, name, shape in drawn_shapes(model, _radius(plant)):
        path = "/".join(rr.escape_entity_path_part(part) for part in name.split("/"))
        rec.log(f"{parents[body]}/{path}", shape, static=True)


def log_pushes(rec: rr.RecordingStream, branch: Branch) -> None:
    """Record an arrow on the frame's upper edge that shows a push as the force of a hand, while the push lasts."""
    path = f"{body_path(branch, branch.plant.axis.frame)}/push"
    (tip, direction), radius = _edge(branch.plant), _radius(branch.plant)
    largest = max((abs(torque) for _, torque in torque_steps(branch.pushes, math.inf)), default=0.0)
    for time, torque in torque_steps(branch.pushes, branch.run.outcome.time_s):
        rec.set_time(TIMELINE, duration=instant(time))
        if abs(torque) <= 1e-9 * largest:
            rec.log(path, rr.Clear(recursive=False))
            continue
        force = direction * (PUSH_LENGTH * radius * torque / largest)
        style = {"radii": [PUSH_RADIUS * radius], "colors": [PUSH_COLOR], "labels": [f"push {torque:+.3g} N m"]}
        rec.log(path, rr.Arrows3D(vectors=[force], origins=[tip - force], **style))
    rec.reset_time()


def _radius(plant: Plant) -> float:
    """Return the radius of the rig at its start, the scale of arrows and floors [m]."""
    return enclosing_ball(plant, np.empty((0, plant.model.nq))).radius


def _edge(plant: Plant) -> tuple[np.ndarray, np.ndarray]:
    """Find the frame's upper edge on the radial line, and its motion under a positive torque, in the frame's axes."""
    model = plant.drawn_model
    axis, anchor = plant.axis.direction, plant.axis.point
    site = model.site_pos[model.sensor(plant.axis.prefix + "accelerometer_outer").objid[0]] - anchor
    radial = site - axis * (axis @ site)
    distance = float(np.linalg.norm(radial))
    radial = radial / distance
    frame_geoms = model.geom_bodyid == plant.axis.frame
    height = max([distance, *((model.geom_pos[frame_geoms] - anchor) @ radial).tolist()])
    return anchor + radial * height, np.cross(axis, radial)
