"""Picture of a recording without a screen, at a time of the run.

Run it: python docs/studies/picture.py runs/push_recovery-homogeneous-0/recording.rrd picture.png 2.5
The viewer draws with Vulkan; on a machine without a graphics card, Debian's mesa-vulkan-drivers has one in software.
"""

import io
import os
import signal
import subprocess
import sys
import time

from PIL import Image
from rerun.experimental import ViewerClient

recording, picture, at = sys.argv[1], sys.argv[2], float(sys.argv[3]) if len(sys.argv) > 3 else 0.0
PORT, BAR = 9911, 38  # the viewer's title bar is cut off
command = ["rerun", "--headless", "--bind", "127.0.0.1", "--port", str(PORT), "--window-size", f"1400x{900 + BAR}"]
viewer = subprocess.Popen(command, env=os.environ | {"RUST_LOG": "error"}, start_new_session=True)
try:
    for _ in range(100):
        try:
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{PORT}/proxy")
            client.get_state()
            break
        except ConnectionError:
            time.sleep(0.2)
    else:
        sys.exit("the viewer does not answer")
    client.open(os.path.abspath(recording))
    while client.get_state().loading:
        time.sleep(0.1)
    client.set_time("sim_time", duration=at, play_state="paused")
    shots = []
    while len(shots) < 3 or len(set(shots[-3:])) > 1:
        shots.append(client.take_screenshot())
        time.sleep(0.2)
finally:
    os.killpg(viewer.pid, signal.SIGTERM)  # `rerun` starts the viewer as its child
    viewer.wait()
image = Image.open(io.BytesIO(shots[-1])).convert("RGB")
image = image.crop((0, BAR, *image.size))
image.quantize(256, method=Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE).save(picture, optimize=True)
