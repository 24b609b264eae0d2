"""Controls with which a robot's own position servos hold it where it stands."""

from __future__ import annotations

import mujoco
import numpy as np

from cmg_mj.plant.elements import ON_A_JOINT

_LINEAR = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE)
_INTEGRATOR = int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
_FILTERS = int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT)


def holds(actuator: mujoco.MjsActuator) -> bool:
    """Return whether an actuator is a position servo of a joint: its force depends on the joint's position."""
    return int(actuator.trntype) in ON_A_JOINT and _pulls_back(int(actuator.biastype), actuator.biasprm)


def rest_controls(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray]:
    """Return the controls and filter states with which position servos exert no force where they are.

    The force of a servo of gain k is k a + b0 + b1 l. Its length l is the gear times the joint's position, and a is its
    control, or the state of its filter or integrator.

    Args:
        model: The robot.
        data: The same where it is to be held, after a forward pass.

    Returns:
        act (na,) and ctrl (nu,); 0 for other actuators.
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
        target, dynamics = -(float(bias[0]) + float(bias[1]) * length) / gain, int(model.actuator_dyntype[i])
        state = int(model.actuator_actadr[i])
        if dynamics == _INTEGRATOR:
            act[state] = target
        elif dynamics in _FILTERS:
            act[state] = ctrl[i] = target
        elif state < 0:
            ctrl[i] = target
    return act, ctrl


def _pulls_back(kind: int, bias: np.ndarray) -> bool:
    return kind == int(mujoco.mjtBias.mjBIAS_AFFINE) and bool(bias[1] != 0.0)
