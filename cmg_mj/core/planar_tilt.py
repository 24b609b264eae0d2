"""Tilt, and its angular acceleration, from accelerometers at any places of the tilting plane."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.core.tilt import MeasurementNoise


@dataclass(frozen=True)
class PlanarTilt:
    """Accelerometers of two axes at any places of the tilting plane, in axes that tilt with the body.

    With across and up as real and imaginary part, an accelerometer at r [m] from the pivot shows the specific force

        f = i g exp(i y) + K r,   K = -i y'' - y'^2,

    so that f over r is a straight line: gravity is its intercept, the motion its slope. Least squares over all
    accelerometers, weighed by 1/sigma^2, are the best unbiased linear estimate of both (Gauss and Markov; A. C. Aitken,
    "On least squares and linear combination of observations", Proc. Royal Society of Edinburgh 55, 1935). y is the
    angle of the intercept, y'' the imaginary part of -K, and y'^2 is not used. Two accelerometers on a ray from the
    pivot are `PairTilt`.

    Where an angle sensor shows y, the intercept is known. If moreover the pivot is at rest, one accelerometer suffices:
    the line goes through i g exp(i y). Otherwise the slope is the accelerometers' alone.

    Attributes:
        places: Across and up from the pivot, as real and imaginary part [m].
        sigmas: Standard deviation of a sample of each accelerometer's axes [m/s^2].
        gravity: [m/s^2].
        has_angle: Whether an angle sensor shows the tilt.
        pivot_moves: Whether the pivot may move.

    Raises:
        InputError: The accelerometers do not show the angular acceleration.
    """

    places: tuple[complex, ...]
    sigmas: tuple[float, ...]
    gravity: float
    has_angle: bool = False
    pivot_moves: bool = False

    def __post_init__(self) -> None:
        if not self._spread:
            cure = "" if self.has_angle else ", or name an angle sensor (tilt)"
            raise InputError(
                "accelerometer: they do not show the angular acceleration, being "
                + ("at the pivot" if self._through_gravity else f"at one place: give a second one{cure}")
            )

    @property
    def _through_gravity(self) -> bool:
        return self.has_angle and not self.pivot_moves

    @property
    def _weights(self) -> np.ndarray:
        weights = np.array(self.sigmas) ** -2.0
        return weights / weights.sum()

    @property
    def _arms(self) -> np.ndarray:
        """Places from the point through which the line goes: the pivot, or the mean place."""
        places = np.array(self.places)
        return places if self._through_gravity else places - self._weights @ places

    @property
    def _spread(self) -> float:
        """Mean square of the arms [m^2]."""
        return float(self._weights @ np.abs(self._arms) ** 2)

    def __call__(self, forces: Sequence[np.ndarray], tilt: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Compute the tilt and its angular acceleration.

        Args:
            forces: Specific force of each accelerometer, across and up as real and imaginary part, (n,) [m/s^2].
            tilt: What the angle sensor shows, (n,) [rad].

        Returns:
            The tilt, (n,) [rad], which is the angle sensor's where there is one, and y'', (n,) [rad/s^2].
        """
        seen, weights = np.array(forces), self._weights
        if tilt is not None and self._through_gravity:
            seen = seen - 1j * self.gravity * np.exp(1j * tilt)
        slope = (weights * self._arms.conj()) @ seen / self._spread
        gravity = weights @ seen - slope * (weights @ np.array(self.places))
        return np.angle(gravity / 1j) if tilt is None else tilt, -slope.imag

    def scaled(self, factor: float) -> PlanarTilt:
        """Return it with so many times the noise of every accelerometer."""
        return replace(self, sigmas=tuple(factor * sigma for sigma in self.sigmas))

    def noise(self, angle_sigma: float = 0.0) -> MeasurementNoise:
        """Return the noise of both, to first order, near upright.

        Args:
            angle_sigma: Standard deviation of a sample of the angle sensor [rad].
        """
        variance = 1.0 / float(np.sum(np.array(self.sigmas) ** -2.0))
        slope = variance / self._spread
        height = float(self._weights @ np.imag(self.places))
        if not self.has_angle:
            tilt = math.sqrt(variance + slope * abs(self._weights @ np.array(self.places)) ** 2) / self.gravity
            common = slope * height / self.gravity
        else:
            tilt = angle_sigma
            by_angle = self.gravity * height / self._spread if self._through_gravity else 0.0
            common, slope = by_angle * tilt**2, slope + (by_angle * tilt) ** 2
        acceleration = math.sqrt(slope)
        return MeasurementNoise(tilt, acceleration, common / (tilt * acceleration) if tilt else 0.0)
