"""An identified rig as its file, table, figures and plot; and how well it foretells another log."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from cmg_mj.core.planar_tilt import PlanarTilt
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.features.identify.geometry import ERRORS, Geometry, Motion, Readings
from cmg_mj.features.identify.identify import Identified
from cmg_mj.features.identify.pendulum import Pendulum
from cmg_mj.features.identify.signals import PER_PERIOD, Signals, floor, spectrum
from cmg_mj.features.replay.log import UNITS
from cmg_mj.observers.gyro_free import steady_error
from cmg_mj.results.summary_keys import SummaryValue
from cmg_mj.results.tables import Row, Table
from cmg_mj.view.plots.figure import Line, Panel, Picture, draw

SHOWN = {"rad": ("deg", math.degrees(1.0)), "s": ("ms", 1e3)}
"""Unit of a parameter -> the unit that a table shows, and its factor."""
DIGITS = 6
"""Significant digits of a rig file's numbers."""
SHORT = 128
"""Rows of a segment of a spectrum of noise: of few segments, the median density is far below the mean."""


def noises(found: Geometry) -> dict[str, float]:
    """Estimate the noise of a sample of each channel: by its upper quarter of frequencies, or by the rest of the fit.

    The larger counts: vibration, and what a rigid body does not explain, disturb observers at low frequencies too. What
    the angular acceleration's own noise leaves at a place r, |r| times it, is not the accelerometer's.

    Returns:
        `tilt` [rad], `rate` [rad/s], `accelerometer 1` [m/s^2] and so on.
    """
    low, channels = found.signals, found.signals.channels

    def by_floor(name: str) -> float:
        power = spectrum(channels.values[name], channels.dt, SHORT)[1]
        return math.sqrt(0.5 / channels.dt * float(floor(power)))

    sizes = {name: by_floor(name) for name in ("tilt", "rate") if name in channels.values}
    impulse = np.zeros(len(low.grid))
    impulse[len(impulse) // 2] = 1.0
    passed = low.low_pass(impulse)
    kept = float(np.linalg.norm(passed))  # of unit white noise
    moved = sizes.get("rate", 0.0) * float(np.linalg.norm(np.gradient(passed, channels.dt)))
    for i, reading in enumerate(found.readings):
        total, (across, up, *_) = sum(by_floor(name) ** 2 for name in reading.columns), found.of(i)
        if "rate" in sizes:  # the second derivative of an angle is too noisy to tell
            rest = (
                float(np.sum(found.solution.sigmas[found.channels_of(i)] ** 2)) - (math.hypot(across, up) * moved) ** 2
            )
            total = max(total, rest / kept**2)
        sizes[f"accelerometer {i + 1}"] = math.sqrt(total / 2.0)
    return sizes


def rig_fields(rig: Identified, sizes: Mapping[str, float]) -> dict[str, Any]:
    """Return the fields of the rig file.

    Args:
        rig: The rig.
        sizes: The channels' noise.
    """
    found = rig.geometry
    options, errors = found.signals.channels.options, ERRORS | found.errors
    log = options.as_toml()
    for other in ("rig", "time_range_s"):
        log.pop(other, None)
    scale, offset = dict(options.scale), dict(options.offset)
    for role, factor, addend in (
        ("tilt", errors["tilt scale"], 0.0),
        ("rate", errors["gyro scale"], errors["gyro offset"]),
    ):
        if role in options.columns:
            size = UNITS["angle" if role == "tilt" else "rate"][options.units[role]]
            scale[role] = _rounded(scale.get(role, 1.0) / factor)
            offset[role] = _rounded((offset.get(role, 0.0) - addend / size) / factor)
    log |= {"scale": scale, "offset": offset}
    if found.is_rate_judged:
        log["delay_s"] = _rounded(errors["gyro delay"])
    accelerometers, delays = [], {}
    for i, reading in enumerate(found.readings):
        across, up, angle, s1, s2, o1, o2, delay = map(_rounded, found.of(i))
        delays |= dict.fromkeys(reading.columns, delay)
        fields = {
            "columns": reading.columns,
            "unit": options.rig.accelerometer[i].unit,
            "place_m": [across, up],
            "angle_deg": _rounded(math.degrees(angle)),
            "scale": [s1, s2],
            "offset_m_s2": [o1, o2],
            "noise_m_s2": _rounded(sizes[f"accelerometer {i + 1}"]),
        }
        accelerometers.append(fields)
    rest: dict[str, Any] = {"accelerometer": accelerometers} if accelerometers else {}
    if "tilt" in sizes:
        rest = {"angle_noise_deg": _rounded(math.degrees(sizes["tilt"])), **rest}
    numbers = {number.name: _rounded(number.value) for number in rig.numbers}
    if "torque delay" in numbers:  # the body feels it later
        delays["torque"] = -numbers["torque delay"]
    rest |= {"rate_hz": _rounded(1.0 / found.signals.channels.dt), "delays_s": delays}
    if "inertia J" in numbers:
        rest["pendulum"] = {"inertia": numbers["inertia J"], "gravity_torque": numbers["m g l"]}
        if rig.momentum is not None:
            rest["pendulum"] |= {"momentum": rig.momentum, "gimbal_inertia": numbers["J2"]}
    return {**rest, "log": log}


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def judge(rig: Identified, signals: Signals) -> dict[str, float]:
    """Compute the share of a log's motion that the rig foretells: R^2.

    The motion is that of the log's gyro and angle sensor, behind the low-pass.

    Args:
        rig: The rig.
        signals: The log, which has all columns.

    Returns:
        R^2 of angular acceleration and tilt, by what foretells it.
    """
    found = rig.geometry
    motion, errors = Motion(signals), found.errors
    if signals is not found.signals:  # an offset is another one every day
        errors |= {p.name: p.start for p in motion.parameters if p.name == "gyro offset"}
    state = motion.at(errors)
    places, forces = [], []
    for i, reading in enumerate(found.readings):
        across, up, angle, s1, s2, o1, o2, delay = found.of(i)
        x, z = Readings(signals, reading.columns, reading.unit, state).shown(delay).T
        places.append(complex(across, up))
        forces.append(((x - o1) / s1 + 1j * (z - o2) / s2) * np.exp(1j * angle))
    tilt, shares = np.angle(state.gravity / 1j), {}
    known = "tilt" in signals.channels.values
    for has_angle in (False, True):
        if places and (known if has_angle else len(places) > 1):
            geometry = PlanarTilt(tuple(places), (1.0,) * len(places), STANDARD_GRAVITY, has_angle)
            y, acceleration = geometry(forces, tilt if has_angle else None)
            by = "accelerometers and tilt" if has_angle else "accelerometers alone"
            shares[f"angular acceleration by {by}"] = _explained(-np.imag(state.K), acceleration)
            if known and not has_angle:
                shares[f"tilt by {by}"] = _explained(tilt, y)
    if rig.pendulum:
        pendulum = Pendulum(motion, errors, rig.momentum)
        shares["angular acceleration by the pendulum"] = _explained(
            pendulum.acceleration, pendulum.foretell(rig.pendulum.values)
        )
    return shares


def _explained(true: np.ndarray, foretold: np.ndarray) -> float:
    return 1.0 - float(np.mean((foretold - true) ** 2) / np.var(true))


def tables(rig: Identified, sizes: Mapping[str, float], judged: Mapping[str, Mapping[str, float]]) -> Group:
    """Make the tables of parameters with their intervals, of noise, and of what logs say to both."""
    rows = []
    for number in rig.numbers:
        unit, factor = SHOWN.get(number.unit, (number.unit, 1.0))
        digits = max(0, 1 - math.floor(math.log10(max(factor * number.error, 1e-9))))
        value, error = (f"{factor * size:.{digits}f}" for size in (number.value, number.error))
        beside = f"not apart from {number.beside}" if number.beside else ""
        remark = beside if number.told else f"this log does not tell it{'; ' * bool(beside)}{beside}"
        rows.append({"name": number.name, "value": f"{value} ±{error}", "unit": unit, "remark": remark})
    for name, size in sizes.items():
        unit, factor = {"tilt": ("deg", math.degrees(1.0)), "rate": ("rad/s", 1.0)}.get(name, ("m/s^2", 1.0))
        rows.append({"name": f"{name} noise", "value": f"{factor * size:.3g}", "unit": unit, "remark": "of a sample"})
    columns = {"name": "parameter", "value": "value, 95 %", "unit": "unit", "remark": "remark"}
    title = f"{rig.signals.channels.name}, below {rig.signals.below_hz:.3g} Hz"
    parts: list[RenderableType] = [Table(columns, rows, title, _cell).rich()]
    names = dict.fromkeys(name for shares in judged.values() for name in shares)
    if names:
        shares = [{"name": n, **{log: f"{its[n]:.3f}" for log, its in judged.items()}} for n in names]
        parts.append(Table({"name": "R^2", **{log: log for log in judged}}, shares, "", _cell).rich())
    parts += [Text(f"By its noise {text}") for text in _expected(rig, sizes)]
    if rig.pendulum is None:
        parts.append(Text("No pendulum: no column is the torque (--columns torque=...) or the gimbals' angle."))
    elif "inertia J" not in {number.name for number in rig.numbers}:
        parts.append(Text("Of the pendulum only ratios are known: give the torque in N m (--units), or --momentum."))
    return Group(*parts)


def _expected(rig: Identified, sizes: Mapping[str, float]) -> Iterator[str]:
    """Say what `gyro_free` errs by with these places and noises, and with two as far apart as the length allows."""
    found, dt = rig.geometry, rig.signals.channels.dt
    places = [complex(*found.of(i)[:2]) for i in range(len(found.readings))]
    sigmas = tuple(sizes[f"accelerometer {i + 1}"] for i in range(len(places)))
    angle, far = sizes.get("tilt", 0.0), max(map(abs, places), default=0.0)
    for words, at, noises, has_angle in (
        ("accelerometers alone", places, sigmas, False),
        ("accelerometers and angle sensor, the pivot at rest", places, sigmas, True),
        (f"two accelerometers at the pivot and {far:.3g} m from it", [0j, complex(0.0, far)], sigmas[:1] * 2, False),
    ):
        if (angle if has_angle else len(at) > 1) and far:
            noise = PlanarTilt(tuple(at), noises, STANDARD_GRAVITY, has_angle).noise(angle)
            yield f"gyro_free errs by {steady_error(noise, dt):.3g} rad/s: {words}."


def _cell(row: Row, key: str) -> str:
    return str(row[key])


def figures(rig: Identified, sizes: Mapping[str, float], judged: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    """Return what `--json` prints."""
    parameters: dict[str, dict[str, SummaryValue]] = {
        n.name: {"value": n.value, "low": n.value - n.error, "high": n.value + n.error, "unit": n.unit, "told": n.told}
        for n in rig.numbers
    }
    return {
        "parameters": parameters,
        "noise": dict(sizes),
        "r_squared": {name: dict(shares) for name, shares in judged.items()},
    }


def plot(path: Path, found: Geometry) -> None:
    """Draw the spectrum of each channel, and that of what the fit leaves."""
    channels, panels, rests = found.signals.channels, [], found.solution.residuals
    f_rest, of_rest = spectrum(rests, 1.0 / (PER_PERIOD * found.signals.below_hz))
    shown = [("rate", "rate\n[(rad/s)^2/Hz]", ["rate"], [0])] if found.is_rate_judged else []
    for i, reading in enumerate(found.readings):
        place = range(len(rests[0]))[found.channels_of(i)]
        shown.append((f"accelerometer {i + 1}", "force\n[(m/s^2)^2/Hz]", list(reading.columns), list(place)))
    for title, label, names, places in shown:
        lines = []
        for number, (name, place) in enumerate(zip(names, places, strict=True)):
            f, power = spectrum(channels.values[name], channels.dt)
            lines.append(Line(f, power, f"{name}", color=number, width=0.6))
            lines.append(Line(f_rest, of_rest[:, place], f"rest of {name}", color=number, width=1.6))
        panels.append(Panel(label, lines, title, "frequency [Hz]", "log", "log"))
    draw(path, Picture("rig", f"Spectra: {channels.name}, fitted below {found.signals.below_hz:.3g} Hz", panels))
