"""The moving mechanism: MuJoCo's geoms as shapes, poses over time, pushes as an arrow, the ball that encloses it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import mujoco
import numpy as np
import rerun as rr

from cmg_mj.plant.plant import Plant
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.view.recording.signals import TIMELINE, Branch, instant, time_column

POSE_RATE_HZ = 100.0
"""Largest rate at which poses are recorded; the eye needs no more."""
FLYWHEEL_SLOWDOWN = 100.0
"""Flywheels are recorded turning this many times slower.

At 314 rad/s a mark on the disc makes half a turn between two poses and seems to stand still.
"""
PUSH_COLOR = (213, 94, 0)
PUSH_LENGTH, PUSH_RADIUS = 0.8, 0.047
"""Length and radius of the strongest push's arrow, in radii of the rig."""
SHOWN_GROUPS = 3
"""Number of groups of geoms and sites that are drawn, as in MuJoCo's viewers."""
INFINITE_PLANE, TILE = 4.0, 0.5
"""Half the edge of an infinite plane, and the edge of its tiles, in radii of the rig."""
MAX_TILES = 200
"""Largest number of tiles along one edge of a plane."""
TILE_COLORS = ((150, 156, 164), (132, 138, 147))
POSES = 25
"""Number of poses of a run that the ball encloses."""
MAX_TRAVEL = 6.0
"""A rig that travels farther than so many radii is shown at its start."""
CORNERS = 2.0 * np.array(list(np.ndindex(2, 2, 2))) - 1.0

_Type = mujoco.mjtGeom


class Ball(NamedTuple):
    """A ball that encloses a rig.

    Attributes:
        centre: Centre, (3,) [m].
        radius: Radius [m].
    """

    centre: np.ndarray
    radius: float


def enclosing_ball(plant: Plant, qpos: np.ndarray) -> Ball:
    """Enclose the part of a plant that a camera must see during a run.

    Args:
        plant: The plant.
        qpos: Joint angles, (n, n_joints) [rad].

    Returns:
        A ball around the moving bodies, at the start and during the run.
    """
    model = plant.drawn_model
    data = mujoco.MjData(model)
    indices = [i for i, *_ in _drawn(model, model.geom, model.ngeom)]
    moving = [i for i in indices if model.geom_bodyid[i] and model.geom_type[i] != int(_Type.mjGEOM_PLANE)]
    if not moving:
        return Ball(model.stat.center.copy(), float(model.stat.extent))
    boxes = model.geom_aabb[moving, None, :3] + model.geom_aabb[moving, None, 3:] * CORNERS

    def enclose(poses: np.ndarray) -> Ball:
        points = []
        for angles in poses:
            data.qpos[:] = angles
            mujoco.mj_kinematics(model, data)
            turned = np.einsum("gij,gcj->gci", data.geom_xmat[moving].reshape(-1, 3, 3), boxes)
            points.append((data.geom_xpos[moving, None] + turned).reshape(-1, 3))
        all_points = np.concatenate(points)
        centre = (all_points.min(axis=0) + all_points.max(axis=0)) / 2.0
        return Ball(centre, float(np.linalg.norm(all_points - centre, axis=1).max()))

    start = plant.new_data().qpos[None]
    poses = qpos[np.isfinite(qpos).all(axis=1)]
    whole = enclose(np.concatenate([start, poses[:: -(-len(poses) // POSES) or 1], poses[-1:]]))
    at_start = enclose(start)
    return whole if whole.radius < MAX_TRAVEL * at_start.radius else at_start


def _drawn(model: mujoco.MjModel, element_of: Any, count: int) -> Iterator[tuple[int, Any, np.ndarray]]:
    """Yield the geoms, or the sites, that MuJoCo draws: number, element, colour."""
    for i in range(count):
        element = element_of(i)
        rgba, material = element.rgba, int(element.matid[0])
        if material >= 0 and np.all(rgba == (0.5, 0.5, 0.5, 1.0)):  # MuJoCo's default
            rgba = model.mat_rgba[material]
        if element.group[0] < SHOWN_GROUPS and rgba[3] > 0.0:
            yield i, element, rgba


def _radius(plant: Plant) -> float:
    """Return the radius of the rig at its start, the scale of arrows and floors [m]."""
    return enclosing_ball(plant, np.empty((0, plant.model.nq))).radius


def log_shapes(rec: rr.RecordingStream, branch: Branch) -> None:
    """Record the plant's shapes: one static entity for each geom and site that MuJoCo draws, under its body."""
    model, radius = branch.plant.drawn_model, _radius(branch.plant)
    shapes = [(geom.name or f"geom{i}", geom, rgba) for i, geom, rgba in _drawn(model, model.geom, model.ngeom)]
    shapes += [(f"site/{site.name or i}", site, rgba) for i, site, rgba in _drawn(model, model.site, model.nsite)]
    for name, element, rgba in shapes:
        path = "/".join(rr.escape_entity_path_part(part) for part in name.split("/"))
        parent = _body_path(branch, int(element.bodyid[0]))
        rec.log(f"{parent}/{path}", _shape(model, element, rgba, radius), static=True)


def _shape(model: mujoco.MjModel, element: Any, rgba: np.ndarray, radius: float) -> rr.AsComponents:
    """Convert a geom or a site, in its body's frame; of a plane, the tiles go by the radius of the rig."""
    kind, size, position = _Type(int(element.type[0])), element.size, element.pos
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, element.quat.astype(float))
    rotation = rotation.reshape(3, 3)
    color = tuple(round(255.0 * c) for c in rgba.tolist())
    style: dict[str, Any] = {"colors": [color], "quaternions": [np.roll(element.quat, -1)]}
    solid = {**style, "fill_mode": rr.components.FillMode.Solid}
    match kind:
        case _Type.mjGEOM_CAPSULE:
            # MuJoCo's capsule is centred, rerun's stands on its start.
            start = position - rotation[:, 2] * size[1]
            return rr.Capsules3D(lengths=[2.0 * size[1]], radii=[size[0]], translations=[start], **solid)
        case _Type.mjGEOM_CYLINDER:
            return rr.Cylinders3D(lengths=[2.0 * size[1]], radii=[size[0]], centers=[position], **solid)
        case _Type.mjGEOM_BOX:
            return rr.Boxes3D(half_sizes=[size], centers=[position], **solid)
        case _Type.mjGEOM_SPHERE:
            return rr.Ellipsoids3D(half_sizes=[np.full(3, size[0])], centers=[position], **solid)
        case _Type.mjGEOM_ELLIPSOID:
            return rr.Ellipsoids3D(half_sizes=[size], centers=[position], **solid)
        case _Type.mjGEOM_PLANE:
            return _tiles(size, position, rotation, radius)
        case _Type.mjGEOM_MESH:
            mesh = model.mesh(int(element.dataid[0]))
            vertices = model.mesh_vert[mesh.vertadr[0] :][: mesh.vertnum[0]] @ rotation.T + position
            faces = model.mesh_face[mesh.faceadr[0] :][: mesh.facenum[0]]
            return rr.Mesh3D(vertex_positions=vertices, triangle_indices=faces, albedo_factor=color)
        case _:  # a height field or a signed distance field: its bounding box
            centre, half_sizes = np.split(element.aabb, 2)
            return rr.Boxes3D(half_sizes=[half_sizes], centers=[position + rotation @ centre], **style)


def _tiles(size: np.ndarray, position: np.ndarray, rotation: np.ndarray, radius: float) -> rr.Mesh3D:
    """Convert a plane to a chequered mesh; lines or textures would flicker or blur."""
    half = np.where(size[:2] > 0.0, size[:2], INFINITE_PLANE * radius)
    count = np.clip(np.ceil(2.0 * half / (TILE * radius)), 1, MAX_TILES).astype(int)
    tiles = np.array(list(np.ndindex(*count)))
    corners = tiles[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    flat = ((corners / count * 2.0 - 1.0) * half).reshape(-1, 2)
    triangles = (4 * np.arange(len(tiles)))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return rr.Mesh3D(
        vertex_positions=flat @ rotation[:, :2].T + position,
        triangle_indices=triangles.reshape(-1, 3),
        vertex_colors=np.repeat(np.array(TILE_COLORS, np.uint8)[tiles.sum(axis=1) % 2], 4, axis=0),
    )


def recorded_poses(plant: Plant, trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Choose the poses that are recorded; the initial pose, if the run has no tick.

    Returns:
        Times, (n_poses,) [s], and joint angles, (n_poses, n_joints) [rad].
    """
    n = len(trajectory)
    if n == 0:
        return np.zeros(1), plant.new_data().qpos[None].copy()
    time = trajectory["time_s"]
    stride = max(1, round(1.0 / (POSE_RATE_HZ * (time[1] - time[0])))) if n > 1 else 1
    ticks = np.union1d(np.arange(0, n, stride), n - 1)
    return time[ticks], trajectory.qpos(ticks)


def log_poses(rec: rr.RecordingStream, branch: Branch) -> None:
    """Record poses of all bodies under `<branch>/rig`, the flywheels slowed."""
    model = branch.plant.model
    time, qpos = recorded_poses(branch.plant, branch.run.trajectory)
    times, data = time_column(time), mujoco.MjData(model)
    qpos[:, [module.flywheel for module in branch.plant.axis.modules]] /= FLYWHEEL_SLOWDOWN
    poses = np.empty((len(qpos), model.nbody, 7))
    for k, angles in enumerate(qpos):
        data.qpos[:] = angles
        mujoco.mj_kinematics(model, data)
        poses[k] = np.hstack([data.xpos, data.xquat])
    for body in range(1, model.nbody):
        place, quaternion = np.split(poses[:, body], [3], axis=1)
        pose = rr.Transform3D.columns(translation=place, quaternion=np.roll(quaternion, -1, axis=1))
        rec.send_columns(_body_path(branch, body), [times], pose)


def _body_path(branch: Branch, body: int) -> str:
    """Name a body's entity: `cube1/gimbal` is `cube1.gimbal`, flat under the rig, as poses are in the world's frame."""
    name = branch.plant.model.body(body).name or f"body{body}"
    return f"{branch.path}/rig/{rr.escape_entity_path_part(name.replace('/', '.'))}"


def log_pushes(rec: rr.RecordingStream, branch: Branch) -> None:
    """Record an arrow on the frame's upper edge that shows a push as the force of a hand, while the push lasts."""
    path, pushes = f"{_body_path(branch, branch.plant.axis.frame)}/push", branch.pushes
    (tip, direction), radius = _edge(branch.plant), _radius(branch.plant)
    edges = sorted({time for push in pushes for time in (push.start_s, push.end_s)})
    torques = {t: sum(p.torque_n_m for p in pushes if p.start_s <= t < p.end_s) for t in edges}
    largest = max(map(abs, torques.values()), default=0.0)
    for time, torque in torques.items():
        if time >= branch.run.outcome.time_s:
            break
        rec.set_time(TIMELINE, duration=instant(time))
        if abs(torque) <= 1e-9 * largest:
            rec.log(path, rr.Clear(recursive=False))
            continue
        force = direction * (PUSH_LENGTH * radius * torque / largest)
        style = {"radii": [PUSH_RADIUS * radius], "colors": [PUSH_COLOR], "labels": [f"push {torque:+.3g} N m"]}
        rec.log(path, rr.Arrows3D(vectors=[force], origins=[tip - force], **style))
    rec.reset_time()


def _edge(plant: Plant) -> tuple[np.ndarray, np.ndarray]:
    """Find the frame's upper edge on the radial line, and its motion under a positive torque, in the frame's axes."""
    model = plant.drawn_model
    anchor, up = plant.axis.point, plant.axis.up
    places = [
        model.site_pos[model.site_bodyid == plant.axis.frame],
        model.geom_pos[model.geom_bodyid == plant.axis.frame],
    ]
    height = float(np.max((np.concatenate(places) - anchor) @ up))
    return anchor + up * height, np.cross(plant.axis.direction, up)
