"""The homogeneous differentiator (11) of aranovskiy2020 without bias and noise: is its error gone in finite time?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.core.arrays import signed_power
from cmg_mj.observers import Measurement, make_observer
from cmg_mj.papers.aranovskiy2020.paper import TABLE_2, printed_model
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.view.plots.figure import Line, Panel, Picture

ALPHAS = (0.55, 0.7, 0.85, 1.0)
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

    decades: np.ndarray
    """Powers of ten by which its homogeneous size has fallen, (n,)."""
    time_s: np.ndarray
    """Times of these sizes, (n,) [s]."""
    rate: np.ndarray
    """The rate's error then, of 1 at first, (n,) [rad/s]."""

    @property
    def turns(self) -> np.ndarray:
        """Changes of the sign of the rate's error: rows of `time_s`, (n_turns,)."""
        return np.flatnonzero(np.diff(np.sign(self.rate)))

    @property
    def shrink_factor(self) -> float:
        """Mean factor by which a half turn of the error is quicker than the one before it."""
        spans = np.diff(self.time_s[self.turns])
        return float((spans[-1] / spans[0]) ** (1.0 / (len(spans) - 1)))

    @property
    def decades_a_turn(self) -> float:
        """Powers of ten by which the size falls in a half turn."""
        return float(np.diff(self.decades[self.turns]).mean())

    @property
    def end_s(self) -> float:
        """Time at which the error is zero: the last turn plus the geometric series of all turns to come, or inf."""
        factor, (before, last) = self.shrink_factor, self.time_s[self.turns[-2:]]
        return math.inf if factor > 0.99 else float(last + (last - before) * factor / (1.0 - factor))

    def time_below(self, share: float) -> float:
        """Return the time from which the rate's error stays below a share of its first size [s]."""
        return float(self.time_s[np.flatnonzero(np.abs(self.rate) > share)[-1] + 1])


def decay(alpha: float) -> Decay:
    """Follow e1' = e2 - k1 [e1]^alpha, e2' = -k2 [e1]^(2 alpha - 1) from e = (0, 1 rad/s) down by twelve decades.

    In e1 = r z1, e2 = r^alpha z2 with z1^2 + |z2|^(2/alpha) = 1 and a time that runs faster as r^(alpha - 1), nothing
    gets steep as r falls.
    """
    k1, k2, _ = TABLE_2["homogeneous"].values()

    def slope(z1: float, z2: float, log_r: float) -> tuple[float, float, float, float]:
        f1, f2 = z2 - k1 * signed_power(z1, alpha), -k2 * signed_power(z1, 2.0 * alpha - 1.0)
        fall = z1 * f1 + signed_power(z2, 2.0 / alpha - 1.0) * f2 / alpha
        fall /= z1 * z1 + abs(z2) ** (2.0 / alpha)  # 1, but for this it would stray from it
        return f1 - fall * z1, f2 - alpha * fall * z2, fall, math.exp((1.0 - alpha) * log_r)

    def advance(state: Sequence[float], step: float, slopes: Sequence[float]) -> list[float]:
        return [value + step * change for value, change in zip(state, slopes, strict=True)]

    states, h = [[0.0, 1.0, 0.0, 0.0]], STEP
    while states[-1][2] > -DECADES * math.log(10.0):  # one classical Runge-Kutta step
        start = states[-1]
        a = slope(*start[:3])
        b = slope(*advance(start, h / 2.0, a)[:3])
        c = slope(*advance(start, h / 2.0, b)[:3])
        d = slope(*advance(start, h, c)[:3])
        mean = [(p + 2.0 * (q + r) + s) / 6.0 for p, q, r, s in zip(a, b, c, d, strict=True)]
        states.append(advance(start, h, mean))
    _, z2, log_r, time = np.array(states).T
    lowest = np.minimum.accumulate(log_r)  # the size is not monotonic where the error turns
    return Decay(-lowest / math.log(10.0), time, np.exp(alpha * log_r) * z2)


def rates_at_rest(alpha: float, dt: float, span_s: float, **start: float) -> np.ndarray:
    """Run the bench's (11) at rest from a wrong state, without noise: sizes of its rate, (n_samples,) [rad/s]."""
    observer, measurement = make_observer("homogeneous", dt, printed_model(), alpha=alpha), Measurement(0.0, 0.0)
    state, rates = observer.init(measurement)._replace(**start), []
    for _ in range(round(span_s / dt)):
        state, estimate = observer.step(state, measurement, 0.0)
        rates.append(abs(estimate.x2))
    return np.array(rates)


def observer_decay_time(alpha: float) -> float:
    """Return the time from which the bench's observer, sampled often, has an error below `SEEN` [s]."""
    return float((np.flatnonzero(rates_at_rest(alpha, FINE_DT, 1.5, x2=1.0) > SEEN)[-1] + 2) * FINE_DT)


def finite_time_claim() -> Claim:
    """Judge whether the time is finite for alpha below 1, not for 1."""
    decays = {alpha: decay(alpha) for alpha in ALPHAS}
    finite = {alpha: d for alpha, d in decays.items() if alpha < 1.0}
    predicted_factors = {alpha: 10.0 ** ((alpha - 1.0) * d.decades_a_turn) for alpha, d in decays.items()}
    factor_error = max(abs(d.shrink_factor / predicted_factors[alpha] - 1.0) for alpha, d in decays.items())
    printed_alpha = TABLE_2["homogeneous"]["alpha"]
    observer_s, equation_s = observer_decay_time(printed_alpha), decays[printed_alpha].time_below(SEEN)
    return Claim(
        place="After (11), finite time",
        statement="Were it not for the replaced x2 and sin(x1), the error would converge to the origin in finite time.",
        is_general=True,
        holds=all(map(math.isfinite, (d.end_s for d in finite.values())))
        and math.isinf(decays[1.0].end_s)
        and factor_error < 0.02
        and abs(observer_s / equation_s - 1.0) < 0.02,
        conditions=f"Tried with k1, k2 of Table 2 and alpha = {', '.join(f'{alpha:g}' for alpha in ALPHAS)}. "
        "For alpha below 1; the printed (1/2, 1] has 1 in it, with which the error fades exponentially.",
        otherwise="The error does not fade as homogeneity has it.",
        figures={
            "gone_after_s": {str(alpha): d.end_s for alpha, d in finite.items()},
            "time_of_a_half_turn_by_the_one_before": {str(alpha): d.shrink_factor for alpha, d in decays.items()},
            "fallen_to_a_thousandth_after_s": {"observer": observer_s, "equation": equation_s},
        },
        pictures=[_picture(decays)],
    )


def _picture(decays: dict[float, Decay]) -> Picture:
    lines = [Line(d.time_s[::5], 10.0 ** (-d.decades[::5]), f"alpha = {alpha:g}") for alpha, d in decays.items()]
    return Picture(
        "aranovskiy2020-finite-time",
        "aranovskiy2020, (11) without bias and noise: how its error fades from 1 rad/s",
        [Panel("homogeneous size of the error", lines, y_scale="log")],
    )


def claims(on_share: OnShare) -> list[Claim]:
    """Judge finite time."""
    return [finite_time_claim()]
