"""Position servos of a robot's own: what to tell them so that they hold it where it stands."""

from __future__ import annotations

import mujoco
import numpy as np

ON_A_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)
_LINEAR = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE)
_INTEGRATOR = int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
_FILTERS = int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT)


def holds(actuator: mujoco.MjsActuator) -> bool:
    """Whether an actuator pulls a joint back to where it is told: its force has a part that goes by its position."""
    return int(actuator.trntype) in ON_A_JOINT and _pulls_back(int(actuator.biastype), actuator.biasprm)


def at_rest(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray]:
    """What position servos are told, and the states of their filters, so that they exert no force where they are.

    The force of a servo of gain k is k a + b0 + b1 l, with l its length, gear times the joint's position, and a what it
    is told, or its filter's or integrator's state.

    Args:
        model: The robot.
        data: The same where it is to be held, after a forward pass.

    Returns:
        act (na,) and ctrl (nu,), 0 for what is no position servo.
    """
    act, ctrl = np.zeros(model.na), np.zeros(model.nu)
    for i in range(model.nu):
        bias, kind = model.actuator_biasprm[i], int(model.actuator_gaintype[i])
        if not _pulls_back(int(model.actuator_biastype[i]), bias) or kind not in _LINEAR:
            continue
        length = float(data.actuator_length[i])
        gain = float(model.actuator_gainprm[i, 0])
        if kind == int(mujoco.mjtGain.mjGAIN_AFFINE):
            gain += float(model.actuator_gainprm[i, 1]) * length
        if gain == 0.0:
            continue
        told, dynamics = -(float(bias[0]) + float(bias[1]) * length) / gain, int(model.actuator_dyntype[i])
        state = int(model.actuator_actadr[i])
        if dynamics == _INTEGRATOR:
            act[state] = told
        elif dynamics in _FILTERS:
            act[state] = ctrl[i] = told
        elif state < 0:
            ctrl[i] = told
    return act, ctrl


def _pulls_back(kind: int, bias: np.ndarray) -> bool:
    return kind == int(mujoco.mjtBias.mjBIAS_AFFINE) and bool(bias[1] != 0.0)
