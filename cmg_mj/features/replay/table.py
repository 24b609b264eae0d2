"""Columns of a CSV or Parquet file as numbers: their roles, their units, and the reading by Arrow."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from cmg_mj.core.errors import InputError, nearest, shortened
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.features.replay.log import ReadOptions

if TYPE_CHECKING:
    import pyarrow as pa

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
