"""Processor time of sweeps by that of MuJoCo's batch alone, and the trials a second.

    python benchmarks/sweep.py [OBSERVER ...] [--worlds 512] (a minute an observer)

A chunk of many worlds of one plant, and one of many plants, on one thread: threads of a pool that wait for work take
processor time as well, which is nobody's.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from mujoco.batch import Batch

from cmg_mj import load_scenario
from cmg_mj.features.sweeps.chunks import compute
from cmg_mj.features.sweeps.study import SweepStudy, parse_axis

WORLDS_A_PLANT = 4
PLANTS = {
    "plant.equilibrium_bias_deg": "-0.8:0.8",
    "plant.gimbal_armature_kg_m2": "0:0.002",
    "plant.gimbal_friction_n_m": "0:0.05",
    "plant.tilt_friction_n_m": "0:0.02",
    "sensors.accelerometer.noise_density_ug_rthz": "100:800",
    "push.0.torque_n_m": "1:3",
}
"""Fields in which the plants differ."""


def bench(observer: str, worlds: int, *, many_plants: bool) -> None:
    """Time a chunk of 15 s of push_recovery, and print a line."""
    scenario = load_scenario("push_recovery", ["duration_s=15"])
    study = SweepStudy(scenario, (parse_axis("plant.equilibrium_bias_deg", "0.5", "plant"),), (observer,), worlds)
    if many_plants:
        axes = tuple(parse_axis(field, values, field) for field, values in PLANTS.items())
        study = SweepStudy(scenario, axes, (observer,), WORLDS_A_PLANT, max(1, worlds // WORLDS_A_PLANT))
    _, trials = study.chunk(0)
    with clocked() as in_batch:
        start = time.process_time()
        rows = compute(study, observer, trials, threads=1)
        whole = time.process_time() - start
    print(
        f"{observer}: {len({number for number, _ in trials})} plants, {len(rows)} trials, "
        f"{sum(row['stood'] is True for row in rows)} stood: {whole:.1f} s, {in_batch[0]:.1f} s in the batch, "
        f"ratio {whole / in_batch[0]:.3f}, {len(rows) / whole:.1f} trials a second"
    )


@contextmanager
def clocked() -> Iterator[list[float]]:
    """Count the processor time in a batch's calls, in one number [s]."""
    spent = [0.0]
    plain = {name: getattr(Batch, name) for name in ("step", "forward")}

    def clock(call: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*args: Any, **kwargs: Any) -> Any:
            start = time.process_time()
            try:
                return call(*args, **kwargs)
            finally:
                spent[0] += time.process_time() - start

        return timed

    for name, call in plain.items():
        setattr(Batch, name, clock(call))
    try:
        yield spent
    finally:
        for name, call in plain.items():
            setattr(Batch, name, call)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("observers", nargs="*", default=["gyro_free"], metavar="OBSERVER")
    parser.add_argument("--worlds", type=int, default=512)
    options = parser.parse_args()
    for name in options.observers:
        for many in (False, True):
            bench(name, options.worlds, many_plants=many)
