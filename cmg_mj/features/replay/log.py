"""A log: what was measured, evenly sampled, in a trajectory's names and units; the columns of its file."""

from __future__ import annotations

import csv
import math
import mmap
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal, NamedTuple

import numpy as np

from cmg_mj.core.errors import InputError, TomlValue, nearest, shortened
from cmg_mj.core.planar_tilt import PlanarTilt
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.inputs.messages import LARGEST
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.scenario.rig_file import Rig
from cmg_mj.stages.push import Window

if TYPE_CHECKING:
    import pyarrow as pa

REFERENCE = "reference_rad_s"
"""The column of the rate that estimates are judged against; NaN where it is not known."""
TORQUE_MOMENTUM = 1e6
"""Momentum with which a known torque is a gimbal's rate [N m s]: so large that the gimbal hardly turns."""
EVEN = 0.02
"""Deviation from an even grid, in periods, up to which stamps count as even."""

Values = Mapping[str, np.ndarray]
"""Name -> (n_rows,)."""


@dataclass(frozen=True)
class Segment:
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
        """Convert other rows' stamps to times in this segment, beyond its ends too, (k,) [s]."""
        return stamps + np.interp(stamps, self.stamps, self.placed - self.stamps)


class WhiteNoise(NamedTuple):
    """Standard deviation of the white noise of one sample, with its 95 % interval."""

    sigma: float
    low: float
    high: float
    doubt: str = ""
    """Why it is no white floor, but the power of the upper band or the quantiser's."""


class LogNoise(NamedTuple):
    """White noise of one sample of a log, or why it cannot be told."""

    tilt: WhiteNoise | str
    """Noise of the tilt [rad]."""
    acceleration: WhiteNoise | str | None
    """Noise of the angular acceleration [rad/s^2]; None without one."""
    correlation: float
    """Correlation of both; 0 where it cannot be told from 0."""


KNOWN_SENSORS = LogNoise("the sensors are known", None, 0.0)


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
        rig: Accelerometers at other places, with columns of their own, and what is known of the rig beside.
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
    rig: Rig = field(default_factory=Rig)
    time_range_s: tuple[float, float] | None = None
    windows_s: Sequence[Window] = ()
    delimiter: str = ","
    encoding: str = "utf-8"
    decimal: str = "."

    def as_toml(self) -> dict[str, TomlValue]:
        """Return the options that are not the defaults, as TOML holds them."""
        defaults, options = vars(ReadOptions()), {**vars(self), "windows_s": tuple(self.windows_s)}
        options["rig"] = self.rig if self.rig == Rig() else self.rig.model_dump(exclude_defaults=True, mode="json")
        return {name: value for name, value in options.items() if value != defaults[name]}


@dataclass(frozen=True)
class Log:
    """One log.

    Attributes:
        name: Name of the file, without its ending.
        dt: Sample period [s].
        columns: `time_s`, `y1_rad`, `y2_rad`, `u_rad_s`, `acceleration_rad_s2`, `mems_gyro_rad_s`,
            `reference_rad_s`, each (n,). Where
            the log lacks a signal, y2 and u are zero, the others NaN.
        parts: Slices without a gap; the observers start at the beginning of each.
        has: Signals of the log among "gimbals" (y2 and u), "acceleration", "gyro" and "reference".
        tilt: Geometry of the accelerometers, if their places are known.
        windows: Windows that are scored separately [s].
        notes: Changes to the rows that were not requested, and likely mistakes, a line each.
        options: Options with which it was read, the units of all columns among them.
        scenario: The resolved scenario of a run's recording.
        row_period_s: Period of the file's own rows, whatever the sample period [s]; None for a run's recording.
        white_noise: White noise of one sample, as the rows show it, or why it cannot be told.
    """

    name: str
    dt: float
    columns: Mapping[str, np.ndarray]
    parts: Sequence[slice]
    has: frozenset[str]
    tilt: PlanarTilt | None = None
    windows: Sequence[Window] = ()
    notes: Sequence[str] = ()
    options: ReadOptions = ReadOptions()
    scenario: Mapping[str, Any] | None = None
    row_period_s: float | None = None
    white_noise: LogNoise = KNOWN_SENSORS

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
        """Return one part, as `cmg_mj.runs.open_loop` takes it."""
        return Trajectory({name: values[part] for name, values in self.columns.items()})

    def scored(self, settle_s: float) -> np.ndarray:
        """Return which samples count: those from `settle_s` after the start of a part on, (n,)."""
        counted = np.zeros(len(self), dtype=bool)
        for part in self.parts:
            counted[part.start + math.ceil(min(settle_s / self.dt, len(self)) - 1e-9) : part.stop] = True
        return counted

    def broken(self, values: np.ndarray) -> np.ndarray:
        """Put a NaN between two parts of values, (n,): no line is drawn across a gap."""
        pieces = [piece for part in self.parts for piece in (values[part], [np.nan])]
        return np.concatenate(pieces[:-1])

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


class Channels(NamedTuple):
    """Columns of a log, evenly sampled, in its longest part without a gap."""

    name: str
    """Name of the file, without its ending."""
    dt: float
    """Sample period [s]."""
    values: Values
    """Role, or heading of an accelerometer's axis -> (n,), in SI units and radians."""
    options: ReadOptions
    """With the units of all columns."""
    notes: Sequence[str]
    """Changes to the rows that were not requested."""


Quantity = Literal["angle", "rate", "angular acceleration", "acceleration", "torque", "time"]

_DEG, _TURN = math.pi / 180.0, 2.0 * math.pi
_RATES = {"rad_s": 1.0, "mrad_s": 1e-3, "deg_s": _DEG, "dps": _DEG, "mdps": 1e-3 * _DEG}
_FORCES = {"g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY, "ug": 1e-6 * STANDARD_GRAVITY}
UNITS: dict[Quantity, dict[str, float]] = {
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": _DEG, "mdeg": 1e-3 * _DEG, "rev": _TURN},
    "rate": {**_RATES, "rpm": _TURN / 60.0, "rev_s": _TURN},
    "angular acceleration": {"rad_s2": 1.0, "deg_s2": _DEG},
    "acceleration": {"m_s2": 1.0, "mm_s2": 1e-3, **_FORCES},
    "torque": {"n_m": 1.0, "mn_m": 1e-3, "a": 1.0, "ma": 1e-3},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
}
"""Quantity -> unit -> its size in rad, rad/s, rad/s^2, m/s^2, N m (or A) or s. The first of each is that."""
_SPELLINGS = {
    "rad": "radian radians",
    "deg": "° degree degrees",
    "rad_s": "rads rps radps rad_sec",
    "deg_s": "degs degps deg_sec °_s",
    "rad_s2": "rad_ss",
    "deg_s2": "°_s2",
    "m_s2": "ms2 mps2 m_ss",
    "n_m": "nm",
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
    "gyro": "rate",
    "rate": "rate",
    "torque": "torque",
    "wheel": "rate",
}
"""Role -> quantity of its column.

`tilt` is the angle from the vertical, `inner_x` to `outer_z` two accelerometers as `PairTilt` takes them, `ax` and
`az` one accelerometer: along the motion of a growing tilt, and outward (upward while upright), `acceleration` the
angular acceleration of the tilt, `gimbal` the gimbals' common angle from the spin axis' upright place (or `gimbal1` and
`gimbal2`, whose half difference it is), `command` their rate, `gyro` a gyro that observers take, `rate` the
reference, `torque` a motor's torque on the body, or its current, `wheel` the speed of the wheel that it drives.
"""

_ASSIGNMENT = re.compile(
    r"""\s*(?P<role>\w+)\s*=\s*(?:"(?P<quoted>(?:[^"]|"")*)"\s*|(?P<plain>[^"].*?))(?:,(?=\s*\w+\s*=)|$)""", re.DOTALL
)
"""ROLE=HEADING or ROLE="HEADING"; the heading ends at a comma before another ROLE=, a quoted one at its quote."""


_COMMENT = re.compile(r"^\s*(?:#|%|//)+\s*")
_NUMBER = re.compile(r"[-+.,\deE ]*\d *")
_ZONE = re.compile(r"\s+(Z|[+-]\d+:?\d*)$")


class Column(NamedTuple):
    """One column of a file: its heading, its unit, and factor and addend that convert it to SI units and radians."""

    name: str
    unit: str | None
    """None for a time whose unit is not known: it is taken as seconds."""
    factor: float
    offset: float


def assignments(texts: Iterable[str], option: str) -> dict[str, str]:
    """Parse `tilt=pitch_deg,rate=gyro dps` into role -> heading; a heading may contain commas.

    A heading with a comma before something like `x=` goes into quotes as in a CSV: `tilt="roll,x=1 (deg)"`, where a
    quote is written twice.

    Args:
        texts: Such texts.
        option: The option's name, for messages.

    Raises:
        InputError: A text has another form, or a role is given twice.
    """
    values: dict[str, str] = {}
    for text in texts:
        rest = text
        while rest:
            part = _ASSIGNMENT.match(rest)
            if part is None:
                raise InputError(
                    f"{option} {shortened(text)!r}: write ROLE=VALUE with commas between, such as tilt=pitch_deg; a "
                    'heading with a comma in it goes into quotes, tilt="roll,x (deg)"'
                )
            role, quoted = part["role"], part["quoted"]
            if role in values:
                raise InputError(f"{option}: {role} is given twice")
            values[role] = (part["plain"] if quoted is None else quoted.replace('""', '"')).strip()
            rest = rest[part.end() :]
    return values


def columns_of(options: ReadOptions) -> dict[str, Column]:
    """Find the columns' units, factors and offsets.

    Returns:
        Role -> column.

    Raises:
        InputError: A role is unknown, roles do not go together, or a column has no known unit.
    """
    names = options.columns
    for option in ("columns", "units", "scale", "offset"):
        for role in getattr(options, option):
            if role not in ROLES:
                raise InputError(f"--{option} {role}: no such role; {nearest(role, ROLES)}")
            if role not in names:
                raise InputError(f"--{option} {role}: there is no such column; --columns names {', '.join(names)}")
    sources = [source for source in (("tilt",), ONE_ACCELEROMETER, ACCELEROMETERS) if names.keys() & set(source)]
    angle_beside = options.rig.accelerometer and sources in ([], [("tilt",)])
    if not angle_beside and (len(sources) != 1 or not names.keys() >= set(sources[0])):
        raise InputError("--columns: name the tilt, or ax and az, or inner_x, inner_z, outer_x and outer_z")
    if "acceleration" in names and (options.rig.accelerometer or sources[0] == ACCELEROMETERS):
        raise InputError("--columns: the accelerometers show the angular acceleration; leave acceleration out")
    if names.keys() & {"gimbal", "gimbal1", "gimbal2"} not in (set(), {"gimbal"}, {"gimbal1", "gimbal2"}):
        raise InputError("--columns: name either gimbal, or gimbal1 and gimbal2")
    if "torque" in names and names.keys() & {"gimbal", "gimbal1", "command"}:
        raise InputError("--columns: name either a torque, or gimbal and command")
    if "gyro" in names and names["gyro"] == names.get("rate"):
        raise InputError(
            f"--columns gyro={names['gyro']}: is the reference too; name another column, or leave rate out"
        )
    found = {role: _column(role, name, options) for role, name in names.items()}
    for accelerometer in options.rig.accelerometer:
        size = UNITS["acceleration"].get(_plain(accelerometer.unit))
        if size is None:
            raise InputError(f"accelerometer.unit = {accelerometer.unit!r}: {nearest(accelerometer.unit, _FORCES)}")
        found |= {heading: Column(heading, accelerometer.unit, size, 0.0) for heading in accelerometer.columns}
    return found


def _column(role: str, name: str, options: ReadOptions) -> Column:
    units, told = UNITS[ROLES[role]], options.units.get(role)
    unit = unit_of_name(ROLES[role], name) if told is None else _plain(told)
    if unit not in units and (told is not None or role != "time"):
        wrong = f"--columns {role}={name}: the name does not end in a unit; say --units {role}=UNIT"
        if told is not None:
            wrong = f"--units {role}={told}: no unit of this quantity"
        raise InputError(f"{wrong}; {nearest(unit or '', units)}")
    scale = options.scale.get(role, 1.0)
    if not scale:
        raise InputError(f"--scale {role}={scale:g}: must be a number other than 0")
    size = units[unit or "s"]
    return Column(name, unit, size * scale, size * options.offset.get(role, 0.0))


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


def read_table(path: Path, columns: dict[str, Column], options: ReadOptions) -> dict[str, np.ndarray]:
    """Read columns of a log; spaces around a heading do not count.

    Returns:
        Role -> values in SI units and radians, (n_rows,), NaN where there is no number. Dates become seconds from the
        first, the unit that their column then has.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with path.open("rb") as file:
            start = file.read(4)
            if not start:
                raise InputError(f"{path}: is empty")
            file.seek(0)
            table = pq.read_table(file) if start == b"PAR1" else _read_csv(path, file, columns, options)
        headings = [heading.strip() for heading in table.column_names]
    except InputError:
        raise
    except (pa.ArrowException, OSError, ValueError, LookupError, OverflowError, TypeError) as error:
        said = re.sub("CSV parse error: Row #", "about line ", " ".join(str(error).split()))
        said = re.sub(r"In CSV column #(\d+): Row #(\d+)", lambda m: f"about line {m[2]}, column {int(m[1]) + 1}", said)
        text = shortened(re.sub(r"CSV conversion error to double: invalid value ('.*)", r"\1 is no number", said))
        raise InputError(
            f"{path}: cannot be read: {text}. Delete a line of units; a CSV is read with --delimiter, --encoding and "
            "--decimal"
        ) from error
    if not table.num_rows:
        raise InputError(f"{path}: has no row")
    values = {}
    for role, (name, _, factor, offset) in list(columns.items()):
        if name.strip() not in headings:
            raise InputError(f"{path}: has no column {name!r}; {nearest(name, headings, 'it has')}")
        if headings.count(name.strip()) > 1:
            raise InputError(f"{path}: has {headings.count(name.strip())} columns {name!r}: rename all but one")
        numbers = table[headings.index(name.strip())]
        is_text, is_date = pa.types.is_string(numbers.type), pa.types.is_timestamp(numbers.type)
        if role == "time" and (is_text or is_date):
            columns[role] = columns[role]._replace(unit="s")
            if is_text:
                values[role] = _stamps(f"{path}: column {name!r}", numbers.to_pylist())
                continue
            stamps = numbers.cast(pa.timestamp("ns", numbers.type.tz)).to_numpy()
            # Nanoseconds are subtracted as integers: a double has a quarter of a microsecond in 2026.
            values[role] = (stamps - np.fmin.reduce(stamps)) / np.timedelta64(1, "ns") * 1e-9
            continue
        if not any(check(numbers.type) for check in (pa.types.is_integer, pa.types.is_floating, pa.types.is_null)):
            raise InputError(f"{path}: column {name!r} holds {numbers.type}, not numbers (--delimiter, --decimal)")
        floats = numbers.cast(pa.float64(), safe=False).to_numpy()
        with np.errstate(over="ignore", invalid="ignore"):
            beyond = np.abs(floats) > LARGEST
            if 2 * len(np.unique(floats[beyond])) > len(floats):
                raise InputError(f"{path}: column {name!r}: {beyond.sum():,} numbers are beyond {LARGEST:g}: its unit?")
            values[role] = np.where(beyond, np.nan, floats) * factor + offset
    return values


def _read_csv(path: Path, file: BinaryIO, columns: Mapping[str, Column], options: ReadOptions) -> pa.Table:
    """Read a CSV: numbers of the columns, text of the time and of all others.

    The heading is the line, among the comments at the beginning and the first other one, that has most of the columns'
    names, with or without its comment sign.
    """
    import pyarrow as pa
    import pyarrow.csv as pacsv

    pc: Any = import_module("pyarrow.compute")
    if "\0".encode(options.encoding) == b"\0":
        at = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ).find(b"\0")
        if at >= 0:
            where = "where a power cut ended a file; delete such bytes, as with tr -d '\\0' < LOG > CLEAN"
            raise InputError(f"{path}: byte {at:,} is NUL, as {'in UTF-16: --encoding utf-16' if at < 4 else where}")
    beginning: list[str] = []
    with path.open(encoding=options.encoding, errors="replace") as lines:
        for line in lines:
            beginning.append(line.lstrip("\ufeff"))
            if line.strip() and not _COMMENT.match(line):
                break
    last, most = len(beginning) - 1, -2
    wanted, names = {column.name.strip() for column in columns.values()}, [""]
    n_skipped = 0
    for number, line in reversed(list(enumerate(beginning))):
        for text in (_COMMENT.sub("", line), line):
            cells = [cell.strip() for cell in next(csv.reader([text], delimiter=options.delimiter))]
            found = len(wanted.intersection(cells)) - "".join(cells).startswith(tuple("+-.0123456789"))
            if cells and found > most:
                most, names, n_skipped = found, cells, max(number + 1, last + (number == last))
    if not wanted <= set(names) and "\ufffd" in "".join(names):
        raise ValueError(f"its heading is not {options.encoding}")
    read = pacsv.ReadOptions(encoding=options.encoding, use_threads=False, column_names=names, skip_rows=n_skipped)
    parse = pacsv.ParseOptions(delimiter=options.delimiter, newlines_in_values=True)
    kinds = dict.fromkeys(names, pa.binary())
    kinds |= dict.fromkeys(wanted, pa.float64())
    convert = pacsv.ConvertOptions(decimal_point=options.decimal, column_types=kinds, strings_can_be_null=True)
    convert.null_values = [*convert.null_values, "-", "--"]
    try:
        table = pacsv.read_csv(file, read, parse, convert)
    except pa.ArrowInvalid:
        if "time" not in columns:
            raise
        file.seek(0)
        convert.column_types = kinds | {columns["time"].name.strip(): pa.string()}  # its stamps may be dates
        table = pacsv.read_csv(file, read, parse, convert)
    for name, cells in zip(names, table.columns, strict=True):
        if pa.types.is_floating(cells.type):
            continue
        n_lines, n_delimiters = (
            np.array(pc.fill_null(pc.count_substring(cells, sign), 0), int) for sign in ("\n", options.delimiter)
        )
        n_lines[-1:] -= 1  # a quote that nothing ends takes the last line's end too
        rows = np.flatnonzero((n_lines > 0) & (n_delimiters >= n_lines * (len(names) - 1)))  # text has fewer than rows
        if len(rows):
            raise InputError(
                f"{path}: a quote in column {name!r}, about line {n_skipped + rows[0] + 1}, ends "
                f"{n_lines[rows[0]]:,} lines later, which are lost: delete the quotes"
            )
    return table


def _stamps(name: str, cells: Sequence[str | None]) -> np.ndarray:
    """Convert ISO dates, all with a zone or all without, to seconds from the first; NaN where there is none."""
    stamps, wrong = [], {}
    for row, cell in enumerate(cells, 1):
        try:
            stamps.append(cell and datetime.fromisoformat(_ZONE.sub(r"\1", cell.strip().upper().replace("UTC", "Z"))))
        except ValueError:
            wrong[row] = str(cell)
    if wrong:
        row = next((row for row in wrong if not _NUMBER.fullmatch(wrong[row])), min(wrong))
        raise InputError(
            f"{name}: {shortened(wrong[row])!r} in row {row} is no number and no date as 2026-11-25T10:00:00.25Z"
        )
    try:
        first = min(stamp for stamp in stamps if stamp)
        return np.array([(stamp - first).total_seconds() if stamp else math.nan for stamp in stamps])
    except TypeError as error:
        raise InputError(f"{name}: some stamps have a zone and some have none: write one for all, such as Z") from error
