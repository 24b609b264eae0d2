"""The observers (10) and (11) in several forms: written out with several methods for H, by explicit Euler, and ours."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar
from cmg_mj.features.replay import replay
from cmg_mj.observers import Estimate, Measurement, Observer
from cmg_mj.observers.homogeneous import Homogeneous
from cmg_mj.observers.ltv import LinearTimeVarying, State, exact_step, map_of_one
from cmg_mj.observers.model_copy import CopyState
from cmg_mj.papers.aranovskiy2020.paper import H_0, A_prime, C, printed_model, riccati_slope
from cmg_mj.papers.claim import Array
from cmg_mj.papers.pair import DT, run_of_10
from cmg_mj.papers.recorded import rms

Method = Callable[[Array, Array, float], Array]
"""(H, A', step) -> H one step later."""

# --- methods for the Riccati equation ---------------------------------------------------------------------------


def euler(H: Array, A: Array, h: float) -> Array:
    """Take one explicit Euler step."""
    return H + H.dtype.type(h) * riccati_slope(H, A)


def rk4(H: Array, A: Array, h: float, first: Array | None = None) -> Array:
    """Take one classical Runge-Kutta step."""
    t = H.dtype.type(h)
    k1 = riccati_slope(H, A, first)
    k2 = riccati_slope(H + t / 2 * k1, A, first)
    k3 = riccati_slope(H + t / 2 * k2, A, first)
    return H + t / 6 * (k1 + 2 * k2 + 2 * k3 + riccati_slope(H + t * k3, A, first))


def rk4_as_printed(H: Array, A: Array, h: float) -> Array:
    """Take the step with the printed first term, H A^T with A of (6)."""
    return rk4(H, A, h, printed_model().A)


def exact_method(H: Array, A: Array, h: float) -> Array:
    """Take one sample of this package's observer at rest, where A is that of `A_prime()`."""
    observer, at_rest = make_exact(h), Measurement(0.0, 0.0)
    (h11, h12, _), (_, h22, _), (*_, h33) = H.tolist()
    state = observer.init(at_rest)._replace(h11=h11, h12=h12, h22=h22, h33=h33)
    return matrix_of(observer.step(state, at_rest, 0.0)[0])


METHODS: dict[str, Method] = {
    "explicit Euler": euler,
    "Runge-Kutta 4": rk4,
    "exact step (ours)": exact_method,
}


# --- the observer -----------------------------------------------------------------------------------------------


@cache
def make_exact(dt: float = DT) -> LinearTimeVarying:
    """Make this package's (10)."""
    return LinearTimeVarying(dt=dt, model=printed_model())


def matrix_of(state: State) -> Array:
    """Return H of this package's observer, (3, 3)."""
    return np.array([[state.h11, state.h12, 0.0], [state.h12, state.h22, 0.0], [0.0, 0.0, state.h33]], dtype=float)


@dataclass
class Plain:
    """(10) as it is printed: one step of twelve equations a sample, matrices of NumPy.

    Attributes:
        method: Method for H.
        dt: Sample period [s].
    """

    method: Method
    dt: float = DT

    def init(self, y: Measurement) -> tuple[Array, Array]:
        """Start at rest, with H = H_0."""
        return np.array([y.y1, 0.0, y.y2]), H_0

    def step(self, state: tuple[Array, Array], y: Measurement, u: float) -> tuple[Any, Any]:
        """Advance by one sample period: H by the method, the estimate by Euler."""
        x, H = state
        drift, gain, damping = printed_model().terms(*y)
        A = A_prime(-u * damping)
        b = np.array([0.0, drift + u * gain, u])
        x = x + self.dt * (A @ x + b - H @ C.T @ (C @ x - np.array(y)))
        return (x, self.method(H, A, self.dt)), x


class Comparison(NamedTuple):
    """Two forms of (10) along a closed-loop run, from 0.2 s on."""

    difference: float
    """RMS of the rate estimated by the other less that by the one [rad/s]."""
    error: float
    """RMS error of the one [rad/s]."""
    other_error: float
    """RMS error of the other [rad/s]."""


def compare(form: Observer, other_form: Observer, seed: int) -> Comparison:
    """Replay both on a run with (10) in the loop."""
    run = run_of_10(seed)
    later = run["time_s"] > 0.2
    truth = run["x2_rad_s"][later]
    rate, other_rate = (replay(observer, run).x2[later] for observer in (form, other_form))
    return Comparison(*(rms(error) for error in (other_rate - rate, rate - truth, other_rate - truth)))


# --- by explicit Euler, on floats and arrays ---------------------------------------------------------------------


@dataclass(frozen=True)
class TenByEuler(LinearTimeVarying):
    """(10), one Euler step a sample at the newest measurement, as `Plain` in matrices.

    Attributes:
        exact_gain: Whether H takes the exact step instead, and the estimate alone Euler's.
    """

    exact_gain: bool = False

    def step(self, state: State, y: Measurement, u: Scalar) -> tuple[State, Estimate]:
        """Advance by one sample period."""
        x1, x2, x3, h11, h12, h22, h33, before, terms = state
        dt, (q1, q2, q3) = self.dt, self.Q
        drift, gain, damping = self.model.terms(*y)
        a = -u * damping
        off1, off3 = x1 - y.y1, x3 - y.y2
        estimate = Estimate(
            x1 + dt * (x2 - h11 * off1),
            x2 + dt * (a * x2 + drift + u * gain - h12 * off1),
            x3 + dt * (u - h33 * off3),
        )
        if self.exact_gain:
            up, down = map_of_one(q3, dt)
            # Two halves: the series of the exact step wants a short one.
            for _ in range(2):
                h11, h12, h22 = exact_step(h11, h12, h22, q1, q2, a, dt / 2.0)
            return State(*estimate, h11, h12, h22, (h33 + up) / (down * h33 + 1.0), before, terms), estimate
        return State(
            *estimate,
            h11 + dt * (2.0 * h12 - h11 * h11 + q1),
            h12 + dt * (h22 + a * h12 - h11 * h12),
            h22 + dt * (2.0 * a * h22 - h12 * h12 + q2),
            h33 + dt * (q3 - h33 * h33),
            before,
            terms,
        ), estimate


class ElevenByEuler(Homogeneous):
    """(11), one Euler step a sample at the newest measurement."""

    def step(self, state: CopyState, y: Measurement, u: Scalar, bias: Scalar = 0.0) -> tuple[CopyState, Estimate]:
        """Advance by one sample period."""
        x1, x2, before, terms = state
        drift, gain, damping = self.model.terms(*y)
        c1, c2 = self.correction(x1 - y.y1, None)
        x1, x2 = x1 + self.dt * (x2 - c1), x2 + self.dt * (drift + u * (gain - damping * x2) - c2)
        return CopyState(x1, x2, before, terms), Estimate(x1, x2, y.y2)
