"""The effect of the accelerometers' imperfections on every observer, in its own loop: each alone, and all together.

    python docs/studies/sensor_errors.py alone [--worlds 20] [--observers all] [--jobs 2] [--only skew]
    python docs/studies/sensor_errors.py together [--worlds 10] [--parts 4] [--observers gyro_free,kalman,adaptive]

The scenario push_recovery. Values are those of the MPU-6050's class: as the datasheet has them (cross-axis 2 %, the
low-pass), as a calibration leaves them (offset 5 mg, scale 1 %), as parts are glued (0.2 and 1 degree). Alone, each has
the sign that adds to e = 0.5 degree. All together, signs are drawn at random, for as many pairs of parts as --parts.
"levelled": an offset of the inner accelerometer makes up for the tilt that the others make at rest, as a calibration at
rest does.

Printed: gyro_free against the best of the others, world by world; then every observer; then where gyro_free loses.
On a quiet core the first takes a minute an observer with 20 worlds, the second two with 4 pairs of parts of 10 worlds.
"""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from cmg_mj import OBSERVERS, Accelerometer, load_plant, load_scenario, prepare
from cmg_mj.laws.state_feedback import TABLE_2_GAINS
from cmg_mj.results.intervals import known_interval, ratio_interval
from cmg_mj.results.tables import markdown_table

SEED = 90_000
OURS = "gyro_free"
RELATIVE = "free_pivot"
"""It has a study of its own, and no place among the others that ours is compared with."""
ERROR, PUSH = "velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s"
WHEEL_KG, WHEEL_RAD_S = 0.61, 314.0
G_6_3_KG_M = WHEEL_KG * 6.3e-3 / WHEEL_RAD_S
"""ISO 21940-11: the grade is the speed of the wheel's centre of mass, 6.3 mm/s for flywheels."""
UNBALANCED = (f"plant.flywheel_imbalance_kg_m={G_6_3_KG_M!r}",)
INSTABILITY_UG = 36.0
"""The datasheet has none; so much the IMU of Microsoft's AirSim takes for the MPU-6000 (ImuSimpleParams.hpp)."""
PERIOD_S = 0.005


class Case(NamedTuple):
    """One line of the tables: the same imperfections on one pair of parts, or on several pairs in turn."""

    name: str
    pairs: list[dict[str, Any]]
    """Fields of the accelerometers."""
    settings: tuple[str, ...] = ()
    """Further differences from the scenario."""


def tilt_off(fields: dict[str, Any]) -> float:
    """Return the error of y1 at rest [deg]."""
    plant = load_plant()
    return math.degrees(plant.bias - plant.apparent_bias(Accelerometer(**fields)))


def levelled(fields: dict[str, Any]) -> dict[str, Any]:
    """The same parts, after an offset of the inner one has been set so that y1 is right at rest."""
    inner, outer = fields.get("bias_mg", (0.0, 0.0))
    found = brentq(lambda mg: tilt_off(fields | {"bias_mg": (inner + mg, outer)}), -300.0, 300.0, xtol=1e-9)
    return fields | {"bias_mg": (inner + found, outer)}


def skew_gain() -> tuple[float, float]:
    """Return the effect of an outer sample that is a period old.

    Returns:
        Change of y1 if the angular acceleration changes from one sample to the next, r_i r_o/((r_o - r_i) g)
        [s^2]; the gain of the loop that this closes: y1 -> u by K_e, u -> acceleration.
    """
    plant = load_plant()
    tilt, reduced = plant.pair_tilt, plant.reduced
    added = tilt.r_inner * tilt.r_outer / ((tilt.r_outer - tilt.r_inner) * plant.gravity)
    return added, TABLE_2_GAINS[0] * added * reduced.J_d * reduced.omega_d / reduced.J1


def drawn(parts: int, misalignment_deg: float, **fields: Any) -> list[dict[str, Any]]:
    """Pairs of parts with everything at once, signs at random."""
    rng = np.random.default_rng(SEED)
    sizes = {"bias_mg": 5.0, "scale_error": 0.01, "misalignment_deg": misalignment_deg, "cross_axis": 0.02}
    common = {"bias_instability_ug": INSTABILITY_UG, "bandwidth_hz": 94.0} | fields
    return [
        {name: tuple((size * rng.choice([-1.0, 1.0], 2)).tolist()) for name, size in sizes.items()} | common
        for _ in range(parts)
    ]


def alone() -> Iterator[Case]:
    """Each imperfection by itself."""
    yield Case("none", [{}])
    yield Case("offset 5 mg, inner", [{"bias_mg": (5.0, 0.0)}])
    yield Case("offset 5 mg, outer", [{"bias_mg": (0.0, -5.0)}])
    yield Case("scale 1 %, inner", [{"scale_error": (-0.01, 0.0)}])
    yield Case("scale 1 %, outer", [{"scale_error": (0.0, 0.01)}])
    for angle in (0.2, 1.0):
        yield Case(f"misaligned {angle:g} deg, inner", [{"misalignment_deg": (-angle, 0.0)}])
        yield Case(f"misaligned {angle:g} deg, outer", [{"misalignment_deg": (0.0, angle)}])
    yield Case("misaligned 1 deg, inner, levelled", [levelled({"misalignment_deg": (-1.0, 0.0)})])
    yield Case("cross-axis 2 %, inner", [{"cross_axis": (0.02, 0.0)}])
    yield Case("cross-axis 2 %, inner, levelled", [levelled({"cross_axis": (0.02, 0.0)})])
    yield Case("cross-axis 2 %, outer", [{"cross_axis": (0.0, -0.02)}])
    yield Case("skew a fifth of a period", [{"skew_s": PERIOD_S / 5.0}])
    yield Case("skew half a period", [{"skew_s": PERIOD_S / 2.0}])
    yield Case("skew four fifths of a period", [{"skew_s": 0.8 * PERIOD_S}])
    yield Case("skew one period", [{"skew_s": PERIOD_S}])
    yield Case("skew one period, estimated angles", [{"skew_s": PERIOD_S}], ("controller.angle_source=estimated",))
    yield Case("skew one period, inner held back for it", [{"latency_s": PERIOD_S}])
    yield Case(f"bias instability {INSTABILITY_UG:g} ug", [{"bias_instability_ug": INSTABILITY_UG}])
    yield Case("low-pass 94 Hz", [{"bandwidth_hz": 94.0}])
    yield Case("low-pass 44 Hz", [{"bandwidth_hz": 44.0}])
    yield Case("wheels balanced to G 6.3", [{}], UNBALANCED)


def together(parts: int) -> Iterator[Case]:
    """All of them."""
    small = drawn(parts, 0.2, skew_s=PERIOD_S / 2.0)
    large = drawn(parts, 1.0, skew_s=PERIOD_S)
    yield Case("0.2 deg, half a period", small, UNBALANCED)
    yield Case("0.2 deg, half a period, levelled", [levelled(fields) for fields in small], UNBALANCED)
    yield Case("1 deg, one period, levelled", [levelled(fields) for fields in large], UNBALANCED)
    estimated = (*UNBALANCED, "controller.angle_source=estimated")
    yield Case("the same, estimated angles", [levelled(fields) for fields in large], estimated)
    late = {"skew_s": 0.0, "latency_s": PERIOD_S}
    yield Case("the same, inner held back", [levelled(fields) | late for fields in large], UNBALANCED)


def measured(case: Case, observer: str, worlds: int) -> dict[str, np.ndarray]:
    """One observer in its loop: error, error in the push window, the cheap gyro's error; NaN where the rig fell."""
    found: dict[str, list[np.ndarray]] = {"error": [], "push": [], "mems": [], "fell": []}
    for i, fields in enumerate(case.pairs):
        given = [f"seed={SEED + i}", *case.settings]
        if observer == "true rate":
            given.append("controller.feedback=truth")
        given += [
            f"sensors.accelerometer.{name}={list(value) if isinstance(value, tuple) else value}"
            for name, value in fields.items()
        ]
        experiment = prepare(load_scenario("push_recovery", given, OURS if observer == "true rate" else observer))
        result = experiment.run_many(worlds, keep_trajectory=False)
        found["error"].append(result.values(ERROR))
        found["push"].append(result.values(PUSH))
        found["mems"].append(result.values(ERROR, "mems_gyro"))
        found["fell"].append(~result.stood)
    return {name: np.concatenate(values) for name, values in found.items()}


def least(of: dict[str, dict[str, np.ndarray]]) -> str:
    """The observer, other than ours, that fell least; among those the one with the least mean error."""

    def order(name: str) -> tuple[float, float]:
        interval = known_interval(of[name]["error"])
        return float(of[name]["fell"].mean()), interval.mean if interval else math.inf

    return min((name for name in of if name not in (OURS, "true rate")), key=order)


def number(values: np.ndarray) -> str:
    """Mean and half the interval over the worlds that stood [1e-3 rad/s]."""
    interval = known_interval(1e3 * values)
    return "-" if interval is None else f"{interval.mean:.1f} ± {interval.half:.1f}"


def mean(values: np.ndarray) -> str:
    """Over the worlds that stood [1e-3 rad/s]."""
    return number(values).partition(" ")[0]


def share(fell: np.ndarray) -> str:
    """Share of the worlds that fell."""
    return f"{fell.mean():.0%}"


def columns(of: dict[str, np.ndarray]) -> tuple[str, str, str]:
    """An observer's error, that in the push window, its falls."""
    return number(of["error"]), number(of["push"]), share(of["fell"])


def short(of: dict[str, np.ndarray]) -> str:
    """An observer's error, and its falls if there are any."""
    return mean(of["error"]) + (f" [{share(of['fell'])}]" if of["fell"].any() else "")


def ratio(ours: np.ndarray, theirs: np.ndarray) -> tuple[str, float, float]:
    """Ratio over the worlds in which both stood, with its interval."""
    both = np.isfinite(ours) & np.isfinite(theirs)
    if both.sum() < 2:
        return "-", math.nan, math.nan
    interval = ratio_interval(ours[both], theirs[both])
    return f"{interval.mean:.2f} ({interval.low:.2f} to {interval.high:.2f})", interval.low, interval.high


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lines", choices=["alone", "together"])
    parser.add_argument("--worlds", type=int, default=20)
    parser.add_argument("--parts", type=int, default=4)
    parser.add_argument("--observers", default="all")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument(
        "--set", action="append", default=[], help="a setting of the scenario, as `cmg-mj run` takes it"
    )
    parser.add_argument("--only", default="", help="cases whose names contain this")
    options = parser.parse_args()
    names = (
        [name for name in OBSERVERS if name != RELATIVE] if options.observers == "all" else options.observers.split(",")
    )
    names = [*dict.fromkeys([OURS, *names]), "true rate"]
    lines = alone() if options.lines == "alone" else together(options.parts)
    chosen = [case._replace(settings=(*case.settings, *options.set)) for case in lines if options.only in case.name]
    with ProcessPoolExecutor(options.jobs, mp_context=get_context("spawn")) as pool:
        waiting = {
            (case.name, name): pool.submit(measured, case, name, options.worlds) for case in chosen for name in names
        }
        found = {case.name: {name: waiting[case.name, name].result() for name in names} for case in chosen}

    rows, losses, times = [], [], []
    for case in chosen:
        of = found[case.name]
        ours, best = of[OURS], least(of)
        against, low, _ = ratio(ours["error"], of[best]["error"])
        off = max(abs(tilt_off(fields)) for fields in case.pairs)
        cells = [cell for name in (OURS, best) for cell in columns(of[name])]
        rows.append((case.name, f"{off:.2f}", *cells[:3], f"`{best}`", *cells[3:], against))
        if low > 1.0 or ours["fell"].mean() > of[best]["fell"].mean():
            losses.append(f"- to `{best}`: {case.name}, {against}")
        gyro, low, _ = ratio(ours["error"], ours["mems"])
        times.append((case.name, gyro, low))
    own = ("error", "push window", "fell")
    headings = ("imperfection", "y1 off at rest [deg]", f"`{OURS}`", *own[1:], "best other", *own, "ratio of errors")
    print("Velocity RMS errors in 1e-3 rad/s, with 95 % intervals:\n")
    print(markdown_table(headings, rows), "\n")
    print("Every observer in its own loop, mean errors, in brackets the share of falls; the cheap gyro on the loop of")
    print(f"`{OURS}`; how often the rig falls if the law is told the true rate:\n")
    observers = names[:-1]
    rows = []
    for case in chosen:
        of = found[case.name]
        told = share(of["true rate"]["fell"])
        rows.append((case.name, *(short(of[name]) for name in observers), mean(of[OURS]["mems"]), told))
    shown = (f"`{name}`" for name in observers)
    print(markdown_table(("imperfection", *shown, "MEMS gyro", "falls with the true rate"), rows), "\n")
    print(f"Where `{OURS}` loses:\n")
    print("\n".join(losses))
    known = [(name, gyro) for name, gyro, low in times if low > 1.0]
    print(f"- to the MEMS gyro: in {len(known)} of {len(times)} lines; its error is as many times the gyro's:")
    print("; ".join(f"{name} {gyro}" for name, gyro in known), "\n")
    added, gain = skew_gain()
    print(f"Where the outer's sample is a period old, an acceleration that changes by 1 rad/s^2 adds {added:.4f}")
    print(f"rad to y1, which the law feeds back: a loop of gain {gain:.2f} closes from sample to sample.")


if __name__ == "__main__":
    main()
