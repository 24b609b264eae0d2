"""A replay as tables for the terminal, as Markdown and as figures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rich.console import Group
from rich.text import Text

from cmg_mj.features.replay.log_replay import ReplayResult
from cmg_mj.features.replay.noise import noise_figures, noise_remarks
from cmg_mj.features.replay.reference import model_remark, remarks_on
from cmg_mj.features.replay.scores import RECONSTRUCTED_S, ZERO_PHASE, Figures
from cmg_mj.results.baselines import ZERO
from cmg_mj.results.intervals import Interval, format_interval, known_interval
from cmg_mj.results.summary_keys import Key, SummaryValue
from cmg_mj.results.tables import Row, Table
from cmg_mj.view.plots.style import observers_to_draw

FIGURES = {
    "velocity_rms_error_rad_s": Key("RMS error", "rad/s", "{:.4f}"),
    "velocity_fit": Key("fit", "", "{:.3f}", better="more", positive=False),
    "velocity_rms_error_push_rad_s": Key("error in windows", "rad/s", "{:.4f}"),
    "velocity_fit_push": Key("fit in windows", "", "{:.3f}", better="more", positive=False),
    "lag_s": Key("lag", "s", "{:.5f}", positive=False),
    "reconstruction_rms_deg": Key("reconstruction error", "deg", "{:.4f}"),
    "roughness_rad_s": Key("roughness", "rad/s", "{:.4f}"),
    "noise_gain_1_s": Key("noise gain", "1/s", "{:.1f}"),
}
"""Figures of a replay, in the order of its table."""


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
    acceleration = {"acceleration_rad_s2": noise.acceleration, "correlation": noise.correlation}
    return {
        "log": log.name,
        "samples": len(log),
        "rate_hz": 1.0 / log.dt,
        "duration_s": log.duration_s,
        "parts": len(log.parts),
        "has": sorted(log.has),
        "notes": list(log.notes),
        "settle_s": replayed.settle_s,
        **({"windows_s": [list(window) for window in log.windows]} if log.windows else {}),
        "noise": {
            "tilt_rad": noise.tilt,
            **(acceleration if "acceleration" in log.has else {}),
        },
        **noise_figures(log, noise),
        **({"reference": replayed.alignment._asdict()} if replayed.alignment else {}),
        "observers": {name: dict(figures) for name, figures in replayed.summaries.items()},
        **_zero_phase_figures(replayed),
        **({} if replayed.misfit is None else {"model_misfit": replayed.misfit}),
        "left_out": dict(replayed.left_out),
    }


def _zero_phase_figures(replayed: ReplayResult) -> dict[str, SummaryValue]:
    """Return the figures of the smoother that sees the future, if there are any."""
    smoother = replayed.zero_phase
    if smoother is None:
        return {}
    more = {"best_cutoff_hz": smoother.best_cutoff_hz, "best_rms_error_rad_s": smoother.best_rms_error_rad_s}
    return {ZERO_PHASE: {**smoother.figures, "cutoff_hz": smoother.cutoff_hz, **more}}


def _figures_by_row(replayed: ReplayResult) -> dict[str, Figures]:
    """Return the figures of a table's rows: the observers, the smoother that is none, and the baseline."""
    rows = dict(replayed.summaries)
    zero = rows.pop(ZERO)
    if replayed.zero_phase is not None:
        rows[ZERO_PHASE] = replayed.zero_phase.figures
    return {**rows, ZERO: zero}


def _means(replays: Sequence[ReplayResult]) -> dict[str, dict[str, SummaryValue]]:
    """Return every row's number of logs, and its figures' means over the logs that have them, the baseline's last."""
    rows = [_figures_by_row(replayed) for replayed in replays]
    last = [name for name in (ZERO_PHASE, ZERO) if any(name in row for row in rows)]
    names = [name for name in dict.fromkeys(n for row in rows for n in row) if name not in last]
    means = {}
    for name in [*names, *last]:
        summaries = [row[name] for row in rows if name in row]
        figures = {key: _mean_of(summaries, key) for key in _keys(replays)}
        means[name] = {"logs": len(summaries), **figures}
    return means


def _mean_of(summaries: Sequence[Figures], key: str) -> dict[str, SummaryValue]:
    values = [value for summary in summaries if (value := summary.get(key)) is not None]
    interval = known_interval(values, FIGURES[key].positive)
    return {
        "mean": sum(values) / len(values) if values else None,
        "interval": [interval.low, interval.high] if interval and math.isfinite(interval.low) else None,
        "logs": len(values),
    }


def _keys(replays: Sequence[ReplayResult]) -> list[str]:
    return [key for key in FIGURES if any(key in f for r in replays for f in r.summaries.values())]


def _tables(replays: Sequence[ReplayResult]) -> list[Table]:
    """Tabulate each log and, of several, the means."""
    tables = []
    for replayed in replays:
        rows: list[Row] = [{"observer": name, **figures} for name, figures in _figures_by_row(replayed).items()]
        tables.append(Table(_headings([replayed]), rows, replayed.log.title, _entry))
    if len(replays) > 1:
        rows = [{"observer": name, **mean} for name, mean in _means(replays).items()]
        title = f"Means over {len(replays)} logs, with 95 % intervals"
        tables.append(Table(_headings(replays), rows, title, _mean_entry))
    return tables


def _headings(replays: Sequence[ReplayResult]) -> dict[str, str]:
    headings = {key: "lag [ms]" if key == "lag_s" else FIGURES[key].heading for key in _keys(replays)}
    return {"observer": "observer", **headings}


def _entry(row: Row, key: str) -> str:
    value = row.get(key)
    return str(value) if isinstance(value, str) else figure_text(key, value)


def figure_text(key: str, value: SummaryValue) -> str:
    """Format a figure for a table; a dash for None."""
    if not isinstance(value, float):
        return "-"
    return f"{value * 1e3:.2f}" if key == "lag_s" else FIGURES[key].pattern.format(value)


def _mean_entry(row: Row, key: str) -> str:
    figure = row[key]
    if not isinstance(figure, Mapping):
        return str(figure)
    scale, pattern = (1e3, "{:.2f}") if key == "lag_s" else (1.0, FIGURES[key].pattern)
    text = figure_text(key, figure["mean"])
    match figure:
        case {"mean": float() as mean, "interval": [float() as low, float() as high]}:
            return "\n".join([text, *format_interval(pattern, Interval(scale * mean, scale * low, scale * high))])
    return text


def replay_tables(replays: Sequence[ReplayResult]) -> Group:
    """Return the tables that `cmg-mj replay` prints: one for each log, and one of the means."""
    tables = _tables(replays)
    parts = []
    for table, replayed in zip(tables, replays, strict=False):
        parts += [table.rich(), *(Text(line, overflow="fold") for line in remarks(replayed)), Text("")]
    means = [table.rich() for table in tables[len(replays) :]]
    return Group(*parts, *means, Text(table_note(replays), overflow="fold"))


def replay_markdown(replays: Sequence[ReplayResult]) -> str:
    """Return the tables as Markdown."""
    tables = _tables(replays)
    parts = []
    for table, replayed in zip(tables, replays, strict=False):
        parts += [f"{table.title}:", table.markdown(), *remarks(replayed)]
    for table in tables[len(replays) :]:
        parts += [f"{table.title}:", table.markdown()]
    return "\n\n".join([*parts, table_note(replays)])


def remarks(replayed: ReplayResult) -> list[str]:
    """Return the remarks on a log and its reference, and the observers left out."""
    lines = remarks_on(replayed.log, replayed.alignment) + noise_remarks(replayed.log, replayed.noise)
    if (smoother := replayed.zero_phase) is not None:
        best = "-" if smoother.best_rms_error_rad_s is None else f"{smoother.best_rms_error_rad_s:.4f}"
        lines.append(
            f"{ZERO_PHASE} is no observer: it sees the future. It smooths the tilt to both sides of each sample, below "
            f"{smoother.cutoff_hz:.3g} Hz, chosen by the tilt alone; with {smoother.best_cutoff_hz:.3g} Hz, the best "
            f"for the reference, its error is {best} rad/s."
        )
    if doubt := model_remark(replayed.misfit):
        lines.append(doubt)
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
