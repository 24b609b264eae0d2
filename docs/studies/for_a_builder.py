"""Which observer for which robot: README's table.

python docs/studies/for_a_builder.py [--worlds 20] (about two minutes on two quiet cores)

Errors are those of `cmg-mj compare push_recovery`: the same worlds and noise for every observer, each in its own loop.
How much bias a loop bears is `bias_limits.py`'s, under the same push. Instructions are those of `cmg-mj bench board`;
without the tools for that they are left out.
"""

import argparse

import numpy as np
from bias_limits import Case, limits

from cmg_mj import load_scenario, prepare
from cmg_mj.codegen.board.cost import cost_scenario, measure
from cmg_mj.errors import InputError
from cmg_mj.observers import OBSERVER_CLASSES, OBSERVERS, needs
from cmg_mj.results import markdown
from cmg_mj.results.baselines import GYROS, MEMS_FUSED, REFERENCES
from cmg_mj.results.intervals import format_interval, in_line, known_interval
from cmg_mj.results.result import Result
from cmg_mj.simulation.batched_observers import run_of, run_side_by_side

ERROR, PUSH_ERROR = "velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s"
WORDS = {"model": "model", "gimbals": "y2, u", "acceleration": "acceleration"}


def errors(result: Result, open_loop_observer: str | None = None) -> list[str]:
    """Error over the run and in the push window, with 95 % intervals."""
    cells = []
    for key in (ERROR, PUSH_ERROR):
        values = result.values(key, open_loop_observer)
        interval = known_interval(values, positive=True)
        figure = "-" if interval is None else f"{interval.mean:.4f}"
        cells.append(in_line([figure, *(format_interval("{:.4f}", interval) if interval else [])]))
    return cells


def bears(limit: np.ndarray) -> str:
    """The range of e in which it stands, to 1/16 degree, median over worlds."""
    below, above = np.median(limit, axis=1)
    return f"-{below:.2f} to {above:.2f}" if min(below, above) >= 0.0 else "falls at 0"


def instructions() -> dict[str, str]:
    """Of a whole update on the board, by observer."""
    try:
        figures = measure([prepare(cost_scenario(name)) for name in OBSERVERS], lambda share: None)["figures"]
    except InputError as error:
        print(f"no board: {error}")
        return {}
    return {row["observer"]: f"{row['update_instructions']:.0f}" for row in figures}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--worlds", type=int, default=20)
    worlds = parser.parse_args().worlds
    counted = instructions()
    runs = [run_of(prepare(load_scenario("push_recovery", [], name)), worlds) for name in OBSERVERS]
    results = dict(zip(OBSERVERS, run_side_by_side(runs, keep_trajectory=False), strict=True))
    borne = dict(zip(OBSERVERS, limits([Case(name) for name in OBSERVERS]), strict=True))
    rows = []
    for name, result in results.items():
        asked = [WORDS[need] for need in needs(OBSERVER_CLASSES.find(name))]
        fell = f"{100.0 * result.fell.mean():.0f}%"
        rows.append(
            [f"`{name}`", *errors(result), fell, bears(borne[name]), counted.get(name, "-"), ", ".join(["y1", *asked])]
        )
    stood = {name: mean for name, r in results.items() if r.stood.all() and (mean := r.mean(ERROR)) is not None}
    best = min(stood, key=stood.__getitem__)
    asked = dict.fromkeys(GYROS, "a gyro") | {MEMS_FUSED: "a gyro, y1"}
    rows += [[f"`{name}`", *errors(results[best], name), "-", "-", "-", asked.get(name, "-")] for name in REFERENCES]
    headings = ["observer", "error [rad/s]", "in push window", "fell", "stands at e [deg]", "instructions", "needs"]
    print(f"{worlds} worlds; the last rows are open loop, in the loop of {best}\n")
    print(markdown.table(headings, rows))


if __name__ == "__main__":
    main()
