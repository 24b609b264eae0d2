"""Starts Studio's viewer: a browser's, on loopback alone, or a window."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence

from mujoco.studio import endpoints, launch_native, launch_thread, plugin, viewer_handle, viewer_protocol, web_viewer

from cmg_mj.errors import InputError

LOOPBACK = "127.0.0.1"
WEB, NATIVE = "web", "native"
PATIENCE_S = 60.0
"""Longest wait for a window's first frames [s]."""


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
    mode = "" if viewer == NATIVE else viewer
    try:
        process = subprocess.run(
            [sys.executable, "-m", "cmg_mj.visualization.studio.probe", mode],
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
        )
    except subprocess.TimeoutExpired:
        why = f"no frame in {PATIENCE_S:g} s"
    else:
        if process.returncode == 0:
            return
        lines = [line.strip() for line in process.stderr.splitlines() if _names_a_failure(line)]
        why = lines[-1] if lines else f"a window ends the process, status {process.returncode}"
    raise InputError(f"--viewer {viewer}: MuJoCo Studio cannot draw with it here ({why}); take --viewer {WEB}")


def _names_a_failure(line: str) -> bool:
    return "rror" in line or "ailed" in line


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
