"""Runs over a pty to the emulated board, on a line that loses, doubles and delays bytes."""

from __future__ import annotations

import json
import os
import pty
import re
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cmg_mj.codegen.board import on_a_wire
from cmg_mj.codegen.board.deploy import temporary_export
from cmg_mj.codegen.board.image import build
from cmg_mj.codegen.board.log_file import read_board_log
from cmg_mj.codegen.board.ports import open_port
from cmg_mj.codegen.board.tools import available
from cmg_mj.codegen.board.wired_board import WiredBoard
from cmg_mj.errors import InputError
from cmg_mj.results.result import Result
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.simulation.experiment import Experiment, prepare
from tests.codegen.board.toy import needs_board, short, toy
from tests.codegen.board.wire import TOY, Faults, PtyWire, tcp_board
from tests.command import cmg_mj

pytest.importorskip("serial")
pytestmark = needs_board

needs_export = pytest.mark.skipif(not available(), reason="the cross-compiler, QEMU or CasADi is not installed")
PATIENCE_S, AGAIN_S = 300.0, 0.05
"""On a busy machine too no tick is lost: a sample is sent again until it is answered [s]."""


@pytest.fixture(autouse=True)
def few_signals_and_patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """An export compares C with Python on few signals (see its tests); a handshake may take long on a busy machine."""
    monkeypatch.setattr("cmg_mj.codegen.export.check.TICKS", 40)
    monkeypatch.setattr("cmg_mj.codegen.board.wired_board.PATIENCE_S", PATIENCE_S)


@contextmanager
def wire_to(experiment: Experiment, folder: Path, faults: Faults | None = None) -> Iterator[PtyWire]:
    """Start a board with an experiment's controller behind a pty."""
    with temporary_export(experiment.axis_controller()) as files:
        image = build(files.observer, files.folder, identity=files.identity).path.rename(folder / "board.elf")
    with PtyWire(image, faults) as wire:
        yield wire


def same(a: Result, b: Result) -> bool:
    assert a.trajectory is not None
    assert b.trajectory is not None
    return all(np.array_equal(a.trajectory[name], b.trajectory[name], equal_nan=True) for name in a.trajectory.columns)


def test_a_toy_behind_a_pty(tmp_path: Path) -> None:
    """Bytes that are lost, doubled, delayed: each sample is executed once. u is the angle and 100 an update."""
    image = toy(tmp_path, identity=TOY.text())
    faults = Faults(1, lose=0.004, double=0.004, delay=0.004, delay_s=0.001)
    with PtyWire(image, faults) as wire:
        port = open_port(wire.name)
        board = WiredBoard(port, wire.name, TOY, 4, PATIENCE_S, AGAIN_S)
        board.start()
        commands = [board.update((0.0, 9.8, 0.0, 9.8), (0.0, 0.0)).u for _ in range(60)]
        port.close()
        assert min(faults.counts.values()) > 0
    assert commands == [100.0 * (i + 1) for i in range(60)]
    assert board.counts.sent_again > 0


@pytest.mark.slow
@needs_export
def test_a_minute_over_a_bad_line_is_the_minute_over_a_good_one(tmp_path: Path) -> None:
    """60 s at 200 Hz in lockstep: the deadline is 300 s. What is lost, doubled or delayed changes not a bit."""
    experiment = prepare(load_scenario("push_recovery", ["duration_s=60"], "gyro_free"))
    faults = Faults(7, lose=1e-4, double=1e-4, delay=1e-4, delay_s=0.002)
    with (
        wire_to(experiment, tmp_path, faults) as wire,
        on_a_wire(experiment.axis_controller(), wire.name, deadline_s=PATIENCE_S, again_s=AGAIN_S) as board,
    ):
        wired = experiment.run_on(board)
    assert wired.wire is not None
    figures = wired.wire.figures
    assert (figures["ticks"], figures["lost"], figures["board"]) == (12_000, 0, "mps2-an500")
    assert min(faults.counts.values()) > 50
    assert isinstance(figures["sent_again"], int)
    assert figures["sent_again"] > 50
    assert same(wired, experiment.run(driver="board"))
    assert wired.outcomes[0].kind == "done"


@pytest.mark.slow
@needs_export
@pytest.mark.parametrize("lossy", [False, True], ids=["good line", "lossy line"])
@pytest.mark.usefixtures("elsewhere")
def test_the_commands_own_deadline(tmp_path: Path, lossy: bool, capsys: pytest.CaptureFixture[str]) -> None:
    """5 ms, sent again after 2.5: whatever this machine manages in time is counted, and the end is clear."""
    share = 2e-3 if lossy else 0.0
    experiment = prepare(load_scenario("push_recovery", ["duration_s=3"], "gyro_free"))
    with wire_to(experiment, tmp_path, Faults(3, lose=share, double=share, delay=share, delay_s=0.004)) as wire:
        arguments = f"run push_recovery --driver board --observer gyro_free --port {wire.name} --set duration_s=3"
        outcome = cmg_mj(*arguments.split(), "--out", "here")
        recorded = bytes(wire.recorded)
    summary = json.loads(Path("here/summary.json").read_text())
    figures = summary["wire"]
    with capsys.disabled():
        print(f"\n{'lossy' if lossy else 'good'} line: status {outcome.status}, {summary['outcome']}, {figures}")
    if outcome.status:
        last = outcome.err.splitlines()[-1]
        assert last.startswith(f"cmg-mj: {wire.name}: the board has not answered for 20 ticks in a row, within 5 ms ")
        assert figures["lost_in_a_row"] == 20
    assert figures["deadline_ms"] == 5.0
    assert figures["ticks"] > 0
    if "round_trip_ms" in figures:
        assert figures["round_trip_ms"]["most"] < 5.0
    if lossy:
        assert figures["sent_again"] + figures["lost"] > 0
    head = Path("here/scenario.toml").read_text().splitlines()[1]
    assert head == f"#     cmg-mj run scenario.toml --driver board --port {wire.name}"
    log = read_board_log(Path("here/board.frames"), 1000)
    assert (len(log.columns["time_s"]), log.damaged) == (figures["ticks"], 0)
    if not lossy:
        Path("wire.bin").write_bytes(recorded)
        raw = read_board_log(Path("wire.bin"), 1000)
        for name in ("time_s", "inner_x_m_s2", "outer_z_m_s2", "gimbal_rad"):
            np.testing.assert_array_equal(raw.columns[name], log.columns[name], err_msg=name)
        if not figures["lost"]:  # an answer that came late is in the wire's recording, and the host has not used it
            np.testing.assert_array_equal(raw.columns["command_rad_s"], log.columns["command_rad_s"])


@pytest.mark.slow
@needs_export
@pytest.mark.usefixtures("elsewhere")
def test_a_board_behind_a_tcp_port(tmp_path: Path) -> None:
    """The command, the rerun line and the replay; the trajectory is the emulated board's."""
    experiment = prepare(load_scenario("push_recovery", ["duration_s=2.5"], "gyro_free"))
    run = ["run", "push_recovery", "--driver", "board", "--observer", "gyro_free", "--set", "duration_s=2.5"]
    wire = ["--deadline-ms", "60000", "--max-lost", "7"]
    with temporary_export(experiment.axis_controller()) as files:
        image = build(files.observer, files.folder, identity=files.identity).path.rename(tmp_path / "board.elf")
    with tcp_board(image) as port:
        wired = cmg_mj(*run, "--port", port, *wire, "--out", "here")
        assert wired.status == 0, wired.err
        assert f"Wire {port} (mps2-an500): 500 ticks; round trip median" in wired.out
        no_rate = cmg_mj(*run, "--port", port, "--baud", "115200")
        assert no_rate.complaint == f"--baud 115200: {port} has no baud rate; leave it out"
        rerun = Path("here/scenario.toml").read_text().splitlines()[1].removeprefix("#     cmg-mj ").split()
        assert rerun == ["run", "scenario.toml", "--driver", "board", "--port", port, *wire]
        rerun[1] = "here/scenario.toml"
        again = cmg_mj(*rerun, "--out", "again")
        assert again.status == 0, again.err
    assert cmg_mj(*run, "--out", "emulated").status == 0
    first, *others = (Trajectory.load(Path(name) / "trajectory.parquet") for name in ("here", "again", "emulated"))
    for other in others:
        for name in first.columns:
            np.testing.assert_array_equal(first[name], other[name], err_msg=name)
    summary = json.loads(Path("here/summary.json").read_text())
    assert "update_us" not in summary["wire"]  # an emulator's
    assert summary["wire"]["options"] == f"--port {port} --deadline-ms 60000 --max-lost 7"
    assert cmg_mj("replay", "here/board.frames", "--settle-s", "0", "--out", "replayed").status == 0


@pytest.mark.slow
def test_another_firmware_is_refused_behind_a_pty(tmp_path: Path) -> None:
    """Each field that the firmware itself says, and its checksum."""
    with PtyWire(toy(tmp_path, identity=TOY.text())) as wire:
        for field, value, message in (
            ("firmware", "other", "the board has firmware cmg_mj, the scenario wants other: export and flash it again"),
            ("version", "9", "the board has firmware version 2, the scenario wants 9: export and flash it again"),
            ("observer", "linear", "the board has observer toy, the scenario wants linear: export and flash it again"),
            ("precision", "double", "the board has precision single, the scenario wants double: export and flash"),
            ("rate_hz", 100.0, "the board has rate 200 Hz, the scenario wants 100 Hz: export and flash it again"),
            (
                "radii_m",
                (0.1, 0.3),
                "the board has radii of the accelerometers 0.1,0.2 m, the scenario wants 0.1,0.3 m",
            ),
            ("code", "deadbeef", "the board's toy has other numbers than the scenario's (checksums 0badc0de and dead"),
        ):
            port = open_port(wire.name)
            with pytest.raises(InputError, match=re.escape(f"{wire.name}: {message}")):
                WiredBoard(port, wire.name, replace(TOY, **{field: value}), 4, PATIENCE_S)
            port.close()


@pytest.mark.slow
def test_answers_that_come_late_behind_a_pty(tmp_path: Path) -> None:
    """Their ticks are lost and counted; the board has executed each sample once, and the next is answered in time."""
    with PtyWire(toy(tmp_path, identity=TOY.text())) as wire:
        port = open_port(wire.name)
        board = WiredBoard(port, wire.name, TOY, 4, 2.0, 2.0)
        board.start()
        sample = (0.0, 9.8, 0.0, 9.8), (0.0, 0.0)
        commands = [board.update(*sample).u]
        wire.late_s = 3.0
        commands.append(board.update(*sample).u)
        wire.late_s = 0.0
        commands += [board.update(*sample).u for _ in range(3)]
        figures = board.figures()
        port.close()
    assert commands == [100.0, 100.0, 300.0, 400.0, 500.0]
    assert (figures["lost"], figures["lost_in_a_row"], figures["late_or_doubled"]) == (1, 1, 1)


@pytest.mark.usefixtures("elsewhere")
def test_a_baud_rate_that_does_not_fit_is_refused_behind_a_pty() -> None:
    master, slave = pty.openpty()
    port = os.ttyname(slave)
    options = f"run push_recovery --driver board --observer gyro_free --port {port} --baud 9600"
    complaint = cmg_mj(*options.split()).complaint
    assert complaint.startswith("--baud 9600: a tick's frames do not fit: 30 + 38 bytes take 70.8 ms")
    assert not Path("runs").exists()
    os.close(master)
    os.close(slave)


@pytest.mark.slow
@needs_export
def test_ticks_that_are_lost_hold_the_command_and_are_counted(tmp_path: Path) -> None:
    """The line is deaf for a few samples, sent twice each; the rig stands. Then it is deaf for good."""
    experiment = short("gyro_free", "duration_s=1.0")
    with (
        wire_to(experiment, tmp_path) as wire,
        on_a_wire(experiment.axis_controller(), wire.name, deadline_s=4.0, max_lost=4) as board,
    ):

        def deafen(time_s: float) -> None:
            if round(time_s, 9) in (0.3, 0.6):
                wire.deaf = 30 * 2 * 3 if time_s < 0.5 else 10**9

        result = experiment.run_on(board, on_progress=deafen)
    assert result.outcomes[0].kind == "stopped"
    assert (
        "has not answered for 4 ticks in a row, within 4000 ms each (--deadline-ms allows more), at t = 0.615 s"
        in result.outcomes[0].reason
    )
    assert result.wire is not None
    assert (result.wire.figures["lost"], result.wire.figures["lost_in_a_row"]) == (7, 4)
    assert result.trajectory is not None
    u = result.trajectory["u_rad_s"]
    assert len(u) == 123
    assert (u[60:63] == u[59]).all()
    assert (u[120:123] == u[119]).all()
    assert len(np.unique(u[63:120])) > 40


@pytest.mark.slow
@needs_export
@pytest.mark.usefixtures("elsewhere")
def test_a_cable_that_is_pulled_ends_in_a_line_and_keeps_the_run(tmp_path: Path) -> None:
    experiment = short("gyro_free")
    with wire_to(experiment, tmp_path) as wire:
        wire.pulled_after = 50 * 30
        outcome = cmg_mj(
            *f"run push_recovery --driver board --observer gyro_free --port {wire.name} --deadline-ms 60000".split(),
            *["--set", "duration_s=0.5", "--set", "push=[]", "--out", "here"],
        )
    assert outcome.status == 2
    last = outcome.err.splitlines()[-1]
    assert last.startswith(f"cmg-mj: {wire.name}: the cable is pulled, or the board is gone, at t = 0.")
    assert last.endswith("; what was recorded until then is in here")
    summary = json.loads(Path("here/summary.json").read_text())
    assert (summary["outcome"], summary["driver"], summary["port"]) == ("stopped", "board", wire.name)
    assert 10 < len(Trajectory.load(Path("here/trajectory.parquet"))) < 50
    assert cmg_mj("replay", "here/board.frames", "--settle-s", "0").status == 0


@pytest.mark.slow
@needs_export
@pytest.mark.usefixtures("elsewhere")
def test_the_command_and_the_replay_of_its_log(tmp_path: Path) -> None:
    """A run over a pty says how the wire did; its log replays to the figures of its trajectory, in single precision."""
    settings = ["--set", "duration_s=4", "--observer", "gyro_free"]
    experiment = prepare(load_scenario("push_recovery", ["duration_s=4"], "gyro_free"))
    with wire_to(experiment, tmp_path) as wire:
        port = ["--driver", "board", "--port", wire.name, "--deadline-ms", "60000"]
        outcome = cmg_mj("run", "push_recovery", *port, *settings, "--out", "here")
        assert outcome.status == 0
        assert f"Wire {wire.name} (mps2-an500): 800 ticks; round trip median" in outcome.out
        assert "0 lost with the command held" in outcome.out
        other = cmg_mj("run", "push_recovery", *port, *settings, "--set", "controller.gains=[36,4,-1,0.3]")
        assert f"{wire.name}: the board's gyro_free has other numbers than the scenario's" in other.complaint
        wrong = cmg_mj("run", "push_recovery", *port, "--observer", "linear")
        assert wrong.complaint == (
            f"{wire.name}: the board has observer gyro_free, the scenario wants linear: export and flash it again"
        )
        assert not Path("runs").exists()
        file = cmg_mj("run", "here/scenario.toml", *port, "--out", "again")
        assert file.status == 0
    first, second = (Trajectory.load(Path(folder) / "trajectory.parquet") for folder in ("here", "again"))
    for name in first.columns:
        np.testing.assert_array_equal(first[name], second[name], err_msg=name)
    common = ["--observers", "linear,homogeneous", "--json", "--out", "replayed"]
    of_user = ["--model", "scissored_pair", "--noise", "accelerometer=400", "--settle-s", "0"]
    run, log = (
        json.loads(cmg_mj("replay", *arguments, *common).out)["logs"][0]
        for arguments in (["here"], ["here/board.frames", *of_user])
    )
    assert (log["samples"], log["rate_hz"], log["notes"]) == (800, 200.0, [])
    for name in ("linear", "homogeneous"):
        for key in ("velocity_rms_error_rad_s", "velocity_rms_rad_s", "velocity_fit"):
            assert log["observers"][name][key] == pytest.approx(run["observers"][name][key], rel=1e-5)


def test_a_wire_to_nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A port that is there, with a board that is still: refused in a line, within the handshake's patience."""
    monkeypatch.setattr("cmg_mj.codegen.board.wired_board.PATIENCE_S", 0.05)
    master, slave = pty.openpty()
    tty.setraw(slave)
    port = open_port(os.ttyname(slave))
    with pytest.raises(InputError, match="no answer within"):
        WiredBoard(port, "the pty", TOY, 4, 1.0)
    port.close()
    os.close(master)
    os.close(slave)
