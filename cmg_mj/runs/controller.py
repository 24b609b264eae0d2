"""A controller for a plant without a scenario, such as for a loop of one's own."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any, Unpack

from cmg_mj.core.axes import MultiAxisController
from cmg_mj.core.errors import InputError
from cmg_mj.laws import Law, StateFeedback
from cmg_mj.observers import Observer
from cmg_mj.plant.plant import Plant
from cmg_mj.scenario.design import Design, StageOptions, make_controller
from cmg_mj.scenario.schema import ObserverSettings, Scenario
from cmg_mj.sensors import Sensors
from cmg_mj.stages.turning import compensation


def controller(
    plant: Plant,
    observer: Observer | str | Mapping[str, Any] = "homogeneous",
    *,
    law: Law | None = None,
    sensors: Sensors | None = None,
    **options: Unpack[StageOptions],
) -> Any:
    """Make a fresh controller for a plant; of several axes one an axis, which compensate a turn about the vertical.

    Args:
        plant: The plant.
        observer: An observer, its name (or package.module:Class), or a section [observer] with its `kind` and
            parameters, such as {"kind": "homogeneous", "k1": 20.0}.
        law: The law, an object; by default Table 2's gains at 200 Hz. `Experiment.law` is a scenario's.
        sensors: The sensors; by default those of the datasheets.
        **options: Options of `Controller`, such as seed and feedback.

    Returns:
        A `Controller`; of several axes a `MultiAxisController`.

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
    controllers = []
    for i, name in enumerate(plant.axis_names):
        part, made = plant.single_axis(name), observer
        if papers:
            _hint(Design(Scenario(sensors=sensors), part.parameters, law))
        if isinstance(made, (str, Mapping)):
            settings = ObserverSettings(**({"kind": made} if isinstance(made, str) else made))
            made = settings.make(law.dt, part.reduced, part.parameters.noise(sensors))
        own: StageOptions = {**options, "axis": i} if len(plant.axes) > 1 else options
        controllers.append(make_controller(made, law, sensors, part.interface, **own))
    if len(controllers) == 1:
        return controllers[0]
    return MultiAxisController(controllers, compensation(plant.turning, sensors.mems_gyro))


def _hint(design: Design) -> None:
    """Say where the papers' gains do not suit a plant."""
    from cmg_mj.linear.verdict import judge_gains  # no loop of a scenario needs it

    if hint := judge_gains(design).hint:
        cure = "here law=StateFeedback(dt=0.005, gains=scaled_gains(plant.reduced)) of cmg_mj.laws"
        logging.getLogger("cmg_mj").warning("hint: %s; %s", hint, cure)
