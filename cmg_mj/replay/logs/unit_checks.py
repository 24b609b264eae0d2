"""Accelerations in a wrong unit or with a wrong sign: gravity, and the tilt's second derivative, say so.

Whatever the motion, r_outer/(r_outer - r_inner) times the inner specific force less r_inner/(r_outer - r_inner) times
the outer one is gravity alone: where its size is right, large specific forces are motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmg_mj.replay.logs.columns import Column
from cmg_mj.replay.logs.tilt_acceleration import second_derivative_pairs
from cmg_mj.replay.logs.units import in_si, unit_of_factor
from cmg_mj.sensors.accelerometer import STANDARD_GRAVITY
from cmg_mj.sensors.tilt import RadialTilt

NEAR = (0.7, 1.4)
"""What is so many times as large as it should be is taken for right."""
GRAVITY_ALONE = 0.1
"""So far gravity from both accelerometers may be off while large specific forces count as motion."""
SURE = 0.9
"""Acceleration and second derivative must correlate so far, either way, before anything is said."""
CLEAR = (0.4, 2.5)
"""Between these the ratio of their sizes may be the tilt's noise. What its own noise makes a loop do is not independent
of it: of bundled runs the ratio is up to 2.1 at a correlation of 0.84."""


def of_gravity(found: Mapping[str, Column], raw: Mapping[str, np.ndarray], places: RadialTilt) -> str | None:
    """A word on accelerometers that do not show gravity's size.

    Args:
        found: The columns.
        raw: Specific forces of `inner_x` to `outer_z`, (n,) [m/s^2].
        places: Where they are.

    Returns:
        None if they do.
    """
    sizes = {}
    for name in ("inner", "outer"):
        force = np.hypot(raw[f"{name}_x"], raw[f"{name}_z"])
        known = force[np.isfinite(force)]
        sizes[name] = float(np.median(known)) / STANDARD_GRAVITY if len(known) else 1.0
    off = {name: size for name, size in sizes.items() if size > 0.0 and not NEAR[0] <= size <= NEAR[1]}
    gravity = np.hypot(*places.gravity(*(raw[f"{name}_{axis}"] for name in sizes for axis in "xz")))
    gravity = gravity[np.isfinite(gravity)]
    right = len(gravity) and abs(float(np.median(gravity)) / STANDARD_GRAVITY - 1.0) <= GRAVITY_ALONE
    if not off or right:
        return None
    names = " and ".join(off)
    shown = " and ".join(f"{size:.4g}" for size in off.values())
    units, scales = [], []
    for name, size in off.items():
        for role in (f"{name}_x", f"{name}_z"):
            column = found[role]
            scale = column.factor / in_si("acceleration", column.unit)
            units.append((role, unit_of_factor("acceleration", column.unit, 1.0 / size, NEAR)))
            scales.append(f"{role}={scale / size:.4g}")
    cure = "--scale " + ",".join(scales)
    if all(unit for _, unit in units):
        cure = "--units " + ",".join(f"{role}={unit}" for role, unit in units)
    return f"the {names} accelerometer's specific force is {shown} times gravity's 9.81 m/s^2 (median): {cure}"


def beside_the_tilt(
    tilt: np.ndarray,
    acceleration: np.ndarray,
    parts: Sequence[slice],
    dt: float,
    found: Mapping[str, Column],
) -> str | None:
    """A word on an angular acceleration whose sign or size the tilt's second derivative clearly contradicts.

    Args:
        tilt: y, (n,) [rad].
        acceleration: a, (n,) [rad/s^2].
        parts: Without a gap in between.
        dt: Sample period [s].
        found: The columns.

    Returns:
        None if it agrees, or if that cannot be told.
    """
    compared = second_derivative_pairs(tilt, acceleration, parts, dt)
    if compared is None:
        return None
    a, b = (values - values.mean() for values in compared)
    size = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    agreement = float(np.sum(a * b)) / size if size > 0.0 else 0.0
    if abs(agreement) < SURE:
        return None
    factor = float(np.sqrt(np.sum(b**2) / np.sum(a**2)))
    off = not CLEAR[0] <= factor <= CLEAR[1]
    if agreement > 0.0 and not off:
        return None
    said = ["counts the other way"] if agreement < 0.0 else []
    said += [f"is {1.0 / factor:.3g} times as large"] if off else []
    of_two = "acceleration" not in found
    what = "the angular acceleration" + (" of the two accelerometers" if of_two else "")
    start = f"{what} {' and '.join(said)} beside the tilt's second derivative (correlation {agreement:.2f})"
    if of_two:
        checks = ["--units and --radii (in m)"] if off else []
        checks += ["the signs of their axes (--scale)"] if agreement < 0.0 else []
        return f"{start}: are {' and '.join(checks)} right?"
    column = found["acceleration"]
    scale = column.factor / in_si("angular acceleration", column.unit)
    turned = -1.0 if agreement < 0.0 else 1.0
    other = unit_of_factor("angular acceleration", column.unit, factor, NEAR) if off else None
    if other:
        sign = f" --scale acceleration={scale * turned:g}" if agreement < 0.0 else ""
        return f"{start}: --units acceleration={other}{sign}, if the tilt's unit is right"
    wanted = turned * scale if not off else turned * scale * factor
    return f"{start}: --scale acceleration={wanted:.3g}"
