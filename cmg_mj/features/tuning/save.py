"""Figures, tables and files of a tuning."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path

from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from cmg_mj.features.tuning.fit import NoiseLevelResult
from cmg_mj.features.tuning.logs import RELEVANT, SHORTEST_S, LogStudy, LoopComparison
from cmg_mj.features.tuning.search import plain
from cmg_mj.features.tuning.simulations import TuningResult, best_noise, tuned_scenario, windows_of
from cmg_mj.results.folder import RunFolder, claimed, write_text
from cmg_mj.results.intervals import Interval
from cmg_mj.results.metrics import finite_or_none
from cmg_mj.results.summary_keys import SummaryValue
from cmg_mj.runs.experiment import prepare


def figures_of(study: TuningResult) -> dict[str, SummaryValue]:
    """Return the figures that `cmg-mj tune --json` prints."""
    best = best_noise(study)
    return {
        "scenario": study.scenario.title,
        "observer": study.kind,
        "seed": study.scenario.seed,
        "worlds_fitted": study.worlds,
        "window_s": list(study.window),
        "scored_s": [list(window) for window in windows_of(study.scenario)],
        "given_parameters": plain(study.start_parameters),
        "tuned": [number.name for number in study.numbers],
        "idle": list(study.insensitive_parameters),
        "levels": [level_figures(level) for level in study.levels],
        "given_best_at_noise_density_ug_rthz": best.noise_ug_rthz,
        **({"given_best_noise_is": best.where} if len(study.levels) > 1 else {}),
    }


def level_figures(level: NoiseLevelResult) -> dict[str, SummaryValue]:
    """Return one level's figures."""
    return {
        "noise_density_ug_rthz": level.noise_ug_rthz,
        "parameters": plain(level.parameters),
        "at_a_limit": list(level.edges),
        "fit_rms_error_rad_s": finite_or_none(level.fit_rms),
        "fit_given_rms_error_rad_s": finite_or_none(level.fit_given_rms),
        "held_out_worlds": len(level.rms),
        "held_out_rms_error_rad_s": finite_or_none(float(level.rms.mean())),
        "held_out_given_rms_error_rad_s": finite_or_none(float(level.given_rms.mean())),
        "held_out_fit": finite_or_none(level.fit),
        "held_out_given_fit": finite_or_none(level.given_fit),
        "held_out_ratio": _interval(level.ratio),
        "verdict": level.verdict,
        "zero_estimate_rms_error_rad_s": level.zero_rms,
        "largest_tilt_acceleration_rad_s2": level.largest_acceleration,
        "worlds_that_fell": level.fell,
    }


def _interval(interval: Interval) -> list[float | None]:
    return [finite_or_none(value) for value in interval]


def tuning_table(study: TuningResult) -> Table:
    """Return the table that `cmg-mj tune` prints."""
    scenario = study.scenario
    title = f"{scenario.title or 'Tuning'}: {study.kind}, seed {scenario.seed}"
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left", padding=(0, 1, 0, 0), caption=_caption(study))
    table.caption_justify = "left"
    table.add_column("noise\n[ug/rtHz]", justify="right", vertical="bottom")
    for number in study.numbers:
        table.add_column(f"{number.name}\ngiven {number.start:.4g}", justify="right", vertical="bottom")
    for heading in (
        "held out:\ntuned\n[rad/s]",
        "\ngiven\n[rad/s]",
        "\ngiven / tuned, 95 %",
        "tuned is",
    ):
        table.add_column(heading, justify="right", vertical="bottom")
    for level in study.levels:
        signed = {n.name: math.copysign(level.sizes[n.name], n.start) for n in study.numbers}
        sizes = (f"{size:.4g}{'*' if name in level.edges else ''}" for name, size in signed.items())
        table.add_row(
            f"{level.noise_ug_rthz:g}",
            *sizes,
            f"{level.rms.mean():.4f}",
            f"{level.given_rms.mean():.4f}",
            ratio_text(level.ratio),
            level.verdict,
        )
    return table


def ratio_text(ratio: Interval) -> str:
    """Format a ratio with three decimals, or as many as show on which side of 1 an end lies."""
    digits = 3
    while digits < 6 and any(value != 1.0 and round(value, digits) == 1.0 for value in ratio[1:]):
        digits += 1
    mean, low, high = (f"{value:.{digits}f}" for value in ratio)
    return f"{mean} ({low} to {high})"


def _caption(study: TuningResult) -> str:
    """Explain the figures of the table."""
    spans = ", ".join(f"{start:g} s to {end:g} s" for start, end in windows_of(study.scenario))
    lines = [f"RMS of the estimated rate less the gyro's, {spans}, on worlds that were not fitted."]
    if not study.scenario.push:
        lines.append("There is no push: the window is the whole run, where an estimate of zero may do best.")
    zero = [f"{level.zero_rms:.4f}" for level in study.levels]
    lines.append(f"An estimate of zero: {' to '.join(dict.fromkeys([min(zero), max(zero)]))} rad/s.")
    for level in study.levels:
        worse = [name for name, fit in (("tuned", level.fit), ("given", level.given_fit)) if not fit > 0.0]
        at = f"At {level.noise_ug_rthz:g} ug/rtHz the" if len(study.levels) > 1 else "The"
        fits = f"fit there is {level.fit:.2f} tuned, {level.given_fit:.2f} given"
        lines.append(f"{at} {fits}" + (f": worse than an estimate of zero, {' and '.join(worse)}." if worse else "."))
    if study.insensitive_parameters:
        lines.append(f"Not tuned, because the rate does not depend on them: {', '.join(study.insensitive_parameters)}.")
    if any(level.edges for level in study.levels):
        lines.append("* at a limit of its range.")
    fell = sum(level.fell for level in study.levels)
    if fell:
        lines.append(f"Discarded: {fell} worlds that fell.")
    if len(study.levels) > 1:
        lines.append(_best(study))
    return "\n".join(lines)


def _best(study: TuningResult) -> str:
    """Describe the noise at which the given parameters are the best ones."""
    best = best_noise(study)
    if best.noise_ug_rthz is None:
        if best.where == "not bracketed":
            return "The noises tried do not show at which one the given parameters are best."
        return f"The given parameters are best at a noise {best.where} these, if at any."
    if len(study.numbers) == 1:
        return f"The given parameters are best at about {best.noise_ug_rthz:.0f} ug/rtHz."
    return f"Among these noises the given parameters lose least at {best.noise_ug_rthz:g} ug/rtHz."


def files_of_study(noises_ug_rthz: Sequence[float]) -> list[str]:
    """Return the names of a study's files: one noise gives scenario.toml, several give scenario-NOISE.toml."""
    several = [f"scenario-{noise:g}.toml" for noise in noises_ug_rthz] if len(noises_ug_rthz) > 1 else ["scenario.toml"]
    return ["tuned.json", *several]


def save_study(folder: RunFolder | Path, study: TuningResult, *, complete: bool = True) -> list[Path]:
    """Write tuned.json, and for each sensor noise a scenario that runs with the tuned observer.

    Args:
        folder: The folder. Files in it that cmg_mj did not write stay.
        study: The result.
        complete: Whether these are all noises that were requested.

    Returns:
        The files.

    Raises:
        InputError: A file cannot be written.
    """
    names = files_of_study([level.noise_ug_rthz for level in study.levels])
    writers = (
        lambda path: write_text(path, json.dumps(figures_of(study), indent=2)),
        *(prepare(tuned_scenario(study, level)).save for level in study.levels),
    )
    with claimed(folder) as claim:
        place = claim.write(dict(zip(names, writers, strict=True)), complete=complete)
    return [place / name for name in names]


FILES = ("tuned.json",)


def figures_of_logs(study: LogStudy) -> dict[str, SummaryValue]:
    """Return the figures that `cmg-mj tune-log --json` prints."""
    level = level_figures(study.level)
    only_of_scenarios = ("noise_density_ug_rthz", "worlds_that_fell", "held_out_worlds")
    return {
        "logs": list(study.names),
        "observer": study.kind,
        "split": study.split,
        "given_parameters": plain(study.start_parameters),
        "tuned": [number.name for number in study.numbers],
        "idle": list(study.insensitive_parameters),
        "noise": [
            {
                "tilt_rad": noise.tilt,
                "acceleration_rad_s2": noise.acceleration,
                "correlation": noise.correlation,
                **by_the_log,
            }
            for noise, by_the_log in zip(study.noises, study.noises_by_the_logs, strict=True)
        ],
        "notes": [list(log) for log in study.remarks],
        "reference": [aligned and aligned._asdict() for aligned in study.alignments],
        "held_out_stretches": len(study.level.rms),
        "held_out_stretch_s": study.stretch_s,
        **{key: value for key, value in level.items() if key not in only_of_scenarios},
        **({} if study.has_interval else {"held_out_ratio": None}),
        "verdict": study.verdict,
        **({} if study.loop is None else {"closed_loop": _loop_figures(study.loop)}),
    }


def _loop_figures(loop: LoopComparison) -> dict[str, SummaryValue]:
    return {
        "scenario": loop.scenario,
        "duration_s": loop.duration_s,
        "worlds": loop.worlds,
        "given_stood": loop.stood[0],
        "tuned_stood": loop.stood[1],
        "given_stood_alone": loop.stood_alone[0],
        "tuned_stood_alone": loop.stood_alone[1],
        "tilt_rms_ratio": None if loop.ratio is None else [finite_or_none(value) for value in loop.ratio],
        "verdict": loop.verdict,
        "refused": loop.refused or None,
    }


def _verdict_in_words(study: LogStudy) -> list[str]:
    """Say why a difference counts for none."""
    ratio = study.level.ratio
    if study.verdict != "tie" or not math.isfinite(ratio.mean):
        return []
    if ratio.low <= 1.0 <= ratio.high:
        return ["A tie: the difference is not beyond chance."]
    return [f"A tie: {abs(ratio.mean - 1.0):.2%} of difference, where less than {RELEVANT - 1.0:.0%} counts for none."]


def logs_table(study: LogStudy) -> Group:
    """Return the table that `cmg-mj tune-log` prints."""
    level = study.level
    share = f"{study.split:.0%}"
    several = len(study.names) > 1
    logs = zip(study.names, study.remarks, strict=True)
    lines = [f"{name}: {line}" if several else line for name, remarks in logs for line in remarks]
    lines += [
        f"RMS of the estimated rate less the reference. Fitted on the first {share} of each log, scored on the rest,",
        f"in {len(level.rms)} stretches. An estimate of zero: {level.zero_rms:.4f} rad/s. Fit {level.fit:.3f} tuned, "
        f"{level.given_fit:.3f} given.",
    ]
    if study.insensitive_parameters:
        lines.append(f"Not tuned, because the rate does not depend on them: {', '.join(study.insensitive_parameters)}.")
    if not study.has_interval:
        short = f"the scored stretches are {study.stretch_s:.2g} s short"
        lines.append(f"No interval: {short}; there is one from {SHORTEST_S:g} s on.")
    if study.limits:
        lines.append(
            f"* at a limit of its range: {', '.join(study.limits)}. Beyond it there may be better ones: --range."
        )
    lines += _verdict_in_words(study)
    if study.loop is not None:
        lines.append(study.loop.remark)
    table = Table(title=f"{', '.join(study.names)}: {study.kind}", box=box.SIMPLE_HEAD, title_justify="left")
    for heading in ("parameter", "given", "tuned"):
        table.add_column(heading, justify="left" if heading == "parameter" else "right")
    for number in study.numbers:
        size = math.copysign(level.sizes[number.name], number.start)
        table.add_row(number.name, f"{number.start:.4g}", f"{size:.4g}{'*' if number.name in level.edges else ''}")
    table.add_section()
    table.add_row("held out [rad/s]", f"{level.given_rms.mean():.4f}", f"{level.rms.mean():.4f}")
    table.add_row("given / tuned, 95 %", "", ratio_text(level.ratio) if study.has_interval else "-")
    table.add_row("tuned is", "", study.verdict or "-")
    return Group(table, Text("\n".join(lines)))


def save_log_study(folder: RunFolder | Path, study: LogStudy) -> Path:
    """Write tuned.json.

    Args:
        folder: The folder. Files in it that cmg_mj did not write stay.
        study: The result.

    Returns:
        The folder of the file.

    Raises:
        InputError: The file cannot be written.
    """
    text = json.dumps(figures_of_logs(study), indent=2)
    with claimed(folder) as claim:
        return claim.write({FILES[0]: lambda path: write_text(path, text)})
