"""The introduction: two scissored pairs at right angles, and whether each axis can be taken alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.inputs.files import find
from cmg_mj.laws.state_feedback import StateFeedback, lqr_gains
from cmg_mj.papers.aranovskiy2020.paper import TABLE_1
from cmg_mj.papers.claim import Array, Claim
from cmg_mj.papers.linear_check import mass_matrix
from cmg_mj.papers.pair import DT
from cmg_mj.papers.recorded import largest_size
from cmg_mj.view.plots.figure import Line, Panel, Picture

AXES = ("pitch", "roll")
"""The tilt axes y and x of the body; the cubes' gimbals lie across them."""
HEIGHT_M = 0.134
"""Height of the cubes' centres above the joint, l/sqrt(2) as on the rig [m]."""
MASS_KG = 4.0 * TABLE_1["m"]
SPEED = TABLE_1["omega_d"]
DURATION_S, PUSH_FROM_S, PUSH_S = 3.0, 0.2, 0.1
PUSHES_N_M = (1.0, 2.0, 3.0)
"""Pushes on either axis of a body of four modules [N m]; the rig of two has 1."""
SMALL = 0.05
"""Two axes are separate if either changes the other by less than this share of the largest tilt."""
WEIGHTS = (426.0, 1.7, 0.01, 0.08)
"""Weights of the law of either axis: a diagonal Q that gives Table 2's gains on the rig, to the digits printed."""


@cache
def two_pairs() -> mujoco.MjModel:
    """Four cubes on one body that tilts about two axes; it does not turn about the vertical, as if both feet stood."""
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.integrator = 0.001, mujoco.mjtIntegrator.mjINT_RK4
    spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    torso = spec.worldbody.add_body(name="torso")
    for name, axis in zip(AXES, ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0)), strict=True):
        torso.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis)
    place, file = 0.095, find("models", "scissored_pair", ".xml", "plant.model =").parent / "cube.xml"
    for i, (x, y) in enumerate(((place, place), (-place, -place), (place, -place), (-place, place))):
        turn = 0.0 if i < 2 else math.pi / 2.0
        frame = torso.add_frame(pos=[x, y, HEIGHT_M], quat=[math.cos(turn / 2.0), 0.0, 0.0, math.sin(turn / 2.0)])
        frame.attach_body(mujoco.MjSpec.from_file(str(file)).body("half"), f"c{i}/", "")
    return spec.compile()


class Addresses(NamedTuple):
    """Places of an axis in MuJoCo's arrays."""

    tilt: int
    gimbals: list[int]
    servos: list[int]
    signs: list[float]
    """Factors of a command, so that both cubes of the pair push the same way."""


def addresses(model: mujoco.MjModel, axis: int) -> Addresses:
    """Find those of pitch, driven by the first two cubes, or of roll, by the others."""
    cubes = (2 * axis, 2 * axis + 1)
    tilt = model.joint(AXES[axis]).qposadr[0]
    gimbals = [model.joint(f"c{i}/gimbal").qposadr[0] for i in cubes]
    servos = [model.actuator(f"c{i}/gimbal_servo").id for i in cubes]
    wheels = [model.joint(f"c{i}/flywheel").dofadr[0] for i in cubes]
    data = at_rest(model)
    data.qpos[gimbals] -= math.pi / 2.0  # the wheel's momentum lies along the tilt axis: u > 0 turns it away
    M = mass_matrix(model, data)
    return Addresses(tilt, gimbals, servos, [math.copysign(1.0, M[tilt, wheel] * data.qvel[wheel]) for wheel in wheels])


def at_rest(model: mujoco.MjModel) -> mujoco.MjData:
    """Return the body upright, spin axes upright, the wheels of a pair turning against each other."""
    data = mujoco.MjData(model)
    for i in range(4):
        speed = SPEED if i % 2 == 0 else -SPEED
        data.qpos[model.joint(f"c{i}/gimbal").qposadr[0]] = math.pi / 2.0
        data.act[model.actuator_actadr[model.actuator(f"c{i}/gimbal_servo").id]] = math.pi / 2.0
        data.qvel[model.joint(f"c{i}/flywheel").dofadr[0]] = speed
        data.ctrl[model.actuator(f"c{i}/flywheel_motor").id] = speed
    mujoco.mj_forward(model, data)
    return data


def reduced(model: mujoco.MjModel, axis: int) -> ReducedModel:
    """Return the reduced model of an axis, by a gimbal's share of its pair, off the mass matrix; J2 is small."""
    data, tilt = at_rest(model), addresses(model, axis).tilt
    J1 = float(mass_matrix(model, data)[tilt, tilt]) / 2.0
    data.qvel[:] = 0.0
    data.qpos[tilt] = math.pi / 2.0
    mujoco.mj_forward(model, data)
    return ReducedModel(J1, 0.0, TABLE_1["J_d"], SPEED, abs(float(data.qfrc_bias[tilt])) / 2.0, 2)


def run(pushes_n_m: tuple[float, float]) -> tuple[Array, Array]:
    """Simulate a push on each axis at 0.2 s, each axis with a law of its own that knows its own state alone.

    Args:
        pushes_n_m: On pitch and roll [N m].

    Returns:
        Pitch and roll tick by tick, (n_ticks, 2) [rad], and the torque about the vertical that held the body from
        turning, (n_ticks - 1,) [N m].
    """
    model = two_pairs()
    data = at_rest(model)
    axes = [addresses(model, axis) for axis in range(2)]
    laws = [StateFeedback(DT, lqr_gains(reduced(model, axis), WEIGHTS, 1.0)) for axis in range(2)]  # type: ignore[arg-type]
    integrators, steps = [0.0, 0.0], round(DT / model.opt.timestep)
    tilts, momenta = [], []
    torso = model.body("torso").id
    for tick in range(round(DURATION_S / DT)):
        pushing = PUSH_FROM_S <= tick * DT < PUSH_FROM_S + PUSH_S - 1e-9
        for axis, (places, law) in enumerate(zip(axes, laws, strict=True)):
            pairs = zip(places.signs, places.gimbals, strict=True)
            x3 = sum(sign * float(data.qpos[gimbal] - math.pi / 2.0) for sign, gimbal in pairs) / 2.0
            state = float(data.qpos[places.tilt]), float(data.qvel[places.tilt]), x3, integrators[axis]
            u, integrators[axis] = law(*state)
            data.ctrl[places.servos] = np.multiply(places.signs, u)
            data.qfrc_applied[places.tilt] = pushes_n_m[axis] if pushing else 0.0
        tilts.append([data.qpos[places.tilt] for places in axes])
        mujoco.mj_subtreeVel(model, data)
        arm, moving = data.subtree_com[torso], data.subtree_linvel[torso] * MASS_KG
        momenta.append(data.subtree_angmom[torso][2] + arm[0] * moving[1] - arm[1] * moving[0])
        mujoco.mj_step(model, data, steps)
    return np.array(tilts), np.diff(momenta) / DT


class Coupling(NamedTuple):
    """One push on both axes at once beside the same on either alone."""

    joint_tilts: Array
    """Tilts, (n_ticks, 2) [rad]."""
    single_tilts: Array
    """Each axis' tilt while the other is not pushed, (n_ticks, 2) [rad]."""
    vertical_n_m: float
    """Largest torque about the vertical, with both pushed."""
    share: float
    """Largest change by the other axis, by the largest tilt."""


def coupling(push_n_m: float) -> Coupling:
    """Push both, then either."""
    tilts, vertical = run((push_n_m, push_n_m))
    pitch, roll = run((push_n_m, 0.0))[0], run((0.0, push_n_m))[0]
    single = np.column_stack([pitch[:, 0], roll[:, 1]])
    return Coupling(tilts, single, largest_size(vertical), largest_size(tilts - single) / largest_size(single))


def one_axis_at_a_time(pushes_n_m: Sequence[float] = PUSHES_N_M) -> Claim:
    """Judge each axis alone, by the first push."""
    couplings = [coupling(push) for push in pushes_n_m]
    first, last, tilts, panels = pushes_n_m[0], pushes_n_m[-1], couplings[-1], []
    for axis, name in enumerate(AXES):
        time = np.arange(len(tilts.joint_tilts)) * DT
        lines = [
            Line(time, np.degrees(tilts.single_tilts[:, axis]), "pushed alone", color=0),
            Line(time, np.degrees(tilts.joint_tilts[:, axis]), "both pushed", "--", color=1),
        ]
        panels.append(Panel(f"{name} [deg]", lines, shaded=[(PUSH_FROM_S, PUSH_FROM_S + PUSH_S)]))
    return Claim(
        "Section I, one axis at a time",
        "With two scissored pairs at right angles each tilt axis of the robot can be stabilised by itself.",
        holds=couplings[0].share < SMALL,
        assumes={
            "body": "four cubes on a body that tilts about two axes",
            "push": f"{first:g} to {last:g} N m for {PUSH_S:g} s",
            "gains": "LQR",
        },
        conditions="Up to the largest of these pushes, under which the other axis changes less than 5 % of the tilt, "
        "on a body that does not turn about the vertical. The momentum that a pair holds along its own axis makes a "
        "torque about the vertical when the other axis moves. The ground must take this torque.",
        figures={
            "push_n_m": pushes_n_m,
            "largest_tilt_deg": [np.degrees(largest_size(c.single_tilts)) for c in couplings],
            "vertical_torque_n_m": [c.vertical_n_m for c in couplings],
            "changed_by_the_other_axis_share": [c.share for c in couplings],
        },
        picture=Picture(
            "aranovskiy2020-two-axes",
            f"aranovskiy2020, Section I: two pairs at right angles, {last:g} N m on an axis",
            panels,
        ),
    )
