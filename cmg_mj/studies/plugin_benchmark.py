"""Processor time of MuJoCo with an engine plugin, over that of the same model without it."""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypedDict

import mujoco
import numpy as np
from mujoco import rollout
from mujoco.batch import Batch

from cmg_mj.plant.mujoco_state import quiet, set_control_callback
from cmg_mj.plant.plugin_model import START_KEY
from cmg_mj.plant.plugin_state import initial_states
from cmg_mj.plant.without_plugins import strip_plugins
from cmg_mj.simulation.experiment import Experiment
from cmg_mj.simulation.plugin_files import make_plugin, unused_name, write_plugin

REPEATS = 15
STEPS = 400
"""Simulated time in which both stand: a model without a controller falls, and costs as much as one that stands."""
WAYS = ("one world, mj_step", "worlds, rollout", "worlds, Batch")


class PluginFigures(TypedDict):
    """The figures that `cmg-mj bench plugin --json` prints."""

    observer: str
    worlds: int
    timestep_s: float
    integrator: str
    numbers_in_state: int
    over_bare: dict[str, float]
    microseconds_a_step: dict[str, float]


def measure(experiment: Experiment, worlds: int, threads: int, on_progress: Callable[[float], None]) -> PluginFigures:
    """Time a scenario's plugin: pairs of both models, one after the other; the median of their ratios.

    Args:
        experiment: The scenario.
        worlds: Worlds of rollout and Batch.
        threads: Their threads.
        on_progress: Called with the completed share.

    Returns:
        The figures.

    Raises:
        InputError: A plugin cannot be made of it.
    """
    with set_control_callback(None), quiet(), tempfile.TemporaryDirectory() as temporary:
        written = write_plugin(make_plugin(experiment, unused_name()), Path(temporary))
        mujoco.mj_loadPluginLibrary(str(written.library))
        stripped = strip_plugins(written.model)
        assert stripped is not None
        models = [mujoco.MjModel.from_xml_path(str(written.model)), stripped.parse().compile()]
    ratios: dict[str, float] = {}
    costs: dict[str, float] = {}
    with quiet():
        for i, (name, timed, n) in enumerate(zip(WAYS, (_step, _rollout, _batch), (1, worlds, worlds), strict=True)):
            pairs = [[timed(model, n, threads) / (n * STEPS) for model in models] for _ in range(REPEATS)]
            ratios[name] = statistics.median(plugin / bare for plugin, bare in pairs)
            costs[name] = 1e6 * statistics.median(plugin for plugin, _ in pairs)
            on_progress((i + 1) / len(WAYS))
    settings = experiment.scenario.plant
    return {
        "observer": experiment.observer_title,
        "worlds": worlds,
        "timestep_s": experiment.plant.timestep,
        "integrator": settings.integrator,
        "numbers_in_state": int(models[0].npluginstate),
        "over_bare": ratios,
        "microseconds_a_step": costs,
    }


def plugin_table(figures: PluginFigures) -> str:
    """Print the figures as text."""
    lines = [
        f"{figures['observer']}, {figures['integrator']} at {1e3 * figures['timestep_s']:g} ms, "
        f"{figures['numbers_in_state']} numbers in the state, {figures['worlds']} worlds",
        "                      us a step   over bare MuJoCo",
    ]
    costs = figures["microseconds_a_step"]
    return "\n".join(
        [*lines, *(f"  {way:<20}{costs[way]:>9.2f}{ratio:>15.3f}" for way, ratio in figures["over_bare"].items())]
    )


def _start(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(START_KEY).id)
    return data


def _step(model: mujoco.MjModel, worlds: int, threads: int) -> float:
    data = _start(model)
    return _cpu(lambda: mujoco.mj_step(model, data, STEPS))


def _states(model: mujoco.MjModel, worlds: int) -> np.ndarray:
    data = _start(model)
    if model.nplugin:
        return initial_states(model, data, 0, worlds)
    kind = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    return np.tile(state, (worlds, 1))


def _rollout(model: mujoco.MjModel, worlds: int, threads: int) -> float:
    states, data = _states(model, worlds), [mujoco.MjData(model) for _ in range(threads)]
    controls = np.broadcast_to(_start(model).ctrl, (worlds, STEPS, model.nu)).copy()
    return _cpu(lambda: rollout.rollout(model, data, states, controls))


def _batch(model: mujoco.MjModel, worlds: int, threads: int) -> float:
    start, batch = _start(model), Batch(model, worlds, threads)
    for name in ("qpos", "qvel", "act", "ctrl"):
        batch.bind(name)[:] = getattr(start, name)
    return _cpu(lambda: batch.step(nstep=STEPS))


def _cpu(call: Callable[[], object]) -> float:
    """Return the processor time that a call takes, of all threads [s]."""
    begin = time.process_time()
    call()
    return time.process_time() - begin
