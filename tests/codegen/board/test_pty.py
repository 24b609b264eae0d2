"""Runs over a pty to the emulated board, on a line that loses, doubles and delays bytes."""

from __future__ import annotations

import json
import os
import pty
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from cmg_mj.codegen.board import on_a_wire
from cmg_mj.codegen.board.deploy import exported
from cmg_mj.codegen.board.image import build
from cmg_mj.codegen.board.ports import open_port
from cmg_mj.codegen.board.tools import available
from cmg_mj.codegen.board.wired_board import WiredBoard
from cmg_mj.errors import InputError
from cmg_mj.results.result import Result
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.simulation.experiment import Experiment, prepare
from tests.codegen.board.toy import needs_board, short, toy
from tests.codegen.board.wire import TOY, Faults, PtyWire
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
    """A pty to the board with an experiment's controller."""
    with exported(experiment.axis_controller()) as files:
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
        assert min(faults.made.values()) > 0
    assert commands == [100.0 * (i + 1) for i in range(60)]
    assert board.counts.sent_again > 0


@pytest.mark.slow
@needs_export
def test_a_minute_over_a_bad_line_is_the_minute_over_a_good_one(tmp_path: Path) -> None:
    """60 s at 200 Hz. What is lost, doubled or delayed on the way changes not a bit of the run."""
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
    assert min(faults.made.values()) > 50
    assert isinstance(figures["sent_again"], int)
    assert figures["sent_again"] > 50
    assert same(wired, experiment.run(driver="board"))
    assert wired.outcomes[0].kind == "done"


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
    assert "has not answered for 4 ticks in a row, within 4000 ms each, at t = 0.615 s" in result.outcomes[0].reason
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
