"""The gimbals of several axes turned against what a turn about the vertical couples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.core.arrays import clip, cos, dot, sin, where
from cmg_mj.core.controller import Controller
from cmg_mj.core.noise import NoiseStream, normals
from cmg_mj.core.types import MultiAxisReading


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


class Turning:
    """Cancels the torques that reach an axis from the others while the rig turns about the vertical at w.

    The momenta of axis j, its wheels' and its tilt's, are swept round with the rig. This takes a torque, which acts
    about axis i. The gimbals of axis i cancel this torque at the rate

        u_i = w sum_j (c_ij sin(x3_j) + d_ij x2_j) / cos(x3_i)

    (`YawCoupling`) beside the law's own u, with the x2_j that is fed back (the observers', unless `feedback` says
    otherwise). The observers get the law's u alone: the rest makes no torque. w k_ij x2_j, with x2_j of the tick
    before, is subtracted from the accelerometers' angular acceleration. w is the reading of a cheap gyro about the
    frame's vertical.

    Args:
        coupling: The coefficients.
        gyro: The gyro that shows w, such as `MemsGyro`.
        first: The first axis' controller.
    """

    def __init__(self, coupling: YawCoupling, gyro: Any, first: Controller) -> None:
        self._coupling = [coefficients.tolist() for coefficients in coupling]
        noise = normals(first.seed, first.world_ids, NoiseStream.TURN_GYRO, gyro.channels)
        self._read = gyro.make_reading_function(first.law.dt, noise)

    def __call__(self, controllers: Sequence[Controller], ideals: MultiAxisReading) -> None:
        """Add to each axis' command what cancels the torque of momenta that are swept round."""
        flywheels, inertia, coriolis = self._coupling
        turn_rate = ideals.turn_rate
        read = self._read(np.atleast_1d(turn_rate)[None, :])[0]
        w = float(read[0]) if type(turn_rate) is float else read
        ticks = [part.tick for part in controllers if part.tick is not None]
        turned = [sin(tick.y2) for tick in ticks]
        known = zip(controllers, ticks, ideals.axes, strict=True)
        rates = [
            {"observer": tick.estimates[0][1], "fog": tick.fog, "truth": ideal.rate}[part.feedback]
            for part, tick, ideal in known
        ]
        for part, tick, c, d, k in zip(controllers, ticks, flywheels, inertia, coriolis, strict=True):
            added = w * (dot(c, turned) + dot(d, rates)) / cos(tick.y2)
            limit = part.law.rate_limit
            total = clip(tick.u + added, -limit, limit)
            u = where(tick.u + added == total, tick.u, total - added)  # the law's, as far as it was not limited
            part.coriolis = w * dot(k, rates)
            part.tick = tick._replace(u=u)
            part.command_rate(total)


def compensation(coupling: YawCoupling, gyro: Any) -> Callable[[Controller], Turning]:
    """Make the stage between the axes: see `Turning`."""
    return partial(Turning, coupling, gyro)
