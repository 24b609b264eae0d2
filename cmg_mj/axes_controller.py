"""A controller an axis, at the same ticks, and the gimbals turned against what a turn about the vertical couples."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cmg_mj.controller import Controller, Feedback, Tick
from cmg_mj.elementwise import Scalar, clip, cos, dot, sin, where
from cmg_mj.errors import InputError
from cmg_mj.ideal import Ideal, Ideals
from cmg_mj.mems_gyro import MemsGyro
from cmg_mj.observing import read_only
from cmg_mj.sensors import normals
from cmg_mj.turning import Turning

Rows = Sequence[Sequence[float]]

STREAM = 5
"""Of the noise of the gyro about the vertical: those before it are an axis' sensors'."""


class AxesController:
    """Runs a controller an axis, tick after tick.

    Where the rig turns about the vertical at w, the momenta of axis j, its wheels' and its tilt's, are swept round with
    it, and what torque that takes acts about axis i. Its gimbals cancel it at the rate

        u_i = w sum_j (c_ij sin(x3_j) + d_ij x2_j) / cos(x3_i)

    (`Turning`) beside the law's own u, with the x2_j that is fed back (the observers', unless `feedback` says
    otherwise). The observers are told the law's u alone: the rest makes no torque. From the accelerometers' angular
    acceleration w k_ij x2_j is taken, with x2_j of the tick before. w is what a cheap gyro about the frame's vertical
    shows.

    Args:
        parts: The controllers, one an axis, of one control period.
        turning: The coefficients; None for a rig whose turns are not minded.
        gyro: What shows w; by default the first axis' cheap gyro.

    Raises:
        InputError: The control periods differ.
    """

    def __init__(
        self, parts: Sequence[Controller], turning: Turning | None = None, gyro: MemsGyro | None = None
    ) -> None:
        self.parts = tuple(parts)
        first = self.parts[0]
        if any(part.period != first.period for part in self.parts):
            raise InputError("controller.rate_hz: must be the same on all axes")
        self.period, self.timestep = first.period, first.timestep
        self.law, self.sensors = first.law, first.sensors
        self._gyro = gyro or first.sensors.mems_gyro
        self.seed, self.worlds = first.seed, first.worlds
        self.beat = math.gcd(*(part.beat for part in self.parts))
        """Physics steps between the moments at which anything may be due."""
        self._turning = None if turning is None else [coefficients.tolist() for coefficients in turning]
        for part in self.parts:
            part.turns_gimbals = turning is None
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next update is the first tick of a run with the same seed."""
        for part in self.parts:
            part.reset()
        self.step: int | None = None
        """The physics step of the last update."""
        noise = normals(self.seed, self.worlds, STREAM, self._gyro.channels)
        self._read = self._gyro.meter(self.law.dt, noise)

    def update(self, step: int, ideals: Ideals) -> bool:
        """Take the samples and the control decisions that are due at a physics step.

        Args:
            step: Number of the physics step, a multiple of `beat`.
            ideals: The ideal readings at that step.

        Returns:
            Whether a control tick was due.

        Raises:
            RunStopped: An observer or a law of an axis returned a number that is not finite.
        """
        self.step = step
        ticked = [part.update(step, ideal) for part, ideal in zip(self.parts, ideals.axes, strict=True)]
        if ticked[0] and self._turning is not None:
            self._against(ideals, *self._turning)
        return ticked[0]

    def _against(self, ideals: Ideals, wheels: Rows, body: Rows, shown: Rows) -> None:
        """Add to each axis' command what cancels the torque of momenta that are swept round."""
        turn_rate = ideals.turn_rate
        read = self._read(np.atleast_1d(turn_rate)[None, :])[0]
        w = float(read[0]) if type(turn_rate) is float else read
        ticks = [part.tick for part in self.parts if part.tick is not None]
        turned = [sin(tick.y2) for tick in ticks]
        known = zip(self.parts, ticks, ideals.axes, strict=True)
        rates = [_fed_back(part.feedback, tick, ideal) for part, tick, ideal in known]
        for part, tick, c, d, k in zip(self.parts, ticks, wheels, body, shown, strict=True):
            added = w * (dot(c, turned) + dot(d, rates)) / cos(tick.y2)
            limit = part.law.rate_limit
            total = clip(tick.u + added, -limit, limit)
            u = where(tick.u + added == total, tick.u, total - added)  # the law's, as far as it was not limited
            part.coriolis = none = w * dot(k, rates)
            if type(u) is not float:
                read_only(u, none)  # as in `Controller.decide`
            part.tick = tick._replace(u=u)
            part.turn(total)


def _fed_back(feedback: Feedback, tick: Tick, ideal: Ideal) -> Scalar:
    """The tilt rate of an axis that its law is given [rad/s]."""
    return tick.estimates[0][1] if feedback == "observer" else tick.fog if feedback == "fog" else ideal.rate
