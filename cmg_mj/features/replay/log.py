"""A log: what was measured, evenly sampled, in the names and units of a trajectory; and the columns of its file."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from cmg_mj.core.errors import InputError, TomlValue, nearest, shortened
from cmg_mj.core.tilt import RadialTilt
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.stages.push import Push, Window, push_windows

if TYPE_CHECKING:
    import pyarrow as pa

REFERENCE = "reference_rad_s"
"""The column of the rate that estimates are judged against; NaN where it is not known."""


EVEN = 0.02
"""Deviation from an even grid, in periods, up to which stamps count as even."""

Values = Mapping[str, np.ndarray]
"""Name -> (n_rows,)."""


@dataclass(frozen=True)
class Part:
    """Rows without a gap, evenly sampled.

    Attributes:
        time: (n,) [s].
        values: Name -> (n,).
        stamps: The rows' own times, (m,) [s].
        placed: The rows' times in `time`, which differ from rounded stamps, (m,) [s].
        rows: Name -> the rows' own values, (m,).
    """

    time: np.ndarray
    values: Values
    stamps: np.ndarray
    placed: np.ndarray
    rows: Values

    def when(self, stamps: np.ndarray) -> np.ndarray:
        """Convert other rows' stamps to times in this part, beyond its ends too, (k,) [s]."""
        before, after = self.stamps[0] - self.placed[0], self.stamps[-1] - self.placed[-1]
        inside = np.interp(stamps, self.stamps, self.placed)
        return np.where(
            stamps < self.stamps[0], stamps - before, np.where(stamps > self.stamps[-1], stamps - after, inside)
        )


class WhiteNoise(NamedTuple):
    """Standard deviation of the white noise of one row, with its 95 % interval."""

    sigma: float
    low: float
    high: float


class LogNoise(NamedTuple):
    """White noise of one row of a file, or why it cannot be told."""

    tilt: WhiteNoise | str
    """Noise of the tilt [rad]."""
    acceleration: WhiteNoise | str | None
    """Noise of the angular acceleration [rad/s^2]; None without one."""
    correlation: float
    """Correlation of both; 0 where it cannot be told from 0."""


@dataclass(frozen=True)
class ReadOptions:
    """Options with which a log is read; the command line has one option for each.

    Attributes:
        columns: Role -> heading, such as `{"tilt": "pitch_deg", "rate": "gyro_dps"}`; the roles: `ROLES`. Empty for a
            run's own recording.
        units: Role -> unit, for headings that do not end in theirs.
        scale: Role -> factor.
        offset: Role -> addend after the scale, in the column's unit.
        rate_hz: Rate of rows without a time; rows with a time are resampled to this rate [Hz].
        max_gap_s: Longer gaps part the log; by default those of more than five rows [s].
        delay_s: Lag of the reference behind the other signals [s].
        radii_m: Distances of two accelerometers from the pivot, the inner first [m].
        time_range_s: Start and end of the part to read, from the first row on [s].
        windows_s: Windows that are scored separately, in the log's own time [s].
        delimiter: Character between the cells of a CSV.
        encoding: Encoding of a CSV.
        decimal: Decimal point of the numbers in a CSV.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    scale: Mapping[str, float] = field(default_factory=dict)
    offset: Mapping[str, float] = field(default_factory=dict)
    rate_hz: float | None = None
    max_gap_s: float | None = None
    delay_s: float = 0.0
    radii_m: tuple[float, float] | None = None
    time_range_s: tuple[float, float] | None = None
    windows_s: Sequence[Window] = ()
    delimiter: str = ","
    encoding: str = "utf-8"
    decimal: str = "."

    def as_toml(self) -> dict[str, TomlValue]:
        """Return the options that are not the defaults, as TOML holds them."""
        defaults, options = vars(ReadOptions()), {**vars(self), "windows_s": tuple(self.windows_s)}
        return {name: value for name, value in options.items() if value != defaults[name]}


@dataclass(frozen=True)
class Log:
    """One log.

    Attributes:
        name: Name of the file, without its ending.
        dt: Sample period [s].
        columns: `time_s`, `y1_rad`, `y2_rad`, `u_rad_s`, `acceleration_rad_s2`, `reference_rad_s`, each (n,). Where
            the log lacks a signal, y2 and u are zero, the others NaN.
        parts: Slices without a gap; the observers start at the beginning of each.
        has: Signals of the log among "gimbals" (y2 and u), "acceleration" and "reference".
        tilt: Geometry of the two accelerometers, if they measure the tilt.
        windows: Windows that are scored separately [s].
        notes: Changes to the rows that were not requested, and likely mistakes, a line each.
        options: Options with which it was read, the units of all columns among them.
        scenario: The resolved scenario of a run's recording.
        row_period_s: Period of the file's own rows, whatever the sample period [s]; None for a run's recording.
        white_noise: White noise of one of these rows; None for a run's recording.
    """

    name: str
    dt: float
    columns: Mapping[str, np.ndarray]
    parts: Sequence[slice]
    has: frozenset[str]
    tilt: RadialTilt | None = None
    windows: Sequence[Window] = ()
    notes: Sequence[str] = ()
    options: ReadOptions = ReadOptions()
    scenario: Mapping[str, Any] | None = None
    row_period_s: float | None = None
    white_noise: LogNoise | None = None

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def __len__(self) -> int:
        return len(self["time_s"])

    @property
    def duration_s(self) -> float:
        """Duration without the gaps [s]."""
        return sum(part.stop - part.start - 1 for part in self.parts) * self.dt

    @property
    def title(self) -> str:
        """The log in one line."""
        parts = "" if len(self.parts) == 1 else f" in {len(self.parts)} parts"
        return f"{self.name}: {len(self):,} samples at {1.0 / self.dt:.6g} Hz, {self.duration_s:.6g} s{parts}"

    def trajectory(self, part: slice) -> Trajectory:
        """Return one part, as `cmg_mj.features.replay.log_replay` takes it."""
        return Trajectory({name: values[part] for name, values in self.columns.items()})

    def scored(self, settle_s: float) -> np.ndarray:
        """Return which samples count: those from `settle_s` after the start of a part on, (n,)."""
        counted = np.zeros(len(self), dtype=bool)
        for part in self.parts:
            counted[part.start + math.ceil(min(settle_s / self.dt, len(self)) - 1e-9) : part.stop] = True
        return counted

    def broken(self, values: np.ndarray) -> np.ndarray:
        """Put a NaN between two parts of values, (n,): no line is drawn across a gap."""
        first, *others = self.parts
        pieces = [piece for part in others for piece in ([np.nan], values[part])]
        return np.concatenate([values[first], *pieces]) if others else values[first]

    def broken_time(self) -> np.ndarray:
        """Return the times of `broken` values [s]."""
        time = self.broken(self["time_s"])
        return np.where(np.isnan(time), np.roll(time, 1) + self.dt, time)

    def cut(self, rows: slice) -> Log:
        """Return the log's part in a range of rows."""
        start, stop, _ = rows.indices(len(self))
        parts = [slice(max(p.start, start) - start, min(p.stop, stop) - start) for p in self.parts]
        columns = {name: values[start:stop] for name, values in self.columns.items()}
        return replace(self, columns=columns, parts=[part for part in parts if part.stop - part.start > 1])


def log_of_run(path: Path) -> Log:
    """Read a run's own recording, whose columns, pushes and scenario are known.

    Raises:
        InputError: The file is no recording of a run about one axis.
    """
    try:
        trajectory = Trajectory.load(path)
        scenario = trajectory.metadata["scenario"]
    except (InputError, LookupError) as error:
        raise InputError(f"{path}: say which columns are what, --columns tilt=HEADING,rate=HEADING,...") from error
    if trajectory.axes:
        raise InputError(
            f"{path}: a run about several axes ({', '.join(trajectory.axes)}), and replay takes one; save one of them "
            f"from Python: Trajectory.load(path).along({trajectory.axes[0]!r}).save(...)"
        )
    if len(trajectory) < 2:
        raise InputError(f"{path}: a run that ended before its second tick")
    columns = {name: trajectory[name] for name in ("time_s", "y1_rad", "y2_rad", "u_rad_s", "acceleration_rad_s2")}
    columns[REFERENCE] = trajectory["x2_rad_s"]
    return Log(
        path.parent.name if path.stem == "trajectory" and path.parent.name else path.stem,
        1.0 / float(scenario["controller"]["rate_hz"]),
        columns,
        [slice(0, len(trajectory))],
        frozenset({"gimbals", "acceleration", "reference"}),
        windows=push_windows([Push(**push) for push in scenario.get("push", ())]),
        scenario=scenario,
    )


Quantity = Literal["angle", "rate", "angular acceleration", "acceleration", "time"]

_DEG, _TURN = math.pi / 180.0, 2.0 * math.pi
_RATES = {"rad_s": 1.0, "mrad_s": 1e-3, "deg_s": _DEG, "dps": _DEG, "mdps": 1e-3 * _DEG}
_FORCES = {"g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY, "ug": 1e-6 * STANDARD_GRAVITY}
UNITS: dict[Quantity, dict[str, float]] = {
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": _DEG, "mdeg": 1e-3 * _DEG, "rev": _TURN},
    "rate": {**_RATES, "rpm": _TURN / 60.0, "rev_s": _TURN},
    "angular acceleration": {"rad_s2": 1.0, "deg_s2": _DEG},
    "acceleration": {"m_s2": 1.0, "mm_s2": 1e-3, **_FORCES},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
}
"""Quantity -> unit -> its size in rad, rad/s, rad/s^2, m/s^2 or s. The first of each is that."""
_SPELLINGS = {
    "rad": "radian radians",
    "deg": "° degree degrees",
    "rad_s": "rads rps radps rad_sec",
    "deg_s": "degs degps deg_sec °_s",
    "rad_s2": "rad_ss",
    "deg_s2": "°_s2",
    "m_s2": "ms2 mps2 m_ss",
    "s": "sec secs second seconds",
    "ms": "msec millis",
    "us": "usec µs μs micros",
    "ns": "nsec nanos",
}
_UNIT_OF_SPELLING = {spelling: unit for unit, others in _SPELLINGS.items() for spelling in others.split()}

ACCELEROMETERS = ("inner_x", "inner_z", "outer_x", "outer_z")
ONE_ACCELEROMETER = ("ax", "az")
ROLES: dict[str, Quantity] = {
    "time": "time",
    "tilt": "angle",
    **dict.fromkeys(ACCELEROMETERS, "acceleration"),
    **dict.fromkeys(ONE_ACCELEROMETER, "acceleration"),
    "acceleration": "angular acceleration",
    "gimbal": "angle",
    "gimbal1": "angle",
    "gimbal2": "angle",
    "command": "rate",
    "rate": "rate",
}
"""Role -> quantity of its column.

`tilt` is the angle from the vertical, `inner_x` to `outer_z` two accelerometers as `RadialTilt` takes them, `ax` and
`az` one accelerometer: along the motion of a growing tilt, and outward (upward while upright), `acceleration` the
angular acceleration of the tilt, `gimbal` the gimbals' common angle from the spin axis' upright place (or `gimbal1` and
`gimbal2`, whose half difference it is), `command` their rate, `rate` the reference.
"""

_ASSIGNMENT = re.compile(
    r"""\s*(?P<role>\w+)\s*=\s*(?:"(?P<quoted>(?:[^"]|"")*)"\s*|(?P<plain>[^"].*?))(?:,(?=\s*\w+\s*=)|$)""", re.DOTALL
)
"""ROLE=HEADING or ROLE="HEADING"; the heading ends at a comma before another ROLE=, a quoted one at its quote."""


@dataclass(frozen=True)
class Column:
    """One column of a log.

    Attributes:
        role: One of `ROLES`.
        name: Heading in the file.
        unit: Unit of its numbers.
        factor: Factor to SI and radians, the user's scale included.
        offset: Addend after the factor, in SI and radians.
        unit_known: Whether the unit was given or is in the heading; else it is assumed.
    """

    role: str
    name: str
    unit: str
    factor: float
    offset: float = 0.0
    unit_known: bool = True

    @property
    def scale(self) -> float:
        """The user's own factor."""
        return self.factor / UNITS[ROLES[self.role]][self.unit]


def assignments(texts: str | Iterable[str], option: str) -> dict[str, str]:
    """Parse `tilt=pitch_deg,rate=gyro dps` into role -> heading; a heading may contain commas.

    A heading with a comma before something like `x=` goes into quotes as in a CSV: `tilt="roll,x=1 (deg)"`, where a
    quote is written twice.

    Args:
        texts: One text or several.
        option: The option's name, for messages.

    Returns:
        Role -> value, in their order.

    Raises:
        InputError: A text has another form, or a role is unknown or given twice.
    """
    values: dict[str, str] = {}
    for text in [texts] if isinstance(texts, str) else texts:
        rest = text.strip().lstrip(",")
        while True:
            part = _ASSIGNMENT.match(rest)
            if part is None:
                raise InputError(
                    f"{option} {shortened(text)!r}: write ROLE=VALUE with commas between, such as tilt=pitch_deg; a "
                    'heading with a comma in it goes into quotes, tilt="roll,x (deg)"'
                )
            role, quoted = part["role"], part["quoted"]
            check_role(role, option)
            if role in values:
                raise InputError(f"{option}: {role} is given twice")
            values[role] = (part["plain"] if quoted is None else quoted.replace('""', '"')).strip()
            rest = rest[part.end() :]
            if not rest:
                break
    return values


def check_role(role: str, option: str) -> None:
    """Refuse an unknown role."""
    if role not in ROLES:
        raise InputError(f"{option} {role}: no such role; {nearest(role, ROLES)}")


def columns_of(options: ReadOptions) -> dict[str, Column]:
    """Find the columns' units, factors and offsets.

    Returns:
        Role -> column.

    Raises:
        InputError: A role is unknown, roles do not go together, or a column has no known unit.
    """
    names = options.columns
    given = {"--units": options.units, "--scale": options.scale, "--offset": options.offset}
    for option, roles in {"--columns": names, **given}.items():
        for role in roles:
            check_role(role, option)
            if role not in names:
                raise InputError(f"{option} {role}: there is no such column; --columns names {', '.join(names)}")
    _check_together(set(names))
    columns = {}
    for role, name in names.items():
        quantity = ROLES[role]
        unit = unit_of_name(quantity, name)
        if role in options.units:
            unit = _plain(options.units[role])
            if unit not in UNITS[quantity]:
                known = nearest(unit, UNITS[quantity])
                raise InputError(f"--units {role}={options.units[role]}: no unit of this quantity; {known}")
        if unit is None and role != "time":
            allowed = ", ".join(UNITS[quantity])
            raise InputError(
                f"--columns {role}={name}: the name does not end in a unit; say --units {role}=UNIT, one of {allowed}"
            )
        scale, offset = options.scale.get(role, 1.0), options.offset.get(role, 0.0)
        if not math.isfinite(scale) or scale == 0.0:
            raise InputError(f"--scale {role}={scale:g}: must be a finite number other than 0")
        if not math.isfinite(offset):
            raise InputError(f"--offset {role}={offset:g}: must be a finite number")
        size = UNITS[quantity][unit or "s"]
        columns[role] = Column(role, name, unit or "s", size * scale, size * offset, unit is not None)
    return columns


def _check_together(names: set[str]) -> None:
    """Refuse roles that leave the tilt unknown, or determine it twice."""
    sources = [source for source in (("tilt",), ONE_ACCELEROMETER, ACCELEROMETERS) if names & set(source)]
    if len(sources) != 1 or not names.issuperset(sources[0]):
        raise InputError("--columns: name the tilt, or ax and az, or inner_x, inner_z, outer_x and outer_z")
    if "acceleration" in names and sources[0] == ACCELEROMETERS:
        raise InputError("--columns: two accelerometers show the angular acceleration; leave acceleration out")
    if names & {"gimbal", "gimbal1", "gimbal2"} not in (set(), {"gimbal"}, {"gimbal1", "gimbal2"}):
        raise InputError("--columns: name either gimbal, or gimbal1 and gimbal2")


def _plain(text: str) -> str:
    """Spell `Deg/s^2`, `deg.s-2` and `deg_s2` alike."""
    text = text.strip().lower().replace("²", "2").replace("^", "").replace("**", "")
    text = re.sub(r"[\s./*·]+", "_", text).replace("_s-1", "_s").replace("_s-2", "_s2").strip("_")
    return _UNIT_OF_SPELLING.get(text, text)


def unit_of_name(quantity: Quantity, name: str) -> str | None:
    """Return the unit that a column's name ends in, after `_`, a space, or in brackets; None if it ends in none.

    A name that is a unit and nothing else, such as `ms`, is one too.
    """
    bracketed = re.search(r"[\[({]([^\[\](){}]+)[\])}]\s*$", name)
    parts = [bracketed[1]] if bracketed else _plain(re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name)).split("_")
    ends = (_plain("_".join(parts[start:])) for start in range(len(parts)))  # the longest first: deg_s before s
    return next((end for end in ends if end in UNITS[quantity]), None)


def read_table(path: Path, columns: Mapping[str, Column], options: ReadOptions) -> tuple[dict[str, np.ndarray], bool]:
    """Read columns of a log.

    Args:
        path: A CSV (with a heading) or a Parquet file.
        columns: Role -> column.
        options: How a CSV is written.

    Returns:
        Role -> values in SI units and radians, (n_rows,), NaN where there is no number; whether the time holds dates,
        which become seconds from the first.

    Raises:
        InputError: The file cannot be read, lacks a column, or has text among the numbers.
    """
    import pyarrow as pa

    try:
        table = _read(path, [column.name.strip() for column in columns.values()], options)
    except InputError:
        raise
    except (pa.ArrowException, OSError, ValueError, LookupError, OverflowError) as error:
        text = " ".join(str(getattr(error, "strerror", None) or error).split())
        raise InputError(
            f"{path}: cannot be read: {shortened(text)}. A CSV is read with --delimiter, --encoding and --decimal"
        ) from error
    if not table.num_rows:
        raise InputError(f"{path}: has no row")
    values, dated, numbers = {}, False, None
    for role, column in columns.items():
        numbers = table[column.name.strip()]
        if role == "time" and pa.types.is_timestamp(numbers.type):
            values[role], dated = _seconds(numbers), True
            continue
        if not (pa.types.is_integer(numbers.type) or pa.types.is_floating(numbers.type)):
            raise InputError(f"{path}: column {column.name!r} holds {numbers.type}, not numbers")
        floats = numbers.cast(pa.float64(), safe=False).to_numpy()
        with np.errstate(over="ignore", invalid="ignore"):
            values[role] = np.where(np.isfinite(floats), floats, np.nan) * column.factor + column.offset
    del table, numbers
    pa.default_memory_pool().release_unused()  # of a long log, as much as all its signals
    return values, dated


def _read(path: Path, names: list[str], options: ReadOptions) -> pa.Table:
    """Read the named columns; spaces around a heading do not count."""
    import pyarrow as pa
    import pyarrow.csv as pacsv
    import pyarrow.parquet as pq

    def spelled(known: list[str]) -> list[str]:
        headings = {heading.strip(): heading for heading in known}
        for name in names:
            if name not in headings:
                raise InputError(f"{path}: has no column {name!r}; {nearest(name, list(headings), 'it has')}")
        return list(dict.fromkeys(headings[name] for name in names))

    with path.open("rb") as file:
        is_parquet = file.read(4) == b"PAR1"
        file.seek(0)
        if is_parquet:
            table = pq.ParquetFile(file).read(columns=spelled(pq.ParquetFile(file).schema_arrow.names))
        else:
            read = pacsv.ReadOptions(encoding=options.encoding, use_threads=False)
            parse = pacsv.ParseOptions(delimiter=options.delimiter)
            headings = spelled(pacsv.open_csv(file, read, parse).schema.names)
            file.seek(0)
            time = options.columns.get("time", "").strip()
            convert = pacsv.ConvertOptions(
                include_columns=headings,
                column_types={name: pa.float64() for name in headings if name.strip() != time},
                decimal_point=options.decimal,
            )
            table = pacsv.read_csv(file, read, parse, convert)
    return table.rename_columns([heading.strip() for heading in table.column_names])


def _seconds(column: pa.ChunkedArray) -> np.ndarray:
    """Convert dates to seconds from the first; nanoseconds are subtracted as integers."""
    import pyarrow as pa

    counts = column.cast(pa.timestamp("ns", column.type.tz)).cast(pa.int64())
    known = counts.drop_null()
    start = known[0].as_py() if len(known) else 0
    return np.where(np.asarray(counts.is_valid()), (counts.fill_null(0).to_numpy() - start) * 1e-9, np.nan)
