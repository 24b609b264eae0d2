"""Converts MuJoCo's geoms and sites to rerun's shapes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypedDict

import mujoco
import numpy as np
import rerun as rr

from cmg_mj.visualization.recording.camera import geom_rgba, is_drawn

INFINITE_PLANE, TILE = 4.0, 0.5
"""Half the edge of an infinite plane, and the edge of its tiles, in radii of the rig."""

MOST_TILES = 200
"""Largest number of tiles along one edge of a plane."""

TILE_COLORS = ((150, 156, 164), (132, 138, 147))

_Type = mujoco.mjtGeom

Shape = rr.Capsules3D | rr.Cylinders3D | rr.Boxes3D | rr.Ellipsoids3D | rr.Mesh3D


class ShapeStyle(TypedDict):
    """Colour and orientation of a shape."""

    colors: list[tuple[int, ...]]
    quaternions: list[np.ndarray]


class Solid(ShapeStyle):
    """Colour and orientation of a shape with filled faces."""

    fill_mode: rr.components.FillMode


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
    style: ShapeStyle = {"colors": [color], "quaternions": [np.roll(wxyz, -1)]}
    solid: Solid = {**style, "fill_mode": rr.components.FillMode.Solid}
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
