"""A motion that is known in closed form, as a log in whatever dress."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

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
