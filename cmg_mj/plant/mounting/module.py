"""One module (`models/cube.xml`) of any size, as a part to attach."""

from __future__ import annotations

import mujoco
import numpy as np

from cmg_mj.inputs.bundled import folder
from cmg_mj.plant.mjcf import parse

EDGE_M = 0.19
"""Of the module as its file has it; the frame's edges are drawn along it [m]."""


def module(scale: float) -> mujoco.MjSpec:
    """The module, scaled.

    Lengths grow with the scale s; materials and the flywheel's speed stay, so that masses grow with s^3, inertias and
    with them the flywheel's momentum with s^5. The drives' loops keep their time constants, their gains growing as the
    inertias do; the largest torques of servo and motor grow as a drive's mass does, with s^3.

    Args:
        scale: s.

    Returns:
        A part of its own, to be attached once.
    """
    spec = parse(folder("models") / "cube.xml")
    if scale == 1.0:
        return spec
    for body in spec.bodies:
        body.pos = np.asarray(body.pos) * scale
        if body.explicitinertial:
            body.mass *= scale**3
            body.inertia = np.asarray(body.inertia) * scale**5
    for geom in spec.geoms:
        geom.pos, geom.size = np.asarray(geom.pos) * scale, np.asarray(geom.size) * scale
        geom.fromto = np.asarray(geom.fromto) * scale  # NaN where there is none
    for mesh in spec.meshes:
        mesh.scale = np.asarray(mesh.scale) * scale
    for actuator in spec.actuators:
        actuator.gainprm = np.asarray(actuator.gainprm) * scale**5
        actuator.biasprm = np.asarray(actuator.biasprm) * scale**5
        actuator.forcerange = np.asarray(actuator.forcerange) * scale**3
    return spec
