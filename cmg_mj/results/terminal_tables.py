"""Tables and lists for the terminal."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from cmg_mj.controllers.laws.registry import OF_LAWS
from cmg_mj.inputs.bundled import bundled
from cmg_mj.inputs.user_classes import UserClassKind
from cmg_mj.observers.registry import OF_OBSERVERS
from cmg_mj.results import markdown
from cmg_mj.results.per_world_table import open_loop_figures
from cmg_mj.results.summary_keys import AXES, KEYS, OPEN_LOOP_COLUMNS, difference, heading, spread, written
from cmg_mj.scenario.description import assignments
from cmg_mj.scenario.differences import describe_differences
from cmg_mj.scenario.loading import load_scenario

WIDEST = 8
"""Characters of a heading before it is broken."""

LESS_BEST = "Less the best of each column, world by world"
"""Above the second table of a comparison."""


def columns_of(summaries: Sequence[Mapping[str, Any]]) -> list[str]:
    """Summary keys that are compared, but that of stopped worlds only if there are any."""
    stopped = any(summary["stopped_fraction"] for summary in summaries)
    return [key for key, about in KEYS.items() if about.compared and (stopped or key != "stopped_fraction")]


def comparison_table(summaries: Sequence[Mapping[str, Any]], title: str) -> Group:
    """What `cmg-mj compare` prints: means, below each its 95 % interval; differences to the best; what they are."""
    tables = [_compared(summaries, title, columns_of(summaries), _mean)]
    if _has_differences(summaries):
        tables.append(_compared(summaries, LESS_BEST, _judged(summaries), _difference))
    return Group(*tables, comparison_note(summaries))


def _compared(
    summaries: Sequence[Mapping[str, Any]], title: str, columns: Sequence[str], cell: Callable[..., list[str]]
) -> Table:
    table = Table(title=_title(title), box=box.SIMPLE_HEAD, title_justify="left", padding=0)
    table.add_column("observer", vertical="bottom", overflow="fold")
    for key in columns:
        unit = [f"[{KEYS[key].unit}]"] if KEYS[key].unit else []
        lines = [*textwrap.wrap(KEYS[key].label, WIDEST, break_long_words=False), *unit]
        table.add_column("\n".join(lines), justify="right", vertical="bottom")
    for summary in summaries:
        cells = [[summary["observer"]], *(cell(summary, key) for key in columns)]
        height = max(map(len, cells))
        table.add_row(*("\n".join([*lines, *[" "] * (height - len(lines))]) for lines in cells))
    return table


def comparison_markdown(summaries: Sequence[Mapping[str, Any]]) -> str:
    """The same in Markdown."""
    parts = [_markdown(summaries, columns_of(summaries), _mean)]
    if _has_differences(summaries):
        parts += [f"{LESS_BEST}:", _markdown(summaries, _judged(summaries), _difference)]
    return "\n\n".join([*parts, comparison_note(summaries)])


def _markdown(summaries: Sequence[Mapping[str, Any]], columns: Sequence[str], cell: Callable[..., list[str]]) -> str:
    rows = [(f"`{s['observer']}`", *(" ".join(cell(s, key)) for key in columns)) for s in summaries]
    return markdown.table(["observer", *map(heading, columns)], rows)


def _judged(summaries: Sequence[Mapping[str, Any]]) -> list[str]:
    """The columns in which one observer is the best."""
    return [key for key in columns_of(summaries) if any(key in summary["minus_best"] for summary in summaries)]


def _has_differences(summaries: Sequence[Mapping[str, Any]]) -> bool:
    return any(less["interval"] for summary in summaries for less in summary["minus_best"].values())


def _mean(summary: Mapping[str, Any], key: str) -> list[str]:
    """A mean as a table shows it, and half its interval."""
    return _with_half(written(key, summary[key]), key, summary["intervals"].get(key))


def _difference(summary: Mapping[str, Any], key: str) -> list[str]:
    """A difference to the best as a table shows it, and half its interval."""
    less = summary["minus_best"].get(key)
    return ["best"] if less is None else _with_half(difference(key, less["mean"]), key, less["interval"])


def _with_half(text: str, key: str, ends: Sequence[float] | None) -> list[str]:
    return [text] if ends is None else [text, spread(key, (ends[1] - ends[0]) / 2.0)]


def comparison_note(summaries: Sequence[Mapping[str, Any]]) -> str:
    """What the tables of a comparison do not say by themselves."""
    lines = [
        "Means over the worlds that stood to the end (settle time: that settled), with 95 % intervals.",
        "Push window: from a push's start to 1 s after its end.",
        "Fit: 1 - RMS error / RMS of the true velocity; 1 is the truth, 0 an estimate of zero.",
    ]
    riding = next((summary["in_loop_of"] for summary in summaries if "in_loop_of" in summary), None)
    if riding:
        lines.append(
            f"What closes no loop rides along in that of {riding}, the best:\n"
            "zero, an estimate of zero; mems_gyro, a two-dollar gyro; floor_y1, the best linear filter of\n"
            "y1 alone (its last 0.5 s) for this very world, found afterwards; floor_accel, the least error that\n"
            "y1 with its acceleration allow for whatever motion, by the noise of their datasheet."
        )
    return "\n".join(lines)


def run_title(summary: Mapping[str, Any]) -> str:
    """Above what a run prints and draws: scenario, observer, seed, world, what differs from the bundled scenario."""
    place = " on the board" if summary.get("driver") == "board" else ""
    world = f", world {summary['world']}" if "world" in summary else ""
    differs = describe_differences(summary["differs"])
    return f"{summary['scenario'] or 'Run'}: {summary['observer']}{place}, seed {summary['seed']}{world}{differs}"


def summary_table(summary: Mapping[str, Any]) -> Group:
    """What `cmg-mj run` prints: the figures, and how well those that rode along estimated the rate."""
    ends = {"done": "stood to the end, {:g} s", "fell": "fell at {:.2f} s"}
    outcome = str(summary["outcome"])
    end = ends.get(outcome, outcome + " at {:g} s").format(summary["end_time_s"])
    table = Table(
        title=_title(run_title(summary)),
        box=box.SIMPLE_HEAD,
        title_justify="left",
        show_header=False,
    )
    axes = summary.get(AXES) or {"": summary}
    table.show_header = len(axes) > 1
    table.add_column()
    for name in axes:
        table.add_column(name, justify="right")
    table.add_row("Outcome", end)
    for key in KEYS:
        if key in summary:
            table.add_row(_capitalised(heading(key)), *(written(key, own.get(key)) for own in axes.values()))
    return Group(table, *(riding for name, own in axes.items() if (riding := _riding(name, own)).row_count))


def _riding(axis: str, summary: Mapping[str, Any]) -> Table:
    """How well those that rode along estimated an axis' rate."""
    riding = Table(box=box.SIMPLE_HEAD, padding=(0, 0, 0, 1))
    riding.add_column(f"Riding along, {axis}" if axis else "Riding along", vertical="bottom", overflow="fold")
    for key in OPEN_LOOP_COLUMNS:
        riding.add_column(heading(key).replace(" [", "\n["), justify="right", vertical="bottom")
    for name, figures in open_loop_figures(summary).items():
        riding.add_row(name, *(written(key, figures.get(key)) for key in OPEN_LOOP_COLUMNS))
    return riding


def _title(text: str) -> Text:
    """A table's title on one line, even if the table is not as wide."""
    return Text(text, style="table.title", no_wrap=True, overflow="ignore")


def _capitalised(text: str) -> str:
    return text[:1].upper() + text[1:]


def scenario_list() -> str:
    """What `cmg-mj list scenarios` prints."""
    names = bundled("scenarios")
    width = max(len(name) for name in names)
    return "\n".join(["Scenarios", *(f"  {name:{width}}  {load_scenario(name).title}" for name in names)])


def observer_list() -> str:
    """What `cmg-mj list observers` prints: every observer, the defaults of its parameters, what it is."""
    return _class_list(OF_OBSERVERS)


def law_list() -> str:
    """What `cmg-mj list laws` prints: every control law, the defaults of its parameters, what it is."""
    return _class_list(OF_LAWS)


def _class_list(kind: UserClassKind) -> str:
    """All of a kind: name, the defaults of its parameters, what it is."""
    width = max(len(name) for name in kind.known)
    lines = [f"{kind.what.capitalize()}s, and the defaults of their parameters (--set {kind.section}.NAME=VALUE)"]
    for name in kind.known:
        taken = kind.takes(name)
        title = (sys.modules[kind.find(name).__module__].__doc__ or "").partition("\n")[0]
        defaults = assignments({own: taken[own].default for own in kind.own(name)}) or "no parameters"
        indent = " " * (width + 4)
        # A default is kept in one piece: its spaces are not those to break at.
        wrapped = textwrap.wrap(defaults.replace(", ", ",\0"), 98, initial_indent=indent, subsequent_indent=indent)
        lines.append(f"  {name:{width}}  {wrapped[0].strip()}".replace("\0", " "))
        lines += [line.replace("\0", " ") for line in wrapped[1:]]
        lines += textwrap.wrap(title, 98, initial_indent=indent, subsequent_indent=indent)
    return "\n".join(lines)
