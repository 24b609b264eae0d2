"""What can be changed of a scenario while it runs: its fields, and what they can be."""

from __future__ import annotations

from typing import Any

from cmg_mj.experiment import Experiment
from cmg_mj.law import TABLE_2_GAINS
from cmg_mj.observers import OBSERVERS
from cmg_mj.schema import Scenario

OBSERVER, FEEDBACK = "observer.kind", "controller.feedback"
BIAS, NOISE = "plant.equilibrium_bias_deg", "sensors.accelerometer.noise_density_ug_rthz"
GAINS, LQR = "controller.gains", "controller.lqr"

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


def laws_of(base: Experiment) -> dict[str, dict[str, Any]]:
    """The gains that can be chosen: name -> the settings that make them."""
    own = base.scenario.controller
    weights = WEIGHTS if own.lqr is None else own.lqr.model_dump(mode="json")
    laws: dict[str, dict[str, Any]] = {
        "Table 2": {GAINS: list(TABLE_2_GAINS), LQR: None},
        "LQR": {GAINS: None, LQR: weights},
    }
    if own.gains is not None and tuple(own.gains) != TABLE_2_GAINS:
        laws["the scenario's"] = {GAINS: list(own.gains), LQR: None}
    return laws


def law_of(now: Experiment) -> str:
    """Which of the laws it has."""
    controller = now.scenario.controller
    if controller.lqr is not None:
        return "LQR"
    return "Table 2" if controller.gains in (None, TABLE_2_GAINS) else "the scenario's"
