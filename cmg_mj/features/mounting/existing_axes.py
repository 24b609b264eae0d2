"""Axes that a robot has from earlier mounts; a second axis leaves them unchanged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco

from cmg_mj.core.errors import InputError
from cmg_mj.plant.axis import find_axis
from cmg_mj.plant.elements import EQUILIBRIUM_KEY, axes_in, axes_of, missing_parts
from cmg_mj.plant.tilt_line import HingeLine


class ExistingAxes(NamedTuple):
    """Axes that a robot has already."""

    lines: Sequence[str]
    """The hinges that it tilts about."""
    drives: Sequence[str]
    """The gimbal and flywheel joints of the modules."""
    speeds: Mapping[str, float]
    """Flywheel joint -> speed [rad/s]."""
    controls: Mapping[str, float]
    """Flywheel motor -> control [rad/s]."""


def find_existing_axes(spec: mujoco.MjSpec, model: mujoco.MjModel, name: str, path: Path) -> ExistingAxes:
    """Find the axes that a robot has already.

    Args:
        spec: The robot.
        model: The same, compiled.
        name: Name of the new axis.
        path: The file, for messages.

    Returns:
        The hinges, joints and speeds of these axes.

    Raises:
        InputError: It has an axis and the new one has no name; it has half of an axis; or its keyframe of that name
            does not fit.
    """
    elements = [element.name for kind in (spec.joints, spec.sites, spec.sensors) for element in kind]
    names = axes_in(elements)
    if not names or not any(key.name == EQUILIBRIUM_KEY for key in spec.keys):
        conflicts = [element for element in elements if names and axes_in([element])]
        conflicts += [f"keyframe {key.name}" for key in spec.keys if key.name == EQUILIBRIUM_KEY]
        if conflicts:
            raise InputError(f"{path}: has an element {conflicts[0]!r} already, which a mounted pair brings: rename it")
        return ExistingAxes((), (), {}, {})
    missing = missing_parts(spec)
    if missing:
        raise InputError(f"{path}: has an axis already, and yet {missing[0]}")
    if not name:
        known = f" {', '.join(filter(None, names))}" if any(names) else ""
        raise InputError(f"{path}: has an axis{known} already: give the new one a name, such as --name pitch")
    key, names_of = model.key(EQUILIBRIUM_KEY).id, axes_of(model)
    axes = [find_axis(model, key, axis, names_of[axis]) for axis in names]
    modules = [module for axis in axes for module in axis.modules]
    lines = [model.joint(axis.line.joint).name for axis in axes if isinstance(axis.line, HingeLine)]
    return ExistingAxes(
        lines,
        [f"{module.name}/{joint}" for module in modules for joint in ("gimbal", "flywheel")],
        {f"{module.name}/flywheel": module.speed for module in modules},
        {f"{module.name}/flywheel_motor": module.speed for module in modules},
    )
