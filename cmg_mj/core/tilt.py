"""Tilt, and its angular acceleration, from two accelerometers: on one ray from the pivot, or anywhere in its plane.

S. Trimpe and R. D'Andrea, "Accelerometer-based tilt estimation of a rigid body with only rotational
degrees of freedom", ICRA 2010 (reference [8] of aranovskiy2020).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from cmg_mj.core.arrays import Scalar, atan2, cos, dot, sin
from cmg_mj.core.types import Forces

MIN_SPAN_M = 1e-3
"""Accelerometers nearer to each other are at one place [m]."""


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
class PairTilt:
    """Two accelerometers at distances r_inner < r_outer from the pivot, on one ray, or beside it.

    A body turning about a fixed point moves a point r n of that ray with the acceleration r W n, W the
    same for both (W = skew(alpha) + skew(omega)^2). Angular acceleration and centripetal terms are therefore
    proportional to r, and the combination below is gravity alone, whatever the motion.

    Beside the ray the same holds of a motion in the tilting plane: with p = r - i across and q = f_z - i f_x, an
    accelerometer shows q = g exp(i y) + K p, K = -i y'' - y'^2 (see `PlanarTilt`), so that

        g exp(i y) = (p_outer q_inner - p_inner q_outer) / (p_outer - p_inner),   K = (q_outer - q_inner) / (the same).

    Attributes:
        r_inner: Distance of the inner accelerometer from the pivot along the ray, of many worlds an array (n_worlds,)
            [m].
        r_outer: Distance of the outer accelerometer from the pivot, likewise [m].
        height: How far above the pivot the point lies that both distances are from, and that is at rest [m]. An
            accelerometer below it has a negative distance.
        across: How far both lie beside the ray, on the side that a growing tilt leans to [m].
        angles: By how much the axes of both are turned in the tilting plane, from across to up [rad].
    """

    r_inner: Scalar
    r_outer: Scalar
    height: float = 0.0
    across: tuple[Scalar, Scalar] = (0.0, 0.0)
    angles: tuple[Scalar, Scalar] = (0.0, 0.0)

    def about(self, height: float) -> PairTilt:
        """Return the estimate with distances from a point of the ray above the pivot [m]."""
        if not height:
            return self
        inner, outer = self.r_inner - height, self.r_outer - height
        return replace(self, r_inner=inner, r_outer=outer, height=self.height + height)

    @property
    def radii(self) -> tuple[Scalar, Scalar]:
        """Distances of both from the pivot [m]."""
        return self.r_inner + self.height, self.r_outer + self.height

    @property
    def places(self) -> tuple[tuple[Scalar, Scalar], ...]:
        """Distance along the ray and across of both [m]."""
        return (self.r_inner, self.across[0]), (self.r_outer, self.across[1])

    @cached_property
    def is_radial(self) -> bool:
        """Whether both lie on the ray, with their axes across and along it."""
        return all(type(x) is float and not x for x in (*self.across, *self.angles))

    @property
    def span(self) -> float:
        """Distance of both from each other [m]."""
        return math.hypot(self.r_outer - self.r_inner, self.across[1] - self.across[0])

    @property
    def is_apart(self) -> bool:
        """Whether both are apart, and on a ray in their order."""
        in_order = not self.is_radial or abs(self.r_inner) <= abs(self.r_outer)
        return in_order and self.span >= MIN_SPAN_M

    @cached_property
    def _weights(self) -> tuple[Scalar, Scalar]:
        """Weights of the inner and the outer accelerometer in the combination that is gravity alone."""
        span = self.r_outer - self.r_inner
        return self.r_outer / span, self.r_inner / span

    @cached_property
    def _complex_weights(self) -> tuple[list[Scalar], list[Scalar]]:
        """Weights in gravity, and in K, as parts of complex numbers: inner real, imaginary, outer real, imaginary."""
        (r_inner, c_inner), (r_outer, c_outer) = self.places
        along, beside = r_outer - r_inner, c_outer - c_inner
        square = along * along + beside * beside
        of_gravity, of_slope = [], []
        for r, c, angle in ((r_outer, c_outer, self.angles[0]), (r_inner, c_inner, self.angles[1])):
            real = (along * cos(angle) - beside * sin(angle)) / square
            imaginary = (along * sin(angle) + beside * cos(angle)) / square
            of_slope += [real, imaginary]
            of_gravity += [r * real + c * imaginary, r * imaginary - c * real]
        return of_gravity, of_slope

    def forces(self, across: Scalar, up: Scalar, acceleration: Scalar, rate: Scalar = 0.0) -> list[Scalar]:
        """Specific forces that both show.

        Args:
            across: Gravity, with the acceleration of the point at rest if it moves, across the ray [m/s^2].
            up: The same along the ray [m/s^2].
            acceleration: y1'' [rad/s^2].
            rate: y1' [rad/s].

        Returns:
            Inner x, inner z, outer x, outer z, in the accelerometers' own axes [m/s^2].
        """
        result = []
        for (r, c), angle in zip(self.places, self.angles, strict=True):
            x, z = across + r * acceleration, up - r * rate * rate
            if not self.is_radial:
                x, z = x - c * rate * rate, z - c * acceleration
                x, z = x * cos(angle) + z * sin(angle), z * cos(angle) - x * sin(angle)
            result += [x, z]
        return result

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
        if not self.is_radial:
            a, b, c, d = self._complex_weights[0]
            across = a * inner_x - b * inner_z - c * outer_x + d * outer_z
            return atan2(-across, a * inner_z + b * inner_x - c * outer_z - d * outer_x)
        w_inner, w_outer = self._weights
        return atan2(-(w_inner * inner_x - w_outer * outer_x), w_inner * inner_z - w_outer * outer_z)

    def acceleration(self, inner_x: Scalar, inner_z: Scalar, outer_x: Scalar, outer_z: Scalar) -> Scalar:
        """Angular acceleration of the tilt, y1'' [rad/s^2]: gravity is the same at both places, r alpha is not.

        The arguments are those of a call.
        """
        if not self.is_radial:
            a, b, c, d = self._complex_weights[1]
            return c * outer_x - d * outer_z - a * inner_x + b * inner_z
        return (outer_x - inner_x) / (self.r_outer - self.r_inner)

    def noise(self, sigma: float, gravity: float) -> MeasurementNoise:
        """Return the noise of tilt and angular acceleration, to first order in the noise of the accelerometers.

        Args:
            sigma: Standard deviation of one axis' sample, independent from axis to axis [m/s^2].
            gravity: [m/s^2].

        Returns:
            Of one sample, near upright.
        """
        (r_inner, c_inner), (r_outer, c_outer) = self.places
        span = self.span
        both = math.hypot(r_outer / span, r_inner / span, c_outer / span, c_inner / span)
        correlation = (r_outer / span + r_inner / span) / (math.sqrt(2.0) * both)
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
        at_rest = self.forces(-gravity * math.sin(tilt), gravity * math.cos(tilt), 0.0)
        return self(*response(at_rest)) - tilt


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
