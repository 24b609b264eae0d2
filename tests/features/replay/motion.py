"""A motion that is known in closed form, as a log in whatever dress."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cmg_mj.features.replay.log import Log, ReadOptions
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
