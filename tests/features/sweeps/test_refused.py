"""Refusals of a sweep before anything is computed, in one line, for the command, a study file and Python."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features import sweeps as swept
from cmg_mj.scenario.loading import load_scenario
from tests.command import cmg_mj

BIAS, NOISE = "plant.equilibrium_bias_deg", "sensors.accelerometer.noise_density_ug_rthz"
INNER, OUTER = "plant.accelerometer_inner_m", "plant.accelerometer_outer_m"
SHORT = ("duration_s=0.1", "push=[]")
BROKEN = """
class Broken:
    def __init__(self, dt, model):
        raise ValueError("never")

    def init(self, y):
        pass

    def step(self, state, y, u):
        pass
"""


@pytest.fixture(autouse=True)
def nothing_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Until something is refused."""
    for module in (".chunks", ""):
        monkeypatch.setattr(f"cmg_mj.features.sweeps{module}.compute", lambda *_, **__: pytest.fail("computed"))


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--vary", f"{BIAS}=0:1", "--sobol", "4"], "--sobol: indices compare several fields; vary two or more"),
        (["--vary", "seed=1,2"], "--vary seed: is not varied: .* --worlds says how many, --seed which"),
        (["--vary", "observer.kind=linear,ltv"], "--vary observer.kind: is not varied: --observers names them"),
        (["--vary", "title=a,b"], "--vary title: is not varied: no trial depends on it"),
        (["--vary", f"{BIAS}+compare.worlds=1,2"], "--vary compare.worlds: is not varied"),
        (["--vary", f"{BIAS}=0,1", "--observers", "linear,ltv,linear"], "observers: 'linear' is there twice"),
        (["--vary", f"{BIAS}=0,1", "--observers", "linear,broken:Broken"], "observer broken:Broken: ValueError: never"),
        (["--vary", f"{INNER}=0.05,0.5"], f"--vary {INNER}=0.5: .* the inner accelerometer must lie nearer"),
        (["--vary", "plant.model=nope.xml"], "--vary plant.model: plant.model = 'nope.xml': no such file"),
        (["--vary", f"{BIAS}=0,1", "--dry-run", "--cluster", "nonsense"], "--cluster nonsense: write tcp://HOST:PORT"),
    ],
)
@pytest.mark.usefixtures("elsewhere")
def test_on_the_command_line(arguments: list[str], complaint: str) -> None:
    Path("broken.py").write_text(BROKEN)
    assert_in(complaint, cmg_mj("sweep", "push_recovery", *arguments, "--out", "out").complaint)
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("sweep", "complaint"),
    [
        ("worlds = 0", "worlds = 0: must be a whole number, 1 or more"),
        ('design = "sample"\nn = -4', "n = -4: must be a whole number of points, 1 or more"),
        ("n = 4", "n = 4: is for the designs sample and sobol"),
        ("observers = [1]", "observers: 1: must be an observer's name"),
        ("observers = []", "observers: there must be one at least"),
        ("order = [1, 2]", "sweep.order: no such field"),
    ],
)
@pytest.mark.usefixtures("elsewhere")
def test_in_a_study_file(sweep: str, complaint: str) -> None:
    Path("s.toml").write_text(f'scenario = "push_recovery"\n[sweep]\n{sweep}\n[vary]\n"{BIAS}" = [0, 1]\n')
    assert_in(complaint, cmg_mj("sweep", "s.toml", "--out", "out").complaint)
    assert not Path("out").exists()


@pytest.mark.usefixtures("elsewhere")
def test_a_design_that_there_is_not() -> None:
    """An option that replaces the design does not make the study file right."""
    Path("s.toml").write_text(f'scenario = "push_recovery"\n[sweep]\ndesign = "nope"\n[vary]\n"{BIAS}" = "0:1"\n')
    complaint = cmg_mj("sweep", "s.toml", "--sample", "2", "--dry-run").complaint
    assert_in("s.toml: sweep.design = 'nope': must be one of grid, sample, sobol", complaint)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"worlds": 1.5}, "worlds = 1.5: must be"),
        ({"worlds": True}, "worlds = true: must be"),
        ({"sample": 2, "sobol": 2}, "sample and sobol: one of them"),
        ({"sobol": 2.0}, "--sobol 2.0: must be a power of two"),
        ({"observers": "linear"}, "observers = 'linear': must be a list of names, such as"),
        ({"vary": {BIAS: {"a": 1}}}, "must be a list of values, or text"),
        ({"vary": {BIAS: None}}, "must be a list of values, or text"),
    ],
)
def test_from_python(options: dict[str, Any], complaint: str) -> None:
    arguments: dict[str, Any] = {"vary": {BIAS: [0, 1]}} | options
    with pytest.raises(InputError) as info:
        swept.sweep("push_recovery", **arguments)
    assert_in(complaint, str(info.value))


def test_values_from_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """One alone, and numpy's: a column of numbers."""
    monkeypatch.undo()
    worlds: Any = np.int64(1)
    vary = {BIAS: 0.5, NOISE: np.array([200.0, 400.0]), "controller.rate_hz": [np.int64(100)]}
    result = swept.sweep(load_scenario("push_recovery", SHORT), vary, ["linear"], worlds=worlds)
    columns = ["point", *vary]
    assert [str(result.trials.schema.field(name).type) for name in columns] == ["int64", "double", "double", "int64"]
    assert result.trials.select(columns).to_pylist()[1] == {
        "point": 1,
        BIAS: 0.5,
        NOISE: 400.0,
        "controller.rate_hz": 100,
    }


def test_what_fits_only_with_another_value_is_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    result = swept.sweep(load_scenario("push_recovery", SHORT), {INNER: [0.05, 0.5], OUTER: [0.2, 0.6]}, worlds=1)
    assert result.trials["outcome"].to_pylist() == ["done", "done", "refused", "done"]


def assert_in(pattern: str, message: str) -> None:
    """The parts of a pattern, with ` .* ` between, stand in a line one after the other."""
    position = 0
    for part in pattern.split(" .* "):
        position = message.find(part, position)
        assert position >= 0, f"{part!r} is not in {message!r}"
