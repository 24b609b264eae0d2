"""A controller for a plant without a scenario, such as for a loop of one's own."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from typing import Any, Unpack

from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError
from cmg_mj.laws import Law, StateFeedback
from cmg_mj.observers import Observer
from cmg_mj.plant.plant import Plant
from cmg_mj.scenario.design import AxisOptions, Design, make_axis
from cmg_mj.scenario.schema import ObserverSettings, Scenario
from cmg_mj.sensors import Sensors
from cmg_mj.stages.turning import compensation


def controller(
    plant: Plant,
    observer: Observer | str | Mapping[str, Any] = "homogeneous",
    *,
    law: Law | None = None,
    sensors: Sensors | None = None,
    seed: int = 0,
    world_ids: int | Sequence[int] = 0,
    **options: Unpack[AxisOptions],
) -> Controller:
    """Make a fresh controller for a plant; of several axes one an axis, which compensate a turn about the vertical.

    Args:
        plant: The plant.
        observer: An observer, its name (or package.module:Class), or a section [observer] with its `kind` and
            parameters, such as {"kind": "homogeneous", "k1": 20.0}.
        law: The law, an object; by default Table 2's gains at 200 Hz. `Experiment.law` is a scenario's.
        sensors: The sensors; by default those of the datasheets.
        seed: Seed of the sensors' noise.
        world_ids: The number of one world, on floats, or the numbers of many, on arrays.
        **options: See `AxisOptions`, such as feedback.

    Returns:
        The controller.

    Raises:
        InputError: The observer does not exist or refuses a parameter, the law is a name, or a rate does not fit the
            physics step.
    """
    if isinstance(law, (str, Mapping)):
        raise InputError(
            f"law = {law!r}: must be a law, not its name. Give StateFeedback(dt=0.005, gains=...), or "
            "prepare(scenario).law of a scenario with this [controller]"
        )
    sensors, papers = sensors or Sensors(), law is None
    law = law or StateFeedback(dt=0.005)
    controls = []
    for i, name in enumerate(plant.axis_names):
        part, made = plant.single_axis(name), observer
        if papers:
            _hint(Design(Scenario(sensors=sensors), part.parameters, law))
        if isinstance(made, (str, Mapping)):
            settings = ObserverSettings(**({"kind": made} if isinstance(made, str) else made))
            made = settings.make(law.dt, part.reduced, part.parameters.noise(sensors))
        own: AxisOptions = {**options, "axis": i} if len(plant.axes) > 1 else options
        controls.append(make_axis(made, law, sensors, part.interface, **own))
    gyro = sensors.mems_gyro.turn_gyro(law.dt)
    between = [compensation(plant.turning, gyro, controls)] if len(controls) > 1 else []
    return Controller(controls, between, seed=seed, world_ids=world_ids)


def _hint(design: Design) -> None:
    """Say where the papers' gains do not suit a plant."""
    from cmg_mj.linear.verdict import judge_gains  # no loop of a scenario needs it

    if hint := judge_gains(design).hint:
        cure = "here law=StateFeedback(dt=0.005, gains=scaled_gains(plant.reduced)) of cmg_mj.laws"
        logging.getLogger("cmg_mj").warning("hint: %s; %s", hint, cure)
