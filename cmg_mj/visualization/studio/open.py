"""A scenario opened in Studio, until its viewer is closed."""

from __future__ import annotations

from collections.abc import Callable

from mujoco.studio import app, messages, sim_history, viewer_handle, viewer_protocol

from cmg_mj.errors import InputError
from cmg_mj.plant.mujoco_state import quiet
from cmg_mj.simulation.experiment import Experiment
from cmg_mj.visualization.studio.panel import Panel
from cmg_mj.visualization.studio.stepping import Stepping
from cmg_mj.visualization.studio.viewers import NATIVE, WEB, ViewerFailed, check_graphics, launched

HISTORY_S = 10.0


def open_in_studio(
    opened: Callable[[str], Experiment], title: str, viewer: str = WEB, port: int = 0, browser: bool = False
) -> None:
    """Open a scenario, its controller running, and stay until the viewer is closed or Ctrl-C.

    Args:
        opened: Makes the scenario ready, at first and whenever the user reloads it: see `Stepping`.
        title: Of the window.
        viewer: `web`, `native`, or one of Studio's graphics modes.
        port: Of the web view, on loopback; 0 for the first free one from 8080 on.
        browser: Whether to open the web view in a browser, if there is a screen.

    Raises:
        InputError: The graphics cannot be had, the port is taken, or the viewer fails.
    """
    check_graphics(viewer)
    mode = "" if viewer == NATIVE else viewer
    config = viewer_protocol.ViewerConfig(title=title, gfx=mode, http_port=port, open_browser=browser)
    studio = app.App(app.Config(show_inspector=False))  # where the panel is; Shift+Tab shows it
    plugins = [studio, Panel(), Stepping(opened), sim_history.SimHistory(min_seconds=HISTORY_S)]
    with quiet():
        try:
            with launched(config, plugins) as handle:
                handle.dispatch(messages.LoadModelEvent())
                viewer_handle.run_sim_loop(handle)
        except ViewerFailed as error:
            raise InputError(f"--viewer {viewer}: the viewer has failed: {' '.join(str(error).split())}") from error
