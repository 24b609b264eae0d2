"""What the simulation's thread and the viewer's tell each other, beyond what Studio does."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from mujoco.studio import messages


@dataclass(frozen=True)
class ChangeSettings(messages.Event):
    """The user changes settings of the scenario, named as with `--set`."""

    values: dict[str, Any]


@dataclass(frozen=True)
class PushRequest(messages.Event):
    """The user pushes: a torque about the tilt axis that is shown [N m], for so long [s]."""

    torque_n_m: float
    duration_s: float


@dataclass(frozen=True)
class ShowAxis(messages.Event):
    """The user chooses which axis of several is shown and pushed, by its name."""

    axis: str


@dataclass(frozen=True)
class RestartController(messages.Event):
    """The user starts a controller that has stopped."""


@dataclass(frozen=True, eq=False)
class SessionState(messages.Snapshot):
    """Where things stand, for the panel.

    Attributes:
        title: The scenario.
        time_s: Of the simulation [s].
        axes: Names of the rig's axes.
        axis: That which is shown: settings, gains and ticks are its.
        settings: What can be changed, by field named as with `--set`, as it is; None is the scenario file's default.
        observers: Those that can be chosen.
        gains: Of the law, on x1, x2, x3, x_e, if it is of that kind.
        laws: Laws that can be chosen: name -> the settings that make it.
        law: Which of them it is.
        stopped: Why the controller has stopped.
        note: What the last change came to.
        ticks: What is plotted, (n_ticks, 6), columns as in `live.PlottedTick`.
    """

    title: str = ""
    time_s: float = 0.0
    axes: tuple[str, ...] = ()
    axis: str = ""
    settings: dict[str, Any] = field(default_factory=dict)
    observers: tuple[str, ...] = ()
    gains: tuple[float, ...] = ()
    laws: dict[str, dict[str, Any]] = field(default_factory=dict)
    law: str = ""
    stopped: str = ""
    note: str = ""
    ticks: np.ndarray = field(default_factory=lambda: np.empty((0, 6)))
