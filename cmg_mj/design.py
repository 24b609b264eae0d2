"""What a scenario asks of the controller, made for one reduced model and tried: the law and the observers."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
from pydantic import ConfigDict, TypeAdapter, ValidationError

from cmg_mj.complaint import fields_of, not_allowed
from cmg_mj.errors import InputError
from cmg_mj.grid import check_times
from cmg_mj.known_rigs import RigFacts
from cmg_mj.law import Law
from cmg_mj.observers import GIVEN, Observer, make_observer, observer_class
from cmg_mj.observers.protocol import extra_signals
from cmg_mj.reduced import ReducedModel
from cmg_mj.rehearsal import rehearse
from cmg_mj.scenario import as_json, located
from cmg_mj.schema import Scenario
from cmg_mj.tilt import TiltNoise
from cmg_mj.trim import trim_of


@dataclass(frozen=True)
class Design:
    """The law of a scenario, and its observers.

    Observers are made anew whenever they are asked for: a user's may remember more than its state holds.

    Attributes:
        scenario: What it was made from.
        rig: The rig it was made for.
        law: The control law.
    """

    scenario: Scenario
    rig: RigFacts
    law: Law

    @property
    def given(self) -> tuple[float, ReducedModel, TiltNoise]:
        """What every observer is given: the control period [s], the reduced model, the noise by the datasheet."""
        return self.law.dt, self.rig.reduced, self.rig.noise(self.scenario.sensors)

    def observer(self) -> Observer:
        """The observer in the loop, fresh."""
        return self.scenario.observer.make(*self.given)

    def companions(self) -> dict[str, Observer]:
        """Those that ride along, by name, fresh."""
        return {name: make_observer(name, *self.given) for name in self.scenario.companion_names()}

    def rehearse(self, worlds: int | None = None) -> None:
        """Try every observer once, so that one that cannot work is found before a run and not at its first sample.

        Args:
            worlds: Try it on arrays of so many worlds; None for floats.

        Raises:
            InputError: An observer raised an exception or returned something else than a state and an estimate.
        """
        tried = [("observer.kind =", self.scenario.observer.kind, self.observer())]
        tried += [("companions:", name, observer) for name, observer in self.companions().items()]
        with np.errstate(all="ignore"):
            for field, name, observer in tried:
                try:
                    rehearse(observer, worlds)
                except InputError as error:
                    raise InputError(f"{field} {name!r}: {error}") from error


def design(scenario: Scenario, rig: RigFacts) -> Design:
    """Check what pydantic could not, construct the law and the observers, and try them once.

    Args:
        scenario: The scenario.
        rig: Its rig.

    Returns:
        The design.

    Raises:
        InputError: Something in the scenario does not fit.
    """
    try:
        check_times(scenario)
        _check_observers(scenario)
        made = Design(scenario, rig, scenario.controller.law(rig.reduced))
        made.rehearse()
        trim_of(scenario.controller.trim_s, made.law, extra_signals(made.observer()))
    except InputError as error:
        raise InputError(located(scenario._where, str(error))) from error
    return made


def _check_observers(scenario: Scenario) -> None:
    """The observers exist, and the parameters of the one in the loop are of their types: no text for a number."""
    named = [("companions", name) for name in scenario.companion_names()]
    named += [("compare.observers", name) for name in (scenario.compare.names() if scenario.compare else ())]
    for field, name in named:
        try:
            observer_class(name)
        except InputError as error:
            raise InputError(str(error).replace("observer.kind = ", f"{field}: ", 1)) from error
    kind, parameters = scenario.observer.kind, scenario.observer.parameters
    types = fields_of(observer_class(kind))
    for name, value in parameters.items():
        if name in GIVEN:
            raise InputError(f"observer.{name}: set by the bench, which gives it to every observer")
        if name not in types:
            continue  # a name that the class does not have, or no class of pydantic's: its constructor decides
        adapter = TypeAdapter(types[name], config=ConfigDict(strict=True, allow_inf_nan=False))
        try:
            adapter.validate_json(json.dumps(value, default=as_json))
        except ValidationError as error:
            finite = all(detail["type"] != "finite_number" for detail in error.errors())
            wrong = not_allowed(f"observer.{name}", value, types[name], finite=finite)
            raise InputError(f"{wrong} (observer {kind})") from error
