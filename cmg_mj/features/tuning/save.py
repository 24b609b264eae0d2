"""Table and files of a tuning."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Group
from rich.text import Text

from cmg_mj.features.tuning.fit import NoiseLevelResult
from cmg_mj.features.tuning.logs import LogStudy
from cmg_mj.features.tuning.simulations import TuningResult, tuned_scenario
from cmg_mj.results.folder import RunFolder, claimed, write_text
from cmg_mj.results.intervals import Interval
from cmg_mj.results.tables import Row, Table
from cmg_mj.runs.experiment import prepare

Study = TuningResult | LogStudy


def study_table(study: Study) -> Group:
    """Return the table that `cmg-mj tune` and `tune-log` print, a row a noise level, and what explains it."""
    rows = []
    for name, level, verdict in study.rows:
        sizes = {n.name: math.copysign(level.sizes[n.name], n.start) for n in study.numbers}
        rows.append(
            {
                "first": name,
                **{name: f"{size:.4g}{'*' if name in level.edges else ''}" for name, size in sizes.items()},
                "rms": f"{level.rms.mean():.4f}",
                "given_rms": f"{level.given_rms.mean():.4f}",
                "ratio": ratio_text(level.ratio) if verdict else None,
                "verdict": verdict,
            }
        )
    columns = {
        "first": "noise [ug/rtHz]" if isinstance(study, TuningResult) else "observer",
        **{number.name: f"{number.name} given {number.start:.4g}" for number in study.numbers},
        "rms": "error tuned [rad/s]",
        "given_rms": "error given [rad/s]",
        "ratio": "given / tuned, 95 %",
        "verdict": "tuned is",
    }
    levels = [level for _, level, _ in study.rows]
    return Group(Table(columns, rows, study.title, _plain).rich(), Text("\n".join(_lines(study, levels))))


def _plain(row: Row, key: str) -> str:
    return "-" if row[key] is None else str(row[key])


def ratio_text(ratio: Interval) -> str:
    """Format a ratio with three decimals, or as many as show on which side of 1 an end lies."""
    digits = 3
    while digits < 6 and any(value != 1.0 and round(value, digits) == 1.0 for value in ratio[1:]):
        digits += 1
    mean, low, high = (f"{value:.{digits}f}" for value in ratio)
    return f"{mean} ({low} to {high})"


def _lines(study: Study, levels: Sequence[NoiseLevelResult]) -> Iterator[str]:
    """Explain the figures of the table."""
    yield from study.opening()
    zero = [f"{level.zero_rms:.4f}" for level in levels]
    yield f"An estimate of zero: {' to '.join(dict.fromkeys([min(zero), max(zero)]))} rad/s."
    for level in levels:
        worse = [name for name, fit in (("tuned", level.fit), ("given", level.given_fit)) if not fit > 0.0]
        at = f"At {level.noise_ug_rthz:g} ug/rtHz the" if len(levels) > 1 else "The"
        fits = f"fit there is {level.fit:.3f} tuned, {level.given_fit:.3f} given"
        yield f"{at} {fits}" + (f": worse than an estimate of zero, {' and '.join(worse)}." if worse else ".")
    if study.insensitive_parameters:
        yield f"Not tuned, because the rate does not depend on them: {', '.join(study.insensitive_parameters)}."
    if limits := dict.fromkeys(limit for level in levels for limit in level.limits(study.numbers)):
        yield f"* at a limit of its range: {', '.join(limits)}. Beyond it there may be better ones: --range."
    if fell := sum(level.fell for level in levels):
        yield f"Discarded: {fell} worlds that fell."
    yield from study.closing()


def save_study(folder: RunFolder | Path, study: Study, *, complete: bool = True) -> list[Path]:
    """Write tuned.json, and for each sensor noise of a simulation a scenario that runs with the tuned observer.

    Args:
        folder: The folder. Files in it that cmg_mj did not write stay.
        study: The result.
        complete: Whether these are all noises that were requested.

    Returns:
        The files: one noise gives scenario.toml, several give scenario-NOISE.toml.

    Raises:
        InputError: A file cannot be written.
    """
    writers = {"tuned.json": lambda path: write_text(path, json.dumps(study.figures(), indent=2))}
    if isinstance(study, TuningResult):
        for level in study.levels:
            name = f"scenario-{level.noise_ug_rthz:g}.toml" if len(study.levels) > 1 else "scenario.toml"
            writers[name] = prepare(tuned_scenario(study, level)).save
    with claimed(folder) as claim:
        place = claim.write(writers, complete=complete)
    return [place / name for name in writers]
