"""The largest physics step of a rig."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.scenario.time_grid import TimeGrid

RK4_LIMIT = 1.5
"""Physics step times the rig's fastest rate: with RK4 the figures of a summary are then within 0.2 % of their limit.

RK4 is stable up to 2.8. `docs/studies/steps.py` prints the table. A torque that swings so fast is integrated as by
Simpson's rule, to 1.5^4/2880 = 0.18 %.
"""
MAX_STEPS = 1_000_000_000
"""Most physics steps of a run; so many take hours."""
Vector = np.ndarray | float
OTHERS_LIMIT_S = 0.001
"""Largest step of MuJoCo's other integrators; none is as accurate at any step that costs less [s]."""


def fit_step(grid: TimeGrid, limit_s: float) -> float:
    """Fit the physics step of a run.

    Args:
        grid: The times that whole steps must fill.
        limit_s: The largest step that is accurate enough for the plant [s]: see `largest_step`.

    Returns:
        The named step, or the largest within the limit of which a whole number fills the period [s].

    Raises:
        InputError: The run would have too many steps to come to its end.
    """
    step = grid.timestep_s or grid.period_s / math.ceil(grid.period_s / limit_s * (1.0 - 1e-9))
    steps = grid.duration_s / step
    if steps > MAX_STEPS:
        raise InputError(
            f"duration_s = {grid.duration_s:g}: {steps:.3g} physics steps of {step:g} s; at most "
            f"{MAX_STEPS:g} are taken, {MAX_STEPS * step:g} s"
        )
    return step


def largest_step(model: mujoco.MjModel, key: int, own_s: float, shake_rate: float) -> float:
    """Return the largest physics step that is accurate enough for a rig [s].

    Args:
        model: The compiled model, with its friction and its integrator.
        key: The keyframe at which it is judged.
        own_s: The model file's own step [s], which is never exceeded: it knows about contacts, say.
        shake_rate: Rate at which an unbalanced flywheel shakes the rig, which none of its poles shows [rad/s].

    Returns:
        The step [s].
    """
    if model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:
        return min(own_s, OTHERS_LIMIT_S)
    jacobian = state_matrix(model, key)
    # A model without finite accelerations is found elsewhere.
    fastest = float(np.abs(np.linalg.eigvals(jacobian)).max()) if np.isfinite(jacobian).all() else 0.0
    return min(own_s, RK4_LIMIT / max(fastest, shake_rate, RK4_LIMIT / own_s))


def state_matrix(model: mujoco.MjModel, key: int) -> np.ndarray:
    """Return the matrix A of a rig without dry friction, linearised at a keyframe by central differences.

    Args:
        model: The compiled model.
        key: The keyframe.

    Returns:
        A, (n, n), of the joints' angles from the keyframe (nv,), their rates (nv,) and the actuators' states.
    """
    nv, slope = model.nv, _slopes(model, key)
    sizes = np.ones(2 * nv + model.na)  # of what the state is turned from, for the length of a difference
    sizes[nv:] = np.maximum(1.0, np.abs([*model.key_qvel[key], *model.key_act[key]]))
    for joint in np.flatnonzero(model.jnt_type >= int(mujoco.mjtJoint.mjJNT_SLIDE)):
        sizes[model.jnt_dofadr[joint]] = max(1.0, abs(model.key_qpos[key, model.jnt_qposadr[joint]]))
    h = 1e-5 * sizes
    columns = [(slope(move) - slope(-move)) / (2.0 * length) for move, length in zip(np.diag(h), h, strict=True)]
    return np.array(columns).T


def input_column(model: mujoco.MjModel, key: int, command: np.ndarray, forces: Vector = 0.0) -> np.ndarray:
    """Return the column of B for commands and forces in given proportions.

    Args:
        model: The compiled model.
        key: The keyframe.
        command: What each actuator gets, (nu,).
        forces: What each joint gets beside it, (nv,) [N or N m].

    Returns:
        The slope of the state of `state_matrix` by the command, (n,).
    """
    slope, h = _slopes(model, key), 1e-5
    return (slope(0.0, h * command, h * forces) - slope(0.0, -h * command, -h * forces)) / (2.0 * h)


def _slopes(model: mujoco.MjModel, key: int) -> Callable[..., np.ndarray]:
    """Return the derivative of the state as a function of moves from the keyframe; without dry friction."""
    smooth = copy.copy(model)
    smooth.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
    data, nv = mujoco.MjData(smooth), smooth.nv

    def slope(move: Vector, command: Vector = 0.0, forces: Vector = 0.0) -> np.ndarray:
        mujoco.mj_resetDataKeyframe(smooth, data, key)
        state = np.concatenate([np.zeros(nv), data.qvel, data.act]) + move
        mujoco.mj_integratePos(smooth, data.qpos, state[:nv], 1.0)
        data.qvel[:], data.act[:] = state[nv : 2 * nv], state[2 * nv :]
        data.ctrl[:] += command
        data.qfrc_applied[:] = forces
        mujoco.mj_forward(smooth, data)
        return np.concatenate([data.qvel, data.qacc, data.act_dot])

    return slope
