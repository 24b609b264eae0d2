"""The plan of a walk on two point feet, in open loop: footsteps, zero moment point, mass centre, feet.

M. Vukobratovic and B. Borovac, "Zero-moment point - thirty five years of its life", Int. J. Humanoid Robotics 1, 2004;
S. Kajita et al., "The 3D linear inverted pendulum mode", IROS 2001. The mass centre's way is their model's exact and
only bounded answer to a zero moment point that runs straight between its corners.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cmg_mj.features.gait import Gait

SWING_FROM, SWING_SHARE = 0.12, 0.76
"""Of single support, the time before a foot moves ahead, and that in which it does."""
LEFT, RIGHT = 0, 1


class Step(NamedTuple):
    """One step."""

    foot: int
    """`LEFT` or `RIGHT`, which swings."""
    lifts: float
    """Time at which it leaves the floor [s]."""
    lands: float
    """Time at which it is to stand again [s]."""
    start: np.ndarray
    end: np.ndarray
    """Its place before and after, x forward and y to the left, (2,) [m]."""
    stance: np.ndarray
    """Place of the other foot, (2,) [m]."""


@dataclass(frozen=True)
class Plan:
    """Footsteps with the corners of the zero moment point.

    Attributes:
        gait: The gait.
        half_width: Distance of each foot from the middle at the start [m].
    """

    gait: Gait
    half_width: float

    @cached_property
    def steps(self) -> list[Step]:
        """The steps, the right foot's first; the last one brings the feet together."""
        gait, feet = self.gait, [np.array([0.0, self.half_width]), np.array([0.0, -self.half_width])]
        steps, time, foot = [], gait.stand_s, RIGHT
        half = self.half_width if gait.width_m is None else 0.5 * gait.width_m
        side = half, -half
        for number in range(gait.steps):
            time += gait.double_s
            stance = feet[1 - foot]
            ahead = gait.step_length_m if number < gait.steps - 1 else 0.0
            end = np.array([stance[0] + ahead, side[foot]])
            steps.append(Step(foot, time, time + gait.single_s, feet[foot], end, stance))
            feet[foot], time, foot = end, time + gait.single_s, 1 - foot
        return steps

    @cached_property
    def _corners(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (n,) [s] and places (n, 2) [m] between which the zero moment point runs straight."""
        last = self.steps[-1]
        end = last.lands + self.gait.double_s
        times, places = [self.gait.stand_s], [np.zeros(2)]
        for step in self.steps:
            times += [step.lifts, step.lands]
            places += [step.stance, step.stance]
        return np.array([*times, end]), np.array([*places, 0.5 * (last.end + last.stance)])

    @property
    def duration_s(self) -> float:
        """Time until it stands again, and has stood [s]."""
        return float(self._corners[0][-1]) + self.gait.stand_s

    def zero_moment_point(self, time: np.ndarray) -> np.ndarray:
        """Return the zero moment point, (n, 2) [m]: under the foot that stands, or on its way to the other one."""
        times, places = self._corners
        return np.column_stack([np.interp(time, times, places[:, i]) for i in range(2)])

    def mass_centre(self, time: np.ndarray, pole: float) -> np.ndarray:
        """Return the mass centre of the linear inverted pendulum, (n, 2) [m].

        c'' = pole^2 (c - p). Less the zero moment point p, whose slope jumps by s_k at t_k, it has the one bounded
        solution c - p = sum of s_k exp(-pole |t - t_k|) / (2 pole).

        Args:
            time: (n,) [s].
            pole: sqrt(g/height) [1/s].
        """
        times, places = self._corners
        slopes = np.pad(np.diff(places, axis=0) / np.diff(times)[:, None], ((1, 1), (0, 0)))
        fading = np.exp(-pole * np.abs(time[:, None] - times))
        return self.zero_moment_point(time) + fading @ np.diff(slopes, axis=0) / (2.0 * pole)

    def feet(self, time: np.ndarray) -> np.ndarray:
        """Return the places of both soles, (2, n, 3) [m]."""
        soles = np.zeros((2, len(time), 3))
        soles[LEFT, :, 1], soles[RIGHT, :, 1] = self.half_width, -self.half_width
        for step in self.steps:
            share = np.clip((time - step.lifts) / (step.lands - step.lifts), 0.0, 1.0)
            later = share > 0.0
            moved = self._moved(step, time[later])[:, None]
            soles[step.foot, later, :2] = step.start + moved * (step.end - step.start)
            soles[step.foot, :, 2] += 16.0 * self.gait.lift_m * (share * (1.0 - share)) ** 2
        return soles

    def rolled(self, time: np.ndarray, ways: np.ndarray) -> np.ndarray:
        """Return by how much both soles are beside their places because they roll while they stand, (2, n, 3) [m].

        Args:
            time: (n,) [s].
            ways: How far they would have rolled since the start, (2, n, 3) [m].
        """
        beside = ways - ways[:, :1]
        for step in self.steps:
            foot, lifts, lands = step.foot, *np.searchsorted(time, [step.lifts, step.lands])
            left = 1.0 - self._moved(step, time[lifts:lands])
            beside[foot, lifts:lands] = left[:, None] * beside[foot, lifts]
            beside[foot, lands:] = ways[foot, lands:] - ways[foot, lands]
        return beside

    @staticmethod
    def _moved(step: Step, time: np.ndarray) -> np.ndarray:
        """Return the share of its way that a foot has moved."""
        return _quintic(((time - step.lifts) / (step.lands - step.lifts) - SWING_FROM) / SWING_SHARE)

    def load(self, time: np.ndarray) -> np.ndarray:
        """Return the share of the weight that each foot carries, (2, n)."""
        left, right = self.feet(time)[:, :, :2]
        way = left - right
        of_left = np.einsum("ni,ni->n", self.zero_moment_point(time) - right, way) / np.einsum("ni,ni->n", way, way)
        for step in self.steps:
            of_left[(time >= step.lifts) & (time <= step.lands)] = float(step.foot == RIGHT)
        return np.stack([of_left, 1.0 - of_left])


def _quintic(share: np.ndarray) -> np.ndarray:
    """Go from 0 to 1 with no speed and no acceleration at both ends."""
    s = np.clip(share, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s)


def bounded(error: np.ndarray, pole: float, dt: float) -> np.ndarray:
    """Return the bounded solution of d'' = pole^2 (d - error), (n, 2): by how much the mass centre has to move [m]."""
    from scipy.linalg import solve_banded

    n = len(error)
    bands = np.full((3, n), 1.0 / dt**2)
    bands[1] = -2.0 / dt**2 - pole**2
    bands[1, [0, -1]] += 1.0 / dt**2
    return solve_banded((1, 1), bands, -(pole**2) * error)
