"""What a pair brings to a body: its modules, the sites and the sensors of one axis."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from cmg_mj.plant.mounting.module import EDGE_M, module
from cmg_mj.plant.parts import SENSORS, TILT_ELEMENT

INNER, OUTER = 0.25, 0.75
"""Where the accelerometers sit, between the line and the robot's highest point above it, as on the papers' rig."""
SAME_WAY = 1e-9
"""Two turns whose cosine of half their angle is so near 1 are the same: 0.005 deg."""


def cube_names(prefix: str, cubes: int) -> list[str]:
    """What the modules of an axis are called."""
    return [f"{prefix}cube{i + 1}" for i in range(cubes)]


def site_names(prefix: str) -> dict[str, str]:
    """What the sites of an axis are called: the line's, and that of each sensor, which bears its name."""
    return {name: prefix + name for name in (TILT_ELEMENT, *SENSORS)}


def attach_cubes(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, names: Sequence[str], scale: float
) -> list[mujoco.MjsFrame]:
    """Attach modules to a body.

    Args:
        spec: The robot, which is changed.
        body: The body that carries them.
        names: Of the modules.
        scale: Of the modules.

    Returns:
        What each hangs on, to be placed.
    """
    spec.copy_during_attach = False
    mounts = []
    for name in names:
        mounts.append(body.add_frame(name=f"{name}_mount"))
        mounts[-1].attach_body(module(scale).body("half"), f"{name}/", "")
    return mounts


def place_cubes(mounts: Sequence[mujoco.MjsFrame], at: np.ndarray, axes: np.ndarray, scale: float) -> bool:
    """Place modules side by side along the axis.

    Args:
        mounts: What each hangs on, which is moved.
        at: The middle of the row, in the body's frame [m].
        axes: The line's axes in the body's frame, by columns, (3, 3): gimbals turn about x, the row goes along y.
        scale: Of the modules.

    Returns:
        Whether they stood so already.
    """
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(axes).ravel())
    stood = all(abs(abs(float(np.asarray(mount.quat) @ quaternion)) - 1.0) < SAME_WAY for mount in mounts)
    for i, mount in enumerate(mounts):
        place = (len(mounts) - 1) / 2.0 - i
        mount.pos, mount.quat = at + axes[:, 1] * place * EDGE_M * scale, quaternion
    return stood


def add_sensors(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, prefix: str, point: np.ndarray, axes: np.ndarray, height: float
) -> None:
    """Add the accelerometers and the gyro, and the site that marks the line.

    Args:
        spec: The robot, which is changed.
        body: The body that carries them.
        prefix: Of their names.
        point: A point of the line, under the robot's mass, in the body's frame [m].
        axes: The line's axes in the body's frame, by columns, (3, 3): y along it, z upward.
        height: Of the robot above the line [m].
    """
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(axes).ravel())
    names = site_names(prefix)
    places = {TILT_ELEMENT: 0.0, "accelerometer_inner": INNER, "accelerometer_outer": OUTER, "fog": OUTER}
    for name, share in places.items():
        size = 0.01 * height
        spot = {"size": [size, size, size], "rgba": [0.8, 0.1, 0.5, 1.0] if "acc" in name else [0.1, 0.6, 0.6, 1.0]}
        site = body.add_site(name=names[name], pos=point + axes[:, 2] * share * height, quat=quaternion, **spot)
        site.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT  # a default of the robot's may turn sites otherwise
    for name, kind in SENSORS.items():
        spec.add_sensor(
            name=names[name],
            type=getattr(mujoco.mjtSensor, f"mjSENS_{kind.upper()}"),
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            objname=names[name],
        )
