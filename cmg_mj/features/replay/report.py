"""A replay as tables for the terminal, as Markdown and as figures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rich.console import Group
from rich.text import Text

from cmg_mj.features.replay.log_replay import ReplayResult
from cmg_mj.features.replay.noise import noise_figures
from cmg_mj.features.replay.reference import remarks_on
from cmg_mj.features.replay.scores import RECONSTRUCTED_S
from cmg_mj.results.baselines import ZERO
from cmg_mj.results.intervals import Interval, finite_mean, finite_values, format_interval, known_ends
from cmg_mj.results.summary_keys import Key, SummaryValue
from cmg_mj.results.tables import Row, Table
from cmg_mj.view.plots.style import observers_to_draw

FIGURES = {
    "velocity_rms_error_rad_s": Key("RMS error", "rad/s", "{:.4f}"),
    "velocity_fit": Key("fit", "", "{:.3f}", better="more", positive=False),
    "velocity_rms_error_push_rad_s": Key("error in windows", "rad/s", "{:.4f}"),
    "velocity_fit_push": Key("fit in windows", "", "{:.3f}", better="more", positive=False),
    "lag_s": Key("lag", "ms", "{:.2f}", positive=False),
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
    figures: dict[str, SummaryValue] = {"logs": [log_figures(replayed) for replayed in replays]}
    if len(replays) > 1:
        figures["mean"] = _means(replays)
    return figures


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


def _means(replays: Sequence[ReplayResult]) -> dict[str, dict[str, SummaryValue]]:
    """Return every row's number of logs, and its figures' means over the logs that have them, the baseline's last."""
    names = dict.fromkeys(name for replayed in replays for name in replayed.summaries)
    means = {}
    for name in sorted(names, key=lambda name: name == ZERO):
        summaries = [replayed.summaries[name] for replayed in replays if name in replayed.summaries]
        means[name] = {"logs": len(summaries)}
        for key in _keys(replays):
            values = finite_values([summary.get(key) for summary in summaries])
            interval = known_ends(values, FIGURES[key].positive)
            means[name][key] = {"mean": finite_mean(values), "interval": interval, "logs": len(values)}
    return means


def _keys(replays: Sequence[ReplayResult]) -> list[str]:
    return [key for key in FIGURES if any(key in f for r in replays for f in r.summaries.values())]


def _tables(replays: Sequence[ReplayResult]) -> list[tuple[Table, list[str]]]:
    """Tabulate each log, with its remarks, and of several the means."""
    tables = [(_table(replayed.log.title, replayed.summaries, [replayed]), remarks(replayed)) for replayed in replays]
    if len(replays) > 1:
        tables.append((_table(f"Means over {len(replays)} logs, with 95 % intervals", _means(replays), replays), []))
    return tables


def _table(title: str, figures: Mapping[str, Row], replays: Sequence[ReplayResult]) -> Table:
    headings = {key: FIGURES[key].heading for key in _keys(replays)}
    rows = [{"observer": name, **row} for name, row in figures.items()]
    return Table({"observer": "observer", **headings}, rows, title, _entry)


def _entry(row: Row, key: str) -> str:
    match row.get(key):
        case {"mean": float() as mean, "interval": [float() as low, float() as high]}:
            interval = Interval(*(_in_unit(key, value) for value in (mean, low, high)))
            return "\n".join([figure_text(key, mean), *format_interval(FIGURES[key].pattern, interval)])
        case {"mean": value} | value:
            return figure_text(key, value)


def figure_text(key: str, value: SummaryValue) -> str:
    """Format a figure for a table; a dash for None."""
    return FIGURES[key].pattern.format(_in_unit(key, value)) if isinstance(value, float) else "-"


def _in_unit(key: str, value: float) -> float:
    return 1e3 * value if key == "lag_s" else value


def replay_tables(replays: Sequence[ReplayResult]) -> Group:
    """Return the tables that `cmg-mj replay` prints: one for each log, and one of the means."""
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
