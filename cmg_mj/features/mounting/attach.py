"""The elements that mounting adds to a body: the modules, sites and sensors of one axis, and their room."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.inputs.files import folder
from cmg_mj.plant.elements import SENSORS, TILT_ELEMENT
from cmg_mj.plant.mjcf import parse
from cmg_mj.plant.tilt_line import UP

EDGE_M = 0.19
"""Edge of the module in `models/cube.xml` [m]."""
INNER, OUTER = 0.25, 0.75
"""Places of the accelerometers, in shares of the robot's height above the line, as on the papers' rig."""
ALWAYS_ON = 31
"""A group of actuators that no `actuatorgroupdisable` can name."""
SAME_WAY = 1e-9
"""Two orientations are the same if the cosine of half the angle between them is this near 1 (0.005 deg)."""


def scaled_module(scale: float) -> mujoco.MjSpec:
    """Read one module (`models/cube.xml`) and scale it.

    Lengths grow with the scale s; materials and the flywheel's speed stay, so that masses grow with s^3, inertias and
    with them the flywheel's momentum with s^5. The drives' loops keep their time constants, their gains growing as the
    inertias do; the largest torques of servo and motor grow as a drive's mass does, with s^3.

    Args:
        scale: The scale s.

    Returns:
        A model to attach once.
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


def attach_modules(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, names: Sequence[str], scale: float
) -> list[mujoco.MjsFrame]:
    """Attach modules to a body.

    Args:
        spec: The robot, which is changed.
        body: The body that carries the modules.
        names: Names of the modules.
        scale: Scale of the modules' lengths.

    Returns:
        The frame of each module, to be placed.
    """
    spec.copy_during_attach = False
    mounts = []
    for name in names:
        mounts.append(body.add_frame(name=f"{name}_mount"))
        module = scaled_module(scale)
        if spec.option.disableactuator:
            for actuator in module.actuators:
                actuator.group = ALWAYS_ON
        mounts[-1].attach_body(module.body("half"), f"{name}/", "")
    return mounts


def place_modules(mounts: Sequence[mujoco.MjsFrame], middle: np.ndarray, axes: np.ndarray, scale: float) -> bool:
    """Place modules side by side along the axis.

    Args:
        mounts: The frame of each module, which is moved.
        middle: The middle of the row, in the body's frame [m].
        axes: The line's axes in the body's frame, by columns, (3, 3): gimbals turn about x, the row goes along y.
        scale: Scale of the modules' lengths.

    Returns:
        Whether the modules had this orientation before.
    """
    quaternion = _quaternion(axes)
    unchanged = all(abs(abs(np.asarray(mount.quat) @ quaternion) - 1.0) < SAME_WAY for mount in mounts)
    for i, mount in enumerate(mounts):
        place = (len(mounts) - 1) / 2.0 - i
        mount.pos, mount.quat = middle + axes[:, 1] * place * EDGE_M * scale, quaternion
    return unchanged


def _quaternion(axes: np.ndarray) -> np.ndarray:
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(axes).ravel())
    return quaternion


def add_sensors(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, prefix: str, point: np.ndarray, axes: np.ndarray, height: float
) -> None:
    """Add the accelerometers and the gyro, and the site that marks the line.

    Args:
        spec: The robot, which is changed.
        body: The body that carries the sensors.
        prefix: First part of their names.
        point: A point of the line, under the robot's mass, in the body's frame [m].
        axes: The line's axes in the body's frame, by columns, (3, 3): y along it, z upward.
        height: Height of the robot above the line [m].
    """
    quaternion = _quaternion(axes)
    places = {TILT_ELEMENT: 0.0, "accelerometer_inner": INNER, "accelerometer_outer": OUTER, "fog": OUTER}
    for name, share in places.items():
        site = body.add_site(name=prefix + name, pos=point + axes[:, 2] * share * height, quat=quaternion)
        site.size = np.full(3, 0.01 * height)
        site.rgba = [0.8, 0.1, 0.5, 1.0] if "acc" in name else [0.1, 0.6, 0.6, 1.0]
        site.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT  # a default of the robot's may turn sites otherwise
    for name, kind in SENSORS.items():
        spec.add_sensor(
            name=prefix + name,
            type=getattr(mujoco.mjtSensor, f"mjSENS_{kind.upper()}"),
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            objname=prefix + name,
        )


TOUCH_M = 1e-3
"""Modules may overlap by so much: they stand side by side [m]."""
HALF = "/half"


def check_room(model: mujoco.MjModel, data: mujoco.MjData, modules: Sequence[str], floor: float | None) -> None:
    """Check that modules reach neither below the floor nor into other modules; they may overlap the robot itself.

    Args:
        model: The robot with all its modules.
        data: The same where it stands, after a forward pass.
        modules: Names of the new modules.
        floor: Height of the floor that the robot stands on [m]; None for a robot on a hinge.

    Raises:
        InputError: A module has no room.
    """

    def reach(body: int, normal: np.ndarray) -> float:
        first = model.body_geomadr[body]
        half = np.abs(
            model.geom_pos[first : first + model.body_geomnum[body]]
        ).max()  # the frame's edges lie so far out
        return half * np.abs(normal @ data.xmat[body].reshape(3, 3)).sum()

    new = [model.body(f"{module}{HALF}").id for module in modules]
    lowest = min(data.xpos[body][2] - reach(body, UP) for body in new)
    if floor is not None and lowest < floor - TOUCH_M:
        raise InputError(
            f"no room: the modules reach {floor - lowest:.3g} m below its support; use a smaller --scale, or a higher "
            "--position"
        )
    for other in range(model.nbody):
        name = model.body(other).name
        if not name.endswith(HALF) or other in new:
            continue
        for body in new:
            apart = data.xpos[other] - data.xpos[body]
            normals = np.hstack([data.xmat[body].reshape(3, 3), data.xmat[other].reshape(3, 3)]).T
            if all(abs(normal @ apart) <= reach(body, normal) + reach(other, normal) - TOUCH_M for normal in normals):
                raise InputError(
                    f"no room: the modules overlap {name.removesuffix(HALF)!r}, which is there already; choose another "
                    "--position"
                )
