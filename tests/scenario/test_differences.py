"""Differences from the bundled scenario: in the folder's name, the title line and the summary."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from cmg_mj import load_scenario, parse_scenario, prepare
from cmg_mj.scenario.resolve import describe_differences, folder_suffix
from tests.command import cmg_mj
from tests.run_folders import write

pytestmark = pytest.mark.usefixtures("elsewhere")

SHORT = ["--set", "duration_s=0.1", "--set", "push=[]"]


def differences_of(*settings: str, name: str = "push_recovery") -> dict[str, Any]:
    return prepare(load_scenario(name, settings)).differences


def test_nothing_differs() -> None:
    assert differences_of() == {}
    assert prepare(load_scenario("push_recovery", observer="ltv").model_copy(update={"seed": 3})).differences == {}
    assert (
        differences_of("title=other", "seed=4", "plant.equilibrium_bias_deg=0.5", "controller.gains=[35, 4, -1, 0.3]")
        == {}
    )
    assert prepare(parse_scenario({"duration_s": 1.0})).differences == {}
    assert (describe_differences({}), folder_suffix({})) == ("", "")


@pytest.mark.parametrize(
    ("setting", "field", "value", "name"),
    [
        ("plant.equilibrium_bias_deg=1", "plant.equilibrium_bias_deg", 1.0, "equilibrium_bias_deg=1"),
        ("observer.k1=30", "observer.k1", 30, "k1=30"),
        ("push=[]", "push", [], "push=none"),
        ("open_loop_observers=[ltv]", "open_loop_observers", ["ltv"], "open_loop_observers=ltv"),
        ("controller.gains=[30, 4, -1, 0.3]", "controller.gains", [30, 4, -1, 0.3], "gains=30_4_-1_0.3"),
    ],
)
def test_one_field(setting: str, field: str, value: object, name: str) -> None:
    result = differences_of(setting.replace("[ltv]", '["ltv"]'))
    assert result == {field: value}
    assert folder_suffix(result) == f"-{name}"


def test_names_that_need_their_section() -> None:
    values = {"sensors.encoder.rate_hz": 1.0, "sensors.fog.rate_hz": 2.0, "push.0.start_s": 1.0, "push.1.start_s": 2.0}
    assert folder_suffix(values) == "-encoder.rate_hz=1-fog.rate_hz=2-push.0.start_s=1-and-1-more"
    assert describe_differences(values) == ", encoder.rate_hz=1, fog.rate_hz=2, push.0.start_s=1, and 1 more"


def test_a_users_version_of_a_bundled_one() -> None:
    assert cmg_mj("run", "push_recovery", *SHORT, "--out", "it").status == 0
    write(
        Path("it/scenario.toml").read_text().replace("equilibrium_bias_deg = 0.5", "equilibrium_bias_deg = 0.6"),
        "push_recovery.toml",
    )
    expected = {"duration_s": 0.1, "plant.equilibrium_bias_deg": 0.6, "push": []}
    assert differences_of(name="push_recovery.toml") == expected


@pytest.mark.daily_cases("command0")
@pytest.mark.parametrize("command", [["run"], ["compare", "--observers", "linear,homogeneous", "--worlds", 1]])
def test_folder_title_and_summary_tell(command: list[Any]) -> None:
    settings = [*SHORT, "--set", "plant.equilibrium_bias_deg=1.0"]
    outcome = cmg_mj(command[0], "push_recovery", *command[1:], *settings)
    assert outcome.status == 0, outcome
    assert outcome.out.splitlines()[0].endswith(", seed 0, duration_s=0.1, equilibrium_bias_deg=1, push=none")
    kind = {"run": "homogeneous"}.get(command[0], command[0])
    (folder,) = os.listdir("runs")
    assert folder == f"push_recovery-{kind}-0-duration_s=0.1-equilibrium_bias_deg=1-push=none"
    summary = json.loads(Path(f"runs/{folder}/summary.json").read_text())
    for entry in summary if isinstance(summary, list) else [summary]:
        assert entry["differs"] == {"duration_s": 0.1, "plant.equilibrium_bias_deg": 1.0, "push": []}
    rerun = cmg_mj("run", f"runs/{folder}/scenario.toml")
    assert rerun.out.splitlines()[0].endswith("equilibrium_bias_deg=1, push=none")


def test_an_observer_that_the_bundled_scenario_does_not_suit() -> None:
    """No trimming without an estimate of the bias."""
    result = prepare(load_scenario("bias_estimation", ["controller.bias_trim_s=0"], "linear")).differences
    assert result == {"controller.bias_trim_s": 0.0}
