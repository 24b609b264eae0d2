"""The joints of a plan: inverse kinematics of two telescopic legs, and the load on their servos by inverse dynamics."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.features.gait import Gait
from cmg_mj.features.gait.plan import Plan, bounded
from cmg_mj.plant.elements import element_id
from cmg_mj.plant.mjcf import data_at_keyframe, set_control_callback

SIDES = "left", "right"
JOINTS = "hip_roll", "hip_pitch", "telescope"
PASSES = 6
"""Corrections of the torso's way for the legs' momenta and for feet that roll; each leaves a tenth of what was left."""


@dataclass(frozen=True, eq=False)
class Walk:
    """A walk planned for a robot.

    Attributes:
        plan: Its plan.
        time: (n,) [s].
        feet: Places of both soles, (2, n, 3) [m].
        qpos: Joint positions, (n, nq).
        qvel: Joint rates, (n, nv).
        torques: Of the servos of the legs' joints, (n, 6) [N m, N].
        zero_moment_point: That of the whole robot, by its inverse dynamics, (n, 2) [m].
        servos: Their addresses in ctrl, (6,).
        setpoints: What they are set to, (n, 6).
        leaning: By how much those change while the torso moves by 1 m, x and y, (n, 6, 2).
        height: Of the mass centre [m].
        acceleration: Of the torso, x and y, (n, 2) [m/s^2].
    """

    plan: Plan
    time: np.ndarray
    feet: np.ndarray
    qpos: np.ndarray
    qvel: np.ndarray
    torques: np.ndarray
    zero_moment_point: np.ndarray
    servos: np.ndarray
    setpoints: np.ndarray
    leaning: np.ndarray
    height: float
    acceleration: np.ndarray


def plan_walk(model: mujoco.MjModel, key: int, gait: Gait, dt: float) -> Walk:
    """Plan a walk for a robot with the joints LEG/hip_roll, LEG/hip_pitch and LEG/telescope, left and right.

    The torso stays level and at its height. Its way is that of the mass centre of the linear inverted pendulum,
    corrected until the zero moment point of the whole robot is the planned one. The feet are balls that roll without
    slip on the floor: spheres, with the sites at their centres.

    Args:
        model: The robot.
        key: The keyframe, in which it stands on both feet.
        gait: The gait.
        dt: Time between two points of the plan [s].

    Raises:
        InputError: The model is no such robot, or its legs do not reach so far.
    """
    with set_control_callback(None):
        return _Legs(model, key).walk(gait, dt)


class _Legs:
    """The legs of a robot that stands at a keyframe."""

    def __init__(self, model: mujoco.MjModel, key: int) -> None:
        names = [f"{side}/{joint}" for side in SIDES for joint in JOINTS]
        joints = [element_id(model, "joint", name) for name in names]
        servos = [element_id(model, "actuator", name) for name in names]
        feet = [element_id(model, "site", f"{side}/foot") for side in SIDES]
        root = int(model.body_rootid[model.site_bodyid[feet[0]]]) if min(feet) >= 0 else -1
        touch = [element_id(model, "sensor", f"{side}/foot") for side in SIDES]
        if (
            min(*joints, *servos, *touch, root) < 0
            or model.jnt_type[model.body_jntadr[root]] != mujoco.mjtJoint.mjJNT_FREE
            or (model.actuator_gear[servos, 0] != 1.0).any()
            or (model.actuator_dyntype[servos] != mujoco.mjtDyn.mjDYN_INTEGRATOR).any()
            or (model.sensor_type[touch] != mujoco.mjtSensor.mjSENS_TOUCH).any()
        ):
            raise InputError(
                "gait.steps: takes a free robot with sites and <touch> sensors LEG/foot, and joints and <intvelocity> "
                f"actuators without a gear LEG/{', LEG/'.join(JOINTS)} of the LEGs {' and '.join(SIDES)}"
            )
        self.named = joints
        self.model, self.key, self.feet, self.servos = model, key, feet, np.array(servos)
        self.root = int(model.jnt_qposadr[model.body_jntadr[root]]), int(model.jnt_dofadr[model.body_jntadr[root]])
        self.q = model.jnt_qposadr[joints].reshape(2, 3)
        self.v = model.jnt_dofadr[joints].reshape(2, 3)
        data = data_at_keyframe(model, key)
        self.start, self.centre = data.qpos.copy(), data.subtree_com[root].copy()
        self.torso = data.qpos[self.root[0] : self.root[0] + 3].copy()
        self.hips = np.array([data.xanchor[joints[3 * leg]] for leg in range(2)]) - self.torso
        self.soles = np.array([data.site_xpos[foot] for foot in feet])
        spheres = (model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE) & (model.geom_bodyid == model.site_bodyid[feet[0]])
        self.radius = float(model.geom_size[spheres, 0].max(initial=0.0))
        self.height = float(self.centre[2] - self.soles[0, 2] + self.radius)
        self.reach = np.linalg.norm(self.soles - self.torso - self.hips, axis=1) - self.start[self.q[:, 2]]

    def walk(self, gait: Gait, dt: float) -> Walk:
        """See `plan_walk`."""
        plan = Plan(gait, float(self.soles[0, 1] - self.torso[1]))
        time = dt * np.arange(math.ceil(plan.duration_s / dt) + 1)
        pole = math.sqrt(float(np.linalg.norm(self.model.opt.gravity)) / self.height)
        planned, shares = plan.feet(time), plan.load(time)
        torso, feet = plan.mass_centre(time, pole), planned
        qpos = self.joints(torso, feet)
        for _ in range(PASSES):
            feet = planned + plan.rolled(time, self.ways(qpos))
            qpos = self.joints(torso, feet)
            *_, point = self.dynamics(qpos, dt)
            error = np.einsum("fn,fni->ni", shares, feet[:, :, :2]) - point
            error[[0, -1]] = 0.0
            torso = torso + bounded(error, pole, dt)
            qpos = self.joints(torso, feet)
        qvel, acceleration, forces, point = self.dynamics(qpos, dt)
        torques = self.loads(qpos, forces, shares)
        gain, damping = self.model.actuator_gainprm[self.servos, 0], -self.model.actuator_biasprm[self.servos, 2]
        self._check_reach(time, qpos)
        setpoints = qpos[:, self.q.ravel()] + (torques + damping * qvel[:, self.v.ravel()]) / gain
        at_rest, small = qpos[:, self.q.ravel()], 1e-4 * np.eye(2)
        leaning = [(self.joints(torso + d, feet)[:, self.q.ravel()] - at_rest) / 1e-4 for d in small]
        return Walk(
            plan,
            time,
            feet,
            qpos,
            qvel,
            torques,
            point,
            self.servos,
            setpoints,
            np.stack(leaning, axis=-1),
            self.height,
            acceleration,
        )

    def joints(self, torso: np.ndarray, feet: np.ndarray) -> np.ndarray:
        """Find the joints by which the soles are where they should be, (n, nq)."""
        qpos = np.tile(self.start, (len(torso), 1))
        at = self.torso + np.column_stack([torso, np.zeros(len(torso))])
        qpos[:, self.root[0] : self.root[0] + 3] = at
        for leg in range(2):
            sole = feet[leg] + [self.torso[0], self.torso[1], self.soles[leg, 2]]
            x, y, z = (sole - at - self.hips[leg]).T
            length = np.sqrt(x * x + y * y + z * z)
            qpos[:, self.q[leg]] = np.column_stack(
                [np.arctan2(y, -z), -np.arcsin(x / length), length - self.reach[leg]]
            )
        return qpos

    def ways(self, qpos: np.ndarray) -> np.ndarray:
        """Return how far balls under the legs would have rolled from the start, (2, n, 3) [m]."""
        roll, pitch = (qpos[:, self.q[:, i]].T for i in range(2))
        return np.stack([self.radius * pitch, -self.radius * roll, 0.0 * roll], axis=-1)

    def _check_reach(self, time: np.ndarray, qpos: np.ndarray) -> None:
        """Refuse joint positions beyond the joints' ranges."""
        for joint, address in zip(self.named, self.q.ravel(), strict=True):
            low, high = self.model.jnt_range[joint]
            way = qpos[:, address]
            worst = int(np.argmax(np.maximum(low - way, way - high)))
            if self.model.jnt_limited[joint] and not low <= way[worst] <= high:
                raise InputError(
                    f"gait.step_length_m, width_m, lift_m: take {self.model.joint(joint).name} to {way[worst]:.3g} at "
                    f"t = {time[worst]:.2f} s, and its range is {low:.3g} to {high:.3g}; make one of them smaller"
                )

    def dynamics(self, qpos: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Find what moves the robot so, by MuJoCo's inverse dynamics without contacts.

        Returns:
            Joint rates (n, nv); the torso's acceleration (n, 2); forces of joints and of the floor (n, nv); the zero
            moment point of those of the floor (n, 2).
        """
        model, n = _without_contacts(self.model), len(qpos)
        data, forces = mujoco.MjData(model), np.zeros((n, model.nv))
        moved = [*range(self.root[0], self.root[0] + 3), *self.q.ravel()]
        dofs = [*range(self.root[1], self.root[1] + 3), *self.v.ravel()]
        rates, accelerations = np.zeros((n, model.nv)), np.zeros((n, model.nv))
        rates[1:-1, dofs] = (qpos[2:, moved] - qpos[:-2, moved]) / (2.0 * dt)
        accelerations[1:-1, dofs] = (qpos[2:, moved] - 2.0 * qpos[1:-1, moved] + qpos[:-2, moved]) / dt**2
        for i in range(n):
            data.qpos[:], data.qvel[:], data.qacc[:] = qpos[i], rates[i], accelerations[i]
            mujoco.mj_inverse(model, data)
            forces[i] = data.qfrc_inverse
        first = self.root[1]
        force, torque = forces[:, first : first + 3], forces[:, first + 3 : first + 6]  # the torso is level
        moment = torque + np.cross(qpos[:, self.root[0] : self.root[0] + 3], force)
        point = np.column_stack([-moment[:, 1], moment[:, 0]]) / force[:, 2:]
        return rates, accelerations[:, first : first + 2], forces, point

    def loads(self, qpos: np.ndarray, forces: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """Find the torques of the legs' joints while each foot carries its share of the floor's force, (n, 6)."""
        data, jacobian = mujoco.MjData(self.model), np.zeros((3, self.model.nv))
        torques, first = forces[:, self.v.ravel()].copy(), self.root[1]
        for i in range(len(qpos)):
            data.qpos[:] = qpos[i]
            mujoco.mj_kinematics(self.model, data)
            mujoco.mj_comPos(self.model, data)
            for foot, share in zip(self.feet, shares[:, i], strict=True):
                mujoco.mj_jacSite(self.model, data, jacobian, None, foot)
                torques[i] -= (share * forces[i, first : first + 3] @ jacobian)[self.v.ravel()]
        return torques


def _without_contacts(model: mujoco.MjModel) -> mujoco.MjModel:
    """Return the model without contacts."""
    free = copy.copy(model)
    free.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    return free
