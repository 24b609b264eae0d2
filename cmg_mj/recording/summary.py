"""The summary as a page of Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cmg_mj.metrics import MetricsSettings
from cmg_mj.push import Push
from cmg_mj.recording.recorded import Recorded

METRICS = {
    "settle_time_s": "Settle time [s]",
    "velocity_rms_error_rad_s": "Rate error, RMS [rad/s]",
    "velocity_rms_error_fog_rad_s": "… against the gyro [rad/s]",
    "tilt_rms_deg": "Tilt, RMS [deg]",
    "gimbal_peak_deg": "Gimbal, peak [deg]",
    "command_rms_rad_s": "Command, RMS [rad/s]",
    "command_saturated_fraction": "Command at its limit [%]",
    "bias_estimate_deg": "Estimated bias, mean [deg]",
    "bias_rms_error_deg": "… its RMS error [deg]",
}
"""The summary's numbers, in words and with their unit."""

OPTIONAL = ("bias_estimate_deg", "bias_rms_error_deg")
"""Those that only some observers have."""

SHORT = {
    "settle_time_s": "Settle [s]",
    "velocity_rms_error_rad_s": "Rate error [rad/s]",
    "tilt_rms_deg": "Tilt [deg]",
    "gimbal_peak_deg": "Gimbal [deg]",
    "command_rms_rad_s": "Command [rad/s]",
}
"""Those that find room when each run is a row."""

MOST_COLUMNS = 3
"""More runs than this are rows."""


def markdown(
    title: str, runs: Sequence[Recorded], pushes: Sequence[Push], settings: MetricsSettings, notes: str
) -> str:
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
    lines = [f"# {title or 'Run'}", "", *table, "", _pushes(pushes), "", band]
    for run in runs:
        if run.outcome.reason:
            lines += ["", f"**{run.name}**: {run.outcome.reason}"]
        companions = run.summary.get("companions")
        if companions:
            lines += ["", *_companions(run.name, companions)]
    return "\n".join([*lines, "", notes, ""])


def scenario_page(toml: str) -> str:
    """The scenario as Markdown."""
    return f"# Scenario\n\n```toml\n{toml.strip()}\n```\n"


def _by_column(runs: Sequence[Recorded]) -> list[str]:
    """A table with a column a run."""
    lines = [_row("", *(run.name for run in runs)), "|---|" + "---:|" * len(runs)]
    lines.append(_row("Outcome", *map(_outcome, runs)))
    return lines + [
        _row(words, *(_number(key, run.summary.get(key)) for run in runs))
        for key, words in METRICS.items()
        if key not in OPTIONAL or any(key in run.summary for run in runs)
    ]


def _by_row(runs: Sequence[Recorded]) -> list[str]:
    """A table with a row a run."""
    lines = [_row("", "Outcome", *SHORT.values()), "|---|---|" + "---:|" * len(SHORT)]
    return lines + [
        _row(run.name, _outcome(run), *(_number(key, run.summary.get(key)) for key in SHORT)) for run in runs
    ]


def _companions(name: str, companions: Mapping[str, Mapping[str, Any]]) -> list[str]:
    key = "velocity_rms_error_rad_s"
    lines = [f"Riding along open loop in the run of {name}:", "", _row("", METRICS[key]), "|---|---:|"]
    return lines + [_row(companion, _number(key, of.get(key))) for companion, of in companions.items()]


def _row(*cells: str) -> str:
    return "| " + " | ".join(cells) + " |"


def _outcome(run: Recorded) -> str:
    return f"{run.outcome.kind} at {run.outcome.time_s:.4g} s"


def _number(key: str, value: float | None) -> str:
    if value is None:
        return "–"
    return f"{100.0 * value:.1f}" if key == "command_saturated_fraction" else f"{value:.3g}"


def _pushes(pushes: Sequence[Push]) -> str:
    if not pushes:
        return "No push."
    listed = (f"{p.torque_n_m:+g} N m for {p.duration_s:g} s at {p.start_s:g} s" for p in pushes)
    return "Pushes: " + "; ".join(listed) + "."
