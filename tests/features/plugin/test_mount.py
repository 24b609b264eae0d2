"""A mount that writes a plugin: the files, what they replace, the robot's own drives, several axes, Gymnasium."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np
import pytest

from cmg_mj.features.mounting.write import plugin_name
from tests.command import HANGS_AFTER_S, ROOT, cmg_mj, environment
from tests.features.mounting.push_robots import PENDULUM
from tests.features.mounting.robots import gymnasium_asset
from tests.features.mounting.test_mount import UNIVERSAL
from tests.features.plugin.made import needs_compiler

pytestmark = [needs_compiler, pytest.mark.usefixtures("elsewhere")]

EXAMPLE, OWN_ROBOT = (ROOT / "examples" / f"gymnasium_{name}.py" for name in ("plugin", "own_robot"))
MOUNT = ("mount", "robot.xml", "--body", "pole", "--quick", "--plugin")
DRIVEN = PENDULUM.replace(
    "</body>\n  </worldbody>",
    '<body pos="0 0 0.4"><joint name="elbow" axis="0 1 0" damping="0.1"/><geom size="0.02" mass="0.01"/></body>'
    '</body>\n  </worldbody>\n  <actuator><motor name="elbow_motor" joint="elbow" gear="2"/></actuator>',
)
"""The pendulum with a joint more, which the mount holds, and a motor."""


def there() -> list[str]:
    return sorted(os.listdir())


def contents(folder: str) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in Path(folder).iterdir() if path.is_file()}


@pytest.mark.parametrize(
    ("file", "name"),
    {
        "my robot-2.xml": "my_robot_2",
        "Äste.xml": "ste",
        "моя.xml": "robot",
        "a" * 60 + ".xml": "a" * 40,
    }.items(),
)
def test_a_plugin_is_named_after_the_models_file(file: str, name: str) -> None:
    assert plugin_name(Path(file)) == name


def test_nothing_is_begun_without_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    Path("robot.xml").write_text(PENDULUM, encoding="utf-8")
    monkeypatch.setattr("cmg_mj.features.mounting.write.mount", None)
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    assert "there is no C compiler" in cmg_mj(*MOUNT).complaint
    assert there() == ["robot.xml"]


@pytest.mark.slow
def test_all_is_written_or_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    Path("robot.xml").write_text(PENDULUM, encoding="utf-8")
    monkeypatch.setattr("cmg_mj.features.plugin.tables.FLAGS", ("-std=c99", "-include", "missing.h"))
    assert "refuses it" in cmg_mj(*MOUNT).complaint
    assert there() == ["robot.xml"]


@pytest.mark.slow
def test_a_mount_replaces_its_own_plugin_alone() -> None:
    Path("robot.xml").write_text(PENDULUM, encoding="utf-8")
    figures = json.loads(cmg_mj(*MOUNT, "--json").out)
    assert figures["plugin_model"] == "balanced_plugin/balanced.xml"
    assert there() == ["balanced.toml", "balanced.xml", "balanced_plugin", "robot.xml"]
    written = contents("balanced_plugin")
    assert not [name for name, content in written.items() if b"partial" in content]
    assert "balanced.xml exists; give another name, or --overwrite" in cmg_mj(*MOUNT).complaint
    outcome = cmg_mj(*MOUNT, "--overwrite", "--scale", "1.1")
    assert "wrote balanced_plugin; try: python balanced_plugin/balanced_example.py" in outcome.err
    assert contents("balanced_plugin")["rig.c"] != written["rig.c"]


def load(folder: str) -> mujoco.MjModel:
    (library,) = Path(folder).glob("*.so")
    (model,) = Path(folder).glob("*.xml")
    mujoco.mj_loadPluginLibrary(str(library))
    return mujoco.MjModel.from_xml_path(str(model))


@pytest.mark.slow
def test_the_robots_own_drives_are_the_programs() -> None:
    """And the pair's the plugin's, which sets the flywheels going: after a plain reset the robot stands."""
    Path("robot.xml").write_text(DRIVEN, encoding="utf-8")
    assert cmg_mj(*MOUNT, "--json", "-o", "driven.xml").status == 0
    model = load("driven_plugin")
    data = mujoco.MjData(model)
    random = np.random.default_rng(0)
    for step in range(round(10.0 / model.opt.timestep)):
        data.ctrl[:] = random.uniform(-300.0, 300.0, model.nu)  # the pair's are ignored
        data.actuator("elbow_motor").ctrl = 0.01 * np.sin(step)
        mujoco.mj_step(model, data)
        assert data.actuator("elbow_motor").force == pytest.approx(0.01 * np.sin(step))
    assert abs(data.joint("hinge").qpos[0]) < 0.1
    assert abs(data.joint("cube1/flywheel").qvel[0]) == pytest.approx(314.0, rel=0.01)


@pytest.mark.slow
def test_a_second_axis() -> None:
    """Its plugin holds both, also if the robot of the first mount is given with its plugin."""
    Path("robot.xml").write_text(UNIVERSAL.format(0), encoding="utf-8")
    shared = ("--body", "trunk", "--quick", "--json", "--plugin")
    first = cmg_mj("mount", "robot.xml", "--axis", "roll", "--name", "roll", "--position", "0 0 0.15", *shared)
    assert first.status == 0
    for robot in ("balanced.xml", "balanced_plugin/balanced.xml"):
        words = ("--axis", "pitch", "--name", "pitch", "--position", "0 0 0.35", "-o", "twice.xml", "--overwrite")
        assert cmg_mj("mount", robot, *words, *shared).status == 0
    model = load("twice_plugin")
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    for _ in range(round(10.0 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    assert abs(data.qpos[:2]).max() < 0.1
    assert data.sensor("balance/roll/command").data != data.sensor("balance/pitch/command").data != 0.0


PLAIN = """
import sys
import gymnasium
import mujoco
mujoco.mj_loadPluginLibrary("./balanced_plugin/libcmg_mj_balanced.so")
env = gymnasium.make("InvertedPendulum-v5", xml_file="./balanced_plugin/balanced.xml", frame_skip=8,
                     reset_noise_scale=0.001, disable_env_checker=True)
for seed in range(2):
    env.reset(seed=seed)
    env.action_space.seed(seed)
    for _ in range(500):
        action = env.action_space.sample()
        action[0] *= 0.01
        assert not env.step(action)[2], seed
assert not [name for name in sys.modules if name == "cmg_mj.plant"]
"""
"""The first action is the cart's; all others, the pair's, are ignored."""
RUN = """
import runpy, sys
runpy.run_path(sys.argv[0], run_name="__main__")
print("of this package:", [name for name in sys.modules if name.startswith("cmg_mj")])
"""


def output(code: str) -> str:
    """What a program prints that runs where this package's folder is not among those to import from."""
    imageio = find_spec("imageio")
    assert imageio is not None
    assert imageio.origin is not None
    variables = environment(PYTHONPATH=str(Path(imageio.origin).parents[1]))
    process = subprocess.run(
        [sys.executable, "-c", code], env=variables, capture_output=True, text=True, timeout=HANGS_AFTER_S
    )
    assert (process.returncode, process.stderr) == (0, "")
    return process.stdout


def stood(*arguments: object) -> int:
    """Seeds of ten that stand in the example."""
    text = output(f"import sys; sys.argv = {[str(EXAMPLE), *map(str, arguments)]!r}\n{RUN}")
    assert text.endswith("of this package: []\n")
    return int(re.findall(r"(\d+) of 10 stand 500 steps", text)[0])


@pytest.mark.slow
@pytest.mark.parametrize("options", [[], ["--release", "slider"]], ids=["cart held", "cart free"])
def test_the_pendulum_stands_in_stock_gymnasium(options: list[str]) -> None:
    pytest.importorskip("gymnasium")
    pytest.importorskip("imageio", reason='imageio is not installed: python -m pip install "gymnasium[mujoco]"')
    robot = gymnasium_asset("inverted_pendulum.xml")
    assert cmg_mj("mount", robot, "--body", "pole", "--axis", "hinge", *options, "--quick", "--json", "--plugin").out
    assert stood("InvertedPendulum-v5", "balanced_plugin/balanced.xml") == 10
    assert stood("InvertedPendulum-v5", "balanced.xml") == 0
    output(PLAIN)


@pytest.mark.slow
def test_a_robot_of_ones_own_stands_in_gymnasium() -> None:
    """And its file's step is not the plugin's, which is said."""
    pytest.importorskip("gymnasium")
    pytest.importorskip("imageio", reason='imageio is not installed: python -m pip install "gymnasium[mujoco]"')
    robot = PENDULUM.replace("<worldbody>", '<option timestep="0.004"/>\n  <worldbody>', 1)
    Path("robot.xml").write_text(robot, encoding="utf-8")
    assert "its physics steps of 4 ms are 2.5 ms in the plugin's model" in cmg_mj(*MOUNT).out
    for model, standing in (("balanced_plugin/balanced.xml", 10), ("balanced.xml", 0)):
        code = f"import runpy, sys; sys.argv = {['own', model, 'pole']!r}\n"
        text = output(code + f"runpy.run_path({str(OWN_ROBOT)!r}, run_name='__main__')")
        assert text == f"{standing} of 10 stand 500 steps of 0.02 s\n"
