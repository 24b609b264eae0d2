"""The two-axis rig's equations of motion from its kinematics as they are written here; only masses are MuJoCo's.

Coordinates: yaw a, roll r, pitch p, then gimbal and wheel angle of roll/cube1, roll/cube2, pitch/cube1, pitch/cube2.
The frame's axes are R_z(a) R_x(r) R_y(p); in it a cube's are R_z(t), t = -90 deg for the roll pair and 0 for the
other's; in the cube the gimbal's are R_x(c), in the gimbal the wheel's R_y(d). All centres are fixed in the frame, and
the joint, where all three lines meet, stands still.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.inputs.files import folder
from tests.plant.paper_model import EulerLagrange

N = 11
SIDE = 0.095
"""Half of a module's edge: the modules' centres lie as far from the two middle planes [m]."""
HEIGHT = 0.134
"""Height of the modules' centres above the joint [m]."""
MODULES = {
    "roll/cube1": ((SIDE, SIDE), -math.pi / 2.0),
    "roll/cube2": ((-SIDE, -SIDE), -math.pi / 2.0),
    "pitch/cube1": ((-SIDE, SIDE), 0.0),
    "pitch/cube2": ((SIDE, -SIDE), 0.0),
}
"""Where each stands in the frame, and how it is turned."""
FRAME_HEIGHT = 0.1
"""Height of the frame's own centre [m]."""
G = 9.81


class Part(NamedTuple):
    """One body at some states: its mass, inertia, place and how the joints' rates turn it."""

    mass: float
    inertia: np.ndarray
    """Principal, (3,)."""
    turn: np.ndarray
    """Its axes in the world, (..., 3, 3)."""
    place: np.ndarray
    """Its centre from the joint, (..., 3)."""
    axes: list[tuple[int, np.ndarray]]
    """Coordinate and world axis (..., 3) of each joint on the way to it."""


def _rotation(axis: str, angle: np.ndarray | float) -> np.ndarray:
    """Rotation matrices about x, y or z, (..., 3, 3); angles may be complex."""
    c, s, zero, one = np.cos(angle), np.sin(angle), 0.0 * angle, 1.0 + 0.0 * angle
    rows = {
        "x": [one, zero, zero, zero, c, -s, zero, s, c],
        "y": [c, zero, s, zero, one, zero, -s, zero, c],
        "z": [c, -s, zero, s, c, zero, zero, zero, one],
    }[axis]
    return np.stack(rows, axis=-1).reshape(*np.shape(angle), 3, 3)


class Chain(EulerLagrange):
    """Masses and inertias are read off the model files' own elements; nothing compiled is."""

    def __init__(self, model: str = "two_axes.xml") -> None:
        spec = mujoco.MjSpec.from_file(str(folder("models") / model))
        self.inertias = {body.name: (float(body.mass), np.array(body.inertia)) for body in spec.bodies if body.name}

    def parts(self, q: np.ndarray) -> list[Part]:
        """All bodies at coordinates q (..., 11)."""
        a, r, p = (q[..., i] for i in range(3))
        vertical = np.broadcast_to([0.0, 0.0, 1.0], (*np.shape(a), 3))
        bearing = _rotation("z", a)
        cross = bearing @ _rotation("x", r)
        frame = cross @ _rotation("y", p)
        yaw, roll, pitch = (0, vertical), (1, bearing[..., :, 0]), (2, cross[..., :, 1])
        three = [yaw, roll, pitch]
        origin = 0.0 * vertical
        result = [
            Part(*self.inertias["thrust_bearing"], bearing, origin, [yaw]),  # its centre is on the vertical
            Part(*self.inertias["cross"], cross, origin, [yaw, roll]),
            Part(*self.inertias["frame"], frame, FRAME_HEIGHT * frame[..., :, 2], three),
        ]
        for i, (name, ((x, y), module_angle)) in enumerate(MODULES.items()):
            place = frame @ np.array([x, y, HEIGHT])
            half = frame @ _rotation("z", module_angle)
            gimbal = half @ _rotation("x", q[..., 3 + 2 * i])
            wheel = gimbal @ _rotation("y", q[..., 4 + 2 * i])
            gimbal_axes = [*three, (3 + 2 * i, half[..., :, 0])]
            wheel_axes = [*gimbal_axes, (4 + 2 * i, gimbal[..., :, 1])]
            result += [
                Part(*self.inertias[f"{name}/half"], half, place, three),
                Part(*self.inertias[f"{name}/gimbal"], gimbal, place, gimbal_axes),
                Part(*self.inertias[f"{name}/flywheel"], wheel, place, wheel_axes),
            ]
        return result

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """M = sum of m Jv' Jv + Jw' I Jw, (..., 11, 11)."""
        total = np.zeros((*q.shape[:-1], N, N), dtype=q.dtype)
        for part in self.parts(q):
            turns, moves = np.zeros((2, *q.shape[:-1], 3, N), dtype=q.dtype)
            for k, axis in part.axes:
                turns[..., :, k] = axis
                if k < 3:  # gimbals and wheels turn about their own centres
                    moves[..., :, k] = np.cross(axis, part.place)
            local_turns = np.swapaxes(part.turn, -1, -2) @ turns
            total += part.mass * np.swapaxes(moves, -1, -2) @ moves
            total += np.swapaxes(local_turns, -1, -2) @ (part.inertia[:, None] * local_turns)
        return total

    def potential(self, q: np.ndarray) -> np.ndarray:
        """m g times height above the joint, (...) [J]."""
        return sum((part.mass * G * part.place[..., 2] for part in self.parts(q)), np.zeros(1))

    def kinetic(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """T, (...) [J]."""
        return 0.5 * np.einsum("...i,...ij,...j", dq, self.mass_matrix(q), dq)

    def momenta(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """dT/d(dq), (..., 11) [N m s]: the first is the momentum about the vertical."""
        return np.einsum("...ij,...j->...i", self.mass_matrix(q), dq)
