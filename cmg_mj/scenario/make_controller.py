"""Makes controllers of one axis, with their stages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Unpack

from cmg_mj.core.controller import Controller, ControllerOptions, ControllerSite, PlantInterface, Sensors
from cmg_mj.core.errors import InputError, nearest
from cmg_mj.core.types import Law, Observer, extra_signals
from cmg_mj.stages.notch import notch
from cmg_mj.stages.trim import trim

COMMANDS = (notch,)
"""The effects on the law's command, the first one first: each makes what makes its stage, or None where it is off."""
MEMORIES = (trim,)
"""The effects on the law's memory, likewise."""


class StageOptions(ControllerOptions, total=False):
    """Options of a controller and of its stages."""

    bias_trim_s: float
    """For so long from the start, the integrator is held where the observer's bias estimate asks for it [s]."""
    notch_hz: float
    """The middle of a notch on the law's command; 0: none [Hz]."""


def make_controller(
    observer: Observer,
    law: Law,
    sensors: Sensors,
    plant: PlantInterface,
    make: Callable[..., Controller] = Controller,
    **options: Unpack[StageOptions],
) -> Controller:
    """Make a fresh controller of one axis.

    Args:
        observer: The observer in the loop.
        law: The control law.
        sensors: The sensors between the ideal readings and the controller.
        plant: The controller's knowledge of the plant.
        make: Makes it of observer, law, sensors, plant and options: a controller of another kind.
        **options: Options of `Controller`, and settings of its stages.

    Returns:
        The controller.

    Raises:
        InputError: A rate does not fit the physics step, or an option is unknown or does not fit the observer or the
            law.
    """
    known = StageOptions.__annotations__
    for name in options:
        if name not in known:
            raise InputError(f"controller: {name!r}: no such option; {nearest(name, known)}")
    own: dict[str, Any] = {name: options[name] for name in options if name in ControllerOptions.__annotations__}
    site = ControllerSite(law, plant.timestep, extra_signals(observer), options)
    own["commands"] = [stage for start in COMMANDS if (stage := start(site)) is not None]
    own["memories"] = [stage for start in MEMORIES if (stage := start(site)) is not None]
    return make(observer, law, sensors, plant, **own)
