"""Figs 4 to 6: the loop closed on (8), (9) and (10)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cmg_mj.intervals import known_interval
from cmg_mj.papers.claim import Claim
from cmg_mj.papers.recorded import pushed, trajectory_of
from cmg_mj.papers.sokolov2019.lag import Lags
from cmg_mj.papers.sokolov2019.loops import (
    LATE_S,
    SHOWN_DEG,
    SLOW_LAG_S,
    Loops,
    deviation,
    limited_share,
    main_frequency,
    numbers,
    shown,
)
from cmg_mj.papers.sokolov2019.paper import OBSERVERS
from cmg_mj.papers.sokolov2019.release import LAGS_S
from cmg_mj.picture import Line, Panel, Picture

FIGURES = {"linear": 4, "luenberger": 5, "homogeneous": 6}


def figure_4(found: Loops, lags: Lags) -> Claim:
    """(8): sustained oscillations."""
    own, slow = found.by_bias[SHOWN_DEG]["linear"], found.slow["linear"]
    sweep, begins, prediction = lags.sweeps["linear"], lags.thresholds["linear"].middle, lags.predictions["linear"]
    by_itself, at_slow = bool(sweep.sustained[0]), sweep.sustained_at(SLOW_LAG_S)
    return Claim(
        place="Fig. 4",
        says="With (8) in the loop the system enters sustained oscillations.",
        found=(
            f"e = {SHOWN_DEG} deg, {found.worlds} seeds, 95 % intervals, standard deviation of the tilt over the last "
            f"{LATE_S:g} s: {shown(deviation(own))} deg with the model's servo, most of it at "
            f"{main_frequency(own):.1f} Hz (the loop's pole: {prediction.frequency_hz:.1f} Hz), "
            f"{shown(deviation(found.gyro))} deg if the gyro closes the loop. Without noise it "
            f"{'goes on' if by_itself else 'decays'}. With a servo lag of {1e3 * SLOW_LAG_S:.0f} ms it "
            f"{'goes on' if at_slow else 'decays'}: {shown(deviation(slow))} deg at "
            f"{main_frequency(slow):.1f} Hz, a limit cycle: the command is at its limit "
            f"{limited_share(slow):.0%} of the time, and {slow.fell.mean():.0%} fall."
        ),
        holds=by_itself or at_slow,
        conditions=(
            ""
            if by_itself or begins is None
            else f"It does with a servo lag from {1e3 * begins:.1f} ms; the model's is "
            f"{1e3 * lags.own_lag_s:.1f} ms, and there noise keeps a badly damped loop ringing, which is no "
            "oscillation by itself."
        ),
        otherwise="It decays at both servo lags.",
        figures={
            "models_servo": numbers(own),
            "slow_servo": numbers(slow),
            "gyro": numbers(found.gyro),
            "main_frequency_hz": main_frequency(own),
            "limited_fraction_slow_servo": limited_share(slow),
            "main_frequency_slow_servo_hz": main_frequency(slow),
            "predicted_frequency_hz": prediction.frequency_hz,
        },
        pictures=[_picture("linear", found, lags)],
    )


def figure_5(found: Loops, lags: Lags) -> Claim:
    """(9): much the same, says the paper."""
    sweep, prediction = lags.sweeps["luenberger"], lags.predictions["luenberger"]
    falls = {e: float(by_name["luenberger"].fell.mean()) for e, by_name in found.by_bias.items()}
    fallen = ", ".join(f"{share:.0%} at e = {e:g} deg" for e, share in falls.items())
    own, linear = (found.by_bias[SHOWN_DEG][name] for name in ("luenberger", "linear"))
    needed = prediction.servo_lag_s
    return Claim(
        place="Fig. 5",
        says="With (9) in the loop the system oscillates much as with (8), because the linearisation does not fit.",
        found=(
            f"Released without noise it oscillates by itself at {sweep.sustained.sum()} of the {len(sweep.lags_s)} "
            f"servo lags tried, up to {1e3 * LAGS_S[-1]:.0f} ms. With noise and "
            f"the push, {found.worlds} seeds, it falls in {fallen}. Where it stands, at e = {SHOWN_DEG} deg, "
            f"the tilt's standard deviation over the last {LATE_S:g} s is {shown(deviation(own))} deg, (8)'s "
            f"{shown(deviation(linear))} deg, and the main frequency {main_frequency(own):.1f} Hz."
        ),
        holds=bool(sweep.sustained[0]) or sweep.sustained_at(SLOW_LAG_S),
        otherwise=(
            f"Its loop is well damped (damping ratio {prediction.damping:.2f}): to oscillate it would need a servo lag "
            f"of {'more than 120 ms' if needed is None else f'{1e3 * needed:.0f} ms'}, by the linearised loop. What it "
            "does instead is miss the push and fall, if the bias adds to it."
        ),
        figures={
            "models_servo": numbers(own),
            "slow_servo": numbers(found.slow["luenberger"]),
            "fell_fraction": {f"{e:g}_deg": share for e, share in falls.items()},
            "damping_ratio": prediction.damping,
            "main_frequency_hz": main_frequency(own),
        },
        pictures=[_picture("luenberger", found, lags)],
    )


def figure_6(found: Loops, lags: Lags) -> Claim:
    """(10): stabilised, without oscillation."""
    own, slow = found.by_bias[SHOWN_DEG]["homogeneous"], found.slow["homogeneous"]
    sweep = lags.sweeps["homogeneous"]
    quiet = not (sweep.sustained[0] or sweep.sustained_at(SLOW_LAG_S))
    falls = max(float(by_name["homogeneous"].fell.mean()) for by_name in found.everywhere.values())
    error, error_slow = (known_interval(result.values("velocity_rms_error_rad_s")) for result in (own, slow))
    return Claim(
        place="Fig. 6",
        says="With (10) in the loop the system is stabilised, without the oscillations of Figs 4 and 5.",
        found=(
            f"Released without noise it {'comes to rest' if quiet else 'does not come to rest'}, with the model's "
            f"servo and with one of {1e3 * SLOW_LAG_S:.0f} ms; with noise and the push it falls in at most {falls:.0%} "
            f"of {found.worlds} seeds at e = {', '.join(f'{e:g}' for e in found.by_bias)} deg. At e = {SHOWN_DEG} deg "
            f"the tilt's standard deviation over the last {LATE_S:g} s is {shown(deviation(own))} deg, with "
            f"the slow servo {shown(deviation(slow))} deg; velocity RMS error "
            f"{shown(error)} and {shown(error_slow)} rad/s."
        ),
        holds=quiet and falls == 0.0,
        otherwise="It oscillates or falls.",
        figures={"models_servo": numbers(own), "slow_servo": numbers(slow), "largest_fell_fraction": falls},
        pictures=[_picture("homogeneous", found, lags)],
    )


def _picture(name: str, found: Loops, lags: Lags) -> Picture:
    """World 0 with the model's servo and with the slow one, side by side on the same scales."""
    runs = {
        f"the model's servo, {1e3 * lags.own_lag_s:.1f} ms": found.by_bias[SHOWN_DEG][name],
        f"a servo lag of {1e3 * SLOW_LAG_S:.0f} ms": found.slow[name],
    }
    worlds = {title: trajectory_of(result).world(0) for title, result in runs.items()}
    rows: list[list[Panel]] = [[], [], []]
    for title, one in worlds.items():
        t = one["time_s"]
        signals = [
            ("tilt y1 [deg]", [Line(t, np.degrees(one["y1_rad"]), "y1", color=7, width=0.7)]),
            ("command u [rad/s]", [Line(t, one["u_rad_s"], "u", color=3, width=0.7)]),
            (
                "tilt rate [rad/s]",
                [
                    Line(t, one[f"estimate/{name}/x2_rad_s"], f"{OBSERVERS[name]} {name}", color=1, width=0.7),
                    Line(t, one["x2_rad_s"], "true rate", color=0, width=1.0),
                ],
            ),
        ]
        for row, (label, lines) in zip(rows, signals, strict=True):
            row.append(Panel(label, lines, title if row is rows[0] else "", shaded=pushed(one)))
    panels = [panel for row in rows for panel in _on_one_scale(row)]
    number = FIGURES[name]
    title = f"sokolov2019, Fig. {number}: {OBSERVERS[name]} in the loop, a push at 1 s (e = {SHOWN_DEG} deg)"
    return Picture(f"sokolov2019-fig-{number}", title, panels, columns=2)


def _on_one_scale(row: Sequence[Panel]) -> list[Panel]:
    """Room for all that the panels show, so that they compare."""
    values = np.concatenate([line.y for panel in row for line in panel.lines])
    low, high = float(values.min()), float(values.max())
    room = 0.05 * (high - low)
    return [replace(panel, y_range=(low - room, high + room)) for panel in row]
