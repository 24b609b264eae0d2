"""Table and files of a tuning."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Group
from rich.text import Text

from cmg_mj.features.tuning.fit import NoiseLevelResult
from cmg_mj.features.tuning.logs import MIN_STRETCH_S, RELEVANT, LogStudy
from cmg_mj.features.tuning.simulations import TuningResult, best_noise, tuned_scenario, windows_of
from cmg_mj.results.folder import RunFolder, claimed, write_text
from cmg_mj.results.intervals import Interval
from cmg_mj.results.tables import Row, Table
from cmg_mj.runs.experiment import prepare

Study = TuningResult | LogStudy


def study_table(study: Study) -> Group:
    """Return the table that `cmg-mj tune` and `tune-log` print, a row a noise level, and what explains it."""
    levels = study.levels if isinstance(study, TuningResult) else [study.level]
    if isinstance(study, TuningResult):
        title, first = (
            f"{study.scenario.title or 'Tuning'}: {study.kind}, seed {study.scenario.seed}",
            "noise [ug/rtHz]",
        )
        names, verdicts = [f"{level.noise_ug_rthz:g}" for level in levels], [level.verdict for level in levels]
    else:
        title, first = f"{', '.join(one.log.name for one in study.logs)}: {study.kind}", "observer"
        names, verdicts = [study.kind], [study.verdict]
    rows = []
    for name, level, verdict in zip(names, levels, verdicts, strict=True):
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
        "first": first,
        **{number.name: f"{number.name} given {number.start:.4g}" for number in study.numbers},
        "rms": "error tuned [rad/s]",
        "given_rms": "error given [rad/s]",
        "ratio": "given / tuned, 95 %",
        "verdict": "tuned is",
    }
    return Group(Table(columns, rows, title, _plain).rich(), Text("\n".join(_lines(study, levels))))


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
    several = len(levels) > 1
    if isinstance(study, TuningResult):
        spans = ", ".join(f"{start:g} s to {end:g} s" for start, end in windows_of(study.scenario))
        yield f"RMS of the estimated rate less the gyro's, {spans}, on worlds that were not fitted."
        if not study.scenario.push:
            yield "There is no push: the window is the whole run, where an estimate of zero may do best."
    else:
        for one in study.logs:
            for remark in one.remarks:
                yield f"{one.log.name}: {remark}" if len(study.logs) > 1 else remark
        share = f"{study.split:.0%} of each log, scored on the rest, in {len(study.level.rms)} stretches"
        yield f"RMS of the estimated rate less the reference. Fitted on the first {share}."
    zero = [f"{level.zero_rms:.4f}" for level in levels]
    yield f"An estimate of zero: {' to '.join(dict.fromkeys([min(zero), max(zero)]))} rad/s."
    for level in levels:
        worse = [name for name, fit in (("tuned", level.fit), ("given", level.given_fit)) if not fit > 0.0]
        at = f"At {level.noise_ug_rthz:g} ug/rtHz the" if several else "The"
        fits = f"fit there is {level.fit:.3f} tuned, {level.given_fit:.3f} given"
        yield f"{at} {fits}" + (f": worse than an estimate of zero, {' and '.join(worse)}." if worse else ".")
    if study.insensitive_parameters:
        yield f"Not tuned, because the rate does not depend on them: {', '.join(study.insensitive_parameters)}."
    if limits := dict.fromkeys(limit for level in levels for limit in level.limits(study.numbers)):
        yield f"* at a limit of its range: {', '.join(limits)}. Beyond it there may be better ones: --range."
    if fell := sum(level.fell for level in levels):
        yield f"Discarded: {fell} worlds that fell."
    if isinstance(study, LogStudy):
        yield from _verdict_lines(study)
    elif several:
        yield _best(study)


def _best(study: TuningResult) -> str:
    """Describe the noise at which the given parameters are the best ones."""
    where, noise = best_noise(study)
    if noise is None:
        if where == "not bracketed":
            return "The noises tried do not show at which one the given parameters are best."
        return f"The given parameters are best at a noise {where} these, if at any."
    if len(study.numbers) == 1:
        return f"The given parameters are best at about {noise:.0f} ug/rtHz."
    return f"Among these noises the given parameters lose least at {noise:g} ug/rtHz."


def _verdict_lines(study: LogStudy) -> Iterator[str]:
    """Say why there is no verdict, or a tie, and what the tuned parameters do in a closed loop."""
    ratio = study.level.ratio
    if not study.has_interval:
        yield (
            f"No interval: the scored stretches are {study.stretch_s:.2g} s short; there is one from "
            f"{MIN_STRETCH_S:g} s on."
        )
    if study.verdict == "tie" and ratio.low <= 1.0 <= ratio.high:
        yield "A tie: the difference is not beyond chance."
    elif study.verdict == "tie" and math.isfinite(ratio.mean):
        yield f"A tie: {abs(ratio.mean - 1.0):.2%} of difference, where less than {RELEVANT - 1.0:.0%} counts for none."
    if study.loop is not None:
        yield study.loop.remark


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
