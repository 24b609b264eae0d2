"""The pages of a recording in Markdown, and the properties by which a catalogue finds it."""

from __future__ import annotations

from collections.abc import Sequence

import rerun as rr

from cmg_mj.results.floors import NOISE_ALONE
from cmg_mj.results.summary_keys import KEYS, OPEN_LOOP_COLUMNS, format_figure, heading
from cmg_mj.results.tables import markdown_table
from cmg_mj.scenario.resolve import versions
from cmg_mj.stages.push import Push
from cmg_mj.stages.swing import Swing
from cmg_mj.view.plots.style import FEW
from cmg_mj.view.recording.run import LegendEntry, RecordingHeader, Run
from cmg_mj.view.recording.scene import FLYWHEEL_SLOWDOWN
from cmg_mj.view.recording.signals import Branch
from cmg_mj.view.recording.stream import log_page

ROW_TABLES = (
    ("velocity_rms_error_push_rad_s", "velocity_fit"),
    ("velocity_rms_error_rad_s", "settle_time_s", "tilt_rms_deg"),
    ("velocity_fit_push", "gimbal_peak_deg", "command_rms_rad_s"),
)
"""Keys of the tables with a row for each run, no wider than their view; the first key ranks the runs."""

OPEN_LOOP_TABLES = (OPEN_LOOP_COLUMNS[:2], OPEN_LOOP_COLUMNS[2:])
"""Keys of the tables with a row for each observer."""

BOLD = "In bold: those that are switched on in the plots; the legends of the other tab switch on any."
NOTES = f"In the 3-D view the flywheels turn at 1/{FLYWHEEL_SLOWDOWN:g} of their speed."


def log_pages(rec: rr.RecordingStream, header: RecordingHeader, branches: Sequence[Branch]) -> None:
    """Record the properties and pages of finished runs."""
    package_versions = {name: versions()[name] for name in ("cmg_mj", "mujoco")}
    names = [branch.run.name for branch in branches]
    rec.send_property("experiment", rr.AnyValues(True, **package_versions, title=header.title, runs=names))
    for run in (branch.run for branch in branches):
        numbers = {key: value for key, value in run.summary.items() if isinstance(value, float)}
        values = rr.AnyValues(True, **numbers, outcome=run.outcome.kind, time_s=run.outcome.time_s)
        rec.send_property(rr.escape_entity_path_part(run.name), values)
    log_page(rec, "summary", summary_page(header, branches))
    if observers := observers_page(branches):
        log_page(rec, "observers", observers)
    log_page(rec, "scenario", f"# Scenario\n\n```toml\n{header.scenario_toml.strip()}\n```\n")


def summary_page(header: RecordingHeader, branches: Sequence[Branch]) -> str:
    """Write the page of summaries in Markdown."""
    tables = [_by_column(branches)] if len(branches) <= FEW else _by_row(branches)
    band = f"Settled: the tilt stays within ±{header.settings.settle_band_deg:g}° to the end."
    runs = [branch.run for branch in branches]
    reasons = [f"**{run.name}**: {run.outcome.reason}" for run in runs if run.outcome.reason]
    return _paragraphs(
        f"# {header.title or 'Run'}", *tables, _pushes(header.pushes), *_swings(header.swings), band, *reasons, NOTES
    )


def observers_page(branches: Sequence[Branch]) -> str:
    """Write the page of all observers of a run; of several runs, of those with open-loop observers."""
    selection = [branch for branch in branches if len(branches) == 1 or branch.run.open_loop_observers]
    return _paragraphs(*(part for branch in selection for part in _estimates(branch)))


def _estimates(branch: Branch) -> list[str]:
    """Write tables of one run's observers and, below them, its baselines."""
    run = branch.run
    names = [*map(_marked, branch.observers), *run.references]
    summaries = [*run.observers.values(), *run.references.values()]
    intro = f"In the run of {run.name}.{' The others are open loop.' if len(names) > 1 else ''}"
    parts = [f"{intro} {BOLD}" if len(run.observers) > FEW else intro]
    for keys in OPEN_LOOP_TABLES:
        rows = [
            (name, *(format_figure(key, summary.get(key)) for key in keys))
            for name, summary in zip(names, summaries, strict=True)
        ]
        parts.append(markdown_table(("", *map(heading, keys)), rows))
    return [*parts, NOISE_ALONE] if run.references else parts


def _by_column(branches: Sequence[Branch]) -> str:
    """Write a table with a column for each run."""
    runs = [branch.run for branch in branches]
    rows = [("Outcome", *map(_outcome, runs))]
    rows += [
        (heading(key), *(format_figure(key, run.summary.get(key)) for run in runs))
        for key in KEYS
        if any(key in run.summary for run in runs)
    ]
    return markdown_table(("", *(branch.label for branch in branches)), rows)


def _by_row(branches: Sequence[Branch]) -> list[str]:
    """Write tables with a row for each run."""
    runs = [branch.run for branch in branches]
    first = [[_marked(branch.entry) for branch in branches], [_outcome(run) for run in runs]]
    tables = []
    for i, keys in enumerate(ROW_TABLES):
        columns = [[format_figure(key, run.summary.get(key)) for run in runs] for key in keys]
        text = first if i == 0 else first[:1]
        headings = (*("", "Outcome")[: len(text)], *map(heading, keys))
        tables.append(markdown_table(headings, list(zip(*text, *columns, strict=True)), text_columns=len(text)))
    return [*tables, BOLD]


def _marked(entry: LegendEntry) -> str:
    """Shorten a name; make one that is switched on bold."""
    return f"**{entry.label}**" if entry.is_best else entry.label


def _outcome(run: Run) -> str:
    return f"{run.outcome.kind} at {run.outcome.time_s:.4g} s"


def _pushes(pushes: Sequence[Push]) -> str:
    if not pushes:
        return "No push."
    texts = (
        f"{p.torque_n_m:+g} N m{f' about {p.axis}' if p.axis else ''} for {p.duration_s:g} s at {p.start_s:g} s"
        for p in pushes
    )
    return "Pushes: " + "; ".join(texts) + "."


def _swings(swings: Sequence[Swing]) -> list[str]:
    texts = (
        f"{s.amplitude_n_m:g} N m{f' about {s.axis}' if s.axis else ''} at {s.frequency_hz:g} Hz from {s.start_s:g} s "
        f"{'to the end' if s.duration_s is None else f'for {s.duration_s:g} s'}"
        for s in swings
    )
    return ["Swings: " + "; ".join(texts) + "."] if swings else []


def _paragraphs(*parts: str) -> str:
    return "\n\n".join(parts) + "\n" if parts else ""
