"""A motion that is known in closed form, as a log in whatever dress."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.features.replay.log import ACCELEROMETERS, Log, ReadOptions
from cmg_mj.features.replay.reading import read_log

DT = 0.005
AMPLITUDE, OMEGA = 0.2, 2.0 * np.pi
N = 4000
COLUMNS = {"time": "t_s", "tilt": "tilt_rad", "rate": "gyro_rad_s"}


def tilt(t: np.ndarray) -> np.ndarray:
    return AMPLITUDE * np.sin(OMEGA * t)


def rate(t: np.ndarray) -> np.ndarray:
    return AMPLITUDE * OMEGA * np.cos(OMEGA * t)


def sine(t: np.ndarray | None = None) -> dict[str, np.ndarray]:
    t = DT * np.arange(N) if t is None else t
    return {"t_s": t, "tilt_rad": tilt(t), "gyro_rad_s": rate(t)}


def write_csv(path: Path | str, columns: Mapping[str, Sequence | np.ndarray], delimiter: str = ",") -> Path:
    rows = zip(*(list(values) for values in columns.values()), strict=True)
    lines = [delimiter.join(columns), *(delimiter.join(_cell(value) for value in row) for row in rows)]
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return Path(path)


def _cell(value: object) -> str:
    return "" if value is None else repr(float(value)) if isinstance(value, (float, np.floating)) else str(value)


def read(
    folder: Path, columns: Mapping[str, Sequence | np.ndarray], roles: Mapping[str, str] = COLUMNS, **options: Any
) -> Log:
    """Read columns back as a log."""
    return read_log(write_csv(folder / "log.csv", columns), ReadOptions(roles, **options))


def two_accelerometers(folder: Path, swing: float, factor: float = 1.0, noise: float = 0.0, **units: str) -> Log:
    """Read two accelerometers: r alpha tangentially, -r w^2 radially, less gravity.

    Args:
        folder: Where the file is written.
        swing: Amplitude [rad].
        factor: Size of the written unit.
        noise: Standard deviation of each [m/s^2].
        units: Units as which they are read; the others are m/s^2.
    """
    random, t = np.random.default_rng(1), DT * np.arange(N)
    y, w, alpha = (swing / AMPLITUDE * values for values in (tilt(t), rate(t), -(OMEGA**2) * tilt(t)))
    columns = {"t_s": t}
    for place, r in (("inner", 0.1), ("outer", 0.3)):
        columns[f"{place}_x"] = r * alpha - STANDARD_GRAVITY * np.sin(y)
        columns[f"{place}_z"] = STANDARD_GRAVITY * np.cos(y) - r * w**2
    for role in ACCELEROMETERS:
        columns[role] = factor * (columns[role] + noise * random.standard_normal(N))
    names = {role: role for role in ACCELEROMETERS}
    units = {**dict.fromkeys(names, "m_s2"), **units}
    return read(folder, columns, {"time": "t_s", **names}, units=units, radii_m=(0.1, 0.3))
