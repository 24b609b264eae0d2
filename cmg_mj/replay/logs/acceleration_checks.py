"""Accelerations checked against gravity and against the tilt's second derivative.

Whatever the motion, r_outer/(r_outer - r_inner) times the inner specific force less r_inner/(r_outer - r_inner) times
the outer one is gravity alone: where its size is right, large specific forces are motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cmg_mj.core.tilt import RadialTilt
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.replay.logs.columns import Column
from cmg_mj.replay.logs.units import in_si, unit_of_factor

NEAR = (0.7, 1.4)
"""A size is plausible if it is within these factors of the right one."""
GRAVITY_ALONE = 0.1
"""Relative deviation of gravity from both accelerometers up to which large specific forces count as motion."""
SURE = 0.9
"""Correlation of acceleration and second derivative, either way, from which a deviation is reported."""
CLEAR_RATIOS = (0.4, 2.5)
"""Between these, the ratio of the two sizes may be due to the tilt's noise, to which a loop responds: in bundled runs
the ratio is up to 2.1 at a correlation of 0.84."""
CLEARLY_SWAPPED = 0.5
"""Agreement of exchanged accelerometers, where 1 is equality, from which they count as swapped."""
SWAPPED = (
    "the tilt turns against the angular acceleration of the two accelerometers, and with it if they change places: are "
    "inner and outer interchanged?"
)
WIDTH_S = 0.25
"""Length of a stretch for the tilt's second derivative [s], of at least `FEWEST_SAMPLES` samples."""
FEWEST_SAMPLES = 12
FEWEST = 20
"""Fewest stretches for a comparison."""


@dataclass(frozen=True)
class TiltMotion:
    """The tilt and the angular acceleration of a log.

    Attributes:
        tilt: y, (n,) [rad].
        acceleration: a, (n,) [rad/s^2].
        parts: Slices without a gap.
        dt: Sample period [s].
    """

    tilt: np.ndarray
    acceleration: np.ndarray
    parts: Sequence[slice]
    dt: float

    def second_derivative_pairs(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Weight the acceleration and the tilt's second derivative over stretches.

        The weights w = (1 - s^2)^4 end smoothly: with b = sum(y w'') and a = sum(a w) no noisy samples are subtracted.

        Returns:
            Weighted sums of a and of y'', (n_stretches,); None for fewer than `FEWEST` stretches.
        """
        a, b = self.weighted_sums()
        return (a, b) if len(a) >= FEWEST else None

    @property
    def half(self) -> int:
        """Number of samples on either side of a stretch's middle."""
        return max(FEWEST_SAMPLES // 2, round(WIDTH_S / 2.0 / self.dt))

    @staticmethod
    def weights(half: int, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the weights w and their second derivative w'', (2 half + 1,)."""
        s = np.arange(-half, half + 1) / (half + 1.0)
        second = 8.0 * (1.0 - s**2) ** 2 * (7.0 * s**2 - 1.0) / ((half + 1.0) * dt) ** 2
        return (1.0 - s**2) ** 4, second - second.mean()

    def weighted_sums(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the sums of `second_derivative_pairs`, however few."""
        half = self.half
        weights, second = self.weights(half, self.dt)
        smoothed, derived = [], []
        for part in self.parts:
            if part.stop - part.start >= len(weights):
                smoothed.append(np.convolve(self.acceleration[part], weights, mode="valid")[::half])
                derived.append(np.convolve(self.tilt[part], second, mode="valid")[::half])
        a, b = (np.concatenate(rows) if rows else np.zeros(0) for rows in (smoothed, derived))
        return a, b


def implausible_acceleration(
    columns: Mapping[str, Column],
    signals: Mapping[str, np.ndarray],
    motion: TiltMotion,
    places: RadialTilt | None,
) -> list[str]:
    """Describe an acceleration that cannot be; of several mistakes with one cause, only the first.

    Args:
        columns: Role -> column.
        signals: Role -> values in SI units, (n_rows,).
        motion: Tilt and angular acceleration.
        places: Geometry of the accelerometers, if they measure the tilt.

    Returns:
        A line, or none.
    """
    if places is not None:
        message = gravity_mismatch(columns, signals, places)
        if message or interchanged(motion, places):
            return [message or SWAPPED]
    message = second_derivative_mismatch(motion, columns)
    return [message] if message else []


def gravity_mismatch(
    columns: Mapping[str, Column], signals: Mapping[str, np.ndarray], places: RadialTilt
) -> str | None:
    """Describe accelerometers that do not show gravity's size.

    Args:
        columns: Role -> column.
        signals: Specific forces of `inner_x` to `outer_z`, (n,) [m/s^2].
        places: Geometry of the accelerometers.

    Returns:
        The deviation and a cure; None if there is no deviation.
    """
    sizes = {}
    for name in ("inner", "outer"):
        force = np.hypot(signals[f"{name}_x"], signals[f"{name}_z"])
        known = force[np.isfinite(force)]
        sizes[name] = float(np.median(known)) / STANDARD_GRAVITY if len(known) else 1.0
    off = {name: size for name, size in sizes.items() if size > 0.0 and not NEAR[0] <= size <= NEAR[1]}
    gravity = np.hypot(*places.gravity(*(signals[f"{name}_{axis}"] for name in sizes for axis in "xz")))
    gravity = gravity[np.isfinite(gravity)]
    right = len(gravity) and abs(float(np.median(gravity)) / STANDARD_GRAVITY - 1.0) <= GRAVITY_ALONE
    if not off or right:
        return None
    names = " and ".join(off)
    sizes_text = " and ".join(f"{size:.4g}" for size in off.values())
    roles = {f"{name}_{axis}": size for name, size in off.items() for axis in "xz"}
    cure = cure_of_size(columns, roles)
    return f"the {names} accelerometer's specific force is {sizes_text} times gravity's 9.81 m/s^2 (median): {cure}"


def cure_of_size(columns: Mapping[str, Column], sizes: Mapping[str, float]) -> str:
    """Return the options that give specific forces of a wrong size gravity's: units if all have one, else scales.

    Args:
        columns: Role -> column.
        sizes: Role -> its specific force's size, by gravity's.
    """
    units, scales = [], []
    for role, size in sizes.items():
        column = columns[role]
        scale = column.factor / in_si("acceleration", column.unit)
        units.append((role, unit_of_factor("acceleration", column.unit, 1.0 / size, NEAR)))
        scales.append(f"{role}={scale / size:.4g}")
    if all(unit for _, unit in units):
        return "--units " + ",".join(f"{role}={unit}" for role, unit in units)
    return "--scale " + ",".join(scales)


def second_derivative_mismatch(motion: TiltMotion, columns: Mapping[str, Column]) -> str | None:
    """Describe an angular acceleration whose sign or size the tilt's second derivative clearly contradicts.

    Args:
        motion: Tilt and angular acceleration.
        columns: Role -> column.

    Returns:
        The deviation and a cure; None if there is none, or none that is clear.
    """
    compared = motion.second_derivative_pairs()
    if compared is None:
        return None
    a, b = (values - values.mean() for values in compared)
    size = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    agreement = float(np.sum(a * b)) / size if size > 0.0 else 0.0
    if abs(agreement) < SURE:
        return None
    factor = float(np.sqrt(np.sum(b**2) / np.sum(a**2)))
    off = not CLEAR_RATIOS[0] <= factor <= CLEAR_RATIOS[1]
    if agreement > 0.0 and not off:
        return None
    deviations = ["counts the other way"] if agreement < 0.0 else []
    deviations += [f"is {1.0 / factor:.3g} times as large"] if off else []
    two_sensors = "acceleration" not in columns
    what = "the angular acceleration" + (" of the two accelerometers" if two_sensors else "")
    start = f"{what} {' and '.join(deviations)} beside the tilt's second derivative (correlation {agreement:.2f})"
    if two_sensors:
        checks = ["--units and --radii (in m)"] if off else []
        checks += ["the signs of their axes (--scale)"] if agreement < 0.0 else []
        return f"{start}: are {' and '.join(checks)} right?"
    column = columns["acceleration"]
    scale = column.factor / in_si("angular acceleration", column.unit)
    turned = -1.0 if agreement < 0.0 else 1.0
    other = unit_of_factor("angular acceleration", column.unit, factor, NEAR) if off else None
    if other:
        sign = f" --scale acceleration={scale * turned:g}" if agreement < 0.0 else ""
        return f"{start}: --units acceleration={other}{sign}, if the tilt's unit is right"
    wanted = turned * scale if not off else turned * scale * factor
    return f"{start}: --scale acceleration={wanted:.3g}"


def interchanged(motion: TiltMotion, places: RadialTilt) -> bool:
    """Return whether the data clearly show that the two accelerometers are interchanged.

    With a = (x_outer - x_inner) / (r_outer - r_inner) the angular acceleration and y the tilt, y'' = a. Interchanged
    columns give a the other sign, and gravity's tangential part is g sin y - (r_inner + r_outer) y'' instead of
    g sin y. But for the square of the rate

        a -> -a,    y -> y - asin((r_inner + r_outer) a cos(y) / g)

    reverses both. The noise is the same either way. In violent swings (30 degrees at 2 Hz) the square of the rate
    counts, and the result is False.

    Args:
        motion: Tilt and angular acceleration.
        places: Geometry of the accelerometers as given.
    """
    share = (places.r_inner + places.r_outer) / STANDARD_GRAVITY * motion.acceleration * np.cos(motion.tilt)
    tilt = motion.tilt - np.arcsin(np.clip(share, -1.0, 1.0))
    as_named, turned = _agreement(motion), _agreement(replace(motion, tilt=tilt, acceleration=-motion.acceleration))
    return as_named is not None and turned is not None and as_named < 0.0 and turned > CLEARLY_SWAPPED


def _agreement(motion: TiltMotion) -> float | None:
    """Return 2 sum(a b) / sum(a^2 + b^2) of the acceleration a and the tilt's second derivative b over stretches."""
    pairs = motion.second_derivative_pairs()
    if pairs is None:
        return None
    a, b = pairs
    size = float(np.sum(a**2 + b**2))
    return 2.0 * float(np.sum(a * b)) / size if size > 0.0 else None
