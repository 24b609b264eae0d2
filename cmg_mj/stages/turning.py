"""The gimbals of several axes turned against what a turn about the vertical couples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from cmg_mj.core.arrays import Scalar, clip, cos, dot, sin, where
from cmg_mj.core.axis import AxisControl, Tick
from cmg_mj.core.rig import AxesOrders, AxesStage
from cmg_mj.core.sensor import Memory, SensorStage
from cmg_mj.core.straight_line import Tables
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

    flywheels: Sequence[Sequence[float]]
    """c [1]: for two axes at right angles whose pairs are alike +-1."""
    inertia: Sequence[Sequence[float]]
    """d [s]."""
    coriolis: Sequence[Sequence[float]]
    """k [1]."""


@dataclass(frozen=True)
class Turning(AxesStage):
    """Cancels the torques that reach an axis from the others while the rig turns about the vertical at w.

    The momenta of axis j, its wheels' and its tilt's, are swept round with the rig. This takes a torque, which acts
    about axis i. The gimbals of axis i cancel this torque at the rate

        u_i = w sum_j (c_ij sin(x3_j) + d_ij x2_j) / cos(x3_i)

    (`YawCoupling`) beside what is ordered already, with the x2_j that is fed back (the observers', unless `feedback`
    says otherwise). The observers are not told of it: it makes no torque. w k_ij x2_j, with x2_j of the tick before, is
    subtracted from the accelerometers' angular acceleration. w is the reading of a cheap gyro about the frame's
    vertical.

    Attributes:
        coupling: The coefficients.
        gyro: The gyro that shows w, at work.
        limits: Largest gimbal rate of each axis, floats or arrays (n_worlds,) [rad/s].
        feedback: The rate that each axis feeds back.
    """

    coupling: YawCoupling
    gyro: SensorStage
    limits: Sequence[Scalar]
    feedback: Sequence[str]

    @property
    def draws(self) -> Mapping[int, int]:
        """See `AxesStage`."""
        return self.gyro.draws

    def init(self, readings: MultiAxisReading, tables: Tables) -> Memory:
        """Return the gyro's memory and the number of its samples."""
        return self.gyro.init((readings.turn_rate,), readings.axes[0], tables), 0

    def step(
        self,
        memory: Memory,
        step: int,
        orders: AxesOrders,
        ticks: Sequence[Tick],
        readings: MultiAxisReading,
        tables: Tables,
    ) -> tuple[Memory, AxesOrders]:
        """Add to each axis' rate what cancels the torque of momenta that are swept round."""
        shown, sample = memory
        shown, (w,) = self.gyro.step(shown, (readings.turn_rate,), readings.axes[0], sample, tables)
        turned = [sin(tick.y2) for tick in ticks]
        fed = zip(self.feedback, ticks, readings.axes, strict=True)
        rates = [
            {"observer": tick.estimates[0][1], "fog": tick.fog, "truth": ideal.rate}[feedback]
            for feedback, tick, ideal in fed
        ]
        flywheels, inertia, coriolis = self.coupling
        told, turns, known = [], [], []
        for i, tick in enumerate(ticks):
            added = w * (dot(flywheels[i], turned) + dot(inertia[i], rates)) / cos(tick.y2)
            wanted = orders.rates[i] + added
            total = clip(wanted, -self.limits[i], self.limits[i])
            turns.append(total)
            told.append(where(wanted == total, orders.told[i], total - added))  # as far as it was not limited
            before = orders.known[i]
            known.append(before._replace(acceleration=before.acceleration + w * dot(coriolis[i], rates)))
        return (shown, sample + 1), orders._replace(told=told, rates=turns, known=known)


def compensation(coupling: YawCoupling, gyro: SensorStage, axes: Sequence[AxisControl]) -> Turning:
    """Make the stage between these axes, with a gyro about the vertical at work: see `Turning`."""
    limits = [axis.law.rate_limit for axis in axes]
    return Turning(coupling, gyro, limits, [axis.feedback for axis in axes])
