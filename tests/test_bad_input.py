"""Wrong input of every kind: one clear line that names file, field and what is allowed, and the right exit status."""

from __future__ import annotations

import math
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from cmg_mj import Estimate, InputError, Measurement, load_plant, parse_scenario, prepare
from cmg_mj.complaint import expected
from cmg_mj.errors import nearest, shown
from cmg_mj.resources import folder
from cmg_mj.trajectory import Trajectory
from tests.command import Said, cmg_mj

OVER_0, FROM_0 = "must be a number greater than 0", "must be a number greater than or equal to 0"
WHOLE = "must be a whole number greater than or equal to 0"
GRID = "not a whole number of physics steps of 0.001 s"


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))  # to which the command adds


@pytest.fixture(autouse=True)
def _no_litter(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> Iterator[None]:
    """MuJoCo must neither print nor write its log, and no temporary file may stay."""
    yield
    assert capfd.readouterr() == ("", "")
    litter = [path for path in tmp_path.rglob("*") if path.name == "MUJOCO_LOG.TXT" or path.name.endswith(".partial")]
    assert not litter


def table(*rows: tuple) -> pytest.MarkDecorator:
    """Parametrise with rows (what, input, expected fragments...)."""
    return pytest.mark.parametrize(
        ("given", "fragments"), [pytest.param(given, fragments, id=what) for what, given, *fragments in rows]
    )


def check(text: str | bytes) -> Said:
    Path("my.toml").write_bytes(text.encode() if isinstance(text, str) else text)
    return cmg_mj("check", "my.toml")


@pytest.fixture
def quick() -> str:
    """A short scenario."""
    Path("quick.toml").write_text("duration_s = 0.3")
    return "quick.toml"


def assert_in_order(fragments: list[str], line: str) -> None:
    assert re.search(".*".join(map(re.escape, fragments)), line), (fragments, line)


# --- the scenario file ---------------------------------------------------------------------------------------


@table(
    ("text for a number", 'duration_s = "abc"', f"duration_s = 'abc': {OVER_0}"),
    ("a number in quotes", 'duration_s = "15"', f"duration_s = '15': {OVER_0}"),
    ("true for a number", "duration_s = true", f"duration_s = true: {OVER_0}"),
    ("a list for a number", "duration_s = [1]", f"duration_s = [1]: {OVER_0}"),
    ("a section for a number", "duration_s = {a = 1}", f"duration_s = {{...}}: {OVER_0}"),
    ("a date for a number", "duration_s = 1979-05-27", f"duration_s = 1979-05-27: {OVER_0}"),
    ("nan", "duration_s = nan", "duration_s = nan: must be a finite number greater than 0"),
    ("infinity", "duration_s = inf", "duration_s = inf: must be a finite number greater than 0"),
    ("minus infinity", "duration_s = -inf", "duration_s = -inf: must be a finite number greater than 0"),
    ("nothing", "duration_s = 0", f"duration_s = 0: {OVER_0}"),
    ("negative", "duration_s = -1.5", f"duration_s = -1.5: {OVER_0}"),
    ("off the physics grid", "duration_s = 1.0004", f"duration_s = 1.0004 s: {GRID}", "nearest: 1 s or 1.001 s"),
    ("a number for text", "title = 3", "title = 3: must be text in quotes"),
    ("half a seed", "seed = 1.5", f"seed = 1.5: {WHOLE}"),
    ("a seed in quotes", 'seed = "7"', f"seed = '7': {WHOLE}"),
    ("true for a seed", "seed = true", f"seed = true: {WHOLE}"),
    ("a negative seed", "seed = -1", f"seed = -1: {WHOLE}"),
    ("typo at top level", "durations = 3", "durations: no such field; did you mean 'duration_s'?", "allowed: ", "seed"),
    ("typo in a section's name", "[plnt]\nmodel = 'x'", "plnt: no such field; did you mean 'plant'?"),
    ("typo in another case", "[Plant]\nmodel = 'x'", "Plant: no such field; did you mean 'plant'?"),
    ("two wrong fields", 'seed = "b"\n[plant]\nmodl = 3', f"seed = 'b': {WHOLE}; plant.modl: no such field"),
    ("a section that is a number", "plant = 3", "plant = 3: must be a section, written under [plant]"),
    ("a section that is a list", "[[plant]]\nmodel = 'x'", "plant = [{...}]: must be a section, written under [plant]"),
    ("a wrong version", "versions = {mujoco = 4}", "versions.mujoco = 4: must be text in quotes"),
)
def test_top_level(given: str, fragments: list[str]) -> None:
    assert_in_order(["my.toml: ", *fragments], check(given).complaint)


@table(
    ("typo", "modl = 'x'", "plant.modl: no such field; did you mean 'model'? allowed: equilibrium_bias_deg, "),
    ("a number for text", "model = 3", "plant.model = 3: must be text in quotes"),
    (
        "typo in a model's name",
        "model = 'scissord_pair'",
        "'scissord_pair': no such file",
        "did you mean 'scissored_pair'?",
    ),
    ("no model's name", "model = ''", "plant.model = '': no such file, nor a bundled one; bundled: "),
    ("a folder for a model", "model = '.'", "plant.model = '.': is a folder, not a file"),
    ("a number in quotes", "equilibrium_bias_deg = '1'", "'1': must be a number greater than -45 and less than 45"),
    ("beyond the upper bound", "equilibrium_bias_deg = 45", "= 45: must be a number greater than -45 and less than 45"),
    (
        "below the lower bound",
        "initial_tilt_deg = -50.5",
        "= -50.5: must be a number greater than -45 and less than 45",
    ),
    (
        "no step",
        "timestep_s = 0.0",
        "plant.timestep_s = 0.0: must be a number greater than or equal to 1e-06 and at most 0.1",
    ),
    (
        "a large step",
        "timestep_s = 0.2",
        "plant.timestep_s = 0.2: must be a number greater than or equal to 1e-06 and at most 0.1",
    ),
    ("a step the rates do not fit", "timestep_s = 0.003", "controller.rate_hz = 200 Hz: not a whole", "166.667 Hz"),
    ("an integrator in small letters", "integrator = 'rk4'", "must be one of 'RK4', 'Euler', ", "did you mean 'RK4'?"),
    ("an integrator's number", "integrator = 4", "plant.integrator = 4: must be one of 'RK4', 'Euler', 'implicit', "),
    ("yes for true", "lock_thrust_bearing = 'yes'", "plant.lock_thrust_bearing = 'yes': must be true or false"),
    ("1 for true", "lock_thrust_bearing = 1", "plant.lock_thrust_bearing = 1: must be true or false"),
    ("negative friction", "gimbal_friction_n_m = -1", f"plant.gimbal_friction_n_m = -1: {FROM_0}"),
    ("true for an optional number", "tilt_damping_n_m_s = true", f"plant.tilt_damping_n_m_s = true: {FROM_0}"),
    ("nan without bounds", "flywheel_imbalance_kg_m = nan", "flywheel_imbalance_kg_m = nan: must be a finite number"),
)
def test_plant(given: str, fragments: list[str]) -> None:
    assert_in_order(["my.toml: ", *fragments], check(f"[plant]\n{given}").complaint)


@table(
    ("typo", "rate = 200", "controller.rate: no such field; did you mean 'rate_hz'? allowed: angles, feedback, gains"),
    ("no rate", "rate_hz = 0", f"controller.rate_hz = 0: {OVER_0}"),
    ("a negative rate", "rate_hz = -200", f"controller.rate_hz = -200: {OVER_0}"),
    ("nan", "rate_hz = nan", "controller.rate_hz = nan: must be a finite number greater than 0"),
    ("infinite", "rate_hz = inf", "controller.rate_hz = inf: must be a finite number greater than 0"),
    ("in quotes", "rate_hz = '200'", f"controller.rate_hz = '200': {OVER_0}"),
    ("true", "rate_hz = true", f"controller.rate_hz = true: {OVER_0}"),
    ("no divisor", "rate_hz = 300", f"controller.rate_hz = 300 Hz: {GRID}", "nearest: 333.333 Hz or 250 Hz"),
    ("above the physics rate", "rate_hz = 2000", f"controller.rate_hz = 2000 Hz: {GRID}", "(nearest: 1000 Hz)"),
    ("no limit", "rate_limit_rad_s = 0", f"controller.rate_limit_rad_s = 0: {OVER_0}"),
    ("three gains", "gains = [1, 2, 3]", "controller.gains = [1, 2, 3]: must be a list of 4 numbers"),
    ("five gains", "gains = [1, 2, 3, 4, 5]", "controller.gains = [1, 2, 3, 4, 5]: must be a list of 4 numbers"),
    ("text among gains", "gains = [1, 2, 3, 'a']", "controller.gains = [1, 2, 3, 'a']: must be a list of 4 numbers"),
    ("true among gains", "gains = [1, 2, 3, true]", "controller.gains = [1, 2, 3, true]: must be a list of 4 numbers"),
    ("nan among gains", "gains = [1, 2, 3, nan]", "gains = [1, 2, 3, nan]: must be a list of 4 finite numbers"),
    ("nested gains", "gains = [[1, 2, 3, 4]]", "controller.gains = [[1, 2, 3, 4]]: must be a list of 4 numbers"),
    ("one gain", "gains = 3", "controller.gains = 3: must be a list of 4 numbers"),
    (
        "gains and lqr",
        "gains = [1, 2, 3, 4]\nlqr.state_cost = [1, 1, 1, 1]",
        "controller: give either gains or lqr, not both",
    ),
    (
        "lqr without weights",
        "lqr = {}",
        "lqr.state_cost: missing; must be a list of 4 numbers greater than or equal to 0",
    ),
    ("typo in lqr", "lqr.state_cots = [1, 1, 1, 1]", "lqr.state_cots: no such field; did you mean 'state_cost'?"),
    ("lqr is a number", "lqr = 3", "controller.lqr = 3: must be a section, written under [controller.lqr]"),
    ("a negative weight", "lqr.state_cost = [1, 1, 1, -1]", "state_cost = [1, 1, 1, -1]: must be a list of 4 numbers "),
    (
        "no input weight",
        "lqr = {state_cost = [1, 1, 1, 1], input_cost = 0}",
        f"controller.lqr.input_cost = 0: {OVER_0}",
    ),
    (
        "weights without effect",
        "lqr.state_cost = [1, 1, 1, 0]",
        "controller.lqr: no stabilising gain",
        "x_e a positive",
    ),
    (
        "unknown feedback",
        "feedback = 'gyro'",
        "controller.feedback = 'gyro': must be one of 'observer', 'fog', 'truth'",
    ),
    (
        "typo in a choice",
        "angles = 'measure'",
        "'measure': must be one of 'measured', 'estimated'; did you mean 'measured'?",
    ),
)
def test_controller(given: str, fragments: list[str]) -> None:
    assert_in_order(["my.toml: ", *fragments], check(f"[controller]\n{given}").complaint)


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        (
            "kind = 'adaptive'\ntorque = true",
            "bias, torque: both are true, but a constant torque and an equilibrium bias",
        ),
        ("kind = 'adaptive'\nbias = false", "bias, torque, sinusoid_hz: nothing to estimate"),
        ("kind = 'adaptive'\nL = [1.0, -3.0]", "L: A + L C must be Hurwitz"),
        ("kind = 'adaptive'\nL = [1.0]", "L = [1.0]: must be a list of 2 numbers"),
        ("kind = 'adaptive'\nGamma = 3", "Gamma = 3: must be a list of 3 numbers greater than 0"),
        ("kind = 'adaptive'\nsinusoid_hz = 500", "sinusoid_hz = 500: must be below half the sample rate, 100 Hz"),
        ("kind = 'homogeneous_adaptive'\nL = [20.0, 0.0]", "L: A + L C must be Hurwitz"),
        ("kind = 'high_gain'\nd_inf = 1.0", "d_inf = 1.0: must be a number greater than or equal to 0 and less than 1"),
        ("kind = 'high_gain'\nb = 2.0", "b = 2: must be below (1 - d_inf)/d_inf = 0.6667, andrieu2009 (21)"),
        ("kind = 'homogeneous'\nalpha = 0.5", "alpha = 0.5: must be a number greater than 0.5 and at most 1"),
        ("kind = 'homogeneous'\nfriction_n_m = 8.0", "friction_n_m, damping_n_m_s: too much for the sample period"),
    ],
)
def test_conditions_of_the_theorems(given: str, complaint: str) -> None:
    kind = given.split("'")[1]
    said = check(f"[observer]\n{given}").complaint
    assert said.startswith(f"my.toml: observer.{complaint}"), said
    assert said.endswith(f"(observer {kind})"), said


def test_trimming_without_a_bias_estimate() -> None:
    said = check("[controller]\ntrim_s = 1.0").complaint
    assert said.startswith("my.toml: controller.trim_s = 1: needs an observer in the loop that estimates the bias")


@table(
    (
        "typo in a name",
        "kind = 'homogenous'",
        "observer.kind = 'homogenous': no such observer; did you mean 'homogeneous'?",
    ),
    ("in capitals", "kind = 'LTV'", "observer.kind = 'LTV': no such observer; did you mean 'ltv'?"),
    ("no name", "kind = ''", "observer.kind = '': no such observer; allowed: ", "or your own as package.module:Class"),
    ("a number", "kind = 3", "observer.kind = 3: must be text in quotes"),
    ("unknown parameter", "alfa = 0.9", "observer.alfa: homogeneous has no such parameter; did you mean 'alpha'?"),
    ("none at all", "kind = 'finite_difference'\ntau = 1", "observer.tau: finite_difference has no such parameter"),
    ("another's parameter", "kind = 'ltv'\nk1 = 3.0", "observer.k1: ltv has no such parameter; allowed: H0, Q"),
    ("text", "k1 = 'abc'", f"observer.k1 = 'abc': {OVER_0} (observer homogeneous)"),
    ("a number in quotes", "k1 = '20'", f"observer.k1 = '20': {OVER_0} (observer homogeneous)"),
    ("true", "k1 = true", f"observer.k1 = true: {OVER_0} (observer homogeneous)"),
    ("a list", "k1 = [1]", f"observer.k1 = [1]: {OVER_0} (observer homogeneous)"),
    ("negative", "k1 = -1", f"observer.k1 = -1: {OVER_0} (observer homogeneous)"),
    ("nan", "k1 = nan", "observer.k1 = nan: must be a finite number greater than 0 (observer homogeneous)"),
    ("out of its range", "alpha = 0.5", "alpha = 0.5: must be a number greater than 0.5 and at most 1 (observer homo"),
    (
        "short",
        "kind = 'ltv'\nQ = [1, 2]",
        "observer.Q = [1, 2]: must be a list of 3 numbers greater than 0 (observer ltv)",
    ),
    ("not stable", "kind = 'luenberger'\nL = [[0, 0], [0, 0], [0, 0]]", "observer.L: A - L C must be Hurwitz"),
    ("the bench's own dt", "dt = 0.01", "observer.dt: set by the bench"),
    ("the bench's own model", "model = 3", "observer.model: set by the bench"),
    ("no such module", "kind = 'no_such_package:Mine'", "cannot be imported: ModuleNotFoundError", "no_such_package"),
    (
        "no such class",
        "kind = 'math:Mine'",
        "cannot be imported: AttributeError: module 'math' has no attribute 'Mine'",
    ),
    ("no class", "kind = 'math:sqrt'", "'math:sqrt': must be a class with the methods init(y) and step(state, y, u)"),
)
def test_observer(given: str, fragments: list[str]) -> None:
    assert_in_order(["my.toml: ", *fragments], check(f"[observer]\n{given}").complaint)


@table(
    ("observer that is text", "observer = 'ltv'", "observer = 'ltv': must be a section, written under [observer]"),
    ("companions in words", "companions = 'al'", "companions = 'al': must be a list of names in quotes or 'all'"),
    ("companions in numbers", "companions = [3]", "companions = [3]: must be a list of names in quotes or 'all'"),
    ("unknown companion", "companions = ['lt']", "companions: 'lt': no such observer; did you mean 'ltv'?"),
    ("typo in a sensor", "[sensors.encodr]", "sensors.encodr: no such field; did you mean 'encoder'?"),
    ("typo in a sensor's field", "[sensors.fog]\nrate = 1", "sensors.fog.rate: no such field; did you mean 'rate_hz'?"),
    (
        "a sensor that is a number",
        "[sensors]\nfog = 3",
        "sensors.fog = 3: must be a section, written under [sensors.fog]",
    ),
    ("sensors that are text", "sensors = 'all'", "sensors = 'all': must be a section, written under [sensors]"),
    ("a sensor's rate", "[sensors.fog]\nrate_hz = 0", f"sensors.fog.rate_hz = 0: {OVER_0}"),
    ("a rate that does not fit", "[sensors.fog]\nrate_hz = 300", f"sensors.fog.rate_hz = 300 Hz: {GRID}", "or 250 Hz"),
    ("a latency", "[sensors.encoder]\nlatency_s = 0.0015", f"sensors.encoder.latency_s = 0.0015 s: {GRID}", "0.002 s"),
    ("negative noise", "[sensors.accelerometer]\nnoise_density_ug_rthz = -1", f"density_ug_rthz = -1: {FROM_0}"),
    ("one bias", "[sensors.accelerometer]\nbias_mg = [1]", "bias_mg = [1]: must be a list of 2 numbers"),
    ("true for counts", "[sensors.encoder]\ncounts_per_revolution = true", f"counts_per_revolution = true: {FROM_0}"),
    ("settled in no band", "[metrics]\nsettle_band_deg = 0", f"metrics.settle_band_deg = 0: {OVER_0}"),
    ("fallen when flat", "[metrics]\nfall_angle_deg = 90", "= 90: must be a number greater than 0 and less than 90"),
    (
        "typo in metrics",
        "[metrics]\nsettle_band = 1",
        "metrics.settle_band: no such field; did you mean 'settle_band_deg'?",
    ),
)
def test_companions_sensors_metrics(given: str, fragments: list[str]) -> None:
    assert_in_order(["my.toml: ", *fragments], check(given).complaint)


@table(
    ("one bracket", "[push]\nstart_s = 1", "push: must be a list of sections, each written under [[push]]"),
    ("a number", "push = 3", "push: must be a list of sections, each written under [[push]]"),
    ("numbers", "push = [3]", "push.0 = 3: must be a section, written under [[push]]"),
    ("no start", "[[push]]\nduration_s = 1", "push.0.start_s: missing; must be a number greater than or equal to 0"),
    ("typo", "[[push]]\nstart_s = 1\ntorque = 3", "push.0.torque: no such field; did you mean 'torque_n_m'?"),
    ("typo in the name", "[[pushes]]\nstart_s = 1", "pushes: no such field; did you mean 'push'?"),
    ("the second one", "[[push]]\nstart_s = 1\n[[push]]\nstart_s = 'a'", f"push.1.start_s = 'a': {FROM_0}"),
    ("before the start", "[[push]]\nstart_s = -1", f"push.0.start_s = -1: {FROM_0}"),
    ("after the end", "[[push]]\nstart_s = 15", "push.0.start_s = 15: must be less than duration_s = 15"),
    ("no duration", "[[push]]\nstart_s = 1\nduration_s = 0", f"push.0.duration_s = 0: {OVER_0}"),
    ("start off the grid", "[[push]]\nstart_s = 1.0004", f"push.0.start_s = 1.0004 s: {GRID}", "1.001 s"),
    ("duration off the grid", "[[push]]\nstart_s = 1\nduration_s = 0.0004", f"push.0.duration_s = 0.0004 s: {GRID}"),
    ("infinite", "[[push]]\nstart_s = 1\ntorque_n_m = inf", "push.0.torque_n_m = inf: must be a finite number"),
)
def test_pushes(given: str, fragments: list[str]) -> None:
    assert_in_order(["my.toml: ", *fragments], check(given).complaint)


@table(
    ("an open string", 'title = "a\nseed = 1', "not valid TOML: Illegal character '\\n' (at line 1, column 11)"),
    ("an open bracket", "title = 'a'\n[plant\nmodel = 'x'", "not valid TOML: Expected ']'", "at line 2, column 7"),
    ("a field twice", "seed = 1\nseed = 2", "not valid TOML: Cannot overwrite a value"),
    ("a bare word", "title = a", "not valid TOML: ", "(at line 1, column 9)"),
    ("another encoding", "title = 'Stoß'".encode("latin-1"), "not valid TOML: not UTF-8 text (at byte 12)"),
)
def test_what_is_no_toml(given: str | bytes, fragments: list[str]) -> None:
    assert_in_order(["my.toml: ", *fragments], check(given).complaint)


@table(
    ("typo of a bundled one", "push_recvery", "scenario 'push_recvery': no such file", "did you mean 'push_recovery'?"),
    (
        "typo with an ending",
        "push_recovry.toml",
        "no such file",
        "did you mean 'push_recovery'?",
        "bundled: bias_estimation, luenberger_",
    ),
    ("nothing like it", "nosuch/file.toml", "scenario 'nosuch/file.toml': no such file, nor a bundled one; bundled: "),
    ("no name", "", "scenario '': no such file"),
    ("a folder", "/", "scenario '/': is a folder, not a file"),
    ("too long a name", "x" * 300, "cannot be read: File name too long"),
    ("what cannot be read", "/proc/self/mem", "/proc/self/mem: cannot be read: "),
)
@pytest.mark.parametrize("command", ["check", "run", "compare"])
def test_a_scenario_that_cannot_be_had(command: str, given: str, fragments: list[str]) -> None:
    assert_in_order(fragments, cmg_mj(command, given).complaint)
    assert list(Path().iterdir()) == []


def test_a_file_without_the_right_to_read_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """For root every file is readable, so the refusal is played."""
    Path("my.toml").write_text("")

    def refuse(*_: object, **__: object) -> str:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_text", refuse)
    assert cmg_mj("check", "my.toml").complaint == "my.toml: cannot be read: Permission denied"


@pytest.mark.parametrize("text", [b"", b"# nothing\n", b"\xef\xbb\xbftitle = 'with a byte order mark'\r\n"])
def test_what_is_left_out_has_defaults(text: bytes) -> None:
    assert check(text).status == 0


# --- the command line ----------------------------------------------------------------------------------------


@table(
    ("no equals sign", ["--set", "seed"], "--set 'seed': write section.field=value, for example plant."),
    ("no name", ["--set", "=3"], "--set '=3': write section.field=value"),
    ("two dots", ["--set", "plant..x=1"], "--set 'plant..x=1': write section.field=value"),
    ("unknown section", ["--set", "plnt.x=1"], "with --set plnt.x=1: plnt: no such field; did you mean 'plant'?"),
    ("unknown field", ["--set", "plant.modl=1"], "with --set plant.modl=1: plant.modl: no such field; did you mean"),
    ("text for a number", ["--set", "observer.k1=abc"], f"with --set observer.k1=abc: observer.k1 = 'abc': {OVER_0}"),
    ("no value", ["--set", "observer.k1="], f"observer.k1 = '': {OVER_0}"),
    ("two settings in one", ["--set", "seed=1\nduration_s=3"], f"seed = '1\\nduration_s=3': {WHOLE}"),
    ("wrong list", ["--set", "controller.gains=[1,2]"], "controller.gains = [1, 2]: must be a list of 4 numbers"),
    ("no such push", ["--set", "push.3.torque_n_m=1"], "there is no push.3; it has 1 of them, counted from 0"),
    ("which push", ["--set", "push.torque_n_m=1"], "push is not a section; write for example push.0.torque_n_m=2.0"),
    ("a push's number in letters", ["--set", "push.².torque_n_m=1"], "there is no push.²"),
    ("below a field", ["--set", "plant.model.x=3"], "plant.model is not a section"),
    ("a section's value", ["--set", "plant=3"], "plant = 3: must be a section, written under [plant]"),
    ("a negative seed", ["--seed", "-1"], "Invalid value for '--seed': -1 is not in the range x>=0."),
    ("a seed in letters", ["--seed", "x"], "Invalid value for '--seed': 'x'"),
    ("unknown option", ["--sed", "3"], "No such option", "--sed", "--seed"),
    ("too many words", ["and_more"], "unexpected extra argument (and_more)"),
    ("no folder's name", ["--out", ""], "--out '': name a folder"),
)
@pytest.mark.parametrize("command", ["run", "compare"])
def test_options(command: str, given: list[str], fragments: list[str]) -> None:
    assert_in_order(fragments, cmg_mj(command, "push_recovery", *given).complaint)
    assert list(Path().iterdir()) == []


@table(
    ("run", ["run", "push_recovery", "--observer", "ltvv"], "--observer 'ltvv': no such observer; did you mean 'ltv'?"),
    (
        "another's parameter",
        ["run", "push_recovery", "--observer", "ltv", "--set", "observer.k1=3"],
        "push_recovery with --observer ltv --set observer.k1=3: observer.k1: ltv has no such parameter",
    ),
    (
        "driver",
        ["run", "push_recovery", "--driver", "native!"],
        "'--driver': 'native!' is not one of 'native', 'callback'",
    ),
    ("compare", ["compare", "push_recovery", "--observers", "ltv,linera"], "--observers 'linera': ", "mean 'linear'?"),
    ("no observers", ["compare", "push_recovery", "--observers", " , "], "--observers ' , ': give names with commas"),
    ("no worlds", ["compare", "push_recovery", "--worlds", "0"], "Invalid value for '--worlds': 0"),
    (
        "for one that is not compared",
        ["compare", "push_recovery", "--observers", "ltv", "--set", "observer.k1=3"],
        "--set observer.k1=3: is a setting of homogeneous, which is not among --observers ltv",
    ),
    ("bench", ["bench", "--observers", "ltvv"], "--observers 'ltvv': no such observer; did you mean 'ltv'?"),
    ("no scenario", ["run"], "Missing argument 'SCENARIO'"),
    ("command", ["rnu", "push_recovery"], "No such command 'rnu'"),
    ("list", ["list", "observer"], "'observer' is not one of 'scenarios', 'observers'"),
)
def test_commands(given: list[str], fragments: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cmg_mj.scenario.simulate", pytest.fail)  # all this is found before anything is run
    assert_in_order(fragments, cmg_mj(*given).complaint)
    assert list(Path().iterdir()) == []


@table(
    ("a file", "taken", "--out taken: cannot be written: File exists"),
    ("below a file", "taken/run", "--out taken/run: cannot be written: Not a directory"),
    ("no place for files", "/proc/cmg-mj", "--out /proc/cmg-mj: cannot be written: "),
    ("a device", "/dev/null", "--out /dev/null: cannot be written: "),
)
@pytest.mark.parametrize("command", ["run", "compare"])
def test_an_output_folder_that_cannot_be_written(
    command: str, given: str, fragments: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cmg_mj.scenario.simulate", pytest.fail)
    Path("taken").write_text("mine")
    assert_in_order(fragments, cmg_mj(command, "push_recovery", "--out", given).complaint)
    assert Path("taken").read_text() == "mine"


# --- the model file ------------------------------------------------------------------------------------------


def edited(rig: tuple[str, str] | None = None, cube: tuple[str, str] | None = None) -> Said:
    """`check` on a copy of the bundled model, in which a pattern has been replaced."""
    for name, edit in (("scissored_pair.xml", rig), ("cube.xml", cube)):
        text = (folder("models") / name).read_text()
        if edit:
            text, count = re.subn(edit[0], edit[1], text, flags=re.DOTALL)
            assert count, f"{edit[0]} does not occur in {name}"
        Path(name.replace("scissored_pair", "rig")).write_text(text)
    return check("duration_s = 0.1\n[plant]\nmodel = 'rig.xml'")


def without(start: str) -> tuple[str, str]:
    return rf"<{start}.*?/>", ""


BODY = '<body name="more" pos="1 0 0">{}<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>'


@table(
    (
        "joint tilt",
        {"rig": without('joint name="tilt"')},
        "the model has no joint 'tilt'; its joints: cube1/flywheel, ",
    ),
    ("typo in tilt", {"rig": ('"tilt"', '"tlit"')}, "the model has no joint 'tilt'; did you mean 'tlit'?"),
    (
        "joint flywheel",
        {"cube": without('joint name="flywheel"')},
        "has no joint 'cube1/flywheel'; its joints: cube1/g",
    ),
    ("joint gimbal", {"cube": without('joint name="gimbal"')}, "the model has no joint 'cube1/gimbal'"),
    (
        "actuator servo",
        {"cube": without("intvelocity")},
        "has no actuator 'cube1/gimbal_servo'; its actuators: cube1/f",
    ),
    ("actuator motor", {"cube": without("velocity name")}, "the model has no actuator 'cube1/flywheel_motor'"),
    ("sensor encoder", {"cube": without("jointpos")}, "the model has no sensor 'cube1/gimbal_encoder'"),
    ("accelerometer", {"rig": without('accelerometer name="accelerometer_inner"')}, "no sensor 'accelerometer_inner'"),
    ("gyro", {"rig": without("gyro")}, "the model has no sensor 'fog'; its sensors: accelerometer_inner"),
    (
        "keyframe",
        {"rig": ("<keyframe>.*</keyframe>", "")},
        "the model has no keyframe 'equilibrium'; its keyframes: none",
    ),
    ("typo in keyframe", {"rig": ('"equilibrium"', '"equilibrum"')}, "'equilibrium'; did you mean 'equilibrum'?"),
    ("cubes", {"rig": ('<frame name="cube..mount.*?</frame>', "")}, "the model has no joint 'cube1/gimbal'"),
    ("the cube's file", {"rig": ('file="cube.xml"', 'file="cub.xml"')}, "not a model MuJoCo can read: ", "cub.xml"),
)
def test_a_model_that_lacks(given: dict[str, Any], fragments: list[str]) -> None:
    assert_in_order(["my.toml: rig.xml: ", *fragments], edited(**given).complaint)


@table(
    ("an end", {"rig": ("<keyframe>.*", "")}, "not a model MuJoCo can read: XML syntax error at line "),
    ("nothing", {"rig": (".*", "")}, "not a model MuJoCo can read: ", "empty file"),
    ("no XML", {"rig": (".*", "a = 1")}, "not a model MuJoCo can read: XML syntax error at line 1"),
    ("an unknown element", {"rig": ("<headlight", "<headlite")}, "unrecognized element", "'headlite', line 20"),
    ("a free joint", {"rig": ("</worldbody>", BODY.format('<freejoint name="j"/>'))}, "joint 'j' must be a hinge"),
    ("a slide", {"rig": ('name="yaw" type="hinge"', 'name="yaw" type="slide"')}, "joint 'yaw' must be a hinge"),
    ("no name", {"rig": ("</worldbody>", BODY.format("<joint/>"))}, "the joint of body 'more' has no name"),
    ("a tilt about x", {"rig": ('name="tilt" type="hinge" axis="0 1 0"', 'name="tilt"')}, "'tilt' must turn about y"),
    (
        "a servo on the flywheel",
        {"cube": ('name="gimbal_servo" joint="gimbal"', 'name="gimbal_servo" joint="flywheel"')},
        "actuator 'cube1/gimbal_servo' must drive the joint 'cube1/gimbal'",
    ),
    (
        "an encoder on the flywheel",
        {"cube": ('name="gimbal_encoder" joint="gimbal"', 'name="gimbal_encoder" joint="flywheel"')},
        "sensor 'cube1/gimbal_encoder' must be the jointpos of 'cube1/gimbal'",
    ),
    ("another gyro", {"rig": ("<gyro(.*?)/>", r"<velocimeter\1/>")}, "sensor 'fog' must be of the kind 'gyro'"),
    (
        "an accelerometer that lies on its side",
        {"rig": ('(name="accelerometer_outer" pos="[^"]*") euler="[^"]*"', r"\1")},
        "the site of sensor 'accelerometer_outer' must have its y axis along the tilt axis",
    ),
    (
        "accelerometers the wrong way round",
        {"rig": ('name="accelerometer_inner" pos="[^"]*"', 'name="accelerometer_inner" pos="0.3 0 0.3"')},
        "accelerometer_outer must lie farther from the tilt axis than accelerometer_inner",
    ),
    (
        "a keyframe without speed",
        {"rig": ("ctrl=.0 314 0 -314.", "")},
        "'equilibrium' must give 'cube1/flywheel_motor' a",
    ),
    ("a speed that is none", {"rig": ("ctrl=.0 314 0", 'ctrl="0 nan 0')}, "must give 'cube1/flywheel_motor' a speed"),
    (
        "a keyframe upside down",
        {"rig": ("qpos=.0 -0.78539816339744828", 'qpos="0 2.356')},
        "the rig must stand upright",
    ),
    ("no mass", {"cube": ('mass="0.61"', 'mass="0"')}, "does not compile: mass and inertia", "'cube1/flywheel'"),
)
def test_a_model_that_has(given: dict[str, Any], fragments: list[str]) -> None:
    assert_in_order(["my.toml: rig.xml: ", *fragments], edited(**given).complaint)


def test_the_unedited_copy_is_a_model() -> None:
    assert edited().status == 0


def test_a_lock_without_a_bearing() -> None:
    edited(rig=('<joint name="yaw".*?/>', ""))
    complaint = cmg_mj("run", "my.toml", "--set", "plant.lock_thrust_bearing=true").complaint
    assert "plant.lock_thrust_bearing = true: rig.xml has no joint 'yaw' to lock" in complaint


def test_a_lock_where_the_keyframe_gives_no_rates() -> None:
    edited(rig=('qvel="[^"]*"', ""))
    assert load_plant(model="rig.xml", lock_thrust_bearing=True).yaw is None


# --- a user's observer ---------------------------------------------------------------------------------------


class Mine:
    """A user's observer that works: what the others get wrong, they get wrong from it."""

    def __init__(self, dt: float, model: object) -> None:
        self.dt = dt

    def init(self, y: Measurement) -> Any:
        return (y.y1, 0)

    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        y1, k = state
        return (y.y1, k + 1), self.estimate(k + 1, y, 0.3 * (y.y1 - y1) / self.dt)

    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return Estimate(y.y1, rate, y.y2)


class FailsWhenMade(Mine):
    def __init__(self, dt: float, model: object) -> None:
        raise RuntimeError("no licence\nfor this")


class TakesNoPeriod(Mine):
    def __init__(self) -> None:
        pass


class FailsAtFirst(Mine):
    def init(self, y: Measurement) -> Any:
        raise KeyError("gain")


class ForgetsArguments(Mine):
    def step(self, y: Measurement) -> Any:  # type: ignore[override]
        return None


class ReturnsNothing(Mine):
    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        return None


class ReturnsNoEstimate(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return None


class ReturnsTwo(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return y.y1, rate


class ReturnsText(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return y.y1, rate, "0.0"


class ReturnsLists(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return [y.y1], [rate], [y.y2]


class ForOneWorld(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return y.y1, math.copysign(1.0, rate), y.y2


class ForgetsWorlds(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return y.y1, 0.0, y.y2


class FailsLater(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return 1 / 0 if k == 30 else Estimate(y.y1, rate, y.y2)


class GivesNan(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return Estimate(y.y1, rate * (math.nan if k >= 30 else 1.0), y.y2)


class GivesInfinity(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return Estimate(y.y1, rate * 0.0 + (math.inf if k >= 30 else 0.0), y.y2)


class NamesNoSignals(Mine):
    extra_signals = "bias_rad"


class OwesASignal(Mine):
    extra_signals = ("bias_rad",)


RETURN = "step(state, y, u) must return"


@table(
    ("made", FailsWhenMade, "observer tests.test_bad_input:FailsWhenMade: RuntimeError: no licence for this"),
    ("made without dt", TakesNoPeriod, "TakesNoPeriod: TypeError: ", "unexpected keyword argument 'dt'"),
    ("init", FailsAtFirst, "'tests.test_bad_input:FailsAtFirst': init(y) raised KeyError: 'gain'"),
    ("signature", ForgetsArguments, "step(state, y, u) raised TypeError: ", "positional arguments"),
    ("None", ReturnsNothing, f"{RETURN} (state, (x1, x2, x3)), not None"),
    ("no estimate", ReturnsNoEstimate, f"{RETURN} (state, (x1, x2, x3)), not (state, None)"),
    ("two numbers", ReturnsTwo, f"{RETURN} (state, (x1, x2, x3)), not (state, [0.011, "),
    ("text", ReturnsText, f"{RETURN} a number for x3, not '0.0'"),
    ("lists", ReturnsLists, f"{RETURN} a number for x1, not [0.011]"),
    ("signals", NamesNoSignals, "extra_signals must be a tuple of names like ('bias_rad',), each once, not 'bias_rad'"),
    ("a signal too few", OwesASignal, f"{RETURN} (state, (x1, x2, x3, bias_rad)), not (state, "),
)
@pytest.mark.parametrize("place", ["in the loop", "riding along", "compared"])
def test_an_observer_that_cannot_work(given: type, fragments: list[str], place: str) -> None:
    """It is found before the run, so that not even a folder is made."""
    kind = f"{__name__}:{given.__name__}"
    if place == "compared":
        said = cmg_mj("compare", "push_recovery", "--observers", f"linear,{kind}", "--worlds", 1)
    elif place == "in the loop":
        said = cmg_mj("run", "push_recovery", "--observer", kind)
    else:
        said = cmg_mj("run", "push_recovery", "--set", f"companions=['{kind}']")
        assert (
            "FailsWhenMade" in kind
            or "TakesNo" in kind
            or "NamesNo" in kind
            or "companions: 'tests.test_bad_input:" in said.complaint
        )
    assert_in_order(["push_recovery", *fragments], said.complaint)
    assert list(Path().iterdir()) == []


@table(
    ("a function for floats", ForOneWorld, "step(state, y, u) raised TypeError: only", "use operators and cmg_mj.elem"),
    ("a number for all", ForgetsWorlds, f"{RETURN} an array of 2 numbers for x2, not 0.0; many worlds come at once"),
)
def test_an_observer_for_one_world_among_many(quick: str, given: type, fragments: list[str]) -> None:
    kind = f"{__name__}:{given.__name__}"
    assert cmg_mj("run", quick, "--observer", kind).status == 0
    said = cmg_mj("compare", quick, "--observers", kind, "--out", "compared")
    assert_in_order([f"observer.kind = '{kind}': ", *fragments], said.complaint)
    assert not Path("compared").exists()


@table(
    ("raises", FailsLater, "observer FailsLater raised ZeroDivisionError: division by zero at t = 0.15 s; "),
    ("NaN", GivesNan, "observer GivesNan returned ", "nan", " at t = 0.15 s; "),
    ("infinity", GivesInfinity, "observer GivesInfinity returned ", "inf", " at t = 0.15 s; "),
)
@pytest.mark.parametrize("driver", ["native", "callback"])
def test_an_observer_that_fails_in_a_run(given: type, fragments: list[str], driver: str) -> None:
    """What was recorded until then is kept."""
    kind = f"{__name__}:{given.__name__}"
    said = cmg_mj("run", "push_recovery", "--observer", kind, "--driver", driver, "--out", "it")
    assert said.status == 2
    assert "stopped at 0.15 s" in said.out
    written, complaint = said.err.splitlines()
    assert written.startswith("Written to it. ")
    assert_in_order(["cmg-mj: ", *fragments, "what was recorded until then is in it"], complaint)
    assert len(Trajectory.load(Path("it/trajectory.parquet"))) == 30
    assert sorted(path.name for path in Path("it").iterdir()) == [
        "recording.rrd",
        "scenario.toml",
        "summary.json",
        "trajectory.parquet",
    ]


def test_an_observer_that_fails_among_others(quick: str) -> None:
    """The others are run, all is written, and the exit status tells."""
    kind = f"{__name__}:GivesNan"
    said = cmg_mj("compare", quick, "--observers", f"{kind},linear", "--worlds", 2)
    assert said.status == 2
    assert re.search(r"linear .* 0%\s+0%", said.out)
    assert re.search(r"GivesNan .* 0%\s+100%", said.out)
    complaint = said.err.splitlines()[1]
    assert complaint.startswith(f"cmg-mj: {kind}: 2 of 2 worlds stopped: ")
    assert Path("runs/quick-compare-0/trajectory-linear.parquet").exists()


def test_a_companion_that_gives_nan_harms_nobody(quick: str) -> None:
    kind = f"{__name__}:GivesNan"
    said = cmg_mj("run", quick, "--set", f"companions=['{kind}']")
    assert said.status == 0
    assert re.search(rf"{kind} \[rad/s\]\s+-", said.out)


# --- a plant that diverges, a folder that disappears ---------------------------------------------------------


@table(
    ("a huge push", "[[push]]\nstart_s = 0.1\ntorque_n_m = 1e9", "the plant diverged at t = 0.105 s", "smaller"),
    ("a stiff damper", "[plant]\ntilt_damping_n_m_s = 1e6", "the plant diverged at t = 0.005 s", "smaller"),
    ("a huge mass", "[plant]\nflywheel_imbalance_kg_m = 1e9", "the plant diverged at t = 0.005 s", "smaller"),
)
@pytest.mark.parametrize("command", ["run", "compare"])
def test_a_plant_that_diverges(command: str, given: str, fragments: list[str]) -> None:
    Path("my.toml").write_text(f"duration_s = 0.5\n{given}")
    options = ["--observers", "linear", "--worlds", "2"] if command == "compare" else ["--json"]
    said = cmg_mj(command, "my.toml", "--out", "it", *options)
    assert said.status == 2
    assert_in_order(["cmg-mj: ", *fragments], said.err.splitlines()[-1])
    assert (Path("it") / "recording.rrd").exists()


@pytest.mark.parametrize("name", ["scenario.toml", "summary.json", "trajectory.parquet", "recording.rrd", "plot.png"])
def test_a_file_that_cannot_be_written_keeps_no_other_from_being(quick: str, name: str) -> None:
    (Path("it") / name / "in the way").mkdir(parents=True)
    plot = ["--plot"] if name == "plot.png" else []
    said = cmg_mj("run", quick, "--out", "it", "--json", *plot)
    assert said.status == 2
    assert said.err == f"cmg-mj: it/{name}: cannot be written: Is a directory\n"
    assert said.out.startswith("{")  # the summary is not lost
    files = {path.name for path in Path("it").iterdir() if path.is_file()}
    assert files == {"scenario.toml", "summary.json", "trajectory.parquet", "recording.rrd"} - {name}


class Removes(Mine):
    """Removes the folder that the run is to be written to."""

    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        if k == 10:
            shutil.rmtree("it", ignore_errors=True)
        return Estimate(y.y1, rate, y.y2)


def test_a_folder_that_disappears(quick: str) -> None:
    said = cmg_mj("run", quick, "--out", "it", "--observer", f"{__name__}:Removes")
    assert said.status == 2
    (line,) = said.err.splitlines()
    assert line.startswith("cmg-mj: it/trajectory.parquet: cannot be written: ")


# --- the words -----------------------------------------------------------------------------------------------


def test_the_nearest_name() -> None:
    assert nearest("Tua", ["tau", "k1"]) == "did you mean 'tau'? allowed: k1, tau"
    assert nearest("xyz", ["tau", "k1"], "there are") == "there are: k1, tau"
    assert nearest("xyz", []) == "allowed: none"


@pytest.mark.parametrize(
    ("annotation", "words"),
    [
        (float, "a number"),
        (int | None, "a whole number"),
        (bool, "true or false"),
        (tuple[float, float], "a list of 2 numbers"),
        (tuple[tuple[int, int], tuple[int, int], tuple[int, int]], "a list of 3 lists of 2 whole numbers"),
        (list[str] | Literal["all"], "a list of names in quotes or 'all'"),
        (Literal["a", "b"], "one of 'a', 'b'"),
    ],
)
def test_what_a_type_takes(annotation: Any, words: str) -> None:
    assert expected(annotation) == words


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (True, "true"),
        ("a", "'a'"),
        ([1, [2.5, False]], "[1, [2.5, false]]"),
        ({"a": 1}, "{...}"),
        (math.nan, "nan"),
        ("x" * 200, "'" + "x" * 79 + "..."),
    ],
)
def test_a_value_as_the_user_wrote_it(value: object, text: str) -> None:
    assert shown(value) == text


@pytest.mark.parametrize("value", [np.float64(3.0), np.float32(3.0), np.int64(3), 3])
def test_a_scenario_in_python_takes_numpys_numbers(value: Any) -> None:
    assert parse_scenario({"duration_s": value}).duration_s == 3.0
    with pytest.raises(InputError, match=r"^duration_s = -3(\.0)?: must be a number greater than 0$"):
        parse_scenario({"duration_s": -value})


def test_a_scenario_in_python_is_checked_alike() -> None:
    with pytest.raises(InputError, match=r"^controller\.rate_hz = 300 Hz: not a whole number"):
        prepare(parse_scenario({"controller": {"rate_hz": 300.0}}))
    with pytest.raises(InputError, match=r"^here: seed = '1': must be a whole number"):
        parse_scenario({"seed": "1"}, "here")
