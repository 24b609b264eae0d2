"""Tilt, and its angular acceleration, from two accelerometers on one radial line through the pivot.

S. Trimpe and R. D'Andrea, "Accelerometer-based tilt estimation of a rigid body with only rotational
degrees of freedom", ICRA 2010 (reference [8] of aranovskiy2020).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from cmg_mj.core.arrays import Scalar, atan2, dot
from cmg_mj.core.types import Forces


@dataclass(frozen=True)
class MeasurementNoise:
    """The noise of one sample of what observers are given.

    Attributes:
        tilt: Standard deviation of the tilt y1 [rad].
        acceleration: Standard deviation of the angular acceleration [rad/s^2].
        correlation: Of both, which come from the same two readings.
        gimbal: Standard deviation of the gimbal angle y2 [rad].
        gyro: Density of the white noise of the cheap gyro [rad/s/sqrt(Hz)].
        gyro_walk: Random walk of that gyro's bias: its standard deviation after a second [rad/s].
        repeats: Number of control periods that see the same sample of y1.
    """

    tilt: float
    acceleration: float
    correlation: float
    gimbal: float = 0.0
    gyro: float = 0.0
    gyro_walk: float = 0.0
    repeats: float = 1.0


@dataclass(frozen=True)
class RadialTilt:
    """Two accelerometers at distances r_inner < r_outer from the pivot, on one ray.

    A body turning about a fixed point moves a point r n of that ray with the acceleration r W n, W the
    same for both (W = skew(alpha) + skew(omega)^2). Angular acceleration and centripetal terms are therefore
    proportional to r, and the combination below is gravity alone, whatever the motion.

    Attributes:
        r_inner: Distance of the inner accelerometer from the pivot, of many worlds an array (n_worlds,) [m].
        r_outer: Distance of the outer accelerometer from the pivot, likewise [m].
        height: How far above the pivot the point lies that both distances are from, and that is at rest [m]. An
            accelerometer below it has a negative distance.
    """

    r_inner: Scalar
    r_outer: Scalar
    height: float = 0.0

    def about(self, height: float) -> RadialTilt:
        """Return the estimate with distances from a point of the ray above the pivot [m]."""
        if not height:
            return self
        return RadialTilt(self.r_inner - height, self.r_outer - height, height)

    @property
    def radii(self) -> tuple[Scalar, Scalar]:
        """Distances of both from the pivot [m]."""
        return self.r_inner + self.height, self.r_outer + self.height

    @cached_property
    def _weights(self) -> tuple[Scalar, Scalar]:
        """Weights of the inner and the outer accelerometer in the combination that is gravity alone."""
        span = self.r_outer - self.r_inner
        return self.r_outer / span, self.r_inner / span

    def __call__(self, inner_x: Scalar, inner_z: Scalar, outer_x: Scalar, outer_z: Scalar) -> Scalar:
        """Tilt y1 = q_b + pi/4 from the specific forces of both accelerometers.

        Args:
            inner_x: Inner accelerometer, tangential axis [m/s^2].
            inner_z: Inner accelerometer, radial axis, outward [m/s^2].
            outer_x: Outer accelerometer, tangential axis [m/s^2].
            outer_z: Outer accelerometer, radial axis, outward [m/s^2].

        Returns:
            Tilt of the radial line from the vertical [rad].
        """
        w_inner, w_outer = self._weights
        return atan2(-(w_inner * inner_x - w_outer * outer_x), w_inner * inner_z - w_outer * outer_z)

    def acceleration(self, inner_x: Scalar, outer_x: Scalar) -> Scalar:
        """Angular acceleration of the tilt: gravity is the same at both places, r alpha is not.

        Args:
            inner_x: Inner accelerometer, tangential axis [m/s^2].
            outer_x: Outer accelerometer, tangential axis [m/s^2].

        Returns:
            y1'' [rad/s^2].
        """
        return (outer_x - inner_x) / (self.r_outer - self.r_inner)

    def noise(self, sigma: float, gravity: float) -> MeasurementNoise:
        """Return the noise of tilt and angular acceleration, to first order in the noise of the accelerometers.

        Args:
            sigma: Standard deviation of one axis' sample, independent from axis to axis [m/s^2].
            gravity: [m/s^2].

        Returns:
            Of one sample, near upright.
        """
        w_inner, w_outer = self._weights
        both = math.hypot(w_inner, w_outer)
        span = self.r_outer - self.r_inner
        correlation = (w_inner + w_outer) / (math.sqrt(2.0) * both)
        return MeasurementNoise(sigma * both / gravity, sigma * math.sqrt(2.0) / span, correlation)

    def offset(self, tilt: float, response: Callable[[Forces], Forces], gravity: float) -> float:
        """Compute the error of y1 at rest that the accelerometers' response to the specific forces makes.

        Args:
            tilt: The true tilt of the radial line [rad].
            response: True specific forces (inner x, z, outer x, z) -> what the accelerometers show [m/s^2].
            gravity: [m/s^2].

        Returns:
            y1 less the tilt [rad].
        """
        x, z = -gravity * math.sin(tilt), gravity * math.cos(tilt)
        return self(*response((x, z, x, z))) - tilt


@dataclass(frozen=True)
class GimbalAngle:
    """y2 from the encoders: of a scissored pair half their difference.

    Attributes:
        directions: For each gimbal +1 or -1: the sign of u that it is given.
        zeros: For each gimbal the angle at which y2 = 0 [rad].
    """

    directions: tuple[float, ...]
    zeros: tuple[float, ...]

    @cached_property
    def _shares(self) -> list[float]:
        return [direction / len(self.directions) for direction in self.directions]

    @cached_property
    def _less_zero(self) -> float:
        return -dot(self._shares, self.zeros)

    def __call__(self, encoders: Sequence[Scalar]) -> Scalar:
        """y2 [rad] from the gimbals' angles, one a gimbal [rad]."""
        y2 = self._less_zero
        for share, angle in zip(self._shares, encoders, strict=True):
            y2 = y2 + share * angle
        return y2
