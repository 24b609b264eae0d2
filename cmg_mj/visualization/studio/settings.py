"""What can be changed of a scenario while it runs: its fields, and what they can be."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cmg_mj.observers import OBSERVERS
from cmg_mj.scenario.loading import axis_fields
from cmg_mj.scenario.schema import Scenario
from cmg_mj.simulation.experiment import Experiment

OBSERVER, FEEDBACK = "observer.kind", "controller.feedback"
BIAS, NOISE = "plant.equilibrium_bias_deg", "sensors.accelerometer.noise_density_ug_rthz"
LAW = "controller"
"""All of the law but what is no law's."""
NO_LAWS = ("feedback", "compensate_turning")
"""Fields of [controller] that stay whatever the law."""
STUDIO_LAW_FIELDS = ("rate_limit_rad_s", "angle_source", "bias_trim_s")
"""Fields of [controller] that every law has as the scenario has them."""

WEIGHTS = {"state_cost": [1.0, 1.0, 1.0, 1.0], "input_cost": 1.0}
"""Of the gains that are solved for, where the scenario has no weights of its own."""


def settings_of(scenario: Scenario) -> dict[str, Any]:
    """What can be changed, as it is."""
    return {
        OBSERVER: scenario.observer.kind,
        FEEDBACK: scenario.controller.feedback,
        BIAS: scenario.plant.equilibrium_bias_deg,
        NOISE: scenario.sensors.accelerometer.noise_density_ug_rthz,
    }


def observers_of(base: Experiment) -> tuple[str, ...]:
    """The observers that come with the bench, and the scenario's if it has another."""
    return tuple(dict.fromkeys([*OBSERVERS, *(own.scenario.observer.kind for own in base.parts)]))


def law_settings(scenario: Scenario) -> dict[str, Any]:
    """Its section [controller], but for what is no law's."""
    return scenario.controller.model_dump(mode="json", exclude_none=True, exclude=set(NO_LAWS))


def laws_of(base: Experiment) -> dict[str, dict[str, Any]]:
    """The laws that can be chosen: name -> the settings that make them, on every axis."""
    scenario = base.scenario
    own = law_settings(scenario)
    common = {name: own[name] for name in ("rate_hz", *STUDIO_LAW_FIELDS)}
    made: dict[str, dict[str, Any]] = {
        "Table 2": {**common, "kind": "state_feedback"},
        "LQR": {**common, "kind": "state_feedback", "lqr": own.get("lqr", WEIGHTS)},
        "LQG": {**common, "kind": "lqg"},
    }
    of_axes = _laws_of_axes(scenario)
    kept = {axis: {name: law[name] for name in STUDIO_LAW_FIELDS if name in law} for axis, law in of_axes.items()}
    laws = {name: {LAW: settings, **kept} for name, settings in made.items()}
    scenarios = {LAW: own, **of_axes}
    if scenarios not in laws.values():
        laws["the scenario's"] = scenarios
    return laws


def law_of(base: Experiment, now: Experiment) -> str:
    """Which of the laws it has."""
    settings = {LAW: law_settings(now.scenario), **_laws_of_axes(now.scenario)}
    return next((name for name, made in laws_of(base).items() if made == settings), "")


def _laws_of_axes(scenario: Scenario) -> dict[str, dict[str, Any]]:
    """What axes have of a law of their own, by field."""
    return {
        f"axes.{axis}.{LAW}": {name: value for name, value in section.items() if name not in NO_LAWS}
        for axis, section in ((axis, axis_fields(own).get(LAW, {})) for axis, own in scenario.axes.items())
    }


def fields_of(base: Experiment, now: Experiment, values: Mapping[str, Any]) -> dict[str, Any]:
    """A choice for all axes as `Experiment.with_settings` takes it.

    Args:
        base: The scenario as it was opened: an observer that it has, on an axis too, has its parameters from there.
        now: The scenario as it is.
        values: What is chosen, by field.

    Returns:
        Values by field. What axes have of their own in the place of a chosen field is gone from [axes.NAME], the rest
        of it stays.
    """
    fields = dict(values)
    kind = fields.pop(OBSERVER, None)
    if kind is not None:
        own = base.scenario.observer
        fields["observer"] = {"kind": kind, **(own.parameters if kind == own.kind else {})}
    if LAW in fields:
        stays = now.scenario.controller.model_dump(mode="json", include=set(NO_LAWS))
        fields[LAW] = {**fields[LAW], **stays}
        for axis in now.scenario.axes:
            fields.pop(f"axes.{axis}.{LAW}", None)
    before = {axis: axis_fields(own) for axis, own in now.scenario.axes.items()}
    axes = {axis: _of_axis(base, axis, own, values) for axis, own in before.items()}
    return {"axes": axes, **fields} if axes != before else fields


def _of_axis(base: Experiment, axis: str, own: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """What an axis has of its own once something is chosen for all."""
    left = dict(own)
    for name in values:
        left = _without(left, name.split("."))
    if OBSERVER in values:
        (of_base,) = (part.scenario.observer for part in base.parts if part.plant.axis.name == axis)
        section = axis_fields(base.scenario.axes[axis]).get("observer", {})
        left["observer"] = section if of_base.kind == values[OBSERVER] else {}
    if LAW in values:
        stays = {name: value for name, value in own.get(LAW, {}).items() if name in NO_LAWS}
        left[LAW] = {**values.get(f"axes.{axis}.{LAW}", {}), **stays}
    return {name: section for name, section in left.items() if section}


def _without(sections: Mapping[str, Any], path: list[str]) -> dict[str, Any]:
    """Sections without a field, however deep it lies."""
    first, *rest = path
    if not rest:
        return {name: value for name, value in sections.items() if name != first}
    return {
        name: _without(value, rest) if name == first and isinstance(value, Mapping) else value
        for name, value in sections.items()
    }
