"""The panel in Studio's viewer, on the viewer's thread: choices, pushes and plots; and its messages."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from mujoco.studio import messages, plugin
from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco.studio.implot import implot

from cmg_mj.features.studio.settings import BIAS, FEEDBACK, NOISE, OBSERVER, FieldValues, Settings

TITLE = "Gyroscopic balance"
PLOTTED_S = 6.0
PLOT_HEIGHT = 122.0
FEEDBACKS = {"observer": "the observer's", "fog": "the gyro's", "truth": "the true one"}


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
        stopped: The reason why the controller has stopped; empty while it runs.
        note: Result of the last change.
        ticks: The plotted ticks, (n_ticks, 5), with the columns of `session.PlottedTick`.
    """

    title: str = ""
    time_s: float = 0.0
    axes: tuple[str, ...] = ()
    axis: str = ""
    settings: Settings | None = None
    observers: tuple[str, ...] = ()
    gains: tuple[float, ...] = ()
    stopped: str = ""
    note: str = ""
    ticks: np.ndarray = field(default_factory=lambda: np.empty((0, 5)))


class StudioPanel(plugin.ViewerPlugin):
    """A window with all settings that a user can change, and plots.

    Attributes:
        state: The last state of the session that the simulation sent.
    """

    def __init__(self) -> None:
        self.state = SessionState()
        self._curves: dict[str, list[float]] = {}
        self._torque, self._duration = 1.0, 0.1
        self._typed: dict[str, float] = {}
        self._shown = True

    @messages.handler
    def on_state(self, event: SessionState) -> None:
        """Prepare the curves that are drawn until the next state."""
        self.state = event
        recent = event.ticks[event.ticks[:, 0] > event.time_s - PLOTTED_S]
        recent = recent[:: max(1, len(recent) // 1200)]
        names = ("time", "tilt", "rate", "estimate", "command")
        self._curves = {name: recent[:, i].tolist() for i, name in enumerate(names) if len(recent)}

    @messages.handler
    def on_build_gui(self, _: messages.BuildGuiEvent) -> None:
        """Draw the panel, and its entry in the menu."""
        if imgui.BeginMainMenuBar():
            if imgui.BeginMenu("View"):
                if imgui.MenuItem(TITLE, "", self._shown):
                    self._shown = not self._shown
                imgui.EndMenu()
            imgui.EndMainMenuBar()
        if not self._shown:
            return
        right = imgui.Vec2(imgui.GetIO().DisplaySize.x - 15.0, 45.0)
        imgui.SetNextWindowPos(right, int(imgui.Cond.FirstUseEver), imgui.Vec2(1.0, 0.0))
        imgui.SetNextWindowSize(imgui.Vec2(430.0, 770.0), int(imgui.Cond.FirstUseEver))
        expanded, self._shown = imgui.Begin(TITLE, self._shown)
        if expanded:
            self._build()
        imgui.End()

    def _build(self) -> None:
        now = self.state
        imgui.TextWrapped(now.title)
        imgui.TextUnformatted(f"t = {now.time_s:.3f} s")
        if now.stopped:
            imgui.TextWrapped(f"The controller has stopped: {now.stopped}")
            if imgui.Button("Start it again"):
                self._send(RestartController())
        if now.note:
            imgui.TextWrapped(now.note)
        if now.settings is not None:
            self._build_choices(now, now.settings)
            self._build_plots(now)

    def _build_choices(self, now: SessionState, settings: Settings) -> None:
        several = len(now.axes) > 1
        if several and (axis := _new_choice("axis shown and pushed", now.axis, now.axes)):
            self._send(ShowAxis(axis))
        imgui.SeparatorText("Controller, on all axes" if several else "Controller")
        if observer := _new_choice("observer", settings.observer, now.observers):
            self._choose({OBSERVER: observer})
        if now.gains:
            imgui.TextUnformatted("K_e = " + ", ".join(f"{gain:.3g}" for gain in now.gains))
        if feedback := _new_choice("rate fed back", settings.feedback, FEEDBACKS, FEEDBACKS.values()):
            self._choose({FEEDBACK: feedback})
        imgui.SeparatorText("Disturbances")
        _, self._torque = imgui.InputDouble("torque [N m]", self._torque, 0.1, 1.0, "%.2f")
        _, self._duration = imgui.InputDouble("duration [s]", self._duration, 0.05, 0.5, "%.3f")
        for label, sign in (("Push +", 1.0), ("Push -", -1.0)):
            if imgui.Button(label) and self._duration > 0.0:
                self._send(PushRequest(sign * self._torque, self._duration))
            imgui.SameLine()
        imgui.NewLine()
        on_all = ", all axes" if several else ""
        self._build_number(f"e{on_all} [deg]", BIAS, settings.bias_deg, 0.1)
        self._build_number(f"noise{on_all} [ug/rtHz]", NOISE, settings.noise_ug_rthz, 100.0)

    def _build_number(self, label: str, name: str, value: float, step: float) -> None:
        """Draw a number, which is sent when the user has finished typing."""
        changed, typed = imgui.InputDouble(label, self._typed.get(name, value), step, 10.0 * step, "%.4g")
        if changed:
            self._typed[name] = typed
        if imgui.IsItemDeactivatedAfterEdit() and name in self._typed:
            self._choose({name: self._typed[name]})
        if not imgui.IsItemActive():
            self._typed.pop(name, None)

    def _build_plots(self, now: SessionState) -> None:
        imgui.SeparatorText(f"The last {PLOTTED_S:g} s")
        for title, unit, curves in (
            ("Tilt", "deg", {"tilt": "tilt"}),
            ("Tilt rate", "rad/s", {"rate": "true", "estimate": "estimate"}),
            ("Command", "rad/s", {"command": "u"}),
        ):
            flags = int(implot.Flags.NoLegend) if len(curves) == 1 else 0
            if implot.BeginPlot(f"{title} [{unit}]", imgui.Vec2(-1.0, PLOT_HEIGHT), flags):
                implot.SetupAxes("", "", 0, int(implot.AxisFlags.AutoFit))
                start, always = now.time_s - PLOTTED_S, int(implot.Cond.Always)
                implot.SetupAxisLimits(int(implot.Axis.X1), start, now.time_s, always)
                implot.SetupLegend(int(implot.Location.NorthWest), int(implot.LegendFlags.Horizontal))
                for name, label in curves.items() if self._curves else ():
                    implot.PlotLine(label, self._curves["time"], self._curves[name])
                implot.EndPlot()

    def _choose(self, values: FieldValues) -> None:
        self._send(ChangeSettings(values))

    def _send(self, message: messages.Message) -> None:
        self.viewer.send_to_sim(message)


def _new_choice(label: str, now: str, options: Iterable[str], texts: Iterable[str] = ()) -> str | None:
    """Draw a list of options, or of texts for them; return the user's new choice, if there is one."""
    names = list(options)
    index = names.index(now) if now in names else -1
    changed, index = imgui.Combo(label, index, list(texts) or names)
    return names[index] if changed and 0 <= index < len(names) else None
