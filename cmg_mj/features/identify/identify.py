"""A rig by one log: its sensors, and its pendulum if the log shows what moves it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cmg_mj.core.errors import InputError
from cmg_mj.features.identify.fit import Number, Solution
from cmg_mj.features.identify.geometry import Geometry, fit_geometry
from cmg_mj.features.identify.pendulum import fit_pendulum, has_pendulum
from cmg_mj.features.identify.signals import Signals, below
from cmg_mj.features.replay.log import Channels

HIGHEST = 0.4
"""Highest cut-off, in sampling rates."""


@dataclass(frozen=True)
class Identified:
    """A rig, as far as one log tells it.

    Attributes:
        signals: The log.
        geometry: The sensors.
        pendulum: The numbers of the pendulum; None without a torque or gimbals.
        momentum: Spin momentum of the flywheels, if it is known [N m s].
    """

    signals: Signals
    geometry: Geometry
    pendulum: Solution | None
    momentum: float | None

    @property
    def numbers(self) -> Sequence[Number]:
        """All parameters."""
        return [*self.geometry.solution.numbers, *(self.pendulum.numbers if self.pendulum else ())]


def identify_rig(channels: Channels, below_hz: float | None = None, momentum: float | None = None) -> Identified:
    """Identify a rig.

    Args:
        channels: The log, whose options name the columns of the accelerometers.
        below_hz: Cut-off of the low-pass behind which channels are compared; by default `below` [Hz].
        momentum: Spin momentum of the flywheels, if it is known [N m s].

    Raises:
        InputError: The log is too short, or a column, sign or unit is wrong.
    """
    if below_hz is not None and below_hz * channels.dt > HIGHEST:
        raise InputError(
            f"--below-hz {below_hz:g}: at most {HIGHEST / channels.dt:.3g} for rows at {1.0 / channels.dt:.4g} Hz"
        )
    if channels.options.radii_m:
        raise InputError("--radii: this command finds the places; name the columns by --accelerometer")
    signals = Signals(channels, below_hz or below(channels))
    values = channels.values
    if not channels.options.rig.accelerometer and not values.keys() >= {"tilt", "rate"}:
        raise InputError("--accelerometer: give the columns of one, or both tilt and rate: there is nothing to compare")
    if "wheel" in values and "torque" not in values:
        raise InputError("--columns wheel: goes with torque, the motor's that drives it")
    geometry = fit_geometry(signals)
    pendulum = fit_pendulum(geometry, momentum)[1] if has_pendulum(signals) else None
    if momentum is not None and pendulum is None:
        raise InputError(f"--momentum {momentum:g}: goes with the gimbals' angle, --columns gimbal=...")
    return Identified(signals, geometry, pendulum, momentum)
