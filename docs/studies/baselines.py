"""The worth of a cheap gyro in the first seconds and at any offset, and the floor over accelerometers' places.

    python docs/studies/baselines.py [--worlds 20] (about a minute)

- gyros: in the loop of `gyro_free` in push_recovery, RMS errors over parts of the run: the gyro as bought, after
  a second at rest (and with an offset since), fused with y1, and fused by a filter that does not know the rate at
  the start.
- parts: accelerometers and gyros of three generations: observers in loops of their own, the gyro fused with y1 in the
  loop of `gyro_free`, and that gyro behind its low-pass, which shows it 2.8 ms late. Their 1/f noise stays that of the
  MPU-6050: the others' datasheets have none.
- places: `floor_accel` by the two accelerometers' distances from the pivot.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace

import numpy as np

from cmg_mj.results.baselines import MEMS_FUSED, MEMS_GYRO, RATE_START, Baselines, FusedGyro
from cmg_mj.results.floors import acceleration_floor
from cmg_mj.results.tables import markdown_table
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.stages.push import inside, push_windows

PARTS_S = ((0.0, 0.5), (0.5, 1.0), (1.0, 2.0), (2.0, 15.0), (0.0, 15.0))
PLACES_M = ((0.0672, 0.2015), (0.05, 0.25), (0.05, 0.15), (0.1, 0.25), (0.1, 0.2), (0.1, 0.15))
"""The bundled rig's first: 1/4 and 3/4 of its height."""
GENERATIONS = {
    "MPU-6050": (400.0, {}),
    "ICM-20602": (100.0, {"noise_density_deg_s_rthz": 0.004, "scale_error": 0.01}),
    "ICM-42688-P": (70.0, {"noise_density_deg_s_rthz": 0.0028, "scale_error": 0.005}),
}
"""Part -> noise of its accelerometers [ug/rtHz], and how its gyro differs from an MPU-6050's."""
OTHERS = ("ltv", "high_gain", "adaptive")
LOW_PASS_S = 2.8e-3
"""Delay of the MPU-6050's gyro behind its low-pass of 98 Hz (RM-MPU-6000A, register 26)."""
ERROR, PUSH_ERROR = "velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s"


def experiment(*settings: str, observer: str = "gyro_free") -> Experiment:
    """Push recovery in the loop of an observer."""
    return prepare(load_scenario("push_recovery", settings, observer))


def gyro_rates(setup: Experiment, t: Trajectory, late_s: float = 0.0, **changed: float) -> dict[str, np.ndarray]:
    """Rates of a gyro with other errors, and late. The rig does not turn, so the tilt rate is the frame's."""
    dt, _, noise = setup.design.constructor_arguments
    gyro, rate, y1 = setup.scenario.sensors.mems_gyro, t["x2_rad_s"], t["y1_rad"]
    before = np.vstack([rate[:1], rate[:-1]])
    rate, worlds = rate + late_s / dt * (before - rate), rate.shape[1]
    part = Baselines(replace(gyro, **changed), dt, setup.scenario.seed, range(worlds), [noise.tilt] * worlds)
    return part.rates(rate, y1)


def gyros(worlds: int) -> None:
    """Print the errors of every way to use the gyro."""
    setup = experiment()
    t = setup.run_many(worlds).trajectory
    assert t is not None
    dt, _, noise = setup.design.constructor_arguments
    gyro, rate, y1 = setup.scenario.sensors.mems_gyro, t["x2_rad_s"], t["y1_rad"]

    def without_rest(offset: float) -> np.ndarray:
        reading = gyro_rates(setup, t, as_bought_offset_deg_s=offset)["mems_as_bought"]
        white, wander = gyro.white_noise_sigma(dt), gyro.flicker_floor
        filters = FusedGyro(white, wander, [noise.tilt] * worlds, dt, math.radians(20.0), 0.0)
        return filters.rates(reading, y1)

    plain = gyro_rates(setup, t)
    rates = {
        "as bought": plain["mems_as_bought"],
        "after a second at rest (`mems_gyro`)": plain[MEMS_GYRO],
        **{
            f"the same, {offset:g} deg/s off since": gyro_rates(setup, t, bias_deg_s=offset)[MEMS_GYRO]
            for offset in (0.1, 0.5, 0.85, 1.6)
        },
        f"fused with y1, from rest within {RATE_START:g} rad/s (`mems_fused`)": plain[MEMS_FUSED],
        **{f"fused, told nothing, offset {offset:g} deg/s": without_rest(offset) for offset in (0.0, 2.0, 20.0)},
        "`gyro_free`": t["estimate/gyro_free/x2_rad_s"],
    }
    time = t["time_s"]
    rows = []
    for name, estimate in rates.items():
        squares = np.square(estimate - rate)
        errors = [np.sqrt(squares[(time >= low) & (time < high)].mean()) for low, high in PARTS_S]
        rows.append([name, *(f"{error:.4f}" for error in errors)])
    print(f"RMS error [rad/s] over seconds of the run, {worlds} worlds\n")
    print(markdown_table(["gyro", *(f"{low:g} to {high:g}" for low, high in PARTS_S)], rows))


def parts(worlds: int) -> None:
    """Print the errors with the parts of each generation."""
    rows = []
    for part, (noise, gyro) in GENERATIONS.items():
        setting = f"sensors.accelerometer.noise_density_ug_rthz={noise}"
        setup = experiment(setting)
        result = setup.run_many(worlds)
        t, error = result.trajectory, result.mean(ERROR) or math.nan
        assert t is not None
        pushed = inside(t["time_s"], push_windows(setup.scenario.push))
        row = [f"{part}, {noise:g}", f"{error:.4f}", f"{result.mean(PUSH_ERROR):.4f}"]
        for name in OTHERS:
            other = experiment(setting, observer=name).run_many(worlds, keep_trajectory=False)
            row.append(f"{other.mean(ERROR):.4f}")
        for late_s, changed in ((0.0, {}), (0.0, gyro), (LOW_PASS_S, gyro)):
            off = gyro_rates(setup, t, late_s, **changed)[MEMS_FUSED] - t["x2_rad_s"]
            fused, at_push = (np.sqrt(np.square(off[rows_]).mean(axis=0)).mean() for rows_ in (pushed | True, pushed))
            row.append(f"{fused:.4f} ({error / fused:.1f}), {at_push:.4f}")
        rows.append(row)
    fused = [f"fused: {which}" for which in ("MPU-6050's gyro", "its own", "its own, 2.8 ms late")]
    print("\nParts: errors [rad/s]; of gyros also gyro_free's error over theirs, and theirs in the push window\n")
    print(markdown_table(["ug/rtHz", "`gyro_free`", "in push window", *(f"`{name}`" for name in OTHERS), *fused], rows))


def places() -> None:
    """Print the floor of y1 and its acceleration over places."""
    rows = []
    for inner, outer in PLACES_M:
        where = experiment(f"plant.accelerometer_inner_m={inner}", f"plant.accelerometer_outer_m={outer}")
        dt, _, noise = where.design.constructor_arguments
        figures = (f"{math.degrees(noise.tilt):.2f}", f"{noise.acceleration:.2f}")
        rows.append([f"{inner:g}, {outer:g}", *figures, f"{acceleration_floor(noise, dt):.4f}"])
    headings = ["inner, outer [m]", "noise of y1 [deg]", "of the acceleration [rad/s^2]", "`floor_accel` [rad/s]"]
    print("\nThe floor by the accelerometers' places\n")
    print(markdown_table(headings, rows))


def main() -> None:
    """Print all parts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=20)
    worlds = parser.parse_args().worlds
    gyros(worlds)
    parts(worlds)
    places()


if __name__ == "__main__":
    main()
