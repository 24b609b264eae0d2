"""Wrong scenario files: exit status 2 and one clear line that names the file and the field."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cmg_mj import InputError, parse_scenario
from tests.command import cmg_mj
from tests.inputs.complaints import check

STEP = "\n[plant]\ntimestep_s = 0.001"


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ('duration_s = "15"', "duration_s = '15'"),
        ("duration_s = true", "duration_s = true"),
        ("duration_s = nan", "duration_s = nan"),
        ("duration_s = -1.5", "duration_s = -1.5"),
        ("duration_s = 1e17", "duration_s = 1e+17"),
        (f"duration_s = 1.0004{STEP}", "duration_s = 1.0004 s"),
        ("title = 3", "title = 3"),
        ("seed = -1", "seed = -1"),
        ("plant = 3", "plant = 3"),
        ("[[plant]]\nmodel = 'x'", "plant = [{...}]"),
        ("versions = {mujoco = 4}", "versions.mujoco = 4"),
        ("plant.model = 3", "plant.model = 3"),
        ("plant.model = ''", "plant.model = ''"),
        ("plant.equilibrium_bias_deg = 45", "plant.equilibrium_bias_deg = 45"),
        ("plant.timestep_s = 0.2", "plant.timestep_s = 0.2"),
        ("plant.timestep_s = 0.003", "controller.rate_hz = 200 Hz"),
        ("plant.gimbal_friction_n_m = -1", "plant.gimbal_friction_n_m = -1"),
        ("controller.rate_hz = 0", "controller.rate_hz = 0"),
        (f"controller.rate_hz = 300{STEP}", "controller.rate_hz = 300 Hz"),
        ("controller.rate_hz = 200.01", "sensors.accelerometer.rate_hz = 200 Hz"),
        ("controller.gains = [1, 2, 3]", "controller.gains = [1, 2, 3]"),
        ("controller = {gains = [1, 2, 3, 4], lqr.state_cost = [1, 1, 1, 1]}", "controller"),
        ("controller.lqr = {}", "controller.lqr.state_cost"),
        ("controller.lqr.state_cost = [1, 1, 1, 0]", "controller.lqr"),
        ("controller.bias_trim_s = 1.0", "controller.bias_trim_s = 1"),
        ("observer = 'ltv'", "observer = 'ltv'"),
        ("observer.kind = 3", "observer.kind = 3"),
        ("observer.k1 = 'abc'", "observer.k1 = 'abc'"),
        ("observer.k1 = nan", "observer.k1 = nan"),
        ("observer.alpha = 0.5", "observer.alpha = 0.5"),
        ("observer = {kind = 'ltv', Q = [1, 2]}", "observer.Q = [1, 2]"),
        ("observer.dt = 0.01", "observer.dt"),
        ("observer.kind = 'no_such_package:Mine'", "observer.kind = 'no_such_package:Mine'"),
        ("observer.kind = 'math:sqrt'", "observer.kind = 'math:sqrt'"),
        ("open_loop_observers = [3]", "open_loop_observers = [3]"),
        (f"sensors.fog.rate_hz = 300{STEP}", "sensors.fog.rate_hz = 300 Hz"),
        ("sensors.accelerometer.noise_density_ug_rthz = -1", "sensors.accelerometer.noise_density_ug_rthz = -1"),
        ("sensors.accelerometer.bias_mg = [1]", "sensors.accelerometer.bias_mg = [1]"),
        ("sensors.accelerometer.scale_error = [-1, 0]", "sensors.accelerometer.scale_error = [-1, 0]"),
        ("sensors.accelerometer.skew_s = 0.006", "sensors.accelerometer.skew_s"),
        ("sensors.accelerometer.bandwidth_hz = 1e-9", "sensors.accelerometer.bandwidth_hz"),
        ("sensors.accelerometer = {rate_hz = 400, bandwidth_hz = 94}", "sensors.accelerometer.bandwidth_hz"),
        ("metrics.fall_angle_deg = 90", "metrics.fall_angle_deg = 90"),
        ("push = [3]", "push.0 = 3"),
        ("[[push]]\nduration_s = 1", "push.0.start_s"),
        ("[[push]]\nstart_s = 1\n[[push]]\nstart_s = 'a'", "push.1.start_s = 'a'"),
        ("[[push]]\nstart_s = 15", "push.0.start_s = 15"),
        (f"[[push]]\nstart_s = 1.0004{STEP}", "push.0.start_s = 1.0004 s"),
        ("[[push]]\nstart_s = 1\ntorque_n_m = inf", "push.0.torque_n_m = inf"),
        ("seed = 1\nseed = 2", "not valid TOML"),
        ("title = '\udcff'", "not UTF-8 text"),
        ("<mujoco/>", "is XML"),
    ],
)
def test_names_the_field_and_its_value(text: str, field: str) -> None:
    message = check(text.encode(errors="surrogateescape")).complaint
    assert message.startswith(f"my.toml: {field}"), message
    assert not message.removeprefix(f"my.toml: {field}")[:1].isalnum(), message


@pytest.mark.parametrize(
    ("text", "field", "guess"),
    [
        ("durations = 3", "durations", "duration_s"),
        ("[Plant]\nmodel = 'x'", "Plant", "plant"),
        ("plant.modl = 'x'", "plant.modl", "model"),
        ("plant.model = 'scissord_pair'", "plant.model = 'scissord_pair'", "scissored_pair"),
        ("plant.integrator = 'rk4'", "plant.integrator = 'rk4'", "RK4"),
        ("controller.rate = 200", "controller.rate", "rate_hz"),
        ("controller.lqr.state_cots = [1, 1, 1, 1]", "controller.lqr.state_cots", "state_cost"),
        ("controller.angle_source = 'measure'", "controller.angle_source = 'measure'", "measured"),
        ("observer.kind = 'LTV'", "observer.kind = 'LTV'", "ltv"),
        ("observer.alfa = 0.9", "observer.alfa", "alpha"),
        ("open_loop_observers = ['lt']", "open_loop_observers", "ltv"),
        ("[sensors.encodr]", "sensors.encodr", "encoder"),
        ("[[push]]\nstart_s = 1\ntorque = 3", "push.0.torque", "torque_n_m"),
        ("metrics.settle_band = 1", "metrics.settle_band", "settle_band_deg"),
    ],
)
def test_names_the_nearest_name(text: str, field: str, guess: str) -> None:
    message = check(text).complaint
    assert f" {field}: " in message, message
    assert f"did you mean '{guess}'?" in message


@pytest.mark.parametrize(
    ("name", "guess"), [("push_recvery", "push_recovery"), ("push_recovry.toml", "push_recovery"), (".", None)]
)
@pytest.mark.parametrize("command", ["check", "run", "compare"])
def test_a_scenario_that_cannot_be_had(command: str, name: str, guess: str | None) -> None:
    message = cmg_mj(command, name).complaint
    assert message.startswith(f"scenario {name!r}: "), message
    assert guess is None or f"did you mean '{guess}'?" in message


@pytest.mark.parametrize("text", [b"", b"# nothing\n", b"\xef\xbb\xbftitle = 'with a byte order mark'\r\n"])
def test_what_is_left_out_has_defaults(text: bytes) -> None:
    Path("my.toml").write_bytes(text)
    assert cmg_mj("check", "my.toml").status == 0


@pytest.mark.parametrize("value", [np.float64(3.0), np.float32(3.0), np.int64(3), 3])
def test_a_scenario_in_python_takes_numpys_numbers(value: float) -> None:
    assert parse_scenario({"duration_s": value}).duration_s == 3.0
    with pytest.raises(InputError, match=r"^duration_s = -3(\.0)?: "):
        parse_scenario({"duration_s": -value})
