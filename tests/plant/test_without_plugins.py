"""A model with one of this package's plugins, which its own runs and analyses leave out."""

from __future__ import annotations

from pathlib import Path

import pytest

import cmg_mj
from cmg_mj.inputs.bundled import find

PLUGIN = """
  <extension>
    <plugin plugin="cmg_mj.gyro_free">
      <instance name="balance"><config key="seed" value="1"/></instance>
    </plugin>
  </extension>"""
SENSOR = """
    <plugin name="balance/tilt" plugin="cmg_mj.gyro_free" instance="balance"/>
    <plugin name="balance/command" instance="balance"/>
  </sensor>"""


def with_plugin(folder: Path, plugin: str = PLUGIN) -> Path:
    bundled = find("models", "scissored_pair.xml", ".xml", "model")
    text = bundled.read_text(encoding="utf-8").replace("cube.xml", str(bundled.with_name("cube.xml")))
    head = text.index(">") + 1
    path = folder / "rig.xml"
    path.write_text(text[:head] + plugin + text[head:].replace("</sensor>", SENSOR), encoding="utf-8")
    return path


def test_the_rig_is_the_one_without_it(tmp_path: Path) -> None:
    rig, plain = cmg_mj.load_plant(model=str(with_plugin(tmp_path))), cmg_mj.load_plant()
    assert rig.model.nplugin == 0
    assert rig.model.nsensor == plain.model.nsensor
    assert rig.largest_step == plain.largest_step
    assert rig.reduced == plain.reduced
    assert [hint for hint in rig.hints if hint not in plain.hints] == [
        "the model has the plugin cmg_mj.gyro_free, which is left out here: the scenario's own controller takes its "
        "place"
    ]


def test_another_packages_plugin_stays(tmp_path: Path) -> None:
    with pytest.raises(cmg_mj.InputError, match=r"plugin other\.gyro_free not found"):
        cmg_mj.load_plant(model=str(with_plugin(tmp_path, PLUGIN.replace("cmg_mj.", "other."))))
