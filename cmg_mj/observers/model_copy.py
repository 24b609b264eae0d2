"""A copy of the reduced model run beside the rig and corrected by what is measured: one step of it.

An observer of this kind is x1' = x2 - c1, x2' = f2(y, x2, u) - c2, with its paper's correction (c1, c2) of the error
e = x1 - y1. f2 of (4) is affine in x2: f2 = known - loss x2. Between samples the measurement runs straight and the
input is held; one classical Runge-Kutta step takes the copy from sample to sample. f2 takes the angles as they are
measured: their noise reaches the rate through gravity as well, unfiltered.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.errors import InputError
from cmg_mj.core.reduced_model import ReducedModel, Terms
from cmg_mj.core.types import Measurement

MAX_RATE = 2.5
"""Times the step: a rate at which the error fades that the Runge-Kutta step follows well. It is stable up to 2.78."""

Correction = Callable[[Scalar, Any], tuple[Scalar, Scalar]]
"""(e, gain) -> (c1, c2). The gain is what varies within a sample, such as H of (10); None for an observer with none."""

Stage = tuple[Scalar, Scalar, Scalar]
"""y1 [rad], known [rad/s^2] and loss [1/s] at one moment."""


class CopyState(NamedTuple):
    """The estimate, the last measurement, and the model's terms there."""

    x1: Scalar
    x2: Scalar
    y: Measurement
    terms: Terms


def stages(
    model: ReducedModel,
    before: Measurement,
    terms: Terms,
    y: Measurement,
    u: Scalar,
    bias: Scalar = 0.0,
    friction: Scalar = 0.0,
) -> tuple[Stage, Stage, Stage, Terms]:
    """f2 at the beginning, in the middle and at the end of a sample period.

    Args:
        model: The reduced model.
        before: The measurement at sample k-1.
        terms: The model's terms there.
        y: The measurement at sample k.
        u: The gimbal rate held between [rad/s].
        bias: Gravity pulls at y1 + bias, in the middle and at the end [rad].
        friction: A loss beside the model's [1/s].

    Returns:
        The three stages, and the terms at sample k.
    """
    (y1_before, y2_before), (y1, y2) = before, y
    y1_middle = 0.5 * (y1_before + y1)
    drift, gain, damping = terms
    begin = y1_before, drift + u * gain, u * damping + friction
    drift, gain, damping = model.terms(y1_middle + bias, 0.5 * (y2_before + y2))
    middle = y1_middle, drift + u * gain, u * damping + friction
    drift, gain, damping = terms = model.terms(y1 + bias, y2)
    end = y1, drift + u * gain, u * damping + friction
    if y.contact is not None:
        begin, middle, end = ((angle, known + y.contact, loss) for angle, known, loss in (begin, middle, end))
    return begin, middle, end, terms


def follow(
    correction: Correction,
    x1: Scalar,
    x2: Scalar,
    h: float,
    begin: Stage,
    middle: Stage,
    end: Stage,
    gains: Sequence[Any] = (None, None, None),
) -> tuple[Scalar, Scalar]:
    """Take one classical Runge-Kutta step of x1' = x2 - c1, x2' = known - loss x2 - c2, (c1, c2) = correction(e, gain).

    Args:
        correction: The observer's correction.
        x1: Estimate of the tilt [rad].
        x2: Estimate of the tilt rate [rad/s].
        h: The step [s].
        begin: f2 at the beginning of the step.
        middle: In its middle.
        end: At its end.
        gains: What the correction takes besides e, at these three instants.

    Returns:
        x1 and x2 at the end.
    """
    half, sixth = 0.5 * h, h / 6.0
    at_begin, at_middle, at_end = gains
    y1, known, loss = begin
    c1, c2 = correction(x1 - y1, at_begin)
    p1, p2 = x2 - c1, known - loss * x2 - c2

    y1, known, loss = middle
    w1, w2 = x1 + half * p1, x2 + half * p2
    c1, c2 = correction(w1 - y1, at_middle)
    q1, q2 = w2 - c1, known - loss * w2 - c2

    w1, w2 = x1 + half * q1, x2 + half * q2
    c1, c2 = correction(w1 - y1, at_middle)
    r1, r2 = w2 - c1, known - loss * w2 - c2

    y1, known, loss = end
    w1, w2 = x1 + h * r1, x2 + h * r2
    c1, c2 = correction(w1 - y1, at_end)
    s1, s2 = w2 - c1, known - loss * w2 - c2
    return x1 + sixth * (p1 + 2.0 * (q1 + r1) + s1), x2 + sixth * (p2 + 2.0 * (q2 + r2) + s2)


def require_stable_step(names: str, poles: np.ndarray, dt: float) -> None:
    """Refuse poles that one classical Runge-Kutta step a sample does not follow stably.

    Args:
        names: The parameters that make the poles.
        poles: Of the linear part of the error system [1/s].
        dt: Sample period [s].

    Raises:
        InputError: A pole is outside.
    """
    z = dt * poles
    if np.abs(1.0 + z + z**2 / 2.0 + z**3 / 6.0 + z**4 / 24.0).max() >= 1.0:
        listed = ", ".join(f"{pole:.3g}" for pole in poles)
        raise InputError(
            f"{names}: too fast for the sample period: the poles {listed} 1/s of the linear part are outside "
            f"the stability region of a Runge-Kutta step of {dt:g} s"
        )
