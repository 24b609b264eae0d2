"""Refuses what the C of a controller does not have; needs no CasADi."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Mapping

import numpy as np

from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError, TomlValue, shown
from cmg_mj.laws import Law, StateFeedback
from cmg_mj.stages.trim import Trim

EXPORTED_OPTIONS = ("angle_source", "memories", "commands")
"""Options of a `Controller` that its C has."""
SIMULATION_OPTIONS = ("seed", "worlds", "axis", "open_loop_observers")
"""Options that concern the simulation around a controller alone."""
EXPORTED_LAW_FIELDS = ("dt", "gains", "rate_limit")
"""Fields of the law (8) that its C has; another law is traced whole."""
REASONS = {
    "feedback": "what is exported has the observer's rate alone",
    "notch_hz": "no notch is exported, so that a frame that needs one has to be stiffer, or another setting cures it",
}
"""Option of a `Controller` -> why its C has none, where that is known."""


def refuse_unexported(controller: Controller) -> None:
    """Refuse every option of the controller, and every field of (8), that C does not have and that is in use.

    Raises:
        InputError: There is one; the message names it, and the value without it.
    """
    law = controller.law
    option_defaults = {
        option.name: None if option.default is option.empty else option.default
        for cls in type(controller).__mro__
        for option in inspect.signature(cls.__init__).parameters.values()
        if option.kind is option.KEYWORD_ONLY and option.name not in EXPORTED_OPTIONS + SIMULATION_OPTIONS
    }
    _refuse_in_use(controller, option_defaults)
    for stage in controller.command_stages:
        name = f"{type(stage).__name__.lower()}_hz"
        reason = REASONS.get(name, "C has no such stage")
        raise InputError(f"controller.{name}: cannot be exported: {reason}; set controller.{name}=0.0")
    for memory in controller.memories:
        if not isinstance(memory, Trim):
            raise InputError(f"{type(memory).__name__}: cannot be exported: C has no such stage")
    if type(law) is StateFeedback:
        fields = [field for field in dataclasses.fields(law) if field.name not in EXPORTED_LAW_FIELDS]
        _refuse_in_use(law, {field.name: _default_of(field) for field in fields})


def _default_of(field: dataclasses.Field[TomlValue]) -> TomlValue:
    """Return a field's default; None without one."""
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return None if field.default is dataclasses.MISSING else field.default


def _refuse_in_use(part: Controller | Law, defaults: Mapping[str, TomlValue]) -> None:
    """Refuse a name whose value is not its default, and one that is no attribute: its value is not known.

    Args:
        part: The controller or its law.
        defaults: Name of an attribute -> its default; None is no default.
    """
    for name, default in defaults.items():
        setting = f"controller.{name}"
        if not hasattr(part, name):
            raise InputError(f"{setting}: cannot be exported: {type(part).__qualname__} has no attribute {name!r}")
        value = getattr(part, name)
        if not np.any(value != default):
            continue
        reason = REASONS.get(name, "C has no such option")
        if default is not None:
            reason += f"; set {setting}={default if isinstance(default, str) else shown(default)}"
        raise InputError(f"{setting} = {shown(value)}: cannot be exported: {reason}")
