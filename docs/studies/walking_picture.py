"""docs/walking.webp and docs/walking.png: the biped walks; with its gimbals held it falls at the first step.

Run it (a minute): MUJOCO_GL=egl python docs/studies/walking_picture.py docs  (or =osmesa)
"""

from __future__ import annotations

import sys
from pathlib import Path

import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from cmg_mj.plant.plant import Plant
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario

WIDTH, HEIGHT, DRAWN = 380, 340, 2
"""Of one robot's picture [pixels], which is drawn so many times larger."""
SHOWN_S, FRAMES_HZ = (1.4, 8.4), 12.5
STILLS_S = 1.7, 2.2, 2.7, 3.0
"""Times of the picture that does not move [s]."""
SIDES = {
    "gyro_free, no gyro": [],
    "gimbals held": ["controller.rate_limit_rad_s=1e-6", "metrics.fall_angle_deg=60"],
}


class Scene:
    """The robot, drawn by MuJoCo."""

    def __init__(self, plant: Plant) -> None:
        self.model = plant.drawn_model
        self.model.vis.headlight.ambient[:], self.model.vis.headlight.diffuse[:] = 0.45, 0.5
        self.model.vis.global_.offwidth, self.model.vis.global_.offheight = DRAWN * WIDTH, DRAWN * HEIGHT
        self.data, self.camera, self.option = mujoco.MjData(self.model), mujoco.MjvCamera(), mujoco.MjvOption()
        self.option.sitegroup[:] = 0
        self.camera.distance, self.camera.azimuth, self.camera.elevation = 1.05, 128.0, -10.0
        self.renderer = mujoco.Renderer(self.model, DRAWN * HEIGHT, DRAWN * WIDTH)

    def picture(self, run: Trajectory, time: float, ahead: float, label: str) -> Image.Image:
        """Draw the pose at a time [s], seen from beside a place on the way [m]."""
        at = min(int(np.searchsorted(run["time_s"], time)), len(run) - 1)
        self.data.qpos[:] = run.qpos(np.array([at]))[0]
        mujoco.mj_forward(self.model, self.data)
        self.camera.lookat[:] = ahead, 0.0, 0.22
        self.renderer.update_scene(self.data, self.camera, self.option)
        self.renderer.enable_segmentation_rendering()
        geoms = self.renderer.render()[:, :, 0]
        self.renderer.disable_segmentation_rendering()
        drawn = self.renderer.render().copy()
        drawn[geoms < 0] = 255
        picture = Image.fromarray(drawn).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)
        draw = ImageDraw.Draw(picture)
        fell = time > run["time_s"][-1]
        draw.text((10, 8), label, fill="#202020", font=ImageFont.load_default(15))
        draw.text(
            (10, 28), f"t = {time:.1f} s{', fallen' if fell else ''}", fill="#202020", font=ImageFont.load_default(13)
        )
        return picture


def main() -> None:
    """Run both, draw the frames."""
    folder, frames, scene = Path(sys.argv[1]), [], None
    runs = {}
    for label, settings in SIDES.items():
        experiment = prepare(load_scenario("walk", [f"duration_s={SHOWN_S[1]}", "gait.steps=5", *settings]))
        runs[label] = experiment.run().trajectory
        scene = scene or Scene(experiment.plant)
    assert scene is not None
    walked = next(iter(runs.values()))

    def pair(time: float, *, upright: bool) -> Image.Image:
        ahead = float(np.interp(time, walked["time_s"], walked["position/torso/x_m"]))
        size = (WIDTH, 2 * HEIGHT) if upright else (2 * WIDTH, HEIGHT)
        both = Image.new("RGB", size, "white")
        for i, (label, run) in enumerate(runs.items()):
            both.paste(
                scene.picture(run, time, ahead if i == 0 else 0.0, label),
                (0, i * HEIGHT) if upright else (i * WIDTH, 0),
            )
        return both

    times = np.arange(*SHOWN_S, 1.0 / FRAMES_HZ)
    frames = [pair(float(time), upright=False) for time in times]
    options = {"duration": round(1000.0 / FRAMES_HZ), "loop": 0, "quality": 55, "method": 4, "minimize_size": True}
    frames[0].save(folder / "walking.webp", save_all=True, append_images=frames[1:], **options)
    still = Image.new("RGB", (len(STILLS_S) * WIDTH, 2 * HEIGHT), "white")
    for i, time in enumerate(STILLS_S):
        still.paste(pair(time, upright=True), (i * WIDTH, 0))
    still.resize((still.width * 2 // 3, still.height * 2 // 3), Image.Resampling.LANCZOS).quantize(128).save(
        folder / "walking.png"
    )


main()
