"""What can be changed of a scenario while it runs: its fields, and what they can be."""

from __future__ import annotations

from typing import Any

from cmg_mj.experiment import Experiment
from cmg_mj.observers import OBSERVERS
from cmg_mj.schema import Scenario

OBSERVER, FEEDBACK = "observer.kind", "controller.feedback"
BIAS, NOISE = "plant.equilibrium_bias_deg", "sensors.accelerometer.noise_density_ug_rthz"
LAW = "controller"
"""All of the law but what is fed back to it."""

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
    """The observers that come with the bench, and the scenario's if it is another."""
    return tuple(dict.fromkeys([*OBSERVERS, base.scenario.observer.kind]))


def law_settings(scenario: Scenario) -> dict[str, Any]:
    """Its section [controller], but for what is fed back."""
    return scenario.controller.model_dump(mode="json", exclude_none=True, exclude={"feedback"})


def laws_of(base: Experiment) -> dict[str, dict[str, Any]]:
    """The laws that can be chosen: name -> the settings that make them."""
    own = law_settings(base.scenario)
    common = {name: own[name] for name in ("rate_hz", "rate_limit_rad_s", "angles", "against_turning", "trim_s")}
    laws: dict[str, dict[str, Any]] = {
        "Table 2": {**common, "kind": "state_feedback"},
        "LQR": {**common, "kind": "state_feedback", "lqr": own.get("lqr", WEIGHTS)},
        "LQG": {**common, "kind": "lqg"},
    }
    if own not in laws.values():
        laws["the scenario's"] = own
    return {name: {LAW: settings} for name, settings in laws.items()}


def law_of(base: Experiment, now: Experiment) -> str:
    """Which of the laws it has."""
    settings = {LAW: law_settings(now.scenario)}
    return next((name for name, made in laws_of(base).items() if made == settings), "")
