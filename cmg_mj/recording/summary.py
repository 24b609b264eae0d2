"""The summary as a page of Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cmg_mj import markdown
from cmg_mj.metrics import MetricsSettings
from cmg_mj.push import Push
from cmg_mj.recording.run import Run
from cmg_mj.summary_keys import KEYS, heading, written

FEWER = ("settle_time_s", "velocity_rms_error_rad_s", "tilt_rms_deg", "gimbal_peak_deg", "command_rms_rad_s")
"""Those that find room when each run is a row."""

MOST_COLUMNS = 3
"""More runs than this are rows."""


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
    table = _by_column(runs) if len(runs) <= MOST_COLUMNS else _by_row(runs)
    band = f"Settled: the tilt stays within ±{settings.settle_band_deg:g}° to the end."
    lines = [f"# {title or 'Run'}", "", table, "", _pushes(pushes), "", band]
    for run in runs:
        if run.outcome.reason:
            lines += ["", f"**{run.name}**: {run.outcome.reason}"]
        companions = run.summary.get("companions")
        if companions:
            lines += ["", _companions(run.name, companions)]
    return "\n".join([*lines, "", notes, ""])


def scenario_page(toml: str) -> str:
    """The scenario as Markdown."""
    return f"# Scenario\n\n```toml\n{toml.strip()}\n```\n"


def _by_column(runs: Sequence[Run]) -> str:
    """A table with a column a run."""
    rows = [("Outcome", *map(_outcome, runs))]
    rows += [
        (heading(key), *(written(key, run.summary.get(key)) for run in runs))
        for key in KEYS
        if any(key in run.summary for run in runs)
    ]
    return markdown.table(("", *(run.name for run in runs)), rows)


def _by_row(runs: Sequence[Run]) -> str:
    """A table with a row a run."""
    rows = [(run.name, _outcome(run), *(written(key, run.summary.get(key)) for key in FEWER)) for run in runs]
    return markdown.table(("", "Outcome", *map(heading, FEWER)), rows, text_columns=2)


def _companions(name: str, companions: Mapping[str, Mapping[str, Any]]) -> str:
    key = "velocity_rms_error_rad_s"
    rows = [(companion, written(key, of.get(key))) for companion, of in companions.items()]
    return f"Riding along open loop in the run of {name}:\n\n{markdown.table(('', heading(key)), rows)}"


def _outcome(run: Run) -> str:
    return f"{run.outcome.kind} at {run.outcome.time_s:.4g} s"


def _pushes(pushes: Sequence[Push]) -> str:
    if not pushes:
        return "No push."
    listed = (f"{p.torque_n_m:+g} N m for {p.duration_s:g} s at {p.start_s:g} s" for p in pushes)
    return "Pushes: " + "; ".join(listed) + "."
