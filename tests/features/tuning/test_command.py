"""`cmg-mj tune`: what it prints and writes, and what it says to wrong input."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path

import pytest

from cmg_mj.features.tuning import tune
from cmg_mj.scenario.loading import load_scenario
from tests.command import CommandOutcome, cmg_mj

QUICK = "title = 'Quick'\nduration_s = 0.6\n[[push]]\nstart_s = 0.2"


@pytest.fixture
def quick(elsewhere: None) -> str:
    """A short scenario with a push, in an empty folder."""
    Path("quick.toml").write_text(QUICK)
    return "quick.toml"


@pytest.fixture(scope="module")
def two_levels(tmp_path_factory: pytest.TempPathFactory) -> tuple[CommandOutcome, Path]:
    """What tuning at two levels of noise says, and the folder in which it ran."""
    folder = tmp_path_factory.mktemp("two-levels")
    with contextlib.chdir(folder):
        Path("quick.toml").write_text(QUICK)
        arguments = ("--observer", "linear", "--worlds", 3, "--noise-levels", "200,400", "--json")
        return cmg_mj("tune", "quick.toml", *arguments), folder


def test_command_prints_a_table_and_writes_what_reruns(quick: str) -> None:
    outcome = cmg_mj("tune", quick, "--observer", "linear", "--worlds", 3, "--out", "tuned")
    assert outcome.status == 0
    assert "Quick: linear, seed 0" in outcome.out
    assert outcome.err == "Written to tuned. Run with the tuned observer: cmg-mj run tuned/scenario.toml\n"
    figures = json.loads(Path("tuned/tuned.json").read_text())
    (level,) = figures["levels"]
    scenario = load_scenario("tuned/scenario.toml")
    assert scenario.observer.kind == "linear"
    assert scenario.observer.parameters == level["parameters"]
    assert cmg_mj("run", "tuned/scenario.toml", "--json").status == 0


def test_json_has_every_figure(two_levels: tuple[CommandOutcome, Path]) -> None:
    outcome, folder = two_levels
    figures = json.loads(outcome.out)
    assert figures["tuned"] == ["tau"]
    assert figures["worlds_fitted"] == 3
    assert figures["window_s"] == pytest.approx([0.2, 0.6])
    assert [level["noise_density_ug_rthz"] for level in figures["levels"]] == [200.0, 400.0]
    assert "given_best_at_noise_density_ug_rthz" in figures
    for level in figures["levels"]:
        mean, low, high = level["held_out_ratio"]
        assert low <= mean <= high
        ratio = level["held_out_given_rms_error_rad_s"] / level["held_out_rms_error_rad_s"]
        assert mean == pytest.approx(ratio, rel=0.05)
        assert level["verdict"] == ("better" if low > 1.0 else "worse" if high < 1.0 else "tie")
    assert figures["given_best_noise_is"] in ("found", "below", "above", "not bracketed")
    assert json.loads((folder / "runs/tune-linear-0/tuned.json").read_text()) == figures


def test_several_noises_make_a_scenario_each(two_levels: tuple[CommandOutcome, Path]) -> None:
    outcome, folder = two_levels
    assert outcome.err == ""
    for noise in (200.0, 400.0):
        scenario = load_scenario(str(folder / f"runs/tune-linear-0/scenario-{noise:g}.toml"))
        assert scenario.sensors.accelerometer.noise_density_ug_rthz == noise


def test_an_interruption_keeps_the_noises_that_are_done(quick: str) -> None:
    def stop_in_the_second(share: float) -> None:
        if share > 0.6:
            raise KeyboardInterrupt

    scenario = load_scenario(quick, ["observer.kind=linear"])
    study = tune(scenario, worlds=2, noise_ug_rthz=[200.0, 400.0], on_share=stop_in_the_second)
    assert [level.noise_ug_rthz for level in study.levels] == [200.0]

    def stop_at_once(share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tune(scenario, worlds=2, noise_ug_rthz=[200.0, 400.0], on_share=stop_at_once)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--observer", "linear", "--parameters", "tua"], "--parameters tua: linear has no such number to tune; did"),
        (["--observer", "finite_difference"], "observer finite_difference has no number to tune"),
        (
            ["--observer", "ltv", "--parameters", "H0[2],Q[2]", "--worlds", "2"],
            "the rate that ltv estimates does not depend on",
        ),
        (["--observer", "linear", "--noise-levels", "100,loud"], "--noise-levels '100,loud': must be numbers"),
        (["--observer", "linear", "--range", "tau=3:1"], "--range tau=3:1: must be two positive numbers"),
        (["--observer", "linear", "--range", "L=1:3"], "--range L: not tuned; tuned: tau"),
        (["--observer", "linear", "--worlds", "1"], "Invalid value for '--worlds'"),
    ],
)
def test_wrong_input_is_one_line(quick: str, arguments: list[str], line: str) -> None:
    assert cmg_mj("tune", quick, *arguments).complaint.startswith(line)
