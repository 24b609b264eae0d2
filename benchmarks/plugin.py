"""Processor time of MuJoCo with an engine plugin, over that of the same model without it.

    python benchmarks/plugin.py [OBSERVER ...] [--worlds 64] (half a minute an observer)

Pairs of both models run one after the other; printed is the median of their ratios.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
from mujoco import rollout
from mujoco.batch import Batch

from cmg_mj import Experiment, load_scenario, prepare
from cmg_mj.features.plugin.driver import initial_states
from cmg_mj.features.plugin.make import make_plugin, write_plugin
from cmg_mj.features.plugin.model import START_KEY
from cmg_mj.plant.mjcf import parse, quiet

REPEATS = 15
STEPS = 400
"""Simulated time in which both stand: a model without a controller falls, and costs as much as one that stands."""
THREADS = os.cpu_count() or 1


def bench(experiment: Experiment, worlds: int) -> None:
    """Time a scenario's plugin, and print a line for each way of stepping."""
    with tempfile.TemporaryDirectory() as temporary:
        written = write_plugin(make_plugin(experiment, f"bench_{experiment.scenario.observer.kind}"), Path(temporary))
        mujoco.mj_loadPluginLibrary(str(written.library))
        models = mujoco.MjModel.from_xml_path(str(written.model)), parse(written.model).compile()
    print(
        f"{experiment.observer_title}, {experiment.scenario.plant.integrator} at "
        f"{1e3 * experiment.plant.timestep:g} ms, {models[0].npluginstate} numbers in the state, {worlds} worlds\n"
        "                      us a step   over bare MuJoCo"
    )
    ways = {"one world, mj_step": (step, 1), "worlds, rollout": (roll_out, worlds), "worlds, Batch": (batch, worlds)}
    for way, (timed, n) in ways.items():
        pairs = [[timed(model, n) / (n * STEPS) for model in models] for _ in range(REPEATS)]
        ratio = statistics.median(plugin / bare for plugin, bare in pairs)
        print(f"  {way:<20}{1e6 * statistics.median(plugin for plugin, _ in pairs):>9.2f}{ratio:>15.3f}")


def start_of(model: mujoco.MjModel) -> mujoco.MjData:
    """Make data in the scenario's initial state."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(START_KEY).id)
    return data


def step(model: mujoco.MjModel, worlds: int) -> float:
    """Time one world in MuJoCo's own loop."""
    data = start_of(model)
    return cpu_time(lambda: mujoco.mj_step(model, data, STEPS))


def roll_out(model: mujoco.MjModel, worlds: int) -> float:
    """Time many worlds by rollout."""
    start = start_of(model)
    if model.nplugin:
        states = initial_states(model, start, 0, worlds)
    else:
        kind = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)
        state = np.empty(mujoco.mj_stateSize(model, kind))
        mujoco.mj_getState(model, start, state, kind)
        states = np.tile(state, (worlds, 1))
    data = [mujoco.MjData(model) for _ in range(THREADS)]
    controls = np.broadcast_to(start.ctrl, (worlds, STEPS, model.nu)).copy()
    return cpu_time(lambda: rollout.rollout(model, data, states, controls))


def batch(model: mujoco.MjModel, worlds: int) -> float:
    """Time many worlds by MuJoCo's Batch."""
    start, many = start_of(model), Batch(model, worlds, THREADS)
    for name in ("qpos", "qvel", "act", "ctrl"):
        many.bind(name)[:] = getattr(start, name)
    return cpu_time(lambda: many.step(nstep=STEPS))


def cpu_time(call: Callable[[], object]) -> float:
    """Return the processor time that a call takes, of all threads [s]."""
    begin = time.process_time()
    call()
    return time.process_time() - begin


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("observers", nargs="*", default=["gyro_free"], metavar="OBSERVER")
    parser.add_argument("--worlds", type=int, default=64)
    options = parser.parse_args()
    for observer in options.observers:
        with quiet():
            bench(prepare(load_scenario("push_recovery", ["open_loop_observers=[]"], observer)), options.worlds)
