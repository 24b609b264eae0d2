"""A controller an axis, at the same ticks, and the gimbals turned against what a turn about the vertical couples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.core.controller import Controller, Feedback, Tick
from cmg_mj.core.noise import NoiseStream, normals
from cmg_mj.core.types import IdealReading, MultiAxisReading
from cmg_mj.elementwise import Scalar, clip, cos, dot, sin, where
from cmg_mj.errors import InputError
from cmg_mj.sensors.mems_gyro import MemsGyro

Matrix = Sequence[Sequence[float]]


class YawCoupling(NamedTuple):
    """Coupling of the axes of a rig that turns at w, (n_axes, n_axes) each, zero on the diagonals.

    In a frame that turns at w about the vertical z, with n_i along axis i, two momenta of axis j are swept round. The
    momentum of its wheels, its gimbals at x3_j, is s_j sin(x3_j), where s_j = sum over its modules of direction (gimbal
    axis x momentum at x3 = 0). It changes by

        s_j cos(x3_j) u_j + w (z x s_j) sin(x3_j),

    and the frame gets the opposite torque. The bodies that tilt have the inertias I_z about the vertical, I_i and I_j
    about the axes. Tilting at x2_j, they make a torque (I_i + I_j - I_z) w x2_j n_i . (n_j x z) about axis i (Euler's
    equations in that frame). Both cancel with

        u_i = w sum_j (c_ij sin(x3_j) + d_ij x2_j) / cos(x3_i),
        c_ij = -n_i . (z x s_j)/(n_i . s_i),   d_ij = (I_i + I_j - I_z) n_i . (n_j x z)/(n_i . s_i).

    The angular acceleration that accelerometers show about axis i also contains w k_ij x2_j, k_ij = 2 n_i . (z x n_j):
    Coriolis' acceleration, once of the frame and once of the point in it.
    """

    flywheels: np.ndarray
    """c [1]: for two axes at right angles whose pairs are alike +-1."""
    inertia: np.ndarray
    """d [s]."""
    coriolis: np.ndarray
    """k [1]."""


class MultiAxisController:
    """Runs a controller an axis, tick after tick.

    Where the rig turns about the vertical at w, the momenta of axis j, its wheels' and its tilt's, are swept round with
    it. This takes a torque, which acts about axis i. The gimbals of axis i cancel this torque at the rate

        u_i = w sum_j (c_ij sin(x3_j) + d_ij x2_j) / cos(x3_i)

    (`YawCoupling`) beside the law's own u, with the x2_j that is fed back (the observers', unless `feedback` says
    otherwise). The observers get the law's u alone: the rest makes no torque. w k_ij x2_j, with x2_j of the tick
    before, is subtracted from the accelerometers' angular acceleration. w is the reading of a cheap gyro about the
    frame's vertical.

    Args:
        parts: The controllers, one an axis, of one control period.
        coupling: The coefficients; None for a plant whose turns are not compensated.
        gyro: What shows w; by default the first axis' cheap gyro.

    Raises:
        InputError: The control periods differ.
    """

    def __init__(
        self, parts: Sequence[Controller], coupling: YawCoupling | None = None, gyro: MemsGyro | None = None
    ) -> None:
        self.parts = tuple(parts)
        first = self.parts[0]
        if any(part.period != first.period for part in self.parts):
            raise InputError("controller.rate_hz: must be the same on all axes")
        self.period, self.timestep = first.period, first.timestep
        self.law, self.sensors = first.law, first.sensors
        self._gyro = gyro or first.sensors.mems_gyro
        self.seed, self.worlds = first.seed, first.worlds
        self.steps_per_sample = math.gcd(*(part.steps_per_sample for part in self.parts))
        """Physics steps between the instants at which anything may be due."""
        self._coupling = None if coupling is None else [coefficients.tolist() for coefficients in coupling]
        for part in self.parts:
            part.turns_gimbals = coupling is None
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next update is the first tick of a run with the same seed."""
        for part in self.parts:
            part.reset()
        self.step: int | None = None
        """The physics step of the last update."""
        noise = normals(self.seed, self.worlds, NoiseStream.TURN_GYRO, self._gyro.channels)
        self._read = self._gyro.make_reading_function(self.law.dt, noise)

    def update(self, step: int, ideals: MultiAxisReading) -> bool:
        """Take the samples and the control decisions that are due at a physics step.

        Args:
            step: Number of the physics step, a multiple of `steps_per_sample`.
            ideals: The ideal readings at that step.

        Returns:
            Whether a control tick was due.

        Raises:
            RunStopped: An observer or a law of an axis returned a number that is not finite.
        """
        self.sample(step, ideals)
        if step % self.period:
            return False
        self.control(step)
        return True

    def sample(self, step: int, ideals: MultiAxisReading) -> None:
        """Take the samples that are due at a physics step: see `update`."""
        self.step = step
        self._ideals = ideals
        for part, ideal in zip(self.parts, ideals.axes, strict=True):
            part.sample(step, ideal)

    def control(self, step: int) -> None:
        """Take the control decisions of a tick, a multiple of `period`: see `update`."""
        for part in self.parts:
            part.control(step)
        if self._coupling is not None:
            self._compensate(self._ideals, *self._coupling)

    def _compensate(self, ideals: MultiAxisReading, flywheels: Matrix, inertia: Matrix, coriolis: Matrix) -> None:
        """Add to each axis' command what cancels the torque of momenta that are swept round."""
        turn_rate = ideals.turn_rate
        read = self._read(np.atleast_1d(turn_rate)[None, :])[0]
        w = float(read[0]) if type(turn_rate) is float else read
        ticks = [part.tick for part in self.parts if part.tick is not None]
        turned = [sin(tick.y2) for tick in ticks]
        known = zip(self.parts, ticks, ideals.axes, strict=True)
        rates = [_fed_back(part.feedback, tick, ideal) for part, tick, ideal in known]
        for part, tick, c, d, k in zip(self.parts, ticks, flywheels, inertia, coriolis, strict=True):
            added = w * (dot(c, turned) + dot(d, rates)) / cos(tick.y2)
            limit = part.law.rate_limit
            total = clip(tick.u + added, -limit, limit)
            u = where(tick.u + added == total, tick.u, total - added)  # the law's, as far as it was not limited
            part.coriolis = w * dot(k, rates)
            part.tick = tick._replace(u=u)
            part.command_rate(total)


def _fed_back(feedback: Feedback, tick: Tick, ideal: IdealReading) -> Scalar:
    """Return the tilt rate of an axis that its law is given [rad/s]."""
    return tick.estimates[0][1] if feedback == "observer" else tick.fog if feedback == "fog" else ideal.rate


AnyController = Controller | MultiAxisController
