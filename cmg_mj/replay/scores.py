"""Scores of an estimated rate on a log: against the reference, or, without one, against the tilt."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from cmg_mj.replay.lag import lag
from cmg_mj.replay.logs import Log
from cmg_mj.replay.logs.log import REFERENCE
from cmg_mj.results.stored_columns import LONG, stretches
from cmg_mj.stages.push import inside

RECONSTRUCTED_S = 1.0
"""Length of the stretches over which the estimated rate is integrated [s]."""

Figures = dict[str, float | None]
"""Name -> figure; None where it does not exist."""


def scores(log: Log, rate: np.ndarray, scored: np.ndarray) -> Figures:
    """Compute the figures of one estimate.

    Args:
        log: The log.
        rate: The estimate, (n,) [rad/s].
        scored: Which samples count, (n,).

    Returns:
        The figures by the names that `--json` prints.
    """
    if "reference" in log.has:
        return _against(log, rate, scored)
    return {
        "reconstruction_rms_deg": reconstruction(log, rate, scored),
        "roughness_rad_s": roughness(log, rate, scored),
    }


def _against(log: Log, rate: np.ndarray, scored: np.ndarray) -> Figures:
    true = log[REFERENCE]
    counted = scored & np.isfinite(true)
    error, motion = _error_and_motion(rate, true, counted)
    figures = {
        "velocity_rms_error_rad_s": error,
        "velocity_rms_rad_s": motion,
        "velocity_fit": _fit(error, motion),
        "lag_s": _lag(log, rate, true, scored),
    }
    if log.windows:
        counted &= inside(log["time_s"], log.windows)
        error, motion = _error_and_motion(rate, true, counted)
        figures |= {"velocity_rms_error_push_rad_s": error, "velocity_fit_push": _fit(error, motion)}
    return figures


def _error_and_motion(rate: np.ndarray, true: np.ndarray, counted: np.ndarray) -> tuple[float | None, float | None]:
    error = _rms_of(len(true), lambda rows: (rate[rows] - true[rows])[counted[rows]])
    return error, _rms_of(len(true), lambda rows: true[rows][counted[rows]])


def _lag(log: Log, rate: np.ndarray, true: np.ndarray, scored: np.ndarray) -> float | None:
    """Find the lag of the estimate behind the reference [s]."""
    known = scored & np.isfinite(rate)
    pieces = _pieces(log, scored)
    return lag(
        [_Masked(rate, known, piece) for piece in pieces], [_Masked(true, scored, piece) for piece in pieces], log.dt
    )


@dataclass(frozen=True)
class _Masked:
    """A piece of a signal, NaN where a mask is false."""

    values: np.ndarray
    mask: np.ndarray
    piece: slice

    def __len__(self) -> int:
        return self.piece.stop - self.piece.start

    def __getitem__(self, rows: slice) -> np.ndarray:
        start, stop, _ = rows.indices(len(self))
        rows = slice(self.piece.start + start, self.piece.start + stop)
        return np.where(self.mask[rows], self.values[rows], np.nan)


def reconstruction(log: Log, rate: np.ndarray, scored: np.ndarray) -> float | None:
    """Compute the RMS of the tilt integrated from an estimated rate less the measured tilt.

    The rate is integrated by the trapezoidal rule over `RECONSTRUCTED_S` at a time, each with the constant that fits
    best: the error over a second counts, not what a small offset becomes in an hour.

    Args:
        log: The log.
        rate: The estimate, (n,) [rad/s].
        scored: Which samples count, (n,).

    Returns:
        The error [deg]; None if no stretch is long enough.
    """
    span = max(2, round(RECONSTRUCTED_S / log.dt) + 1)
    errors = []
    for piece in _pieces(log, scored):
        y, r = log["y1_rad"][piece], rate[piece]
        for start in range(0, len(y) - span + 1, span - 1):
            part = slice(start, start + span)
            travelled = np.concatenate([[0.0], np.cumsum(r[part][1:] + r[part][:-1])]) * (log.dt / 2.0)
            error = travelled - y[part]
            errors.append(error - error.mean())
    return _number(math.degrees(_rms(np.concatenate(errors)) or 0.0)) if errors else None


def roughness(log: Log, rate: np.ndarray, scored: np.ndarray) -> float | None:
    """Compute the size of the white noise whose second differences are as large as an estimate's.

    Args:
        log: The log.
        rate: The estimate, (n,) [rad/s].
        scored: Which samples count, (n,).

    Returns:
        RMS of the second differences by sqrt(6) [rad/s].
    """
    second = [np.diff(rate[piece], 2) for piece in _pieces(log, scored)]
    rms = _rms(np.concatenate(second)) if second else None
    return None if rms is None else rms / math.sqrt(6.0)


def noise_gain(
    noisy: Mapping[str, np.ndarray], clean: Mapping[str, np.ndarray], size: float, scored: np.ndarray
) -> float | None:
    """Compute the gain from white noise of the tilt to an estimate.

    Args:
        noisy: The estimates with the noise, (n,) each.
        clean: The estimates without it.
        size: Standard deviation of one sample of the noise [rad].
        scored: Which samples count, (n,).

    Returns:
        RMS of the response, divided by the size [1/s].
    """
    noisy_rate, rate = noisy["x2_rad_s"], clean["x2_rad_s"]
    rms = _rms_of(len(scored), lambda rows: (noisy_rate[rows] - rate[rows])[scored[rows]])
    return None if rms is None or not size > 0.0 else rms / size


def _pieces(log: Log, scored: np.ndarray) -> list[slice]:
    """Return the scored slice of each part."""
    pieces = []
    for part in log.parts:
        counted = np.flatnonzero(scored[part])
        if len(counted):
            pieces.append(slice(part.start + int(counted[0]), part.start + int(counted[-1]) + 1))
    return pieces


def _rms(values: np.ndarray) -> float | None:
    """Return the RMS; None of no values, or if one is not finite."""
    if not len(values):
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        return _number(math.sqrt(float(np.mean(values**2))))


def _rms_of(n_rows: int, values: Callable[[slice], np.ndarray]) -> float | None:
    """Return the RMS of the values that are computed from rows, stretch by stretch."""
    if n_rows <= LONG:
        return _rms(values(slice(0, n_rows)))
    total, count = 0.0, 0
    with np.errstate(over="ignore", invalid="ignore"):
        for rows in stretches(n_rows):
            some = values(rows)
            total, count = total + float(np.sum(some**2)), count + len(some)
    return _number(math.sqrt(total / count)) if count else None


def _fit(error: float | None, motion: float | None) -> float | None:
    """Return 1 - error/motion: 1 for the reference, 0 for an estimate of zero."""
    return _number(1.0 - error / motion) if motion and error is not None else None


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
