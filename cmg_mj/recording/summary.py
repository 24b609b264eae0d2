"""The summary as a page of Markdown."""

from __future__ import annotations

from collections.abc import Sequence
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
}
"""The summary's numbers, in words and with their unit."""


def markdown(
    title: str, runs: Sequence[Recorded], pushes: Sequence[Push], settings: MetricsSettings, notes: str
) -> str:
    """Write the summary.

    Args:
        title: The experiment's title.
        runs: The runs, a column each.
        pushes: Torques from outside.
        settings: The settle band.
        notes: A last paragraph.

    Returns:
        The page.
    """
    lines = [
        f"# {title or 'Run'}",
        "",
        "| | " + " | ".join(run.name for run in runs) + " |",
        "|---|" + "---:|" * len(runs),
        "| Outcome | " + " | ".join(_outcome(run) for run in runs) + " |",
    ]
    for key, words in METRICS.items():
        lines.append(f"| {words} | " + " | ".join(_number(key, run.summary.get(key)) for run in runs) + " |")
    lines += [
        "",
        _pushes(pushes),
        "",
        f"Settled: the tilt stays within ±{settings.settle_band_deg:g}° to the end.",
    ]
    for run in runs:
        companions = run.summary.get("companions")
        if companions:
            lines += ["", *_companions(run.name, companions)]
        if run.outcome.reason:
            lines += ["", f"**{run.name}**: {run.outcome.reason}"]
    return "\n".join([*lines, "", notes, ""])


def scenario_page(toml: str) -> str:
    """The scenario as Markdown."""
    return f"# Scenario\n\n```toml\n{toml.strip()}\n```\n"


def _companions(name: str, companions: dict[str, Any]) -> list[str]:
    lines = [
        f"Riding along in the run of {name}, open loop:",
        "",
        "| | Rate error, RMS [rad/s] |",
        "|---|---:|",
    ]
    for companion, numbers in companions.items():
        lines.append(f"| {companion} | {_number('', numbers.get('velocity_rms_error_rad_s'))} |")
    return lines


def _outcome(run: Recorded) -> str:
    return f"**{run.outcome.kind}** at {run.outcome.time_s:.4g} s"


def _number(key: str, value: float | None) -> str:
    if value is None:
        return "–"
    return f"{100.0 * value:.1f}" if key == "command_saturated_fraction" else f"{value:.3g}"


def _pushes(pushes: Sequence[Push]) -> str:
    if not pushes:
        return "No push."
    return (
        "Pushes: " + "; ".join(f"{p.torque_n_m:+g} N m for {p.duration_s:g} s at {p.start_s:g} s" for p in pushes) + "."
    )
