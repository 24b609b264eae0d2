"""This checkout against another: observers on one recorded run, the closed loop, the time of an update and of a run.

    python docs/studies/against.py OTHER_CHECKOUT [--python OTHER_PYTHON] [--worlds 20]

About six minutes of processor time.

A refactoring must leave the estimates on recorded signals as they were, to rounding. In the closed loop one last bit
becomes another count after some seconds, so there only means over worlds can be compared.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from cmg_mj import OBSERVERS, load_scenario, prepare
from cmg_mj.results.tables import markdown_table

HERE = Path(__file__).resolve().parents[2]

REPLAY = """
import sys, time
import numpy as np
import cmg_mj
from cmg_mj import OBSERVERS, Measurement, make_observer

signals, found, names = np.load(sys.argv[1]), {}, ("y1", "y2", "a", "u")
arguments = cmg_mj.prepare(cmg_mj.load_scenario("push_recovery")).design.constructor_arguments
floats = [signals[name][:, 0].tolist() for name in names]
arrays = [np.ascontiguousarray(signals[name][:300]) for name in names]
for kind in OBSERVERS:
    observer = make_observer(kind, *arguments)
    for name, (y1, y2, a, u), repeats in (("one", floats, 9), ("many", arrays, 5)):
        times = []
        for _ in range(repeats):
            state, estimates = observer.init(Measurement(y1[0], y2[0], a[0])), []
            start = time.perf_counter()
            for k in range(1, len(y1)):
                state, estimate = observer.step(state, Measurement(y1[k], y2[k], a[k]), u[k - 1])
                estimates.append(estimate)
            times.append((time.perf_counter() - start) / (len(y1) - 1) * 1e6)
        found[f"{kind}/{name}"] = np.array(estimates)
        found[f"{kind}/{name}_us"] = min(times)
np.savez(sys.argv[2], **found)
"""

COMPARE = """
import sys
from cmg_mj.cli import main
main(["compare", "push_recovery", "--observers", "all", "--worlds", sys.argv[1], "--out", "it", "--json"])
"""

COST = """
import sys, time
import cmg_mj
experiment = cmg_mj.prepare(cmg_mj.load_scenario("push_recovery", observer=sys.argv[1]))
experiment.run_many(2, keep_trajectory=False)
start = time.process_time()
result = experiment.run_many(256, keep_trajectory=False)
print(1e3 * (time.process_time() - start) / 256 / result.seconds)
"""
PAIRS = 3


def run(checkout: Path, python: str, code: str, *arguments: object) -> str:
    """Run code on a checkout's package."""
    environment = {**os.environ, "PYTHONPATH": str(checkout), "OPENBLAS_NUM_THREADS": "1"}
    command = [python, "-W", "ignore", "-c", code, *map(str, arguments)]
    with tempfile.TemporaryDirectory() as elsewhere:
        done = subprocess.run(command, cwd=elsewhere, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout


def recorded(path: Path) -> None:
    """Write the measurements and commands of 256 worlds of `push_recovery`."""
    trajectory = prepare(load_scenario("push_recovery")).run_many(256).trajectory
    assert trajectory is not None
    y1, y2, u = (trajectory[name] for name in ("y1_rad", "y2_rad", "u_rad_s"))
    np.savez(path, y1=y1, y2=y2, a=trajectory["acceleration_rad_s2"], u=u)


def largest(a: np.ndarray, b: np.ndarray) -> str:
    """The largest difference of the estimates, by the largest estimate."""
    if np.array_equal(a, b, equal_nan=True):
        return "bit for bit"
    return f"{np.nanmax(np.abs(a - b)) / np.nanmax(np.abs(a)):.1e}"


def main() -> None:
    """Print the three tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("other", type=Path)
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("--worlds", type=int, default=20)
    options = parser.parse_args()
    checkouts = {"before": (options.other.resolve(), options.python), "after": (HERE, sys.executable)}
    with tempfile.TemporaryDirectory() as folder:
        signals = Path(folder) / "signals.npz"
        recorded(signals)
        found = {}
        for name, (checkout, python) in checkouts.items():
            run(checkout, python, REPLAY, signals, Path(folder) / f"{name}.npz")
            found[name] = np.load(Path(folder) / f"{name}.npz")
        before, after = found["before"], found["after"]
        rows = []
        for kind in OBSERVERS:
            times = [f"{of[f'{kind}/{part}_us'].item():.1f}" for part in ("one", "many") for of in (before, after)]
            gaps = [largest(before[f"{kind}/{part}"], after[f"{kind}/{part}"]) for part in ("one", "many")]
            rows.append((f"`{kind}`", *gaps, *times))
    headings = ("observer", "estimates, one world", "256 worlds", "us before", "after", "256 worlds: before", "after")
    print(markdown_table(headings, rows, text_columns=3), "\n")

    keys = ("velocity_rms_error_rad_s", "tilt_rms_deg", "settle_time_s", "fell_fraction")
    means = {
        name: [row for row in json.loads(run(*at, COMPARE, options.worlds)) if row["observer"] in OBSERVERS]
        for name, at in checkouts.items()
    }  # later checkouts have rows of what observers are judged beside as well
    rows = [
        (f"`{old['observer']}`", *("-" if s[key] is None else f"{s[key]:.4f}" for key in keys for s in (old, new)))
        for old, new in zip(means["before"], means["after"], strict=True)
    ]
    print(markdown_table(("observer", *(f"{key} {name}" for key in keys for name in ("before", "after"))), rows), "\n")

    rows = []
    for kind in ("linear", "homogeneous", "adaptive"):
        pairs = [[float(run(*at, COST, kind)) for at in checkouts.values()] for _ in range(PAIRS)]
        ratio = statistics.median(new / old for old, new in pairs)
        rows.append(
            (f"`{kind}`", *(f"{statistics.median(times):.2f}" for times in zip(*pairs, strict=True)), f"{ratio:.2f}")
        )
    costs = (
        "processor time of a simulated world-second, 256 worlds [ms]: before",
        "after",
        f"ratio, median of {PAIRS} pairs",
    )
    print(markdown_table(("observer", *costs), rows))


if __name__ == "__main__":
    main()
