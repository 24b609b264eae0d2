"""Makes controllers of one axis, whose decisions the host or a processor takes."""

from __future__ import annotations

from typing import Unpack

from cmg_mj.controllers.processor import Processor, ProcessorController
from cmg_mj.core.controller import Controller, ControllerOptions, PlantInterface
from cmg_mj.core.types import Law, Observer
from cmg_mj.errors import InputError, nearest
from cmg_mj.sensors.sampled import Sensors


def make_controller(
    observer: Observer,
    law: Law,
    sensors: Sensors,
    plant: PlantInterface,
    processor: Processor | None = None,
    **options: Unpack[ControllerOptions],
) -> Controller:
    """Make a fresh controller of one axis.

    Args:
        observer: The observer in the loop.
        law: The control law.
        sensors: What stands between the ideal readings and the controller.
        plant: The controller's knowledge of the plant.
        processor: Takes the decisions in the host's place, such as a board.
        **options: Those of `Controller`.

    Returns:
        The controller.

    Raises:
        InputError: A rate does not fit the physics step, or an option is unknown or does not fit the observer or the
            law.
    """
    known = ControllerOptions.__annotations__
    for name in options:
        if name not in known:
            raise InputError(f"controller: {name!r}: no such option; {nearest(name, known)}")
    if processor is None:
        return Controller(observer, law, sensors, plant, **options)
    return ProcessorController(processor, observer, law, sensors, plant, **options)
