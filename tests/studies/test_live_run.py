"""A run in a viewer while it goes on: what is streamed, and that the run does not care what becomes of the viewer."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from cmg_mj.cli.live import factor_of
from cmg_mj.results.folder import RunFolder
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.simulation.experiment import Experiment, prepare
from cmg_mj.stages.push import Push
from cmg_mj.studies.live_run import LiveRun, RealTimeClock, shown_before
from cmg_mj.studies.save import report_run, save_run
from cmg_mj.visualization.recording import viewer
from cmg_mj.visualization.recording.live import GONE, STUCK
from cmg_mj.visualization.recording.stream import set_up
from cmg_mj.visualization.recording.streaming import StreamedRun
from cmg_mj.visualization.recording.viewer import Viewer, start_viewer, url_of
from tests.command import COMMAND, HANGS_AFTER_S, cmg_mj, cmg_mj_process, environment
from tests.run_folders import assert_whole
from tests.tiers import slow_but

pytestmark = pytest.mark.usefixtures("elsewhere")

SHORT = ("duration_s=3.0", "push.0.start_s=0.4", "push.0.duration_s=0.1")
TWO_AXES = (*SHORT, "push.1.start_s=0.8", 'open_loop_observers=["adaptive"]', "axes.pitch.observer.kind=linear")
TWO_ENDS = ("tilt/settle_band", "command/limit", "bias/true")
"""Straight lines, of which a recording has the ends and a stream the ends of every piece."""
NOT_ALIKE = "/__properties"
"""The name of the recording, and when it was made."""


@pytest.fixture
def receiver() -> Iterator[Viewer]:
    """A viewer without a screen that keeps all it is sent in a file."""
    viewer = start_viewer(["--save", "received.rrd"])
    yield viewer
    end(viewer, signal.SIGKILL)


def end(viewer: Viewer, signal_number: signal.Signals) -> None:
    """The viewer and what started it, and nothing else: they have a session of their own."""
    if viewer.process.poll() is None:
        os.killpg(viewer.process.pid, signal_number)
        viewer.process.wait()


def content(path: Path) -> dict[tuple[str, str], dict[Any, Any]]:
    """(entity, component) -> time [ns], None where there is none, -> value: all that a recording holds."""
    columns: dict[tuple[str, str], dict[Any, Any]] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a stream has no footer
        chunks = list(RrdReader(path).stream())
    for chunk in chunks:
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if name != "sim_time" and not name.startswith("rerun.controls")]
        times = [None] * batch.num_rows
        if not chunk.is_static:
            times = batch.column("sim_time").to_numpy(zero_copy_only=False).astype(np.int64).tolist()
        for name in names:
            rows = columns.setdefault((chunk.entity_path, name), {})
            for instant, value in zip(times, batch.column(name).to_pylist(), strict=True):
                if value is not None:
                    assert (
                        instant is None or instant not in rows or rows[instant] == value
                    )  # a page may be written anew
                    rows[instant] = value
    return columns


def assert_alike(stream_path: Path, file_path: Path) -> None:
    stream, file = content(stream_path), content(file_path)
    assert {key for key in stream if NOT_ALIKE not in key[0]} == {key for key in file if NOT_ALIKE not in key[0]}
    for key, rows in file.items():
        if key[0].startswith(NOT_ALIKE):
            continue
        if key[0].endswith(TWO_ENDS) and key[1] == "Scalars:scalars":
            assert {str(value) for value in stream[key].values()} == {str(value) for value in rows.values()}
            assert (min(stream[key]), max(stream[key])) == (min(rows), max(rows))
        else:
            assert stream[key] == rows, key


@pytest.mark.daily_cases("fall")
@pytest.mark.parametrize(
    ("scenario", "settings"),
    [
        pytest.param("push_recovery", SHORT, id="push", marks=pytest.mark.slow),
        pytest.param(
            "push_recovery",
            (*SHORT, 'open_loop_observers=["adaptive", "linear"]', "plant.equilibrium_bias_deg=0.5"),
            id="open_loop_observers",
            marks=pytest.mark.slow,
        ),
        pytest.param("push_recovery", (*SHORT, "push.0.torque_n_m=40.0"), id="fall"),
        pytest.param(
            "push_recovery",
            (*SHORT, "push.0.start_s=0.401", "push.0.duration_s=0.001", "plant.initial_tilt_deg=0.0"),
            id="between ticks",
            marks=pytest.mark.slow,
        ),
        pytest.param("push_recovery", ("duration_s=0.005", "push=[]"), id="one tick"),
        pytest.param("two_axes", TWO_AXES, id="two axes", marks=pytest.mark.slow),
        pytest.param(
            "two_axes",
            (*TWO_AXES, "push.1.torque_n_m=20.0", "plant.model=two_axes_free_base"),
            id="fall about pitch",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "two_axes",
            (*SHORT, 'plant.locked_axes=["pitch"]', "push.1.start_s=1.0"),
            id="one is locked",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_the_stream_is_the_recording(receiver: Viewer, scenario: str, settings: tuple[str, ...]) -> None:
    """Every entity, every component, every value at its time."""
    experiment = prepare(load_scenario(scenario, settings))
    view = LiveRun(experiment, receiver.url, RealTimeClock(5.0))
    with view:
        result = experiment.run(**view.options())
        view.ended(report_run(experiment, result))
        save_run(RunFolder(Path("it")), report_run(experiment, result))
    assert view.failure == ""
    assert_received(Path("received.rrd"))


@pytest.mark.daily_cases("(0.052, 0.07)-64")
@pytest.mark.parametrize("ticks", slow_but([1, 2, 3, 64], 64))
@pytest.mark.parametrize("push", [(0.05, 0.05), (0.051, 0.001), (0.052, 0.07)], ids=str)
def test_wherever_it_is_cut_into_pieces(ticks: int, push: tuple[float, float]) -> None:
    """With pushes that begin and end at ticks and between them; a second one comes before the rig has settled."""
    pushes = [Push(torque_n_m=2.0, start_s=push[0], duration_s=push[1])]
    pushes.append(Push(torque_n_m=-1.0, start_s=0.2, duration_s=0.015))
    scenario = load_scenario("push_recovery", ["duration_s=0.6", "plant.timestep_s=0.001"])
    assert_alike_in_pieces(prepare(scenario.model_copy(update={"push": pushes})), ticks)


@pytest.mark.slow
@pytest.mark.parametrize("ticks", [1, 3])
def test_wherever_several_axes_are_cut(ticks: int) -> None:
    """A push about one axis is none about the other, whose arrow and phases go their own way."""
    pushes = ("push.0.start_s=0.051", "push.0.duration_s=0.02", "push.1.start_s=0.2", "push.1.torque_n_m=-2.5")
    assert_alike_in_pieces(
        prepare(load_scenario("two_axes", ["duration_s=0.6", "plant.timestep_s=0.001", *pushes])), ticks
    )


def assert_alike_in_pieces(experiment: Experiment, ticks: int) -> None:
    result = experiment.run()
    assert result.trajectory is not None
    growing = StreamedRun(shown_before(experiment), rows(result.trajectory, 0, 0))
    with rr.RecordingStream("cmg-mj") as rec:
        memory = rec.memory_recording()
        set_up(rec, "")
        growing.begin(rec)
        for first in range(0, len(result.trajectory) - ticks, ticks):
            growing.add(rec, rows(result.trajectory, first, first + ticks))
        growing.end(rec, report_run(experiment, result).runs)
        Path("streamed.rrd").write_bytes(memory.drain_as_bytes())
    save_run(RunFolder(Path("it")), report_run(experiment, result))
    assert_alike(Path("streamed.rrd"), Path("it/recording.rrd"))


def rows(trajectory: Trajectory, first: int, end: int) -> Trajectory:
    return replace(trajectory, columns={name: values[first:end] for name, values in trajectory.columns.items()})


def assert_received(path: Path) -> None:
    """The viewer has written all: it has been sent that, but writes when it comes to it."""
    size = -1
    while True:
        try:
            return assert_alike(path, Path("it/recording.rrd"))
        except Exception:  # half a file may be no recording at all
            if path.stat().st_size == size:
                raise
            size = path.stat().st_size
            time.sleep(1.0)


def column(path: Path) -> dict[str, list[float]]:
    return {name: values.tolist() for name, values in Trajectory.load(path).columns.items()}


@pytest.mark.slow
@pytest.mark.parametrize("driver", ["native", "callback"])
def test_the_figures_are_those_of_a_run_that_nobody_looks_at(receiver: Viewer, driver: str) -> None:
    """Bit for bit, and nothing more is said. The callback is one for the whole process, the view's thread included."""
    arguments = ["run", "push_recovery", f"--driver={driver}", *(f"--set={setting}" for setting in SHORT), "--json"]
    live = cmg_mj_process(*arguments, "--out=live", "--connect", receiver.port, "--pace=5", cwd=Path())
    alone = cmg_mj_process(*arguments, "--out=alone", cwd=Path())
    assert live == alone
    assert live.status == 0
    assert column(Path("live/trajectory.parquet")) == column(Path("alone/trajectory.parquet"))
    assert Path("received.rrd").stat().st_size > 100_000


@pytest.mark.slow
@pytest.mark.parametrize("signal_number", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "stopped"])
def test_the_run_does_not_care_what_becomes_of_the_viewer(receiver: Viewer, signal_number: signal.Signals) -> None:
    """Killed, or standing still, while the run goes on, which ends all the same."""
    arguments = ["run", "push_recovery", *(f"--set={setting}" for setting in SHORT), "--out=it", "--json"]
    command = [*COMMAND, *arguments, "--connect", str(receiver.port), "--pace=2"]
    with subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        while Path("received.rrd").stat().st_size < 100_000:
            time.sleep(0.05)
        os.killpg(receiver.process.pid, signal_number)
        out, err = run.communicate(timeout=HANGS_AFTER_S)
    assert run.returncode == 0, err
    reason = {signal.SIGKILL: GONE, signal.SIGSTOP: STUCK}[signal_number]
    assert err == f"cmg-mj: the viewer missed a part: {reason}; the run and its files are complete\n"
    assert json.loads(out)["outcome"] == "done"
    assert len(assert_whole("it")) == 600


@pytest.mark.slow
def test_ctrl_c_keeps_what_was_recorded(receiver: Viewer, ctrl_c: None) -> None:
    command = [*COMMAND, "run", "push_recovery", "--out=it", "--connect", str(receiver.port)]
    with subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        while Path("received.rrd").stat().st_size < 150_000:
            time.sleep(0.05)
        run.send_signal(signal.SIGINT)
        _, err = run.communicate(timeout=HANGS_AFTER_S)
    assert run.returncode == 130
    assert err.splitlines()[-1].startswith("cmg-mj: interrupted at ")
    assert 0 < len(assert_whole("it")) < 2000  # the shapes come first and fill most of what was waited for
    assert_received(Path("received.rrd"))


def test_a_viewer_is_heard_on_this_machine_alone(receiver: Viewer) -> None:
    lines = subprocess.run(["ss", "-ltnH"], capture_output=True, text=True, check=True).stdout.splitlines()
    places = [line.split()[3] for line in lines if line.split()[3].endswith(f":{receiver.port}")]
    assert places == [f"127.0.0.1:{receiver.port}"]


def test_a_run_ends_and_its_viewer_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    """The command that starts one: here with a viewer that needs no screen, of which rerun has several kinds."""
    monkeypatch.setattr(viewer, "start_viewer", lambda: start_viewer(["--serve-grpc"]))
    outcome = cmg_mj(
        "run", "push_recovery", *(f"--set={setting}" for setting in SHORT), "--live", "--pace=max", "--out=it"
    )
    own_viewer = viewer._viewers[-1]
    try:
        assert outcome.status == 0, outcome
        assert own_viewer.process.poll() is None
    finally:
        end(own_viewer, signal.SIGKILL)


@pytest.fixture
def _without_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in viewer.SCREENS:
        monkeypatch.delenv(name, raising=False)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere no environment variable names the screen")
@pytest.mark.usefixtures("_without_screen")
def test_without_a_screen_it_is_said_before_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """No viewer is started to find that out."""
    monkeypatch.setattr(viewer, "_start", pytest.fail)
    message = cmg_mj("run", "push_recovery", "--live", "--out=it").complaint
    unset = "neither WAYLAND_DISPLAY nor WAYLAND_SOCKET nor DISPLAY is set"
    assert message.startswith(f"--live: no viewer could be started: {unset}. Where there is no screen: start rerun ")
    assert not Path("it").exists()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere no environment variable names the screen")
@pytest.mark.usefixtures("_without_screen")
def test_a_viewer_that_finds_no_screen_is_not_taken_for_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """It listens, and ends: on a busy machine seconds later."""
    monkeypatch.setenv("DISPLAY", "nowhere:77")
    monkeypatch.setattr(viewer, "STAYS_S", 60.0)
    message = cmg_mj("run", "push_recovery", "--live", "--out=it").complaint
    assert message.startswith("--live: no viewer could be started: ")
    assert not Path("it").exists()


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (
            ["--connect={free_port}"],
            "--connect '{free_port}': no viewer listens there (connection refused); start one with: ",
        ),
        (["--connect=localhost"], "--connect 'localhost': no address of a viewer; give PORT, HOST:PORT or "),
        (["--connect=http://localhost:1"], "--connect 'http://localhost:1': no address of a viewer; "),
        (["--connect=1:2:3"], "--connect '1:2:3': no address of a viewer; "),
        (["--connect=localhost:99999"], "--connect 'localhost:99999': no address of a viewer; "),
        (
            ["--connect={free_port}", "--live"],
            "--live starts a viewer, --connect uses a running one: give one",
        ),
        (["--live", "--pace=fast"], "--pace 'fast': must be a number such as 0.5 or 4, or max for no limit"),
        (["--live", "--pace=-1"], "--pace '-1': must be "),
        (["--live", "--pace=nan"], "--pace 'nan': must be "),
        (["--pace=2"], "--pace: goes with --live or --connect; "),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_is_wrong_is_said_before_the_run(arguments: list[str], complaint: str) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        free_port = probe.getsockname()[1]
    outcome = cmg_mj(
        "run", "push_recovery", "--out=it", *(argument.format(free_port=free_port) for argument in arguments)
    )
    assert outcome.complaint.startswith(complaint.format(free_port=free_port))
    assert not Path("it").exists()


@pytest.mark.parametrize(
    ("address", "url"),
    [
        ("9877", "rerun+http://127.0.0.1:9877/proxy"),
        ("elsewhere:9876", "rerun+http://elsewhere:9876/proxy"),
        ("[::1]:9876", "rerun+http://[::1]:9876/proxy"),
        ("rerun+http://127.0.0.1:1/proxy", "rerun+http://127.0.0.1:1/proxy"),
    ],
)
def test_addresses(address: str, url: str) -> None:
    assert url_of(address) == url


class Clock:
    """A clock that only sleeping moves."""

    def __init__(self) -> None:
        self.now = 100.0
        self.slept: list[float] = []

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.slept.append(round(seconds, 9))
        self.now += seconds


def test_a_pace_is_kept() -> None:
    """Twice real time; a tick that took long is made up for, a pause of seconds is not."""
    clock = Clock()
    pace = RealTimeClock(2.0, clock, clock.sleep)
    clock.now += 5.0  # nothing counts before the start
    pace.start()
    pace.wait(0.1)
    clock.now += 0.06
    pace.wait(0.2)
    pace.wait(0.3)
    assert clock.slept == [0.05, 0.04]
    clock.now += 10.0
    pace.wait(0.4)
    pace.wait(0.5)
    assert clock.slept == [0.05, 0.04, 0.05]


def test_as_fast_as_it_goes_nothing_is_waited_for() -> None:
    clock = Clock()
    pace = RealTimeClock(factor_of("max"), clock, clock.sleep)
    pace.wait(1000.0)
    assert clock.slept == []
    assert factor_of("0") == factor_of("max")
    assert factor_of("0.5") == 0.5
