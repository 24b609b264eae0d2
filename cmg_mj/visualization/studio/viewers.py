"""Which viewer there is: the browser's, on loopback alone, or a window."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence

from mujoco.studio import endpoints, launch_native, launch_thread, plugin, viewer_handle, viewer_protocol, web_viewer

from cmg_mj.errors import InputError

LOOPBACK = "127.0.0.1"
WEB, NATIVE = "web", "native"
PATIENCE_S = 60.0
"""With which a window's first frames are waited for [s]."""


class ViewerFailed(Exception):
    """The viewer's thread has ended with an exception."""


class LoopbackViewer(web_viewer.WebViewer):
    """The web viewer for this machine's browsers alone. Studio's own listens on every network interface, to anybody."""

    @property
    def _host(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        return LOOPBACK

    @_host.setter
    def _host(self, _: str) -> None:
        """Studio names all interfaces here."""


def check_graphics(viewer: str) -> None:
    """Refuse graphics that cannot be had, which end the process otherwise, before there is a viewer.

    Args:
        viewer: `web`, `native`, or one of Studio's graphics modes.

    Raises:
        InputError: They cannot be had here.
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
        tried = subprocess.run(
            [sys.executable, "-m", "cmg_mj.visualization.studio.probe", mode],
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
        )
    except subprocess.TimeoutExpired:
        why = f"no frame in {PATIENCE_S:g} s"
    else:
        if tried.returncode == 0:
            return
        lines = [line.strip() for line in tried.stderr.splitlines() if _says_why(line)]
        why = lines[-1] if lines else f"a window ends the process, status {tried.returncode}"
    raise InputError(f"--viewer {viewer}: MuJoCo Studio cannot draw with it here ({why}); take --viewer {WEB}")


def _says_why(line: str) -> bool:
    return "rror" in line or "ailed" in line


def launched(config: viewer_protocol.ViewerConfig, plugins: Sequence[plugin.Plugin]) -> viewer_handle.ViewerHandle:
    """Start a viewer in a thread of its own.

    Args:
        config: Its window and graphics.
        plugins: What runs on both threads.

    Returns:
        The simulation's handle on it, which raises `ViewerFailed` should the viewer.
    """
    of_viewer, of_simulation = plugin.split_plugins(plugins)

    def view(endpoint: endpoints.ViewerEndpoint) -> None:
        try:
            if config.gfx == WEB:
                viewer_protocol.run_viewer_loop(LoopbackViewer(config, endpoint, plugins=of_viewer))
            else:
                launch_native.run_native_viewer(config, endpoint, plugins=of_viewer)
        except Exception as error:
            raise ViewerFailed(f"{type(error).__name__}: {error}") from error

    return launch_thread.launch_thread(view, sim_plugins=of_simulation)
