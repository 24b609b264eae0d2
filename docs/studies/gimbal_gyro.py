"""The gimbals' encoders as a rate gyro: a filter of all signals that knows the servo, and what makes it useless.

    python docs/studies/gimbal_gyro.py [--worlds 20] [--parts loop,friction,wrong]

About five minutes. push_recovery, each observer in a loop of its own, in the same worlds.

The frame's rate x2 makes a gyroscopic torque -h cos(x3) x2 on a gimbal, h = J_d omega_d. A servo of stiffness kp gives
way by h x2/kp, on the bundled rig 4 mrad per rad/s; a count of its encoder is 1.5 mrad. `GimbalGyro` knows the servo
and the command, so that it knows the gimbal's angle to a part of a count, and each count tells on which side of an edge
the angle is. Parts:

- loop: the filter beside others, by the encoders' counts, and where the pivot moves (the filter is told how strongly);
  `floor_all`, the least error of a *linear* filter of the same signals, to which y2 is white noise. The interval of a
  count says more than its variance: the filter is below that floor.
- friction: dry friction of the gimbals, which the filter does not know, or whose size it is told.
- wrong: a wrong model, servo or momentum.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy.linalg import solve_discrete_are
from scipy.special import log_ndtr

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.core.types import STANDARD_GRAVITY, Estimate, Measurement
from cmg_mj.observers.gyro_free import GyroFree
from cmg_mj.results.floors import acceleration_floor
from cmg_mj.results.intervals import mean_interval
from cmg_mj.results.tables import markdown_table
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario

TILT, RATE, GIMBAL, TURN, TORQUE, OFFSET, DRAG, PIVOT, SWAY = range(9)
"""The state: x1 as y1 shows it, x2, x3 and x3'; the torque on the rig with that of e; the acceleration's offset; the
torque on a gimbal; the pivot's share of y1 and its rate."""
NUDGE = 1e-6
"""Steps of the parts of the state, for slopes."""
W = 2.0 * math.pi * 5.0
"""Corner of the pivot's motion, and of the torque on a gimbal [rad/s]."""
TORQUE_START, TORQUE_WALK = 0.2, 0.01
"""Standard deviation of the torque on the rig at the start, and of its change in a second [N m]."""
GATE = 3.0
"""Standard deviations of the acceleration from what is expected, beyond which it is a push."""


@dataclass(frozen=True)
class GimbalGyro:
    """An extended Kalman filter of y1, the acceleration, y2 and u, with the servo in its model.

    A count of y2 says in which interval x3 is: the estimate becomes the mean of the normal distribution cut to it. A
    push is found by the acceleration: if this is off by more than `GATE` allows, the torque may have changed by as much
    (its variance grows by the square of that, less what was expected).

    Attributes:
        dt: Sample period, and the physics step: the model takes the same RK4 step [s].
        model: The reduced model.
        noise: Of tilt and acceleration.
        stiffness, damping: Of the servo [N m/rad, N m s/rad].
        inertia: Of gimbal and flywheel about the gimbal's axis [kg m^2].
        count: Of the encoder [rad].
        y2: `interval`, `white` noise, or `blind` to it.
        drag: Standard deviation of the torque on a gimbal that the model lacks, such as friction [N m].
        pivot: Standard deviation of the pivot's acceleration over g.
        tilt_inertia, momentum: Factors on the model's J1 and h, to make the filter wrong.
    """

    needs: ClassVar[tuple[str, ...]] = ("model", "gimbals", "acceleration")

    dt: float
    model: ReducedModel
    noise: MeasurementNoise
    stiffness: float = 85.6
    damping: float = 0.731
    inertia: float = 1.56e-3
    count: float = 2.0 * math.pi / 4096.0
    y2: str = "interval"
    drag: float = 0.0
    pivot: float = 0.0
    tilt_inertia: float = 1.0
    momentum: float = 1.0

    def init(self, y: Measurement) -> Any:
        """Start at rest at the measured tilt, the gimbals where their encoders show them, as the servos do."""
        zero = 0.0 * np.asarray(y.y1)
        x = np.stack([y.y1 + zero, zero, y.y2 + zero, *[zero] * 6], axis=-1)
        offset = GyroFree.bias_start
        known = [self.noise.tilt, 0.02, 1e-6, 1e-6, TORQUE_START, offset, self.drag, self.pivot, W * self.pivot]
        return x, np.diag(np.square(known)) + zero[..., None, None], y.y2 + zero

    def step(self, state: Any, y: Measurement, u: Any) -> tuple[Any, Estimate]:
        """Advance by one sample period."""
        x, P, setpoint = state
        x, P = self._predicted(x, P, setpoint, u)
        setpoint = setpoint + self.dt * u
        x, P = self._by_accelerometers(x, P, setpoint, y)
        if self.y2 != "blind":
            x, P = self._by_encoder(x, P, y.y2)
        return (x, P, setpoint), Estimate(x[..., TILT], x[..., RATE], x[..., GIMBAL])

    def slope(self, x: np.ndarray, setpoint: np.ndarray) -> np.ndarray:
        """Return x', (..., 9), at the servo's setpoint [rad]."""
        m, h = self.model, self.momentum * self.model.J_d * self.model.omega_d
        x1, x2, x3, turn, torque, offset, drag, pivot, sway = np.moveaxis(x, -1, 0)
        s, c = np.sin(x3), np.cos(x3)
        D = self.tilt_inertia * m.J1 + m.J2 * s * s
        tilting = m.gravity_torque * np.sin(x1 - pivot) + torque / m.gimbals + turn * c * (h - 2.0 * m.J2 * s * x2)
        servo = self.stiffness * (setpoint - x3) - self.damping * turn
        turning = servo - c * x2 * (h - m.J2 * s * x2) + drag
        swaying = -W * W * pivot - math.sqrt(2.0) * W * sway
        zero = 0.0 * offset
        return np.stack([x2, tilting / D, turn, turning / self.inertia, zero, zero, -W * drag, sway, swaying], axis=-1)

    def moved(self, x: np.ndarray, setpoint: Any, u: Any) -> np.ndarray:
        """Return x a sample period later, by the step of the physics."""
        h, s, ds = self.dt, np.asarray(setpoint)[..., None], self.dt * np.asarray(u)[..., None]
        k1 = self.slope(x, s)
        k2 = self.slope(x + 0.5 * h * k1, s + 0.5 * ds)
        k3 = self.slope(x + 0.5 * h * k2, s + 0.5 * ds)
        k4 = self.slope(x + h * k3, s + ds)
        return x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)

    def _predicted(self, x: np.ndarray, P: np.ndarray, setpoint: Any, u: Any) -> tuple[np.ndarray, np.ndarray]:
        x, F = _slopes(self.moved(_nudged(x), setpoint, u))
        white = np.zeros(9)
        white[TURN] = 1e-3  # keeps x3 uncertain by a thousandth of a count
        white[TORQUE], white[OFFSET] = TORQUE_WALK, GyroFree.bias_walk
        white[DRAG], white[SWAY] = self.drag * math.sqrt(2.0 * W), self.pivot * math.sqrt(math.sqrt(8.0) * W**3)
        return x, F @ P @ np.swapaxes(F, -1, -2) + np.diag(np.square(white)) * self.dt

    def _by_accelerometers(
        self, x: np.ndarray, P: np.ndarray, setpoint: Any, y: Measurement
    ) -> tuple[np.ndarray, np.ndarray]:
        """Bring in the acceleration, then y1 less what it shares of the acceleration's noise."""
        n, expected, (C, C1) = self.noise, *self.shown(x, setpoint)
        e, e1 = y.acceleration - expected[..., 0], y.y1 - expected[..., 1]
        ee = np.einsum("...i,...ij,...j", C, P, C) + n.acceleration**2
        P = P.copy()
        P[..., TORQUE, TORQUE] += np.where(e * e > GATE**2 * ee, e * e - ee, 0.0) / C[..., TORQUE] ** 2
        before, share = x, n.correlation * n.tilt / n.acceleration
        x, P = _corrected(x, P, C, e, n.acceleration**2)
        C1 = C1 - share * C
        e1 = e1 - share * e - np.einsum("...i,...i", C1, x - before)
        return _corrected(x, P, C1, e1, n.tilt**2 * (1.0 - n.correlation**2))

    def shown(self, x: np.ndarray, setpoint: Any) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
        """Return acceleration and y1 without noise, (..., 2), and their slopes, (..., 9) each."""
        points = _nudged(x)
        acceleration = self.slope(points, np.asarray(setpoint)[..., None])[..., RATE] + points[..., OFFSET]
        value, C = _slopes(np.stack([acceleration, points[..., TILT] - points[..., PIVOT]], axis=-1))
        return value, (C[..., 0, :], C[..., 1, :])

    def _by_encoder(self, x: np.ndarray, P: np.ndarray, y2: Any) -> tuple[np.ndarray, np.ndarray]:
        off = y2 - x[..., GIMBAL]
        if self.y2 == "white":
            return _corrected(x, P, np.eye(9)[GIMBAL], off, self.count**2 / 12.0)
        sigma, half = np.sqrt(P[..., GIMBAL, GIMBAL]), 0.5 * self.count
        mean, variance = truncated((off - half) / sigma, (off + half) / sigma)
        gain = P[..., GIMBAL] / sigma[..., None]
        return x + gain * mean[..., None], P - gain[..., None] * gain[..., None, :] * (1.0 - variance)[..., None, None]


def truncated(low: Any, high: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and variance of a standard normal number that is known to lie between two limits."""
    flip = low + high > 0.0  # in the left tail the logarithms are exact
    a, b = np.where(flip, -high, low), np.where(flip, -low, high)
    log_a, log_b = log_ndtr(a), log_ndtr(b)
    log_mass = log_b + np.log1p(-np.exp(log_a - log_b))
    at_a, at_b = (np.exp(-0.5 * limit**2 - log_mass) / math.sqrt(2.0 * math.pi) for limit in (a, b))
    mean = at_a - at_b
    variance = 1.0 + a * at_a - b * at_b - mean**2
    return np.where(flip, -mean, mean), np.clip(variance, 1e-6, 1.0)


def _nudged(x: np.ndarray) -> np.ndarray:
    """Return x and, in nine more rows, x with each part nudged."""
    return x[..., None, :] + np.vstack([np.zeros(9), NUDGE * np.eye(9)])


def _slopes(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a function's value at x and its slopes, from its values at the rows of `_nudged`."""
    return values[..., 0, :], np.swapaxes(values[..., 1:, :] - values[..., :1, :], -1, -2) / NUDGE


def _corrected(x: np.ndarray, P: np.ndarray, C: np.ndarray, e: Any, variance: float) -> tuple[np.ndarray, np.ndarray]:
    """Bring in a measured number that is off by e."""
    column = np.einsum("...ij,...j->...i", P, C)
    gain = column / (np.sum(column * C, axis=-1, keepdims=True) + variance)
    P = P - gain[..., None] * column[..., None, :]
    return x + gain * e[..., None], 0.5 * (P + np.swapaxes(P, -1, -2))


def floor_all(of: GimbalGyro) -> float:
    """Return the least error of a linear filter that knows all but the noise, to which y2 is white noise [rad/s].

    It bounds no filter that takes y2 as an interval.
    """
    x, still, n = np.zeros(9), np.zeros(()), of.noise
    _, F = _slopes(of.moved(_nudged(x), still, still))
    both = n.correlation * n.tilt * n.acceleration
    R = np.diag([n.acceleration**2, n.tilt**2, of.count**2 / 12.0])
    R[0, 1] = R[1, 0] = both
    known = slice(0, 4)  # no push, no offset, no friction, a pivot at rest
    C = np.vstack([*of.shown(x, still)[1], np.eye(9)[GIMBAL]])[:, known]
    P = solve_discrete_are(F[known, known].T, C.T, np.zeros((4, 4)), R)
    return math.sqrt((P - P @ C.T @ np.linalg.solve(C @ P @ C.T + R, C @ P))[RATE, RATE])


OURS = "gimbal_gyro:GimbalGyro"
ERRORS = ("velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s")
HEADINGS = ["", "in the loop", "error [rad/s]", "in push window [rad/s]", "zero [rad/s]", "fell"]


def experiment(observer: str, *settings: str) -> Experiment:
    """Push recovery with an observer in the loop."""
    return prepare(load_scenario("push_recovery", settings, observer))


def row(label: str, observer: str, worlds: int, *settings: str) -> list[str]:
    """Run worlds; return a row of a table."""
    result = experiment(observer, *settings).run_many(worlds, keep_trajectory=False)
    stood = int(result.stood.sum())
    ends = [mean_interval(result.values(key)[result.stood]) if stood > 1 else None for key in ERRORS]
    figures = ["-" if end is None else f"{end.mean:.4f} ± {end.half:.4f}" for end in ends]
    zero = result.mean(ERRORS[0], "zero")
    figures.append("-" if zero is None else f"{zero:.4f}")
    said = [setting.removeprefix("observer.") for setting in settings if setting.startswith("observer.")]
    return [label, ", ".join([observer.removeprefix("gimbal_gyro:"), *said]), *figures, f"{worlds - stood} of {worlds}"]


def show(title: str, rows: Sequence[Sequence[str]]) -> None:
    """Print a table."""
    print(f"\n{title}\n\n{markdown_table(HEADINGS, rows, text_columns=2)}", flush=True)


def loop(worlds: int) -> None:
    """Print the filter beside others, by counts, and where the pivot moves."""
    rows = [row("as it is", name, worlds) for name in ("gyro_free", OURS)]
    rows += [row("as it is", OURS, worlds, f'observer.y2="{kind}"') for kind in ("white", "blind")]
    dt, model, noise = experiment("gyro_free").design.constructor_arguments
    bounds = [("any counts", "floor_accel", acceleration_floor(noise, dt))]
    for counts in (4096, 16384, 65536):
        label, count = f"{counts} counts", 2.0 * math.pi / counts
        finer = f"sensors.encoder.counts_per_revolution={counts}", f"observer.count={count:.4g}"
        rows.append(row(label, OURS, worlds, *finer))
        bounds.append((label, "floor_all", floor_all(GimbalGyro(dt, model, noise, count=count))))
    rows += [[label, f"`{name}`", f"{least:.4f}", *3 * "-"] for label, name, least in bounds]
    moving = 'pivot=[{kind="noise", acceleration_m_s2=0.5, corner_hz=5.0}]'
    told = f"observer.pivot={0.5 / STANDARD_GRAVITY:.4f}"
    rows += [row("pivot 0.5 m/s2 to 5 Hz", name, worlds, moving) for name in ("gyro_free", "free_pivot")]
    rows.append(row("pivot 0.5 m/s2 to 5 Hz", OURS, worlds, moving, told))
    show("The filter beside others", rows)


def friction(worlds: int) -> None:
    """Print the filter by the friction of the gimbals."""
    rows = []
    for torque in (0.0, 0.005, 0.02, 0.1):
        rough, label = f"plant.gimbal_friction_n_m={torque}", f"{torque:g} N m"
        rows.append(row(label, "gyro_free", worlds, rough))
        rows.append(row(label, OURS, worlds, rough))
        rows.append(row(label, OURS, worlds, rough, f"observer.drag={max(torque, 0.005)}"))
    show("Dry friction of the gimbals", rows)


def wrong(worlds: int) -> None:
    """Print the filter with a wrong model."""
    changes = {
        "J1 10 % too large": "tilt_inertia=1.1",
        "J1 10 % too small": "tilt_inertia=0.9",
        "h 5 % too large": "momentum=1.05",
        "kp 5 % too large": "stiffness=89.9",
        "kp 20 % too large": "stiffness=102.7",
    }
    rows = [
        row(label, OURS, worlds, f"observer.{change}", f"observer.drag={drag}")
        for label, change in changes.items()
        for drag in (0.0, 0.02)
    ]
    show("A wrong model", rows)


def main() -> None:
    """Print the parts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=20)
    parser.add_argument("--parts", default="loop,friction,wrong")
    options = parser.parse_args()
    parts = {"loop": loop, "friction": friction, "wrong": wrong}
    for name in options.parts.split(","):
        parts[name](options.worlds)


if __name__ == "__main__":
    main()
