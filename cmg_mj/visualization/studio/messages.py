"""Messages between the simulation's thread and the viewer's, besides Studio's."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from mujoco.studio import messages

from cmg_mj.visualization.studio.settings import Fields, FieldValues, Settings


@dataclass(frozen=True)
class ChangeSettings(messages.Event):
    """The user changes settings of the scenario, named as with `--set`."""

    values: FieldValues


@dataclass(frozen=True)
class PushRequest(messages.Event):
    """The user pushes: torque about the axis shown [N m], duration [s]."""

    torque_n_m: float
    duration_s: float


@dataclass(frozen=True)
class ShowAxis(messages.Event):
    """The user chooses the axis to show and push, by its name."""

    axis: str


@dataclass(frozen=True)
class RestartController(messages.Event):
    """The user restarts a controller that has stopped."""


@dataclass(frozen=True, eq=False)
class SessionState(messages.Snapshot):
    """The state of the session, for the panel.

    Attributes:
        title: The scenario's title.
        time_s: Simulated time [s].
        axes: Names of the plant's axes.
        axis: The axis shown, of settings, gains and ticks.
        settings: The settings that can be changed; None before a scenario is loaded.
        observers: The observers to choose from.
        gains: Gains of a linear law on x1, x2, x3, x_e; empty for other laws.
        laws: The laws to choose from: name -> fields.
        law: Name of the law in use; empty if it is none of `laws`.
        stopped: The reason why the controller has stopped; empty while it runs.
        note: Result of the last change.
        ticks: The plotted ticks, (n_ticks, 6), with the columns of `live.PlottedTick`.
    """

    title: str = ""
    time_s: float = 0.0
    axes: tuple[str, ...] = ()
    axis: str = ""
    settings: Settings | None = None
    observers: tuple[str, ...] = ()
    gains: tuple[float, ...] = ()
    laws: dict[str, Fields] = field(default_factory=dict)
    law: str = ""
    stopped: str = ""
    note: str = ""
    ticks: np.ndarray = field(default_factory=lambda: np.empty((0, 6)))
