"""The differentiators: lag and noise of (9); whether the error of (11) is gone in finite time, and where it ends."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cmg_mj.core.arrays import signed_power
from cmg_mj.observers import Measurement, make_observer
from cmg_mj.papers.aranovskiy2020.paper import TABLE_2, printed_model
from cmg_mj.papers.claim import Array, Claim
from cmg_mj.papers.pair import DT, replay_at_rest
from cmg_mj.papers.recorded import largest_size, rms
from cmg_mj.view.plots.figure import Line, Panel, Picture

ALPHAS = (0.55, 0.7, 0.85, 1.0)


def rates_at_rest(alpha: float, dt: float, span_s: float, **start: float) -> Array:
    """Run the bench's (11) at rest from a wrong state, without noise: sizes of its rate, (n_samples,) [rad/s]."""
    observer, measurement = make_observer("homogeneous", dt, printed_model(), alpha=alpha), Measurement(0.0, 0.0)
    state, rates = observer.init(measurement)._replace(**start), []
    for _ in range(round(span_s / dt)):
        state, estimate = observer.step(state, measurement, 0.0)
        rates.append(abs(estimate.x2))
    return np.array(rates)


# --- finite time ------------------------------------------------------------------------------------------------

DECADES = 12
"""Powers of ten that the error is followed down."""
STEP = 5e-4
"""Step of the integration [s], at the error's first size."""
FINE_DT = 1e-4
"""Sample period at which the bench's observer is compared with the differential equation [s]."""
SEEN = 1e-3
"""Share of the rate's first error: when the error has fallen to it for good, the two are compared."""


class Decay(NamedTuple):
    """The course of an error that fades."""

    decades: Array
    """Powers of ten by which its homogeneous size has fallen, (n,)."""
    time_s: Array
    """Times of these sizes, (n,) [s]."""
    rate: Array
    """The rate's error then, of 1 at first, (n,) [rad/s]."""

    @property
    def turns(self) -> Array:
        """Changes of the sign of the rate's error: rows of `time_s`, (n_turns,)."""
        return np.flatnonzero(np.diff(np.sign(self.rate)))

    @property
    def shrink_factor(self) -> float:
        """Mean factor by which a half turn of the error is quicker than the one before it."""
        spans = np.diff(self.time_s[self.turns])
        return (spans[-1] / spans[0]) ** (1.0 / (len(spans) - 1))

    @property
    def decades_a_turn(self) -> float:
        """Powers of ten by which the size falls in a half turn."""
        return np.diff(self.decades[self.turns]).mean()

    @property
    def end_s(self) -> float:
        """Time at which the error is zero: the last turn plus the geometric series of all turns to come, or inf."""
        factor, (before, last) = self.shrink_factor, self.time_s[self.turns[-2:]]
        return math.inf if factor > 0.99 else last + (last - before) * factor / (1.0 - factor)


def decay(alpha: float) -> Decay:
    """Follow e1' = e2 - k1 [e1]^alpha, e2' = -k2 [e1]^(2 alpha - 1) from e = (0, 1 rad/s) down by twelve decades.

    In e1 = r z1, e2 = r^alpha z2 with z1^2 + |z2|^(2/alpha) = 1 and a time that runs faster as r^(alpha - 1), nothing
    gets steep as r falls.
    """
    k1, k2, _ = TABLE_2["homogeneous"].values()

    def slope(state: Array) -> Array:
        z1, z2, log_r, _ = state.tolist()
        f1, f2 = z2 - k1 * signed_power(z1, alpha), -k2 * signed_power(z1, 2.0 * alpha - 1.0)
        fall = z1 * f1 + signed_power(z2, 2.0 / alpha - 1.0) * f2 / alpha
        fall /= z1 * z1 + abs(z2) ** (2.0 / alpha)  # 1, but for this it would stray from it
        return np.array([f1 - fall * z1, f2 - alpha * fall * z2, fall, math.exp((1.0 - alpha) * log_r)])

    states, h = [np.array([0.0, 1.0, 0.0, 0.0])], STEP
    while states[-1][2] > -DECADES * math.log(10.0):  # one classical Runge-Kutta step
        start = states[-1]
        a = slope(start)
        b = slope(start + h / 2.0 * a)
        c = slope(start + h / 2.0 * b)
        d = slope(start + h * c)
        states.append(start + h * ((a + 2.0 * (b + c) + d) / 6.0))
    _, z2, log_r, time = np.array(states).T
    lowest = np.minimum.accumulate(log_r)  # the size is not monotonic where the error turns
    return Decay(-lowest / math.log(10.0), time, np.exp(alpha * log_r) * z2)


def time_below(times: Array, rate: Array) -> float:
    """Return the time from which a rate stays below `SEEN` [s]."""
    return float(times[np.flatnonzero(np.abs(rate) > SEEN)[-1] + 1])


def finite_time() -> Claim:
    """Judge whether the time is finite for alpha below 1, not for 1."""
    decays = {alpha: decay(alpha) for alpha in ALPHAS}
    ends = {alpha: d.end_s for alpha, d in decays.items()}
    factor_error = max(
        abs(d.shrink_factor / 10.0 ** ((alpha - 1.0) * d.decades_a_turn) - 1.0) for alpha, d in decays.items()
    )
    printed = decays[TABLE_2["homogeneous"]["alpha"]]
    rates = rates_at_rest(TABLE_2["homogeneous"]["alpha"], FINE_DT, 1.5, x2=1.0)
    observer_s = time_below(FINE_DT * np.arange(1, len(rates) + 1), rates)
    equation_s = time_below(printed.time_s, printed.rate)
    lines = [Line(d.time_s[::5], 10.0 ** (-d.decades[::5]), f"alpha = {alpha:g}") for alpha, d in decays.items()]
    return Claim(
        "After (11), finite time",
        "Were it not for the replaced x2 and sin(x1), the error would converge to the origin in finite time.",
        is_general=True,
        holds=all(math.isfinite(end) == (alpha < 1.0) for alpha, end in ends.items())
        and factor_error < 0.02
        and abs(observer_s / equation_s - 1.0) < 0.02,
        conditions="Tried with k1, k2 of Table 2 and alpha = 0.55, 0.7, 0.85, 1. For alpha below 1; the printed "
        "(1/2, 1] has 1 in it, with which the error fades exponentially.",
        figures={
            "gone_after_s": {alpha: end for alpha, end in ends.items() if alpha < 1.0},
            "time_of_a_half_turn_by_the_one_before": {alpha: d.shrink_factor for alpha, d in decays.items()},
            "fallen_to_a_thousandth_after_s": {"observer": observer_s, "equation": equation_s},
        },
        picture=Picture(
            "aranovskiy2020-finite-time",
            "aranovskiy2020, (11) without bias and noise: how its error fades from 1 rad/s",
            [Panel("homogeneous size of the error", lines, y_scale="log")],
        ),
    )


# --- the vicinity -----------------------------------------------------------------------------------------------

SEED = 77_000
SETTLING = ALPHAS[1:]
"""The exponents without much chatter."""
BIASES_DEG = (0.125, 0.25, 0.5, 1.0, 2.0)
NOISES_RAD = (0.0005, 0.001, 0.002, 0.004, 0.008)
TICKS = 2000
VANISHED = 1e-3
"""Share of the rate's first error that counts as none."""
SEEN_RAD_S = 0.01
"""Biases of the rate above this one are compared with the closed form by their ratio, those below by the difference."""


def errors_at_rest(alpha: float, y1: Array) -> Array:
    """Return the RMS of the rate estimated at rest, (n_worlds,) [rad/s], from y1, (n_ticks, n_worlds) [rad]."""
    observer = make_observer("homogeneous", DT, printed_model(), alpha=alpha)
    return rms(replay_at_rest(observer, y1).x2[len(y1) // 2 :])


def bias_bound(alpha: float, e_rad: float) -> float:
    """k1 (M sin e/(J1 k2))^(alpha/(2 alpha - 1)), where (11) rests if y1 = -e [rad/s]."""
    model, (k1, k2, _) = printed_model(), TABLE_2["homogeneous"].values()
    pull = model.gravity_torque * math.sin(e_rad) / model.J1
    return k1 * (pull / k2) ** (alpha / (2.0 * alpha - 1.0))


def vicinity(seed: int = SEED) -> Claim:
    """Judge convergence to a vicinity of the origin, and how large it is."""
    # What is left after 3 s of a wrong rate of -1 rad/s at rest: the last 0.5 s' largest.
    errors, fine_errors = (
        {a: rates_at_rest(a, dt, 3.0, x1=0.05, x2=-1.0)[-round(0.5 / dt) :].max() for a in ALPHAS}
        for dt in (DT, DT / 10.0)
    )
    # Sampled, (11) chatters with an amplitude that falls as dt^(alpha/(1 - alpha)), by homogeneity.
    converges = all(errors[a] < VANISHED or fine_errors[a] < errors[a] / 10.0 for a in ALPHAS)
    biases, noise = np.radians(BIASES_DEG), np.random.default_rng(seed).normal(0.0, 1.0, (TICKS, 16))
    biased, noisy = np.tile(-biases, (TICKS, 1)), np.hstack([sigma * noise for sigma in NOISES_RAD])
    by_bias = {alpha: errors_at_rest(alpha, biased) for alpha in SETTLING}
    bounds = {alpha: np.array([bias_bound(alpha, e) for e in biases]) for alpha in SETTLING}
    by_noise = {alpha: errors_at_rest(alpha, noisy).reshape(len(NOISES_RAD), -1).mean(axis=1) for alpha in SETTLING}
    pairs = [pair for alpha in SETTLING for pair in zip(by_bias[alpha], bounds[alpha], strict=True)]
    relative_difference = max(abs(x / b - 1.0) for x, b in pairs if b > SEEN_RAD_S)
    difference = max(abs(x - b) for x, b in pairs if b <= SEEN_RAD_S)
    slopes = {a: np.polyfit(np.log(NOISES_RAD), np.log(error), 1)[0] for a, error in by_noise.items()}
    biased_lines, noisy_lines = [], []
    for i, alpha in enumerate(SETTLING, 1):
        label = f"alpha = {alpha:g}"
        biased_lines.append(Line(BIASES_DEG, by_bias[alpha], label, "o", color=i))
        biased_lines.append(Line(BIASES_DEG, bounds[alpha], color=i, width=0.8))
        noisy_lines.append(Line(np.degrees(NOISES_RAD), by_noise[alpha], label, "o-", color=i))
    e, sigma = "equilibrium bias e [deg]", "standard deviation of y1's noise [deg]"
    return Claim(
        "After (11), the vicinity",
        "For s^2 + k2 s + k1 Hurwitz and alpha in (1/2, 1] the error converges to a vicinity of the origin.",
        is_general=True,
        assumes={"e": "0.125 to 2 deg", "noise": "0.0005 to 0.008 rad", "control rate": f"{1.0 / DT:g} Hz"},
        holds=converges and relative_difference < 0.01 and difference < 0.1 * SEEN_RAD_S and min(slopes.values()) > 0.5,
        conditions="Tried with k1, k2 of Table 2 and alpha = 0.55, 0.7, 0.85, 1. With s^2 + k1 s + k2 Hurwitz; the "
        "printed s^2 + k2 s + k1 has k1 and k2 exchanged, without consequence: either is Hurwitz just when both gains "
        "are positive.",
        figures={
            "error_left_share": errors,
            "bias_deg": BIASES_DEG,
            "rate_error_by_bias_rad_s": by_bias,
            "error_left_share_2000_hz": fine_errors,
            "closed_form_relative_difference": relative_difference,
            "closed_form_difference_where_small_rad_s": difference,
            "noise_rad": NOISES_RAD,
            "rate_error_by_noise_rad_s": by_noise,
            "exponent_of_noise": slopes,
        },
        picture=Picture(
            "aranovskiy2020-vicinity",
            "aranovskiy2020, (11): how far from the true rate its estimate rests, k1 and k2 of Table 2",
            [
                Panel(
                    "rate error [rad/s]", biased_lines, "no noise; lines: closed form; above: chatter", e, "log", "log"
                ),
                Panel("RMS rate error\n[rad/s]", noisy_lines, "with noise, no bias", sigma, "log", "log"),
            ],
            share_x=False,
        ),
    )


LAG_SEED = 76_000
TAUS_S = (0.01, 0.015, 0.02, 0.03, 0.05, 0.08)


def trade(tau: float, seed: int = LAG_SEED) -> tuple[float, float]:
    """Replay (9) with one time constant on a steadily accelerated tilt, and on noise.

    Returns:
        Delay of the estimate of a steadily rising rate [s], RMS of the estimate by that of a white noise measured
        [1/s].
    """
    time, settling_ticks = np.arange(2000) * DT, 400
    acceleration = 0.3
    noise = np.random.default_rng(seed).normal(0.0, 1.0, (len(time), 8))
    y1 = np.column_stack([acceleration * time**2 / 2.0, noise])
    x2 = replay_at_rest(make_observer("linear", DT, printed_model(), tau=tau), y1).x2
    return time[-1] - x2[-1, 0] / acceleration, np.sqrt(np.mean(x2[settling_ticks:, 1:] ** 2))


def predict_trade(tau: float) -> tuple[float, float]:
    """Predict the trade by G = s/(tau s + 1)^2, whose phase falls with the slope 2 tau.

    A sample of noise is a triangle in time, two samples wide: the weights are the impulse response's means over it. For
    samples short beside tau their squares add up to dt/(4 tau^3).
    """
    fine = 50
    time = np.arange(fine * (round(30.0 * tau / DT) + 1)) * DT / fine
    response = (1.0 - time / tau) * np.exp(-time / tau) / tau**2
    triangle = 1.0 - np.abs(np.arange(-fine, fine + 1)) / fine
    weights = np.convolve(response, triangle)[fine::fine] * DT / fine
    weights[0] -= response[0] / 2.0 * DT / fine  # trapezoidal rule at the response's jump
    return 2.0 * tau, np.sqrt(np.sum(weights**2))


def lag(seed: int = LAG_SEED) -> Claim:
    """Judge a longer tau: less noise, more lag."""
    lags, gains = zip(*(trade(tau, seed) for tau in TAUS_S), strict=True)
    lags_foreseen, gains_foreseen = np.array([predict_trade(tau) for tau in TAUS_S]).T
    fine = np.geomspace(TAUS_S[0], TAUS_S[-1], 50)
    fine_lags, fine_gains = np.array([predict_trade(tau) for tau in fine]).T
    lag_lines = [
        Line(TAUS_S, 1e3 * np.array(lags), "measured", "o", color=1),
        Line(fine, 1e3 * fine_lags, "2 tau", color=7),
    ]
    noise_lines = [
        Line(TAUS_S, gains, "measured", "o", color=1),
        Line(fine, fine_gains, "of the transfer function", color=7),
    ]
    x = "tau [s]"
    return Claim(
        "(9), lag and noise",
        "A filter with the differentiator reduces noise, but lag distorts the estimate: tau trades them.",
        holds=largest_size(lags / lags_foreseen - 1.0) < 0.01
        and largest_size(gains / gains_foreseen - 1.0) < 0.05
        and sorted(gains, reverse=True) == list(gains),
        figures={"tau_s": TAUS_S, "lag_s": lags, "noise_gain_1_s": gains},
        picture=Picture(
            "aranovskiy2020-eq-9",
            "aranovskiy2020, (9): the lag of the linear differentiator against its noise",
            [
                Panel("lag [ms]", lag_lines, "", x, "log", "log"),
                Panel("noise gain [1/s]", noise_lines, "", x, "log", "log"),
            ],
        ),
    )
