"""The worth of a cheap gyro in the first seconds and at any offset, and the floor over accelerometers' places.

    python docs/studies/baselines.py [--worlds 20] (about five seconds)

- gyros: in the loop of `gyro_free` in push_recovery, RMS errors over parts of the run: the gyro as bought, after
  a second at rest (and with an offset since), fused with y1, and fused by a filter that does not know the rate at
  the start.
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
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario

PARTS_S = ((0.0, 0.5), (0.5, 1.0), (1.0, 2.0), (2.0, 15.0), (0.0, 15.0))
PLACES_M = ((0.0672, 0.2015), (0.05, 0.25), (0.05, 0.15), (0.1, 0.25), (0.1, 0.2), (0.1, 0.15))
"""The bundled rig's first: 1/4 and 3/4 of its height."""


def experiment(*settings: str) -> Experiment:
    """Push recovery in the loop of gyro_free."""
    return prepare(load_scenario("push_recovery", settings, "gyro_free"))


def gyros(worlds: int) -> None:
    """Print the errors of every way to use the gyro."""
    setup = experiment()
    t = setup.run_many(worlds).trajectory
    assert t is not None
    dt, _, noise = setup.design.constructor_arguments
    gyro, rate, y1 = setup.scenario.sensors.mems_gyro, t["x2_rad_s"], t["y1_rad"]
    sigmas = [noise.tilt] * worlds

    def baselines(**changed: float) -> dict[str, np.ndarray]:
        """Rates of a gyro with other errors; the rig does not turn, so the tilt rate is the frame's."""
        return Baselines(replace(gyro, **changed), dt, setup.scenario.seed, range(worlds), sigmas).rates(rate, y1)

    def without_rest(offset: float) -> np.ndarray:
        reading = baselines(as_bought_offset_deg_s=offset)["mems_as_bought"]
        filters = FusedGyro(gyro.white_noise_sigma(dt), gyro.flicker_floor, sigmas, dt, math.radians(20.0), 0.0)
        return filters.rates(reading, y1)

    plain = baselines()
    rates = {
        "as bought": plain["mems_as_bought"],
        "after a second at rest (`mems_gyro`)": plain[MEMS_GYRO],
        **{
            f"the same, {offset:g} deg/s off since": baselines(bias_deg_s=offset)[MEMS_GYRO]
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
    """Print both parts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=20)
    gyros(parser.parse_args().worlds)
    places()


if __name__ == "__main__":
    main()
