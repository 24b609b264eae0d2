"""Opens a scenario in Studio until its viewer is closed: a browser's, on loopback alone, or a window."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Sequence

from mujoco.studio import (
    app,
    endpoints,
    launch_native,
    launch_thread,
    messages,
    plugin,
    sim_history,
    viewer_handle,
    viewer_protocol,
    web_viewer,
)

from cmg_mj.core.errors import InputError
from cmg_mj.features.studio.panel import StudioPanel
from cmg_mj.features.studio.stepping import Stepping
from cmg_mj.plant.mjcf import quiet
from cmg_mj.runs.experiment import Experiment

HISTORY_S = 10.0
LOOPBACK = "127.0.0.1"
WEB, NATIVE = "web", "native"
PATIENCE_S = 60.0
"""Longest wait for a window's first frames [s]."""


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
    config = viewer_protocol.ViewerConfig(title=title, gfx=_mode(viewer), http_port=port, open_browser=browser)
    studio = app.App(app.Config(show_inspector=False))  # where the panel is; Shift+Tab shows it
    plugins = [studio, StudioPanel(), Stepping(load), sim_history.SimHistory(min_seconds=HISTORY_S)]
    with quiet():
        try:
            with launch(config, plugins) as handle:
                handle.dispatch(messages.LoadModelEvent())
                viewer_handle.run_sim_loop(handle)
        except ViewerFailed as error:
            raise InputError(f"--viewer {viewer}: the viewer has failed: {' '.join(str(error).split())}") from error


class ViewerFailed(Exception):
    """An exception that ended the viewer's thread."""


class LoopbackViewer(web_viewer.WebViewer):
    """A web viewer for browsers on this machine alone; Studio's listens on every network interface."""

    @property
    def _host(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        return LOOPBACK

    @_host.setter
    def _host(self, _: str) -> None:
        """Ignore the address that Studio sets, that of all interfaces."""


def check_graphics(viewer: str) -> None:
    """Reject graphics that are not available, before they end the process.

    Args:
        viewer: `web`, `native`, or one of Studio's graphics modes.

    Raises:
        InputError: The graphics are not available.
    """
    if viewer == WEB:
        return
    if sys.version_info < (3, 12):
        raise InputError(
            f"--viewer {viewer}: MuJoCo Studio's windows need Python 3.12 or newer, and this is "
            f"{sys.version_info.major}.{sys.version_info.minor}; take --viewer {WEB}"
        )
    command = [sys.executable, "-m", __name__, _mode(viewer)]
    try:
        process = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    except subprocess.TimeoutExpired:
        why = f"no frame in {PATIENCE_S:g} s"
    else:
        if process.returncode == 0:
            return
        lines = [line.strip() for line in process.stderr.splitlines() if "rror" in line or "ailed" in line]
        why = lines[-1] if lines else f"a window ends the process, status {process.returncode}"
    raise InputError(f"--viewer {viewer}: MuJoCo Studio cannot draw with it here ({why}); take --viewer {WEB}")


def _mode(viewer: str) -> str:
    """Return Studio's name of the graphics: none for a window's default."""
    return "" if viewer == NATIVE else viewer


def launch(config: viewer_protocol.ViewerConfig, plugins: Sequence[plugin.Plugin]) -> viewer_handle.ViewerHandle:
    """Start a viewer in a thread.

    Args:
        config: Window and graphics.
        plugins: Plugins of both threads.

    Returns:
        The simulation's handle on the viewer, which raises `ViewerFailed` if the viewer fails.
    """
    viewer_plugins, sim_plugins = plugin.split_plugins(plugins)

    def view(endpoint: endpoints.ViewerEndpoint) -> None:
        try:
            if config.gfx == WEB:
                viewer_protocol.run_viewer_loop(LoopbackViewer(config, endpoint, plugins=viewer_plugins))
            else:
                launch_native.run_native_viewer(config, endpoint, plugins=viewer_plugins)
        except Exception as error:
            raise ViewerFailed(f"{type(error).__name__}: {error}") from error

    return launch_thread.launch_thread(view, sim_plugins=sim_plugins)


def _draw_two_frames(mode: str) -> None:
    """Draw with a window, and exit before it is torn down."""
    from mujoco.studio import native_viewer  # needs Python 3.12

    endpoint, _ = launch_thread.make_thread_endpoints()
    viewer = native_viewer.NativeViewer(viewer_protocol.ViewerConfig(gfx=mode, width=64, height=64), endpoint)
    for _ in range(2):
        viewer.prepare_next_frame()
        viewer.dispatch(messages.UpdateEvent())
        viewer.sync()
    os._exit(0)


if __name__ == "__main__":  # in a process of its own: graphics that fail end the process
    _draw_two_frames(sys.argv[1])
