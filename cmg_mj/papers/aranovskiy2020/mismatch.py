"""Scissored pairs whose halves are not alike: Hypotheses 1 and 2 of aranovskiy2020 broken on purpose.

The controller and the observers do not know the change.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from cmg_mj.papers.aranovskiy2020.rig import push_recovery, run_on_rigs
from cmg_mj.plant.plant import Plant, load_plant
from cmg_mj.results.result import Result

Change = Callable[[Plant, float], None]
"""Makes the second cube of a rig differ by so much."""


def slower_flywheel(plant: Plant, share: float) -> None:
    """Slow the second flywheel down by a share (Hypothesis 2 and 3: unequal speeds)."""
    module, model = plant.axis.modules[1], plant.model
    model.key_ctrl[plant.key, module.motor] *= 1.0 - share
    model.key_qvel[plant.key, module.flywheel] *= 1.0 - share


def gimbal_offset(plant: Plant, offset_deg: float) -> None:
    """Start the second gimbal off its place (Hypothesis 2)."""
    module, model = plant.axis.modules[1], plant.model
    model.key_qpos[plant.key, module.gimbal] += module.direction * math.radians(offset_deg)
    model.key_act[plant.key, model.actuator_actadr[module.servo]] += module.direction * math.radians(offset_deg)


def servo_gain(plant: Plant, share: float) -> None:
    """Let the second servo turn its gimbal farther than commanded, by a share (Hypothesis 1)."""
    module, model = plant.axis.modules[1], plant.model
    gear = 1.0 / (1.0 + share)
    zero = model.key_qpos[plant.key, module.gimbal]
    # Its setpoint counts in angle times gear, from where the gimbal starts.
    model.actuator_gear[module.servo, 0] = gear
    model.key_act[plant.key, model.actuator_actadr[module.servo]] = gear * zero


def gimbal_friction(plant: Plant, torque_n_m: float) -> None:
    """Give the second gimbal dry friction, the first none (Hypothesis 1)."""
    plant.model.dof_frictionloss[plant.axis.modules[1].gimbal] = torque_n_m


@dataclass(frozen=True)
class Mismatch:
    """One way in which the second cube differs.

    Attributes:
        kind: Its name.
        change: Function that breaks a rig so.
        sizes: Sizes of the mismatch that are tried.
        unit: Unit of the sizes.
        display_factor: Number by which a size is multiplied to be shown in that unit.
        is_predictable: Whether `predict_yaw_rate` has it.
    """

    kind: str
    change: Change
    sizes: Sequence[float]
    unit: str
    display_factor: float
    is_predictable: bool = True


MISMATCHES = (
    Mismatch("flywheel speed", slower_flywheel, (0.01, 0.02, 0.05, 0.1), "%", 100.0),
    Mismatch("gimbal offset", gimbal_offset, (1.0, 2.0, 5.0, 10.0), "deg", 1.0),
    Mismatch("servo gain", servo_gain, (0.02, 0.05, 0.1, 0.2), "%", 100.0),
    Mismatch("gimbal friction", gimbal_friction, (0.1, 0.3, 1.0), "N m", 1.0, is_predictable=False),
)


class MismatchRuns(NamedTuple):
    """Symmetric and broken rigs on the same noise and push."""

    plant: Plant
    """The symmetric rig."""
    symmetric: Result
    """Run of the symmetric rig, of all worlds."""
    broken: dict[tuple[str, float], Result]
    """(kind, size) -> run."""

    @property
    def fell(self) -> int:
        """Number of worlds that fell."""
        return int(sum(result.fell.sum() for result in (self.symmetric, *self.broken.values())))


def run_all(
    mismatches: Sequence[Mismatch], worlds: int, seed: int, duration_s: float, settings: Sequence[str] = ()
) -> MismatchRuns:
    """Run every mismatch in some worlds, all at once, with (11) in the loop and the push of Figs 5 to 7."""
    # A rig is changed after its step has been chosen, and friction wants a short one to conserve momentum.
    experiment = push_recovery("homogeneous", seed, ["plant.timestep_s=0.001", *settings], duration_s)
    cases = [(mismatch, size) for mismatch in mismatches for size in mismatch.sizes]
    rigs = [load_plant(experiment.scenario.plant) for _ in range(1 + len(cases))]
    for rig, (mismatch, size) in zip(rigs[1:], cases, strict=True):
        mismatch.change(rig, size)
    symmetric, *broken = run_on_rigs(experiment, rigs, worlds)
    kinds = [(mismatch.kind, size) for mismatch, size in cases]
    return MismatchRuns(rigs[0], symmetric, dict(zip(kinds, broken, strict=True)))
