"""Place and size of a rig: for the camera, and for shapes drawn to the rig's scale."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from cmg_mj.plant.plant import Plant

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
