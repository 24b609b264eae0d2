"""The state of plugins in MuJoCo's data: seeds, worlds, and whether they have failed."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import mujoco
import numpy as np

from cmg_mj.codegen.engine_plugin.rig import LARGEST_SEED
from cmg_mj.errors import InputError
from cmg_mj.plant.plugin_names import plugin_names
from cmg_mj.plant.without_plugins import OWN

SEED, WORLD, STATUS, STEPS = range(4)
"""Places in an instance's state, as state.h numbers them."""
FAILED = 2.0
"""A status, as state.h numbers it."""


def set_world(model: mujoco.MjModel, data: mujoco.MjData, seed: int, world: int) -> None:
    """Choose the noise of the plugins in a simulation that has not yet been stepped since its reset.

    Args:
        model: A model with plugins of this package.
        data: Its data.
        seed: Seed of the noise.
        world: Number of the world.

    Raises:
        InputError: The model has no such plugin, a number is outside the plugin's range, or the noise has begun.
    """
    for name, number in (("seed", seed), ("world", world)):
        if not 0 <= number <= LARGEST_SEED or number != int(number):
            raise InputError(f"{name} = {number}: a plugin takes {name}s from 0 to 2^53, as whole numbers")
    for state in instance_states(model, data):
        if state[STEPS]:
            raise InputError("the plugin's noise has begun: choose seed and world right after a reset")
        state[SEED], state[WORLD] = seed, world


def instance_states(model: mujoco.MjModel, data: mujoco.MjData) -> list[np.ndarray]:
    """Return the states of the plugins of this package, which may be written to.

    Raises:
        InputError: The model has no such plugin.
    """
    starts = [int(model.plugin_stateadr[i]) for i, name in enumerate(plugin_names(model)) if name.startswith(OWN)]
    if not starts:
        raise InputError("the model has no plugin of cmg_mj's")
    return [data.plugin_state[start:] for start in starts]


def initial_states(model: mujoco.MjModel, data: mujoco.MjData, seed: int, worlds: int | Sequence[int]) -> np.ndarray:
    """Make the initial states of many worlds, as `mujoco.rollout` takes them.

    Args:
        model: A model with plugins of this package.
        data: Its data in the state that all worlds start from, not yet stepped since its reset. It stays as it is.
        seed: Seed of the noise.
        worlds: How many, or their numbers.

    Returns:
        Full physics states, (n_worlds, n_numbers).

    Raises:
        InputError: See `set_world`.
    """
    kind = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)
    numbers = range(worlds) if isinstance(worlds, int) else worlds
    states = np.empty((len(numbers), mujoco.mj_stateSize(model, kind)))
    data = copy.copy(data)
    for state, world in zip(states, numbers, strict=True):
        set_world(model, data, seed, world)
        mujoco.mj_getState(model, data, state, kind)
    return states
