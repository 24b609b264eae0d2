"""The loop of a rig that bends: its transfer as the scenario's own law and observer make it, and its margins."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.controllers.laws.protocol import feedback_state
from cmg_mj.controllers.notch import Notch
from cmg_mj.elementwise import Scalar
from cmg_mj.observers.protocol import Measurement
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.linear_rig import BendModel, Response

AMPLITUDE_RAD_S = 0.05
"""Rate with which the loop is tried where the sensors sit: observers that are not linear answer to sizes."""
AMPLITUDE_RAD = 0.2
"""The gimbals' angle with which it is tried, at most."""
TRIED_S = 6.0
"""So long the controller is tried at each frequency; the last half counts."""
SENSORS_USED = ("accelerometer", "encoder", "fog")
LOWEST_HZ = 0.5
HIGHEST_SHARE = 0.48
"""The frequencies go from the lowest to this share of the control rate."""


class BentLoop(NamedTuple):
    """The transfer of the loop, opened at the command: the law's answer, turned in sign, to its own command.

    Attributes:
        frequencies_hz: (n_frequencies,).
        transfer: With the bend, (n_frequencies,) complex.
        rigid: With a rigid frame.
    """

    frequencies_hz: np.ndarray
    transfer: np.ndarray
    rigid: np.ndarray

    @property
    def is_stable(self) -> bool:
        """Whether the bend leaves a stable loop stable: 1 + L turns round as often as it does with a rigid frame."""
        turns = np.unwrap(np.angle((1.0 + self.transfer) / (1.0 + self.rigid)))
        return abs(float(turns[-1] - turns[0])) < math.pi

    @property
    def distance(self) -> float:
        """The least distance of the transfer from -1."""
        return float(np.min(np.abs(1.0 + self.transfer)))

    @property
    def rigid_distance(self) -> float:
        """The same with a rigid frame."""
        return float(np.min(np.abs(1.0 + self.rigid)))


def bent_loop(design: Design, bend: BendModel) -> BentLoop:
    """Try a scenario's law and observer at many frequencies, on what the sensors of a rig that bends show.

    Sensors are perfect but for their latency: no noise, no quantisation, a sample a control period.

    Args:
        design: The law and the observers.
        bend: The rig.

    Returns:
        The loop. Of an observer that is not linear it is that of its answer at the frequency it is tried at, with a
        rate of `AMPLITUDE_RAD_S`.
    """
    dt = design.law.dt
    around = bend.bending.lightly_damped()
    frequencies = _frequencies(around, LOWEST_HZ, HIGHEST_SHARE / dt)
    twice = np.tile(frequencies, 2)
    answers = [rig.response(frequencies, dt) for rig in (bend.bending, bend.rigid)]
    transfer = _transfer(design, Response(*map(np.concatenate, zip(*answers, strict=True))), twice, dt)
    known = np.isfinite(transfer).reshape(2, -1).all(axis=0)
    return BentLoop(frequencies[known], *transfer.reshape(2, -1)[:, known])


def _frequencies(poles: np.ndarray, low: float, high: float) -> np.ndarray:
    """From low to high, close together around poorly damped modes."""
    spread = np.sinh(np.linspace(-6.0, 6.0, 41)) / math.sinh(6.0)
    near = [(pole.imag + 0.3 * abs(pole) * spread) / (2.0 * math.pi) for pole in poles]
    frequencies = np.unique(np.concatenate([np.geomspace(low, high, 80), *near]))
    return frequencies[(frequencies >= low) & (frequencies <= high)]


def _transfer(design: Design, answers: Response, frequencies: np.ndarray, dt: float) -> np.ndarray:
    """Return -(answer)/(command) at each frequency, a world each, (n_frequencies,) complex."""
    settings, sensors = design.scenario.controller, design.scenario.sensors
    size = np.minimum(AMPLITUDE_RAD_S / np.abs(answers.gyro), AMPLITUDE_RAD / np.abs(answers.y2))
    late = {name: np.exp(-2j * np.pi * frequencies * getattr(sensors, name).latency_s) for name in SENSORS_USED}
    y1, acceleration = answers.y1 * late["accelerometer"], answers.acceleration * late["accelerometer"]
    y2 = answers.y2 * late["encoder"]
    rates = {"fog": answers.gyro * late["fog"], "truth": answers.true_rate}
    observer, law = design.observer(), design.fresh_law()
    notch = Notch(settings.notch_hz, dt, math.inf) if settings.notch_hz else None
    steps = round(TRIED_S / dt)
    turn = np.exp(2j * np.pi * frequencies * dt)
    now = size.astype(complex)
    outputs, inputs = np.empty((steps, len(frequencies))), np.empty((steps, len(frequencies)), complex)
    with np.errstate(all="ignore"):
        y = _shown(now, y1, y2, acceleration)
        held: Scalar = 0.0 * y.y1
        state, law_state = observer.init(y), law.init(y)
        estimate: Sequence[Scalar] = (y.y1, held, y.y2)
        for k in range(steps):
            if k:
                y = _shown(now, y1, y2, acceleration)
                state, estimate = observer.step(state, y, held)
            x1, x2, x3 = (y.y1, estimate[1], y.y2) if settings.angle_source == "measured" else estimate[:3]
            if settings.feedback != "observer":
                x2 = np.real(now * rates[settings.feedback])
            law_state, u = law.step(law_state, y, feedback_state(x1, x2, x3, tuple(estimate[3:])), held)
            outputs[k], inputs[k] = u if notch is None else notch(u), now
            held, now = np.real(now), now * turn
    return -_fitted(outputs[steps // 2 :], inputs[steps // 2 :])


def _shown(now: np.ndarray, y1: np.ndarray, y2: np.ndarray, acceleration: np.ndarray) -> Measurement:
    """The measurement while the command is the real part of `now`."""
    return Measurement(*(np.real(now * answer) for answer in (y1, y2, acceleration)))


def _fitted(outputs: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """Fit Re(g input) and a constant to what was answered, least squares, a frequency each: g, (n_frequencies,)."""
    basis = np.stack([np.real(inputs), -np.imag(inputs), np.ones_like(outputs)], axis=-1).transpose(1, 0, 2)
    square = basis.transpose(0, 2, 1) @ basis
    real, imaginary, _ = np.linalg.solve(square, basis.transpose(0, 2, 1) @ outputs.T[:, :, None])[:, :, 0].T
    return real + 1j * imaginary
