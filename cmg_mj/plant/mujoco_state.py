"""MuJoCo's process-wide switches, and its data in a given state."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np


@contextmanager
def quiet() -> Iterator[None]:
    """Switch off warnings of MuJoCo and numpy, and MUJOCO_LOG.TXT in the current folder. Callers report faults."""
    before, config = mujoco.MjLogConfig.get(), mujoco.MjLogConfig.get()
    config.logto_console = config.logto_file = False
    config.set()
    try:
        with np.errstate(all="ignore"):
            yield
    finally:
        before.set()


@contextmanager
def set_control_callback(callback: object | None) -> Iterator[None]:
    """Have MuJoCo call this control callback (None: none), and the one before it again afterwards."""
    before = mujoco.get_mjcb_control()
    mujoco.set_mjcb_control(callback)
    try:
        yield
    finally:
        mujoco.set_mjcb_control(before)


def at_keyframe(model: mujoco.MjModel, key: int) -> mujoco.MjData:
    """Return fresh data at a keyframe, after a forward pass."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_forward(model, data)
    return data


def posed(model: mujoco.MjModel, qpos: np.ndarray) -> mujoco.MjData:
    """Return fresh data with given joint positions, after a forward pass."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    return data
