"""WIP."""

from __future__ import annotations

import math
import sys, time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy.special import log_ndtr

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.core.types import Estimate, Measurement

TILT, RATE, GIMBAL, TURN, TORQUE, OFFSET, PIVOT = range(7)
DIFFERENCE = 1e-6


@dataclass(frozen=True)
class GimbalGyro:
    needs: ClassVar[tuple[str, ...]] = ("model", "gimbals", "acceleration")

    dt: float
    model: ReducedModel
    noise: MeasurementNoise
    stiffness: float = 85.6
    damping: float = 0.731
    inertia: float = 1.56e-3
    count: float = 2.0 * math.pi / 4096
    torque_walk: float = 0.01
    torque_start: float = 0.2
    offset_start: float = 0.35
    turn_white: float = 1e-3
    gate: float = 9.0
    pivot: float = 0.0
    pivot_hz: float = 5.0
    interval: bool = True
    blind: bool = False

    def init(self, y: Measurement) -> Any:
        zero = 0.0 * np.asarray(y.y1)
        x = np.stack([y.y1 + zero, zero, y.y2 + zero, zero, zero, zero, zero], axis=-1)
        start = [self.noise.tilt, 0.02, 1e-6, 1e-6, self.torque_start, self.offset_start, self.pivot]
        return x, np.diag(np.square(start)) + zero[..., None, None], y.y2 + zero

    def step(self, state: Any, y: Measurement, u: Any) -> tuple[Any, Estimate]:
        x, P, setpoint = state
        x, P = self._predicted(x, P, setpoint, u)
        setpoint = setpoint + self.dt * u
        x, P = self._accelerometers(x, P, setpoint, y)
        if not self.blind:
            x, P = self._encoder(x, P, y.y2)
        return (x, P, setpoint), Estimate(*(x[..., i] for i in (TILT, RATE, GIMBAL)))

    def _slope(self, x, setpoint):
        m = self.model
        x1, x2, x3, turn, torque, _, pivot = np.moveaxis(x, -1, 0)
        s, c = np.sin(x3), np.cos(x3)
        H = m.J_d * m.omega_d
        D = m.J1 + m.J2 * s * s
        tilting = (m.gravity_torque * np.sin(x1 - pivot) + torque / m.gimbals + turn * (H * c - 2 * m.J2 * s * c * x2)) / D
        turning = (self.stiffness * (setpoint - x3) - self.damping * turn - H * c * x2 + m.J2 * s * c * x2 * x2) / self.inertia
        zero = 0.0 * x1
        return np.stack([x2, tilting, turn, turning, zero, zero, -2.0 * math.pi * self.pivot_hz * pivot], axis=-1)

    def _predicted(self, x, P, setpoint, u):
        h, points, s = self.dt, _around(x), np.asarray(setpoint)[..., None]
        ds = h * np.asarray(u)[..., None]
        k1 = self._slope(points, s)
        k2 = self._slope(points + 0.5 * h * k1, s + 0.5 * ds)
        k3 = self._slope(points + 0.5 * h * k2, s + 0.5 * ds)
        k4 = self._slope(points + h * k3, s + ds)
        x, F = _split(points + h / 6.0 * (k1 + 2 * k2 + 2 * k3 + k4))
        white = [0.0, 0.0, 0.0, self.turn_white, self.torque_walk, 0.01, self.pivot * math.sqrt(4.0 * math.pi * self.pivot_hz)]
        return x, F @ P @ np.swapaxes(F, -1, -2) + np.diag(np.square(white)) * h

    def _accelerometers(self, x, P, setpoint, y):
        n = self.noise
        alpha, C = _split(self._slope(_around(x), np.asarray(setpoint)[..., None])[..., RATE, None])
        C = C[..., 0, :]
        C[..., OFFSET] = 1.0
        e = y.acceleration - alpha[..., 0] - x[..., OFFSET]
        ee = _spread(P, C) + n.acceleration**2
        P = P.copy()
        P[..., TORQUE, TORQUE] += np.where(e * e > self.gate * ee, e * e - ee, 0.0) / C[..., TORQUE] ** 2
        before = x
        x, P = _corrected(x, P, C, e, n.acceleration**2)
        c = n.correlation * n.tilt / n.acceleration
        tilt = np.zeros(7)
        tilt[[TILT, PIVOT]] = 1.0, -1.0
        C = tilt - c * C
        e = y.y1 - before @ tilt - c * e - np.einsum("...i,...i", C, x - before)
        return _corrected(x, P, C, e, n.tilt**2 * (1.0 - n.correlation**2))

    def _encoder(self, x, P, y2):
        mean, variance = x[..., GIMBAL], P[..., GIMBAL, GIMBAL]
        if not self.interval:
            C = np.zeros(7); C[GIMBAL] = 1.0
            return _corrected(x, P, C, y2 - mean, self.count**2 / 12.0)
        sigma = np.sqrt(variance)
        low, high = (y2 - 0.5 * self.count - mean) / sigma, (y2 + 0.5 * self.count - mean) / sigma
        moved, left = truncated(low, high)
        gain = P[..., GIMBAL] / sigma[..., None]
        return x + gain * moved[..., None], P - gain[..., None] * gain[..., None, :] * (1.0 - left)[..., None, None]


def truncated(low, high):
    """Mean and variance of a standard normal between two limits."""
    flip = low + high > 0.0  # work in the left tail
    a, b = np.where(flip, -high, low), np.where(flip, -low, high)
    la, lb = log_ndtr(a), log_ndtr(b)
    log_mass = lb + np.log1p(-np.exp(la - lb))
    pa, pb = (np.exp(-0.5 * t * t - log_mass) / math.sqrt(2.0 * math.pi) for t in (a, b))
    mean = pa - pb
    variance = np.clip(1.0 + np.where(np.isfinite(a), a * pa, 0) - b * pb - mean * mean, 1e-6, 1.0)
    return np.where(flip, -mean, mean), variance


def _around(x):
    return np.concatenate([x[..., None, :], x[..., None, :] + DIFFERENCE * np.eye(x.shape[-1])], axis=-2)


def _split(points):
    """value and Jacobian."""
    return points[..., 0, :], np.swapaxes(points[..., 1:, :] - points[..., :1, :], -1, -2) / DIFFERENCE


def _spread(P, C):
    return np.einsum("...i,...ij,...j", C, P, C)


def _corrected(x, P, C, e, variance):
    column = np.einsum("...ij,...j->...i", P, C)
    ee = np.einsum("...i,...i", column, np.broadcast_to(C, column.shape)) + variance
    K = column / ee[..., None]
    P = P - K[..., None] * column[..., None, :]
    return x + K * e[..., None], 0.5 * (P + np.swapaxes(P, -1, -2))


if __name__ == "__main__":
    from cmg_mj.runs.experiment import prepare
    from cmg_mj.scenario.loading import load_scenario
    t0 = time.time()
    ex = prepare(load_scenario("push_recovery", sys.argv[1:], "gimbal_gyro:GimbalGyro"))
    r = ex.run_many(20)
    E = "velocity_rms_error_rad_s"
    print(r.mean(E), r.mean("velocity_rms_error_push_rad_s"), r.stood.sum(), {k: r.mean(E, k) for k in ("gyro_free", "zero", "floor_accel", "mems_fused")}, time.time() - t0)
