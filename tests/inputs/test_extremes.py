"""Sizes no rig has, text that is none, brackets and keys without end: one clear line, by `check` and by `run`."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from cmg_mj import load_scenario
from cmg_mj.errors import InputError
from cmg_mj.scenario.loading import parse_scenario
from cmg_mj.simulation.experiment import prepare
from cmg_mj.simulation.simulate import simulate
from tests.command import cmg_mj
from tests.inputs.complaints import assert_in_order, check, table

MANY = "9" * 5000
QUOTED = '"a" . '


@pytest.mark.parametrize("size", ["1e17", "1e300", "1e306", "5e-324", "1e-300"])
@pytest.mark.parametrize(
    "field",
    [
        "duration_s",
        "controller.rate_hz",
        "controller.rate_limit_rad_s",
        "sensors.fog.rate_hz",
        "sensors.accelerometer.range_g",
        "plant.timestep_s",
        "plant.tilt_damping_n_m_s",
        "observer.k1",
        "push.0.start_s",
        "push.0.duration_s",
        "push.0.torque_n_m",
    ],
)
def test_extreme_numbers(field: str, size: str) -> None:
    outcome = cmg_mj("run", "push_recovery", "--set", f"{field}={size}")
    if outcome.status == 0 or outcome.out:  # such a rate limit limits nothing, such a push throws the rig over
        assert "Traceback" not in outcome.err
    else:
        assert f"{field}" in outcome.complaint or "plant" in outcome.complaint


@table(
    (
        "gains",
        "[controller]\ngains = [1e308, 4, -1, 0.3]",
        "controller.gains.0 = 1e+308: sizes are from 1e-30 to 1e+30",
    ),
    (
        "a title of digits",
        f"title = '{MANY}'",
        "title = '9999",
        "...: must be text in quotes of at most 200 characters",
    ),
    ("a title of many lines", 'title = "a\\nb"', r"title = 'a\nb': must be text", "without control characters"),
    ("a title without quotes", f"title = {MANY}", "not valid TOML: a number of too many digits"),
    ("a seed of digits", f"seed = {MANY}", "not valid TOML: a number of too many digits"),
    ("a seed in sixteens", f"seed = 0x{MANY}", "seed: a whole number of 20000 bits; at most 128 are allowed"),
    ("200 brackets", f"seed = {'[' * 200}{']' * 200}", "more than 12 sections and lists in one another"),
    ("50,000 brackets", f"seed = {'[' * 50000}", "not valid TOML: brackets in one another without end"),
    ("20 dotted keys", f"{'a.' * 20}a = 1", "a.a.a.a.a.a.a.a.a.a.a.a.a: more than 12 sections"),
    ("500 dotted keys", f"{'a.' * 500}a = 1", "not valid TOML: a key of more than 100 parts"),
    ("500 keys in quotes", QUOTED * 500 + "a = 1", "not valid TOML: a key of more than 100 parts"),
    ("500 dotted sections", f"[{'a.' * 500}a]", "not valid TOML: a key of more than 100 parts"),
    ("a thousand wrong fields", "\n".join(f"a{i} = 1" for i in range(1000)), "a19: no such field", "; and 980 more"),
    ("a file without end", "#" * 1_000_001, "larger than 1000 kB, which no scenario is"),
    ("a model", "<mujoco/>", "is XML, not a scenario; a scenario names its model with plant.model"),
    ("an hour too much", "duration_s = 10005", "duration_s = 10005: 2e+06 control ticks", "at most 2000000", "10000 s"),
    (
        "too many steps",
        "duration_s = 5000\nplant.timestep_s = 1e-6",
        "duration_s = 5000: 5e+09 physics steps of 1e-06 s; at most 1e+09 are taken, 1000 s",
    ),
)
def test_what_is_no_scenario(wrong_input: str, fragments: list[str]) -> None:
    """None takes long: a minute is what tomllib takes for a key of 50,000 parts."""
    start = time.process_time()
    assert_in_order(["my.toml: ", *fragments], check(wrong_input).complaint)
    assert_in_order(["my.toml: ", *fragments], cmg_mj("run", "my.toml").complaint)
    assert time.process_time() - start < 5.0


@table(
    ("brackets", [f"seed={'[' * 50000}"], "seed = '[[[["),
    ("dotted keys", [f"{'a.' * 500}a=1"], "more than 12 sections and lists in one another"),
    ("bytes in a value", ["title='a\udcff'"], r"title = 'a\udcff': not UTF-8 text"),
    ("bytes in a name", ["\udcff=1"], r"'\udcff': not UTF-8 text"),
    ("bytes in a file's name", ["plant.model=a\udcff"], r"plant.model = 'a\udcff': not UTF-8 text"),
)
def test_settings(wrong_input: list[str], fragments: list[str]) -> None:
    assert_in_order(fragments, cmg_mj("run", "push_recovery", "--set", *wrong_input).complaint)


@table(
    ("a scenario", ["check", "a\udcff.toml"], r"scenario 'a\udcff.toml': no such file"),
    (
        "an observer",
        ["run", "push_recovery", "--observer", "a\udcff:Mine"],
        r"observer.kind = 'a\udcff:Mine': not UTF-8",
    ),
    ("observers", ["compare", "push_recovery", "--observers", "a\udcff:Mine"], r"observer.kind = 'a\udcff:Mine': "),
    ("a paper", ["reproduce", "\udcff"], r"'\udcff': no such paper"),
    ("a list", ["list", "\udcff"], r"'\udcff' is not one of"),
)
def test_bytes_that_are_no_text(wrong_input: list[str], fragments: list[str]) -> None:
    assert_in_order(fragments, cmg_mj(*wrong_input).complaint)
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("scenario", [{"title": "\udcff"}, {"observer": {"\udcff": 1}}])
def test_bytes_in_python(scenario: dict) -> None:
    with pytest.raises(InputError, match="not UTF-8 text"):
        parse_scenario(scenario)


def test_a_model_in_a_folder_whose_name_is_no_text() -> None:
    """The scenario that a run writes names the model's place, and is UTF-8."""
    os.mkdir(b"\xff")
    os.chdir(b"\xff")
    Path("my.xml").write_text("<mujoco/>")
    assert_in_order([r"my.xml", "lies in a folder whose name is not UTF-8 text"], cmg_mj("check", "my.xml").complaint)


@pytest.mark.parametrize("name", ["a.toml", "a.xml"])
def test_files_that_are_none(name: str) -> None:
    for make in (os.mkfifo, Path.mkdir, lambda path: os.symlink(path, path)):
        make(Path(name))  # type: ignore[operator]
        assert cmg_mj("check", name).complaint
        Path(name).rmdir() if Path(name).is_dir() else Path(name).unlink()


def test_a_duration_in_python() -> None:
    experiment = prepare(load_scenario("push_recovery"))
    with pytest.raises(InputError, match=r"^duration_s = 1e\+306 s: not a whole number of physics steps"):
        simulate(experiment.plant, experiment.controller(), 1e306, observers=["homogeneous"])


@pytest.mark.parametrize("command", [("compare", "push_recovery"), ("tune", "push_recovery")])
def test_more_worlds_than_memory(command: tuple[str, str]) -> None:
    assert "is not in the range" in cmg_mj(*command, "--worlds", 10**12).complaint


def test_letters_where_python_takes_the_terminal_for_one_of_ascii() -> None:
    outcome = cmg_mj("run", "push_recovery", "--set", os.fsdecode("title='Stoß'".encode()), "--set", "duration_s=x")
    assert "Stoß" in outcome.complaint or "duration_s = 'x'" in outcome.complaint
