"""Ctrl-C: a run ends between two ticks and is written whole; a second one ends it at once."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cmg_mj.results.baselines import BASELINES
from cmg_mj.results.trajectory import Trajectory
from tests.command import COMMAND, HANGS_AFTER_S, CommandOutcome, cmg_mj_process, environment
from tests.run_folders import assert_whole, names, write

pytestmark = pytest.mark.usefixtures("elsewhere", "ctrl_c")

OBSERVER = """
import signal, time
from pathlib import Path
from cmg_mj import Estimate

class Interrupts:
    '''Presses Ctrl-C at the 600th sample, once or more often.'''
    def __init__(self, dt, model, times=1, signal="SIGINT"):
        self.times, self.signal = times, signal
    def init(self, y):
        return 0
    def step(self, k, y, u):
        if k == 598:
            for _ in range(self.times):
                self.press()
        return k + 1, Estimate(y.y1, 0.0 * y.y1, y.y2)
    def press(self):
        signal.raise_signal(getattr(signal, self.signal))

class Waits(Interrupts):
    '''Waits at the 600th sample until somebody else has pressed it.'''
    def press(self):
        Path('waiting').touch()
        while not Path('pressed').exists():
            time.sleep(0.01)

class Slow(Interrupts):
    '''Takes 0.1 s a sample; presses it at the fourth.'''
    def step(self, k, y, u):
        time.sleep(0.1)
        if k == 2:
            Path('after').write_text('')
            self.press()
        elif k > 2:
            with Path('after').open('a') as after:
                after.write('.')
        return k + 1, Estimate(y.y1, 0.0 * y.y1, y.y2)
"""
LONG = "duration_s = 600.0\n[controller]\nfeedback = 'truth'\n[observer]\nkind = 'pressing:Interrupts'"


PARTLY = "cmg-mj: interrupted at 2.995 s; what was recorded until then is in it"


def command(*arguments: object) -> CommandOutcome:
    """Run a command in the current folder, where the observers are."""
    write(OBSERVER, "pressing.py")
    return cmg_mj_process(*arguments, cwd=Path())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "ticks"),
    [
        (["--driver", "native"], 600),
        (["--driver", "callback"], 600),
        (["--set", "observer.times=2"], 599),  # a second one ends it at once
        (["--set", "observer.signal=SIGTERM"], 600),
        (["--set", "observer.signal=SIGHUP"], 600),
    ],
)
def test_ends_a_run_at_the_next_clean_point(options: list[str], ticks: int) -> None:
    """Started by nohup a process ignores SIGHUP, and so do those that it starts: not here."""
    inherited = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    try:
        outcome = command("run", write(LONG), "--out", "it", *options)
    finally:
        signal.signal(signal.SIGHUP, inherited)
    assert outcome.status == 130, outcome
    assert outcome.err.splitlines()[-1] == PARTLY
    assert len(assert_whole("it")) == ticks
    assert json.loads(Path("it/summary.json").read_text())["outcome"] == "interrupted"


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [["run"], ["compare", "--observers", "pressing:Slow", "--worlds", 2]])
def test_is_heard_after_the_tick_however_slow_an_observer_is(arguments: list) -> None:
    """An observer of 0.1 s a sample: not one more sample is taken."""
    name, *options = arguments
    outcome = command(name, write(LONG.replace("Interrupts", "Slow")), *options, "--out", "it")
    assert outcome.status == 130, outcome
    assert Path("after").read_text() == ""
    assert name == "compare" or len(assert_whole("it")) == 4


WRITING = """
import signal
from cmg_mj import cli
from cmg_mj.runs import save as runs
def pressed(record, times=({times})):
    def press(*arguments):
        for _ in range(times):
            signal.raise_signal(signal.SIGINT)
        record(*arguments)
    return press
runs._write_json = pressed(runs._write_json)
cli.main(["run", "my.toml", "--out", "it"])
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("times", "last_line"),
    [(1, "cmg-mj: interrupted at the end; the complete run is in it"), (2, "cmg-mj: interrupted")],
)
def test_while_files_are_written_lets_them_be_finished_unless_it_comes_twice(times: int, last_line: str) -> None:
    write("duration_s = 0.2")
    process = subprocess.run(
        [sys.executable, "-c", WRITING.format(times=times)],
        env=environment(),
        capture_output=True,
        text=True,
        timeout=HANGS_AFTER_S,
    )
    assert process.returncode == 130, process
    assert process.stderr.splitlines()[-1] == last_line
    if times == 1:
        assert_whole("it")
    else:
        assert [name for name in names("it") if not name.startswith(".")] == ["trajectory.parquet"]
    assert len(Trajectory.load(Path("it/trajectory.parquet"))) == 40


@pytest.mark.slow
def test_ends_a_comparison_with_the_observers_that_are_done() -> None:
    file = write("duration_s = 3.0\n[controller]\nfeedback = 'truth'")
    observers = "linear,pressing:Interrupts,ltv"
    outcome = command("compare", file, "--observers", observers, "--worlds", 1, "--out", "it")
    assert outcome.status == 130, outcome
    assert outcome.err.splitlines()[-1] == "cmg-mj: interrupted; 1 of 3 observers are in it"
    assert {"trajectory-linear.parquet", "worlds.parquet"} <= set(names("it"))
    rows = json.loads(Path("it/summary.json").read_text())
    assert [entry["observer"] for entry in rows] == ["linear", *BASELINES]


@pytest.mark.slow
def test_before_the_first_observer_is_done_leaves_nothing() -> None:
    outcome = command("compare", write(LONG), "--observers", "pressing:Interrupts", "--worlds", 1, "--out", "it")
    assert (outcome.status, outcome.out) == (130, "")
    assert outcome.err == "cmg-mj: interrupted before the first observer was done; nothing was written\n"
    assert not Path("it").exists()


@pytest.mark.slow
def test_from_outside() -> None:
    """From another process, while the run waits for it in the middle of a tick: nothing depends on who is faster."""
    write(OBSERVER, "pressing.py")
    file = write(LONG.replace("Interrupts", "Waits"))
    with subprocess.Popen(
        [*COMMAND, "run", file, "--out", "it"],
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            while not Path("waiting").exists():
                assert process.poll() is None, process.communicate()
                time.sleep(0.01)
            process.send_signal(signal.SIGINT)
            Path("pressed").touch()
            _, err = process.communicate(timeout=HANGS_AFTER_S)
        finally:
            process.kill()
    assert process.returncode == 130, err
    assert err.splitlines()[-1] == PARTLY
    assert len(assert_whole("it")) == 600
    verified = subprocess.run([sys.executable, "-m", "rerun", "rrd", "verify", "it/recording.rrd"], capture_output=True)
    assert verified.returncode == 0, verified


@pytest.mark.slow
def test_leaves_the_complete_result_of_a_run_before() -> None:
    assert command("run", write("duration_s = 0.1"), "--out", "it").status == 0
    assert "; what was in it stays as it was" in command("run", write(LONG), "--out", "it").err
    assert len(Trajectory.load(Path("it/trajectory.parquet"))) == 20
    assert len(assert_whole("it-2")) == 600


@pytest.mark.slow
@pytest.mark.parametrize("was_there", [False, True])
def test_a_study_that_cannot_begin_leaves_no_folder_but_one_that_was_there(was_there: bool) -> None:
    if was_there:
        Path("a").mkdir()
    assert command("tune", write("duration_s = 1.0"), "--parameters", "nothing", "--out", "a").status == 2
    assert Path("a").is_dir() == was_there
