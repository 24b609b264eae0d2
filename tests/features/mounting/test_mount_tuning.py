"""`mount --tune`: the observer tuned on the mounted robot."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.mounting import write
from cmg_mj.features.mounting.limits import PushMargin
from cmg_mj.features.mounting.write import TUNED_COMMENT, tune_mounted
from cmg_mj.features.tuning import NoiseLevelResult, TuningResult
from cmg_mj.results.folder import is_signed, signed
from cmg_mj.scenario.loading import load_scenario
from tests.command import cmg_mj
from tests.features.mounting.robots import EXAMPLES

GIVEN = np.array([0.2, 0.21, 0.19])
LEVEL = NoiseLevelResult(400.0, {"tau": 0.05}, {"tau": 0.05}, [], 0.1, 0.2, 0.5 * GIVEN, GIVEN, 0.3, 5.0, 0)


TORSO = ("mount", str(EXAMPLES / "torso.xml"), "--body", "torso", "--axis", "x", "--scale", "1.21", "--quick")


class Stubs(NamedTuple):
    path: Path
    use: Callable[[NoiseLevelResult, float, float], None]
    """Sets the result of the search, and E before and after."""


@pytest.fixture
def stubs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Stubs:
    """A scenario as a mount writes it, and a search and push margins that cost nothing."""
    path = tmp_path / "balanced.toml"
    path.write_bytes(signed('seed = 3\n\n[observer]\nkind = "linear"\ntau = 0.04\n', ".toml"))

    def use(level: NoiseLevelResult, before: float, after: float) -> None:
        study = TuningResult("linear", {"tau": 0.04}, [], [], load_scenario(str(path)), 8, [level])
        margins = iter([PushMargin(before, before), PushMargin(after, after)])
        monkeypatch.setattr(write, "tune", lambda *_, **__: study)
        monkeypatch.setattr(write, "push_margin", lambda *_: next(margins))

    return Stubs(path, use)


def test_better_parameters_come_into_the_scenario(stubs: Stubs) -> None:
    stubs.use(LEVEL, 1.0, 1.1)
    tuning = tune_mounted(stubs.path)
    assert tuning.figures()["tuned_in_use"]
    assert tuning.line().endswith(": the scenario has the tuned ones")
    text = stubs.path.read_text(encoding="utf-8")
    assert tomllib.loads(text) == {"seed": 3, "observer": {"kind": "linear", "tau": 0.05}}
    assert f"{TUNED_COMMENT}\n[observer]" in text
    assert is_signed(stubs.path)


@pytest.mark.parametrize(
    ("level", "after", "reason"),
    [
        (LEVEL, 0.9, "because with tuned ones it stands less"),
        (replace(LEVEL, rms=GIVEN), 1.1, "because tuned ones are not better beyond chance"),
    ],
)
def test_others_do_not(stubs: Stubs, level: NoiseLevelResult, after: float, reason: str) -> None:
    before = stubs.path.read_bytes()
    stubs.use(level, 1.0, after)
    assert tune_mounted(stubs.path).line().endswith(f"the scenario keeps the others, {reason}")
    assert stubs.path.read_bytes() == before


def test_not_beside_a_plugin(elsewhere: None) -> None:
    torso = str(EXAMPLES / "torso.xml")
    assert cmg_mj("mount", torso, "--body", "torso", "--tune", "--plugin").complaint.startswith(
        "--tune: not with --plugin"
    )
    assert list(Path().iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("failure", "status", "message"),
    [
        (InputError("nothing to tune"), 2, "mounted, but --tune: nothing to tune"),
        (KeyboardInterrupt(), 130, "interrupted; balanced.xml and balanced.toml are whole"),
    ],
)
def test_what_is_mounted_stays(
    elsewhere: None, monkeypatch: pytest.MonkeyPatch, failure: BaseException, status: int, message: str
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise failure

    monkeypatch.setattr(write, "tune_mounted", fail)
    outcome = cmg_mj(*TORSO, "--tune")
    assert (outcome.status, outcome.err.splitlines()[-1]) == (status, f"cmg-mj: {message}")
    assert "inertia 8.135 kg m^2" in outcome.out
    assert is_signed(Path("balanced.toml"))


@pytest.mark.slow
def test_the_command(elsewhere: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever comes out, within its time, the scenario runs and its first line is right."""
    monkeypatch.setattr(write, "TUNED_WORLDS", 2)
    monkeypatch.setattr(write, "MAX_TUNING_S", 1.0)
    outcome = cmg_mj(*TORSO, "--observer", "linear", "--tune")
    assert outcome.status == 0
    assert "linear tuned" in outcome.out
    assert is_signed(Path("balanced.toml"))
    assert load_scenario("balanced.toml").observer.parameters["tau"] > 0.02
