"""docs/mounted.png: a robot with a pair on it, pushed, and its tilt and tilt rate.

Run it: MUJOCO_GL=egl python docs/studies/mounted_picture.py docs/mounted.png  (or MUJOCO_GL=osmesa)
"""

import io
import sys
import tempfile
from pathlib import Path

import matplotlib as mpl
import mujoco
import numpy as np
from PIL import Image

mpl.use("agg")
import matplotlib.pyplot as plt

from cmg_mj import mount
from cmg_mj.features.mounting.limits import push_limits
from cmg_mj.features.mounting.write import PUSHED_AT_S, write_scenario
from cmg_mj.view.plots.style import colour, hexadecimal

ROBOT = Path(__file__).parents[2] / "examples" / "robots" / "torso.xml"
SIZE = 1200
"""Side of the robot's drawing [pixels]."""
SHOWN_S = 7.0, 16.0
GREY = "#404040"


def robot(spec: mujoco.MjSpec, qpos: np.ndarray) -> np.ndarray:
    """The robot on white, (height, width, 3)."""
    spec.visual.global_.offwidth, spec.visual.global_.offheight = SIZE, SIZE
    spec.visual.headlight.ambient[:] = 0.45
    spec.visual.headlight.diffuse[:] = 0.5
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = [0.0, 0.0, 0.49], 1.5, 140.0, -14.0
    with mujoco.Renderer(model, SIZE, SIZE) as renderer:
        renderer.update_scene(data, camera, no_sites())
        picture = renderer.render().copy()
        renderer.enable_segmentation_rendering()
        renderer.update_scene(data, camera, no_sites())
        geoms = renderer.render()[:, :, 0]
    floor = [model.geom("floor").id]
    background = (geoms < 0) | np.isin(geoms, floor)
    picture[background] = 255
    rows, columns = (np.flatnonzero(~background.all(axis=axis)) for axis in (1, 0))
    return picture[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


def no_sites() -> mujoco.MjvOption:
    """Return options that hide the sensors' marks."""
    option = mujoco.MjvOption()
    option.sitegroup[:] = 0
    return option


def main() -> None:
    """Mount, run, draw."""
    made = mount(ROBOT, "torso", axis="x", scale=1.21)
    with tempfile.TemporaryDirectory() as folder:
        model = made.save(Path(folder) / "balanced.xml")
        can = push_limits(write_scenario(model, ROBOT, "gyro_free"))
        run = write_scenario(model, ROBOT, "gyro_free", can).run().trajectory
    assert run is not None
    time = run["time_s"]
    shown = (time >= SHOWN_S[0]) & (time <= SHOWN_S[1])
    at = int(np.argmax(np.abs(np.where(time > PUSHED_AT_S, run["x1_rad"], 0.0))))
    plt.rcParams.update({"font.size": 11, "axes.edgecolor": GREY, "axes.spines.top": False, "axes.spines.right": False})
    figure = plt.figure(figsize=(11.0, 4.8), facecolor="white")
    grid = figure.add_gridspec(2, 2, width_ratios=[0.62, 1.35], wspace=0.2, hspace=0.22)
    seen = figure.add_subplot(grid[:, 0])
    seen.imshow(robot(made.spec, run.qpos()[at]))
    seen.axis("off")
    tilt = figure.add_subplot(grid[0, 1])
    tilt.plot(time[shown], np.degrees(run["y1_rad"][shown]), color="#c9d6ea", linewidth=0.6, label="measured")
    tilt.plot(time[shown], np.degrees(run["x1_rad"][shown]), color=GREY, linewidth=1.8, label="true")
    tilt.set_ylabel("tilt [deg]")
    most = np.degrees(np.abs(run["x1_rad"][shown]).max())
    tilt.set_title(f"gyro_free in the loop: the true tilt stays within {most:.2f} deg", loc="left", fontsize=11)
    rate = figure.add_subplot(grid[1, 1], sharex=tilt)
    rate.plot(time[shown], run["x2_rad_s"][shown], color=GREY, linewidth=1.8, label="true")
    estimate = run["estimate/gyro_free/x2_rad_s"][shown]
    rate.plot(time[shown], estimate, color=hexadecimal(colour("gyro_free")), linewidth=1.0, label="gyro_free")
    rate.set_ylabel("tilt rate [rad/s]")
    rate.set_xlabel("time [s]")
    torque = float(np.abs(run["push_n_m"]).max())
    for axes in (tilt, rate):
        axes.axvspan(PUSHED_AT_S, PUSHED_AT_S + 0.1, color="#f2c6c6", zorder=0)
        axes.legend(frameon=False, loc="upper right", ncols=2, fontsize=9)
        axes.margins(x=0.0, y=0.25)
    tilt.annotate(
        f"push: {torque:.3g} N m, 0.1 s", (PUSHED_AT_S + 0.15, tilt.get_ylim()[0]), color="#a04040", va="bottom"
    )
    written = io.BytesIO()
    figure.savefig(written, dpi=100, bbox_inches="tight")
    image = Image.open(written).convert("RGB")
    image.quantize(128, dither=Image.Dither.NONE).save(sys.argv[1], optimize=True)


main()
