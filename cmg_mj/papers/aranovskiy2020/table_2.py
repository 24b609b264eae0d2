"""Table 2 of aranovskiy2020: its observers' parameters beside those that Section V's tuning finds here."""

from __future__ import annotations

from cmg_mj.intervals import Interval
from cmg_mj.papers.aranovskiy2020.retuned import (
    CASES,
    DEFAULT_NOISE,
    GENTLE,
    GENTLE_SHARE,
    HOMOGENEOUS,
    LINEAR,
    LTV,
    SEED,
    WORLDS,
    Tuned,
    at_default,
    in_the_loop,
    nearest,
    recorder,
    study_of,
    zero_is_closer,
)
from cmg_mj.papers.aranovskiy2020.tuning_procedure import procedure_claim
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.tuning import BestNoise, Level, Study, best_noise


def table_2_claim(case: Tuned, study: Study, gentle: Level | None = None, loop: Interval | None = None) -> Claim:
    """Table 2's line of one observer. Its condition is the noise at which the printed gains are the best ones.

    Args:
        case: What was tuned.
        study: At several noises.
        gentle: Under a gentle push, at the default noise.
        loop: Error in the closed loop, Table 2's by that of the gains tuned at the default noise.

    Returns:
        The claim.
    """
    best = best_noise(study)
    levels = study.levels
    extra: dict[str, Interval] = {}
    if loop is not None:
        extra["in_the_loop_table_2_by_tuned_error"] = loop
    if gentle is not None:
        extra["gentle_table_2_by_tuned_error"] = gentle.ratio
    return Claim(
        place=f"Table 2, {case.equation}",
        says=f"{case.printed}, tuned to fit the gyro best.",
        found=" ".join(_found(study, best, gentle, loop)),
        holds=best.where == "found",
        conditions=" ".join(_conditions(study, best.noise_ug_rthz, gentle)) if best.noise_ug_rthz is not None else "",
        otherwise="The noises tried do not bracket one at which they are the best.",
        figures={
            "noise_density_ug_rthz": [level.noise_ug_rthz for level in levels],
            "tuned": [dict(level.sizes) for level in levels],
            "table_2_by_tuned_error": [level.ratio for level in levels],
            "table_2_error_rad_s": [float(level.given_rms.mean()) for level in levels],
            "tuned_error_rad_s": [float(level.rms.mean()) for level in levels],
            "zero_estimate_error_rad_s": [level.zero_rms for level in levels],
            "tuned_is": [level.verdict for level in levels],
            "table_2_best_at_noise_density_ug_rthz": best.noise_ug_rthz,
            "table_2_best_noise_is": best.where,
            **extra,
        },
    )


def _found(study: Study, best: BestNoise, gentle: Level | None, loop: Interval | None) -> list[str]:
    listed = "; ".join(
        f"{level.noise_ug_rthz:g}: {_sizes(level)}, {_ratio(level.ratio)}, {level.verdict}" for level in study.levels
    )
    sentences = [
        f"Fitted on {study.worlds} seeds, scored on as many others: Table 2's error by that of the tuned, with 95 % "
        f"intervals, by noise [ug/rtHz]: {listed}.",
        _at_best(study, best.noise_ug_rthz),
    ]
    linear = [f"{level.noise_ug_rthz:g}" for level in study.levels if level.sizes.get("alpha") == 1.0]
    if linear:
        sentences.append(f"At {', '.join(linear)} the best exponent is 1, a linear observer.")
    if loop is not None:
        sentences.append(
            f"In the closed loop Table 2's gains have {_ratio(loop)} times the error of those tuned at "
            f"{DEFAULT_NOISE:g}: what is best in the second after the push, open loop, need not be best in the loop."
        )
    if gentle is not None:
        sentences.append(
            f"With a push of 0.3 N m and e = 0 at {gentle.noise_ug_rthz:g} ug/rtHz: {_sizes(gentle)}, Table 2 "
            f"{_ratio(gentle.ratio)} times, {gentle.verdict}."
        )
    return sentences


def _at_best(study: Study, noise: float | None) -> str:
    """Where the given parameters are the best ones, and what an estimate of zero would do there."""
    if noise is None:
        tried = f"{study.levels[0].noise_ug_rthz:g} to {study.levels[-1].noise_ug_rthz:g} ug/rtHz"
        return f"The noises tried, {tried}, do not bracket one at which Table 2's own gains are the best."
    level = nearest(study, noise)
    if len(study.numbers) == 1:
        where = f"Table 2's own gains are the best at about {noise:.0f} ug/rtHz"
    else:
        where = f"Of these noises Table 2's own gains lose least at {noise:g} ug/rtHz"
    if level.verdict == "tie":
        given = {number.name: abs(number.given) for number in study.numbers}
        where += " (a tie)" if level.sizes != given else " (no better ones were found)"
    return (
        f"{where}; their error at {level.noise_ug_rthz:g} is {level.given_rms.mean():.4f} rad/s, that of the tuned "
        f"{level.rms.mean():.4f}, that of an estimate of zero {level.zero_rms:.4f}"
        f"{', less than both' if zero_is_closer(level) else ''}."
    )


def _conditions(study: Study, noise: float, gentle: Level | None) -> list[str]:
    sentences = [f"At an accelerometer noise of about {noise:.0f} ug/rtHz; the paper does not give its own."]
    if zero_is_closer(nearest(study, noise)):
        sentences.append("There an estimate of zero is closer to the gyro than either.")
    default = at_default(study)
    if default.verdict == "better":
        sentences.append(f"At {DEFAULT_NOISE:g} they have {default.ratio.mean:.2f} times the error of the tuned.")
    if gentle is not None:
        sentences.append(
            f"Under a gentle push without bias, at {gentle.noise_ug_rthz:g}, it is {_ratio(gentle.ratio)} times."
        )
    return sentences


def _sizes(level: Level) -> str:
    return ", ".join(f"{name} = {size:.4g}" for name, size in level.sizes.items())


def _ratio(ratio: Interval) -> str:
    return f"{ratio.mean:.3f} ({ratio.low:.3f} to {ratio.high:.3f})"


def claims(on_share: OnShare) -> list[Claim]:
    """Section V's procedure, and a line of Table 2 an observer."""
    recorded, studies, done = recorder(), {}, 0.0
    for case in CASES:

        def share(part: float, before: float = done, case: Tuned = case) -> None:
            on_share(before + part * case.share)

        studies[case.observer] = study_of(case, SEED, WORLDS, recorded=recorded, on_share=share)
        done += case.share
    (gentle,) = study_of(
        HOMOGENEOUS, SEED, WORLDS, [DEFAULT_NOISE], GENTLE, on_share=lambda part: on_share(done + part * GENTLE_SHARE)
    ).levels
    loop = in_the_loop(HOMOGENEOUS, at_default(studies["homogeneous"]), 10, SEED + 1)
    return [
        procedure_claim(studies),
        *(table_2_claim(case, studies[case.observer]) for case in (LINEAR, LTV)),
        table_2_claim(HOMOGENEOUS, studies["homogeneous"], gentle, loop),
    ]
