"""The effective inertia about a tilt line. Bodies that are free to move reduce it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.plant.elements import BEND_JOINT, ON_A_JOINT, element_id
from cmg_mj.plant.mjcf import data_at_keyframe
from cmg_mj.plant.tilt_line import HingeLine, Line

SMALL = 1e-9
"""Below this share of the largest singular value a matrix takes a direction to zero."""


class Inertia(NamedTuple):
    """The effective inertia about a line.

    Attributes:
        coupling_row: Row of the mass matrix that couples a tilt with every joint, (nv,).
        tilt_inertia: Effective inertia of the tilt [kg m^2].
        rates: Rates of the joints while the plant tilts by 1 rad/s and the unheld joints move freely, (nv,).
    """

    coupling_row: np.ndarray
    tilt_inertia: float
    rates: np.ndarray


def inertia_about(model: mujoco.MjModel, key: int, line: Line, angles: dict[int, float]) -> Inertia:
    """Compute the effective inertia of a tilt at the keyframe, with some joint angles replaced.

    The body that carries a hinge may be free to move. All unheld joints then move with the tilt, which reduces the
    inertia. The floor does not move, nor do bodies that stand on it at the keyframe, as far as the contacts hold them.

    Args:
        model: The compiled model.
        key: The keyframe at which the rig stands upright.
        line: The line of the tilt.
        angles: Joint angles by their addresses in qpos, the others being those of the keyframe [rad].

    Returns:
        The inertia.
    """
    data = data_at_keyframe(model, key)
    for address, angle in angles.items():
        data.qpos[address] = angle
    mujoco.mj_forward(model, data)
    dense = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, dense)
    motion = line.motion(model, data)
    row = motion @ dense
    line_inertia, rates = row @ motion, motion
    loose = _free_dofs(model, data) if isinstance(line, HingeLine) else []
    loose = [dof for dof in loose if not motion[dof]]
    if loose:
        ways = _ways(model, data, loose)
        gives = row[loose] @ ways
        way = np.linalg.solve(ways.T @ dense[np.ix_(loose, loose)] @ ways, gives)
        line_inertia = line_inertia - gives @ way
        rates = motion.copy()
        rates[loose] -= ways @ way
    return Inertia(row, float(line_inertia), rates)


def free_motions(model: mujoco.MjModel, data: mujoco.MjData, dofs: Sequence[int]) -> np.ndarray:
    """Find the motions of some degrees of freedom and of all that neither servos, constraints nor contacts hold.

    Args:
        model: The compiled model.
        data: Its state after a forward pass.
        dofs: Degrees of freedom that are free, whatever holds them.

    Returns:
        A basis, (nv, n).
    """
    moving = sorted({*dofs, *_free_dofs(model, data)})
    return np.eye(model.nv)[:, moving] @ _ways(model, data, moving)


def wheel_momentum(model: mujoco.MjModel, data: mujoco.MjData, dof: int, speed: float) -> np.ndarray:
    """Return the momentum of a wheel that turns at a speed [rad/s] in its joint, in the world (3,) [N m s]."""
    body, axis = model.dof_bodyid[dof], data.xaxis[model.dof_jntid[dof]]
    shares = data.ximat[body].reshape(3, 3).T @ axis  # of the principal inertias
    return model.body_inertia[body] @ shares**2 * speed * axis


def _free_dofs(model: mujoco.MjModel, data: mujoco.MjData) -> list[int]:
    """Degrees of freedom that neither a constraint, a servo nor the spring of a bend holds."""
    bend = element_id(model, "joint", BEND_JOINT)
    held = {model.jnt_dofadr[bend]} if bend >= 0 else set()
    for constraint in np.flatnonzero((model.eq_type == mujoco.mjtEq.mjEQ_JOINT) & (data.eq_active == 1)):
        held.add(model.jnt_dofadr[model.eq_obj1id[constraint]])
    for actuator in range(model.nu):
        holds = model.actuator_biasprm[actuator, 1:3].any()  # a servo of position or rate
        if holds and int(model.actuator_trntype[actuator]) in ON_A_JOINT:
            held.add(model.jnt_dofadr[model.actuator_trnid[actuator, 0]])
    return [dof for dof in range(model.nv) if dof not in held]


def _weld_jacobian(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return the Jacobian of the errors of welds and connects, (n, nv). A weld holds a ball joint."""
    kinds = mujoco.mjtEq.mjEQ_WELD, mujoco.mjtEq.mjEQ_CONNECT
    columns = np.zeros((model.nv, data.nefc))
    for column, unit in zip(columns, np.eye(model.nv), strict=True):
        mujoco.mj_mulJacVec(model, data, column, unit)
    equalities = np.flatnonzero(data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    return columns.T[[i for i in equalities if int(model.eq_type[data.efc_id[i]]) in kinds]]


def _contacts(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return the Jacobian of the relative motion at each contact, parting or sliding, (n, nv).

    What twists or rolls there is not held: it is of the size of a foot.
    """
    rows, one, other = [], np.zeros((3, model.nv)), np.zeros((3, model.nv))
    for contact in data.contact:
        if contact.efc_address < 0:  # near, and not touching
            continue
        for jacobian, geom in ((one, contact.geom[0]), (other, contact.geom[1])):
            mujoco.mj_jac(model, data, jacobian, None, contact.pos, model.geom_bodyid[geom])
        directions = contact.frame.reshape(3, 3)[: 1 if contact.dim == 1 else 3]  # the normal is the first
        rows.append(directions @ (other - one))
    return np.concatenate(rows) if rows else np.zeros((0, model.nv))


def _ways(model: mujoco.MjModel, data: mujoco.MjData, dofs: Sequence[int]) -> np.ndarray:
    """Return an orthonormal basis of the motions of some degrees of freedom that contacts and welds leave, (n, k)."""
    held = np.concatenate([_contacts(model, data), _weld_jacobian(model, data)])[:, dofs]
    if not held.size:
        return np.eye(len(dofs))
    _, sizes, directions = np.linalg.svd(held)
    rank = int(np.sum(sizes > SMALL * sizes[0])) if sizes[0] > 0.0 else 0
    return directions[rank:].T
