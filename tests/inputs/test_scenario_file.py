"""Wrong scenario files: one clear line that names file, field and what is allowed, and exit status 2."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.command import cmg_mj
from tests.inputs.complaints import FROM_0, GRID, OVER_0, RATE, WHOLE, assert_in_order, check, table


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
    (
        "off the physics grid",
        "duration_s = 1.0004\n[plant]\ntimestep_s = 0.001",
        f"duration_s = 1.0004 s: {GRID}",
        "nearest: 1 s or 1.001 s",
    ),
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
def test_top_level(wrong_input: str, fragments: list[str]) -> None:
    assert_in_order(["my.toml: ", *fragments], check(wrong_input).complaint)


@table(
    ("typo", "modl = 'x'", "plant.modl: no such field; did you mean 'model'? allowed: accelerometer_inner_m, "),
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
    ("a servo without stiffness", "servo_stiffness_n_m_rad = 0", "plant.servo_stiffness_n_m_rad = 0: must be a number"),
    (
        "wheels that stand",
        "flywheel_speed_rad_s = 0",
        "plant.flywheel_speed_rad_s = 0: must be a number greater than 0",
    ),
    ("true for an optional number", "tilt_damping_n_m_s = true", f"plant.tilt_damping_n_m_s = true: {FROM_0}"),
    ("nan without bounds", "flywheel_imbalance_kg_m = nan", "flywheel_imbalance_kg_m = nan: must be a finite number"),
)
def test_plant(wrong_input: str, fragments: list[str]) -> None:
    assert_in_order(["my.toml: ", *fragments], check(f"[plant]\n{wrong_input}").complaint)


@table(
    (
        "typo",
        "rate = 200",
        "controller.rate: no such field; did you mean 'rate_hz'? allowed: angle_source, bias_trim_s, "
        "compensate_turning",
    ),
    ("no rate", "rate_hz = 0", f"controller.rate_hz = 0: {RATE}"),
    ("a negative rate", "rate_hz = -200", f"controller.rate_hz = -200: {RATE}"),
    ("nan", "rate_hz = nan", "controller.rate_hz = nan: must be a finite number greater than or equal to 0.1"),
    ("infinite", "rate_hz = inf", "controller.rate_hz = inf: must be a finite number greater than or equal to 0.1"),
    ("in quotes", "rate_hz = '200'", f"controller.rate_hz = '200': {RATE}"),
    ("true", "rate_hz = true", f"controller.rate_hz = true: {RATE}"),
    (
        "no divisor",
        "rate_hz = 300\n[plant]\ntimestep_s = 0.001",
        f"controller.rate_hz = 300 Hz: {GRID}",
        "nearest: 333.333 Hz or 250 Hz",
    ),
    (
        "above the physics rate",
        "rate_hz = 2000\n[plant]\ntimestep_s = 0.001",
        f"controller.rate_hz = 2000 Hz: {GRID}",
        "(nearest: 1000 Hz)",
    ),
    (
        "no common step",
        "rate_hz = 200.01",
        "sensors.accelerometer.rate_hz = 200 Hz: does not fit the other rates",
        "plant.timestep_s",
    ),
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
        "angle_source = 'measure'",
        "'measure': must be one of 'measured', 'estimated'; did you mean 'measured'?",
    ),
)
def test_controller(wrong_input: str, fragments: list[str]) -> None:
    assert_in_order(["my.toml: ", *fragments], check(f"[controller]\n{wrong_input}").complaint)


@pytest.mark.parametrize(
    ("wrong_input", "complaint"),
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
def test_conditions_of_the_theorems(wrong_input: str, complaint: str) -> None:
    kind = wrong_input.split("'")[1]
    message = check(f"[observer]\n{wrong_input}").complaint
    assert message.startswith(f"my.toml: observer.{complaint}"), message
    assert message.endswith(f"(observer {kind})"), message


def test_trimming_without_a_bias_estimate() -> None:
    message = check("[controller]\nbias_trim_s = 1.0").complaint
    assert message.startswith(
        "my.toml: controller.bias_trim_s = 1: needs an observer in the loop that estimates the bias"
    )


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
def test_observer(wrong_input: str, fragments: list[str]) -> None:
    assert_in_order(["my.toml: ", *fragments], check(f"[observer]\n{wrong_input}").complaint)


@table(
    ("observer that is text", "observer = 'ltv'", "observer = 'ltv': must be a section, written under [observer]"),
    (
        "open-loop observers in words",
        "open_loop_observers = 'al'",
        "open_loop_observers = 'al': must be a list of names in quotes or 'all'",
    ),
    (
        "open-loop observers in numbers",
        "open_loop_observers = [3]",
        "open_loop_observers = [3]: must be a list of names in quotes or 'all'",
    ),
    ("no world", "[compare]\nworlds = 0", "compare.worlds = 0: must be a whole number greater than or equal to 1"),
    ("nothing to compare", "[compare]\nobservers = []", "compare.observers = []: must"),
    ("unknown to compare", "[compare]\nobservers = ['lt']", "compare.observers: 'lt': no such observer; did you mean"),
    (
        "unknown open-loop observer",
        "open_loop_observers = ['lt']",
        "open_loop_observers: 'lt': no such observer; did you mean 'ltv'?",
    ),
    ("typo in a sensor", "[sensors.encodr]", "sensors.encodr: no such field; did you mean 'encoder'?"),
    ("typo in a sensor's field", "[sensors.fog]\nrate = 1", "sensors.fog.rate: no such field; did you mean 'rate_hz'?"),
    (
        "a sensor that is a number",
        "[sensors]\nfog = 3",
        "sensors.fog = 3: must be a section, written under [sensors.fog]",
    ),
    ("sensors that are text", "sensors = 'all'", "sensors = 'all': must be a section, written under [sensors]"),
    ("a sensor's rate", "[sensors.fog]\nrate_hz = 0", f"sensors.fog.rate_hz = 0: {RATE}"),
    (
        "a rate that does not fit",
        "[sensors.fog]\nrate_hz = 300\n[plant]\ntimestep_s = 0.001",
        f"sensors.fog.rate_hz = 300 Hz: {GRID}",
        "or 250 Hz",
    ),
    ("a rate that fits no other", "[sensors.fog]\nrate_hz = 301.7", "sensors.fog.rate_hz = 301.7 Hz: does not fit the"),
    ("negative noise", "[sensors.accelerometer]\nnoise_density_ug_rthz = -1", f"density_ug_rthz = -1: {FROM_0}"),
    ("one bias", "[sensors.accelerometer]\nbias_mg = [1]", "bias_mg = [1]: must be a list of 2 numbers"),
    (
        "one scale",
        "[sensors.accelerometer]\nscale_error = 0.01",
        "scale_error = 0.01: must be a list of 2 numbers greater",
    ),
    ("a scale that turns round", "[sensors.accelerometer]\nscale_error = [-1, 0]", "than -1 and less than 1"),
    ("a part on its side", "[sensors.accelerometer]\nmisalignment_deg = [0, 90]", "than -45 and less than 45"),
    (
        "more than the other axis",
        "[sensors.accelerometer]\ncross_axis = [0, 1]",
        "[0, 1]: must be a list of 2 numbers",
    ),
    ("a sample of tomorrow", "[sensors.accelerometer]\nskew_s = -0.001", f"skew_s = -0.001: {FROM_0}"),
    (
        "a sample of the period before last",
        "[sensors.accelerometer]\nskew_s = 0.006",
        "sensors.accelerometer.skew_s: 0.006 s: at most one sample period, 0.005 s at rate_hz = 200",
    ),
    (
        "a skew that does not fit",
        "[sensors.accelerometer]\nskew_s = 0.0025\n[plant]\ntimestep_s = 0.001",
        f"sensors.accelerometer.skew_s = 0.0025 s: {GRID}",
    ),
    (
        "a low-pass that passes nothing",
        "[sensors.accelerometer]\nbandwidth_hz = 1e-9",
        "bandwidth_hz: 1e-09 Hz: at least 1 Hz, or 0 for no low-pass",
    ),
    ("a low-pass that passes all", "[sensors.accelerometer]\nbandwidth_hz = 500", "equal to 0 and less than 500"),
    (
        "a low-pass at a rate that does not divide its own",
        "[sensors.accelerometer]\nrate_hz = 400\nbandwidth_hz = 94",
        "accelerometer.bandwidth_hz: a part with a low-pass samples at 1000 Hz, which rate_hz = 400 must divide",
    ),
    (
        "a low-pass between physics steps",
        "[sensors.accelerometer]\nbandwidth_hz = 94\n[plant]\ntimestep_s = 0.005",
        "accelerometer.bandwidth_hz = 94 Hz, sampled at 1000 Hz inside the part: not a whole number of physics steps",
    ),
    ("drift below nothing", "[sensors.accelerometer]\nbias_instability_ug = -1", f"instability_ug = -1: {FROM_0}"),
    ("true for counts", "[sensors.encoder]\ncounts_per_revolution = true", f"counts_per_revolution = true: {FROM_0}"),
    ("settled in no band", "[metrics]\nsettle_band_deg = 0", f"metrics.settle_band_deg = 0: {OVER_0}"),
    ("fallen when flat", "[metrics]\nfall_angle_deg = 90", "= 90: must be a number greater than 0 and less than 90"),
    (
        "typo in metrics",
        "[metrics]\nsettle_band = 1",
        "metrics.settle_band: no such field; did you mean 'settle_band_deg'?",
    ),
)
def test_open_loop_observers_sensors_metrics(wrong_input: str, fragments: list[str]) -> None:
    assert_in_order(["my.toml: ", *fragments], check(wrong_input).complaint)


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
    (
        "start off the grid",
        "[[push]]\nstart_s = 1.0004\n[plant]\ntimestep_s = 0.001",
        f"push.0.start_s = 1.0004 s: {GRID}",
        "1.001 s",
    ),
    (
        "duration off the grid",
        "[[push]]\nstart_s = 1\nduration_s = 0.0004\n[plant]\ntimestep_s = 0.001",
        f"push.0.duration_s = 0.0004 s: {GRID}",
    ),
    ("start on no grid", "[[push]]\nstart_s = 1.00001", "push.0.start_s = 1.00001 s: does not fit the other rates"),
    ("infinite", "[[push]]\nstart_s = 1\ntorque_n_m = inf", "push.0.torque_n_m = inf: must be a finite number"),
)
def test_pushes(wrong_input: str, fragments: list[str]) -> None:
    assert_in_order(["my.toml: ", *fragments], check(wrong_input).complaint)


@table(
    ("an open string", 'title = "a\nseed = 1', "not valid TOML: Illegal character '\\n' (at line 1, column 11)"),
    ("an open bracket", "title = 'a'\n[plant\nmodel = 'x'", "not valid TOML: Expected ']'", "at line 2, column 7"),
    ("a field twice", "seed = 1\nseed = 2", "not valid TOML: Cannot overwrite a value"),
    ("a bare word", "title = a", "not valid TOML: ", "(at line 1, column 9)"),
    ("another encoding", "title = 'Stoß'".encode("latin-1"), "not valid TOML: not UTF-8 text (at byte 12)"),
)
def test_what_is_no_toml(wrong_input: str | bytes, fragments: list[str]) -> None:
    assert_in_order(["my.toml: ", *fragments], check(wrong_input).complaint)


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
def test_a_scenario_that_cannot_be_had(command: str, wrong_input: str, fragments: list[str]) -> None:
    assert_in_order(fragments, cmg_mj(command, wrong_input).complaint)
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
