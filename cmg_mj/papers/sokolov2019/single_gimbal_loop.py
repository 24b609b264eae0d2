"""Figs 4 to 6 of sokolov2019: the loop closed on each estimator, with noise and a push, over seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.intervals import Interval, mean_interval
from cmg_mj.papers.claim import Claim, OnShare, verdict
from cmg_mj.papers.sokolov2019.single_gimbal import LATE_S, Runs, limited_share, main_frequency, pushed, runs
from cmg_mj.papers.sokolov2019.single_gimbal_lag import LAGS_S, PAPERS, Lags
from cmg_mj.picture import Line, Panel, Picture
from cmg_mj.trajectory import Trajectory

SEED, WORLDS = 83_000, 20
DURATION_S = 7.0
BIASES_DEG = (0.0, 0.25, 0.5)
SHOWN_DEG = 0.25
"""The bias of the pictures: all three stand there."""
SLOW_LAG_S = 0.025
"""A servo three times as slow as the model's, beyond the threshold of (8) [s]."""
FIGURES = {"linear": "Fig. 4", "luenberger": "Fig. 5", "homogeneous": "Fig. 6"}


class Loops(NamedTuple):
    """The closed loops over seeds."""

    by_bias: dict[float, dict[str, Runs]]
    """With the model's servo: e [deg] -> observer -> runs."""
    slow: dict[str, Runs]
    """With the slow servo, at the bias of the pictures."""
    gyro: Runs
    """The law fed by the gyro, with the model's servo, at the bias of the pictures."""
    worlds: int


def loops(on_share: OnShare, worlds: int = WORLDS, seed: int = SEED, biases_deg: Sequence[float] = BIASES_DEG) -> Loops:
    """Run them all."""

    def settings(e: float) -> list[str]:
        return [f"plant.equilibrium_bias_deg={e}", f"duration_s={DURATION_S}"]

    total, done = len(PAPERS) * (len(biases_deg) + 1) + 1, 0
    by_bias: dict[float, dict[str, Runs]] = {e: {} for e in biases_deg}
    slow: dict[str, Runs] = {}
    for name in PAPERS:
        for e in biases_deg:
            by_bias[e][name] = runs(name, worlds, seed, settings(e))
            done += 1
            on_share(done / total)
        slow[name] = runs(name, worlds, seed, settings(SHOWN_DEG), servo_lag_s=SLOW_LAG_S)
        done += 1
        on_share(done / total)
    gyro = runs("homogeneous", worlds, seed, settings(SHOWN_DEG), feedback="fog")
    return Loops(by_bias, slow, gyro, worlds)


def interval(values: np.ndarray) -> Interval | None:
    """Mean and 95 % interval over the worlds that stood; None if fewer than two did."""
    stood = values[np.isfinite(values)]
    return mean_interval(stood) if len(stood) > 1 else None


def _shown(value: Interval | None, digits: int = 3) -> str:
    return "-" if value is None else f"{value.mean:.{digits}f} +- {value.half:.{digits}f}"


def _plain(value: Interval | None) -> list[float] | None:
    return None if value is None else list(value)


def _numbers(found: Runs) -> dict[str, object]:
    return {
        "velocity_rms_error_rad_s": _plain(interval(found.velocity_error)),
        "tilt_rms_deg": _plain(interval(found.tilt)),
        "late_tilt_deviation_deg": _plain(interval(found.shaking)),
        "fell_fraction": float(found.fell.mean()),
    }


def figures_4_to_6(found: Loops, lag: Lags) -> list[Claim]:
    """One claim a figure, and the comparisons that Sections V and VI draw."""
    return [_figure_4(found, lag), _figure_5(found, lag), _figure_6(found, lag), _best(found), _model_based(found)]


def _at(lag: Lags, name: str) -> bool:
    """Whether the loop oscillates by itself at the slow servo lag, without noise."""
    sweep = lag.sweeps[name]
    return bool(sweep.sustained[int(np.argmin(np.abs(sweep.lags_s - SLOW_LAG_S)))])


def _figure_4(found: Loops, lag: Lags) -> Claim:
    own, slow = found.by_bias[SHOWN_DEG]["linear"], found.slow["linear"]
    by_itself = bool(lag.sweeps["linear"].sustained[0])
    at_slow = _at(lag, "linear")
    threshold = lag.thresholds["linear"].middle
    conditions = (
        ""
        if by_itself or threshold is None
        else f"with a servo lag from {1e3 * threshold:.1f} ms; the model's is {1e3 * lag.own_lag_s:.1f} ms, and there "
        "noise keeps a badly damped loop ringing, which is no oscillation by itself"
    )
    pole = lag.predictions["linear"].pole
    return Claim(
        place="Fig. 4",
        says="With (8) in the loop the system enters sustained oscillations.",
        found=(
            f"e = {SHOWN_DEG} deg, {found.worlds} seeds, 95 % intervals, standard deviation of the tilt over the last "
            f"{LATE_S:g} s: {_shown(interval(own.shaking))} deg with the model's servo, most of it at "
            f"{main_frequency(own.trajectory):.1f} Hz (the loop's pole: {pole.imag / (2.0 * np.pi):.1f} Hz), "
            f"{_shown(interval(found.gyro.shaking))} deg if the gyro closes the loop. Without noise it "
            f"{'goes on' if by_itself else 'decays'}. With a servo lag of {1e3 * SLOW_LAG_S:.0f} ms it "
            f"{'goes on' if at_slow else 'decays'}: {_shown(interval(slow.shaking))} deg at "
            f"{main_frequency(slow.trajectory):.1f} Hz, a limit cycle: the command is at its limit "
            f"{limited_share(slow.trajectory):.0%} of the time, and {slow.fell.mean():.0%} fall."
        ),
        verdict=verdict(by_itself or at_slow, conditions),
        why=conditions if by_itself or at_slow else "It decays at both servo lags.",
        figures={
            "models_servo": _numbers(own),
            "slow_servo": _numbers(slow),
            "gyro": _numbers(found.gyro),
            "main_frequency_hz": main_frequency(own.trajectory),
            "limited_fraction_slow_servo": limited_share(slow.trajectory),
            "main_frequency_slow_servo_hz": main_frequency(slow.trajectory),
            "predicted_frequency_hz": pole.imag / (2.0 * np.pi),
        },
        pictures=[_picture("linear", found, lag)],
    )


def _figure_5(found: Loops, lag: Lags) -> Claim:
    by_itself = bool(lag.sweeps["luenberger"].sustained[0]) or _at(lag, "luenberger")
    prediction = lag.predictions["luenberger"]
    falls = {e: float(by_name["luenberger"].fell.mean()) for e, by_name in found.by_bias.items()}
    fallen = ", ".join(f"{share:.0%} at e = {e:g} deg" for e, share in falls.items())
    own = found.by_bias[SHOWN_DEG]["luenberger"]
    needed = prediction.servo_lag_s
    why = (
        f"Its loop is well damped (damping ratio {prediction.damping:.2f}): to oscillate it would need a servo lag of "
        f"{'more than 120 ms' if needed is None else f'{1e3 * needed:.0f} ms'}, by the linearised loop. What it does "
        "instead is miss the push and fall, if the bias adds to it."
    )
    return Claim(
        place="Fig. 5",
        says="With (9) in the loop the system oscillates much as with (8), because the linearisation does not fit.",
        found=(
            f"Released without noise it oscillates by itself at {lag.sweeps['luenberger'].sustained.sum()} of the "
            f"{len(lag.sweeps['luenberger'].lags_s)} servo lags tried, up to {1e3 * LAGS_S[-1]:.0f} ms. With noise and "
            f"the push, {found.worlds} seeds, it falls in {fallen}. Where it stands, at e = {SHOWN_DEG} deg, "
            f"the tilt's standard deviation over the last {LATE_S:g} s is {_shown(interval(own.shaking))} deg, (8)'s "
            f"{_shown(interval(found.by_bias[SHOWN_DEG]['linear'].shaking))} deg, and the main frequency "
            f"{main_frequency(own.trajectory):.1f} Hz."
        ),
        verdict=verdict(by_itself),
        why="" if by_itself else why,
        figures={
            "models_servo": _numbers(own),
            "slow_servo": _numbers(found.slow["luenberger"]),
            "fell_fraction": {f"{e:g}_deg": share for e, share in falls.items()},
            "damping_ratio": prediction.damping,
            "main_frequency_hz": main_frequency(own.trajectory),
        },
        pictures=[_picture("luenberger", found, lag)],
    )


def _figure_6(found: Loops, lag: Lags) -> Claim:
    name = "homogeneous"
    quiet = not (lag.sweeps[name].sustained[0] or _at(lag, name))
    falls = max(float(by_name[name].fell.mean()) for by_name in (*found.by_bias.values(), found.slow))
    stands = quiet and falls == 0.0
    own, slow = found.by_bias[SHOWN_DEG][name], found.slow[name]
    return Claim(
        place="Fig. 6",
        says="With (10) in the loop the system is stabilised, without the oscillations of Figs 4 and 5.",
        found=(
            f"Released without noise it {'comes to rest' if quiet else 'does not come to rest'}, with the model's "
            f"servo and with one of {1e3 * SLOW_LAG_S:.0f} ms; with noise and the push it falls in at most {falls:.0%} "
            f"of {found.worlds} seeds at e = {', '.join(f'{e:g}' for e in found.by_bias)} deg. At e = {SHOWN_DEG} deg "
            f"the tilt's standard deviation over the last {LATE_S:g} s is {_shown(interval(own.shaking))} deg, with "
            f"the slow servo {_shown(interval(slow.shaking))} deg; velocity RMS error "
            f"{_shown(interval(own.velocity_error))} and {_shown(interval(slow.velocity_error))} rad/s."
        ),
        verdict=verdict(stands),
        why="" if stands else "It oscillates or falls.",
        figures={"models_servo": _numbers(own), "slow_servo": _numbers(slow), "largest_fell_fraction": falls},
        pictures=[_picture(name, found, lag)],
    )


# --- the comparisons ----------------------------------------------------------------------------------------


def smaller(a: Runs, b: Runs, what: str = "velocity_error") -> bool | None:
    """Whether a's numbers are smaller than b's beyond chance, world by world; None if fewer than two stood."""
    difference = interval(getattr(b, what) - getattr(a, what))
    return None if difference is None else difference.low > 0.0


def _table(by_name: Mapping[str, Runs], what: str) -> str:
    return ", ".join(
        f"{equation} {_shown(interval(getattr(by_name[name], what)))}"
        + (f" ({by_name[name].fell.mean():.0%} fell)" if by_name[name].fell.any() else "")
        for name, equation in PAPERS.items()
    )


def _everywhere(found: Loops) -> dict[str, Mapping[str, Runs]]:
    by: dict[str, Mapping[str, Runs]] = {f"e = {e:g} deg": by_name for e, by_name in found.by_bias.items()}
    return by | {f"e = {SHOWN_DEG:g} deg, servo lag {1e3 * SLOW_LAG_S:.0f} ms": found.slow}


def _best(found: Loops) -> Claim:
    """(10) against the other two."""
    by = _everywhere(found)
    error = {
        where: all(smaller(by_name["homogeneous"], by_name[name]) is not False for name in ("linear", "luenberger"))
        for where, by_name in by.items()
    }
    tilt_of_8 = [where for where, by_name in by.items() if smaller(by_name["linear"], by_name["homogeneous"], "tilt")]
    conditions = (
        f"by the error of the estimated rate; by the tilt's RMS (8) is the better one at {'; '.join(tilt_of_8)}"
        if tilt_of_8
        else ""
    )
    return Claim(
        place="Section V, the comparison",
        says="The nonlinear differentiator (10) offers the best behaviour of the three.",
        found=(
            f"{found.worlds} seeds with 95 % intervals. Velocity RMS error [rad/s]: "
            + "; ".join(f"{where}: {_table(by_name, 'velocity_error')}" for where, by_name in by.items())
            + ". Tilt RMS [deg]: "
            + "; ".join(f"{where}: {_table(by_name, 'tilt')}" for where, by_name in by.items())
            + "."
        ),
        verdict=verdict(all(error.values()), conditions),
        why=conditions if all(error.values()) else "Its velocity error is not the smallest everywhere.",
        figures={
            where: {name: _numbers(by_name[name]) for name in PAPERS} | {"error_of_10_is_smallest": error[where]}
            for where, by_name in by.items()
        },
    )


def _model_based(found: Loops) -> Claim:
    """Section VI: with a model better than without, and the nonlinear one better than the linear one."""
    holds, not_there = [], []
    for where, by_name in _everywhere(found).items():
        with_model = smaller(by_name["luenberger"], by_name["linear"])
        nonlinear = smaller(by_name["homogeneous"], by_name["luenberger"])
        stands = not any(by_name[name].fell.any() for name in ("luenberger", "homogeneous"))
        (holds if with_model and nonlinear and stands else not_there).append(where)
    conditions = f"at {'; '.join(holds)}; not at {'; '.join(not_there)}" if holds and not_there else ""
    return Claim(
        place="Section VI",
        says="The designs with a model outperform the one without; of them the nonlinear one has the smaller error.",
        found=(
            f"Velocity RMS error, {found.worlds} seeds, world by world beyond chance: (10) < (9) < (8) with no fall at "
            f"{'; '.join(holds) or 'none'}. Not so at {'; '.join(not_there) or 'none'}: a bias makes (9) believe in a "
            "rate, until it is no better than (8), or falls."
        ),
        verdict=verdict(bool(holds), conditions),
        why=conditions if holds else "(9) is nowhere better than (8).",
        figures={"holds_at": holds, "does_not_hold_at": not_there},
    )


def _picture(name: str, found: Loops, lag: Lags) -> Picture:
    columns: list[tuple[str, Trajectory]] = [
        (f"the model's servo, {1e3 * lag.own_lag_s:.1f} ms", found.by_bias[SHOWN_DEG][name].trajectory.world(0)),
        (f"a servo lag of {1e3 * SLOW_LAG_S:.0f} ms", found.slow[name].trajectory.world(0)),
    ]
    rows: list[list[Panel]] = [[], [], []]
    tilts = [np.degrees(one["y1_rad"]) for _, one in columns]
    estimates = [one[f"estimate/{name}/x2_rad_s"] for _, one in columns]
    truths = [one["x2_rad_s"] for _, one in columns]
    commands = [one["u_rad_s"] for _, one in columns]
    ranges = [_range(values) for values in (tilts, commands, [*estimates, *truths])]
    for (title, one), tilt, estimate in zip(columns, tilts, estimates, strict=True):
        t, push = one["time_s"], pushed(one)
        rows[0].append(
            Panel("tilt y1 [deg]", [Line(t, tilt, "y1", color=7, width=0.7)], title, shaded=push, y_range=ranges[0])
        )
        u = Line(t, one["u_rad_s"], "u", color=3, width=0.7)
        rows[1].append(Panel("command u [rad/s]", [u], shaded=push, y_range=ranges[1]))
        rates = [
            Line(t, estimate, f"{PAPERS[name]} {name}", color=1, width=0.7),
            Line(t, one["x2_rad_s"], "true rate", color=0, width=1.0),
        ]
        rows[2].append(Panel("tilt rate [rad/s]", rates, shaded=push, y_range=ranges[2]))
    number = FIGURES[name].removeprefix("Fig. ")
    title = f"sokolov2019, {FIGURES[name]}: {PAPERS[name]} in the loop, a push at 1 s (e = {SHOWN_DEG} deg)"
    return Picture(f"sokolov2019-fig-{number}", title, [panel for row in rows for panel in row], columns=2)


def _range(values: Sequence[np.ndarray]) -> tuple[float, float]:
    """Room for all of them, so that the columns compare."""
    low, high = min(float(v.min()) for v in values), max(float(v.max()) for v in values)
    room = 0.05 * (high - low)
    return low - room, high + room
