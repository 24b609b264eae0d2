"""The cost of a sweep relative to its physics: processor time of the whole loop by that of MuJoCo's batch alone.

python benchmarks/sweep.py [--observers homogeneous] [--worlds 512] [--json] (a minute an observer)
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import ParamSpec, TypedDict, TypeVar

from mujoco.batch import Batch
from rich import box
from rich.console import Console
from rich.table import Table

from cmg_mj.observers import OBSERVERS
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.studies.sweeps.axes import parse_axis
from cmg_mj.studies.sweeps.chunk import compute
from cmg_mj.studies.sweeps.study import SweepStudy

SCENARIO, DURATION_S = "push_recovery", 15.0
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
P = ParamSpec("P")
R = TypeVar("R")


class ChunkCost(TypedDict):
    """The cost of a chunk; the CPU times are of all, and of MuJoCo's batch alone [s]."""

    observer: str
    rigs: int
    trials: int
    stood: int
    cpu_s: float
    batch_cpu_s: float
    cpu_over_batch: float


class SweepCost(TypedDict):
    """The cost of a sweep, as `--json` prints it."""

    scenario: str
    duration_s: float
    figures: list[ChunkCost]


def measure(observers: Sequence[str], worlds: int) -> SweepCost:
    """Time a chunk of two sweeps for each observer: many worlds of one plant, and many plants.

    A chunk runs on one thread: threads of a pool that wait for work take processor time as well, which is nobody's.

    Args:
        observers: Names of the observers.
        worlds: Trials of a chunk.

    Returns:
        The figures, as `--json` prints them.

    Raises:
        InputError: An observer does not exist.
    """
    cases = [(observer, many_plants) for observer in observers for many_plants in (False, True)]
    figures: list[ChunkCost] = []
    for observer, many_plants in cases:
        study = _study(observer, worlds, many_plants=many_plants)
        chunk = study.chunks[0]
        with _clocked() as clock:
            start = time.process_time()
            rows = compute(study, chunk, lambda share: None, threads=1)
            whole = time.process_time() - start
        figures.append(
            {
                "observer": observer,
                "rigs": len({number for number, _ in chunk.trials}),
                "trials": len(rows),
                "stood": sum(row["stood"] is True for row in rows),
                "cpu_s": whole,
                "batch_cpu_s": clock[0],
                "cpu_over_batch": whole / clock[0],
            }
        )
    return {"scenario": SCENARIO, "duration_s": DURATION_S, "figures": figures}


def table(cost: SweepCost) -> Table:
    """Make the table that is printed."""
    title = (
        f"{cost['scenario']}, {cost['duration_s']:g} s, on one thread: processor time of all by that in MuJoCo's batch"
    )
    rows = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    rows.add_column("observer", vertical="bottom")
    for heading in ("rigs", "trials", "stood", "all [s]", "batch [s]", "ratio", "trials\na second"):
        rows.add_column(heading, justify="right", vertical="bottom")
    for row in cost["figures"]:
        counts = (str(row[key]) for key in ("rigs", "trials", "stood"))
        rate = row["trials"] / row["cpu_s"]
        seconds = (f"{row['cpu_s']:.1f}", f"{row['batch_cpu_s']:.1f}", f"{row['cpu_over_batch']:.3f}", f"{rate:.1f}")
        rows.add_row(row["observer"], *counts, *seconds)
    return rows


def _study(observer: str, worlds: int, *, many_plants: bool) -> SweepStudy:
    """Make a sweep of so many trials: many worlds of one plant, or few of each of many plants."""
    scenario = load_scenario(SCENARIO, [f"duration_s={DURATION_S}"])
    if not many_plants:
        return SweepStudy(scenario, (parse_axis("plant.equilibrium_bias_deg", "0.5", "rig"),), (observer,), worlds)
    axes = tuple(parse_axis(field, values, field) for field, values in PLANTS.items())
    return SweepStudy(scenario, axes, (observer,), WORLDS_A_PLANT, "sample", max(1, worlds // WORLDS_A_PLANT))


@contextmanager
def _clocked() -> Iterator[list[float]]:
    """Count the processor time in a batch's calls, in one number [s]."""
    spent = [0.0]
    plain = {name: getattr(Batch, name) for name in ("step", "forward")}

    def clocked(call: Callable[P, R]) -> Callable[P, R]:
        def timed(*args: P.args, **kwargs: P.kwargs) -> R:
            start = time.process_time()
            try:
                return call(*args, **kwargs)
            finally:
                spent[0] += time.process_time() - start

        return timed

    for name, call in plain.items():
        setattr(Batch, name, clocked(call))
    try:
        yield spent
    finally:
        for name, call in plain.items():
            setattr(Batch, name, call)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--observers", default=",".join(OBSERVERS), metavar="NAMES")
    parser.add_argument("--worlds", type=int, default=512)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    figures = measure(options.observers.split(","), options.worlds)
    if options.json:
        print(json.dumps(figures, indent=2))
    else:
        Console().print(table(figures))
