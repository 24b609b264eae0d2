"""The settings of a scenario that a user can change during a session, and their choices."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from cmg_mj.observers import OBSERVERS
from cmg_mj.runs.experiment import Experiment
from cmg_mj.scenario.schema import Scenario

FieldValues = Mapping[str, float | str]
"""Field, named as with `--set` -> value."""

OBSERVER = "observer.kind"
FEEDBACK = "controller.feedback"
BIAS = "plant.equilibrium_bias_deg"
NOISE = "sensors.accelerometer.noise_density_ug_rthz"


class Settings(NamedTuple):
    """Values of the settings in the panel."""

    observer: str
    feedback: str
    bias_deg: float
    noise_ug_rthz: float


def current_settings(scenario: Scenario) -> Settings:
    """Return the values of the settings."""
    bias_deg, sensor = scenario.plant.equilibrium_bias_deg, scenario.sensors.accelerometer
    return Settings(scenario.observer.kind, scenario.controller.feedback, bias_deg, sensor.noise_density_ug_rthz)


def choosable_observers(base: Experiment) -> tuple[str, ...]:
    """List the bundled observers, and the scenario's."""
    return tuple(dict.fromkeys([*OBSERVERS, *(part.scenario.observer.kind for part in base.axes)]))


def changed_fields(base: Experiment, now: Experiment, values: FieldValues) -> dict[str, Any]:
    """Convert a choice for all axes to fields for `Experiment.with_settings`.

    Args:
        base: The scenario at the start, from which an observer of the scenario or of an axis takes its parameters.
        now: The scenario with the user's changes.
        values: Field -> chosen value.

    Returns:
        Field -> value. Sections [axes.NAME] lose the chosen fields and keep the others.
    """
    fields: dict[str, Any] = dict(values)
    kind = fields.pop(OBSERVER, None)
    if kind is not None:
        observer = base.scenario.observer
        fields["observer"] = {"kind": kind, **(observer.parameters if kind == observer.kind else {})}
    axes = {axis: settings.as_fields() for axis, settings in now.scenario.axes.items()}
    for axis, section in axes.items():
        for name in values:
            *path, last = name.split(".")
            inner = section
            for part in path:
                inner = inner.get(part, {})
            inner.pop(last, None)
        if kind is not None:
            (before,) = (part.scenario.observer for part in base.axes if part.plant.axis.name == axis)
            own = base.scenario.axes[axis].as_fields().get("observer", {})
            section["observer"] = own if before.kind == kind else {}
    return {"axes": axes, **fields} if axes else fields
