"""Section V after Fig. 3, and Section VI: the loop closed on each estimator, with noise and a push, over seeds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.papers.claim import Claim
from cmg_mj.papers.recorded import loop_picture, on_common_scales, run_settings, trajectory_of
from cmg_mj.papers.sokolov2019 import lag
from cmg_mj.papers.sokolov2019.backlash import GAP_ARCMIN, Cycles, cycles, peak_frequency
from cmg_mj.papers.sokolov2019.figure_3 import WITH_Y2
from cmg_mj.papers.sokolov2019.paper import OBSERVERS
from cmg_mj.papers.sokolov2019.rig import PUSH_AND_NOISE, experiment
from cmg_mj.results.intervals import known_interval
from cmg_mj.results.result import Result
from cmg_mj.view.plots.figure import Picture

SEED, WORLDS = 83_000, 20
DURATION_S = 15.0
"""Until the push's tail has faded: the law's slowest poles, -0.19 +- 0.29j 1/s, leave a tenth of it after 12 s [s]."""
LATE_S = 4.0
"""The end of a run that counts as after the push [s]."""
BIASES_DEG = (0.0, 0.25, 0.5)
WEAKER_N_M = 0.1
"""Torque of a weaker push, since the paper does not give its own [N m]."""
SHOWN_DEG = 0.25
"""The bias of the pictures: all three stand there."""
BEHIND_A_GAP = f"e = {SHOWN_DEG:g} deg, {GAP_ARCMIN:g} arcmin of backlash"

ByName = Mapping[str, Result]
"""Observer -> runs."""


class Loops(NamedTuple):
    """The closed loops over seeds."""

    by_bias: Mapping[float, ByName]
    """Runs without backlash by e [deg]."""
    weaker: Mapping[float, ByName]
    """The same with a push of `WEAKER_N_M`."""
    gap: ByName
    """Runs with the datasheet's backlash, at the bias of the pictures."""
    gyro: Result
    """The law fed by the gyro, without backlash, at the bias of the pictures."""

    @property
    def all_settings(self) -> dict[str, ByName]:
        """All but the gyro's, by where, in words."""
        pushes = {0.5: self.by_bias, WEAKER_N_M: self.weaker}
        no_gap = {f"{push:g} N m, e = {e:g} deg": of for push, by_bias in pushes.items() for e, of in by_bias.items()}
        return {**no_gap, BEHIND_A_GAP: self.gap}


def loops(worlds: int = WORLDS, seed: int = SEED) -> Loops:
    """Run them all; those with noise at once, the same seeds for every observer, at every bias and with the gap."""
    settings = [f"seed={seed}", f"duration_s={DURATION_S}", f"plant.equilibrium_bias_deg={SHOWN_DEG}"]
    n = len(BIASES_DEG)
    values = {
        "equilibrium_bias_deg": [*BIASES_DEG, *BIASES_DEG, SHOWN_DEG],
        "push.0.torque_n_m": [0.5] * n + [WEAKER_N_M] * n + [0.5],
        "gimbal_backlash_arcmin": [*[0.0] * 2 * n, GAP_ARCMIN],
    }
    by_case = zip(*run_settings([experiment(settings, name) for name in OBSERVERS], values, worlds), strict=True)
    *no_gap, gap = (dict(zip(OBSERVERS, results, strict=True)) for results in by_case)
    by_bias, weaker = (dict(zip(BIASES_DEG, part, strict=True)) for part in (no_gap[:n], no_gap[n:]))
    gyro = experiment(settings, feedback="fog").run_many(worlds)
    return Loops(by_bias, weaker, gap, gyro)


# --- what is read off the runs ------------------------------------------------------------------------------

VELOCITY, TILT = "velocity_rms_error_rad_s", "tilt_rms_deg"
KEYS = {VELOCITY: "velocity RMS error", TILT: "tilt RMS"}
"""Measures that the estimators could be compared by; the paper names none."""


def _late_signal(result: Result, name: str) -> np.ndarray:
    """Return a signal over the last `LATE_S` of the worlds that stood, (n_ticks, n_stood)."""
    t = trajectory_of(result)["time_s"]
    return trajectory_of(result)[name].reshape(len(t), -1)[t >= t[-1] - LATE_S][:, result.stood]


def main_frequency(result: Result) -> float:
    """Find the late peak of the tilt rate's spectrum, averaged over the worlds that stood [Hz]."""
    t, x2 = trajectory_of(result)["time_s"], _late_signal(result, "x2_rad_s")
    return peak_frequency(x2 - x2.mean(axis=0), t[1] - t[0])


def deviations(result: Result) -> np.ndarray:
    """Return the standard deviation of the tilt over the last `LATE_S`, one a world that stood [deg]."""
    return np.degrees(_late_signal(result, "x1_rad")).std(axis=0)


def numbers(result: Result) -> dict[str, Any]:
    """Return a result's numbers for a claim's figures."""
    return {
        **{key: known_interval(result.values(key)) for key in KEYS},
        "late_tilt_deviation_deg": known_interval(deviations(result)),
        "fell_fraction": result.fell.mean(),
    }


def is_better(a: Result, b: Result, key: str = VELOCITY) -> bool:
    """Return true if a's numbers are smaller beyond chance and a falls no more often, or a stands where b fell."""
    difference = known_interval(b.values(key) - a.values(key))  # None if fewer than two worlds stood in both
    if difference is None:
        return bool(a.stood.all() and b.fell.all())
    return difference.low > 0.0 and a.fell.mean() <= b.fell.mean()


# --- Figs 4 to 6 --------------------------------------------------------------------------------------------

LET_GO = {
    "backlash": f"{GAP_ARCMIN:g} arcmin",
    "friction": "it holds the gimbal in the gap",
}
HELD = (
    f"With {GAP_ARCMIN:g} arcmin of backlash behind the servo's motor, as its datasheet has it, and friction that "
    "holds the gimbal in the gap. The paper mentions neither."
)
ALL_SETTINGS = {
    **PUSH_AND_NOISE,
    "push": f"{WEAKER_N_M:g} or 0.5 N m for 0.1 s",
    "e": f"up to {max(BIASES_DEG):g} deg",
    "backlash": f"0 and {GAP_ARCMIN:g} arcmin",
}
NUMBERS = {"linear": 4, "luenberger": 5, "homogeneous": 6}
"""Observer -> its figure."""


def _figures(loops: Loops, name: str, cycles: Cycles) -> dict:
    no_gap, gap, cycle = loops.by_bias[SHOWN_DEG][name], loops.gap[name], cycles.ends[name]
    return {
        "without_backlash": numbers(no_gap),
        "with_backlash": numbers(gap),
        "main_frequency_hz": main_frequency(no_gap),
        "main_frequency_with_backlash_hz": main_frequency(gap),
        "cycle_amplitude_deg": cycle.amplitude_deg,
        "cycle_frequency_hz": cycle.frequency_hz,
        "cycle_is_sustained": cycle.sustained,
    }


def picture(name: str, loops: Loops) -> Picture:
    """Draw world 0 without backlash and with it, side by side."""
    runs = {
        "without backlash": loops.by_bias[SHOWN_DEG][name],
        f"{GAP_ARCMIN:g} arcmin of backlash": loops.gap[name],
    }
    number, equation = NUMBERS[name], OBSERVERS[name]
    title = f"sokolov2019, Fig. {number}: {equation} in the loop, a push at 1 s (e = {SHOWN_DEG} deg)"
    return loop_picture((f"sokolov2019-fig-{number}", title), (name, equation), runs, 0.5, gimbal=False)


def oscillation(
    name: str, statement: str, without_backlash: str, loops: Loops, cycles: Cycles, figures: Mapping[str, Any]
) -> Claim:
    """Judge Fig. 4 or 5: whether the loop oscillates without end, let go behind the gap."""
    return Claim(
        f"Fig. {NUMBERS[name]}",
        statement,
        assumes={**PUSH_AND_NOISE, "e": f"{SHOWN_DEG:g} deg", **LET_GO},
        holds=cycles.ends[name].sustained,
        conditions=f"{HELD} {without_backlash}",
        figures={**_figures(loops, name, cycles), **figures},
        picture=picture(name, loops),
    )


def figure_4(loops: Loops, lags: lag.Lags, cycles: Cycles) -> Claim:
    """Judge (8): sustained oscillations."""
    return oscillation(
        "linear",
        "With (8) in the loop the system enters sustained oscillations.",
        "Without backlash noise keeps the loop ringing, which is no oscillation by itself; that takes a servo lag of "
        "21.3 ms, and the model's is 8.5 ms.",
        loops,
        cycles,
        {
            "gyro": numbers(loops.gyro),
            "predicted_frequency_hz": lags.predictions["linear"]["pole_1_s"][1] / (2.0 * np.pi),
        },
    )


def figure_5(loops: Loops, lags: lag.Lags, cycles: Cycles) -> Claim:
    """Judge (9): much the same."""
    return oscillation(
        "luenberger",
        "With (9) in the loop the system oscillates, much as with (8).",
        "Without backlash the loop is well damped and misses the push: it falls, if the bias adds to that.",
        loops,
        cycles,
        {
            "fell_fraction": {f"{e:g}_deg": of["luenberger"].fell.mean() for e, of in loops.by_bias.items()},
            "damping_ratio": lags.predictions["luenberger"]["damping_ratio"],
        },
    )


def cause_of_figure_5(cycles: Cycles) -> Claim:
    """Judge the cause that Section V gives for the oscillation with (9)."""
    without_y2, with_y2 = cycles.ends["luenberger"], cycles.ends[WITH_Y2]
    return Claim(
        "Section V, the cause of Fig. 5",
        "(9) makes the system oscillate because the linearisation does not fit its behaviour.",
        assumes=LET_GO,
        holds=without_y2.sustained and with_y2.amplitude_deg < 0.5 * without_y2.amplitude_deg,
        otherwise="The terms that the linearisation leaves out change next to nothing. The gap makes the oscillation, "
        "and would do so in a linear system. Without it (9) comes to rest. So it is with gaps of 5 to 40 arcmin, e up "
        "to 0.25 deg and a release from 0.2 or 2 deg, and where y1 that is 50 ms late makes the oscillation.",
        figures={
            "cycle_amplitude_deg": without_y2.amplitude_deg,
            "cycle_amplitude_with_nonlinear_terms_deg": with_y2.amplitude_deg,
            "foreseen": {name: cycle and cycle._asdict() for name, cycle in cycles.predicted.items()},
        },
    )


def figure_6(loops: Loops, cycles: Cycles) -> Claim:
    """Judge (10): stabilised."""
    falls = max(by_name["homogeneous"].fell.mean() for by_name in loops.all_settings.values())
    return Claim(
        "Fig. 6",
        "With (10) in the loop the system is stabilised.",
        assumes=ALL_SETTINGS,
        holds=falls == 0.0,
        figures=_figures(loops, "homogeneous", cycles) | {"largest_fell_fraction": falls},
        picture=picture("homogeneous", loops),
    )


def figure_6_at_rest(cycles: Cycles) -> Claim:
    """Judge (10): without the oscillations of the others, on the rig on which they have them."""
    eight, nine, ten = (cycles.ends[name] for name in OBSERVERS)
    return Claim(
        "Fig. 6, beside Figs 4 and 5",
        "With (10) in the loop the oscillations of Figs 4 and 5 are not there.",
        assumes=LET_GO,
        missing_data="The paper does not say what makes (8) and (9) oscillate, nor how wide a gap its servo has.",
        holds=(eight.sustained or nine.sustained) and not ten.sustained,
        otherwise="The causes that make (8) and (9) oscillate make (10) oscillate as well, though not as far. A slow "
        "servo makes (8) oscillate and not (10), but not (9) either.",
        figures={f"cycle_amplitude_{name}_deg": cycle.amplitude_deg for name, cycle in cycles.ends.items()},
    )


# --- the comparisons ----------------------------------------------------------------------------------------


def best(loops: Loops, key: str) -> Claim:
    """Judge section V by one measure: (10) against the other two, in one setting."""
    wins = {
        setting: all(is_better(by_name["homogeneous"], by_name[name], key) for name in ("linear", "luenberger"))
        for setting, by_name in loops.all_settings.items()
    }
    return Claim(
        f"Section V, the comparison: {KEYS[key]}",
        f"The nonlinear differentiator (10) offers the best behaviour of the three; judged by the {KEYS[key]}.",
        assumes=ALL_SETTINGS,
        holds=wins,
        one_suffices=True,
        conditions={
            VELOCITY: "With the weaker push and no bias (9) has the smaller error.",
            TILT: "With the weaker push and at most a small bias; elsewhere (8) tilts least.",
        }[key],
        figures={
            setting: {name: numbers(by_name[name]) for name in OBSERVERS}
            for setting, by_name in loops.all_settings.items()
        },
    )


def is_ranked(by_name: ByName, key: str = VELOCITY) -> bool:
    """Return true if (9) is better than (8), (10) better than (9), and neither of the two with a model falls."""
    with_model = is_better(by_name["luenberger"], by_name["linear"], key)
    nonlinear = is_better(by_name["homogeneous"], by_name["luenberger"], key)
    return with_model and nonlinear and not any(by_name[name].fell.any() for name in ("luenberger", "homogeneous"))


def model_based(loops: Loops, key: str) -> Claim:
    """Judge section VI by one measure: with a model better than without, the nonlinear better than the linear one."""
    ranked = {setting: is_ranked(by_name, key) for setting, by_name in loops.all_settings.items()}
    return Claim(
        f"Section VI: {KEYS[key]}",
        "The designs with a model outperform the one without; of them the nonlinear one has the smaller "
        f"error; judged by the {KEYS[key]}.",
        assumes=ALL_SETTINGS,
        holds=ranked,
        one_suffices=True,
        conditions={
            VELOCITY: "Not where a bias makes (9) believe in a rate, until it is no better than (8), or falls; nor "
            "with the weaker push and no bias, where (9) has the smaller error.",
            TILT: "With the weaker push and no bias; elsewhere (8) tilts less than (9).",
        }[key],
    )


def claims() -> list[Claim]:
    """Judge the loops; Figs 4 to 6 need the lags and the cycles, which show what oscillates without noise."""
    lags, ends, results = lag.lags(), cycles(), loops()
    four, five, six = on_common_scales(
        [figure_4(results, lags, ends), figure_5(results, lags, ends), figure_6(results, ends)]
    )
    return [
        four,
        five,
        cause_of_figure_5(ends),
        six,
        figure_6_at_rest(ends),
        *(best(results, key) for key in KEYS),
        *(model_based(results, key) for key in KEYS),
        lag.claim(lags),
    ]
