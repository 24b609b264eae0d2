"""A tuning's figures, table and files."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path

from rich import box
from rich.table import Table

from cmg_mj.features.tuning.fit import NoiseLevelResult
from cmg_mj.features.tuning.parameters import plain
from cmg_mj.features.tuning.simulations import windows_of
from cmg_mj.features.tuning.study import TuningResult, best_noise, tuned_scenario
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
