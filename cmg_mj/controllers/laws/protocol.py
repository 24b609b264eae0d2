"""The protocol of a control law: a frozen value with `init` and `step`, discrete in time, elementwise in the worlds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from cmg_mj.elementwise import Scalar
from cmg_mj.observers.protocol import Estimate, Measurement, State, declared, names_out_of


class FeedbackState(Estimate):
    """Feedback of a law: x1 [rad], x2 [rad/s], x3 [rad], floats for one world, arrays (n_worlds,) for many.

    x1 and x3 are measured or estimated (`controller.angle_source`), x2 is the observer's, the gyro's or the true one
    (`controller.feedback`). `extra` has what the observer in the loop estimates beyond x, in the order of its
    `extra_signals`.
    """

    extra: Sequence[Scalar] = ()


_new = tuple.__new__


def feedback_state(x1: Scalar, x2: Scalar, x3: Scalar, extra: Sequence[Scalar] = ()) -> FeedbackState:
    """Put together what is fed back to a law."""
    x = _new(FeedbackState, (x1, x2, x3))
    if extra:
        x.extra = extra
    return x


class Law(Protocol):
    """A control law in discrete time: from what is measured and estimated to the gimbal rate u.

    All memory is in the state, so that one value serves any number of runs and worlds. Its constructor is given `dt`
    and `rate_limit`, which it keeps under these names, and `model` and `noise` (`TiltNoise`, of the sensors'
    datasheet) if it takes them. The controller limits u to `rate_limit` whatever the law says; a law that has memory
    should know the limit, and not wind up.

    Where a law has more to say:

    - A part `x_e` of its state is its integrator, which the trajectory shows; of a law without one it shows NaN.
    - `trim_gain` [s]: its integrator settles at that times the equilibrium bias. Such a law can be trimmed
      (`controller.bias_trim_s`); its state is a NamedTuple with `x_e`.
    - `needs`, out of `NEEDS`: () for a law that takes y and nothing of the observer.
    - `arrays`: names of its fields that may be arrays (n_worlds,), so that worlds of one batch may differ in them.

    Attributes:
        dt: Control period [s].
        rate_limit: Largest gimbal rate [rad/s].
    """

    @property
    def dt(self) -> float: ...  # noqa: D102

    @property
    def rate_limit(self) -> Scalar: ...  # noqa: D102

    def init(self, y: Measurement) -> State:
        """Return the state before the first sample is fed back."""
        ...

    def step(self, state: State, y: Measurement, x: FeedbackState, u: Scalar) -> tuple[State, Scalar]:
        """Decide on one sample.

        Args:
            state: The state before it.
            y: What is measured at it.
            x: What is fed back at it.
            u: The gimbal rate commanded at the sample before and held since [rad/s]; 0 at the first.

        Returns:
            The next state, and the gimbal rate to hold until the next sample [rad/s].
        """
        ...


NEEDS = ("estimate",)
"""Inputs that a law may need beside y: the estimate, which the observer or in its place the gyro gives."""


def needs(law: Law | type[Law]) -> tuple[str, ...]:
    """Return the `NEEDS` of a law, or of its class: its inputs beside y. A law without the attribute takes all.

    Raises:
        InputError: It names something else.
    """
    return names_out_of(NEEDS, declared("needs", lambda: getattr(law, "needs", NEEDS)))
