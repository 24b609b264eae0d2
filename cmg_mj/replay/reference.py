"""Remarks on a log and its reference, in replays and in tuning."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cmg_mj.replay.alignment import Alignment, alignment
from cmg_mj.replay.logs import Log
from cmg_mj.replay.logs.log import REFERENCE
from cmg_mj.replay.logs.units import in_si
from cmg_mj.replay.logs.white_noise import WhiteNoise
from cmg_mj.replay.user_noise import noise_in

OFF = 0.005
"""Deviation of the reference's scale from 1, or its offset by its RMS, from which it matters, if it is significant."""
NEAR = 0.05
"""Largest such deviation at which a reference that correlates less than `AGREES` still agrees."""
SURE = 2.365
"""Standard errors of a 95 % interval: Student's, of the seven degrees of freedom of eight stretches."""
CLEAR = 4.03
"""Standard errors of a 99.5 % interval, which a deviation leaves that is reported: one of 20 faultless logs would leave
the other."""
NOISE = 1.2
"""Ratio up to which the rest of the tilt is its white noise."""
LATE = 0.1
"""Lag from which it is reported, in periods of the log's rows or its samples, the longer of the two."""
NOTHING = 0.001
"""An offset that with its interval is below this share of the reference's RMS is not mentioned."""
MOST_DECIMALS = 6
"""Most decimals of an interval; a narrower one is not mentioned."""
FINE = 0.01
"""Step in which a delay is offered, at most, in the same periods."""
ALIKE = 0.5
"""Correlation below which tilt and reference are unrelated."""
AGREES = 0.95
"""Correlation at the best lag, of either sign, from which a cure is offered. If the tilt freezes half-way, neither lag
nor scale is meaningful."""
UNIT_NEAR = 1.1
"""A scale within this factor of a degree, or of its inverse, is probably a unit."""


class _Judgement(NamedTuple):
    """Judgement on a reference."""

    remark: str
    fault: str | None
    """Why errors against the reference are not the estimates' own, in a clause; None if it agrees with the tilt."""


def alignment_of(log: Log) -> Alignment | None:
    """Align a log's reference with its tilt; None without a reference, and for a run's recording."""
    if "reference" not in log.has or log.scenario is not None:
        return None
    tilts, references = ([log[name][part] for part in log.parts] for name in ("y1_rad", REFERENCE))
    return alignment(tilts, references, log.dt)


def remarks_on(log: Log, aligned: Alignment | None) -> list[str]:
    """Describe the changes to a log, and its reference.

    Args:
        log: The log.
        aligned: Alignment from `alignment_of`.

    Returns:
        Sentences.
    """
    lines = [f"{note[:1].upper()}{note[1:]}{'' if note.endswith('?') else '.'}" for note in log.notes]
    return lines if aligned is None else [*lines, _judgement(log, aligned).remark]


def reference_fault(log: Log, aligned: Alignment | None) -> str | None:
    """Say in a clause why errors against a log's reference are not the estimates' own; None if nothing is known of it.

    Args:
        log: The log.
        aligned: Alignment from `alignment_of`.
    """
    return None if aligned is None else _judgement(log, aligned).fault


def _judgement(log: Log, aligned: Alignment) -> _Judgement:
    """Describe the reference's lag, scale and offset, with options that correct those that matter."""
    lag, scale, offset, correlation = aligned[:4]
    if scale is None or offset is None or correlation is None:
        remark = "The reference cannot be compared with the tilt: too little motion, or too short."
        return _Judgement(remark, "the reference cannot be compared with the tilt")
    lag_error, scale_error, offset_error = (
        math.inf if error is None else CLEAR * error
        for error in (aligned.lag_error_s, aligned.scale_error, aligned.offset_error_rad_s)
    )
    noisy = _is_noise(log, aligned.residual_rad)
    if correlation <= -AGREES or (noisy and scale < -scale_error):
        scale_now = log.options.scale.get("rate", 1.0)
        remark = (
            f"The reference does not go with the tilt (correlation {correlation:.2f}): it counts the other way: "
            f"--scale rate={-scale_now:g}."
        )
        return _Judgement(remark, "the reference counts the other way than the tilt")
    goes_along = noisy and scale > scale_error
    if abs(correlation) < ALIKE and noisy and not goes_along:
        remark = "The reference cannot be compared with the tilt, whose noise hides its motion."
        return _Judgement(remark, "the tilt's noise hides its motion")
    if abs(correlation) < ALIKE and not goes_along:
        remark = (
            f"The reference does not go with the tilt (correlation {correlation:.2f}): is it the rate of this tilt?"
        )
        remark += _accelerometer_question(log)
        return _Judgement(remark, "the reference does not go with the tilt")
    period = max(log.dt, log.row_period_s or 0.0)
    late = None if lag is None or abs(lag) <= max(LATE * period, lag_error) else lag
    resized = abs(scale - 1.0) > max(OFF, scale_error)
    known = log[REFERENCE][np.isfinite(log[REFERENCE])]
    motion = math.sqrt(float(np.mean(known**2)))
    shifted = abs(offset) > max(OFF * motion, offset_error)
    near = lag is not None and abs(lag) <= LATE * period and abs(scale - 1.0) <= NEAR and abs(offset) <= NEAR * motion
    if correlation < AGREES and not goes_along and not near:
        remark = (
            f"Tilt and reference hardly agree (correlation {correlation:.2f} at the best lag; below {AGREES:g} neither "
            "delay nor scale is offered): look at the log, whether one of them stands still, leaps or is noise."
        )
        remark += _accelerometer_question(log)
        if correlation < 0.0:
            turned = -log.options.scale.get("rate", 1.0)
            remark += f" The correlation is negative: does one of them count the other way (--scale rate={turned:g})?"
        return _Judgement(remark, "tilt and reference hardly agree")
    fit = _fit_text(scale, SURE / CLEAR * scale_error, offset, SURE / CLEAR * offset_error, motion)
    if late is None and not resized and not shifted:
        roughly = " as far as can be told" if SURE / CLEAR * scale_error > NEAR else ""
        remark = f"Tilt and reference agree{roughly}: {fit.replace('it', 'the reference', 1)} fits."
        return _Judgement(remark, None)
    decimals = max(0, math.ceil(-math.log10(FINE * period)))
    milliseconds = "" if late is None else f"{abs(late) * 1e3:.{max(2, decimals - 3)}f} ms"
    behind = "" if late is None else f"comes {milliseconds} {'behind' if late > 0.0 else 'before'}; "
    fit = f"the reference {behind}{fit}" if behind else fit.replace("it", "the reference", 1)
    cures = [] if late is None else [f"--delay {round(log.options.delay_s + late, decimals) + 0.0:.{decimals}f}"]
    factor = scale if resized else 1.0
    cures += [f"--scale rate={factor * log.options.scale.get('rate', 1.0):.4g}"] if resized else []
    offset_before = log.options.offset.get("rate", 0.0)
    unit_size = in_si("rate", log.options.units.get("rate", "rad_s"))
    total = factor * offset_before + (offset / unit_size if shifted else 0.0)
    cures += [f"--offset rate={total:.3g}"] if shifted or (resized and offset_before) else []
    corrected = log.options.delay_s or "rate" in log.options.scale or "rate" in log.options.offset
    instead = ", instead of what is set" if corrected else ""
    cure = f" (to take it out{instead}: {' '.join(cures)})"
    remark = f"Beside the tilt {fit} fits{cure}" + (_unit_question(log, scale) or ".")
    size = "another scale or offset than" if resized or shifted else ""
    if late is None:
        return _Judgement(remark, f"the reference has {size} the tilt's rate")
    comes = f"the reference comes {'behind' if late > 0.0 else 'before'} the tilt"
    return _Judgement(remark, f"{comes}, with {size} its rate" if size else comes)


def _accelerometer_question(log: Log) -> str:
    """Name the motion of one accelerometer's place among the causes of a disagreement."""
    if "ax" not in log.options.columns:
        return ""
    return (
        " Or the accelerometer's own motion puts off the tilt, with both sensors faultless: look how far, in the line "
        "on one accelerometer."
    )


def _is_noise(log: Log, residual: float | None) -> bool:
    """Return whether the tilt's noise explains all by which its increments differ from the reference's."""
    noise = noise_in(log).tilt
    return residual is not None and isinstance(noise, WhiteNoise) and residual <= NOISE * math.sqrt(2.0) * noise.high


def _fit_text(scale: float, scale_error: float, offset: float, offset_error: float, motion: float) -> str:
    """Write a scale and an offset with their intervals, where there are any; no offset that is nothing beside a motion.

    An interval has at least four decimals, and more for the first digit of its half width, up to `MOST_DECIMALS`; a
    narrower one is left out.
    """
    size, sign = abs(offset), "plus" if offset >= 0.0 else "less"
    times = f"{_with_interval(scale, scale_error)} times it"
    if size + offset_error < NOTHING * motion:
        return times
    return f"{times} {sign} {_with_interval(size, offset_error)} rad/s"


def _with_interval(value: float, error: float) -> str:
    decimals = 4 if error == 0.0 or not math.isfinite(error) else max(4, math.ceil(-math.log10(error)))
    known = math.isfinite(error) and error > 0.0 and decimals <= MOST_DECIMALS
    if not known:
        return f"{value:.4f}" if abs(value) >= 0.1 else f"{value:.4g}"
    low, high = (round(end, decimals) + 0.0 for end in (value - error, value + error))  # no -0.0000
    return f"{value:.{decimals}f} ({low:.{decimals}f} to {high:.{decimals}f})"


def _unit_question(log: Log, scale: float) -> str | None:
    """Ask for the unit if a reference's scale is that of degrees taken as radians, or the other way."""
    units = log.options.units
    for factor, rate, tilt in ((math.pi / 180.0, "deg/s", "rad"), (180.0 / math.pi, "rad/s", "deg")):
        if 1.0 / UNIT_NEAR < scale / factor < UNIT_NEAR:
            tilts = f", or the tilt {tilt}" if "tilt" in units and units["tilt"] != tilt else ""
            return f": is it {rate}{tilts}?"
    return None
