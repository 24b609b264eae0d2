"""A replay as tables for the terminal, as Markdown and as figures."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.console import Group
from rich.text import Text

from cmg_mj.features.replay.log_replay import ReplayResult
from cmg_mj.features.replay.noise import noise_figures
from cmg_mj.features.replay.reference import remarks_on
from cmg_mj.features.replay.scores import RECONSTRUCTED_S
from cmg_mj.results.summary_keys import Key, SummaryValue
from cmg_mj.results.tables import Table
from cmg_mj.view.plots.style import observers_to_draw

FIGURES = {
    "velocity_rms_error_rad_s": Key("RMS error", "rad/s", "{:.4f}"),
    "velocity_fit": Key("fit", "", "{:.3f}", better="more"),
    "velocity_rms_error_push_rad_s": Key("error in windows", "rad/s", "{:.4f}"),
    "velocity_fit_push": Key("fit in windows", "", "{:.3f}", better="more"),
    "lag_s": Key("lag", "ms", "{:.2f}"),
    "reconstruction_rms_deg": Key("reconstruction error", "deg", "{:.4f}"),
    "roughness_rad_s": Key("roughness", "rad/s", "{:.4f}"),
    "noise_gain_1_s": Key("noise gain", "1/s", "{:.1f}"),
}
"""Figures of a replay, in the order of its table, and the units there: a lag is in ms."""


def shown_first(replayed: ReplayResult) -> list[str]:
    """Return the few observers to draw over each other: the best with a reference, else the first."""
    return observers_to_draw({name: replayed.summaries[name] for name in replayed.estimates})


def replay_figures(replays: Sequence[ReplayResult]) -> dict[str, SummaryValue]:
    """Return the figures that `cmg-mj replay --json` prints."""
    return {"logs": [log_figures(replayed) for replayed in replays]}


def log_figures(replayed: ReplayResult) -> dict[str, SummaryValue]:
    """Return the figures of one log."""
    log, noise = replayed.log, replayed.noise
    figures: dict[str, SummaryValue] = {
        "log": log.name,
        "samples": len(log),
        "rate_hz": 1.0 / log.dt,
        "duration_s": log.duration_s,
        "parts": len(log.parts),
        "has": sorted(log.has),
        "notes": list(log.notes),
        "settle_s": replayed.settle_s,
    }
    if log.windows:
        figures["windows_s"] = [list(window) for window in log.windows]
    figures["noise"] = {"tilt_rad": noise.tilt}
    if "acceleration" in log.has:
        figures["noise"] |= {"acceleration_rad_s2": noise.acceleration, "correlation": noise.correlation}
    if "gyro" in log.has:
        figures["noise"]["gyro_rad_s_rthz"] = noise.gyro
    figures |= noise_figures(log, noise)
    if replayed.alignment:
        figures["reference"] = replayed.alignment._asdict()
    return {**figures, "observers": dict(replayed.summaries), "left_out": dict(replayed.left_out)}


def _keys(replays: Sequence[ReplayResult]) -> list[str]:
    return [key for key in FIGURES if any(key in f for r in replays for f in r.summaries.values())]


def _tables(replays: Sequence[ReplayResult]) -> list[tuple[Table, list[str]]]:
    """Tabulate each log, with its remarks."""
    return [(_table(replayed), remarks(replayed)) for replayed in replays]


def _table(replayed: ReplayResult) -> Table:
    headings = {key: FIGURES[key].heading for key in _keys([replayed])}
    rows = [{"observer": name, **row} for name, row in replayed.summaries.items()]
    return Table(
        {"observer": "observer", **headings}, rows, replayed.log.title, lambda row, key: figure_text(key, row.get(key))
    )


def figure_text(key: str, value: SummaryValue) -> str:
    """Format a figure for a table; a dash for None."""
    return FIGURES[key].pattern.format(1e3 * value if key == "lag_s" else value) if isinstance(value, float) else "-"


def replay_tables(replays: Sequence[ReplayResult]) -> Group:
    """Return the tables that `cmg-mj replay` prints: one for each log."""
    parts = []
    for table, lines in _tables(replays):
        parts += [table.rich(), *(Text(line, overflow="fold") for line in lines), *([Text("")] if lines else [])]
    return Group(*parts, Text(table_note(replays), overflow="fold"))


def replay_markdown(replays: Sequence[ReplayResult]) -> str:
    """Return the tables as Markdown."""
    parts = [part for table, lines in _tables(replays) for part in (f"{table.title}:", table.markdown(), *lines)]
    return "\n\n".join([*parts, table_note(replays)])


def remarks(replayed: ReplayResult) -> list[str]:
    """Return the remarks on a log and its reference, and the observers left out."""
    lines = remarks_on(replayed.log, replayed.alignment, replayed.noise)
    reasons: dict[str, list[str]] = {}
    for name, reason in replayed.left_out.items():
        reasons.setdefault(reason, []).append(name)
    return [*lines, *(f"Without {', '.join(names)}: {reason}." for reason, names in reasons.items())]


def table_note(replays: Sequence[ReplayResult]) -> str:
    """Explain the figures of the tables."""
    keys = _keys(replays)
    lines = []
    if "velocity_fit" in keys:
        lines.append("Fit: 1 - RMS error / RMS of the reference; 1 is the reference, 0 an estimate of zero.")
        lines.append("Lag: how long an estimate comes after the reference; -: none is known.")
    if "reconstruction_rms_deg" in keys:
        lines.append(
            f"Reconstruction error: the tilt integrated from the rate, {RECONSTRUCTED_S:g} s at a time, less the\n"
            "measured one. Roughness: the white noise whose second differences are as large."
        )
    sizes = {f"{math.degrees(replayed.noise.tilt):.3g}" for replayed in replays}
    starts = {f"{replayed.settle_s:g}" for replayed in replays}
    lines.append(
        f"Noise gain: what white noise of the tilt ({', '.join(sorted(sizes))} deg) makes of the rate, by its size.\n"
        f"Scored from {', '.join(sorted(starts))} s after each start on."
    )
    return "\n".join(lines)
