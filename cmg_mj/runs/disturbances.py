"""Disturbances from outside: torques about the axes, and those of features. The one place that lists them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cmg_mj.core.loop import Disturbance
from cmg_mj.inputs.features import entries
from cmg_mj.plant.plant import Plant
from cmg_mj.scenario.schema import Scenario
from cmg_mj.stages.push import Pushes
from cmg_mj.stages.swing import Swings

Outsides = Mapping[str, Sequence[Any]]
"""Section of a scenario, such as `push` -> its settings; of many worlds a number may be an array (n_worlds,)."""
TORQUES = {"push": Pushes, "swing": Swings}


def outsides(scenario: Scenario) -> Outsides:
    """Take what acts from outside from a scenario."""
    torques = {name: tuple(scenario.section(name)) for name in TORQUES}
    features = {**entries("disturbance"), **entries("between")}
    return torques | {name: tuple(scenario.feature_sections[name]) for name in features}


def disturbances(
    settings: Outsides, plants: Sequence[Plant], seed: int, world_ids: int | Sequence[int]
) -> list[Disturbance]:
    """Make what acts from outside.

    Args:
        settings: The settings; what is missing does not act.
        plants: The plant of each world.
        seed: The run's seed.
        world_ids: The number of one world, or the numbers of many.
    """
    first = plants[0]
    made: list[Disturbance] = [
        kind(settings[name], first.timestep, first.axis_names) for name, kind in TORQUES.items() if settings.get(name)
    ]
    for name, make in entries("disturbance").items():
        if settings.get(name) and (one := make(settings[name], plants, seed, world_ids)):
            made.append(one)
    return made
