"""Speed of the closed loop against bare MuJoCo in the same run, and cost of an observer's update.

python benchmarks/loop.py [--observers homogeneous,ltv] [--worlds 256] [--json] (a minute and a quarter an observer)
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import mujoco
from mujoco.batch import Batch
from rich import box
from rich.console import Console
from rich.table import Table

from cmg_mj.observers import OBSERVERS
from cmg_mj.results.result import Result
from cmg_mj.runs.benchmark import REPEATS, time_of_update
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import parse_scenario
from cmg_mj.scenario.schema import Scenario

CONTROL_RATES_HZ = (200.0, 1000.0)
ONE_WORLD_S = 6.0
MANY_WORLDS_S = 1.0
UPDATES = 400
"""Updates of an observer that are timed at once, along a recorded run."""


def measure(observers: Sequence[str], worlds: int) -> dict[str, Any]:
    """Time every observer at every control rate.

    All sensors sample at the control rate. Closed loop and bare stepping alternate; each repeat gives one
    ratio, and the median ratio is reported, because the speed of a shared machine drifts.

    Args:
        observers: Names of the observers.
        worlds: Worlds of the batch.

    Returns:
        The figures that `--json` prints.

    Raises:
        InputError: An observer does not exist.
    """
    cases = [(observer, rate) for observer in observers for rate in CONTROL_RATES_HZ]
    experiments = [
        (prepare(_scenario(observer, rate, ONE_WORLD_S)), prepare(_scenario(observer, rate, MANY_WORLDS_S)))
        for observer, rate in cases
    ]
    rows = []
    load = _load()
    for (observer, rate), (one, many) in zip(cases, experiments, strict=True):
        single = [(_bare_one(one), _closed_one(one)) for _ in range(REPEATS)]
        batch = [(_bare_many(many, worlds), _closed_many(many, worlds)) for _ in range(REPEATS)]
        on_floats, on_arrays = update_us(one, None), update_us(many, worlds)
        rows.append(
            {
                "observer": observer,
                "control_rate_hz": rate,
                "timestep_ms": 1e3 * one.plant.timestep,
                "bare_ms": _median_ms(bare.wall for bare, _ in single),
                "closed_loop_ms": _median_ms(closed.wall for _, closed in single),
                "closed_loop_over_bare": statistics.median(closed.wall / bare.wall for bare, closed in single),
                "batch_ms": _median_ms(bare.wall for bare, _ in batch),
                "closed_loop_batch_ms": _median_ms(closed.wall for _, closed in batch),
                "closed_loop_share_of_batch": statistics.median(bare.wall / closed.wall for bare, closed in batch),
                "closed_loop_batch_cpu_ms": _median_ms(closed.cpu for _, closed in batch),
                "update_us": on_floats,
                "update_of_batch_us": on_arrays,
            }
        )
    return {
        "worlds": worlds,
        "processors": os.cpu_count(),
        "load_before": load,
        "mujoco": mujoco.__version__,
        "figures": rows,
    }


def bench_table(figures: dict[str, Any]) -> Table:
    """Return the table that is printed."""
    load = figures["load_before"]
    busy = "" if load is None else f", {load:.1f} processes wanted one before"
    title = (
        f"{figures['processors']} processors{busy}; sensors at the control rate; ratios: medians of {REPEATS} "
        "pairs; bare: MuJoCo alone with the same steps and forward passes"
    )
    worlds = figures["worlds"]
    columns = {
        "control\n[Hz]": ("control_rate_hz", "{:g}"),
        "step\n[ms]": ("timestep_ms", "{:g}"),
        "1 s of one\nworld [ms]:\nbare": ("bare_ms", "{:.2f}"),
        "\nclosed\nloop": ("closed_loop_ms", "{:.2f}"),
        "\n\nratio": ("closed_loop_over_bare", "{:.2f}"),
        f"1 s of one\nof {worlds} [ms]:\nbare Batch": ("batch_ms", "{:.2f}"),
        "\nclosed\nloop ": ("closed_loop_batch_ms", "{:.2f}"),
        "\n\nshare": ("closed_loop_share_of_batch", "{:.2f}"),
        "\nof all\nthreads": ("closed_loop_batch_cpu_ms", "{:.2f}"),
        "an update\n[us]: one\nworld": ("update_us", "{:.1f}"),
        f"\n{worlds}\nworlds": ("update_of_batch_us", "{:.0f}"),
    }
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    table.add_column("observer", vertical="bottom")
    for heading in columns:
        table.add_column(heading.strip(" "), justify="right", vertical="bottom")
    for row in figures["figures"]:
        table.add_row(row["observer"], *(_cell(row[key], pattern) for key, pattern in columns.values()))
    return table


def _median_ms(seconds: Iterable[float]) -> float:
    return 1e3 * statistics.median(seconds)


def _cell(value: float | None, pattern: str) -> str:
    return "-" if value is None else pattern.format(value)


def update_us(experiment: Experiment, worlds: int | None) -> float | None:
    """Microseconds of one update of the observer, the median of some repeats along a recorded run.

    Args:
        experiment: Gives the observer and the motion.
        worlds: Number of worlds at once, on arrays; None for one world, on floats.

    Returns:
        The time [us]; None for an observer that raises, or a rig that falls at once.
    """
    result = _finished(experiment.run() if worlds is None else experiment.run_many(worlds))
    assert result.trajectory is not None
    columns = [result.trajectory[name][:UPDATES] for name in ("y1_rad", "y2_rad", "acceleration_rad_s2", "u_rad_s")]
    if worlds is None:
        columns = [column.tolist() for column in columns]
    try:
        return time_of_update(experiment.design.observer(), *columns)
    except Exception:  # a user's observer may fail in any way; the figures of its run say how far it came
        return None


def _scenario(observer: str, rate: float, duration_s: float) -> Scenario:
    sensors = {kind: {"rate_hz": rate} for kind in ("accelerometer", "encoder", "fog")}
    return parse_scenario(
        {
            "duration_s": duration_s,
            "plant": {"equilibrium_bias_deg": 0.0, "initial_tilt_deg": 0.2},
            "controller": {"rate_hz": rate},
            "observer": {"kind": observer},
            "sensors": sensors,
            # An observer that cannot hold the rig must not end the measurement.
            "metrics": {"fall_angle_deg": 89.0},
        }
    )


class _Cost(NamedTuple):
    """Time for a simulated second of one world [s]."""

    wall: float
    cpu: float
    """Processor time of all threads."""


def _timed(work: Callable[[], float], worlds: int) -> _Cost:
    """Time work that returns how many seconds it has simulated of so many worlds."""
    wall, cpu = time.perf_counter(), time.process_time()
    seconds = work()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return _Cost(wall / (seconds * worlds), cpu / (seconds * worlds))


def _bare_one(experiment: Experiment) -> _Cost:
    """MuJoCo alone on one world: a forward pass where sensors are read, then steps."""
    model, data = experiment.plant.model, experiment.plant.new_data()
    samples, steps = _samples(experiment)

    def work() -> float:
        for _ in range(samples):
            mujoco.mj_forward(model, data)
            mujoco.mj_step(model, data, steps)
        return samples * steps * model.opt.timestep

    return _timed(work, 1)


def _bare_many(experiment: Experiment, worlds: int) -> _Cost:
    """MuJoCo's Batch alone: the same."""
    model, data = experiment.plant.model, experiment.plant.new_data()
    samples, steps = _samples(experiment)
    batch = Batch(model, worlds)
    for field in ("qpos", "qvel", "act", "ctrl"):
        batch.bind(field)[:] = getattr(data, field)

    def work() -> float:
        for _ in range(samples):
            batch.forward()
            batch.step(nstep=steps)
        return samples * steps * model.opt.timestep

    return _timed(work, worlds)


def _closed_one(experiment: Experiment) -> _Cost:
    """Time a whole run, its trajectory and summary included."""
    return _timed(lambda: _finished(experiment.run()).seconds, 1)


def _closed_many(experiment: Experiment, worlds: int) -> _Cost:
    """Time a batch run without trajectory."""
    return _timed(lambda: _finished(experiment.run_many(worlds, keep_trajectory=False)).seconds, worlds)


def _finished(result: Result) -> Result:
    """Return the result of a complete run; an interrupted run ends the measurement."""
    if any(outcome.kind == "interrupted" for outcome in result.outcomes):
        raise KeyboardInterrupt
    return result


def _samples(experiment: Experiment) -> tuple[int, int]:
    """Return the number of sensor samples of a run, and the physics steps between two."""
    steps = experiment.controller().steps_per_sample
    return round(experiment.scenario.duration_s / (experiment.plant.timestep * steps)), steps


def _load() -> float | None:
    """Return the load average of the last minute; None where the system has none."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--observers", default=",".join(OBSERVERS), metavar="NAMES")
    parser.add_argument("--worlds", type=int, default=256)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    figures = measure(options.observers.split(","), options.worlds)
    if options.json:
        print(json.dumps(figures, indent=2))
    else:
        Console().print(bench_table(figures))
