"""A plant as matrices: linearised at its keyframe, or its reduced model."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.core.reduced_model import ReducedModel, hold_matrices
from cmg_mj.plant.axis import pivot_rows
from cmg_mj.plant.elements import BEND_JOINT, element_id
from cmg_mj.plant.mjcf import data_at_keyframe
from cmg_mj.plant.plant import Plant
from cmg_mj.plant.step_limit import input_column, state_matrix
from cmg_mj.plant.tilt_line import HingeLine

NEGLIGIBLE = 1e-6
"""A direction that a command or a push moves by less than this share of the others is not moved: rounding moves it."""


class LinearPlant(NamedTuple):
    """x' = A x + B [command, push], and the outputs C x + D [command, push].

    Outputs are tilt x1, tilt rate x2, gimbal angle x3, the measured tilt y1, its angular acceleration, and the rate
    that a gyro at the sensors shows.

    Attributes:
        A: State matrix, (n, n).
        B: Input matrix, (n, 2).
        C: Output matrix, (6, n).
        D: Feedthrough, (6, 2).
        states: Name of each state; `rig_1`, `rig_2`, ... if empty.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    states: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each state."""
        return self.states or tuple(f"rig_{i + 1}" for i in range(len(self.A)))

    def hold(self, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Advance by a time [s] with the inputs held: F and G of x+ = F x + G [command, push]."""
        return hold_matrices(self.A, self.B, dt)[:2]

    def minimal(self) -> LinearPlant:
        """Leave out the states that no input reaches, then those that no output shows."""
        rig = self._within(_reached(self.A, self.B))
        return rig._within(_reached(rig.A.T, rig.C.T))

    def _within(self, basis: np.ndarray) -> LinearPlant:
        """Return the plant in the coordinates of an orthonormal basis, (n, m)."""
        return LinearPlant(basis.T @ self.A @ basis, basis.T @ self.B, self.C @ basis, self.D)


def linearise(plant: Plant, *, rigid: bool = False, height: float | None = None) -> LinearPlant:
    """Linearise a plant's axis at its keyframe, with its servos and all friction but the dry.

    Args:
        plant: The plant.
        rigid: Whether to hold its bend, if it has one.
        height: Height above a pivot that slides of the point that the tilt estimate takes to be at rest [m]; None for
            that of the plant's own estimate.

    Returns:
        The plant, in the states of `step_limit.state_matrix`.
    """
    model, key, axis = plant.model, plant.key, plant.axis
    command = np.zeros(model.nu)
    for module in axis.modules:
        command[module.servo] = module.direction
    push = np.zeros(model.nv)
    for dof, share in zip(*axis.line.push, strict=True):
        push[dof] += share
    columns = [input_column(model, key, command), input_column(model, key, np.zeros(model.nu), push)]
    whole = np.column_stack([state_matrix(model, key), *columns])
    n = len(whole)
    if rigid:
        whole = _without_bend(model, key, whole)
    outputs = _outputs(plant, whole, axis.pair_tilt.height if height is None else height)
    return LinearPlant(whole[:, :n], whole[:, n:], outputs[:, :n], outputs[:, n:])


def linearise_alone(plant: Plant) -> LinearPlant:
    """Linearise a plant's only axis, without what no input reaches, and without what no sensor shows.

    Raises:
        InputError: The plant stands freely on contacts, or tilts about other axes too.
    """
    axis = plant.axis
    if not isinstance(axis.line, HingeLine):
        raise InputError(
            f"plant.model = {plant.settings.model!r}: it stands freely, on contacts, which are not linear; take "
            'linear_closed_loop(plant="reduced")'
        )
    if others := sorted({*plant.filed.modules} - {axis.name, *plant.settings.locked_axes}):
        raise InputError(
            f"{axis.name}: the rig tilts about {', '.join(others)} too, which the loop of one axis does not hold up; "
            'take linear_closed_loop(plant="reduced"), or lock the others'
        )
    return linearise(plant).minimal()


def linear_reduced(model: ReducedModel) -> LinearPlant:
    """Return the reduced model's linearisation (6), its gimbals turning as commanded.

    Args:
        model: The reduced model, of a pivot at rest.
    """
    per_torque = 1.0 / (model.J1 * model.gimbals)
    B = np.hstack([model.B, [[0.0], [per_torque], [0.0]]])
    x1, x2, x3 = np.eye(3)
    C = np.array([x1, x2, x3, x1, model.A[1], x2])
    D = np.zeros((6, 2))
    D[4] = model.B[1, 0], per_torque
    return LinearPlant(model.A, B, C, D, ("x1", "x2", "x3"))


def _without_bend(model: mujoco.MjModel, key: int, whole: np.ndarray) -> np.ndarray:
    """Hold the bend in [A, B]: a torque there takes its acceleration away."""
    joint = element_id(model, "joint", BEND_JOINT)
    if joint < 0:
        return whole
    bend, nv = int(model.jnt_dofadr[joint]), model.nv
    unit, gives = np.zeros((1, nv)), np.zeros((1, nv))
    unit[0, bend] = 1.0
    mujoco.mj_solveM(model, data_at_keyframe(model, key), gives, unit)
    rigid = whole.copy()
    rigid[nv : 2 * nv] -= np.outer(gives[0] / gives[0, bend], whole[nv + bend])
    rigid[[bend, nv + bend]] = 0.0
    rigid[:, [bend, nv + bend]] = 0.0
    return rigid


def _outputs(plant: Plant, whole: np.ndarray, height: float) -> np.ndarray:
    """Compute [C, D] from [A, B]: the sensors turn with the modules, or with the bend besides.

    A pivot that slides is accelerated by the rig: y1 is the tilt less the acceleration of the point at rest, over g.
    """
    model, key, axis = plant.model, plant.key, plant.axis
    nv, columns = model.nv, np.eye(whole.shape[1])
    angle, rate, acceleration = columns[:nv], columns[nv : 2 * nv], whole[nv : 2 * nv]
    modules = axis.line.motion(model, data_at_keyframe(model, key))
    sensors, gimbals = modules.copy(), np.zeros(nv)
    site = int(model.sensor_objid[element_id(model, "sensor", f"{axis.prefix}fog")])
    if int(model.site_bodyid[site]) == element_id(model, "body", BEND_JOINT):  # on the part beyond the bend
        sensors[int(model.joint(BEND_JOINT).dofadr[0])] = 1.0
    for module in axis.modules:
        gimbals[module.gimbal_dof] = module.direction / len(axis.modules)
    y1 = sensors @ angle
    if axis.reduced.pivot_arm:
        across, _ = pivot_rows(model, key, axis)
        y1 = y1 - (across + height * sensors) @ acceleration / plant.gravity
    return np.array([modules @ angle, modules @ rate, gimbals @ angle, y1, sensors @ acceleration, sensors @ rate])


def _reached(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Find an orthonormal basis of the states that the inputs of x' = A x + B w reach, (n, n_reached)."""
    from scipy.linalg import expm

    # exp(A t) has the invariant subspaces of A. With a t of the fastest mode's size its powers differ by no magnitudes.
    F = expm(A / max(float(np.abs(np.linalg.eigvals(A)).max()), 1.0))
    basis = np.zeros((len(A), 0))
    waiting = list(B.T)
    while waiting:
        vector = waiting.pop(0)
        part = vector - basis @ (basis.T @ vector)
        part = part - basis @ (basis.T @ part)
        if np.linalg.norm(part) > NEGLIGIBLE * np.linalg.norm(vector):
            basis = np.column_stack([basis, part / np.linalg.norm(part)])
            waiting.append(F @ basis[:, -1])
    return basis
