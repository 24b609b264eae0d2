"""A controller an axis, at the same ticks, and the gimbals turned against what a turn about the vertical couples."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cmg_mj.controller import Controller
from cmg_mj.elementwise import Scalar, clip, cos, sin, where
from cmg_mj.errors import InputError
from cmg_mj.ideal import Ideals
from cmg_mj.mems_gyro import MemsGyro
from cmg_mj.observing import read_only
from cmg_mj.sensors import normals

STREAM = 5
"""Of the noise of the gyro about the vertical: those before it are an axis' sensors'."""


class AxesController:
    """Runs a controller an axis, tick after tick.

    Where the rig turns about the vertical at w, the momentum that axis j's gimbals have turned out of the vertical is
    swept round with it, and what torque that takes acts about axis i. Its gimbals cancel it at the rate

        u_i = w sum_j c_ij sin(x3_j) / cos(x3_i)

    (`turning.py`), beside the law's own u. The observers are told the law's alone: the rest makes no torque.

    Args:
        parts: The controllers, one an axis, of one control period.
        coupling: c_ij, (n_axes, n_axes); None for gimbals that are not turned against it.

    Raises:
        InputError: The control periods differ.
    """

    def __init__(self, parts: Sequence[Controller], coupling: np.ndarray | None = None) -> None:
        self.parts = tuple(parts)
        first = self.parts[0]
        if any(part.period != first.period for part in self.parts):
            raise InputError("controller.rate_hz: must be the same on all axes")
        self.period, self.timestep = first.period, first.timestep
        self.law, self.sensors = first.law, first.sensors
        self.seed, self.worlds = first.seed, first.worlds
        self.beat = math.gcd(*(part.beat for part in self.parts))
        """Physics steps between the moments at which anything may be due."""
        self._coupling = None if coupling is None else coupling.tolist()
        for part in self.parts:
            part.turns_gimbals = coupling is None
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next update is the first tick of a run with the same seed."""
        for part in self.parts:
            part.reset()
        self.step: int | None = None
        """The physics step of the last update."""
        gyro: MemsGyro = self.sensors.mems_gyro
        self._read = gyro.meter(self.law.dt, normals(self.seed, self.worlds, STREAM, gyro.channels))

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
        if ticked[0] and self._coupling is not None:
            self._against_turning(ideals.turn_rate)
        return ticked[0]

    def _against_turning(self, turn_rate: Scalar) -> None:
        """Add to each axis' command what cancels the torque of the others' momentum that is swept round."""
        shown = self._read(np.atleast_1d(turn_rate)[None, :])[0]
        w = float(shown[0]) if type(turn_rate) is float else shown
        ticks = [part.tick for part in self.parts]
        swept = [sin(tick.y2) for tick in ticks if tick is not None]
        for part, tick, row in zip(self.parts, ticks, self._coupling or (), strict=True):
            assert tick is not None
            added = 0.0 * w
            for c, momentum in zip(row, swept, strict=True):
                added = added + c * momentum
            added = w * added / cos(tick.y2)
            limit = part.law.rate_limit
            u = clip(tick.u + added, -limit, limit)
            kept = tick.u + added == u  # what is not limited stays to the last bit
            own = where(kept, tick.u, u - added)
            if type(own) is not float:
                read_only(own)  # as in `Controller.decide`
            part.tick = tick._replace(u=own)
            part.turn(u)
