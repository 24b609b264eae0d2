"""Tables and lists that `run`, `compare` and `list` print."""

from __future__ import annotations

import textwrap
from collections.abc import Container, Iterable, Mapping, Sequence
from typing import Any

from rich.console import Group

from cmg_mj.core.errors import TomlValue
from cmg_mj.inputs.files import bundled
from cmg_mj.inputs.user_classes import UserClassKind
from cmg_mj.results.baselines import MEMS_AS_BOUGHT, MEMS_GYRO
from cmg_mj.results.floors import FLOOR_ACCELERATION, NO_ACCELERATION_FLOOR, NOISE_ALONE
from cmg_mj.results.intervals import Interval, format_interval
from cmg_mj.results.summary_keys import (
    AXES,
    KEYS,
    OPEN_LOOP_COLUMNS,
    SummaryValue,
    capitalised,
    format_figure,
    heading,
    open_loop_figures,
    section,
)
from cmg_mj.results.tables import Row, Table
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.scenario.resolve import describe_differences

ABOUT_FIGURES = """\
Error: RMS of the estimated tilt rate less the true one; push window: from a push to 1 s after it.
Fit: 1 - error / RMS of the true rate. Settle time: from the last push's end until the tilt stays
within metrics.settle_band_deg, by default 1 deg. Gimbal peak: largest angle from upright."""
ABOUT_COMPARISONS = f"""\
Means over the worlds that stood to the end (settle time: that settled), with 95 % intervals.
{ABOUT_FIGURES}"""
ABOUT_BASELINES = """\
zero: always 0. mems_fused: a two-dollar gyro, fused with the tilt. All figures: --json.
Floors: lower bounds on the error, from the tilt (floor_y1), or tilt and acceleration (floor_accel)."""
BESIDE = ("velocity_rms_error_fog", "velocity_rms_rad", "velocity_fit_", "command_")
PRINTED = [key for key in KEYS if not key.startswith(BESIDE)]
"""Figures of an observer in the loop that `run` and `compare` print."""
NOT_PRINTED = (MEMS_AS_BOUGHT, MEMS_GYRO)
"""Baselines that `run` and `compare` do not print."""


def comparison_tables(summaries: Sequence[Row], title: str) -> list[Table]:
    """Tabulate a comparison.

    Args:
        summaries: Its rows, as `cmg-mj compare --json` prints them.
        title: Of the first table.

    Returns:
        The means with their 95 % intervals and, if there are any, the paired differences to the best of each column.
    """
    stopped = any(summary["stopped_fraction"] for summary in summaries)
    summaries = [summary for summary in summaries if summary["observer"] not in NOT_PRINTED]
    keys = [key for key in PRINTED if KEYS[key].compared and (stopped or key != "stopped_fraction")]
    tables = [Table(_headings("observer", keys), summaries, title, _mean_entry)]
    differences = [summary["minus_best"] for summary in summaries]
    if any(less["interval"] for row in differences for less in row.values()):
        headings = _headings("observer", [key for key in keys if any(key in row for row in differences)])
        tables.append(Table(headings, summaries, "Less the best of each column, world by world", _difference_entry))
    return tables


def comparison_note(summaries: Sequence[Row]) -> str:
    """Explain the tables of a comparison."""
    falls = [
        f"{summary['observer']} at {summary['fell_from_to_s'][0]:.1f} to {summary['fell_from_to_s'][1]:.1f} s"
        for summary in summaries
        if summary.get("fell_from_to_s")
    ]
    note = f"{ABOUT_COMPARISONS}\nFell: {', '.join(falls)}." if falls else ABOUT_COMPARISONS
    loop = next((summary["in_loop_of"] for summary in summaries if "in_loop_of" in summary), None)
    if not loop:
        return note
    floors = about_floors([summary["observer"] for summary in summaries])
    return f"{note}\nOpen loop, on the motion of {loop}, the best:\n{ABOUT_BASELINES}\n{floors}"


def comparison_table(summaries: Sequence[Row], title: str) -> Group:
    """Make what `cmg-mj compare` prints."""
    return Group(*(table.rich() for table in comparison_tables(summaries, title)), comparison_note(summaries))


def comparison_markdown(summaries: Sequence[Row]) -> str:
    """Make the same in Markdown."""
    means, *differences = comparison_tables(summaries, "")
    less = [f"{table.title}:\n\n{table.markdown()}" for table in differences]
    return "\n\n".join([means.markdown(), *less, comparison_note(summaries)])


def _headings(first: str, keys: Iterable[str]) -> dict[str, str]:
    return {"observer": first, **{key: heading(key) for key in keys}}


def _mean_entry(summary: Row, key: str) -> str:
    return _with_interval(key, summary[key], summary["intervals"].get(key))


def _difference_entry(summary: Row, key: str) -> str:
    less = summary["minus_best"].get(key)
    return "best" if less is None else _with_interval(key, less["mean"], less["interval"], "+")


def _with_interval(key: str, mean: float | None, ends: Sequence[float | None] | None, sign: str = "") -> str:
    known = [value for value in (mean, *(ends or ())) if value is not None]
    interval = format_interval(KEYS[key].pattern, Interval(*known)) if len(known) == 3 else []
    return "\n".join([format_figure(key, mean, sign), *interval])


def run_title(summary: Row) -> str:
    """Name a run in a line: scenario, observer, seed, world, what differs from the bundled scenario."""
    place = " on the board" if summary.get("driver") == "board" else ""
    world = f", world {summary['world']}" if "world" in summary else ""
    differs = describe_differences(summary["differs"])
    return f"{summary['scenario'] or 'Run'}: {summary['observer']}{place}, seed {summary['seed']}{world}{differs}"


def summary_table(summary: Row) -> Group:
    """Make what `cmg-mj run` prints: the figures of each axis, and those of its open-loop observers."""
    axes = section(summary, AXES) or {"": summary}
    printed = {name: {key: axis[key] for key in PRINTED if key in axis} for name, axis in axes.items()}
    first = next(iter(printed))
    printed[first] |= {key: summary[key] for key in PRINTED if key in summary and key not in printed[first]}
    end = outcome_in_words(str(summary["outcome"]), summary["end_time_s"])
    tables, floors = [figures_table(printed, {next(iter(axes)): end}, run_title(summary))], ""
    for name, axis in axes.items():
        if figures := open_loop_figures(axis):
            shown = {other: figures[other] for other in figures if other not in NOT_PRINTED}
            tables.append(estimates_table(f"Open loop, {name}" if name else "Open loop", shown))
            floors = f"\n{ABOUT_BASELINES}\n{about_floors(figures)}"
    return Group(*(table.rich() for table in tables), ABOUT_FIGURES + floors)


def outcome_in_words(kind: str, time_s: SummaryValue) -> str:
    """Say how a run ended, and when."""
    ends = {"done": "stood to the end, {:g} s", "fell": "fell at {:.2f} s"}
    return ends.get(kind, kind + " at {:g} s").format(time_s)


def figures_table(summaries: Mapping[str, Row], outcomes: Mapping[str, str], title: str = "") -> Table:
    """Tabulate summaries, a column each, with a row for each figure that any of them has.

    Args:
        summaries: Heading -> summary.
        outcomes: Heading -> outcome in words.
        title: Above the table in the terminal.
    """
    rows: list[Row] = [{"figure": "Outcome", **outcomes}]
    for key in KEYS:
        if any(key in summary for summary in summaries.values()):
            figures = {name: format_figure(key, summary.get(key)) for name, summary in summaries.items()}
            rows.append({"figure": capitalised(heading(key)), **figures})
    columns = {"figure": "", **{name: name for name in summaries}}
    return Table(columns, rows, title, lambda row, key: str(row.get(key, "")), named=False)


def estimates_table(
    first: str, figures: Mapping[str, Row], keys: Sequence[str] = OPEN_LOOP_COLUMNS, *, named: bool = True
) -> Table:
    """Tabulate how well observers and baselines estimate the rate.

    Args:
        first: Heading of the names.
        figures: Name -> figures.
        keys: The figures to show.
        named: Whether the names are code in Markdown.
    """
    rows = [{**values, "observer": name} for name, values in figures.items()]
    return Table(_headings(first, keys), rows, "", lambda row, key: format_figure(key, row.get(key)), named)


def about_floors(names: Container[SummaryValue]) -> str:
    """Explain the floors among some baselines."""
    return NOISE_ALONE if FLOOR_ACCELERATION in names else NO_ACCELERATION_FLOOR


def scenario_list() -> str:
    """List the bundled scenarios and their titles."""
    names = bundled("scenarios")
    width = max(map(len, names))
    return "\n".join(["Scenarios", *(f"  {name:{width}}  {load_scenario(name).title}" for name in names)])


def class_list(kind: UserClassKind) -> str:
    """List every observer, or every control law, the defaults of its parameters, and its description."""
    width = max(map(len, kind.known))
    indent = " " * (width + 4)
    lines = [f"{kind.what.capitalize()}s, and the defaults of their parameters (--set {kind.section}.NAME=VALUE)"]
    for name in kind.known:
        parameters = kind.takes(name)
        title = (kind.find(name).__doc__ or "").partition("\n")[0]
        defaults = assignments({key: parameters[key].default for key in kind.own(name)}) or "no parameters"
        # A default is kept in one piece: its spaces are not those to break at.
        wrapped = textwrap.wrap(defaults.replace(", ", ",\0"), 98, initial_indent=indent, subsequent_indent=indent)
        wrapped[0] = f"  {name:{width}}  {wrapped[0].strip()}"
        lines += [line.replace("\0", " ") for line in wrapped]
        lines += textwrap.wrap(title, 98, initial_indent=indent, subsequent_indent=indent)
    return "\n".join(lines)


def lines(title: str, rows: Iterable[tuple[str, Any]]) -> str:
    """Join a title, and rows of a label and a text; rows without a text are left out."""
    return "\n".join([title, *(f"  {label:10}  {text}" for label, text in rows if text)])


def assignments(values: Mapping[str, TomlValue]) -> str:
    """Parameters and their values, as `--set` takes them."""
    return "  ".join(f"{name}={number(value)}" for name, value in values.items())


def number(value: TomlValue) -> str:
    """Return a value as TOML writes it, to six digits."""
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(number(item) for item in value)}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
