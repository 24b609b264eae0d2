"""Misfits of right and wrong models: `model_misfit` of runs whose model is known, over seeds.

    python docs/studies/model_misfit.py [SEEDS] (about half a minute)

Prints the least and the largest misfit of each condition, with the right model and with wrong ones, and those of the
shipped log of a motor with the pendulum of the example.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from cmg_mj import load_scenario, prepare
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.features.replay.log import Log, ReadOptions
from cmg_mj.features.replay.reading import read_log
from cmg_mj.features.replay.reference import MISFIT, model_misfit

DENSITY = "sensors.accelerometer.noise_density_ug_rthz"
CONDITIONS = {
    "push_recovery": ("push_recovery", []),
    "on gyro_free": ("push_recovery", ["observer.kind='gyro_free'"]),
    "1.5 deg of bias": ("push_recovery", ["observer.kind='gyro_free'", "plant.equilibrium_bias_deg=1.5"]),
    "on the gyro, 1 ug/rtHz": ("push_recovery", ["controller.feedback='fog'", f"{DENSITY}=1"]),
    "on the gyro, 2,000 ug/rtHz": ("push_recovery", ["controller.feedback='fog'", f"{DENSITY}=2000"]),
    "on linear, 1,000 ug/rtHz": ("push_recovery", ["observer.kind='linear'", f"{DENSITY}=1000"]),
    "backlash of 0.5 deg": ("push_recovery", ["observer.kind='gyro_free'", "plant.gimbal_backlash_arcmin=30"]),
    "10 ms late": ("push_recovery", ["observer.kind='gyro_free'", "sensors.accelerometer.latency_s=0.01"]),
    "1 kHz": ("push_recovery", ["observer.kind='gyro_free'", "controller.rate_hz=1000",
              "sensors.accelerometer.rate_hz=1000", "sensors.encoder.rate_hz=1000", "duration_s=6"]),
    "of 6 s": ("push_recovery", ["observer.kind='gyro_free'", "duration_s=6"]),
    "of 6 s, on the gyro": ("push_recovery", ["controller.feedback='fog'", "duration_s=6"]),
    "single_gimbal": ("single_gimbal", []),
    "observer_tuning": ("observer_tuning", []),
}  # fmt: skip
WRONG = {
    "momentum the other way": lambda m: replace(m, omega_d=-m.omega_d),
    "gravity's torque x 3": lambda m: replace(m, gravity_torque=3.0 * m.gravity_torque),
    "inertia / 3": lambda m: replace(m, J1=m.J1 / 3.0),
}


def main(seeds: int) -> None:
    """Print the table."""
    print(f"{'':28}{'right':>14}" + "".join(f"{name:>24}" for name in WRONG))
    for name, (scenario, settings) in CONDITIONS.items():
        try:
            experiment = prepare(load_scenario(scenario, settings))
        except ValueError as error:
            print(f"{name:28} {error}")
            continue
        trajectory = experiment.run_many(seeds).trajectory
        assert trajectory is not None
        logs = [_log(trajectory.columns, i, 1.0 / experiment.scenario.controller.rate_hz) for i in range(seeds)]
        right = experiment.plant.reduced
        cells = [_range(logs, model) for model in (right, *(wrong(right) for wrong in WRONG.values()))]
        print(f"{name:28}{cells[0]:>14}" + "".join(f"{cell:>24}" for cell in cells[1:]), flush=True)
    path = Path(__file__).parents[2] / "examples" / "data" / "stepper_encoder_gyro.csv"
    for tilt in ("encoder_rad", "tilt_acc_rad"):
        log = read_log(path, ReadOptions({"time": "time_s", "tilt": tilt, "rate": "gyr_y_rad_s"}))
        print(f"a motor's log, {tilt}: {model_misfit(log, ReducedModel(0.06, 0.0, 0.0, 1.0, 3.4)):.1f}")
    print(f"A model is doubted above {MISFIT:g}.")


def _log(columns: Mapping[str, np.ndarray], world: int, dt: float) -> Log:
    names = ("time_s", "y1_rad", "y2_rad", "u_rad_s")
    rows = {name: columns[name] if columns[name].ndim == 1 else columns[name][:, world] for name in names}
    end = int(np.isfinite(rows["y1_rad"]).sum())
    return Log("run", dt, {name: values[:end] for name, values in rows.items()}, [slice(0, end)], frozenset())


def _range(logs: list[Log], model: ReducedModel) -> str:
    values = [value for log in logs if (value := model_misfit(log, model)) is not None]
    return f"{min(values):.2f} to {max(values):.2f}"


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
