"""docs/push_recovery.webp: the rig is pushed and recovers; beside it the true tilt rate and two estimates.

Run it (half a minute): MUJOCO_GL=egl python docs/studies/moving_picture.py docs/push_recovery.webp  (or =osmesa)
A GIF of the same frames has eight times the size, and 256 colours.
"""

from __future__ import annotations

import io
import sys

import matplotlib as mpl
import mujoco
import numpy as np
from PIL import Image

mpl.use("agg")
import matplotlib.pyplot as plt
from matplotlib.colors import to_rgb

from cmg_mj.plant.plant import Plant
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.view.plots.style import colour, hexadecimal

SIZE, DPI = (7.6, 3.4), 100
"""Size of a frame [inch], and its resolution."""
RIG = 340
"""Width and height of the drawn rig [pixels]."""
SHOWN_S = 1.6, 3.1
"""Span of the run that is shown [s]."""
SLOWED, FRAMES_HZ, REST_S = 5.0, 16.0, 1.6
"""The run is drawn so many times slower, at so many frames a second; the last frame stands so long [s]."""
OBSERVERS = ("homogeneous", "gyro_free")
GREY, PUSH = "#404040", "#d55e00"
ORANGE = 80
"""Least difference of red and blue in the arrow, which the ground behind it does not have."""
TILT_DRAWN = 3.0
"""Factor on the tilt that is drawn: four degrees are hard to see."""


def main() -> None:
    """Run, draw each frame, write the loop."""
    experiment = prepare(load_scenario("push_recovery", [f"duration_s={SHOWN_S[1]}"]))
    run = experiment.run().trajectory
    assert run is not None
    push = experiment.scenario.push[0]
    n_frames = round((SHOWN_S[1] - SHOWN_S[0]) * SLOWED * FRAMES_HZ)
    frames = []
    with Scene(experiment.plant) as scene:
        for now in np.linspace(*SHOWN_S, n_frames + 1):
            at = min(int(np.searchsorted(run["time_s"], now)), len(run) - 1)
            is_pushed = push.start_s <= now < push.end_s
            rig = scene.picture(run.qpos(np.array([at]))[0], run["x1_rad"][at], pushed=is_pushed)
            frames.append(frame(run, now, rig, (push.start_s, push.end_s), float(push.torque_n_m)))
    durations = [round(1000.0 / FRAMES_HZ)] * len(frames)
    durations[-1] = round(1000.0 * REST_S)
    options = {"duration": durations, "loop": 0, "quality": 65, "method": 4, "minimize_size": True}
    frames[0].save(sys.argv[1], save_all=True, append_images=frames[1:], **options)


class Scene:
    """The rig, drawn by MuJoCo on white.

    Args:
        plant: The plant.
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.model = plant.drawn_model
        self.model.vis.headlight.ambient[:], self.model.vis.headlight.diffuse[:] = 0.45, 0.5
        self.model.vis.quality.shadowsize = 0
        self.data = mujoco.MjData(self.model)
        self.camera = mujoco.MjvCamera()
        self.option = mujoco.MjvOption()
        self.option.sitegroup[:] = 0
        self.renderer = mujoco.Renderer(self.model, 2 * RIG, 2 * RIG)
        lengths = self.model.stat
        self.camera.lookat[:] = lengths.center + np.array([0.0, 0.0, 0.03])
        self.camera.distance, self.camera.azimuth, self.camera.elevation = 1.3 * lengths.extent, 132.0, -14.0

    def __enter__(self) -> Scene:
        return self

    def __exit__(self, *_: object) -> None:
        self.renderer.close()

    def picture(self, qpos: np.ndarray, tilt: float, *, pushed: bool) -> np.ndarray:
        """Draw a pose, its tilt magnified, with the push as an arrow, (RIG, RIG, 3)."""
        self.data.qpos[:] = qpos
        self.data.qpos[self.plant.tilt] += (TILT_DRAWN - 1.0) * tilt
        mujoco.mj_forward(self.model, self.data)
        self.renderer.update_scene(self.data, self.camera, self.option)
        self.renderer.enable_segmentation_rendering()
        geoms = self.renderer.render()[:, :, 0]
        self.renderer.disable_segmentation_rendering()
        if pushed:
            self._arrow()
        picture = self.renderer.render().copy()
        planes = np.flatnonzero(self.model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
        red, _, blue = np.moveaxis(picture.astype(int), -1, 0)
        is_arrow = pushed & (red - blue > ORANGE)
        picture[((geoms < 0) | np.isin(geoms, planes)) & ~is_arrow] = 255
        return np.asarray(Image.fromarray(picture).resize((RIG, RIG), Image.Resampling.LANCZOS))

    def _arrow(self) -> None:
        """Draw the push as the force of a hand on the frame's upper edge."""
        axis, frame = self.plant.axis, self.plant.axis.frame
        turn = self.data.xmat[frame].reshape(3, 3)
        geoms = np.flatnonzero(self.model.geom_bodyid == frame)
        top = self.data.geom_xpos[geoms[np.argmax(self.data.geom_xpos[geoms, 2])]]
        anchor = self.data.xpos[frame] + turn @ axis.point
        direction = np.cross(turn @ axis.direction, top - anchor)
        direction /= np.linalg.norm(direction)
        scene = self.renderer.scene
        geom = scene.geoms[scene.ngeom]
        rgba = np.array([*to_rgb(PUSH), 1.0], dtype=np.float32)
        mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_ARROW, np.zeros(3), np.zeros(3), np.zeros(9), rgba)
        length = 0.7 * self.model.stat.extent
        mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_ARROW, 0.035 * length, top - length * direction, top)
        scene.ngeom += 1


def frame(run: Trajectory, now: float, rig: np.ndarray, push: tuple[float, float], torque: float) -> Image.Image:
    """Draw one frame: the rig, and the rates until now."""
    plt.rcParams.update({"font.size": 10, "axes.edgecolor": GREY, "axes.spines.top": False})
    plt.rcParams.update({"axes.spines.right": False})
    figure = plt.figure(figsize=SIZE, dpi=DPI, facecolor="white")
    seen = figure.add_axes((0.0, 0.0, 0.43, 0.94))
    seen.imshow(rig)
    seen.axis("off")
    note = f"drawn {SLOWED:g} times slower,\nits tilt {TILT_DRAWN:g} times as large"
    figure.text(0.012, 0.025, note, fontsize=8, color=GREY)
    if push[0] <= now < push[1]:
        figure.text(0.2, 0.93, f"push: {torque:g} N m, {push[1] - push[0]:g} s", color=PUSH, weight="bold", ha="center")
    axes = figure.add_axes((0.53, 0.15, 0.455, 0.74))
    axes.axvspan(*push, color=PUSH, alpha=0.2, linewidth=0)
    until = (run["time_s"] >= SHOWN_S[0]) & (run["time_s"] <= now)
    time = run["time_s"][until]
    axes.plot(time, run["x2_rad_s"][until], color="#b4b4b4", linewidth=6.0, label="true")
    for name in OBSERVERS:
        estimate = run[f"estimate/{name}/x2_rad_s"][until]
        axes.plot(time, estimate, color=hexadecimal(colour(name)), linewidth=1.6, label=name)
    axes.axhline(0.0, color=GREY, linewidth=0.5, alpha=0.5)
    axes.set_xlim(*SHOWN_S)
    axes.set_ylim(-0.5, 0.75)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("tilt rate [rad/s]")
    axes.set_title("tilt rate: true and estimated", fontsize=10, loc="left")
    axes.legend(loc="upper right", frameon=False, fontsize=9)
    written = io.BytesIO()
    figure.savefig(written, dpi=DPI)
    plt.close(figure)
    return Image.open(written).convert("RGB")


main()
