"""A replay as tables for the terminal, as Markdown and as figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from cmg_mj.observers import OBSERVER_CLASSES
from cmg_mj.observers.protocol import needs
from cmg_mj.replay.log_replay import ReplayResult, describe_log
from cmg_mj.replay.model_check import model_remark
from cmg_mj.replay.noise_remarks import noise_figures, noise_remarks
from cmg_mj.replay.reference import reference_fault, remarks_on
from cmg_mj.replay.scores import RECONSTRUCTED_S, Figures
from cmg_mj.replay.zero_phase import ZERO_PHASE
from cmg_mj.results import markdown
from cmg_mj.results.baselines import ZERO
from cmg_mj.results.intervals import Interval, known_interval
from cmg_mj.results.summary_keys import Key, SummaryValue
from cmg_mj.visualization.plots.style import observers_to_draw

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
        figures["mean"] = {
            name: {"logs": mean.logs, **{key: figure._asdict() for key, figure in mean.figures.items()}}
            for name, mean in _means(replays).items()
        }
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


class _Mean(NamedTuple):
    """Mean of a figure over the logs that have it, with its 95 % interval."""

    mean: float | None
    interval: list[float] | None
    logs: int


class _ObserverMeans(NamedTuple):
    """Means of an observer's figures over the logs that it took part in."""

    logs: int
    figures: dict[str, _Mean]


def _means(replays: Sequence[ReplayResult]) -> dict[str, _ObserverMeans]:
    """Return every observer's means over the logs, the baseline's last."""
    rows = [_figures_by_row(replayed) for replayed in replays]
    last = [name for name in (ZERO_PHASE, ZERO) if any(name in row for row in rows)]
    names = [name for name in dict.fromkeys(n for row in rows for n in row) if name not in last]
    means = {}
    for name in [*names, *last]:
        summaries = [row[name] for row in rows if name in row]
        means[name] = _ObserverMeans(len(summaries), {key: _mean_of(summaries, key) for key in _keys(replays)})
    return means


def _mean_of(summaries: Sequence[Figures], key: str) -> _Mean:
    values = [value for summary in summaries if (value := summary.get(key)) is not None]
    interval = known_interval(values, FIGURES[key].positive)
    ends = [interval.low, interval.high] if interval and math.isfinite(interval.low) else None
    return _Mean(sum(values) / len(values) if values else None, ends, len(values))


def _keys(replays: Sequence[ReplayResult]) -> list[str]:
    return [key for key in FIGURES if any(key in f for r in replays for f in r.summaries.values())]


def replay_tables(replays: Sequence[ReplayResult]) -> Group:
    """Return the tables that `cmg-mj replay` prints: one for each log, and one of the means."""
    parts: list[RenderableType] = []
    for replayed in replays:
        keys = _keys([replayed])
        table = _table(describe_log(replayed.log), keys)
        for name, figures in _figures_by_row(replayed).items():
            table.add_row(name, *(figure_text(key, figures.get(key)) for key in keys))
        lines = [_text(line) for line in remarks(replayed)]
        parts += [table, *lines, *([Text("")] if lines else [])]  # a table ends with an empty line of its own
    if len(replays) > 1:
        keys = _keys(replays)
        table = _table(f"Means over {len(replays)} logs, with 95 % intervals", keys)
        for name, mean in _means(replays).items():
            few = "" if mean.logs == len(replays) else f" ({mean.logs} logs)"
            table.add_row(name + few, *(_mean_text(key, mean.figures[key]) for key in keys))
        parts.append(table)
    return Group(*parts, _text(table_note(replays)))


def replay_markdown(replays: Sequence[ReplayResult]) -> str:
    """Return the tables as Markdown."""
    parts = []
    for replayed in replays:
        keys = _keys([replayed])
        rows = [
            (f"`{name}`", *(figure_text(key, figures.get(key)) for key in keys))
            for name, figures in _figures_by_row(replayed).items()
        ]
        parts += [f"{describe_log(replayed.log)}:", markdown.table(["observer", *map(_heading, keys)], rows)]
        parts += remarks(replayed)
    if len(replays) > 1:
        keys = _keys(replays)
        rows = [
            (f"`{name}`", *(_mean_text(key, mean.figures[key]).replace("\n", " ") for key in keys))
            for name, mean in _means(replays).items()
        ]
        parts += [f"Means over {len(replays)} logs:", markdown.table(["observer", *map(_heading, keys)], rows)]
    return "\n\n".join([*parts, table_note(replays)])


def _table(title: str, keys: Sequence[str]) -> Table:
    text = Text(title, style="table.title", no_wrap=True, overflow="ignore")
    table = Table(title=text, box=box.SIMPLE_HEAD, title_justify="left", padding=(0, 1, 0, 0))
    table.add_column("observer", vertical="bottom", overflow="fold")
    for key in keys:
        table.add_column(_heading(key).replace(" [", "\n["), justify="right", vertical="bottom")
    return table


def _heading(key: str) -> str:
    return "lag [ms]" if key == "lag_s" else FIGURES[key].heading


def figure_text(key: str, value: float | None) -> str:
    """Format a figure for a table; a dash for None."""
    if value is None:
        return "-"
    return f"{value * 1e3:.2f}" if key == "lag_s" else FIGURES[key].pattern.format(value)


def _mean_text(key: str, figure: _Mean) -> str:
    text = figure_text(key, figure.mean)
    if figure.interval is None:
        return text
    low, high = figure.interval
    assert figure.mean is not None
    if Interval(figure.mean, low, high).is_lopsided:
        return f"{text}\n{figure_text(key, low)}\nto {figure_text(key, high)}"
    return f"{text}\n±{figure_text(key, (high - low) / 2.0)}"


def _text(line: str) -> Text:
    return Text(line, overflow="fold")


def remarks(replayed: ReplayResult) -> list[str]:
    """Return the remarks on a log and its reference, and the observers left out."""
    lines = remarks_on(replayed.log, replayed.alignment) + noise_remarks(replayed.log, replayed.noise)
    if replayed.zero_phase is not None:
        lines.append(replayed.zero_phase.remark(_doubt_of_price(replayed)))
    if doubt := model_remark(replayed.misfit):
        lines.append(doubt)
    reasons: dict[str, list[str]] = {}
    for name, reason in replayed.left_out.items():
        reasons.setdefault(reason, []).append(name)
    return [*lines, *(f"Without {', '.join(names)}: {reason}." for reason, names in reasons.items())]


def _doubt_of_price(replayed: ReplayResult) -> str | None:
    """Say why the distance from the smoother is not the price of causality; None where it is.

    Observers that know more than the tilt may well be nearer to the reference.
    """
    doubts = [fault] if (fault := reference_fault(replayed.log, replayed.alignment)) else []
    assert replayed.zero_phase is not None
    error = replayed.zero_phase.figures["velocity_rms_error_rad_s"]
    errors = {
        name: other
        for name, figures in replayed.summaries.items()
        if (other := figures["velocity_rms_error_rad_s"]) is not None
        and (name == ZERO or not needs(OBSERVER_CLASSES.find(name)))
    }
    best = min(errors, key=lambda name: errors[name], default=None)
    if error is not None and best is not None and errors[best] < error:
        doubts.append(f"{best}, which knows no more than the past, is nearer to the reference")
    return "; ".join(doubts) or None


def table_note(replays: Sequence[ReplayResult]) -> str:
    """Explain the figures of the tables."""
    keys = _keys(replays)
    lines = []
    if "velocity_fit" in keys:
        lines.append("Fit: 1 - RMS error / RMS of the reference; 1 is the reference, 0 an estimate of zero.")
        lines.append(
            "Lag: how long an estimate comes after the reference, by the peak of their correlation; -: none is known."
        )
    if "reconstruction_rms_deg" in keys:
        lines += [
            f"No reference. Reconstruction error: the tilt integrated from the rate, {RECONSTRUCTED_S:g} s at a time,",
            "against the measured one. Roughness: the white noise whose second differences are as large. Neither",
            "is an error of the rate.",
        ]
    beside = " and the acceleration's beside it"
    sizes = [
        f"{math.degrees(replayed.noise.tilt):.3g} deg in the tilt{beside if 'acceleration' in replayed.log.has else ''}"
        for replayed in replays
    ]
    names = [replayed.log.name for replayed in replays]
    size = _by_log(names, sizes)
    lines.append(f"Noise gain: what white noise of {size} makes of the rate, by the tilt's noise.")
    if len(set(sizes)) > 1:
        lines.append("Gains of observers that are not linear depend on that size, so their mean is of no one noise.")
    starts = [f"from {r.settle_s:g} s after each start on" if r.settle_s else "from its start on" for r in replays]
    if any(replayed.settle_s for replayed in replays):
        lines.append(f"Scored {_by_log(names, starts)}.")
    return "\n".join(lines)


def _by_log(names: Sequence[str], texts: Sequence[str]) -> str:
    """Write the text of all logs, or of each where they differ."""
    logs: dict[str, list[str]] = {}
    for name, text in zip(names, texts, strict=True):
        logs.setdefault(text, []).append(name)
    if len(logs) == 1:
        return next(iter(logs))
    return ", ".join(f"{text} ({', '.join(few)})" for text, few in logs.items())
