"""A linear plant as matrices: from the gimbals' command to what its sensors show, bending and rigid."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np


class Response(NamedTuple):
    """Answers to a unit of command, held between samples, one a frequency: (n_frequencies,) complex.

    Attributes:
        y1: The tilt where the sensors sit [rad].
        acceleration: Its second derivative [rad/s^2].
        y2: The gimbal angle [rad].
        true_rate: The rate of the part that carries the modules [rad/s].
        gyro: The rate of the part that carries the sensors [rad/s].
    """

    y1: np.ndarray
    acceleration: np.ndarray
    y2: np.ndarray
    true_rate: np.ndarray
    gyro: np.ndarray


class LinearPlant(NamedTuple):
    """x' = A x + B u, and the outputs C x in the order of `Response`.

    Attributes:
        A: State matrix, (n, n).
        B: Input matrix, (n, 1).
        C: Output matrix, (5, n).
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray

    def response(self, frequencies_hz: np.ndarray, dt: float) -> Response:
        """Compute the answers to a command that is sampled and held.

        Args:
            frequencies_hz: Frequencies below half the sample rate, (n_frequencies,) [Hz].
            dt: Sample period [s].
        """
        n = len(self.A)
        F, G = self.hold(dt)
        z = np.exp(2j * np.pi * frequencies_hz * dt)
        states = np.linalg.solve(z[:, None, None] * np.eye(n) - F, np.broadcast_to(G, (len(z), n, 1)))
        return Response(*(self.C @ states)[:, :, 0].T)

    def hold(self, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Advance by a time [s] with the command held: F and G of x+ = F x + G u."""
        from scipy.linalg import expm

        n = len(self.A)
        whole = np.zeros((n + 1, n + 1))
        whole[:n, :n], whole[:n, n:] = self.A, self.B
        whole = expm(whole * dt)
        return whole[:n, :n], whole[:n, n:]

    def lightly_damped(self, ratio: float = 0.3) -> np.ndarray:
        """Find the poles of poorly damped modes, one of each pair, (n_modes,) complex [1/s]."""
        poles = np.linalg.eigvals(self.A)
        return poles[(poles.imag > 1.0) & (np.abs(poles.real) < ratio * np.abs(poles))]


class BendModel(NamedTuple):
    """A plant that bends, linearised.

    Attributes:
        frequency_hz: The mode's frequency, as the scenario asks for it [Hz].
        damping_ratio: The mode's damping ratio.
        bending: The plant.
        rigid: The plant with a rigid frame.
    """

    frequency_hz: float
    damping_ratio: float
    bending: LinearPlant
    rigid: LinearPlant

    @property
    def energy_loss(self) -> float:
        """The share of the mode's energy that its damping takes in a second: 1 - exp(-2 zeta omega)."""
        return -math.expm1(-4.0 * math.pi * self.damping_ratio * self.frequency_hz)


def rk4_energy_loss(frequency_hz: float, step: float) -> float:
    """Compute the share of an undamped mode's energy that RK4 takes in a second.

    With z = omega h, |R(iz)|^2 = 1 - z^6/72 + z^8/576.

    Args:
        frequency_hz: The mode's frequency [Hz].
        step: The physics step h [s].
    """
    z = 2.0 * math.pi * frequency_hz * step
    return -math.expm1(math.log1p(-(z**6) / 72.0 + z**8 / 576.0) / step)
