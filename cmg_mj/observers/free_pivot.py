"""`gyro_free` for a pivot that moves: it learns how strongly, and trusts the measured tilt less.

Accelerometers take the pivot's acceleration for gravity, which makes y1 wrong by its horizontal part over g. The
angular acceleration is the difference between two accelerometers on one body: the pivot's motion is not in it.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Annotated, NamedTuple, TypeAlias

from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar, sqrt, where
from cmg_mj.core.types import Measurement
from cmg_mj.inputs.types import STRICT, NonNegative, Positive
from cmg_mj.observers.gyro_free import GyroFree, decorrelated

Scalars: TypeAlias = tuple[Scalar, ...]


class Band(NamedTuple):
    """A filter's prediction of sample k, p, z, b, w, its covariance, and what it has learnt of the pivot.

    All angles: z is that of a sample period, z dt, and b that of its square, b dt^2.
    """

    p: Scalar
    z: Scalar
    b: Scalar
    w: Scalar
    pp: Scalar
    pz: Scalar
    pb: Scalar
    pw: Scalar
    zz: Scalar
    zb: Scalar
    zw: Scalar
    bb: Scalar
    bw: Scalar
    ww: Scalar
    pivot: Scalar
    """Variance of w [rad^2]."""


class State(NamedTuple):
    """Both filters, and what they have in common."""

    fast: Band
    slow: Band
    odds: Scalar
    """By how much the fast one foretold y1 better of late: the logarithm of a ratio of likelihoods, zero if alike."""
    scale: Scalar
    """The sensors' variance over that of the datasheet."""
    share: Scalar
    """Weight of the next sample in the variances of w."""
    y1: Scalar
    """y1 of the sample before."""
    step: Scalar
    """Difference of `y1` from y1 one sample earlier."""


@dataclass(frozen=True, config=STRICT)
class FreePivot(GyroFree):
    """`gyro_free` for a pivot that moves: it learns how strongly, and trusts the measured tilt less.

    x1' = x2, x2' = alpha; the sensors show y1 = x1 + w + v and a = alpha + b + n, at the samples.

    As in `gyro_free`, whose p, z, b, n, v and equations these are, but for w, minus the pivot's horizontal acceleration
    over g. It fades and is renewed: w+ = f w + white, f = exp(-2 pi pivot_hz dt), so that its variance S is stationary.

    Two such filters run side by side, the slow one with slow_hz: a strike is over in a moment, while braking and a
    hand's sway last, and no corner between serves both. The estimate is the fast one's with the weight g and the slow
    one's with 1 - g, g = (1 + q/sqrt(4 + q^2))/2, which stands for 1/(1 + exp -q). q is `odds_alike` and, summed over
    about `odds_s`, the logarithm of the ratio of each sample's likelihoods, half of e^2/ee of the slow one less e^2/ee
    of the fast one plus ln c, c the ratio of their ee, where 2 (c - 1)/(c + 1) stands for ln c.

    Two things are learnt on the way, r and, by each filter for itself, S:

    - The sensors' variance is r times that of the datasheet, at least once: vibration is white and no motion of the
      pivot. r is the mean of (y1 - 2 y1- + y1--)^2/(6 var v) over about `noise_s`.
    - S+ = S + share (w^2 + ww - S + innovation_weight S (e^2/ee - 1)), at least pivot_floor^2. w and ww are the
      estimate after the sample and its variance: a step of expectation-maximisation. e and ee are the innovation and
      its variance, which tell sooner that S is wrong by much. `share` is dt/learn_s at the start and falls, as that of
      a mean over all samples, to dt/pivot_s. Where S rises, rise_factor share times the rise is added: at the start it
      is worse to learn late of a pivot that moves than to suspect one that rests.

    A knock is far from what S allows, and is over before S is learnt; taken for tilt it would turn x2 for seconds. So,
    before the correction, if e^2 > gate ee, e^2 - ee is added to w's variance: nearly all of e is then w.

    Early samples were trusted too much if S then turns out larger:

    - The p that began at y1 took the w of that time for tilt. So covariance_boost share times the rise of S is added to
      p's variance and to w's, and taken from their covariance.
    - The z that y1's differences gave is as uncertain as S was, not as it is found to be. So the covariance of p and z
      is multiplied by 1 + inflation share rise/(S + var y1), the variance of y1's noise by the datasheet.

    While S is zero, r is one and the gate is shut it is `gyro_free`. All is computed in angles of a sample period, x2
    dt and alpha dt^2: so many multiplications by dt less.

    Attributes:
        dt: Sample period [s].
        model: The reduced model (not used).
        noise: Of tilt and angular acceleration, by the sensors' datasheet.
        rate_start: Standard deviation of the rate at the start, about zero [rad/s].
        bias_start: Standard deviation of the acceleration's offset b at the start [rad/s^2].
        bias_walk: Random walk of the offset b: its standard deviation after a second [rad/s^2].
        jerk: Standard deviation of the mean acceleration between two samples from that of a straight line [rad/s^2].
        pivot_hz: Corner frequency of the fast filter's model of w, the pivot's share of y1; not that of the motion
            [Hz].
        slow_hz: Corner frequency of the slow filter's model of w [Hz].
        odds_s: Time over which the samples count that the filters foretold [s].
        odds_alike: Logarithm of the odds for the fast filter where both foretell alike, as on a pivot at rest.
        pivot_start: Standard deviation of w at the start [rad].
        pivot_floor: Least standard deviation of w [rad].
        pivot_s: Time over which the filter learns S, the variance of w [s].
        learn_s: Time over which the filter learns S at the start [s].
        innovation_weight: Weight of the innovation in the learning of S by the fast filter.
        slow_innovation_weight: The same by the slow filter, where the innovation tells more than w.
        noise_s: Time over which the filter learns r, the variance of the measured tilt over the datasheet's [s].
        rise_factor: Factor by which S rises faster than it falls, over `share`.
        covariance_boost: Part of a rise of S that is added to the variance of p, over `share`.
        inflation: Factor on the covariance of p and z for a rise of S by the variance of y1, over `share`.
        gate: Square of an innovation by its variance, above which the excess is put down to the pivot.
    """

    pivot_hz: Positive = 9.5
    slow_hz: Positive = 0.7
    odds_s: Positive = 0.07
    odds_alike: NonNegative = 1.4
    pivot_start: NonNegative = 2.3e-3
    pivot_floor: NonNegative = 1.5e-3
    pivot_s: Positive = 0.6
    learn_s: Positive = 0.02
    innovation_weight: NonNegative = 0.75
    slow_innovation_weight: NonNegative = 3.7
    noise_s: Positive = 0.22
    rise_factor: NonNegative = 29.0
    covariance_boost: NonNegative = 13.0
    inflation: NonNegative = 2.4
    gate: Annotated[float, Field(ge=1.0)] = 13.5

    def __post_init__(self) -> None:
        GyroFree.__post_init__(self)
        if not (self.noise.tilt or self.pivot_floor):
            raise ValueError("pivot_floor = 0: with sensors without noise it must be positive")

    def init(self, y: Measurement) -> State:
        """Start at rest at the measured tilt, with no bias; of the tilt nothing else is known."""
        zero, h = 0.0 * y.y1, self.dt
        p = y.y1 - h * h * y.acceleration / 6.0  # so that the first sample shows what is expected
        one, ww = 1.0 + zero, self.pivot_start**2 + zero
        zz, bb = (h * self.rate_start) ** 2 * one, (h * h * self.bias_start) ** 2 * one
        band = Band(p, zero, zero, zero, one, zero, zero, zero, zz, zero, zero, bb, zero, ww, ww)
        return self._sample(State(band, band, zero, one, self._shares[1] + zero, y.y1, zero), y)[0]

    def _sample(self, state: State, y: Measurement) -> tuple[State, Scalar, Scalar]:
        """Correct what was expected of a sample by what it shows, and advance to the next; x1 and x2 between both."""
        # Learn the noise that there is.
        step = y.y1 - state.y1
        bend = step - state.step
        scale = state.scale + self._shares[2] * (self._per_bend * bend * bend - state.scale)
        r = where(scale > 1.0, scale, 1.0)

        fast, ratio, ee, x1, x2 = self._filtered(state.fast, y, r, state.share, self._fades[0], self.innovation_weight)
        slow, slow_ratio, slow_ee, slow_x1, slow_x2 = self._filtered(
            state.slow, y, r, state.share, self._fades[1], self.slow_innovation_weight
        )
        better = 0.5 * (slow_ratio - ratio) + (slow_ee - ee) / (slow_ee + ee)
        odds = self._fades[2] * state.odds + better
        q = self.odds_alike + odds
        weight = 0.5 + 0.5 * q / sqrt(4.0 + q * q)
        x1, x2 = slow_x1 + weight * (x1 - slow_x1), slow_x2 + weight * (x2 - slow_x2)

        slower = state.share / (1.0 + state.share)
        share = where(slower > self._shares[0], slower, self._shares[0])
        return State(fast, slow, odds, scale, share, y.y1, step), x1, x2

    def _filtered(
        self, band: Band, y: Measurement, r: Scalar, share: Scalar, fade: float, innovation_weight: float
    ) -> tuple[Band, Scalar, Scalar, Scalar, Scalar]:
        """Take a sample by one filter, and advance it to the next.

        Returns:
            The filter, e^2/ee, ee, and its x1 and x2 of the sample.
        """
        ratio, ee, means, covariance = self._correct(band, y, r)
        alpha, p, z, _, w = means
        x1, x2 = p + 1.0 / 6.0 * alpha, (z + 0.5 * alpha) * (1.0 / self.dt)

        # Learn how strongly the pivot moves.
        ww, pivot = covariance[9], band.pivot
        rise = share * (w * w + ww - pivot + pivot * innovation_weight * (ratio - 1.0))
        early = share * where(rise > 0.0, rise, 0.0)
        pivot = pivot + rise + self.rise_factor * early
        floor = self.pivot_floor**2
        pivot = where(pivot > floor, pivot, floor)
        return self._advance(means, covariance, early, pivot, fade), ratio, ee, x1, x2

    def _correct(self, band: Band, y: Measurement, r: Scalar) -> tuple[Scalar, Scalar, Scalars, Scalars]:
        """Correct p, z, b, w, n by e = y1 - p - w - d alpha, its excess put down to w.

        Returns:
            e^2/ee, ee, the means of alpha, p, z, b, w, and the covariance of p, z, b, w and of m = b + n, which is
            alpha's error: its rows.
        """
        h, d = self.dt, 1.0 / 6.0
        c, nn, rest = self._noise
        p, z, b, w, pp, pz, pb, pw, zz, zb, zw, bb, bw, ww, _ = band

        a = h * h * y.acceleration
        e = y.y1 - p - w - d * (a - b)
        ep, ez, eb, ew = pp + pw - d * pb, pz + zw - d * zb, pb + bw - d * bb, pw + ww - d * bw
        en = r * ((c - d) * nn)
        ee = ep + ew - d * eb + r * ((c - d) * (c - d) * nn + rest)
        square = e * e
        excess = where(square > self.gate * ee, square - ee, 0.0)
        ww, ew, ee = ww + excess, ew + excess, ee + excess
        kp, kz, kb, kw, kn = ep / ee, ez / ee, eb / ee, ew / ee, en / ee
        p, z, b, w, n = p + kp * e, z + kz * e, b + kb * e, w + kw * e, kn * e

        pp, pz, zz = pp - kp * ep, pz - kp * ez, zz - kz * ez
        pb, zb, bb = pb - kp * eb, zb - kz * eb, bb - kb * eb
        pw, zw, bw, ww = pw - kp * ew, zw - kz * ew, bw - kb * ew, ww - kw * ew
        pm, zm, bm, wm = pb - kp * en, zb - kz * en, bb - kb * en, bw - kw * en
        mm = bm - kn * eb + r * nn - kn * en + (h * h * self.jerk) ** 2
        return square / ee, ee, (a - b - n, p, z, b, w), (pp, pz, pb, pw, zz, zb, zw, bb, bw, ww, pm, zm, bm, wm, mm)

    def _advance(self, means: Scalars, covariance: Scalars, early: Scalar, pivot: Scalar, f: float) -> Band:
        """Doubt early samples, and advance: p+ = r + alpha with r = p + z, z+ = z + alpha, w+ = f w + white."""
        h = self.dt
        alpha, p, z, b, w = means
        pp, pz, pb, pw, zz, zb, zw, bb, bw, ww, pm, zm, bm, wm, mm = covariance

        boost = self.covariance_boost * early
        pp, pw, ww = pp + boost, pw - boost, ww + boost
        inflate = 1.0 + self.inflation * early / (pivot + self.noise.tilt**2)
        pp, pz, zz = inflate * pp, inflate * pz, inflate * zz

        r, rz, rb, rw, rm = p + z, pz + zz, pb + zb, pw + zw, pm + zm
        of_p = pp + pz + rz + mm - 2.0 * rm, rz + mm - zm - rm, rb - bm, f * (rw - wm)
        of_z = zz + mm - 2.0 * zm, zb - bm, f * (zw - wm)
        of_b = bb + h**5 * self.bias_walk**2, f * bw
        return Band(r + alpha, z + alpha, b, f * w, *of_p, *of_z, *of_b, f * f * (ww - pivot) + pivot, pivot)

    @cached_property
    def _fades(self) -> tuple[float, float, float]:
        """Share that remains after a sample period of the fast w, the slow w and the odds."""
        corners = (2.0 * math.pi * self.pivot_hz, 2.0 * math.pi * self.slow_hz, 1.0 / self.odds_s)
        return tuple(math.exp(-corner * self.dt) for corner in corners)  # pyright: ignore

    @cached_property
    def _shares(self) -> tuple[float, float, float]:
        """A sample's in S once it has settled and at the start, and in r."""
        dt = self.dt
        return min(dt / self.pivot_s, 1.0), min(dt / self.learn_s, 1.0), min(dt / self.noise_s, 1.0)

    @cached_property
    def _noise(self) -> tuple[float, float, float]:
        """See `decorrelated`, of n dt^2."""
        return decorrelated(self.noise, self.noise.acceleration * self.dt * self.dt)

    @cached_property
    def _per_bend(self) -> float:
        """One over 6 times the variance of v."""
        return 1.0 / (6.0 * self.noise.tilt**2) if self.noise.tilt else 0.0
