"""Figs 4 to 6: the loop closed on (8), (9) and (10), without backlash and with that of the servo's datasheet."""

from __future__ import annotations

from collections.abc import Mapping

from cmg_mj.papers.claim import Assumption, Claim
from cmg_mj.papers.sokolov2019.backlash import GAP_ARCMIN
from cmg_mj.papers.sokolov2019.cycles import WITH_Y2, Cycles
from cmg_mj.papers.sokolov2019.lag import Lags, in_ms
from cmg_mj.papers.sokolov2019.loops import (
    SHOWN_DEG,
    Loops,
    main_frequency,
    numbers,
    tail,
)
from cmg_mj.papers.sokolov2019.pictures_4_to_6 import picture
from cmg_mj.papers.sokolov2019.rig import PUSH_AND_NOISE

HELD = (
    f"With {GAP_ARCMIN:g} arcmin of backlash behind the servo's motor, as its datasheet has it, and friction that "
    "holds the gimbal in the gap. The paper mentions neither."
)


ASSUMED: Mapping[Assumption, str] = {**PUSH_AND_NOISE, "e": f"{SHOWN_DEG:g} deg"}
LET_GO: Mapping[Assumption, str] = {
    "backlash": f"{GAP_ARCMIN:g} arcmin",
    "friction": "it holds the gimbal in the gap",
}
BEHIND_BACKLASH: Mapping[Assumption, str] = {**ASSUMED, **LET_GO}


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
        assumes=ASSUMED if oscillates_by_itself else BEHIND_BACKLASH,
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
        assumes=ASSUMED if oscillates_by_itself else BEHIND_BACKLASH,
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
