"""The command line: what it says where, to whom, and with which exit status."""

from __future__ import annotations

import json
import os
import pty
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import click
import pytest
import tomli_w

from cmg_mj.cli import cli
from cmg_mj.inputs.files import bundled
from cmg_mj.observers import OBSERVERS
from cmg_mj.results.baselines import BASELINES
from tests.command import COMMAND, cmg_mj, environment

SUMMARY = [
    "observer",
    "seed",
    "fell",
    "settle_time_s",
    "velocity_rms_error_rad_s",
    "velocity_rms_error_fog_rad_s",
    "tilt_rms_deg",
    "gimbal_peak_deg",
    "command_rms_rad_s",
    "command_saturated_fraction",
]
"""Names that users' scripts rely on."""

COMMANDS = cli.list_commands(click.Context(cli))


pytestmark = pytest.mark.usefixtures("elsewhere")


@pytest.fixture
def quick() -> str:
    """A short scenario with a push."""
    Path("quick.toml").write_text("title = 'Quick'\nduration_s = 0.4\n[[push]]\nstart_s = 0.2")
    return "quick.toml"


# --- what the plain installation has -------------------------------------------------------------------------

BARE = """
import json, re, sys
from importlib.machinery import PathFinder
from importlib.metadata import requires
extras = {re.match("[a-zA-Z0-9]+", line)[0] for line in requires("cmg_mj") if "extra ==" in line} - {"rerun"}
genuine = PathFinder.find_spec
PathFinder.find_spec = lambda name, *others: None if name in extras else genuine(name, *others)
from tests.command import cmg_mj
for line in sys.stdin:
    outcome = cmg_mj(*line.split())
    print(json.dumps([outcome.status, outcome.err]))
"""
"""Runs commands, a line each, in a process in which no package of an extra can be imported."""


EXTRAS = {
    "reproduce all": "papers",
    "sweep quick.toml --vary duration_s=0.3,0.4 --cluster local:1": "cluster",
    "compare quick.toml --observers linear --worlds 2": None,
    "tune quick.toml --observer linear --worlds 2": None,
    "check quick.toml": None,
    "export gyro_free": None,
    "studio --help": None,
}


def test_a_command_without_its_extra_names_it_in_one_line(quick: str) -> None:
    process = subprocess.run(
        [sys.executable, "-c", BARE], input="\n".join(EXTRAS), env=environment(), capture_output=True, text=True
    )
    for (command, extra), line in zip(EXTRAS.items(), process.stdout.splitlines(), strict=True):
        status, err = json.loads(line)
        if extra is None:
            assert status == 0, (command, err)
        else:
            assert status == 2, command
            assert re.fullmatch(rf'cmg-mj: .*: python -m pip install "cmg_mj\[{extra}\]"\n', err), err


# --- help ----------------------------------------------------------------------------------------------------


def test_help_names_every_command_in_a_whole_line() -> None:
    outcome = cmg_mj("--help")
    assert (outcome.status, outcome.err) == (0, "")
    command_list = outcome.out.partition("Commands:\n")[2]
    assert re.findall(r"^  ([\w-]+)  +[A-Z][^\n]*[a-z]\.$", command_list, re.MULTILINE) == COMMANDS
    assert "..." not in outcome.out.replace("[ARGS]...", "")
    assert "\n    cmg-mj run push_recovery\n" in outcome.out  # examples keep their lines
    assert "\b" not in outcome.out
    assert "\\b" not in outcome.out
    assert "Exit status: 0 done" in outcome.out


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_a_command(command: str) -> None:
    outcome = cmg_mj(command, "-h")
    assert (outcome.status, outcome.err) == (0, "")
    assert outcome.out.startswith(f"Usage: cmg-mj {command} ")
    assert "INTEGER" not in outcome.out  # but N
    assert max(map(len, outcome.out.splitlines())) <= 100


def test_version() -> None:
    assert cmg_mj("--version").out == f"cmg-mj, version {version('cmg_mj')}\n"


# --- list and check ------------------------------------------------------------------------------------------


def test_list() -> None:
    outcome = cmg_mj("list")
    assert (outcome.status, outcome.err) == (0, "")
    assert outcome.out == "\n".join(cmg_mj("list", kind).out for kind in ("scenarios", "observers", "laws"))
    for name in bundled("scenarios"):
        assert re.search(rf"^  {name}  +[A-Z]", outcome.out, re.MULTILINE)
    for name in OBSERVERS:
        assert re.search(rf"^  {name}  +\S", outcome.out, re.MULTILINE)
    assert re.search(
        r"  homogeneous +k1=20  k2=150  alpha=0\.85 .*\n(?: .*\n)* +The homogeneous finite-time diff", outcome.out
    )
    assert re.search(r"  luenberger +L=\[\[20, 0\], \[150, 0\], \[0, 20\]\]\n", outcome.out)
    assert re.search(r"  finite_difference +no parameters\n", outcome.out)
    assert max(map(len, outcome.out.splitlines())) <= 100


def test_check_says_what_a_scenario_amounts_to(quick: str) -> None:
    outcome = cmg_mj("check", quick)
    assert (outcome.status, outcome.err) == (0, "")
    for fragment in (
        "quick.toml: valid",
        "0.4 s, 80 physics steps of 0.005 s (RK4), seed 0",
        "scissored_pair.xml, modules: cube1, cube2",
        "equilibrium bias 0.5 deg, initial tilt 1 deg",
        "K_e = [35, 4, -1, 0.3] at 200 Hz, at most 4.7 rad/s",
        "gains alone, on the reduced model's true state: stable, slowest pole -0.203 1/s",
        "homogeneous  k1=20  k2=150  alpha=0.85",
        "open loop   none",
        "accelerometer 200 Hz, encoder 200 Hz, fog 200 Hz",
        "1 N m from 0.2 s to 0.3 s",
    ):
        assert fragment in outcome.out
    assert not Path("runs").exists()


# --- run -----------------------------------------------------------------------------------------------------


def test_json_is_alone_on_standard_output(quick: str) -> None:
    outcome = cmg_mj("run", quick, "--json", "--seed", 5, "--set", "push=[]")
    assert (outcome.status, outcome.err) == (0, "")
    summary = json.loads(outcome.out)
    assert [key for key in summary if key in SUMMARY] == SUMMARY
    assert (summary["observer"], summary["seed"], summary["fell"]) == ("homogeneous", 5, False)
    assert all(isinstance(summary[key], float) for key in SUMMARY[3:])


BESIDE = r"mems_as_bought|mems_gyro|[Cc]ommand|Fit in|against the gyro|[Tt]rue velocity"
"""What `run` and `compare` leave to --json."""


def test_a_person_reads_a_table_and_where_the_files_are(quick: str) -> None:
    outcome = cmg_mj("run", quick, "--set", "open_loop_observers=['ltv']")
    assert outcome.status == 0
    assert outcome.out.startswith("Quick: homogeneous, seed 0\n")
    assert "\x1b" not in outcome.out
    assert all(line == line.rstrip() for line in outcome.out.splitlines())
    for row in (
        r"Outcome +stood to the end, 0\.4 s",
        r"Tilt RMS \[deg\] +\d",
        r"ltv +0\.\d+ +0\.\d+ +-?\d",
        r"zero +0\.\d+ +0\.\d+ +0\.00 +0\.00\n",
        r"mems_fused +0\.0\d+ +0\.0\d+ +0\.\d",
        r"Error: RMS of the estimated tilt rate less the true one",
        r"Fit: 1 - error / RMS of the true rate\. Settle time: from the last push's end",
        r"Gimbal peak: largest angle from upright",
        r"Floors: lower bounds on the error",
        r"Floors are for the sensors' noise alone",
    ):
        assert re.search(row, outcome.out)
    assert not re.search(BESIDE, outcome.out)
    written = json.loads(Path("runs/quick-homogeneous-0/summary.json").read_text())
    assert {"mems_as_bought", "mems_gyro"} <= set(written["references"])
    assert {"velocity_fit_push", "command_rms_rad_s", "velocity_rms_rad_s"} <= set(written)
    folder = "runs/quick-homogeneous-0"
    assert outcome.err == f"Written to {folder}. Open the recording: rerun {folder}/recording.rrd\n"
    assert (Path(folder) / "recording.rrd").exists()


def test_another_world_is_named_wherever_a_run_is(quick: str) -> None:
    outcome = cmg_mj("run", quick, "--world", 2)
    assert outcome.out.startswith("Quick: homogeneous, seed 0, world 2\n")
    assert os.listdir("runs") == ["quick-homogeneous-0-world2"]
    folder = Path("runs/quick-homogeneous-0-world2")
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["world"] == 2
    head = (folder / "scenario.toml").read_text().splitlines()[1]
    assert head == "#     cmg-mj run scenario.toml --world 2"
    rerun = cmg_mj("run", folder / "scenario.toml", "--world", 2, "--json", "--out", "again")
    assert json.loads(rerun.out) == summary
    world_0 = json.loads(cmg_mj("run", folder / "scenario.toml", "--json", "--out", "other").out)
    assert "world" not in world_0
    assert world_0["velocity_rms_error_rad_s"] != summary["velocity_rms_error_rad_s"]
    assert "--world" in cmg_mj("run", quick, "--world", -1).complaint


# --- compare -------------------------------------------------------------------------------------------------


def test_compare_prints_a_list_of_summaries(quick: str) -> None:
    outcome = cmg_mj("compare", quick, "--observers", "ltv, linear,ltv", "--worlds", 2, "--json")
    assert (outcome.status, outcome.err) == (0, "")
    summaries = json.loads(outcome.out)
    assert [entry["observer"] for entry in summaries] == ["ltv", "linear", *BASELINES]
    assert all([key for key in entry if key in SUMMARY] == SUMMARY for entry in summaries)
    assert json.loads(Path("runs/quick-compare-0/summary.json").read_text()) == summaries


@pytest.mark.slow
def test_compare_prints_a_table(quick: str) -> None:
    """All observers fit into 100 columns; the widest numbers are not cut."""
    outcome = cmg_mj("compare", quick, "--worlds", 2)
    assert outcome.status == 0
    lines = outcome.out.splitlines()
    assert lines[0] == "Quick: 2 worlds an observer, seed 0"
    assert max(map(len, lines)) <= 100
    assert "…" not in outcome.out
    for name in OBSERVERS:
        assert re.search(rf"^ {name} +\S+ +\S+", outcome.out, re.MULTILINE)
    assert "stopped" not in outcome.out  # a column that there is only if something stopped
    assert outcome.err.startswith("Written to runs/quick-compare-0. ")


def test_compare_prints_markdown(quick: str) -> None:
    outcome = cmg_mj("compare", quick, "--worlds", 1, "--observers", "linear", "--markdown")
    header, line, row, zero, *_ = outcome.out.splitlines()
    assert re.match(r"\| observer +\| +velocity RMS error \[rad/s\] \|", header)
    assert line.count("|") == header.count("|") == row.count("|") == zero.count("|")
    assert re.match(r"\| `linear` +\| +0\.", row)
    assert re.match(r"\| `zero` +\| +0\.", zero)
    assert not re.search(BESIDE, outcome.out)


def test_numbers_that_there_are_not() -> None:
    """No world stood to the end: dashes, and null in JSON."""
    Path("my.toml").write_text("duration_s = 1.0\n[plant]\nequilibrium_bias_deg = 30.0")
    outcome = cmg_mj("compare", "my.toml", "--worlds", 1, "--observers", "linear", "--out", "it")
    assert outcome.status == 0
    assert re.search(r"^ linear( +-){6} +100%$", outcome.out, re.MULTILINE)
    assert "zero" not in outcome.out.splitlines()  # nothing stood, on whose motion it could run open loop
    (summary,) = json.loads(Path("it/summary.json").read_text())
    assert (summary["fell"], summary["tilt_rms_deg"]) == (True, None)


# --- terminals, pipes ----------------------------------------------------------------------------------------


def run_on_a_terminal(*arguments: str) -> tuple[subprocess.CompletedProcess[str], str]:
    """Run with standard error on a terminal of 100 columns; what it showed."""
    master, terminal = pty.openpty()
    with subprocess.Popen(
        [*COMMAND, *arguments], env=environment(COLUMNS="100"), stdout=subprocess.PIPE, stderr=terminal, text=True
    ) as process:
        os.close(terminal)
        screen = b""
        while True:  # meanwhile: a slow run shows more progress than the terminal has room for
            try:
                piece = os.read(master, 65536)
            except OSError:  # the terminal is closed and read to its end
                break
            if not piece:
                break
            screen += piece
        out, _ = process.communicate()
    os.close(master)
    return subprocess.CompletedProcess(process.args, process.returncode, out), screen.decode()


@pytest.mark.slow
def test_progress_is_shown_on_a_terminal_and_nowhere_else() -> None:
    Path("long.toml").write_text(tomli_w.dumps({"title": "[b]Long[/b]", "duration_s": 4.0}))
    process, screen = run_on_a_terminal("run", "long.toml", "--json")
    assert process.returncode == 0
    assert json.loads(process.stdout)["outcome"] == "done"
    assert "[b]Long[/b]" in screen
    assert re.search(r"\d+%", screen)
    silent = cmg_mj("run", "long.toml", "--json")
    assert (silent.status, silent.err) == (0, "")
    assert silent.out == process.stdout


def test_an_unknown_way_of_rendering_is_one_line() -> None:
    """Where MuJoCo is imported first, in a process of its own."""
    unknown = {**os.environ, "MUJOCO_GL": "bogus"}
    process = subprocess.run(
        [*COMMAND, "check", "push_recovery"], capture_output=True, text=True, env=unknown, check=False
    )
    assert process.returncode == 2
    assert process.stderr.splitlines() == [
        "cmg-mj: invalid value for environment variable MUJOCO_GL: bogus: unset it, or take egl, glfw or osmesa"
    ]
