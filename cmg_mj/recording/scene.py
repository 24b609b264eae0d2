"""The moving mechanism: MuJoCo's geoms as static shapes, body poses over time, the push as an arrow."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import mujoco
import numpy as np
import rerun as rr

from cmg_mj.plant import Cube, Plant
from cmg_mj.push import Push
from cmg_mj.recording.run import Run, torque_steps
from cmg_mj.recording.timeline import TIMELINE, column, instant

POSE_RATE_HZ = 100.0
"""Poses are recorded at most this often; the eye needs no more."""

FLYWHEEL_SLOWDOWN = 100.0
"""Flywheels are drawn turning this many times slower.

At 314 rad/s a mark on the disc makes half a turn between two poses and seems to stand still. The recorded pose of
the flywheel is the true one; its shapes hang from a child entity, `slowed`, that turns them back.
"""

SHOWN_GROUPS = 3
"""Geoms and sites of groups 0 to 2 are drawn, as in MuJoCo's own viewers."""

PUSH_COLOR = (213, 94, 0)
PUSH_LENGTH_M = 0.2
INFINITE_PLANE_M = 1.0
TILE_M = 0.125
TILE_COLORS = ((150, 156, 164), (132, 138, 147))

_Type = mujoco.mjtGeom


def log_rig(rec: rr.RecordingStream, branch: str, plant: Plant, run: Run, pushes: Sequence[Push]) -> None:
    """Record the rig of one run under `<branch>/rig`.

    Args:
        rec: The recording.
        branch: The run's branch.
        plant: The rig.
        run: The run.
        pushes: Torques from outside.
    """
    _log_shapes(rec, branch, plant)
    time, qpos = pose_samples(plant, run)
    positions, quaternions = body_poses(plant, qpos)
    at = column(time)
    for body in range(1, plant.model.nbody):
        poses = rr.Transform3D.columns(translation=positions[:, body], quaternion=quaternions[:, body])
        rec.send_columns(body_path(branch, plant, body), [at], poses)
    for cube in plant.cubes:
        translation, quaternion = _turned_back(plant, cube, qpos)
        poses = rr.Transform3D.columns(translation=translation, quaternion=quaternion)
        rec.send_columns(_slowed_path(branch, plant, cube), [at], poses)
    _log_push(rec, branch, plant, pushes, run.outcome.time_s)


def body_path(branch: str, plant: Plant, body: int) -> str:
    """Entity of a body: flat under the rig, `cube1/gimbal` as `cube1.gimbal`, for poses are in the world's frame."""
    name = plant.model.body(body).name or f"body{body}"
    return f"{branch}/rig/{rr.escape_entity_path_part(name.replace('/', '.'))}"


def pose_samples(plant: Plant, run: Run) -> tuple[np.ndarray, np.ndarray]:
    """The ticks at which poses are recorded; the initial pose, if the run has no tick.

    Args:
        plant: The rig.
        run: The run.

    Returns:
        Times, (n_poses,) [s], and joint angles, (n_poses, n_joints) [rad].
    """
    trajectory = run.trajectory
    n = len(trajectory)
    if n == 0:
        return np.zeros(1), plant.new_data().qpos[None].copy()
    time = trajectory["time_s"]
    stride = max(1, round(1.0 / (POSE_RATE_HZ * (time[1] - time[0])))) if n > 1 else 1
    kept = np.union1d(np.arange(0, n, stride), n - 1)
    return time[kept], trajectory.qpos()[kept]


def body_poses(plant: Plant, qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Poses of all bodies in the world, from MuJoCo's forward kinematics.

    Args:
        plant: The rig.
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


def extent(plant: Plant) -> tuple[np.ndarray, float]:
    """Centre, (3,) [m], and radius [m] of all that is drawn of the rig in its initial pose, floor apart."""
    model = plant.drawn_model
    data = mujoco.MjData(model)
    data.qpos[:] = plant.new_data().qpos
    mujoco.mj_forward(model, data)
    drawn = [i for i in range(model.ngeom) if _is_drawn(model.geom_group[i], _rgba(model, i)) and model.geom_bodyid[i]]
    if not drawn:
        return data.subtree_com[0].copy(), float(model.stat.extent)
    low, high = data.geom_xpos[drawn].min(axis=0), data.geom_xpos[drawn].max(axis=0)
    return (low + high) / 2.0, float(np.linalg.norm(high - low) / 2.0) or float(model.stat.extent)


def _turned_back(plant: Plant, cube: Cube, qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Turn, in the flywheel's own frame, from its true angle to the slowed one: translation and quaternion xyzw."""
    model = plant.model
    axis, anchor = model.jnt_axis[cube.flywheel], model.jnt_pos[cube.flywheel]
    turn = (qpos[:, cube.flywheel] * (1.0 / FLYWHEEL_SLOWDOWN - 1.0))[:, None]
    quaternion = np.concatenate([np.sin(turn / 2.0) * axis, np.cos(turn / 2.0)], axis=1)
    along = axis * (axis @ anchor)
    turned = along + np.cos(turn) * (anchor - along) + np.sin(turn) * np.cross(axis, anchor)
    return anchor - turned, quaternion


def _slowed_path(branch: str, plant: Plant, cube: Cube) -> str:
    return f"{body_path(branch, plant, int(plant.model.jnt_bodyid[cube.flywheel]))}/slowed"


# --- shapes --------------------------------------------------------------------------------------------------


def _log_shapes(rec: rr.RecordingStream, branch: str, plant: Plant) -> None:
    """One static entity a geom and a site, under its body."""
    model = plant.drawn_model
    parents = {body: body_path(branch, plant, body) for body in range(model.nbody)}
    for cube in plant.cubes:
        parents[int(model.jnt_bodyid[cube.flywheel])] = _slowed_path(branch, plant, cube)
    for body, name, shape in shapes(model):
        path = "/".join(rr.escape_entity_path_part(part) for part in name.split("/"))
        rec.log(f"{parents[body]}/{path}", shape, static=True)


def shapes(model: mujoco.MjModel) -> Iterator[tuple[int, str, Any]]:
    """Body, name and shape of all that MuJoCo draws."""
    for i in range(model.ngeom):
        rgba = _rgba(model, i)
        if _is_drawn(model.geom_group[i], rgba):
            name = model.geom(i).name or f"geom{i}"
            place = (model.geom_size[i], model.geom_pos[i], model.geom_quat[i])
            yield int(model.geom_bodyid[i]), name, _shape(model, i, int(model.geom_type[i]), *place, rgba)
    for i in range(model.nsite):
        if _is_drawn(model.site_group[i], model.site_rgba[i]):
            name = f"site/{model.site(i).name or i}"
            place = (model.site_size[i], model.site_pos[i], model.site_quat[i])
            yield (
                int(model.site_bodyid[i]),
                name,
                _shape(model, None, int(model.site_type[i]), *place, model.site_rgba[i]),
            )


def _is_drawn(group: int, rgba: np.ndarray) -> bool:
    return group < SHOWN_GROUPS and rgba[3] > 0.0


def _rgba(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """A geom's colour: its own, or its material's if it has none of its own."""
    own, material = model.geom_rgba[geom], model.geom_matid[geom]
    return model.mat_rgba[material] if material >= 0 and np.all(own == (0.5, 0.5, 0.5, 1.0)) else own


def _shape(
    model: mujoco.MjModel,
    geom: int | None,
    kind: int,
    size: np.ndarray,
    position: np.ndarray,
    wxyz: np.ndarray,
    rgba: np.ndarray,
) -> Any:
    """MuJoCo's shape as rerun's, in the body's frame."""
    rotation = _matrix(wxyz)
    color = tuple(round(255.0 * c) for c in rgba.tolist())
    looks: dict[str, Any] = {"colors": [color], "quaternions": [np.roll(wxyz, -1)]}
    solid: dict[str, Any] = {"fill_mode": rr.components.FillMode.Solid}
    if kind == int(_Type.mjGEOM_CAPSULE):
        # MuJoCo's capsule is centred, rerun's stands on its start.
        start = position - rotation[:, 2] * size[1]
        return rr.Capsules3D(lengths=[2.0 * size[1]], radii=[size[0]], translations=[start], **looks, **solid)
    if kind == int(_Type.mjGEOM_CYLINDER):
        return rr.Cylinders3D(lengths=[2.0 * size[1]], radii=[size[0]], centers=[position], **looks, **solid)
    if kind == int(_Type.mjGEOM_BOX):
        return rr.Boxes3D(half_sizes=[size], centers=[position], **looks, **solid)
    if kind in (int(_Type.mjGEOM_SPHERE), int(_Type.mjGEOM_ELLIPSOID)):
        half_sizes = size if kind == int(_Type.mjGEOM_ELLIPSOID) else np.full(3, size[0])
        return rr.Ellipsoids3D(half_sizes=[half_sizes], centers=[position], **looks, **solid)
    if kind == int(_Type.mjGEOM_PLANE):
        return _tiles(size, position, rotation)
    if kind == int(_Type.mjGEOM_MESH) and geom is not None:
        vertices, faces = _mesh(model, int(model.geom_dataid[geom]))
        return rr.Mesh3D(vertex_positions=vertices @ rotation.T + position, triangle_indices=faces, albedo_factor=color)
    # A height field or a signed distance field: its bounding box.
    box = model.geom_aabb[geom]
    return rr.Boxes3D(half_sizes=[box[3:]], centers=[position + rotation @ box[:3]], **looks)


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[np.ndarray, np.ndarray]:
    vertex, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    return (
        model.mesh_vert[vertex : vertex + model.mesh_vertnum[mesh]],
        model.mesh_face[face : face + model.mesh_facenum[mesh]],
    )


def _tiles(size: np.ndarray, position: np.ndarray, rotation: np.ndarray) -> Any:
    """A plane as a chequered mesh: lines and textures would fight or blur."""
    half = np.where(size[:2] > 0.0, size[:2], INFINITE_PLANE_M)
    count = np.maximum(1, np.ceil(2.0 * half / TILE_M)).astype(int)
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


# --- the push ------------------------------------------------------------------------------------------------


def _log_push(rec: rr.RecordingStream, branch: str, plant: Plant, pushes: Sequence[Push], end_s: float) -> None:
    """An arrow on the frame's upper edge that shows the torque as the force of a hand, while it lasts."""
    path = f"{body_path(branch, plant, plant.frame)}/push"
    steps = torque_steps(pushes, end_s)
    strongest = max((abs(torque) for _, torque in steps), default=0.0)
    tip, direction = _edge(plant)
    for time, torque in steps:
        rec.set_time(TIMELINE, duration=instant(time))
        if abs(torque) <= 1e-9 * strongest:
            rec.log(path, rr.Clear(recursive=False))
            continue
        vector = direction * (PUSH_LENGTH_M * torque / strongest)
        label = f"push {torque:+.3g} N m"
        rec.log(
            path,
            rr.Arrows3D(vectors=[vector], origins=[tip - vector], radii=[0.012], colors=[PUSH_COLOR], labels=[label]),
        )
    rec.reset_time()


def _edge(plant: Plant) -> tuple[np.ndarray, np.ndarray]:
    """The frame's upper edge on the radial line, and where a positive torque moves it, both in the frame's axes."""
    model = plant.drawn_model
    axis, anchor = model.jnt_axis[plant.tilt], model.jnt_pos[plant.tilt]
    site = model.site_pos[model.sensor("accelerometer_outer").objid[0]] - anchor
    radial = site - axis * (axis @ site)
    distance = float(np.linalg.norm(radial))
    radial = radial / distance
    own = model.geom_bodyid == plant.frame
    height = max([distance, *((model.geom_pos[own] - anchor) @ radial).tolist()])
    return anchor + radial * height, np.cross(axis, radial)
