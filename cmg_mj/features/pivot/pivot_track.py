"""Reads a recorded acceleration of the pivot from a CSV file."""

from __future__ import annotations

import csv
import functools
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cmg_mj.core.errors import InputError, nearest, shown
from cmg_mj.inputs.files import read_text, require_file

MAX_BYTES = 100_000_000
MAX_RECORDED_M_S2 = 1000.0
"""A track with a larger acceleration is in another unit [m/s^2]."""


class Track(NamedTuple):
    """A recorded acceleration, taken to run straight between its samples.

    Attributes:
        times: Since its first sample, increasing, (n,) [s].
        accelerations: At these times, (n,) [m/s^2].
        velocities: Integral of the acceleration since the first sample, (n,) [m/s].
    """

    times: np.ndarray
    accelerations: np.ndarray
    velocities: np.ndarray

    @property
    def words(self) -> str:
        """Samples, length and size, for one line."""
        rms = math.sqrt(float(np.mean(np.square(self.accelerations))))
        return f"{len(self.times)} samples over {self.times[-1]:g} s, {rms:.3g} m/s2 rms before its scale"

    def velocity(self, time: float) -> float:
        """Integral of the acceleration from the first sample to a time [m/s]; before and after it rests."""
        if time <= 0.0:
            return 0.0
        i = int(np.searchsorted(self.times, time, side="right")) - 1
        if i + 1 >= len(self.times):
            return float(self.velocities[-1])
        since, length = time - float(self.times[i]), float(self.times[i + 1] - self.times[i])
        a, b = float(self.accelerations[i]), float(self.accelerations[i + 1])
        return float(self.velocities[i]) + since * (a + 0.5 * (b - a) * since / length)


def read_track(file: str, column: str | None) -> Track:
    """Read a track.

    Args:
        file: The file's path.
        column: Heading of the acceleration; None for the only one beside the time.

    Returns:
        The track.

    Raises:
        InputError: The file cannot be read or holds no track; the line is named.
    """
    path = Path(file)
    require_file(path)
    status = path.stat()
    return _read_track(path, column, status.st_mtime_ns, status.st_size)


@functools.lru_cache(maxsize=16)
def _read_track(path: Path, column: str | None, _changed_ns: int, _size: int) -> Track:
    """See `read_track`; a file that changes is read anew."""
    rows = csv.reader(read_text(path, str(path), MAX_BYTES).splitlines())
    try:
        heading = [name.strip() for name in next(rows, [])]
        number = _column(path, heading, column)
        lines = [(rows.line_num, row) for row in rows if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise InputError(f"{path}: no CSV: {error} (line {rows.line_num})") from error
    if len(lines) < 2:
        raise InputError(f"{path}: too few samples ({len(lines)}); a track has at least two")
    numbers = np.array([_numbers(path, line, row, number, len(heading)) for line, row in lines])
    times, accelerations = numbers.T
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if len(back):
        line = lines[int(back[0]) + 1][0]
        raise InputError(f"{path}: line {line}: the time {times[back[0] + 1]:g} s does not follow {times[back[0]]:g} s")
    largest = int(np.argmax(np.abs(accelerations)))
    if abs(accelerations[largest]) > MAX_RECORDED_M_S2:
        raise InputError(
            f"{path}: line {lines[largest][0]}: {accelerations[largest]:g} m/s2: at most {MAX_RECORDED_M_S2:g}; "
            "accelerations are in m/s2"
        )
    times = times - times[0]
    steps = 0.5 * np.diff(times) * (accelerations[:-1] + accelerations[1:])
    return Track(times, accelerations, np.concatenate([[0.0], np.cumsum(steps)]))


def _column(path: Path, heading: list[str], column: str | None) -> int:
    """Find the number of the acceleration's column."""
    if not heading or any(_is_number(name) for name in heading):
        raise InputError(f"{path}: line 1: must be a heading, such as time_s,acceleration_m_s2")
    if len(heading) < 2:
        raise InputError(f"{path}: line 1: one column; a track has the time first, then an acceleration")
    names = heading[1:]
    if column is None:
        if len(names) > 1:
            raise InputError(
                f"{path}: has the columns {shown(', '.join(names))}; name that of the acceleration with column"
            )
        return 1
    if column not in names:
        raise InputError(f"{path}: no column {shown(column)}; {nearest(column, names)}")
    return 1 + names.index(column)


def _numbers(path: Path, line: int, row: list[str], column: int, columns: int) -> tuple[float, float]:
    """Read the time and the acceleration of a line."""
    if len(row) != columns:
        raise InputError(f"{path}: line {line}: {len(row)} values; the heading has {columns}")
    values = []
    for text in (row[0], row[column]):
        if not _is_number(text) or not math.isfinite(float(text)):
            raise InputError(f"{path}: line {line}: {shown(text.strip())} is not a finite number")
        values.append(float(text))
    return values[0], values[1]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
