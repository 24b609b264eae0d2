"""Section V after Fig. 3, and Section VI: the loop closed on each estimator, with noise and a push, over seeds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.papers.claim import Assumption, Claim, OnShare
from cmg_mj.papers.recorded import loop_panels, trajectory_of
from cmg_mj.papers.scales import on_common_scales
from cmg_mj.papers.sokolov2019 import lag
from cmg_mj.papers.sokolov2019.backlash import GAP_ARCMIN, WITH_Y2, Cycles, cycles
from cmg_mj.papers.sokolov2019.lag import Lags, in_ms
from cmg_mj.papers.sokolov2019.paper import OBSERVERS
from cmg_mj.papers.sokolov2019.rig import NO_NOISE, PUSH_AND_NOISE, experiment
from cmg_mj.papers.words import plus_minus
from cmg_mj.results.intervals import Interval, known_interval
from cmg_mj.results.result import Result
from cmg_mj.runs.side_by_side import BatchJob, run_side_by_side
from cmg_mj.view.plots.figure import Picture

SEED, WORLDS = 83_000, 20
DURATION_S = 15.0
"""Until the push's tail has faded: the law's slowest poles, -0.19 +- 0.29j 1/s, leave a tenth of it after 12 s [s]."""
LATE_S = 4.0
"""The end of a run that counts as after the push [s]."""
BIASES_DEG = (0.0, 0.25, 0.5)
SHOWN_DEG = 0.25
"""The bias of the pictures: all three stand there."""
BEHIND_A_GAP = f"e = {SHOWN_DEG:g} deg, {GAP_ARCMIN:g} arcmin of backlash"


class Loops(NamedTuple):
    """The closed loops over seeds."""

    by_bias: dict[float, dict[str, Result]]
    """Runs without backlash: e [deg] -> observer -> runs."""
    gap: dict[str, Result]
    """Runs with the datasheet's backlash, at the bias of the pictures."""
    quiet: dict[str, Result]
    """Runs without backlash or noise, one world at the bias of the pictures: the rest of the push's motion."""
    gyro: Result
    """The law fed by the gyro, without backlash, at the bias of the pictures."""
    worlds: int

    @property
    def all_settings(self) -> dict[str, Mapping[str, Result]]:
        """All but the gyro's: where, in words -> observer -> runs."""
        by_setting: dict[str, Mapping[str, Result]] = {f"e = {e:g} deg": by_name for e, by_name in self.by_bias.items()}
        return by_setting | {BEHIND_A_GAP: self.gap}


def loops(on_share: OnShare, worlds: int = WORLDS, seed: int = SEED, duration_s: float = DURATION_S) -> Loops:
    """Run them all; those with noise at once, the same seeds for every observer, at every bias and with the gap."""
    settings = [f"seed={seed}", f"duration_s={duration_s}", f"plant.equilibrium_bias_deg={SHOWN_DEG}"]
    by_bias: dict[float, dict[str, Result]] = {e: {} for e in BIASES_DEG}
    gap: dict[str, Result] = {}
    quiet: dict[str, Result] = {}
    cases = len(BIASES_DEG) + 1
    gaps = np.repeat([*[0.0] * len(BIASES_DEG), GAP_ARCMIN], worlds)
    values = {"equilibrium_bias_deg": np.repeat([*BIASES_DEG, SHOWN_DEG], worlds), "gimbal_backlash_arcmin": gaps}
    runs = [BatchJob(experiment(settings, name).with_varied(values), [*range(worlds)] * cases) for name in OBSERVERS]
    for name, result in zip(OBSERVERS, run_side_by_side(runs), strict=True):
        *no_gap, gap[name] = result.split(cases)
        for e, bias_result in zip(BIASES_DEG, no_gap, strict=True):
            by_bias[e][name] = bias_result
    on_share(0.8)
    for name in OBSERVERS:
        quiet[name] = experiment([*settings, *NO_NOISE], name).run()
    return Loops(by_bias, gap, quiet, experiment(settings, feedback="fog").run_many(worlds), worlds)


# --- what is read off the runs ------------------------------------------------------------------------------


def _late_signal(result: Result, name: str) -> np.ndarray:
    """Return a signal over the last `LATE_S` of the worlds that stood, (n_ticks, n_stood)."""
    t = trajectory_of(result)["time_s"]
    return trajectory_of(result)[name].reshape(len(t), -1)[t >= t[-1] - LATE_S][:, result.stood]


def main_frequency(result: Result) -> float:
    """Find the late peak of the tilt rate's spectrum, averaged over the worlds that stood [Hz]."""
    x2, t = _late_signal(result, "x2_rad_s"), trajectory_of(result)["time_s"]
    padded = 8 * len(x2)
    spectrum = (np.abs(np.fft.rfft(x2 - x2.mean(axis=0), padded, axis=0)) ** 2).mean(axis=1)
    return float(np.fft.rfftfreq(padded, t[1] - t[0])[spectrum.argmax()])


def deviations(result: Result) -> np.ndarray:
    """Return the standard deviation of the tilt over the last `LATE_S`, one a world that stood [deg]."""
    return np.degrees(_late_signal(result, "x1_rad")).std(axis=0)


def deviation(result: Result) -> Interval | None:
    """Return the mean of `deviations` [deg]."""
    return known_interval(deviations(result))


def tail(result: Result) -> float:
    """Return the late deviation of a single run without noise: what the push has left behind [deg]."""
    return float(deviations(result).max())


def format_interval(interval: Interval | None) -> str:
    """Write an interval with three digits after the point."""
    return plus_minus(interval, 3)


def numbers(result: Result) -> dict[str, Any]:
    """Return a result's numbers for a claim's figures."""
    intervals = {key: known_interval(result.values(key)) for key in ("velocity_rms_error_rad_s", "tilt_rms_deg")}
    intervals["late_tilt_deviation_deg"] = deviation(result)
    return {
        **{key: None if interval is None else list(interval) for key, interval in intervals.items()},
        "fell_fraction": float(result.fell.mean()),
    }


def is_smaller(a: Result, b: Result, key: str = "velocity_rms_error_rad_s") -> bool | None:
    """Return true if a's numbers are smaller beyond chance, world by world; None if fewer than two stood in both."""
    difference = known_interval(b.values(key) - a.values(key))
    return None if difference is None else difference.low > 0.0


def is_better(a: Result, b: Result, key: str = "velocity_rms_error_rad_s") -> bool:
    """Return true if a's numbers are smaller beyond chance and a falls no more often, or a stands where b fell."""
    beyond_chance = is_smaller(a, b, key)
    if beyond_chance is None:
        return bool(a.stood.all() and b.fell.all())
    return beyond_chance and a.fell.mean() <= b.fell.mean()


KEYS = {"velocity_rms_error_rad_s": "velocity RMS error [rad/s]", "tilt_rms_deg": "tilt RMS [deg]"}
"""Measures that the estimators could be compared by; the paper names none."""
ASSUMED: Mapping[Assumption, str] = {
    **PUSH_AND_NOISE,
    "e": f"up to {max(BIASES_DEG):g} deg",
    "backlash": f"0 and {GAP_ARCMIN:g} arcmin",
}


def _label(key: str) -> str:
    return KEYS[key].partition(" [")[0]


def best_claims(loops: Loops) -> list[Claim]:
    """Judge section V by each measure: (10) against the other two."""
    return [_best(loops, key) for key in KEYS]


def _best(loops: Loops, key: str) -> Claim:
    wins = {
        setting: all(is_better(by_name["homogeneous"], by_name[name], key) for name in ("linear", "luenberger"))
        for setting, by_name in loops.all_settings.items()
    }
    better_settings = {
        name: [s for s, by_name in loops.all_settings.items() if is_better(by_name[name], by_name["homogeneous"], key)]
        for name in ("linear", "luenberger")
    }
    others = [
        f"{OBSERVERS[name]} is better at {'; '.join(places)}" for name, places in better_settings.items() if places
    ]
    return Claim(
        place=f"Section V, the comparison: {_label(key)}",
        statement="The nonlinear differentiator (10) offers the best behaviour of the three; judged by the "
        f"{_label(key)}.",
        assumes=ASSUMED,
        holds=wins,
        otherwise=f"{'. '.join(others) or 'It is not the best beyond chance everywhere'}.",
        figures={
            setting: {name: numbers(by_name[name]) for name in OBSERVERS} | {"10_is_best": wins[setting]}
            for setting, by_name in loops.all_settings.items()
        },
    )


def is_ranked(by_name: Mapping[str, Result], key: str = "velocity_rms_error_rad_s") -> bool:
    """Return true if (9) is better than (8), (10) better than (9), and neither of the two with a model falls."""
    with_model = is_better(by_name["luenberger"], by_name["linear"], key)
    nonlinear = is_better(by_name["homogeneous"], by_name["luenberger"], key)
    return with_model and nonlinear and not any(by_name[name].fell.any() for name in ("luenberger", "homogeneous"))


def model_based_claims(loops: Loops) -> list[Claim]:
    """Judge section VI by each measure: with a model better than without, the nonlinear better than the linear one."""
    return [_model_based(loops, key) for key in KEYS]


def _model_based(loops: Loops, key: str) -> Claim:
    holds_at = [setting for setting, by_name in loops.all_settings.items() if is_ranked(by_name, key)]
    not_at = [setting for setting in loops.all_settings if setting not in holds_at]
    return Claim(
        place=f"Section VI: {_label(key)}",
        statement="The designs with a model outperform the one without; of them the nonlinear one has the smaller "
        f"error; judged by the {_label(key)}.",
        assumes=ASSUMED,
        holds=bool(holds_at),
        conditions=(
            f"Not at {'; '.join(not_at)}: a bias makes (9) believe in a rate, until it is no better than (8), or falls."
            if not_at
            else ""
        ),
        otherwise="(9) is nowhere better than (8), or (10) nowhere better than (9).",
        figures={"holds_at": holds_at, "does_not_hold_at": not_at},
    )


NUMBERS = {"linear": 4, "luenberger": 5, "homogeneous": 6}


def picture(name: str, loops: Loops) -> Picture:
    """Draw world 0 without backlash and with it, side by side."""
    runs = {
        "without backlash": loops.by_bias[SHOWN_DEG][name],
        f"{GAP_ARCMIN:g} arcmin of backlash": loops.gap[name],
    }
    columns = [
        loop_panels(trajectory_of(result).world(0), name, OBSERVERS[name], title, 0.5) for title, result in runs.items()
    ]
    number = NUMBERS[name]
    title = f"sokolov2019, Fig. {number}: {OBSERVERS[name]} in the loop, a push at 1 s (e = {SHOWN_DEG} deg)"
    return Picture(
        f"sokolov2019-fig-{number}", title, [panel for row in zip(*columns, strict=True) for panel in row], columns=2
    )


HELD = (
    f"With {GAP_ARCMIN:g} arcmin of backlash behind the servo's motor, as its datasheet has it, and friction that "
    "holds the gimbal in the gap. The paper mentions neither."
)


SHOWN_ASSUMED: Mapping[Assumption, str] = {**PUSH_AND_NOISE, "e": f"{SHOWN_DEG:g} deg"}
LET_GO: Mapping[Assumption, str] = {
    "backlash": f"{GAP_ARCMIN:g} arcmin",
    "friction": "it holds the gimbal in the gap",
}
BEHIND_BACKLASH: Mapping[Assumption, str] = {**SHOWN_ASSUMED, **LET_GO}


def _figures(loops: Loops, name: str, cycles: Cycles) -> dict:
    no_gap, gap, cycle = loops.by_bias[SHOWN_DEG][name], loops.gap[name], cycles.ends[name]
    return {
        "without_backlash": numbers(no_gap),
        "with_backlash": numbers(gap),
        "main_frequency_hz": main_frequency(no_gap),
        "main_frequency_with_backlash_hz": main_frequency(gap),
        "push_tail_deg": tail(loops.quiet[name]),
        "cycle_amplitude_deg": cycle.amplitude_deg,
        "cycle_frequency_hz": cycle.frequency_hz,
        "cycle_is_sustained": cycle.sustained,
    }


def figure_4(loops: Loops, lags: Lags, cycles: Cycles) -> Claim:
    """Judge (8): sustained oscillations."""
    oscillates_by_itself, cycle = bool(lags.sweeps["linear"].sustained[0]), cycles.ends["linear"]
    threshold, prediction = lags.thresholds["linear"].middle, lags.predictions["linear"]
    return Claim(
        place="Fig. 4",
        statement="With (8) in the loop the system enters sustained oscillations.",
        assumes=SHOWN_ASSUMED if oscillates_by_itself else BEHIND_BACKLASH,
        holds=oscillates_by_itself or cycle.sustained,
        conditions=(
            ""
            if oscillates_by_itself
            else f"{HELD} Without backlash noise keeps the loop ringing, which is no oscillation by itself; that takes "
            f"a servo lag of {in_ms(threshold)}, and the model's is {in_ms(lags.own_lag_s)}."
        ),
        otherwise="Without noise it comes to rest, with backlash too.",
        figures=_figures(loops, "linear", cycles)
        | {"gyro": numbers(loops.gyro), "predicted_frequency_hz": prediction.frequency_hz},
        pictures=[picture("linear", loops)],
    )


def figure_5(loops: Loops, lags: Lags, cycles: Cycles) -> Claim:
    """Judge (9): much the same."""
    oscillates_by_itself, cycle = bool(lags.sweeps["luenberger"].sustained[0]), cycles.ends["luenberger"]
    falls = {e: float(by_name["luenberger"].fell.mean()) for e, by_name in loops.by_bias.items()}
    prediction = lags.predictions["luenberger"]
    return Claim(
        place="Fig. 5",
        statement="With (9) in the loop the system oscillates, much as with (8).",
        assumes=SHOWN_ASSUMED if oscillates_by_itself else BEHIND_BACKLASH,
        holds=oscillates_by_itself or cycle.sustained,
        conditions=(
            ""
            if oscillates_by_itself
            else f"{HELD} Without backlash the loop is well damped (damping ratio {prediction.damping:.2f}) and misses "
            "the push: it falls, if the bias adds to that."
        ),
        otherwise="Without noise it comes to rest, with backlash too.",
        figures=_figures(loops, "luenberger", cycles)
        | {"fell_fraction": {f"{e:g}_deg": share for e, share in falls.items()}, "damping_ratio": prediction.damping},
        pictures=[picture("luenberger", loops)],
    )


def cause_of_figure_5(lags: Lags, cycles: Cycles) -> Claim:
    """Judge the cause that Section V gives for the oscillation with (9)."""
    without_y2, with_y2 = cycles.ends["luenberger"], cycles.ends[WITH_Y2]
    predicted_cycles = {name: cycles.predicted[name] for name in ("linear", "luenberger")}
    return Claim(
        place="Section V, the cause of Fig. 5",
        statement="(9) makes the system oscillate because the linearisation does not fit its behaviour.",
        assumes=LET_GO,
        holds=without_y2.sustained and with_y2.amplitude_deg < 0.5 * without_y2.amplitude_deg,
        otherwise=(
            "The terms that the linearisation leaves out change next to nothing. The gap makes the oscillation, and "
            "would do so in a linear system."
            + ("" if lags.sweeps["luenberger"].sustained[0] else " Without it (9) comes to rest.")
        ),
        figures={
            "cycle_amplitude_deg": without_y2.amplitude_deg,
            "cycle_amplitude_with_nonlinear_terms_deg": with_y2.amplitude_deg,
            "foreseen_amplitude_deg": {name: cycle and cycle.amplitude_deg for name, cycle in predicted_cycles.items()},
            "foreseen_frequency_hz": {name: cycle and cycle.frequency_hz for name, cycle in predicted_cycles.items()},
        },
    )


def figure_6(loops: Loops, cycles: Cycles) -> Claim:
    """Judge (10): stabilised."""
    falls = {setting: float(by_name["homogeneous"].fell.mean()) for setting, by_name in loops.all_settings.items()}
    return Claim(
        place="Fig. 6",
        statement="With (10) in the loop the system is stabilised.",
        assumes={
            **PUSH_AND_NOISE,
            "e": f"up to {max(loops.by_bias):g} deg",
            "backlash": f"0 and {GAP_ARCMIN:g} arcmin",
        },
        holds=max(falls.values()) == 0.0,
        otherwise="It falls.",
        figures=_figures(loops, "homogeneous", cycles) | {"largest_fell_fraction": max(falls.values())},
        pictures=[picture("homogeneous", loops)],
    )


def figure_6_at_rest(lags: Lags, cycles: Cycles) -> Claim:
    """Judge (10): without the oscillations of the others, on the rig on which they have them."""
    eight, nine, ten = (cycles.ends[name] for name in ("linear", "luenberger", "homogeneous"))
    ratios_text = " and ".join(
        f"{ten.amplitude_deg / cycle.amplitude_deg:.2f}" for cycle in (eight, nine) if cycle.sustained
    )
    return Claim(
        place="Fig. 6, beside Figs 4 and 5",
        statement="With (10) in the loop the oscillations of Figs 4 and 5 are not there.",
        assumes=LET_GO,
        missing_data="The paper does not say what makes (8) and (9) oscillate, nor how wide a gap its servo has.",
        holds=(eight.sustained or nine.sustained) and not ten.sustained,
        otherwise="Nothing oscillates."
        if not ratios_text
        else (
            f"The causes that make (8) and (9) oscillate make (10) oscillate as well, {ratios_text} times as far. A "
            "slow servo makes (8) oscillate and not (10), but not (9) either."
        ),
        figures={f"cycle_amplitude_{name}_deg": cycle.amplitude_deg for name, cycle in cycles.ends.items()},
    )


def claims(on_share: OnShare) -> list[Claim]:
    """Judge the loops; Figs 4 to 6 need the lags and the cycles, which show what oscillates without noise."""
    lags = lag.lags(lambda share: on_share(0.2 * share))
    ends = cycles()
    results = loops(lambda share: on_share(0.3 + 0.7 * share))
    four, five, six = on_common_scales(
        [figure_4(results, lags, ends), figure_5(results, lags, ends), figure_6(results, ends)]
    )
    return [
        four,
        five,
        cause_of_figure_5(lags, ends),
        six,
        figure_6_at_rest(lags, ends),
        *best_claims(results),
        *model_based_claims(results),
        lag.claim(lags),
    ]
