"""Every observer with the whole controller on the emulated board, beside the same on the host.

    python docs/studies/on_the_board.py [--observers NAMES] [--worlds 20] [--scenario push_recovery]

In lockstep the board closes the loop, and the host's controller gets the same readings. The column has the RMS
difference of both estimated rates over all worlds and ticks. In closed loop there are means of velocity RMS error and
settle time over the worlds. Those on the host have their 95 % intervals; for those with the board the table says
whether they lie within. docs/board.md has the table. About a minute an observer.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence

import numpy as np

from cmg_mj.core.controller import Controller
from cmg_mj.features.board import Board, on_a_board
from cmg_mj.features.board.processor import Decision, run_on
from cmg_mj.observers import OBSERVERS
from cmg_mj.results.intervals import format_interval, in_line, known_interval
from cmg_mj.results.tables import markdown_table
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario

FIGURES = {"velocity_rms_error_rad_s": "{:.5f}", "settle_time_s": "{:.3f}"}


class Beside:
    """The board, and a controller on the host that gets the same readings.

    Attributes:
        differences: Differences of the estimated rates, a number a tick [rad/s].
    """

    def __init__(self, board: Board, controller: Controller) -> None:
        self.board, self.controller = board, controller
        self.differences: list[float] = []
        self._tick = 0

    def start(self) -> None:
        """The next update is the first."""
        self.board.start()
        self.controller.reset()
        self._tick = 0

    def update(self, accelerations: Sequence[float], encoders: Sequence[float]) -> Decision:
        """Let the board decide."""
        decision = self.board.update(accelerations, encoders)
        step = self._tick * self.controller.period
        tick = self.controller.decide(step, accelerations, encoders, math.nan, math.nan)
        self.differences.append(decision.estimate[1] - tick.estimates[0][1])
        self._tick += 1
        return decision


def row(experiment: Experiment, worlds: int) -> list[str]:
    """An observer's row of the table."""
    host = experiment.run_many(worlds, keep_trajectory=False)
    runs = []
    with on_a_board(experiment.axis_controller()) as board:
        beside = Beside(board, experiment.axis_controller())
        for world in range(worlds):
            runs.append(run_on(experiment, beside, world, keep_trajectory=False))
    cells = [experiment.scenario.observer.kind, f"{np.sqrt(np.mean(np.square(beside.differences))):.1e}"]
    cells.append(f"{int(host.fell.sum())} / {sum(bool(run.fell[0]) for run in runs)}")
    for key, pattern in FIGURES.items():
        cells += _beside(pattern, host.values(key), np.array([run.values(key)[0] for run in runs]))
    return cells


def _beside(pattern: str, on_host: np.ndarray, on_board: np.ndarray) -> list[str]:
    """The host's mean and interval, the board's mean, and whether that lies within."""
    host, board = known_interval(on_host, positive=True), known_interval(on_board, positive=True)
    if host is None or board is None:
        return ["-", "-", "-"]
    within = host.low <= board.mean <= host.high
    figure = in_line([pattern.format(host.mean), *format_interval(pattern, host)])
    return [figure.replace("±", "+- "), pattern.format(board.mean), "yes" if within else "NO"]


def main() -> None:
    """Print the table, a row an observer as they come."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--observers", default=",".join(name for name in OBSERVERS if name != "mems_fused"))
    parser.add_argument("--worlds", type=int, default=20)
    parser.add_argument("--scenario", default="push_recovery")
    of = parser.parse_args()
    headings = ["observer", "lockstep [rad/s]", "fell: host / board"]
    for what in ("error [rad/s]", "settles [s]"):
        headings += [f"{what}: host", "board", "within"]
    rows = []
    for name in of.observers.split(","):
        rows.append(row(prepare(load_scenario(of.scenario, [], name)), of.worlds))
        print(f"  {rows[-1]}", flush=True)
    print(markdown_table(headings, rows))


if __name__ == "__main__":
    main()
