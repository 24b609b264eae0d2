"""Which worlds can run in one batch, and what they differ in as arrays (n_worlds,)."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any

from cmg_mj.controllers.laws import Law, law_class
from cmg_mj.controllers.laws.registry import OF_LAWS
from cmg_mj.observers.registry import takes_noise
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.disturbances import Push
from cmg_mj.scenario.loading import as_fields
from cmg_mj.scenario.schema import Scenario
from cmg_mj.sensors.sampled import Sensors
from cmg_mj.simulation.stacked import batch_values

ARRAYS = frozenset(
    {
        "plant.equilibrium_bias_deg",
        "plant.initial_tilt_deg",
        "plant.gimbal_armature_kg_m2",
        "plant.gimbal_friction_n_m",
        "plant.gimbal_damping_n_m_s",
        "plant.gimbal_backlash_arcmin",
        "plant.servo_stiffness_n_m_rad",
        "plant.servo_damping_n_m_s_rad",
        "plant.accelerometer_inner_m",
        "plant.accelerometer_outer_m",
        "plant.tilt_friction_n_m",
        "plant.tilt_damping_n_m_s",
        "plant.flywheel_imbalance_kg_m",
        "controller.gains",
        "controller.lqr",
        "controller.rate_limit_rad_s",
        "sensors.accelerometer.noise_density_ug_rthz",
        "sensors.accelerometer.bias_mg",
        "sensors.fog.angle_random_walk_deg_rth",
        "push.torque_n_m",
    }
)
"""Fields that worlds of one batch may differ in. Every other decides what is computed, or when."""

OF_THE_LAW = {"controller.gains": "gains", "controller.lqr": "gains", "controller.rate_limit_rad_s": "rate_limit"}
"""Fields of those that need a law which takes an array for one of its own."""

UNUSED = frozenset({"title", "based_on", "versions", "compare"})


def batch_key(scenario: Scenario, design: Design) -> dict[str, str]:
    """What worlds that run together have in common.

    Args:
        scenario: The scenario of one world.
        design: What was made of it.

    Returns:
        Field -> its value in words; worlds of which all are equal can be pooled.
    """
    law = scenario.controller.kind
    found = {
        field: value
        for field, value in _leaves(as_fields(scenario))
        if field.split(".")[0] not in UNUSED and not can_vary_in_batch(field, law)
    }
    _, model, noise = design.given
    found["the reduced model"] = repr(model)
    for observer in (scenario.observer.kind, *scenario.open_loop_names()):
        if takes_noise(observer):
            found[f"the sensors' noise, which {observer} is told,"] = repr(noise)
    if "noise" in OF_LAWS.takes(law):
        found["the noise that the law is told"] = repr(noise)
    return found


def first_difference(a: Mapping[str, str], b: Mapping[str, str]) -> str | None:
    """The first field in which two structures differ."""
    return next((field for field in (*a, *b) if a.get(field) != b.get(field)), None)


def batched(
    worlds: Sequence[tuple[Law, Sensors, tuple[Push, ...]]],
) -> tuple[Law, Sensors, tuple[Push, ...]]:
    """Law, sensors and pushes of many worlds as one, with arrays (n_worlds,) where they differ."""
    laws, sensors, pushes = zip(*worlds, strict=True)
    return _one_law(laws), batch_values(sensors), tuple(batch_values(each) for each in zip(*pushes, strict=True))


def _one_law(laws: Sequence[Law]) -> Law:
    """One law that stands for a law a world, which differ in what may be arrays alone."""
    law = laws[0]
    names = getattr(law, "arrays", ())
    together = {name: batch_values([getattr(each, name) for each in laws]) for name in names}
    if all(values is getattr(law, name) for name, values in together.items()):
        return law
    made = copy.copy(law)
    for name, values in together.items():
        object.__setattr__(made, name, values)
    return made


def _leaves(fields: Any, at: str = "") -> list[tuple[str, str]]:
    if isinstance(fields, list) and fields and isinstance(fields[0], Mapping):
        fields = {str(i): part for i, part in enumerate(fields)}
    if not isinstance(fields, Mapping):
        return [(at, repr(fields))]
    return [leaf for name, value in fields.items() for leaf in _leaves(value, f"{at}.{name}" if at else name)]


def can_vary_in_batch(field: str, law: str) -> bool:
    """Whether worlds of one batch may differ in a field, under a law of this kind."""
    parts = [part for part in field.split(".") if not part.isdecimal()]
    found = next((name for i in range(len(parts)) if (name := ".".join(parts[: i + 1])) in ARRAYS), None)
    return found is not None and (found not in OF_THE_LAW or OF_THE_LAW[found] in getattr(law_class(law), "arrays", ()))
