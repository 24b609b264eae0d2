"""The instants of a run at which something is due, and the torques and the pivot's acceleration between them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence

from cmg_mj.core.sensor import whole_steps
from cmg_mj.elementwise import Scalar, where
from cmg_mj.scenario.pivot_signals import PivotSignals
from cmg_mj.stages.push import Push, Swing, add_swing_torques

Instant = tuple[int, int, Sequence[Scalar]]
"""Physics step, steps until the next instant, each axis' torque until then, one or a world's each [N m]."""


def sampling_instants(
    steps: int, steps_per_sample: int, pushes: Sequence[Push], timestep: float, axes: Sequence[str] = ("",)
) -> Iterator[Instant]:
    """Find the instants of a run at which a sensor or the controller is due, or a push begins or ends.

    A push about an axis that the rig does not have, since it is locked, moves nothing.
    """
    changes: dict[int, list[Scalar]] = {0: [0.0] * len(axes), steps: [0.0] * len(axes)}
    for push in pushes:
        for time, torque in ((push.start_s, push.torque_n_m), (push.end_s, -push.torque_n_m)):
            step = whole_steps(time, timestep, "push", f"{time:g} s")
            change = changes.setdefault(step, [0.0] * len(axes))
            about = push.axis or axes[0]
            if about in axes:
                change[axes.index(about)] += torque
    edges = sorted(step for step in changes if step <= steps)
    torques: list[Scalar] = [0.0] * len(axes)
    for start, end in itertools.pairwise(edges):
        torques = [torque + change for torque, change in zip(torques, changes[start], strict=True)]
        held = [where(abs(torque) > 1e-12, torque, 0.0) for torque in torques]
        first = min(
            -(-start // steps_per_sample) * steps_per_sample, end
        )  # the first sample not before the push's edge
        if first > start:
            yield start, first - start, held
        last = max(end // steps_per_sample * steps_per_sample, first)
        for step in range(first, last, steps_per_sample):
            yield step, steps_per_sample, held
        if last < end:
            yield last, end - last, held


def with_swing_torques(
    instants: Iterable[Instant], swings: Sequence[Swing], timestep: float, axes: Sequence[str]
) -> Iterator[Instant]:
    """Add the swings' torques, at their value in the middle between two instants."""
    for step, steps, torques in instants:
        yield step, steps, add_swing_torques(torques, swings, axes, (step + 0.5 * steps) * timestep)


def with_moving_pivot(
    instants: Iterable[Instant], pivot: PivotSignals, accelerate: Callable[[Sequence[Scalar]], None], timestep: float
) -> Iterator[Instant]:
    """Set the pivot's acceleration before each instant, at its mean until the next one.

    Args:
        instants: The instants.
        pivot: The acceleration in time.
        accelerate: Sets x, y, z of the acceleration in the physics [m/s^2].
        timestep: Physics step [s].
    """
    for step, steps, torques in instants:
        accelerate(pivot.mean(step * timestep, (step + steps) * timestep))
        yield step, steps, torques
