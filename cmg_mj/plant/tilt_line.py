"""The line that a rig tilts about: a hinge, or, for a free body, a line through its contacts with the floor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from cmg_mj.core.arrays import Scalar, atan2
from cmg_mj.core.errors import InputError
from cmg_mj.core.loop import Joints
from cmg_mj.plant.elements import element_id

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class HingeLine:
    """A hinge of the plant.

    Attributes:
        joint: The joint's number.
        angle: Address of its angle in qpos.
        dof: Address of its rate in qvel.
        zero: Angle at the keyframe, where the plant stands upright [rad].
        sign: +1, or -1 where the hinge turns against the axis.
    """

    joint: int
    angle: int
    dof: int
    zero: float
    sign: float = 1.0

    def lean(self, qpos: Joints) -> Scalar:
        """Tilt from the keyframe [rad]."""
        return self.sign * (qpos[self.angle] - self.zero)

    def rate(self, qvel: Joints) -> Scalar:
        """Tilt rate [rad/s]."""
        return self.sign * qvel[self.dof]

    @property
    def push(self) -> tuple[Sequence[int], Sequence[float]]:
        """Addresses in qfrc_applied, and what each gets of a torque about the line."""
        return [self.dof], [self.sign]

    def motion(self, model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
        """Return the joints' rates of a tilt rate of 1 rad/s, (nv,)."""
        rates = np.zeros(model.nv)
        rates[self.dof] = self.sign
        return rates

    def tilt(self, data: mujoco.MjData, angle: float) -> None:
        """Tilt data, which is at the keyframe, by an angle [rad]."""
        data.qpos[self.angle] = self.zero + self.sign * angle


@dataclass(frozen=True)
class SupportLine:
    """A line through what a free body stands on, fixed to that body.

    Attributes:
        joint: The number of its free joint.
        angle: The joint's address in qpos.
        dof: The joint's address in qvel.
        axes: The line's frame in the body's axes: x, y along the line, z upward at the keyframe, (3, 3), by columns.
        point: A point of the line, in the body's frame [m].
    """

    joint: int
    angle: int
    dof: int
    axes: np.ndarray
    point: np.ndarray

    @cached_property
    def _xyz(self) -> list[list[float]]:
        """The axes as floats, which every tick looks up."""
        return self.axes.T.tolist()

    def lean(self, qpos: Joints) -> Scalar:
        """Tilt of the line's z axis from the vertical about the line, as accelerometers see it [rad]."""
        w, x, y, z = (qpos[self.angle + 3 + i] for i in range(4))
        up = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)  # in the body's axes
        across, _, upward = self._xyz
        return atan2(-_dot(up, across), _dot(up, upward))

    def rate(self, qvel: Joints) -> Scalar:
        """Angular velocity about the line [rad/s]."""
        return _dot([qvel[self.dof + 3 + i] for i in range(3)], self._xyz[1])

    @property
    def push(self) -> tuple[Sequence[int], Sequence[float]]:
        """Addresses in qfrc_applied, and what each gets of a torque about the line."""
        return [self.dof + 3, self.dof + 4, self.dof + 5], self._xyz[1]

    def motion(self, model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
        """Return the joints' rates of a tilt rate of 1 rad/s about the line, (nv,)."""
        turn = data.xmat[model.jnt_bodyid[self.joint]].reshape(3, 3)
        rates = np.zeros(model.nv)
        rates[self.dof : self.dof + 3] = np.cross(turn @ self.axes[:, 1], turn @ -self.point)
        rates[self.dof + 3 : self.dof + 6] = self.axes[:, 1]
        return rates

    def tilt(self, data: mujoco.MjData, angle: float) -> None:
        """Tilt data, which is at the keyframe, by an angle [rad]."""
        pose = data.qpos[self.angle : self.angle + 7]  # a view
        axis, pivot = np.empty(3), np.empty(3)
        mujoco.mju_rotVecQuat(axis, self.axes[:, 1].copy(), pose[3:])
        mujoco.mju_rotVecQuat(pivot, self.point, pose[3:])
        turn_pose(pose, pivot + pose[:3], axis, angle)
        pose[3:] /= math.sqrt(pose[3:] @ pose[3:])


Line = HingeLine | SupportLine


def turn_pose(pose: np.ndarray, point: np.ndarray, axis: np.ndarray, angle: float) -> None:
    """Turn the pose of a free joint, position and quaternion (7,), in place about an axis through a point [rad]."""
    turn, moved, turned = np.empty(4), np.empty(3), np.empty(4)
    mujoco.mju_axisAngle2Quat(turn, axis, angle)
    mujoco.mju_rotVecQuat(moved, pose[:3] - point, turn)
    mujoco.mju_mulQuat(turned, turn, pose[3:])
    pose[:3], pose[3:] = point + moved, turned


SAME_LINE_M = 1e-3
"""A hinge whose axis passes by a site at a larger distance is not the line that the site marks [m]."""
SAME_DIRECTION = math.cos(math.radians(1.0))


def apply_torques(applied: np.ndarray, lines: Sequence[Line], torques: Sequence[Scalar]) -> None:
    """Set the generalised forces of torques about tilt lines; lines of one free body share its joint.

    Args:
        applied: MuJoCo's qfrc_applied, changed in place, (nv,) or (nv, n_worlds) [N m].
        lines: The lines.
        torques: About each line [N m].
    """
    for line in lines:
        for dof in line.push[0]:
            applied[dof] = 0.0
    for line, torque in zip(lines, torques, strict=True):
        for dof, share in zip(*line.push, strict=True):
            applied[dof] += share * torque


def line_named(model: mujoco.MjModel, data: mujoco.MjData, name: str, key: int) -> Line:
    """Return the hinge of a name; or the line along the y axis of a site of that name, a hinge's or a free body's.

    Args:
        model: The compiled model.
        data: The rig at the keyframe, after a forward pass.
        name: The name.
        key: The keyframe.

    Returns:
        The line.

    Raises:
        InputError: The site's body has no hinge along its y axis and is not free.
    """
    joint, sign = element_id(model, "joint", name), 1.0
    if joint < 0:
        site = element_id(model, "site", name)
        at, axes = data.site_xpos[site], data.site_xmat[site].reshape(3, 3)
        body = model.site_bodyid[site]
        while body and joint < 0:
            first = model.body_jntadr[body]
            for candidate in range(first, first + model.body_jntnum[body]):
                kind = model.jnt_type[candidate]
                if kind == mujoco.mjtJoint.mjJNT_FREE:
                    turn = data.xmat[body].reshape(3, 3).T
                    at_joint = int(model.jnt_qposadr[candidate]), int(model.jnt_dofadr[candidate])
                    return SupportLine(candidate, *at_joint, turn @ axes, turn @ (at - data.xpos[body]))
                along = data.xaxis[candidate] @ axes[:, 1]
                past = np.linalg.norm(np.cross(data.xanchor[candidate] - at, axes[:, 1]))
                is_hinge = kind == mujoco.mjtJoint.mjJNT_HINGE
                if is_hinge and abs(along) > SAME_DIRECTION and past < SAME_LINE_M:
                    joint, sign = candidate, math.copysign(1.0, along)
                    break
            body = model.body_parentid[body]
        if joint < 0:
            raise InputError(
                f"site {name!r} lies on no hinge that its body hangs on, along its y axis, and that body is not free: "
                "about what it tilts cannot be told"
            )
    angle = int(model.jnt_qposadr[joint])
    return HingeLine(joint, angle, int(model.jnt_dofadr[joint]), float(model.key_qpos[key, angle]), sign)


def _dot(a: Joints, b: Sequence[float]) -> Scalar:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
