"""Runs a rig whose model has an engine plugin; and the plugins' state in MuJoCo's data: seeds, worlds, failures."""

from __future__ import annotations

import copy
import ctypes
from collections.abc import Sequence

import mujoco
import numpy as np

from cmg_mj.core.axis import Tick
from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.core.loop import ControlLoop
from cmg_mj.core.types import as_estimate
from cmg_mj.features.plugin.model import INSTANCE, mujoco_library
from cmg_mj.plant.mjcf import OWN
from cmg_mj.plant.physics import OneWorld

SEED, WORLD, STATUS, STEPS = range(4)
"""Places in an instance's state, as rig.h numbers them."""
FAILED = 2.0
"""A status, as rig.h numbers it."""
MAX_SEED = 2**53
"""Seeds and worlds lie in the plugin's state, whose numbers are doubles."""


class PluginLoop(ControlLoop):
    """The loop of a run in which a plugin in the plant's model decides: MuJoCo decides, the loop records.

    The Python controller is led along the plugin's decisions, for what the plugin does not have: the gyro's readings
    and the open-loop observers.
    """

    def decide(self) -> None:
        """Record the plugin's decision, which it takes in every forward pass."""
        assert isinstance(self.physics, OneWorld)
        model, data = self.physics.model, self.physics.data
        if any(state[STATUS] == FAILED for state in instance_states(model, data)):
            raise RunStopped(f"the plugin has stopped at t = {data.time:g} s")
        self.controller.update(self.step, self.readings)
        prefixes = ["/".join(filter(None, (INSTANCE, name))) for name in self.physics.axis_names]
        ticks = zip(self.controller.ticks, prefixes, strict=True)
        self.controller.overrule([_decided(tick, data, prefix) for tick, prefix in ticks])


def _decided(tick: Tick, data: mujoco.MjData, prefix: str) -> Tick:
    """Return a tick with the plugin's numbers."""

    def shown(quantity: str) -> list[float]:
        return data.sensor(f"{prefix}/{quantity}").data.tolist()

    (y1,), (y2,), (acceleration,) = shown("tilt"), shown("gimbal_angle"), shown("acceleration")
    (u,), (x_e,) = shown("command"), shown("integrator")
    estimates = [as_estimate(shown("estimate")), *tick.estimates[1:]]
    return tick._replace(y1=y1, y2=y2, acceleration=acceleration, u=u, x_e=x_e, estimates=estimates)


def check_noise(seed: float, world: float) -> None:
    """Refuse a seed or world that no plugin's state holds.

    Raises:
        InputError: It is out of range, or no whole number.
    """
    for name, number in (("seed", seed), ("world", world)):
        if not 0 <= number <= MAX_SEED or number != int(number):
            raise InputError(f"{name} = {number}: a plugin takes {name}s from 0 to 2^53, as whole numbers")


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
    check_noise(seed, world)
    for state in instance_states(model, data):
        if state[STEPS]:
            raise InputError("the plugin's noise has begun: choose seed and world right after a reset")
        state[SEED], state[WORLD] = seed, world


class _Plugin(ctypes.Structure):
    """The beginning of MuJoCo's mjpPlugin."""

    _fields_ = (("name", ctypes.c_char_p),)


def instance_states(model: mujoco.MjModel, data: mujoco.MjData) -> list[np.ndarray]:
    """Return the states of the plugins of this package, which may be written to.

    Raises:
        InputError: The model has no such plugin.
    """
    library = mujoco_library()
    library.mjp_getPluginAtSlot.restype = ctypes.POINTER(_Plugin)  # its names MuJoCo's Python package does not tell
    states = [
        data.plugin_state[start:]
        for slot, start in zip(model.plugin.tolist(), model.plugin_stateadr.tolist(), strict=True)
        if library.mjp_getPluginAtSlot(slot).contents.name.decode().startswith(OWN)
    ]
    if not states:
        raise InputError("the model has no plugin of cmg_mj's")
    return states


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
