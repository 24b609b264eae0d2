"""The plugin in MuJoCo's own loop against the native runner: how many numbers differ in any bit.

    python docs/studies/plugin_table.py [--parts rig,axes,worlds,robots] [--observers gyro_free,kalman] [--duration 15]

A program that calls nothing but mj_step stands beside a run of the native driver at every control tick. Compared are
positions and rates of all joints, the estimate, y1, y2, the measured acceleration, the command, the integrator, and the
decision's number. Numbers are compared as their 64 bits: -0 is not 0. One library serves the three integrators. About
ten minutes on a quiet core; the last line says how many numbers were compared, and how many differ.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[2]))

from cmg_mj.features.plugin.driver import set_world
from cmg_mj.observers import OBSERVERS
from cmg_mj.results.tables import markdown_table
from tests.features.plugin.made import SENSORS, Made, bits, make, pairs, run, variant
from tests.features.plugin.robots import ROBOTS, is_missing, write_robot

PARTS = ("rig", "axes", "worlds", "robots")
INTEGRATORS = ("RK4", "implicitfast", "Euler")
NOISES = ((0, 0), (0, 1), (0, 63), (1, 0), (12345678901, 7), (2**53, 2**53))
"""Seed and world."""
WORLDS_OF = ("gyro_free", "adaptive")


class Comparison(NamedTuple):
    """Numbers of a run beside the runner's.

    Attributes:
        differing: How many differ in any bit.
        numbers: How many there are.
        seconds: Until when the run went [s].
    """

    differing: int
    numbers: int
    seconds: float


def compare(made: Made, seed: int | None = None, world: int = 0) -> Comparison:
    """Compare every number with the runner's.

    Args:
        made: The plugin.
        seed: Seed of the noise; None: the scenario's.
        world: World whose noise it is.
    """
    experiment, data = made.experiment, made.start()
    if seed is not None:
        experiment = experiment.with_settings({"seed": seed})
    set_world(made.model, data, experiment.scenario.seed, world)
    trajectory = experiment.run(world=world).trajectory
    assert trajectory is not None
    rows = run(made, data, len(trajectory))
    both = list(pairs(made, rows, trajectory))
    differing = sum(int((bits(a) != bits(b)).sum()) for _, a, b in both)
    period = experiment.controller().period * experiment.plant.timestep
    return Comparison(differing, sum(b.size for _, _, b in both), len(trajectory) * period)


class Count:
    """Adds up what was compared.

    Attributes:
        runs: How many runs.
        numbers: How many numbers of them.
        differing: How many of these differ.
    """

    def __init__(self) -> None:
        self.runs = self.numbers = self.differing = 0

    def cell(self, comparison: Comparison, duration: float) -> str:
        """Print how many numbers of a run differ, and when it ended, if that was before its time."""
        self.runs += 1
        self.numbers += comparison.numbers
        self.differing += comparison.differing
        until = f", fell at {comparison.seconds:.2f} s" if comparison.seconds < duration else ""
        return f"{comparison.differing}{until}"

    def cells(self, made: Made, duration: float) -> list[str]:
        """Compare a rig under every integrator."""
        variants = [variant(made, {"plant.integrator": name}) for name in INTEGRATORS]
        return [self.cell(compare(rig), duration) for rig in variants]


TRUE_RATE = "controller.feedback=truth"


def tables(count: Count, rigs: Mapping[str, Callable[..., Made]], duration: float) -> str:
    """Compare rigs x sensors x integrators; where a rig falls, also on the true rate."""
    rows, fallen = [], []
    for name, make_rig in rigs.items():
        row = [name]
        for sensors, settings in SENSORS.items():
            cells = count.cells(make_rig(*settings), duration)
            row += cells
            if any("fell" in cell for cell in cells):
                fallen.append([f"{name}, {sensors}", *count.cells(make_rig(*settings, TRUE_RATE), duration)])
        rows.append(row)
    result = markdown_table(["", *(f"{name}, {sensors}" for sensors in SENSORS for name in INTEGRATORS)], rows)
    if fallen:
        result += f"\n\nWhat fell, on the true rate:\n\n{markdown_table(['', *INTEGRATORS], fallen)}"
    return result


def observers(count: Count, scenario: str, names: Sequence[str], duration: float) -> str:
    """Compare observers on a rig."""
    rigs = {f"`{name}`": partial(make, name, f"duration_s={duration}", scenario=scenario) for name in names}
    return tables(count, rigs, duration)


def worlds(count: Count, duration: float) -> str:
    """Compare seeds x worlds, all with one library."""
    rows = []
    for scenario in ("push_recovery", "two_axes"):
        for observer in WORLDS_OF:
            for sensors in ("default", "all"):
                made = make(observer, f"duration_s={duration}", *SENSORS[sensors], scenario=scenario)
                cells = [count.cell(compare(made, seed, world), duration) for seed, world in NOISES]
                rows.append([f"{scenario}, `{observer}`, {sensors}", *cells])
    return markdown_table(["seed, world", *(f"{seed}, {world}" for seed, world in NOISES)], rows)


def robots(count: Count, duration: float) -> str:
    """Compare robots, with `gyro_free`."""
    rigs = {}
    with tempfile.TemporaryDirectory() as place:
        for robot in ROBOTS:
            if is_missing(robot):
                print(f"{robot}: left out, gymnasium is not installed", file=sys.stderr)
                continue
            folder = Path(place) / robot
            folder.mkdir()
            rigs[robot] = partial(make, "gyro_free", scenario=write_robot(robot, folder, duration))
        return tables(count, rigs, duration)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--parts", default=",".join(PARTS))
    parser.add_argument("--observers", default=",".join(OBSERVERS))
    parser.add_argument("--duration", type=float, default=15.0)
    of = parser.parse_args()
    names, count = of.observers.split(","), Count()
    for part in of.parts.split(","):
        title, compared = {
            "rig": ("push_recovery", lambda: observers(count, "push_recovery", names, of.duration)),
            "axes": ("two_axes", lambda: observers(count, "two_axes", names, of.duration)),
            "worlds": ("Seeds and worlds", lambda: worlds(count, of.duration)),
            "robots": ("Robots, gyro_free", lambda: robots(count, of.duration)),
        }[part]
        print(f"{title}, {of.duration:g} s:\n\n{compared()}\n", flush=True)
    print(f"{count.runs} runs, {count.numbers:,} numbers: {count.differing} differ")


if __name__ == "__main__":
    main()
