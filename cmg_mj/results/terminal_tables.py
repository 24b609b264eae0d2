"""Tables and lists for the terminal."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Callable, Mapping, Sequence

from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from cmg_mj.inputs.bundled import bundled
from cmg_mj.inputs.user_classes import UserClassKind
from cmg_mj.results import markdown
from cmg_mj.results.error_bounds import FLOOR_ACCELERATION, FLOORS, NO_ACCELERATION_FLOOR, NOISE_ALONE
from cmg_mj.results.intervals import Interval, format_interval, in_line
from cmg_mj.results.summary_keys import (
    AXES,
    KEYS,
    OPEN_LOOP_COLUMNS,
    SummaryValue,
    capitalised,
    format_difference,
    format_figure,
    heading,
    open_loop_figures,
    section,
)
from cmg_mj.scenario.description import assignments
from cmg_mj.scenario.differences import describe_differences
from cmg_mj.scenario.loading import load_scenario

WIDEST = 8
"""Characters of a heading before it is broken."""

LESS_BEST = "Less the best of each column, world by world"
"""Above the second table of a comparison."""


Comparison = Sequence[Mapping[str, SummaryValue]]
"""The rows of a comparison, as `cmg-mj compare --json` prints them."""
Cell = Callable[[Mapping[str, SummaryValue], str], list[str]]
"""Formats a row's figure: its number, and the lines of its interval if there is one."""


def columns_of(summaries: Comparison) -> list[str]:
    """Return the summary keys that are compared, that of stopped worlds only if there are any."""
    stopped = any(summary["stopped_fraction"] for summary in summaries)
    return [key for key, about in KEYS.items() if about.compared and (stopped or key != "stopped_fraction")]


def comparison_table(summaries: Comparison, title: str) -> Group:
    """Make what `cmg-mj compare` prints: means with their 95 % intervals, differences to the best, and a note."""
    tables = [_columns_table(summaries, title, columns_of(summaries), _mean_cell)]
    if _has_differences(summaries):
        tables.append(_columns_table(summaries, LESS_BEST, _columns_with_best(summaries), _difference_cell))
    return Group(*tables, comparison_note(summaries))


def _columns_table(summaries: Comparison, title: str, columns: Sequence[str], cell: Cell) -> Table:
    table = Table(title=_title(title), box=box.SIMPLE_HEAD, title_justify="left", padding=0)
    table.add_column("observer", vertical="bottom", overflow="fold")
    for key in columns:
        unit = [f"[{KEYS[key].unit}]"] if KEYS[key].unit else []
        lines = [*textwrap.wrap(KEYS[key].label, WIDEST, break_long_words=False), *unit]
        table.add_column("\n".join(lines), justify="right", vertical="bottom")
    for summary in summaries:
        cells = [[str(summary["observer"])], *(cell(summary, key) for key in columns)]
        height = max(map(len, cells))
        table.add_row(*("\n".join([*lines, *[" "] * (height - len(lines))]) for lines in cells))
    return table


def comparison_markdown(summaries: Comparison) -> str:
    """Make the same in Markdown."""
    parts = [_markdown(summaries, columns_of(summaries), _mean_cell)]
    if _has_differences(summaries):
        parts += [f"{LESS_BEST}:", _markdown(summaries, _columns_with_best(summaries), _difference_cell)]
    return "\n\n".join([*parts, comparison_note(summaries)])


def _markdown(summaries: Comparison, columns: Sequence[str], cell: Cell) -> str:
    rows = [(f"`{s['observer']}`", *(in_line(cell(s, key)) for key in columns)) for s in summaries]
    return markdown.table(["observer", *map(heading, columns)], rows)


def _columns_with_best(summaries: Comparison) -> list[str]:
    """Return the columns in which one observer is the best."""
    return [key for key in columns_of(summaries) if any(key in section(summary, "minus_best") for summary in summaries)]


def _has_differences(summaries: Comparison) -> bool:
    return any(less["interval"] for summary in summaries for less in section(summary, "minus_best").values())


def _mean_cell(summary: Mapping[str, SummaryValue], key: str) -> list[str]:
    intervals = summary["intervals"]
    ends = intervals.get(key) if isinstance(intervals, Mapping) else None
    return _with_interval(format_figure(key, summary[key]), key, summary[key], ends)


def _difference_cell(summary: Mapping[str, SummaryValue], key: str) -> list[str]:
    less = section(summary, "minus_best").get(key)
    return (
        ["best"]
        if less is None
        else _with_interval(format_difference(key, less["mean"]), key, less["mean"], less["interval"])
    )


def _with_interval(text: str, key: str, mean: SummaryValue, ends: SummaryValue) -> list[str]:
    match mean, ends:
        case float(), [float() as low, float() as high]:
            return [text, *format_interval(KEYS[key].pattern, Interval(mean, low, high))]
    return [text]


def comparison_note(summaries: Comparison) -> str:
    """Say what the tables of a comparison do not say by themselves."""
    lines = [
        "Means over the worlds that stood to the end (settle time: that settled), with 95 % intervals,",
        "both ends where one is much nearer to the mean.",
        "Push window: from a push's start to 1 s after its end.",
        "Fit: 1 - RMS error / RMS of the true velocity; 1 is the truth, 0 an estimate of zero.",
    ]
    loop = next((summary["in_loop_of"] for summary in summaries if "in_loop_of" in summary), None)
    if loop:
        has_acceleration = any(summary["observer"] == FLOOR_ACCELERATION for summary in summaries)
        acceleration = (
            "; floor_accel, the least error that y1 with its acceleration allow for whatever\nmotion"
            if has_acceleration
            else ""
        )
        lines.append(
            f"Open loop, on the motion of {loop}, the best:\n"
            "zero, an estimate of zero; mems_as_bought, a two-dollar gyro with its offset; mems_gyro, the same\n"
            "after a second at rest, at constant temperature; mems_fused, as bought, in a Kalman filter with y1;\n"
            "floor_y1, the best time-invariant filter of y1 alone (its last 0.5 s, 16 taps) for this very world,\n"
            f"found afterwards{acceleration}.{' ' if has_acceleration else chr(10)}{_about_floors(has_acceleration)}"
        )
    return "\n".join(lines)


def run_title(summary: Mapping[str, SummaryValue]) -> str:
    """Name a run in a line: scenario, observer, seed, world, what differs from the bundled scenario."""
    place = " on the board" if summary.get("driver") == "board" else ""
    place += f" at {summary['port']}" if "port" in summary else ""
    world = f", world {summary['world']}" if "world" in summary else ""
    changes = summary["differs"]
    differs = describe_differences(changes) if isinstance(changes, Mapping) else ""
    return f"{summary['scenario'] or 'Run'}: {summary['observer']}{place}, seed {summary['seed']}{world}{differs}"


def summary_table(summary: Mapping[str, SummaryValue]) -> Group:
    """Make what `cmg-mj run` prints: the figures, and those of the open-loop observers."""
    ends = {"done": "stood to the end, {:g} s", "fell": "fell at {:.2f} s"}
    outcome = str(summary["outcome"])
    end = ends.get(outcome, outcome + " at {:g} s").format(summary["end_time_s"])
    table = Table(title=_title(run_title(summary)), box=box.SIMPLE_HEAD, title_justify="left", show_header=False)
    axes = section(summary, AXES) or {"": summary}
    table.show_header = len(axes) > 1
    table.add_column()
    for name in axes:
        table.add_column(name, justify="right")
    table.add_row("Outcome", end)
    for key in KEYS:
        if key in summary:
            figures = (format_figure(key, axis_summary.get(key)) for axis_summary in axes.values())
            table.add_row(capitalised(heading(key)), *figures)
    open_loop = [_open_loop_table(name, axis_summary) for name, axis_summary in axes.items()]
    floors = {name for axis_summary in axes.values() for name in FLOORS if name in open_loop_figures(axis_summary)}
    about = [_about_floors(FLOOR_ACCELERATION in floors)] if floors else []
    return Group(table, *(rows for rows in open_loop if rows.row_count), *about)


def _about_floors(has_acceleration: bool) -> str:
    return NOISE_ALONE if has_acceleration else NO_ACCELERATION_FLOOR


def _open_loop_table(axis: str, summary: Mapping[str, SummaryValue]) -> Table:
    """Show how well the open-loop observers and the baselines estimate an axis' rate."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 0, 0, 1))
    table.add_column(f"Open loop, {axis}" if axis else "Open loop", vertical="bottom", overflow="fold")
    for key in OPEN_LOOP_COLUMNS:
        table.add_column(heading(key).replace(" [", "\n["), justify="right", vertical="bottom")
    for name, figures in open_loop_figures(summary).items():
        table.add_row(name, *(format_figure(key, figures.get(key)) for key in OPEN_LOOP_COLUMNS))
    return table


def _title(text: str) -> Text:
    """Put a table's title on one line, even if the table is not as wide."""
    return Text(text, style="table.title", no_wrap=True, overflow="ignore")


def scenario_list() -> str:
    """List the bundled scenarios and their titles."""
    names = bundled("scenarios")
    width = max(len(name) for name in names)
    return "\n".join(["Scenarios", *(f"  {name:{width}}  {load_scenario(name).title}" for name in names)])


def class_list(kind: UserClassKind) -> str:
    """List every observer, or every control law, the defaults of its parameters, and its description."""
    width = max(len(name) for name in kind.known)
    lines = [f"{kind.what.capitalize()}s, and the defaults of their parameters (--set {kind.section}.NAME=VALUE)"]
    for name in kind.known:
        parameters = kind.takes(name)
        title = (sys.modules[kind.find(name).__module__].__doc__ or "").partition("\n")[0]
        defaults = assignments({key: parameters[key].default for key in kind.own(name)}) or "no parameters"
        indent = " " * (width + 4)
        # A default is kept in one piece: its spaces are not those to break at.
        wrapped = textwrap.wrap(defaults.replace(", ", ",\0"), 98, initial_indent=indent, subsequent_indent=indent)
        lines.append(f"  {name:{width}}  {wrapped[0].strip()}".replace("\0", " "))
        lines += [line.replace("\0", " ") for line in wrapped[1:]]
        lines += textwrap.wrap(title, 98, initial_indent=indent, subsequent_indent=indent)
    return "\n".join(lines)
