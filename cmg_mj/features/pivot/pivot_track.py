"""Reads a recorded acceleration of the pivot from a CSV file."""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cmg_mj.core.errors import InputError, nearest, shown
from cmg_mj.inputs.files import require_file

MAX_RECORDED_M_S2 = 1000.0
"""A track with a larger acceleration is in another unit [m/s^2]."""
MAX_TIME_S = 1e12
"""Largest time of a track; dates in seconds are smaller [s]."""


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
        rms = math.sqrt(np.mean(np.square(self.accelerations)))
        return f"{len(self.times)} samples over {self.times[-1]:g} s, {rms:.3g} m/s2 rms before its scale"

    def velocity(self, time: float) -> float:
        """Integral of the acceleration from the first sample to a time [m/s]; before and after it rests."""
        if time <= 0.0:
            return 0.0
        i = np.searchsorted(self.times, time, side="right") - 1
        if i + 1 >= len(self.times):
            return self.velocities[-1]
        since, length = time - self.times[i], self.times[i + 1] - self.times[i]
        a, b = self.accelerations[i : i + 2]
        return self.velocities[i] + since * (a + 0.5 * (b - a) * since / length)


def read_track(file: str, column: str | None) -> Track:
    """Read a track.

    Args:
        file: The file's path.
        column: Heading of the acceleration; None for the only one beside the time.

    Returns:
        The track.

    Raises:
        InputError: The file cannot be read or holds no track.
    """
    path = Path(file)
    require_file(path)
    status = path.stat()
    return _read_track(path, column, status.st_mtime_ns, status.st_size)


@functools.lru_cache(maxsize=16)
def _read_track(path: Path, column: str | None, _changed_ns: int, _size: int) -> Track:
    """See `read_track`; a file that changes is read anew."""
    import pyarrow as pa
    import pyarrow.csv as pacsv

    try:
        table = pacsv.read_csv(path)
        names = [name.strip() for name in table.column_names]
        if len(names) < 2 or names[0][:1] in tuple("+-.0123456789"):
            raise InputError(f"{path}: line 1: must be a heading of at least two columns, as time_s,acceleration_m_s2")
        if column is None and len(names) > 2:
            known = shown(", ".join(names[1:]))
            raise InputError(f"{path}: has the columns {known}; name that of the acceleration with column")
        if column is not None and column not in names[1:]:
            raise InputError(f"{path}: no column {shown(column)}; {nearest(column, names[1:])}")
        number = 1 if column is None else names.index(column, 1)
        for i in (0, number):
            if not (pa.types.is_floating(table[i].type) or pa.types.is_integer(table[i].type)):
                raise InputError(f"{path}: column {shown(names[i])}: must hold numbers alone, with a point and no unit")
        times, accelerations = (table[i].cast(pa.float64()).to_numpy() for i in (0, number))
    except (pa.ArrowException, OSError, UnicodeError) as error:
        raise InputError(f"{path}: cannot be read as CSV: {' '.join(str(error).split())}") from error
    if len(times) < 2:
        raise InputError(f"{path}: too few samples ({len(times)}); a track has at least two")
    wrong = np.flatnonzero(~((np.abs(times) <= MAX_TIME_S) & (np.abs(accelerations) <= MAX_RECORDED_M_S2)))
    if len(wrong):
        raise InputError(
            f"{path}: sample {wrong[0] + 1}: {accelerations[wrong[0]]:g} m/s2 at {times[wrong[0]]:g} s: must be finite "
            f"numbers, accelerations in m/s2 and at most {MAX_RECORDED_M_S2:g}, times at most {MAX_TIME_S:g} s"
        )
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if len(back):
        first, second = times[back[0] : back[0] + 2]
        raise InputError(f"{path}: sample {back[0] + 2}: the time {second:g} s does not follow {first:g} s")
    times = times - times[0]
    steps = 0.5 * np.diff(times) * (accelerations[:-1] + accelerations[1:])
    return Track(times, accelerations, np.concatenate([[0.0], np.cumsum(steps)]))
