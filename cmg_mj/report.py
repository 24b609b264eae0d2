"""Tables and lists for the terminal."""

from __future__ import annotations

import inspect
import sys
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

from rich import box
from rich.table import Table

from cmg_mj import markdown
from cmg_mj.description import assignments
from cmg_mj.observers import OBSERVERS, observer_class
from cmg_mj.resources import bundled
from cmg_mj.scenario import load_scenario
from cmg_mj.summary_keys import KEYS, heading, written

WIDEST = 9
"""Characters of a heading before it is broken."""


def columns_of(summaries: Sequence[Mapping[str, Any]]) -> list[str]:
    """Summary keys that are compared, but that of stopped worlds only if there are any."""
    stopped = any(summary["stopped_fraction"] for summary in summaries)
    return [key for key, about in KEYS.items() if about.compared and (stopped or key != "stopped_fraction")]


def comparison_table(summaries: Sequence[Mapping[str, Any]], title: str) -> Table:
    """The table that `cmg-mj compare` prints."""
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left", padding=(0, 1, 0, 0))
    table.add_column("observer", vertical="bottom", overflow="fold")
    columns = columns_of(summaries)
    for key in columns:
        unit = [f"[{KEYS[key].unit}]"] if KEYS[key].unit else []
        lines = [*textwrap.wrap(KEYS[key].label, WIDEST, break_long_words=False), *unit]
        table.add_column("\n".join(lines), justify="right", vertical="bottom")
    for summary in summaries:
        table.add_row(summary["observer"], *(written(key, summary[key]) for key in columns))
    return table


def comparison_markdown(summaries: Sequence[Mapping[str, Any]]) -> str:
    """The same table in Markdown."""
    columns = columns_of(summaries)
    rows = [(f"`{s['observer']}`", *(written(key, s[key]) for key in columns)) for s in summaries]
    return markdown.table(["observer", *map(heading, columns)], rows)


def summary_table(summary: Mapping[str, Any]) -> Table:
    """The table that `cmg-mj run` prints."""
    ends = {"done": "stood to the end, {:g} s", "fell": "fell at {:.2f} s"}
    outcome = str(summary["outcome"])
    end = ends.get(outcome, outcome + " at {:g} s").format(summary["end_time_s"])
    table = Table(
        title=f"{summary['scenario'] or 'Run'}: {summary['observer']}, seed {summary['seed']}",
        box=box.SIMPLE_HEAD,
        title_justify="left",
        show_header=False,
    )
    table.add_column()
    table.add_column(justify="right")
    table.add_row("Outcome", end)
    for key in KEYS:
        if key in summary:
            table.add_row(_capitalised(heading(key)), written(key, summary[key]))
    error = "velocity_rms_error_rad_s"
    for name, figures in summary.get("companions", {}).items():
        of = KEYS[error]._replace(label=f"{KEYS[error].label} of {name}")
        table.add_row(_capitalised(of.heading), written(error, figures[error]))
    return table


def _capitalised(text: str) -> str:
    return text[:1].upper() + text[1:]


def scenario_list() -> str:
    """What `cmg-mj list scenarios` prints."""
    names = bundled("scenarios")
    width = max(len(name) for name in names)
    return "\n".join(["Scenarios", *(f"  {name:{width}}  {load_scenario(name).title}" for name in names)])


def observer_list() -> str:
    """What `cmg-mj list observers` prints: every observer, the defaults of its parameters, what it is."""
    width = max(len(name) for name in OBSERVERS)
    lines = ["Observers, and the defaults of their parameters (--set observer.NAME=VALUE)"]
    for name in OBSERVERS:
        cls = observer_class(name)
        parameters = [p for p in inspect.signature(cls).parameters.values() if p.name not in ("dt", "model")]
        title = (sys.modules[cls.__module__].__doc__ or "").partition("\n")[0]
        defaults = assignments({p.name: p.default for p in parameters}) or "no parameters"
        indent = " " * (width + 4)
        # A default is kept in one piece: its spaces are not those to break at.
        wrapped = textwrap.wrap(defaults.replace(", ", ",\0"), 98, initial_indent=indent, subsequent_indent=indent)
        lines.append(f"  {name:{width}}  {wrapped[0].strip()}".replace("\0", " "))
        lines += [line.replace("\0", " ") for line in wrapped[1:]]
        lines += textwrap.wrap(title, 98, initial_indent=indent, subsequent_indent=indent)
    return "\n".join(lines)
