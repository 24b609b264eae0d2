"""A rig linearised at its keyframe: from command and push to what its sensors show, servos and viscous friction in."""

from __future__ import annotations

import mujoco
import numpy as np

from cmg_mj.errors import InputError
from cmg_mj.plant.axis import Axis
from cmg_mj.plant.linearisation import output_matrix, state_and_input
from cmg_mj.plant.mujoco_state import at_keyframe
from cmg_mj.plant.parts import TILT_ELEMENT
from cmg_mj.plant.plant import Plant
from cmg_mj.plant.step_limit import input_column
from cmg_mj.plant.tilt_line import HingeLine
from cmg_mj.scenario.linear_rig import LinearRig


def linear_rig(plant: Plant) -> LinearRig:
    """Linearise a plant's only axis at its keyframe, whether its frame bends or its pivot slides.

    Args:
        plant: The plant.

    Returns:
        The rig, without what no command or push reaches, and without what no sensor shows.

    Raises:
        InputError: The plant stands freely on contacts, or tilts about other axes too.
    """
    model, key, axis = plant.model, plant.key, plant.axis
    if not isinstance(axis.line, HingeLine):
        raise InputError(
            f"plant.model = {plant.settings.model!r}: it stands freely, on contacts, which are not linear; take "
            'linear_closed_loop(plant="reduced")'
        )
    if others := sorted(_other_axes(model, axis) - set(plant.settings.locked_axes)):
        raise InputError(
            f"{axis.name}: the rig tilts about {', '.join(others)} too, which the loop of one axis does not hold up; "
            'take linear_closed_loop(plant="reduced"), or lock the others'
        )
    A, command = state_and_input(model, key, axis)
    push = input_column(model, key, np.zeros(model.nu), _push_forces(model, axis))
    n = len(A)
    whole = np.zeros((n + 2, n + 2))  # command and push as two more states: their columns of C are D
    whole[:n] = np.hstack([A, command, push[:, None]])
    on_mast = plant.settings.bends and plant.settings.bend_beyond != "both"
    C = output_matrix(model, key, axis, whole, on_mast=on_mast, height=axis.radial_tilt.height)
    x1 = np.zeros(n + 2)
    x1[: model.nv] = axis.line.motion(model, at_keyframe(model, key))
    y1, acceleration, y2, rate, gyro = C
    C = np.array([x1, rate, y2, y1, acceleration, gyro])
    return LinearRig(A, whole[:n, n:], C[:, :n], C[:, n:]).minimal()


def _other_axes(model: mujoco.MjModel, axis: Axis) -> set[str]:
    """Return the names of the axes that a model has besides, locked or not."""
    elements = [model.joint(i).name for i in range(model.njnt)] + [model.site(i).name for i in range(model.nsite)]
    names = {name.removesuffix(TILT_ELEMENT) for name in elements if f"/{name}".endswith(f"/{TILT_ELEMENT}")}
    return {name.rstrip("/") for name in names - {axis.prefix}}


def _push_forces(model: mujoco.MjModel, axis: Axis) -> np.ndarray:
    """Return the generalised forces of a torque of 1 N m about the tilt line, (nv,)."""
    forces = np.zeros(model.nv)
    for dof, share in zip(*axis.line.push, strict=True):
        forces[dof] += share
    return forces
