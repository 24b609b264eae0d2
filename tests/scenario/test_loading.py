"""Scenario files: what they mean, what replaces what, and that the resolved one says what the one it came from says."""

from __future__ import annotations

import dataclasses
import os
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from cmg_mj import Estimate, InputError, Measurement, load_scenario, parse_scenario, prepare
from cmg_mj.features.sweeps.chunks import Store
from cmg_mj.features.sweeps.study import SweepStudy, parse_axis
from cmg_mj.inputs.files import bundled, folder
from cmg_mj.laws.state_feedback import TABLE_2_GAINS
from cmg_mj.observers import OBSERVERS
from cmg_mj.scenario.schema import Scenario
from tests.command import cmg_mj
from tests.run_folders import write

pytestmark = pytest.mark.usefixtures("elsewhere")


def copy_models(place: str) -> None:
    Path(place).mkdir(parents=True, exist_ok=True)
    for name in ("scissored_pair.xml", "cube.xml"):
        (Path(place) / name).write_text((folder("models") / name).read_text())


# --- reading -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", bundled("scenarios"))
def test_bundled_scenarios_are_right(name: str) -> None:
    experiment = prepare(load_scenario(name))
    assert experiment.scenario.title
    assert load_scenario(str(folder("scenarios") / f"{name}.toml")) is not None


def test_an_empty_file_is_the_defaults() -> None:
    scenario = load_scenario(write(""))
    assert scenario.model_dump(exclude={"plant"}) == Scenario().model_dump(exclude={"plant"})
    assert dataclasses.replace(scenario.plant, model="") == dataclasses.replace(Scenario().plant, model="")


def test_open_loop_observers_leave_out_the_observer_itself_and_doubles() -> None:
    every = parse_scenario({"open_loop_observers": "all", "observer": {"kind": "ltv"}})
    assert every.open_loop_names() == [name for name in OBSERVERS if name != "ltv"]
    assert parse_scenario({"open_loop_observers": ["ltv", "linear", "ltv", "homogeneous"]}).open_loop_names() == [
        "ltv",
        "linear",
    ]


# --- replacing -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("plant.equilibrium_bias_deg=1.5", lambda s: s.plant.equilibrium_bias_deg == 1.5),
        ("plant.integrator='Euler'", lambda s: s.plant.integrator == "Euler"),
        ("controller.gains=[1, 2, 3, 4]", lambda s: s.controller.gains == (1.0, 2.0, 3.0, 4.0)),
        ("controller.lqr.state_cost=[1, 1, 1, 1]", lambda s: s.controller.lqr is not None),
        ("push.0.torque_n_m=-2", lambda s: s.push[0].torque_n_m == -2.0),
        ("push=[]", lambda s: s.push == []),
        ("title=a = b", lambda s: s.title == "a = b"),
        (" title = spaced ", lambda s: s.title == "spaced"),
        ("open_loop_observers=all", lambda s: len(s.open_loop_names()) == len(OBSERVERS) - 1),
    ],
)
def test_a_setting_replaces_a_field(setting: str, value: Any) -> None:
    assert not value(load_scenario("push_recovery"))
    assert value(load_scenario("push_recovery", [setting]))


def test_another_observer_brings_its_own_parameters() -> None:
    """The parameters of the file's observer do not pass to it; parameters set on the command line do."""
    file = write("[observer]\nkind = 'homogeneous'\nk1 = 30.0")
    assert load_scenario(file, observer="homogeneous").observer.parameters == {"k1": 30.0}
    assert load_scenario(file, observer="ltv").observer.parameters == {}
    assert load_scenario(file, ["observer.tau=0.05"], observer="linear").observer.parameters == {"tau": 0.05}
    assert load_scenario(file).with_observer("homogeneous").observer.parameters == {"k1": 30.0}
    assert load_scenario(file).with_observer("ltv").observer.parameters == {}


def test_a_setting_mends_a_file_with_another_observer_too() -> None:
    file = write("duration_s = 'x'\n[observer]\nkind = 'homogeneous'")
    assert load_scenario(file, ["duration_s=2"], observer="ltv").duration_s == 2.0


def test_a_study_may_leave_its_scenario_empty() -> None:
    assert load_scenario(write("[sweep]\nworlds = 2"), fields={}).duration_s == Scenario().duration_s


def test_what_does_not_fit_names_the_file_whenever_it_is_found() -> None:
    scenario = load_scenario(write("plant.timestep_s = 0.001\n[controller]\nrate_hz = 300"), ["seed=1"]).with_observer(
        "ltv"
    )
    with pytest.raises(InputError, match=r"^my\.toml with --set seed=1: controller\.rate_hz = 300 Hz: not a whole"):
        prepare(scenario)


# --- the model's file ----------------------------------------------------------------------------------------


def test_a_model_is_found_beside_its_scenario() -> None:
    """Not in the folder one happens to stand in, where another may have the same name."""
    copy_models("here")
    copy_models(".")
    Path("scissored_pair.xml").write_text("<mujoco/>")
    assert prepare(load_scenario(write("", "here/my.toml"))).plant.path == Path("here/scissored_pair.xml")


def test_a_bundled_model_is_meant_unless_there_is_one_beside_the_scenario() -> None:
    write("<mujoco/>", "scissored_pair.xml")
    bundled_one = folder("models") / "scissored_pair.xml"
    assert prepare(load_scenario(write("", "here/my.toml"))).plant.path == bundled_one
    assert prepare(load_scenario("push_recovery")).plant.path == bundled_one


def test_a_model_on_the_command_line_is_relative_to_where_one_stands() -> None:
    copy_models("rigs")
    scenario = load_scenario(write("", "here/my.toml"), ["plant.model=rigs/scissored_pair.xml"])
    assert prepare(scenario).plant.path == Path("rigs/scissored_pair.xml")


def test_a_model_that_is_nowhere() -> None:
    copy_models("rigs")
    with pytest.raises(InputError, match=r"^here/my\.toml: plant\.model = 'rig\.xml': no such file"):
        load_scenario(write("[plant]\nmodel = 'rig.xml'", "here/my.toml"))


# --- resolving -----------------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Odd:
    """A user's observer with defaults of all sorts."""

    dt: float
    model: object
    gain: float = 0.5
    nothing: float | None = None
    matrix: np.ndarray = dataclasses.field(default_factory=lambda: np.eye(2))
    number: np.float64 = dataclasses.field(default_factory=lambda: np.float64(0.1))
    pair: tuple[str, ...] = ("a", "b")
    function: Any = max
    made: int = dataclasses.field(init=False, default=3)

    def init(self, y: Measurement) -> Any:
        return y.y1

    def step(self, state: Any, y: Measurement, u: Any) -> tuple[Any, Estimate]:
        return y.y1, Estimate(y.y1, self.gain * (y.y1 - state) / self.dt, y.y2)


RESOLVED = {
    "defaults": {},
    "lqr": {"controller": {"lqr": {"state_cost": [30, 1, 0.5, 0.1], "input_cost": 0.3}}},
    "every observer": {"open_loop_observers": "all", "observer": {"kind": "luenberger"}},
    "rational": {"plant": {"timestep_s": 1 / 3000}, "controller": {"rate_hz": 1000 / 3}, "duration_s": 0.3},
    "a user's observer": {"observer": {"kind": f"{__name__}:Odd", "gain": 0.4, "nothing": 2.0}},
    "pushes": {"push": [{"start_s": 0.1}, {"start_s": 0.2, "torque_n_m": -0.1}], "seed": 2**70},
}


@pytest.mark.parametrize("fields", RESOLVED.values(), ids=RESOLVED)
def test_resolving_twice_changes_nothing(fields: dict[str, Any]) -> None:
    sensors = {kind: {"rate_hz": 1000 / 3} for kind in ("accelerometer", "encoder", "fog")}
    if "plant" in fields:
        fields = {**fields, "sensors": sensors}
    resolved = prepare(parse_scenario(fields)).resolved()
    rerun = prepare(load_scenario(write(tomli_w.dumps(resolved)))).resolved()
    assert rerun == resolved
    assert tomllib.loads(tomli_w.dumps(resolved)) == resolved


def test_the_resolved_scenario_has_everything_written_out() -> None:
    resolved = prepare(load_scenario("push_recovery")).resolved()
    assert resolved["plant"]["model"] == "scissored_pair.xml"  # a bundled one by name, wherever it is installed
    assert resolved["controller"]["gains"] == list(TABLE_2_GAINS)
    friction = {"friction_n_m": 0.0, "damping_n_m_s": 0.0, "friction_width_rad_s": 0.05}
    assert resolved["observer"] == {"kind": "homogeneous", "k1": 20.0, "k2": 150.0, "alpha": 0.85, **friction}
    assert resolved["sensors"]["fog"]["range_deg_s"] == 490.0
    assert set(resolved["versions"]) == {"cmg_mj", "mujoco", "numpy", "scipy", "python"}
    assert resolved["versions"]["python"] == ".".join(map(str, sys.version_info[:3]))


def test_a_users_parameters_are_written_as_far_as_toml_can_hold_them() -> None:
    kind = f"{__name__}:Odd"
    assert prepare(parse_scenario({"observer": {"kind": kind}})).resolved()["observer"] == {
        "kind": kind,
        "gain": 0.5,
        "matrix": [[1.0, 0.0], [0.0, 1.0]],
        "number": 0.1,
        "pair": ["a", "b"],
    }


def test_a_users_model_is_written_with_its_whole_path() -> None:
    copy_models("here")
    resolved = prepare(load_scenario(write("", "here/my.toml"))).resolved()
    assert resolved["plant"]["model"] == str(Path("here/scissored_pair.xml").resolve())


def test_of_gains_and_weights_the_one_set_replaces_the_files(tmp_path: Path) -> None:
    """So that a scenario that `mount` wrote, which has gains, takes the weights that `check` proposes."""
    path = tmp_path / "with_gains.toml"
    path.write_text('[controller]\ngains = "scaled"\n', encoding="utf-8")
    weights = "controller.lqr={state_cost=[1.0, 1.0, 1.0, 1.0], input_cost=10}"
    controller = load_scenario(str(path), [weights]).controller
    assert controller.gains is None
    assert controller.lqr is not None
    with pytest.raises(InputError, match="give either gains or lqr, not both"):
        load_scenario(str(path), [weights, "controller.gains=scaled"])


# --- files that are none -------------------------------------------------------------------------------------


def _sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(3_000_000_000)


STRANGE: dict[str, tuple[Callable[[Path], object], str]] = {
    "a FIFO": (lambda path: os.mkfifo(path), "no ordinary file"),
    "a device": (lambda path: path.symlink_to("/dev/zero"), "no ordinary file"),
    "many dots": (lambda path: path.write_text(".".join("a" * 5000) + "=1"), "tables in too many tables"),
    "dots": (lambda path: path.write_text(".".join("a" * 300) + "=1"), "tables in too many tables"),
    "many brackets": (lambda path: path.write_text("a=" + "[" * 5000), "not valid TOML: "),
    "3 GB": (_sparse, "larger than 10 MB"),
    "no UTF-8": (lambda path: path.write_bytes(b"a = '\xff'"), "not UTF-8 text"),
}


@pytest.mark.skipif(sys.platform == "win32", reason="has no FIFO")
@pytest.mark.parametrize("kind", STRANGE)
def test_a_strange_file_is_refused_in_a_line(kind: str) -> None:
    """As a scenario, and as a study; beside a model, it is no scenario."""
    make, words = STRANGE[kind]
    copy_models(".")
    make(Path("scissored_pair.toml"))
    for command in ("check", "sweep"):
        assert words in cmg_mj(command, "scissored_pair.toml").complaint
    assert "run push_recovery --set plant.model" in cmg_mj("check", "scissored_pair.xml").out


@pytest.mark.skipif(sys.platform == "win32", reason="has no FIFO")
@pytest.mark.parametrize("kind", [*STRANGE, "a text"])
def test_a_strange_study_in_a_folder_is_not_ours(kind: str) -> None:
    Path("sweep").mkdir()
    make, _ = STRANGE.get(kind, (lambda path: path.write_text('scenario = "x"'), ""))
    make(Path("sweep/study.toml"))
    study = SweepStudy(
        load_scenario("push_recovery"), (parse_axis("plant.equilibrium_bias_deg", "0,1", ""),), ("linear",), 1
    )
    assert Store.open(Path("sweep"), study).folder == Path("sweep-2")
