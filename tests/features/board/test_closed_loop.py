"""Exported controllers on the emulated board: in lockstep with the host, and closing the loop."""

from __future__ import annotations

import json
import math
import re
import subprocess
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.features.board import Board, on_a_board, temporary_export
from cmg_mj.features.board.image import build
from cmg_mj.features.board.processor import Decision, run_on
from cmg_mj.observers import OBSERVERS
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario
from tests.command import cmg_mj
from tests.features.board.toy import SHORT, needs_board, short
from tests.recorded import assert_same_bits, recorded
from tests.tiers import slow_but

pytestmark = needs_board


@pytest.fixture(autouse=True)
def few_signals(monkeypatch: pytest.MonkeyPatch) -> None:
    """On which an export compares C with Python, before it goes to the board: see the tests of the export."""
    monkeypatch.setattr("cmg_mj.features.export.check.TICKS", 40)


NO_COUNTS = ("sensors.accelerometer.counts_per_g=0", "sensors.encoder.counts_per_revolution=0")
OWN_LAW = "controller.kind=tests.features.export.own_laws:"
ARE_PUSHED = ("homogeneous", "kalman", "gyro_free")
"""In lockstep; the others stand there for half a second."""
PUSH_SETTINGS = ("duration_s=2.5", "push.0.start_s=1.0", "push.0.torque_n_m=2.5")


def set_options(settings: tuple[str, ...]) -> list[str]:
    return [word for setting in settings for word in ("--set", setting)]


class Recorder:
    """A processor that does what the controller itself does, and keeps what it was given and decided."""

    def __init__(self, experiment: Experiment) -> None:
        self.controller = experiment.axis_controller()
        self.readings: list[tuple[list[float], list[float]]] = []
        self.decisions: list[Decision] = []

    def start(self) -> None:
        self.controller.reset()

    def update(self, accelerations: Sequence[float], encoders: Sequence[float]) -> Decision:
        tick = self.controller.decide(
            len(self.readings) * self.controller.period, accelerations, encoders, math.nan, math.nan
        )
        self.readings.append((list(accelerations), list(encoders)))
        self.decisions.append(Decision(tick.u, tick.x_e, tick.estimates[0]))
        return self.decisions[-1]


DOUBLE = re.compile(
    r"__aeabi_\w*d\w*|__\w*df\w*|(pow|exp|log|sqrt|sin|cos|tan|asin|acos|atan|atan2|sinh|cosh|tanh|f(abs|max|min|mod)"
    r"|floor|ceil|copysign|hypot|expm1|log1p)"
)
"""Functions that compute in double precision on this processor: the compiler's helpers, and the C library's."""


def double_precision_names(image: Path) -> list[str]:
    listing = subprocess.run(["arm-none-eabi-nm", image], capture_output=True, text=True, check=True).stdout
    names = [line.split()[-1] for line in listing.splitlines()]
    assert "main" in names
    return [name for name in names if DOUBLE.fullmatch(name)]


def test_a_processor_that_is_the_controller_changes_nothing() -> None:
    experiment = short("adaptive")
    ours, on_processor = experiment.run(), run_on(experiment, Recorder(experiment))
    assert ours.summaries == on_processor.summaries
    assert_same_bits(recorded(ours), recorded(on_processor))


@pytest.mark.parametrize("observer", slow_but([name for name in OBSERVERS if name != "mems_fused"], "linear"))
def test_lockstep_on_the_same_inputs(observer: str) -> None:
    """The board's inputs are rounded to single precision, and so are its numbers; nothing is in double."""
    experiment = prepare(load_scenario("push_recovery", PUSH_SETTINGS if observer in ARE_PUSHED else SHORT, observer))
    host = Recorder(experiment)
    run_on(experiment, host)
    with temporary_export(experiment.axis_controller()) as (name, folder):
        image = build(name, folder).path
        assert double_precision_names(image) == []
        board = Board(image)
    with board:
        board.start()
        decisions = [board.update(*reading) for reading in host.readings]
    for signal in (lambda decision: decision.estimate[1], lambda decision: decision.x_e):
        host_signal, board_signal = (
            np.array([signal(decision) for decision in series]) for series in (host.decisions, decisions)
        )
        assert np.sqrt(np.mean((board_signal - host_signal) ** 2)) < 1e-5
    if observer in ARE_PUSHED:  # and hard: the command went to its limit
        assert max(abs(decision.u) for decision in host.decisions) == experiment.law.rate_limit
    u, board_u = (np.array([decision.u for decision in series]) for series in (host.decisions, decisions))
    assert np.sqrt(np.mean((board_u - u) ** 2)) < 1e-4


@pytest.mark.parametrize(
    ("observer", "settings"),
    [
        ("gyro_free", ()),
        pytest.param(
            "adaptive",
            ("controller.bias_trim_s=0.2", "controller.angle_source=estimated"),
            marks=pytest.mark.slow,
        ),
        pytest.param("kalman", ("controller.kind=lqg",), marks=pytest.mark.slow),
        pytest.param("kalman", (f"{OWN_LAW}Elaborate",), marks=pytest.mark.slow),
        pytest.param("kalman", (f"{OWN_LAW}Memoryless",), marks=pytest.mark.slow),
    ],
)
def test_it_closes_the_loop(observer: str, settings: tuple[str, ...]) -> None:
    """Tick by tick, without the sensors' counts: a reading just between two of them may fall to either side.

    Of the last two laws one has an integrator that does not begin at zero, and the other one has none.
    """
    experiment = short(observer, *NO_COUNTS, *settings)
    with temporary_export(experiment.axis_controller()) as (name, folder):
        assert double_precision_names(build(name, folder).path) == []
    results = [experiment.run(driver) for driver in ("native", "board")]
    assert results[0].outcomes == results[1].outcomes
    host, board = map(recorded, results)
    assert board.columns.keys() == host.columns.keys()
    for name in ("x1_rad", "x2_rad_s", "u_rad_s", "x_e_rad_times_s", f"estimate/{observer}/x2_rad_s"):
        np.testing.assert_allclose(board[name], host[name], atol=1e-4, err_msg=name)
    assert not np.array_equal(board["u_rad_s"], host["u_rad_s"])
    assert np.isnan(board["x_e_rad_times_s"]).all() == (settings == (f"{OWN_LAW}Memoryless",))


@pytest.mark.slow
def test_open_loop_observers_run_on_the_host() -> None:
    experiment = short("linear", "open_loop_observers=['ltv']")
    host, board = experiment.run(), experiment.run(driver="board")
    key = "velocity_rms_error_rad_s"
    assert board.values(key, "ltv") == pytest.approx(host.values(key, "ltv"), rel=1e-3)
    assert host.values(key, "ltv") != host.values(key)


def test_a_reading_that_is_not_finite_stops_the_board_until_start() -> None:
    good = ((0.0, 9.81, 0.0, 9.81), (math.pi / 2.0, math.pi / 2.0))
    broken = ((math.inf, *good[0][1:]), good[1])
    with on_a_board(prepare(load_scenario("push_recovery", SHORT, "linear")).axis_controller()) as board:
        before = [board.update(*good) for _ in range(3)]
        for readings in (broken, good):
            with pytest.raises(
                RunStopped, match=r"^the controller on the board has stopped: a reading was not finite$"
            ):
                board.update(*readings)
        board.start()
        assert [board.update(*good) for _ in range(3)] == before


def test_what_the_board_cannot_do_is_refused() -> None:
    with pytest.raises(
        InputError, match=r"^controller\.feedback = 'truth': cannot be exported: C has the observer's rate"
    ):
        short("linear", "controller.feedback=truth").run(driver="board")


@pytest.mark.slow
@pytest.mark.usefixtures("elsewhere")
def test_a_run_on_the_board_says_so_and_reruns_to_the_same_numbers() -> None:
    first = cmg_mj("run", "push_recovery", "--driver", "board", *set_options(SHORT), "--out", "board")
    assert "homogeneous on the board, seed 0" in " ".join(first.out.split())
    file = Path("board/scenario.toml")
    assert "cmg-mj run scenario.toml --driver board" in file.read_text().splitlines()[1]
    assert cmg_mj("run", file, "--driver", "board", "--out", "again").status == 0
    assert cmg_mj("run", file, "--out", "on_host").status == 0
    folders, drivers = [Path("board"), Path("again"), Path("on_host")], ["board", "board", None]
    summaries = [(folder / "summary.json").read_text() for folder in folders]
    assert summaries[0] == summaries[1] != summaries[2]
    assert file.read_text() == Path("again/scenario.toml").read_text()
    assert tomllib.loads(file.read_text()) == tomllib.loads(Path("on_host/scenario.toml").read_text())
    assert [json.loads(summary).get("driver") for summary in summaries] == drivers
    assert [Trajectory.load(folder / "trajectory.parquet").metadata.get("driver") for folder in folders] == drivers


OPEN_LOOP_OBSERVER = """
import signal
from cmg_mj import Estimate

class Presses:
    '''Presses Ctrl-C at the 20th sample.'''
    def __init__(self, dt, model):
        pass
    def init(self, y):
        return 0
    def step(self, k, y, u):
        if k == 18:
            signal.raise_signal(signal.SIGINT)
        return k + 1, Estimate(y.y1, 0.0 * y.y1, y.y2)
"""


@pytest.mark.slow
@pytest.mark.usefixtures("elsewhere", "ctrl_c")
def test_ctrl_c_ends_the_board_too() -> None:
    Path("pressing.py").write_text(OPEN_LOOP_OBSERVER)
    others = children()
    outcome = cmg_mj(
        *["run", "push_recovery", "--driver", "board", "--out", "here"],
        "--set",
        "open_loop_observers=['pressing:Presses']",
    )
    assert outcome.status == 130
    assert outcome.err.endswith("cmg-mj: interrupted at 0.095 s; what was recorded until then is in here\n")
    assert json.loads(Path("here/summary.json").read_text())["outcome"] == "interrupted"
    assert children() == others


def children() -> set[str]:
    """Processes that this one has started."""
    if not Path("/proc/self/task").exists():
        return set()
    return {pid for task in Path("/proc/self/task").iterdir() for pid in (task / "children").read_text().split()}


def test_a_processor_takes_one_axis() -> None:
    processor: Any = "a board"
    with pytest.raises(InputError, match=r"\(roll, pitch\), and one controller takes one; lock the others"):
        run_on(prepare(load_scenario("two_axes")), processor)


@pytest.mark.parametrize("wrong", [{"x_e": math.nan}, {"x_e": math.inf}, {"u": math.nan}])
def test_an_answer_that_is_no_number_stops_the_run(wrong: dict[str, float]) -> None:
    """The law has an integrator."""
    experiment = short("linear")
    host = Recorder(experiment)
    update = host.update

    def forget(accelerations: Sequence[float], encoders: Sequence[float]) -> Decision:
        decision = update(accelerations, encoders)
        return decision._replace(**wrong) if len(host.decisions) == 20 else decision

    host.update = forget  # type: ignore[method-assign]
    (outcome,) = run_on(experiment, host).outcomes
    assert outcome.kind == "stopped"
    assert "the processor answered u = " in outcome.reason
    assert "at t = 0.095 s" in outcome.reason


def test_an_observer_that_needs_a_gyro_is_refused() -> None:
    experiment = prepare(load_scenario("push_recovery", SHORT, "mems_fused"))
    with pytest.raises(InputError, match="MemsFused: a processor in the loop reads no gyro; take another observer"):
        run_on(experiment, Recorder(experiment))
