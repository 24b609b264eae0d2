"""Every observer on push_recovery: the table of docs/which_observer.md.

python docs/studies/for_a_builder.py [--worlds 20] [--observers linear,gyro_free]

About two minutes on two quiet cores, eight on busy ones; a bar shows the progress.

Errors are those of `cmg-mj compare push_recovery`: the same worlds and noise for every observer, each in its own loop.
The order of the observers depends on the push; one column has the errors at a quarter of it.
The bias range that a loop tolerates is `bias_limits.py`'s, under the same push. Instructions are those of
`benchmarks/board.py`; without the programs that it needs, their column is empty. Estimates that close no loop are
judged in the loop of `gyro_free`.
"""

import argparse
import runpy
import sys
from pathlib import Path

import numpy as np
from bias_limits import Case, limits
from rich.console import Console
from rich.progress import track

from cmg_mj import load_scenario, prepare
from cmg_mj.core.errors import InputError
from cmg_mj.observers import OBSERVER_CLASSES, OBSERVERS, needs
from cmg_mj.results.baselines import BASELINES, GYROS, MEMS_FUSED
from cmg_mj.results.intervals import format_interval, in_line, known_interval
from cmg_mj.results.result import Result
from cmg_mj.results.tables import markdown_table

ERROR, PUSH_ERROR = "velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s"
WORDS = {"model": "model", "gimbals": "y2, u", "acceleration": "acceleration", "gyro": "a gyro"}
LOOP_OF_BASELINES = "gyro_free"
HEADINGS = (
    "observer",
    "error [rad/s]",
    "error in push window [rad/s]",
    "both, 0.25 N m [rad/s]",
    "worlds that fell",
    "bias range it tolerates [deg]",
    "instructions an update",
    "needs",
)


def errors(result: Result, open_loop_observer: str | None = None) -> list[str]:
    """Return the errors over the run and in the push window, with 95 % intervals."""
    cells = []
    for key in (ERROR, PUSH_ERROR):
        values = result.values(key, open_loop_observer)
        interval = known_interval(values, positive=True)
        figure = "-" if interval is None else f"{interval.mean:.4f}"
        cells.append(in_line([figure, *(format_interval("{:.4f}", interval) if interval else [])]))
    return cells


def run(observer: str, worlds: int, *settings: str) -> Result:
    """Close the loop on an observer."""
    return prepare(load_scenario("push_recovery", settings, observer)).run_many(worlds, keep_trajectory=False)


def means(result: Result, open_loop_observer: str | None = None) -> str:
    """Return the mean errors over the run and in the push window."""
    found = (result.mean(key, open_loop_observer) for key in (ERROR, PUSH_ERROR))
    return "/".join("-" if mean is None else f"{mean:.4f}" for mean in found)


def tolerated(limit: np.ndarray) -> str:
    """Return the range of e in which the rig stands, to 1/16 degree, the median over worlds."""
    below, above = np.median(limit, axis=1)
    return f"-{below:.2f} to {above:.2f}" if min(below, above) >= 0.0 else "falls at 0"


def instructions(observer: str) -> str:
    """Return the instructions of a whole update on the board, or a dash."""
    if observer == MEMS_FUSED:
        return "-"
    measure = runpy.run_path(str(Path(__file__).parents[2] / "benchmarks" / "board.py"))["measure"]
    try:
        (figures,) = measure([observer])["figures"]
    except InputError as error:
        print(f"no instructions of {observer}: {error}", file=sys.stderr)
        return "-"
    return f"{figures['update_instructions']:.0f}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=20)
    parser.add_argument("--observers", default=",".join(OBSERVERS), help="names, separated by commas")
    options = parser.parse_args()
    worlds, names = options.worlds, list(dict.fromkeys([*options.observers.split(","), LOOP_OF_BASELINES]))
    rows, results = [], {}
    for name in track(names, "observers", console=Console(stderr=True)):
        result = run(name, worlds)
        gentle = run(name, worlds, "push.0.torque_n_m=0.25")
        results[name] = result, gentle
        asked = [WORDS[need] for need in needs(OBSERVER_CLASSES.find(name))]
        fell = f"{100.0 * result.fell.mean():.0f}%"
        (limit,) = limits([Case(name)])
        rows.append(
            [
                f"`{name}`",
                *errors(result),
                means(gentle),
                fell,
                tolerated(limit),
                instructions(name),
                ", ".join(["y1", *asked]),
            ]
        )
    asked = dict.fromkeys(GYROS, "a gyro") | {MEMS_FUSED: "a gyro, y1"}
    loop, gentle = results[LOOP_OF_BASELINES]
    rows += [
        [f"`{name}`", *errors(loop, name), means(gentle, name), "-", "-", "-", asked.get(name, "-")]
        for name in BASELINES
        if name not in names
    ]
    print(f"{worlds} worlds; baselines are open loop, in the loop of {LOOP_OF_BASELINES}\n")
    print(markdown_table(list(HEADINGS), rows))


if __name__ == "__main__":
    main()
