"""The moving mechanism: MuJoCo's geoms as shapes, poses over time, pushes as an arrow, the ball that encloses it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import rerun as rr

from cmg_mj.plant.elements import Module
from cmg_mj.plant.plant import Plant
from cmg_mj.view.recording.run import recorded_poses, torque_steps
from cmg_mj.view.recording.signals import TIMELINE, Branch, instant, time_column

INFINITE_PLANE, TILE = 4.0, 0.5
"""Half the edge of an infinite plane, and the edge of its tiles, in radii of the rig."""

MOST_TILES = 200
"""Largest number of tiles along one edge of a plane."""

TILE_COLORS = ((150, 156, 164), (132, 138, 147))

_Type = mujoco.mjtGeom

Shape = rr.Capsules3D | rr.Cylinders3D | rr.Boxes3D | rr.Ellipsoids3D | rr.Mesh3D


SHOWN_GROUPS = 3
"""Number of groups of geoms and sites that are drawn, as in MuJoCo's viewers."""

POSES = 25
"""Number of poses of a run that the ball encloses."""

FARTHEST = 2.0
"""A rig that travels farther than so many radii is shown at its start."""

CORNERS = 2.0 * np.array(list(np.ndindex(2, 2, 2))) - 1.0


@dataclass(frozen=True)
class Ball:
    """A ball that encloses a rig.

    Attributes:
        centre: Centre, (3,) [m].
        radius: Radius [m].
    """

    centre: np.ndarray
    radius: float


def is_drawn(group: int, rgba: np.ndarray) -> bool:
    """Return whether MuJoCo would draw a geom or site."""
    return group < SHOWN_GROUPS and bool(rgba[3] > 0.0)


def geom_rgba(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Return a geom's colour, or the colour of its material if the geom has MuJoCo's default."""
    rgba, material = model.geom_rgba[geom], model.geom_matid[geom]
    return model.mat_rgba[material] if material >= 0 and np.all(rgba == (0.5, 0.5, 0.5, 1.0)) else rgba


def enclosing_ball(plant: Plant, qpos: np.ndarray) -> Ball:
    """Enclose the part of a plant that a camera must see during a run.

    Args:
        plant: The plant.
        qpos: Joint angles, (n, n_joints) [rad].

    Returns:
        A ball around the moving bodies and the fixed geoms beside them, without floors and walls.
    """
    model = plant.drawn_model
    data = mujoco.MjData(model)
    geoms = [i for i in range(model.ngeom) if is_drawn(model.geom_group[i], geom_rgba(model, i))]
    geoms = [i for i in geoms if model.geom_type[i] != int(mujoco.mjtGeom.mjGEOM_PLANE)]
    moving_geoms = [i for i in geoms if model.geom_bodyid[i]]
    fixed_geoms = [i for i in geoms if not model.geom_bodyid[i]]

    def corners_at(angles: np.ndarray) -> list[np.ndarray]:
        data.qpos[:] = angles
        mujoco.mj_kinematics(model, data)
        return [_corners(model, data, i) for i in moving_geoms]

    first = corners_at(plant.new_data().qpos)
    if not first:
        mujoco.mj_comPos(model, data)
        return Ball(data.subtree_com[0].copy(), float(model.stat.extent))
    first_ball = _enclose(first)
    near_boxes = [box for box in (_corners(model, data, i) for i in fixed_geoms) if _is_within(box, first_ball)]
    poses = qpos[np.isfinite(qpos).all(axis=1)]
    poses = poses[np.unique(np.linspace(0, max(len(poses) - 1, 0), POSES).astype(int))] if len(poses) else poses
    ball = _enclose([*first, *near_boxes, *(corners for angles in poses for corners in corners_at(angles))])
    return ball if ball.radius < FARTHEST * first_ball.radius else _enclose([*first, *near_boxes])


def _corners(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> np.ndarray:
    """Return the corners of a geom's box in the world, (8, 3) [m]."""
    centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
    return data.geom_xpos[geom] + (centre + half * CORNERS) @ data.geom_xmat[geom].reshape(3, 3).T


def _enclose(points: list[np.ndarray]) -> Ball:
    all_points = np.concatenate(points)
    centre = (all_points.min(axis=0) + all_points.max(axis=0)) / 2.0
    return Ball(centre, float(np.linalg.norm(all_points - centre, axis=1).max()))


def _is_within(points: np.ndarray, rig: Ball) -> bool:
    """Return whether a geom is near enough to a rig to be a part of it."""
    return bool(np.linalg.norm(points - rig.centre, axis=1).max() < FARTHEST * rig.radius)


def drawn_shapes(model: mujoco.MjModel, radius: float) -> Iterator[tuple[int, str, Shape]]:
    """Convert all geoms and sites that MuJoCo draws.

    Args:
        model: The model.
        radius: Radius of the rig, the scale of a plane's tiles [m].

    Yields:
        The body's index, the name, the shape in the body's frame.
    """
    for i in range(model.ngeom):
        rgba = geom_rgba(model, i)
        if is_drawn(model.geom_group[i], rgba):
            name = model.geom(i).name or f"geom{i}"
            place = (model.geom_size[i], model.geom_pos[i], model.geom_quat[i])
            yield int(model.geom_bodyid[i]), name, _shape(model, i, int(model.geom_type[i]), *place, rgba, radius)
    for i in range(model.nsite):
        if is_drawn(model.site_group[i], model.site_rgba[i]):
            name = f"site/{model.site(i).name or i}"
            place = (model.site_size[i], model.site_pos[i], model.site_quat[i])
            kind, rgba = int(model.site_type[i]), model.site_rgba[i]
            yield int(model.site_bodyid[i]), name, _shape(model, None, kind, *place, rgba, radius)


def _shape(
    model: mujoco.MjModel,
    geom: int | None,
    kind: int,
    size: np.ndarray,
    position: np.ndarray,
    wxyz: np.ndarray,
    rgba: np.ndarray,
    radius: float,
) -> Shape:
    """Convert one shape, in the body's frame."""
    rotation = _matrix(wxyz)
    color = tuple(round(255.0 * c) for c in rgba.tolist())
    style: dict[str, Any] = {"colors": [color], "quaternions": [np.roll(wxyz, -1)]}
    solid = {**style, "fill_mode": rr.components.FillMode.Solid}
    if kind == int(_Type.mjGEOM_CAPSULE):
        # MuJoCo's capsule is centred, rerun's stands on its start.
        start = position - rotation[:, 2] * size[1]
        return rr.Capsules3D(lengths=[2.0 * size[1]], radii=[size[0]], translations=[start], **solid)
    if kind == int(_Type.mjGEOM_CYLINDER):
        return rr.Cylinders3D(lengths=[2.0 * size[1]], radii=[size[0]], centers=[position], **solid)
    if kind == int(_Type.mjGEOM_BOX):
        return rr.Boxes3D(half_sizes=[size], centers=[position], **solid)
    if kind in (int(_Type.mjGEOM_SPHERE), int(_Type.mjGEOM_ELLIPSOID)):
        half_sizes = size if kind == int(_Type.mjGEOM_ELLIPSOID) else np.full(3, size[0])
        return rr.Ellipsoids3D(half_sizes=[half_sizes], centers=[position], **solid)
    if kind == int(_Type.mjGEOM_PLANE):
        return _tiles(size, position, rotation, radius)
    if kind == int(_Type.mjGEOM_MESH) and geom is not None:
        vertices, faces = _mesh(model, int(model.geom_dataid[geom]))
        return rr.Mesh3D(vertex_positions=vertices @ rotation.T + position, triangle_indices=faces, albedo_factor=color)
    # A height field or a signed distance field: its bounding box.
    box = model.geom_aabb[geom]
    return rr.Boxes3D(half_sizes=[box[3:]], centers=[position + rotation @ box[:3]], **style)


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[np.ndarray, np.ndarray]:
    vertex, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    return (
        model.mesh_vert[vertex : vertex + model.mesh_vertnum[mesh]],
        model.mesh_face[face : face + model.mesh_facenum[mesh]],
    )


def _tiles(size: np.ndarray, position: np.ndarray, rotation: np.ndarray, radius: float) -> rr.Mesh3D:
    """Convert a plane to a chequered mesh; lines or textures would flicker or blur."""
    half = np.where(size[:2] > 0.0, size[:2], INFINITE_PLANE * radius)
    count = np.clip(np.ceil(2.0 * half / (TILE * radius)), 1, MOST_TILES).astype(int)
    i, j = (index.ravel() for index in np.meshgrid(*map(np.arange, count), indexing="ij"))
    corners = np.stack([i, j], axis=1)[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    flat = (corners / count * 2.0 - 1.0) * half
    vertices = np.concatenate([flat, np.zeros((*flat.shape[:2], 1))], axis=2).reshape(-1, 3)
    triangles = (4 * np.arange(len(i)))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    colors = np.repeat(np.array(TILE_COLORS, np.uint8)[(i + j) % 2], 4, axis=0)
    return rr.Mesh3D(
        vertex_positions=vertices @ rotation.T + position,
        triangle_indices=triangles.reshape(-1, 3),
        vertex_colors=colors,
    )


def _matrix(wxyz: np.ndarray) -> np.ndarray:
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, wxyz.astype(float))
    return matrix.reshape(3, 3)


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
