"""The summary as pages of Markdown, in tables no wider than their view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cmg_mj.results import markdown
from cmg_mj.results.summary_keys import KEYS, OPEN_LOOP_COLUMNS, format_figure, heading
from cmg_mj.scenario.disturbances import Push
from cmg_mj.scenario.schema import MetricsSettings
from cmg_mj.visualization.plots.readability import FEW, short_names
from cmg_mj.visualization.recording.run import Run, best_observers, best_runs

ROW_TABLES = (
    ("velocity_rms_error_push_rad_s", "velocity_fit"),
    ("velocity_rms_error_rad_s", "settle_time_s", "tilt_rms_deg"),
    ("velocity_fit_push", "gimbal_peak_deg", "command_rms_rad_s"),
)
"""What is shown where each run is a row, table by table: first that by which the best are found."""

BOLD = "In bold: those that are switched on in the plots; the legends of the other tab switch on any."

RIDING_TABLES = (OPEN_LOOP_COLUMNS[:2], OPEN_LOOP_COLUMNS[2:])
"""What there is of an observer that rides along, table by table."""


def page(title: str, runs: Sequence[Run], pushes: Sequence[Push], settings: MetricsSettings, notes: str) -> str:
    """Write the summary.

    Args:
        title: The experiment's title.
        runs: The runs.
        pushes: Torques from outside.
        settings: The settle band.
        notes: A last paragraph.

    Returns:
        The page.
    """
    tables = [_by_column(runs)] if len(runs) <= FEW else _by_row(runs)
    band = f"Settled: the tilt stays within ±{settings.settle_band_deg:g}° to the end."
    reasons = [f"**{run.name}**: {run.outcome.reason}" for run in runs if run.outcome.reason]
    return _paragraphs(f"# {title or 'Run'}", *tables, _pushes(pushes), band, *reasons, notes)


def observers_page(runs: Sequence[Run]) -> str:
    """What is estimated in a run, by all that ride along; of several runs, of those with open-loop observers."""
    return _paragraphs(*(part for run in runs if len(runs) == 1 or run.open_loop_observers for part in _estimates(run)))


def _estimates(run: Run) -> list[str]:
    """One run's observers, then what they are judged beside, table by table."""
    references: Mapping[str, Mapping[str, Any]] = run.summary.get("references") or {}
    names = [*_marked(list(run.observers), best_observers(run)), *references]
    figures = [*run.observers.values(), *references.values()]
    said = f"In the run of {run.name}.{' The others ride along.' if len(names) > 1 else ''}"
    parts = [f"{said} {BOLD}" if len(run.observers) > FEW else said]
    for keys in RIDING_TABLES:
        rows = [[format_figure(key, of.get(key)) for key in keys] for of in figures]
        rows = [(name, *row) for name, row in zip(names, rows, strict=True)]
        parts.append(markdown.table(("", *map(heading, keys)), rows))
    return parts


def scenario_page(toml: str) -> str:
    """The scenario as Markdown."""
    return f"# Scenario\n\n```toml\n{toml.strip()}\n```\n"


def _by_column(runs: Sequence[Run]) -> str:
    """A table with a column a run."""
    rows = [("Outcome", *map(_outcome, runs))]
    rows += [
        (heading(key), *(format_figure(key, run.summary.get(key)) for run in runs))
        for key in KEYS
        if any(key in run.summary for run in runs)
    ]
    return markdown.table(("", *short_names([run.name for run in runs]).values()), rows)


def _by_row(runs: Sequence[Run]) -> list[str]:
    """Tables with a row a run."""
    first = [_marked([run.name for run in runs], best_runs(runs)), [_outcome(run) for run in runs]]
    tables = []
    for i, keys in enumerate(ROW_TABLES):
        columns = [[format_figure(key, run.summary.get(key)) for run in runs] for key in keys]
        text = first if i == 0 else first[:1]
        headings = (*("", "Outcome")[: len(text)], *map(heading, keys))
        tables.append(markdown.table(headings, list(zip(*text, *columns, strict=True)), text_columns=len(text)))
    return [*tables, BOLD]


def _marked(names: Sequence[str], best: Sequence[str]) -> list[str]:
    """Names, shortened; in bold those that are switched on."""
    return [f"**{short}**" if name in best else short for name, short in short_names(names).items()]


def _outcome(run: Run) -> str:
    return f"{run.outcome.kind} at {run.outcome.time_s:.4g} s"


def _pushes(pushes: Sequence[Push]) -> str:
    if not pushes:
        return "No push."
    listed = (
        f"{p.torque_n_m:+g} N m{f' about {p.axis}' if p.axis else ''} for {p.duration_s:g} s at {p.start_s:g} s"
        for p in pushes
    )
    return "Pushes: " + "; ".join(listed) + "."


def _paragraphs(*parts: str) -> str:
    return "\n\n".join(parts) + "\n" if parts else ""
