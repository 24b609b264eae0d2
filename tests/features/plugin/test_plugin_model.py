"""A plant written as a model that names a plugin: the numbers of the plant, to the last bit."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest

from cmg_mj.features.mounting import mount
from cmg_mj.features.plugin.model import plugin_mjcf
from cmg_mj.plant.build import build
from cmg_mj.plant.mjcf import compile_model, parse
from cmg_mj.plant.plant import load_plant
from cmg_mj.scenario.plant_settings import PlantSettings

IN_FRAMES = """
<mujoco>
  <option timestep="0.01"><flag contact="disable"/></option>
  <worldbody>
    <frame euler="0 0 17" pos="0.1 0.2 0">
      <body name="pole" pos="0 0 0.6"><joint name="hinge" axis="0 1 0" damping="0.1"/>
        <geom size="0.05" pos="0 0 0.5" mass="1"/>
        <frame euler="13 7 5">
          <geom type="box" size="0.01 0.02 0.03" mass="0.01" pos="0.01 0.02 0.03"/>
          <site pos="0.03 0.1 0.2" euler="1 2 3"/>
          <frame euler="3 4 5">
            <body pos="0 0.1 0.1" euler="3 7 11"><joint axis="1 2 3" damping="0.1"/>
              <geom size="0.02" mass="0.01"/></body>
          </frame>
        </frame>
        <frame euler="1 2 3"><camera pos="0 0 1"/><light pos="0 0 1"/><site pos="0.1 0.2 0.3"/></frame>
      </body>
    </frame>
  </worldbody>
  <keyframe><key name="start" qpos="0.5 0"/></keyframe>
</mujoco>
"""


def test_what_stands_in_frames_is_where_it_was(tmp_path: Path) -> None:
    """Written and read again, frames would be rounded again; a keyframe `start` of the robot's gives way."""
    mounted = mount(mujoco.MjSpec.from_string(IN_FRAMES), "pole", axis="hinge")
    plant = load_plant(model=str(mounted.save(tmp_path / "robot.xml")))
    (tmp_path / "plugin.xml").write_text(plugin_mjcf(plant, "cmg_mj.mine", {}), encoding="utf-8")
    written, drawn = parse(tmp_path / "plugin.xml").compile(), compile_model(plant.drawn_spec(), plant.path)
    for name in ("body_pos", "body_quat", "body_inertia", "site_pos", "jnt_axis", "cam_pos", "cam_quat"):
        np.testing.assert_array_equal(getattr(written, name), getattr(drawn, name), err_msg=name)
    solid = drawn.geom_type != int(mujoco.mjtGeom.mjGEOM_MESH)
    for name in ("geom_pos", "geom_quat"):
        np.testing.assert_array_equal(getattr(written, name)[solid], getattr(drawn, name)[solid], err_msg=name)
    np.testing.assert_array_equal(written.key("start").qpos, plant.new_data().qpos)


def test_the_equilibrium_is_where_the_plant_balances(tmp_path: Path) -> None:
    """With the bias e in its masses, it does not where the file's keyframe has it."""
    plant = load_plant(equilibrium_bias_deg=0.5)
    (tmp_path / "plugin.xml").write_text(plugin_mjcf(plant, "cmg_mj.mine", {}), encoding="utf-8")
    rig = build(tmp_path / "plugin.xml", PlantSettings(), {})  # as `cmg-mj check` does
    (tilt,) = (axis.line for axis in plant.axes)
    assert tilt.lean(rig.model.key("equilibrium").qpos) == pytest.approx(-math.radians(0.5), rel=1e-12)
    assert [hint for hint in rig.hints if "cmg_mj.mine" in hint]
