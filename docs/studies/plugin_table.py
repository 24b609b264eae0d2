"""The plugin in MuJoCo's own loop against the native runner: how many numbers differ in any bit.

    python docs/studies/plugin_table.py [--parts rig,axes,worlds,robots] [--observers gyro_free,kalman] [--duration 15]

A program that calls nothing but mj_step stands beside a run of the native driver at every control tick: positions and
rates of all joints, the estimate, y1, y2, the measured acceleration, the command, the integrator, and the decision's
number. Numbers are compared as their 64 bits: -0 is not 0. One library serves the three integrators. About ten
minutes on a quiet core; the last line says how many numbers were compared, and how many differ.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from cmg_mj.observers import OBSERVERS
from cmg_mj.results.markdown import table
from tests.codegen.engine_plugin.made import SENSORS, Comparison, Made, compare, make, variant
from tests.codegen.engine_plugin.robots import ROBOTS, is_missing, write_robot

PARTS = ("rig", "axes", "worlds", "robots")
INTEGRATORS = ("RK4", "implicitfast", "Euler")
NOISES = ((0, 0), (0, 1), (0, 63), (1, 0), (12345678901, 7), (2**53, 2**53))
"""Seed and world."""
WORLDS_OF = ("gyro_free", "adaptive")


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


def headings(sensors: Sequence[str]) -> list[str]:
    """Print a heading a column of sensors x integrators."""
    return ["", *(f"{name}, {quality}" for quality in sensors for name in INTEGRATORS)]


def observers(count: Count, scenario: str, names: Sequence[str], duration: float) -> str:
    """Compare observers x sensors x integrators; where a rig falls, also on the true rate, on which it stands."""
    rows, fallen = [], []
    for name in names:
        row = [f"`{name}`"]
        for sensors, settings in SENSORS.items():
            settings = (f"duration_s={duration}", *settings)
            cells = count.cells(make(name, *settings, scenario=scenario), duration)
            row += cells
            if any("fell" in cell for cell in cells):
                standing = make(name, *settings, "controller.feedback=truth", scenario=scenario)
                fallen.append([f"`{name}`, {sensors}", *count.cells(standing, duration)])
        rows.append(row)
    result = table(headings(list(SENSORS)), rows)
    if fallen:
        result += f"\n\nWhat fell, on the true rate:\n\n{table(['', *INTEGRATORS], fallen)}"
    return result


def worlds(count: Count, duration: float) -> str:
    """Compare seeds x worlds, all with one library."""
    rows = []
    for scenario in ("push_recovery", "two_axes"):
        for observer in WORLDS_OF:
            for sensors in ("default", "all"):
                made = make(observer, f"duration_s={duration}", *SENSORS[sensors], scenario=scenario)
                cells = [count.cell(compare(made, seed, world), duration) for seed, world in NOISES]
                rows.append([f"{scenario}, `{observer}`, {sensors}", *cells])
    return table(["seed, world", *(f"{seed}, {world}" for seed, world in NOISES)], rows)


def robots(count: Count, duration: float) -> str:
    """Compare robots x sensors x integrators, with `gyro_free`."""
    rows = []
    for robot in ROBOTS:
        if is_missing(robot):
            print(f"{robot}: left out, gymnasium is not installed", file=sys.stderr)
            continue
        cells = []
        for settings in SENSORS.values():
            with tempfile.TemporaryDirectory() as folder:
                made = make("gyro_free", *settings, scenario=write_robot(robot, Path(folder), duration))
                cells += count.cells(made, duration)
        rows.append([robot, *cells])
    return table(headings(list(SENSORS)), rows)


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
