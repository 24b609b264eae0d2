"""The transfer of the loop around a frame that bends, as the scenario's own law and observer make it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.core.types import Measurement, feedback_state
from cmg_mj.elementwise import Scalar
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.linear_plant import BendModel, Response
from cmg_mj.stages.notch import Notch

AMPLITUDE_RAD_S = 0.05
"""Amplitude of the tilt rate at the sensors: observers that are not linear answer to sizes."""
AMPLITUDE_RAD = 0.2
"""Largest amplitude of the gimbals' angle."""
TRIAL_S = 6.0
"""Duration of a trial at each frequency; its last half counts."""
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
    def distance(self) -> float:
        """The least distance of the transfer from -1."""
        return float(np.min(np.abs(1.0 + self.transfer)))

    @property
    def rigid_distance(self) -> float:
        """The least distance from -1 with a rigid frame."""
        return float(np.min(np.abs(1.0 + self.rigid)))


def bent_loop(design: Design, bend: BendModel) -> BentLoop | None:
    """Try a scenario's law and observer at many frequencies, on what the sensors of a plant that bends show.

    Sensors are perfect but for their latency: no noise, no quantisation, a sample a control period.

    Args:
        design: The law and the observers.
        bend: The plant.

    Returns:
        The loop, which says nothing of stability: `bend_decay` does. An observer that is not linear counts with its
        answer at the frequency it is tried at, with a rate of `AMPLITUDE_RAD_S`. None where the control rate is too
        low for any frequency, or the answers are not finite.
    """
    dt = design.law.dt
    around = bend.bending.lightly_damped()
    frequencies = _frequencies(around, LOWEST_HZ, HIGHEST_SHARE / dt)
    if not len(frequencies):
        return None
    twice = np.tile(frequencies, 2)
    answers = [plant.response(frequencies, dt) for plant in (bend.bending, bend.rigid)]
    transfer = _transfer(design, Response(*map(np.concatenate, zip(*answers, strict=True))), twice, dt)
    known = np.isfinite(transfer).reshape(2, -1).all(axis=0)
    return BentLoop(frequencies[known], *transfer.reshape(2, -1)[:, known]) if known.any() else None


def _frequencies(poles: np.ndarray, low: float, high: float) -> np.ndarray:
    """Space frequencies from low to high, close together around poorly damped modes."""
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
    steps = round(TRIAL_S / dt)
    turn = np.exp(2j * np.pi * frequencies * dt)
    now = size.astype(complex)
    outputs, inputs = np.empty((steps, len(frequencies))), np.empty((steps, len(frequencies)), complex)
    with np.errstate(all="ignore"):
        y = _measurement(now, y1, y2, acceleration)
        held: Scalar = 0.0 * y.y1
        state, law_state = observer.init(y), law.init(y)
        estimate: Sequence[Scalar] = (y.y1, held, y.y2)
        for k in range(steps):
            if k:
                y = _measurement(now, y1, y2, acceleration)
                state, estimate = observer.step(state, y, held)
            x1, x2, x3 = (y.y1, estimate[1], y.y2) if settings.angle_source == "measured" else estimate[:3]
            if settings.feedback != "observer":
                x2 = np.real(now * rates[settings.feedback])
            law_state, u = law.step(law_state, y, feedback_state(x1, x2, x3, tuple(estimate[3:])), held)
            outputs[k], inputs[k] = u if notch is None else notch(u), now
            held, now = np.real(now), now * turn
    return -_fit(outputs[steps // 2 :], inputs[steps // 2 :])


def _measurement(now: np.ndarray, y1: np.ndarray, y2: np.ndarray, acceleration: np.ndarray) -> Measurement:
    """Return the measurement while the command is the real part of `now`."""
    return Measurement(*(np.real(now * answer) for answer in (y1, y2, acceleration)))


def _fit(outputs: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """Fit Re(g input) and a constant to what was answered, least squares, a frequency each: g, (n_frequencies,)."""
    basis = np.stack([np.real(inputs), -np.imag(inputs), np.ones_like(outputs)], axis=-1).transpose(1, 0, 2)
    square = basis.transpose(0, 2, 1) @ basis
    real, imaginary, _ = np.linalg.solve(square, basis.transpose(0, 2, 1) @ outputs.T[:, :, None])[:, :, 0].T
    return real + 1j * imaginary
