"""Opens a window of Studio's for two frames, in a separate process: graphics that fail end the process.

python -m cmg_mj.visualization.studio.probe MODE
"""

from __future__ import annotations

import os
import sys

from mujoco.studio import launch_thread, messages, native_viewer, viewer_protocol


def main(mode: str) -> None:
    """Draw two frames, and exit before the window is torn down."""
    endpoint, _ = launch_thread.make_thread_endpoints()
    viewer = native_viewer.NativeViewer(viewer_protocol.ViewerConfig(gfx=mode, width=64, height=64), endpoint)
    for _ in range(2):
        viewer.prepare_next_frame()
        viewer.dispatch(messages.UpdateEvent())
        viewer.sync()
    os._exit(0)


if __name__ == "__main__":
    try:
        main(sys.argv[1])
    except BaseException as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr, flush=True)
        os._exit(1)
