"""The settings of a scenario that a user can change during a session, and their choices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

from cmg_mj.observers import OBSERVERS
from cmg_mj.runs.experiment import Experiment
from cmg_mj.scenario.schema import ALL_AXES_LAW_FIELDS, COMMON_LAW_FIELDS, LOOP_FIELDS, Scenario

FieldValue: TypeAlias = "float | str | Sequence[FieldValue] | Mapping[str, FieldValue] | None"
FieldValues = Mapping[str, FieldValue]
Fields = dict[str, FieldValue]
"""Field, named as with `--set` -> value."""

OBSERVER = "observer.kind"
FEEDBACK = "controller.feedback"
BIAS = "plant.equilibrium_bias_deg"
NOISE = "sensors.accelerometer.noise_density_ug_rthz"
LAW = "controller"
"""The section of the law, without the fields that stay whatever the law."""
STUDIO_LAW_FIELDS = tuple(name for name in COMMON_LAW_FIELDS if name not in (*ALL_AXES_LAW_FIELDS, *LOOP_FIELDS))
"""Fields of [controller] that every law takes from the scenario."""

WEIGHTS = {"state_cost": [1.0, 1.0, 1.0, 1.0], "input_cost": 1.0}
"""Weights for the gains of the LQR, if the scenario has none."""


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
    return tuple(dict.fromkeys([*OBSERVERS, *(part.scenario.observer.kind for part in base.parts)]))


def choosable_laws(base: Experiment) -> dict[str, Fields]:
    """List the laws to choose from: name -> fields, on every axis."""
    fields = _laws(base.scenario)
    law = _section(fields, LAW)
    common = {name: law[name] for name in ("rate_hz", *STUDIO_LAW_FIELDS)}
    of_axes: Fields = {
        axis: {name: value for name, value in _section(fields, axis).items() if name in STUDIO_LAW_FIELDS}
        for axis in fields
        if axis != LAW
    }
    bundled: dict[str, Fields] = {
        "Table 2": {**common, "kind": "state_feedback"},
        "LQR": {**common, "kind": "state_feedback", "lqr": law.get("lqr", WEIGHTS)},
        "LQG": {**common, "kind": "lqg"},
    }
    laws: dict[str, Fields] = {name: {LAW: law, **of_axes} for name, law in bundled.items()}
    return laws if fields in laws.values() else {**laws, "the scenario's": fields}


def current_law(base: Experiment, now: Experiment) -> str:
    """Name the law in use; empty if it is none of the choosable laws."""
    fields = _laws(now.scenario)
    return next((name for name, law in choosable_laws(base).items() if law == fields), "")


def _laws(scenario: Scenario) -> Fields:
    """Return the section of the law, and those that axes have, without the fields that stay whatever the law."""
    sections: Fields = {LAW: scenario.controller.model_dump(mode="json", exclude_none=True)}
    for axis, settings in scenario.axes.items():
        sections[f"axes.{axis}.{LAW}"] = _section(settings.as_fields(), LAW)
    return {
        name: {field: value for field, value in _section(sections, name).items() if field not in LOOP_FIELDS}
        for name in sections
    }


def changed_fields(base: Experiment, now: Experiment, values: FieldValues) -> Fields:
    """Convert a choice for all axes to fields for `Experiment.with_settings`.

    Args:
        base: The scenario at the start, from which an observer of the scenario or of an axis takes its parameters.
        now: The scenario with the user's changes.
        values: Field -> chosen value.

    Returns:
        Field -> value. Sections [axes.NAME] lose the chosen fields and keep the others.
    """
    fields: Fields = dict(values)
    kind = fields.pop(OBSERVER, None)
    if kind is not None:
        observer = base.scenario.observer
        fields["observer"] = {"kind": kind, **(observer.parameters if kind == observer.kind else {})}
    if LAW in fields:
        stays = now.scenario.controller.model_dump(mode="json", include=set(LOOP_FIELDS))
        fields[LAW] = {**_section(fields, LAW), **stays}
        for axis in now.scenario.axes:
            fields.pop(f"axes.{axis}.{LAW}", None)
    before = {axis: settings.as_fields() for axis, settings in now.scenario.axes.items()}
    axes = {axis: _axis_section(base, axis, section, values) for axis, section in before.items()}
    return {"axes": axes, **fields} if axes != before else fields


def _axis_section(base: Experiment, axis: str, before: FieldValues, values: FieldValues) -> Fields:
    """Return the section [axes.NAME] after a choice for all axes."""
    rest: Fields = dict(before)
    for name in values:
        rest = _without(rest, name.split("."))
    if OBSERVER in values:
        (observer,) = (part.scenario.observer for part in base.parts if part.plant.axis.name == axis)
        section = base.scenario.axes[axis].as_fields().get("observer", {})
        rest["observer"] = section if observer.kind == values[OBSERVER] else {}
    if LAW in values:
        stays = {name: value for name, value in _section(before, LAW).items() if name in LOOP_FIELDS}
        rest[LAW] = {**_section(values, f"axes.{axis}.{LAW}"), **stays}
    return {name: section for name, section in rest.items() if section}


def _section(fields: FieldValues, name: str) -> FieldValues:
    """Return a field that is a section; empty if there is none."""
    value = fields.get(name)
    return value if isinstance(value, Mapping) else {}


def _without(sections: FieldValues, path: list[str]) -> Fields:
    """Remove a field from nested sections."""
    first, *rest = path
    if not rest:
        return {name: value for name, value in sections.items() if name != first}
    return {
        name: _without(value, rest) if name == first and isinstance(value, Mapping) else value
        for name, value in sections.items()
    }
