"""Checks that modules have room above the floor and beside those of other axes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError

TOUCH_M = 1e-3
"""Modules may overlap by so much: they stand side by side [m]."""
HALF = "/half"


def check_room(
    model: mujoco.MjModel, data: mujoco.MjData, modules: Sequence[str], floor: float | None, path: Path
) -> None:
    """Check that modules reach neither below the floor nor into other modules; they may overlap the robot itself.

    Args:
        model: The robot with all its modules.
        data: The same where it stands, after a forward pass.
        modules: Names of the new modules.
        floor: Height of the floor that the robot stands on [m]; None for a robot on a hinge.
        path: The file, for messages.

    Raises:
        InputError: A module has no room.
    """
    names = [model.body(i).name for i in range(model.nbody)]
    new = [f"{module}{HALF}" for module in modules]
    lowest = min(
        float(data.body(name).xpos[2] - _half(model, name) * np.abs(_axes(data, name)[2]).sum()) for name in new
    )
    if floor is not None and lowest < floor - TOUCH_M:
        raise InputError(
            f"{path}: no room: the modules reach {floor - lowest:.3g} m below its support; use a smaller "
            "--scale, or a higher --position"
        )
    for other in names:
        if other.endswith(HALF) and other not in new and any(_overlap(model, data, name, other) for name in new):
            raise InputError(
                f"{path}: no room: the modules overlap {other.removesuffix(HALF)!r}, which is there already; "
                "choose another --position"
            )


def _half(model: mujoco.MjModel, name: str) -> float:
    """Half of a module's edge [m]: its frame's edges lie so far out."""
    body = model.body(name)
    return float(np.abs(model.geom_pos[int(body.geomadr[0]) :][: int(body.geomnum[0])]).max())


def _axes(data: mujoco.MjData, name: str) -> np.ndarray:
    return data.body(name).xmat.reshape(3, 3)


def _overlap(model: mujoco.MjModel, data: mujoco.MjData, one: str, other: str) -> bool:
    """Return whether two modules overlap: no face of either separates them."""
    apart = data.body(other).xpos - data.body(one).xpos
    for normal in np.hstack([_axes(data, one), _axes(data, other)]).T:
        reach = sum(_half(model, name) * np.abs(normal @ _axes(data, name)).sum() for name in (one, other))
        if abs(float(normal @ apart)) > reach - TOUCH_M:
            return False
    return True
