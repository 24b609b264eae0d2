"""Controllers of which no plugin is made: one line, and no folder."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path

import mujoco
import pytest

from cmg_mj.plant.mjcf import quiet
from tests.command import cmg_mj
from tests.features.plugin.made import make, needs_compiler

pytestmark = needs_compiler

UNSTABLE = "controller.rate_hz = 5: the closed loop is unstable on this rig's reduced model, sampled every 0.2 s"


@pytest.mark.usefixtures("elsewhere")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["linear", "--set", "controller.rate_hz=5"], f"cmg-mj: {UNSTABLE}"),
        (["linear", "--scenario", "walk"], "gait: "),
        pytest.param(
            ["linear", "--set", "controller.rate_hz=5", "--scenario", "two_axes"],
            f"cmg-mj: axis roll: {UNSTABLE}",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_one_line_and_nothing_written(arguments: list[str], words: str) -> None:
    complaint = cmg_mj("plugin", *arguments, "--out", "balance").err.splitlines()[-1]
    assert words in complaint
    assert not Path("balance").exists()


@pytest.mark.slow
def test_an_infinite_command_stops_the_gimbals() -> None:
    """Of a law that commands it when the rig hangs; the runner ends such a run."""
    made = make("linear", "controller.kind=tests.features.export.own_laws:Overflows", "push=[]")
    data, (axis,) = made.start(), made.experiment.plant.axes
    mujoco.mj_step(made.model, data, 5)
    assert abs(data.sensor("balance/command").data) == made.experiment.law.rate_limit
    data.qpos[made.model.jnt_qposadr[axis.line.joint]] += math.pi
    with quiet():
        mujoco.mj_step(made.model, data, 5)
    assert data.sensor("balance/command").data == 0.0


@pytest.mark.slow
@pytest.mark.usefixtures("elsewhere")
def test_without_a_compiler_all_else_is_written(monkeypatch: pytest.MonkeyPatch) -> None:
    """The line comes when `make` has something to compile, here with the compiler that is there after all."""
    monkeypatch.delenv("CC", raising=False)
    with monkeypatch.context() as patch:
        patch.setattr("shutil.which", lambda name: None)
        outcome = cmg_mj("plugin", "linear", "--out", "balance", "--set", "plant.equilibrium_bias_deg=0.5")
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err.splitlines()[-1] == (
        "cmg-mj: plugin: libcmg_mj_linear.so is missing, for no C compiler was found (CC, cc, gcc, clang); the other "
        "files are in balance: run `make` there where there is a compiler"
    )
    assert not Path("balance/libcmg_mj_linear.so").exists()
    subprocess.run(["make", "-C", "balance"], check=True, timeout=300, capture_output=True)
    outcome = cmg_mj("check", "balance/linear.xml")  # the command's own output
    assert outcome.status == 0
    assert "has the plugin cmg_mj.linear" in outcome.out + outcome.err
    mujoco.mj_loadPluginLibrary("balance/libcmg_mj_linear.so")
    assert mujoco.MjModel.from_xml_path("balance/linear.xml").nplugin == 1
