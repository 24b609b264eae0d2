"""Checks a pendulum's model against a log: the acceleration that it predicts, beside the tilt's own."""

from __future__ import annotations

import numpy as np

from cmg_mj.observers.reduced_model import ReducedModel
from cmg_mj.replay.logs import Log
from cmg_mj.replay.logs.acceleration_checks import FEWEST, TiltMotion
from cmg_mj.results.stored_columns import select_rows, stretches

RATE_SPAN_S = 0.04
"""Time over which increments of the tilt give the rate in the model's damping term [s]."""
MISFIT = 1.5
"""Misfit from which a model is doubted. Right models have at most 1.15: docs/studies/model_misfit.py."""


def model_misfit(log: Log, model: ReducedModel) -> float | None:
    """Compare the model's tilt acceleration with the tilt's second derivative.

    Both are weighted over stretches of a quarter of a second, as `TiltMotion` does. With the spread s of a set of sums
    (median of the deviations from the median, which neither an offset of the tilt nor pushes move), the misfit is
    s(predicted - measured)/s(measured), by what it is for white noise of the tilt alone. A model that says nothing has
    1, a right one less or, where all is noise, 1 too.

    Args:
        log: The log; without gimbals y2 and u are zero.
        model: The pendulum.

    Returns:
        The misfit; None for too few stretches, or if nothing moves.
    """
    half, differences, measured = 0, [], []
    for part in log.parts:
        for some in stretches(part.stop - part.start):
            columns = select_rows(log.columns, slice(part.start + some.start, part.start + some.stop))
            tilt = columns["y1_rad"]
            m = max(1, round(RATE_SPAN_S / 2.0 / log.dt))
            rate = np.zeros(len(tilt))
            rate[m:-m] = (tilt[2 * m :] - tilt[: -2 * m]) / (2 * m * log.dt)
            predicted = model.tilt_acceleration(tilt, rate, columns["y2_rad"], columns["u_rad_s"])
            motion = TiltMotion(tilt, np.broadcast_to(predicted, tilt.shape), [slice(0, len(tilt))], log.dt)
            pairs = motion.weighted_sums()
            differences.append(pairs[0] - pairs[1])
            measured.append(pairs[1])
            half = motion.half
    difference, second = np.concatenate(differences), np.concatenate(measured)
    size = _spread(second)
    if len(second) < FEWEST or not size > 0.0:
        return None
    return _spread(difference) / size / _of_noise(half, log.dt, model.gravity_torque / model.J1)


def _spread(values: np.ndarray) -> float:
    return float(np.median(np.abs(values - np.median(values)))) if len(values) else 0.0


def _of_noise(half: int, dt: float, stiffness: float) -> float:
    """Return s(stiffness y - y'')/s(y'') for white noise y, by the weights over it [no unit]."""
    weights, second = TiltMotion.weights(half, dt)
    return float(np.linalg.norm(stiffness * weights - second) / np.linalg.norm(second))


def model_remark(misfit: float | None) -> str | None:
    """Doubt a model, or say nothing."""
    if misfit is None or not misfit > MISFIT:
        return None
    times = f"{misfit:.1f}" if misfit < 100.0 else f"{misfit:.0f}"
    return (
        f"Can the model be that of this log? The tilt acceleration that it predicts misses the tilt's own by {times} "
        f"times as much as one of zero would (of right models at most 1.15): look at --model, the tilt's unit, "
        "sign and zero, or for large torques that the model does not know. Estimates of observers with a model mean "
        "little here."
    )
