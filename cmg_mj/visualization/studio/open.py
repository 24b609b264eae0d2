"""Opens a scenario in Studio until its viewer is closed."""

from __future__ import annotations

from collections.abc import Callable

from mujoco.studio import app, messages, sim_history, viewer_handle, viewer_protocol

from cmg_mj.errors import InputError
from cmg_mj.plant.mujoco_state import quiet
from cmg_mj.simulation.experiment import Experiment
from cmg_mj.visualization.studio.panel import StudioPanel
from cmg_mj.visualization.studio.stepping import Stepping
from cmg_mj.visualization.studio.viewers import NATIVE, WEB, ViewerFailed, check_graphics, launch

HISTORY_S = 10.0


def open_in_studio(
    load: Callable[[str], Experiment], title: str, viewer: str = WEB, port: int = 0, browser: bool = False
) -> None:
    """Open a scenario with its controller, and return when the viewer is closed or at Ctrl-C.

    Args:
        load: Prepares the scenario, at first and whenever the user reloads it: see `Stepping`.
        title: Title of the window.
        viewer: `web`, `native`, or one of Studio's graphics modes.
        port: Port of the web view, on loopback; 0 for the first free one from 8080 on.
        browser: Whether to open the web view in a browser, if there is a screen.

    Raises:
        InputError: The graphics are not available, the port is in use, or the viewer fails.
    """
    check_graphics(viewer)
    mode = "" if viewer == NATIVE else viewer
    config = viewer_protocol.ViewerConfig(title=title, gfx=mode, http_port=port, open_browser=browser)
    studio = app.App(app.Config(show_inspector=False))  # where the panel is; Shift+Tab shows it
    plugins = [studio, StudioPanel(), Stepping(load), sim_history.SimHistory(min_seconds=HISTORY_S)]
    with quiet():
        try:
            with launch(config, plugins) as handle:
                handle.dispatch(messages.LoadModelEvent())
                viewer_handle.run_sim_loop(handle)
        except ViewerFailed as error:
            raise InputError(f"--viewer {viewer}: the viewer has failed: {' '.join(str(error).split())}") from error
