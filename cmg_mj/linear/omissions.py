"""Names the properties of a real rig that a scenario has, but not the reduced model or anything computed from it."""

from __future__ import annotations

from cmg_mj.inputs.features import entries
from cmg_mj.scenario.schema import Scenario

IN_THE_MODEL = (
    "plant.accelerometer_inner_misplaced_mm",
    "plant.accelerometer_outer_misplaced_mm",
    *entries("edit"),
)
"""The properties that the plant's MuJoCo model itself has, whoever steps it."""


def omissions(scenario: Scenario) -> dict[str, str]:
    """Find what the reduced model, margins, the ceiling and the floor of y1 with its acceleration know nothing of.

    Args:
        scenario: The scenario of one axis.

    Returns:
        Field -> what it is, in words.
    """
    clauses = {
        name: clause
        for name, parts in scenario.feature_sections.items()
        for part in parts
        if (clause := part.unmodelled)
    }
    accelerometer = scenario.sensors.accelerometer
    if accelerometer.vibration_mg:
        clauses["sensors.accelerometer.vibration_mg"] = "the accelerometers' vibration"
    if any(accelerometer.wheel_harmonics_mg):
        clauses["sensors.accelerometer.wheel_harmonics_mg"] = "the flywheels' tones in the accelerometers"
    for which in ("inner", "outer"):
        field = f"accelerometer_{which}_misplaced_mm"
        if getattr(scenario.plant, field):
            clauses[f"plant.{field}"] = f"the {which} accelerometer's misplacement"
    return clauses
