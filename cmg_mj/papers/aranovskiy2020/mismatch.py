"""Scissored pairs whose halves are not alike, and the turn of body A that follows from conservation of momentum.

The six bodies of aranovskiy2020 with Hypotheses 1 and 2 broken; the reduced model knows nothing of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.experiment import Experiment, prepare
from cmg_mj.plant import Plant, load_plant
from cmg_mj.scenario import load_scenario
from cmg_mj.simulate import Result
from cmg_mj.trajectory import Trajectory

Change = Callable[[Plant, float], None]


# --- rigs whose second cube differs. The controller and the observers do not know. ------------------------------


def slower_flywheel(plant: Plant, share: float) -> None:
    """The second flywheel turns slower by a share (Hypothesis 2 and 3: unequal speeds)."""
    cube, model = plant.cubes[1], plant.model
    model.key_ctrl[plant.key, cube.motor] *= 1.0 - share
    model.key_qvel[plant.key, cube.flywheel] *= 1.0 - share


def gimbal_offset(plant: Plant, offset_deg: float) -> None:
    """The second gimbal starts off its place (Hypothesis 2)."""
    cube, model = plant.cubes[1], plant.model
    model.key_qpos[plant.key, cube.gimbal] += cube.direction * math.radians(offset_deg)
    model.key_act[plant.key, model.actuator_actadr[cube.servo]] += cube.direction * math.radians(offset_deg)


def servo_gain(plant: Plant, share: float) -> None:
    """The second servo turns its gimbal farther than commanded, by a share (Hypothesis 1)."""
    cube, model = plant.cubes[1], plant.model
    gear = 1.0 / (1.0 + share)
    zero = model.key_qpos[plant.key, cube.gimbal]
    # Its setpoint counts in angle times gear, from where the gimbal starts.
    model.actuator_gear[cube.servo, 0] = gear
    model.key_act[plant.key, model.actuator_actadr[cube.servo]] = gear * zero


def gimbal_friction(plant: Plant, torque_n_m: float) -> None:
    """The second gimbal has dry friction, the first none (Hypothesis 1)."""
    plant.model.dof_frictionloss[plant.cubes[1].gimbal] = torque_n_m


# --- conservation of the momentum about the vertical -------------------------------------------------------------


class Inertia(NamedTuple):
    """What the momentum about the vertical consists of at the upright."""

    yaw: float
    """Of all that turns with body A [kg m^2]."""
    gimbal: float
    """I_c + I_d of a gimbal about its own axis [kg m^2]."""
    spin: float
    """J_d [kg m^2]."""


def inertia_of(plant: Plant) -> Inertia:
    """Read off the mass matrix at the keyframe."""
    data = mujoco.MjData(plant.model)
    mujoco.mj_resetDataKeyframe(plant.model, data, plant.key)
    mujoco.mj_forward(plant.model, data)
    M = np.zeros((plant.model.nv, plant.model.nv))
    mujoco.mj_fullM(plant.model, data, M)
    cube = plant.cubes[0]
    return Inertia(*(float(M[i, i]) for i in (plant.yaw or 0, cube.gimbal, cube.flywheel)))


def carried(plant: Plant, trajectory: Trajectory) -> np.ndarray:
    """Momentum of gimbals and flywheels about the vertical, (n_ticks, ...) [N m s].

    The gimbals' axis is b_x, whose vertical part is -sin q_b; the flywheels' is b_y cos q_c + b_z sin q_c, whose
    vertical part is cos q_b sin q_c.
    """
    parts, names = inertia_of(plant), plant.joint_names
    tilt = trajectory[f"angle/{names[plant.tilt]}_rad"]
    total = np.zeros_like(tilt)
    for cube in plant.cubes:
        angle = trajectory[f"angle/{names[cube.gimbal]}_rad"]
        turning = trajectory[f"rate/{names[cube.gimbal]}_rad_s"]
        spinning = trajectory[f"rate/{names[cube.flywheel]}_rad_s"]
        total = total - parts.gimbal * turning * np.sin(tilt)
        total = total + parts.spin * spinning * np.cos(tilt) * np.sin(angle)
    return total


def balanced_yaw_rate(plant: Plant, trajectory: Trajectory) -> np.ndarray:
    """Body A's rate by conservation: no torque acts about the vertical, so I q_a' + carried stays [rad/s]."""
    momentum = carried(plant, trajectory)
    return (momentum[0] - momentum) / inertia_of(plant).yaw


def foreseen_yaw_rate(kind: str, size: float, plant: Plant, trajectory: Trajectory) -> np.ndarray:
    """Body A's rate foretold from a run of the symmetric rig, for a small mismatch [rad/s].

    The law holds the mean of both gimbal angles x3, whatever each does, so x3 and the tilt are those of the symmetric
    rig to first order. With h = J_d omega_d cos q_b the flywheels carry h (cos x3_1 - cos x3_2).

    Args:
        kind: What differs, of `MISMATCHES`.
        size: By how much.
        plant: The symmetric rig.
        trajectory: Its run.

    Returns:
        The rate, (n_ticks, ...).
    """
    parts = inertia_of(plant)
    tilt = trajectory[f"angle/{plant.joint_names[plant.tilt]}_rad"]
    x3, turning = trajectory["x3_rad"], np.gradient(trajectory["x3_rad"], trajectory["time_s"], axis=0)
    h = parts.spin * abs(plant.cubes[0].speed) * np.cos(tilt)
    if kind == "flywheel speed":
        held = size * h * np.cos(x3)
    elif kind == "gimbal offset":
        half = math.radians(size) / 2.0
        held = h * (np.cos(x3 - half) - np.cos(x3 + half))
    else:  # servo gain
        first = 2.0 * x3 / (2.0 + size)
        held = h * (np.cos(first) - np.cos((1.0 + size) * first)) + parts.gimbal * size * turning * np.sin(tilt)
    return (held[0] - held) / parts.yaw


@dataclass(frozen=True)
class Mismatch:
    """One way in which the second cube differs.

    Attributes:
        kind: Its name.
        change: What it does to a rig.
        sizes: How large it is.
        unit: Of the sizes.
        shown: Number by which a size is multiplied to be shown in that unit.
        hypothesis: Which hypothesis it breaks.
        foreseen: Whether `foreseen_yaw_rate` has it.
    """

    kind: str
    change: Change
    sizes: Sequence[float]
    unit: str
    shown: float
    hypothesis: str
    foreseen: bool = True


MISMATCHES = (
    Mismatch("flywheel speed", slower_flywheel, (0.01, 0.02, 0.05, 0.1), "%", 100.0, "2"),
    Mismatch("gimbal offset", gimbal_offset, (1.0, 2.0, 5.0, 10.0), "deg", 1.0, "2"),
    Mismatch("servo gain", servo_gain, (0.02, 0.05, 0.1, 0.2), "%", 100.0, "1"),
    Mismatch("gimbal friction", gimbal_friction, (0.1, 0.3, 1.0), "N m", 1.0, "1", foreseen=False),
)


def rig(experiment: Experiment, change: Change | None = None, size: float = 0.0) -> Plant:
    """A rig of its own, changed."""
    plant = load_plant(experiment.scenario.plant)
    if change:
        change(plant, size)
    return plant


class Ran(NamedTuple):
    """Symmetric and broken rigs on the same noise and push."""

    plant: Plant
    """The symmetric rig."""
    symmetric: Trajectory
    """Its run, (n_ticks, n_worlds)."""
    broken: dict[tuple[str, float], Trajectory]
    """(kind, size) -> run, (n_ticks, n_worlds)."""
    summaries: dict[tuple[str, float], list[dict]]
    """(kind, size) -> summaries; the symmetric rig's under ("", 0)."""
    fell: int
    """How many worlds fell."""


def run_all(
    mismatches: Sequence[Mismatch], worlds: int, seed: int, duration_s: float, settings: Sequence[str] = ()
) -> Ran:
    """Run every mismatch in some worlds, all at once, with (11) in the loop and the push of Figs 5 to 7."""
    experiment = prepare(load_scenario("push_recovery", [f"seed={seed}", f"duration_s={duration_s}", *settings]))
    cases = [(m.kind, size) for m in mismatches for size in m.sizes]
    changes = {m.kind: m.change for m in mismatches}
    symmetric = rig(experiment)
    rigs = [symmetric] + [rig(experiment, changes[kind], size) for kind, size in cases]
    plants = [plant for plant in rigs for _ in range(worlds)]
    result: Result = experiment.run_many([*range(worlds)] * len(rigs), plants=plants)
    trajectory = result.trajectory
    assert trajectory is not None

    def part(i: int) -> Trajectory:
        span = slice(i * worlds, (i + 1) * worlds)
        return Trajectory({n: v if n == "time_s" else v[:, span] for n, v in trajectory.columns.items()})

    names = [("", 0.0), *cases]
    summaries = {name: result.summaries[i * worlds : (i + 1) * worlds] for i, name in enumerate(names)}
    fell = sum(outcome.fell for outcome in result.outcomes)
    return Ran(symmetric, part(0), {name: part(i + 1) for i, name in enumerate(cases)}, summaries, fell)
