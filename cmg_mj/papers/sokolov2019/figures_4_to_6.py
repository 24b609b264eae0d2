"""Figs 4 to 6: the loop closed on (8), (9) and (10), without backlash and with that of the servo's datasheet."""

from __future__ import annotations

from collections.abc import Mapping

from cmg_mj.papers.claim import Assumption, Claim
from cmg_mj.papers.sokolov2019.backlash import GAP_ARCMIN
from cmg_mj.papers.sokolov2019.cycles import WITH_Y2, Cycles
from cmg_mj.papers.sokolov2019.lag import Lags, in_ms
from cmg_mj.papers.sokolov2019.loops import (
    LATE_S,
    SHOWN_DEG,
    Loops,
    deviation,
    format_interval,
    main_frequency,
    numbers,
    tail,
)
from cmg_mj.papers.sokolov2019.pictures_4_to_6 import picture
from cmg_mj.papers.sokolov2019.rig import PUSH_AND_NOISE
from cmg_mj.results.intervals import known_interval

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


def _setting(loops: Loops) -> str:
    return (
        f"e = {SHOWN_DEG} deg, a push at 1 s, {loops.worlds} seeds; standard deviation of the tilt over the last "
        f"{LATE_S:g} s"
    )


def _describe_tilt(loops: Loops, name: str) -> str:
    """Describe the tilt's late deviation in both rigs, and the push's tail in it."""
    no_gap, gap = loops.by_bias[SHOWN_DEG][name], loops.gap[name]
    return (
        f"{_setting(loops)}: {format_interval(deviation(no_gap))} deg without backlash, "
        f"{format_interval(deviation(gap))} with it. The push's tail is {tail(loops.quiet[name]):.3f} deg of it."
    )


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
    no_gap = loops.by_bias[SHOWN_DEG]["linear"]
    return Claim(
        place="Fig. 4",
        statement="With (8) in the loop the system enters sustained oscillations.",
        result=(
            f"Let go without noise it {'oscillates by itself' if oscillates_by_itself else 'comes to rest'} without "
            f"backlash; with {GAP_ARCMIN:g} arcmin it {cycle.words}. {_describe_tilt(loops, 'linear')} Without "
            f"backlash most of it is at {main_frequency(no_gap):.1f} Hz, where the loop has a badly damped pole "
            f"({prediction.frequency_hz:.1f} Hz). With the gyro in the law it is "
            f"{format_interval(deviation(loops.gyro))} deg."
        ),
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
    falls_text = ", ".join(f"{share:.0%} at e = {e:g} deg" for e, share in falls.items())
    prediction = lags.predictions["luenberger"]
    return Claim(
        place="Fig. 5",
        statement="With (9) in the loop the system oscillates, much as with (8).",
        result=(
            f"Let go without noise it {'oscillates by itself' if oscillates_by_itself else 'comes to rest'} without "
            f"backlash; with {GAP_ARCMIN:g} arcmin it {cycle.words}, (8) {cycles.ends['linear'].words}. "
            f"{_describe_tilt(loops, 'luenberger')} Without backlash it falls in {falls_text}."
        ),
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
    cycles_text = " and ".join(
        "none" if cycle is None else f"{cycle.amplitude_deg:.2f} deg at {cycle.frequency_hz:.1f} Hz"
        for cycle in predicted_cycles.values()
    )
    return Claim(
        place="Section V, the cause of Fig. 5",
        statement="(9) makes the system oscillate because the linearisation does not fit its behaviour.",
        result=(
            f"With backlash the loop {without_y2.words}. With gravity, J2 and y2 in (9) as in the nonlinear model it "
            f"{with_y2.words}. The linear loop with a gap, for which the linearisation is exact, has by its describing "
            f"function cycles of {cycles_text} with (8) and (9)."
        ),
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
    error = known_interval(loops.by_bias[SHOWN_DEG]["homogeneous"].values("velocity_rms_error_rad_s"))
    return Claim(
        place="Fig. 6",
        statement="With (10) in the loop the system is stabilised.",
        result=(
            f"With noise and the push it falls in at most {max(falls.values()):.0%} of {loops.worlds} seeds at "
            f"{', '.join(falls)}. {_describe_tilt(loops, 'homogeneous')} The velocity RMS error is "
            f"{format_interval(error)} rad/s."
        ),
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
    is_sustained = lags.sweeps["homogeneous"].sustained
    return Claim(
        place="Fig. 6, beside Figs 4 and 5",
        statement="With (10) in the loop the oscillations of Figs 4 and 5 are not there.",
        result=(
            f"Let go without noise, with backlash, (10) {ten.words}. (8) {eight.words}. (9) {nine.words}. "
            f"Without backlash (10) comes to rest at {len(is_sustained) - is_sustained.sum()} of {len(is_sustained)} "
            f"servo lags up to {in_ms(float(lags.sweeps['homogeneous'].lags_s[-1]))}."
        ),
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
