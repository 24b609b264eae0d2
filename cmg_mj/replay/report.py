"""A replay as tables for the terminal, as Markdown and as figures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from cmg_mj.replay.log_replay import ReplayResult, described
from cmg_mj.replay.reference import remarks_on
from cmg_mj.replay.scores import RECONSTRUCTED_S
from cmg_mj.results import markdown
from cmg_mj.results.baselines import ZERO
from cmg_mj.results.intervals import known_interval
from cmg_mj.results.summary_keys import Key
from cmg_mj.visualization.plots.readability import observers_to_draw

FIGURES = {
    "velocity_rms_error_rad_s": Key("RMS error", "rad/s", "{:.4f}"),
    "velocity_fit": Key("fit", "", "{:.3f}", better="more"),
    "velocity_rms_error_push_rad_s": Key("error in windows", "rad/s", "{:.4f}"),
    "velocity_fit_push": Key("fit in windows", "", "{:.3f}", better="more"),
    "lag_s": Key("lag", "s", "{:.5f}"),
    "reconstruction_rms_deg": Key("reconstruction error", "deg", "{:.4f}"),
    "roughness_rad_s": Key("roughness", "rad/s", "{:.4f}"),
    "noise_gain_1_s": Key("noise gain", "1/s", "{:.1f}"),
}
"""What a table of a replay can show, in this order."""


def shown_first(replayed: ReplayResult) -> list[str]:
    """The few observers that can be followed over each other: with a reference the best, else the first."""
    return observers_to_draw({name: replayed.summaries[name] for name in replayed.estimates})


def figures_of(replays: Sequence[ReplayResult]) -> dict[str, Any]:
    """What `cmg-mj replay --json` prints."""
    found: dict[str, Any] = {"logs": [_figures(replayed) for replayed in replays]}
    if len(replays) > 1:
        found["mean"] = _means(replays)
    return found


def _figures(replayed: ReplayResult) -> dict[str, Any]:
    log = replayed.log
    return {
        "log": log.name,
        "samples": len(log),
        "rate_hz": 1.0 / log.dt,
        "duration_s": log.duration_s,
        "parts": len(log.parts),
        "has": sorted(log.has),
        "notes": list(log.notes),
        "skipped_s": replayed.skip_s,
        **({"windows_s": [list(window) for window in log.windows]} if log.windows else {}),
        "noise": {
            "tilt_rad": replayed.noise.tilt,
            **(
                {
                    "acceleration_rad_s2": replayed.noise.acceleration,
                    "correlation": replayed.noise.correlation,
                }
                if "acceleration" in log.has
                else {}
            ),
        },
        **({"reference": replayed.alignment._asdict()} if replayed.alignment else {}),
        "observers": {name: dict(figures) for name, figures in replayed.summaries.items()},
        "left_out": dict(replayed.left_out),
    }


def _means(replays: Sequence[ReplayResult]) -> dict[str, dict[str, Any]]:
    """Of every observer the means over the logs that have the figure, and their 95 % intervals."""
    names = [name for name in dict.fromkeys(n for r in replays for n in r.summaries) if name != ZERO]
    found: dict[str, dict[str, Any]] = {}
    for name in [*names, ZERO]:
        figures: dict[str, Any] = {"logs": sum(name in r.summaries for r in replays)}
        for key in _keys(replays):
            values = [r.summaries[name].get(key) for r in replays if name in r.summaries]
            known = [value for value in values if value is not None]
            interval = known_interval(known)
            figures[key] = {
                "mean": sum(known) / len(known) if known else None,
                "interval": [interval.low, interval.high] if interval and math.isfinite(interval.low) else None,
                "logs": len(known),
            }
        found[name] = figures
    return found


def _keys(replays: Sequence[ReplayResult]) -> list[str]:
    return [key for key in FIGURES if any(key in f for r in replays for f in r.summaries.values())]


def replay_tables(replays: Sequence[ReplayResult]) -> Group:
    """What `cmg-mj replay` prints: a table a log, and one over them."""
    parts: list[Any] = []
    for replayed in replays:
        keys = _keys([replayed])
        table = _table(described(replayed.log), keys)
        for name, figures in replayed.summaries.items():
            table.add_row(name, *(written(key, figures.get(key)) for key in keys))
        said = [_text(line) for line in remarks(replayed)]
        parts += [table, *said, *([Text("")] if said else [])]  # a table ends with an empty line of its own
    if len(replays) > 1:
        keys = _keys(replays)
        table = _table(f"Means over {len(replays)} logs, with 95 % intervals", keys)
        for name, figures in _means(replays).items():
            few = "" if figures["logs"] == len(replays) else f" ({figures['logs']} logs)"
            table.add_row(name + few, *(_mean(key, figures[key]) for key in keys))
        parts.append(table)
    return Group(*parts, _text(note(replays)))


def replay_markdown(replays: Sequence[ReplayResult]) -> str:
    """The same in Markdown."""
    parts = []
    for replayed in replays:
        keys = _keys([replayed])
        rows = [
            (f"`{name}`", *(written(key, figures.get(key)) for key in keys))
            for name, figures in replayed.summaries.items()
        ]
        parts += [f"{described(replayed.log)}:", markdown.table(["observer", *map(_heading, keys)], rows)]
        parts += remarks(replayed)
    if len(replays) > 1:
        keys = _keys(replays)
        rows = [
            (f"`{n}`", *(_mean(key, f[key]).replace("\n", " ") for key in keys)) for n, f in _means(replays).items()
        ]
        parts += [f"Means over {len(replays)} logs:", markdown.table(["observer", *map(_heading, keys)], rows)]
    return "\n\n".join([*parts, note(replays)])


def _table(title: str, keys: Sequence[str]) -> Table:
    text = Text(title, style="table.title", no_wrap=True, overflow="ignore")
    table = Table(title=text, box=box.SIMPLE_HEAD, title_justify="left", padding=(0, 1, 0, 0))
    table.add_column("observer", vertical="bottom", overflow="fold")
    for key in keys:
        table.add_column(_heading(key).replace(" [", "\n["), justify="right", vertical="bottom")
    return table


def _heading(key: str) -> str:
    return "lag [ms]" if key == "lag_s" else FIGURES[key].heading


def written(key: str, value: float | None) -> str:
    """A figure as tables show it; a dash where there is none."""
    if value is None:
        return "-"
    return f"{value * 1e3:.2f}" if key == "lag_s" else FIGURES[key].pattern.format(value)


def _mean(key: str, figure: Mapping[str, Any]) -> str:
    text = written(key, figure["mean"])
    if figure["interval"] is None:
        return text
    low, high = figure["interval"]
    return f"{text}\n±{written(key, (high - low) / 2.0)}"


def _text(line: str) -> Text:
    return Text(line, overflow="fold")


def remarks(replayed: ReplayResult) -> list[str]:
    """What was done to one log, what its reference is, and who did not take part."""
    lines = remarks_on(replayed.log, replayed.alignment)
    reasons: dict[str, list[str]] = {}
    for name, reason in replayed.left_out.items():
        reasons.setdefault(reason, []).append(name)
    return [*lines, *(f"Without {', '.join(names)}: {reason}." for reason, names in reasons.items())]


def note(replays: Sequence[ReplayResult]) -> str:
    """What the tables do not say by themselves."""
    first = replays[0]
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
    size = f"{math.degrees(first.noise.tilt):.3g} deg"
    more = " and the acceleration's beside it" if "acceleration" in first.log.has else ""
    lines.append(f"Noise gain: what white noise of {size} in the tilt{more} makes of the rate, by that size.")
    if first.skip_s:
        lines.append(f"Judged from {first.skip_s:g} s after each start on.")
    return "\n".join(lines)
