"""Remarks on the noise that observers assume, beside the noise that a log shows."""

from __future__ import annotations

import math

from cmg_mj.core.tilt import TiltNoise
from cmg_mj.replay.logs import Log
from cmg_mj.replay.logs.white_noise import WhiteNoise
from cmg_mj.replay.user_noise import density_of, noise_in
from cmg_mj.results.summary_keys import SummaryValue

APART = 1.5
"""Ratio of the noise that is used and the noise that the log shows, from which it is reported."""


def noise_remarks(log: Log, noise: TiltNoise) -> list[str]:
    """Describe the noise that observers assume, and what the log shows.

    Args:
        log: The log.
        noise: The noise of one sample that observers assume.

    Returns:
        A line for each noise; none for a run's recording, whose sensors are known.
    """
    if log.white_noise is None:
        return []
    shown = noise_in(log)
    if log.tilt is not None:
        density = density_of(log, noise.tilt)
        estimate = shown.tilt
        if isinstance(estimate, WhiteNoise):
            estimate = WhiteNoise(*(density_of(log, value) for value in estimate))
        return [_remark("accelerometers", density, estimate, "ug/rtHz", "accelerometer")]
    degrees = shown.tilt
    if isinstance(degrees, WhiteNoise):
        degrees = WhiteNoise(*map(math.degrees, degrees))
    lines = [_remark("tilt", math.degrees(noise.tilt), degrees, "deg", "tilt")]
    if shown.acceleration is not None:
        lines.append(_remark("angular acceleration", noise.acceleration, shown.acceleration, "rad/s^2", "acceleration"))
    return lines


def _remark(signal: str, used: float, estimate: WhiteNoise | str, unit: str, option: str) -> str:
    """Describe one noise, both in the unit that `--noise` takes."""
    start = f"Noise of the {signal}: {used:.3g} {unit}"
    if isinstance(estimate, str):
        return f"{start} is used; the log cannot tell: {estimate}."
    interval = f"{estimate.low:.3g} to {estimate.high:.3g}"
    if math.isclose(used, estimate.sigma, rel_tol=1e-9):
        return f"{start} ({interval}) by the log, and used."
    remark = f"{start} is used; the log shows {estimate.sigma:.3g} ({interval})"
    ratio = estimate.sigma / used
    if max(ratio, 1.0 / ratio) < APART:
        return f"{remark}."
    factor = max(ratio, 1.0 / ratio)
    size = f"{factor:.1f}" if factor < 9.95 else f"{factor:.0f}"
    apart = f"{'more' if ratio > 1.0 else 'less'} by a factor of {size}"
    return f"{remark}, {apart}: give --noise {option}={estimate.sigma:.3g}, or no {option} for the log's own."


def noise_figures(log: Log, noise: TiltNoise) -> dict[str, SummaryValue]:
    """Return the noise that a log shows as `--json` prints it; nothing for a run's recording."""
    if log.white_noise is None:
        return {}
    shown, figures = noise_in(log), {}
    pairs = {"tilt_rad": (shown.tilt, noise.tilt), "acceleration_rad_s2": (shown.acceleration, noise.acceleration)}
    for key, (estimate, used) in pairs.items():
        if isinstance(estimate, WhiteNoise):
            figures[key] = {**estimate._asdict(), "used": math.isclose(used, estimate.sigma, rel_tol=1e-9)}
        elif estimate is not None:
            figures[key] = {"sigma": None, "reason": estimate, "used": False}
    if shown.acceleration is not None:
        figures["correlation"] = shown.correlation
    return {"noise_by_the_log": figures}
