"""The panel, drawn for nobody, and what it sends."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from mujoco.studio import messages
from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco.studio.implot import implot

from cmg_mj.features.studio import panel as module
from cmg_mj.features.studio.panel import (
    ChangeSettings,
    PushRequest,
    RestartController,
    SessionState,
    ShowAxis,
    StudioPanel,
)
from cmg_mj.features.studio.settings import FEEDBACK, OBSERVER
from tests.features.studio.session import session


class Screen:
    """Stands in for Studio's viewer: takes what the panel sends, and draws frames that nobody sees."""

    def __init__(self) -> None:
        self.sent: list[messages.Message] = []
        self.panel = StudioPanel()
        vars(self.panel)["_viewer"] = self

    def send_to_sim(self, message: messages.Message) -> None:
        self.sent.append(message)

    def frame(self) -> None:
        imgui.NewFrame()
        self.panel.on_build_gui(messages.BuildGuiEvent())
        imgui.Render()


@pytest.fixture
def screen() -> Iterator[Screen]:
    context = imgui.CreateContext()
    imgui.SetCurrentContext(context)
    implot.set_imgui_context(context)
    plots = implot.CreateContext()
    implot.set_implot_context(plots)
    io = imgui.GetIO()
    io.DisplaySize = imgui.Vec2(1400.0, 900.0)
    io.BackendFlags = int(io.BackendFlags) | int(imgui.BackendFlags.RendererHasTextures)
    yield Screen()
    implot.DestroyContext(plots)
    imgui.DestroyContext(context)


@pytest.fixture(scope="module")
def state_of_balance() -> SessionState:
    with session() as studio:
        studio.run(3.0)
        return studio.session_state()


def press(label: str) -> Callable[..., bool]:
    return lambda text, *_: text == label


def pick(label: str, choice: str) -> Callable[..., tuple[bool, int]]:
    def combo(text: str, place: int, options: list[str]) -> tuple[bool, int]:
        return (True, options.index(choice)) if text == label else (False, place)

    return combo


def test_it_is_drawn_from_the_first_frame_on(
    screen: Screen, state_of_balance: SessionState, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines: dict[str, int] = {}
    monkeypatch.setattr(module.implot, "PlotLine", lambda label, xs, ys: lines.update({label: len(xs)}))
    screen.frame()
    assert lines == {}
    screen.panel.on_state(state_of_balance)
    for _ in range(3):
        screen.frame()
    assert lines == {"tilt": 607, "true": 607, "estimate": 607, "u": 607}
    assert screen.sent == []


@pytest.mark.parametrize(
    ("widget", "action", "message"),
    [
        ("Button", press("Push +"), PushRequest(1.0, 0.1)),
        ("Button", press("Push -"), PushRequest(-1.0, 0.1)),
        ("Combo", pick("observer", "adaptive"), ChangeSettings({OBSERVER: "adaptive"})),
        ("Combo", pick("rate fed back", "the gyro's"), ChangeSettings({FEEDBACK: "fog"})),
    ],
)
def test_what_is_pressed_is_sent(
    screen: Screen,
    state_of_balance: SessionState,
    monkeypatch: pytest.MonkeyPatch,
    widget: str,
    action: Any,
    message: messages.Message,
) -> None:
    screen.panel.on_state(state_of_balance)
    screen.frame()
    monkeypatch.setattr(module.imgui, widget, action)
    screen.frame()
    assert screen.sent == [message]


def test_of_several_axes_one_is_chosen(
    screen: Screen, state_of_balance: SessionState, monkeypatch: pytest.MonkeyPatch
) -> None:
    with session(scenario="two_axes") as studio:
        studio.run(0.5)
        screen.panel.on_state(studio.session_state())
    screen.frame()
    monkeypatch.setattr(module.imgui, "Combo", pick("axis shown and pushed", "pitch"))
    screen.frame()
    assert screen.sent == [ShowAxis("pitch")]
    screen.sent.clear()
    screen.panel.on_state(state_of_balance)
    screen.frame()
    assert screen.sent == []


def test_a_stopped_controller_is_said_and_can_be_started(screen: Screen, monkeypatch: pytest.MonkeyPatch) -> None:
    texts: list[str] = []
    monkeypatch.setattr(module.imgui, "TextWrapped", texts.append)
    monkeypatch.setattr(module.imgui, "Button", press("Start it again"))
    screen.panel.on_state(SessionState(title="x", stopped="observer Mine raised KeyError: 'gone' at t = 2 s"))
    screen.frame()
    assert "The controller has stopped: observer Mine raised KeyError: 'gone' at t = 2 s" in texts
    assert screen.sent == [RestartController()]
