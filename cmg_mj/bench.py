"""How fast the closed loop is, against bare MuJoCo in the same run, and what an observer's update costs."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch
from rich import box
from rich.table import Table

from cmg_mj.experiment import Experiment, prepare
from cmg_mj.observers import Measurement, Observer
from cmg_mj.scenario import parse_scenario
from cmg_mj.schema import Scenario

CONTROL_RATES_HZ = (200.0, 1000.0)
REPEATS = 7
ONE_WORLD_S = 3.0
MANY_WORLDS_S = 0.5
UPDATES = 400
"""So many updates of an observer are timed at once, along a recorded run."""


def measure(observers: Sequence[str], worlds: int, on_progress: Callable[[float], None]) -> dict[str, Any]:
    """Time every observer at every control rate.

    All sensors sample at the control rate. Closed loop and bare stepping alternate; each repeat gives one
    ratio, and the median ratio is reported, because the speed of a shared machine drifts.

    Args:
        observers: Names of the observers.
        worlds: Worlds of the batch.
        on_progress: Called with the share done.

    Returns:
        The figures, as `--json` prints them.

    Raises:
        InputError: An observer does not exist.
    """
    cases = [(observer, rate) for observer in observers for rate in CONTROL_RATES_HZ]
    experiments = [
        (prepare(_scenario(observer, rate, ONE_WORLD_S)), prepare(_scenario(observer, rate, MANY_WORLDS_S)))
        for observer, rate in cases
    ]
    rows = []
    for i, ((observer, rate), (one, many)) in enumerate(zip(cases, experiments, strict=True)):
        single = [(_bare_one(one), _closed_one(one)) for _ in range(REPEATS)]
        on_progress((i + 0.5) / len(cases))
        batch = [(_bare_many(many, worlds), _closed_many(many, worlds)) for _ in range(REPEATS)]
        on_progress((i + 1.0) / len(cases))
        on_floats, on_arrays = update_us(one, None), update_us(many, worlds)
        rows.append(
            {
                "observer": observer,
                "control_rate_hz": rate,
                "bare_step_us": statistics.median(bare for bare, _ in single),
                "closed_loop_step_us": statistics.median(closed for _, closed in single),
                "closed_loop_over_bare": statistics.median(closed / bare for bare, closed in single),
                "batch_world_step_us": statistics.median(bare for bare, _ in batch),
                "closed_loop_batch_world_step_us": statistics.median(closed for _, closed in batch),
                "closed_loop_share_of_batch": statistics.median(bare / closed for bare, closed in batch),
                "update_us": on_floats,
                "update_of_batch_us": on_arrays,
            }
        )
    return {"worlds": worlds, "processors": os.cpu_count(), "mujoco": mujoco.__version__, "figures": rows}


def bench_table(figures: dict[str, Any]) -> Table:
    """The table that `cmg-mj bench` prints."""
    table = Table(
        title=f"Microseconds, {figures['processors']} processors; sensors at the control rate; ratios: medians of "
        f"{REPEATS} pairs",
        box=box.SIMPLE_HEAD,
        title_justify="left",
    )
    worlds = figures["worlds"]
    columns = {
        "control\n[Hz]": ("control_rate_hz", "{:g}"),
        "a step:\nbare\nmj_step": ("bare_step_us", "{:.2f}"),
        "\nclosed\nloop": ("closed_loop_step_us", "{:.2f}"),
        "\n\nratio": ("closed_loop_over_bare", "{:.2f}"),
        f"a world-step:\nBatch of\n{worlds}": ("batch_world_step_us", "{:.2f}"),
        "\nclosed\nloop ": ("closed_loop_batch_world_step_us", "{:.2f}"),
        "\n\nshare": ("closed_loop_share_of_batch", "{:.2f}"),
        "an update:\none\nworld": ("update_us", "{:.1f}"),
        f"\n{worlds}\nworlds": ("update_of_batch_us", "{:.0f}"),
    }
    table.add_column("observer", vertical="bottom")
    for heading in columns:
        table.add_column(heading.strip(" "), justify="right", vertical="bottom")
    for row in figures["figures"]:
        table.add_row(row["observer"], *(_cell(row[key], pattern) for key, pattern in columns.values()))
    return table


def _cell(value: float | None, pattern: str) -> str:
    return "-" if value is None else pattern.format(value)


def update_us(experiment: Experiment, worlds: int | None) -> float | None:
    """Microseconds of one update of the observer, the median of some repeats along a recorded run.

    Args:
        experiment: Whose observer, and whose motion.
        worlds: So many worlds at once, on arrays; None for one, on floats.

    Returns:
        The time [us]; None for an observer that raises, or a rig that falls at once.
    """
    result = experiment.run() if worlds is None else experiment.run_many(worlds)
    assert result.trajectory is not None
    columns = [result.trajectory[name][:UPDATES] for name in ("y1_rad", "y2_rad", "u_rad_s")]
    if worlds is None:
        columns = [column.tolist() for column in columns]
    try:
        return time_of_update(experiment.design.observer(), *columns)
    except Exception:  # a user's observer may fail in any way; the figures of its run say how far it came
        return None


def time_of_update(observer: Observer, y1: Sequence[Any], y2: Sequence[Any], u: Sequence[Any]) -> float:
    """Microseconds of one update along given signals, the median of some repeats.

    Args:
        observer: The observer.
        y1: Measured tilt, (n_ticks,) floats or (n_ticks, n_worlds) [rad].
        y2: Measured gimbal angle, the same [rad].
        u: Gimbal rate, the same [rad/s].

    Returns:
        The time [us].
    """
    samples = [(Measurement(a, b), held) for a, b, held in zip(y1, y2, u, strict=True)]
    times = []
    with np.errstate(all="ignore"):  # worlds that have fallen are NaN
        for _ in range(REPEATS):
            state = observer.init(samples[0][0])
            start = time.perf_counter()
            for y, held in samples:
                state, _ = observer.step(state, y, held)
            times.append((time.perf_counter() - start) / len(samples) * 1e6)
    return statistics.median(times)


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


def _bare_one(experiment: Experiment) -> float:
    """Microseconds a step of mj_step alone."""
    data = experiment.plant.new_data()
    steps = round(experiment.scenario.duration_s / experiment.plant.model.opt.timestep)
    start = time.perf_counter()
    mujoco.mj_step(experiment.plant.model, data, steps)
    return (time.perf_counter() - start) / steps * 1e6


def _closed_one(experiment: Experiment) -> float:
    """Microseconds a step of a whole run, its trajectory and summary included."""
    start = time.perf_counter()
    result = experiment.run()
    return (time.perf_counter() - start) / _steps(experiment, result.seconds) * 1e6


def _bare_many(experiment: Experiment, worlds: int) -> float:
    """Microseconds a world-step of Batch alone, at its best: many steps a call."""
    model = experiment.plant.model
    data = experiment.plant.new_data()
    batch = Batch(model, worlds)
    for field in ("qpos", "qvel", "act", "ctrl"):
        batch.bind(field)[:] = getattr(data, field)
    steps = round(experiment.scenario.duration_s / model.opt.timestep)
    start = time.perf_counter()
    batch.step(nstep=steps)
    return (time.perf_counter() - start) / steps / worlds * 1e6


def _closed_many(experiment: Experiment, worlds: int) -> float:
    """Microseconds a world-step of a batch run without trajectory."""
    start = time.perf_counter()
    result = experiment.run_many(worlds, keep_trajectory=False)
    return (time.perf_counter() - start) / _steps(experiment, result.seconds) / worlds * 1e6


def _steps(experiment: Experiment, seconds: float) -> float:
    return seconds / experiment.plant.model.opt.timestep
