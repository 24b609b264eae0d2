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

from cmg_mj.core.arrays import Scalar, where
from cmg_mj.core.types import Measurement
from cmg_mj.inputs.types import STRICT, NonNegative, Positive
from cmg_mj.observers.gyro_free import GyroFree, decorrelated

Scalars: TypeAlias = tuple[Scalar, ...]


class State(NamedTuple):
    """Prediction of sample k, p, z, b, w, its covariance, and what has been learnt of the noise and of the pivot.

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
    scale: Scalar
    """The sensors' variance over that of the datasheet."""
    pivot: Scalar
    """Variance of w [rad^2]."""
    share: Scalar
    """Weight of the next sample in that variance."""
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
    Two things are learnt on the way, r and S:

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
        bias_start: Standard deviation of the acceleration's offset b at the start [rad/s^2]. On the bundled rig the
            default stands for 7 mg between the accelerometers, more than in `gyro_free`: a larger offset would look
            like a pivot that moves.
        bias_walk: Random walk of the offset b: its standard deviation after a second [rad/s^2].
        jerk: Standard deviation of the mean acceleration between two samples from that of a straight line [rad/s^2].
        pivot_hz: Corner frequency of the filter's model of w, the pivot's share of y1; not that of the motion [Hz].
        pivot_start: Standard deviation of w at the start [rad].
        pivot_floor: Least standard deviation of w [rad].
        pivot_s: Time over which the filter learns S, the variance of w [s].
        learn_s: Time over which the filter learns S at the start [s].
        innovation_weight: Weight of the innovation in the learning of S.
        noise_s: Time over which the filter learns r, the variance of the measured tilt over the datasheet's [s].
        rise_factor: Factor by which S rises faster than it falls, over `share`.
        covariance_boost: Part of a rise of S that is added to the variance of p, over `share`.
        inflation: Factor on the covariance of p and z for a rise of S by the variance of y1, over `share`.
        gate: Square of an innovation by its variance, above which the excess is put down to the pivot.
    """

    bias_start: Positive = 0.5
    pivot_hz: Positive = 5.0
    pivot_start: NonNegative = 2e-3
    pivot_floor: NonNegative = 1e-3
    pivot_s: Positive = 1.0
    learn_s: Positive = 0.05
    innovation_weight: NonNegative = 4.0
    noise_s: Positive = 0.3
    rise_factor: NonNegative = 60.0
    covariance_boost: NonNegative = 10.0
    inflation: NonNegative = 10.0
    gate: Annotated[float, Field(ge=1.0)] = 11.5

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
        known = (one, zero, zero, zero, zz, zero, zero, bb, zero, ww)
        learnt = (1.0 + zero, ww, self._shares[1] + zero, y.y1, zero)
        return self._sample(State(p, zero, zero, zero, *known, *learnt), y)[0]

    def _sample(self, state: State, y: Measurement) -> tuple[State, Scalar, Scalar]:
        """Correct what was expected of a sample by what it shows, and advance to the next; x1 and x2 between both."""
        # Learn the noise that there is.
        step = y.y1 - state.y1
        bend = step - state.step
        scale = state.scale + self._shares[2] * (self._per_bend * bend * bend - state.scale)

        ratio, means, covariance = self._correct(state, y, where(scale > 1.0, scale, 1.0))
        alpha, p, z, _, w = means
        x1, x2 = p + 1.0 / 6.0 * alpha, (z + 0.5 * alpha) * (1.0 / self.dt)

        # Learn how strongly the pivot moves.
        ww, pivot, share = covariance[9], state.pivot, state.share
        rise = share * (w * w + ww - pivot + pivot * self.innovation_weight * (ratio - 1.0))
        early = share * where(rise > 0.0, rise, 0.0)
        pivot = pivot + rise + self.rise_factor * early
        floor = self.pivot_floor**2
        pivot = where(pivot > floor, pivot, floor)
        slower = share / (1.0 + share)
        share = where(slower > self._shares[0], slower, self._shares[0])

        return self._advance(means, covariance, early, (scale, pivot, share, y.y1, step)), x1, x2

    def _correct(self, state: State, y: Measurement, r: Scalar) -> tuple[Scalar, Scalars, Scalars]:
        """Correct p, z, b, w, n by e = y1 - p - w - d alpha, its excess put down to w.

        Returns:
            e^2 by its variance, the means of alpha, p, z, b, w, and the covariance of p, z, b, w and of m = b + n,
            which is alpha's error: its rows.
        """
        h, d = self.dt, 1.0 / 6.0
        c, nn, rest = self._noise
        p, z, b, w, pp, pz, pb, pw, zz, zb, zw, bb, bw, ww, *_ = state

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
        return square / ee, (a - b - n, p, z, b, w), (pp, pz, pb, pw, zz, zb, zw, bb, bw, ww, pm, zm, bm, wm, mm)

    def _advance(self, means: Scalars, covariance: Scalars, early: Scalar, learnt: Scalars) -> State:
        """Doubt early samples, and advance: p+ = r + alpha with r = p + z, z+ = z + alpha, w+ = f w + white."""
        h, f = self.dt, self._fade
        alpha, p, z, b, w = means
        pp, pz, pb, pw, zz, zb, zw, bb, bw, ww, pm, zm, bm, wm, mm = covariance
        scale, pivot, share, y1, step = learnt

        boost = self.covariance_boost * early
        pp, pw, ww = pp + boost, pw - boost, ww + boost
        inflate = 1.0 + self.inflation * early / (pivot + self.noise.tilt**2)
        pp, pz, zz = inflate * pp, inflate * pz, inflate * zz

        r, rz, rb, rw, rm = p + z, pz + zz, pb + zb, pw + zw, pm + zm
        return State(
            p=r + alpha,
            z=z + alpha,
            b=b,
            w=f * w,
            pp=pp + pz + rz + mm - 2.0 * rm,
            pz=rz + mm - zm - rm,
            pb=rb - bm,
            pw=f * (rw - wm),
            zz=zz + mm - 2.0 * zm,
            zb=zb - bm,
            zw=f * (zw - wm),
            bb=bb + h**5 * self.bias_walk**2,
            bw=f * bw,
            ww=f * f * (ww - pivot) + pivot,
            scale=scale,
            pivot=pivot,
            share=share,
            y1=y1,
            step=step,
        )

    @cached_property
    def _fade(self) -> float:
        """Share of w that remains after a sample period."""
        return math.exp(-2.0 * math.pi * self.pivot_hz * self.dt)

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
