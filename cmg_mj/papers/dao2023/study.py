"""The simulations behind Figs 2 and 3: some motions of the pendulum robot, followed by both observers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cmg_mj.papers.claim import Assumption, OnShare
from cmg_mj.papers.dao2023 import paper
from cmg_mj.papers.dao2023 import pendulum_robot as robot

SIGMAS = (*paper.SIGMAS, 10_000.0)
"""The paper's three weights, in the order of Fig. 3, and one beyond."""

SETTLED = 0.1
"""Settled: the errors of theta1, theta2 and d, as a vector of their numbers in the units of Fig. 3, stay below this."""

ASSUMED: Mapping[Assumption, str] = {"initial values": "ten motions", "duration": "200 s"}
UNSTATED = (
    "The paper gives neither time span nor initial values: ten motions with angles within half a turn and rates within "
    "2 rad/s, observers started from zero, 200 s, with the corrected L = -[1; 1]."
)


@dataclass(frozen=True)
class Study:
    """The arm's motions and what the observers made of them.

    Attributes:
        proposed: Errors with each of `SIGMAS`.
        conventional: Errors at Sigma = 10.
        largest_angle: The largest |q| [rad].
    """

    proposed: robot.Errors
    conventional: robot.Errors
    largest_angle: float


def study(
    seed: int = 0,
    motions: int = 10,
    duration_s: float = 200.0,
    rates_hz: tuple[float, float] = (400.0, 200.0),
    on_share: OnShare = lambda share: None,
) -> Study:
    """Let both observers follow the arm.

    Args:
        seed: Seed of the initial values.
        motions: Number of motions.
        duration_s: Simulated time [s].
        rates_hz: Sample rates of the proposed and of the conventional observer, the former a multiple of the latter
            [Hz].
        on_share: Called with the share done.

    Returns:
        All errors.
    """
    rate, every = rates_hz[0], round(rates_hz[0] / rates_hz[1])
    t = np.arange(round(duration_s * rate) + 1) / rate
    x = robot.motion(robot.starts(seed, motions), t)
    proposed = robot.follow(robot.make_proposed(1.0 / rate, SIGMAS), t, x, lambda s: on_share(0.1 + 0.65 * s))
    t_plain, x_plain = t[::every], x[::every]
    plain = robot.follow(robot.make_conventional(every / rate), t_plain, x_plain, lambda s: on_share(0.75 + 0.25 * s))
    return Study(proposed, plain, float(np.abs(x[..., 0]).max()))


def exogenous_settle_times(errors: robot.Errors, band: float = SETTLED) -> np.ndarray:
    """Find when the errors of theta1, theta2 and d settle, (n_sigmas, n) [s]; infinite if they do not."""
    return robot.settle_times(np.linalg.norm(errors.exogenous, axis=-1), errors.t, band)


def finite_times(times: np.ndarray) -> list[float | None]:
    """Return settling times as JSON can hold them."""
    return [float(time) if math.isfinite(time) else None for time in times]
