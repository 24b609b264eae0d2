"""The worth of each number of `free_pivot`, on worlds that it was tuned on: the table of docs/assumptions.md.

    python docs/studies/free_pivot_tuning.py [--worlds 32] [--falls 300] [--jobs 2] [--seed 60000]

About three minutes of processor time. Cells are those of free_pivot_grid.py. Open loop, the law fed the true rate: the
velocity RMS error over that of `gyro_free` on the same worlds. In the loop, in the cell that fells most: falls. With 0
worlds a part is not run.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

import numpy as np
from free_pivot_grid import BASE, ERROR, OURS, Cell, experiment, grid, in_loop, replayed

from cmg_mj.observers import make_observer
from cmg_mj.results.tables import markdown_table

CELLS = {
    "outer 1 deg off": "1 deg off",
    "pivot 0.2 m/s2 to 5 Hz": "0.2 m/s2 to 5 Hz",
    "pivot 0.5 m/s2 to 1 Hz": "0.5 m/s2 to 1 Hz",
    "pivot 0.5 m/s2 to 5 Hz": "to 5 Hz",
    "pivot 0.5 m/s2 to 15 Hz": "to 15 Hz",
    "pivot 0.5 m/s2 sine, 10 Hz": "sine, 10 Hz",
}
"""Cells of the grid, with the headings of their columns."""
FALLS = "pivot 0.5 m/s2 to 1 Hz"
VARIANTS: list[dict[str, float]] = [
    {},
    {"gate": 1e9},
    {"covariance_boost": 0.0},
    {"rise_factor": 0.0},
    {"innovation_weight": 0.0},
    {"learn_s": 0.5},
    {"pivot_s": 1.0},
    {"odds_alike": 1e6},  # the fast filter alone
    {"slow_hz": 3.0},
]


def ratios(variants: list[dict[str, float]], worlds: int, cell: Cell, seed: int) -> list[float]:
    """Errors over those of `gyro_free`, a variant each."""
    setup = experiment(cell, BASE, seed, 'controller.feedback="truth"')
    result = setup.run_many(worlds)
    t = result.trajectory
    assert t is not None
    rate, y1, a = (t[name][:, result.stood] for name in ("x2_rad_s", "y1_rad", "acceleration_rad_s2"))
    base = result.values(ERROR)[result.stood].mean()
    estimates = (
        replayed(make_observer(OURS, *setup.design.constructor_arguments, **variant), y1, a) for variant in variants
    )
    return [float(np.sqrt(np.square(estimate - rate).mean(axis=0)).mean() / base) for estimate in estimates]


def falls(cell: Cell, seed: int, worlds: int, variant: dict[str, float]) -> int:
    """Worlds that fall in loops of their own."""
    settings = tuple(f"observer.{name}={value!r}" for name, value in variant.items())
    return in_loop(cell._replace(loop=(*cell.loop, *settings)), OURS, seed, worlds)[0]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=32)
    parser.add_argument("--falls", type=int, default=300)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=60_000)
    options = parser.parse_args()
    numbered = [(cell, options.seed + 1000 * i) for i, cell in enumerate(grid()) if cell.name in CELLS]
    rows = [
        [", ".join(f"`{name}` = {value:g}" for name, value in variant.items()) or "as it is"] for variant in VARIANTS
    ]
    headings = [""]
    with ProcessPoolExecutor(options.jobs, get_context("spawn")) as pool:
        if options.worlds:
            cells, seeds = zip(*numbered, strict=True)
            for column in pool.map(partial(ratios, VARIANTS, options.worlds), cells, seeds):
                for row, ratio in zip(rows, column, strict=True):
                    row.append(f"{ratio:.2f}")
            headings += [CELLS[cell.name] for cell in cells]
        if options.falls:
            ((cell, seed),) = [(cell, seed) for cell, seed in numbered if cell.name == FALLS]
            counts = pool.map(partial(falls, cell, seed, options.falls), VARIANTS)
            for row, count in zip(rows, counts, strict=True):
                row.append(str(count))
            headings.append(f"falls of {options.falls}")
    print(markdown_table(headings, rows))


if __name__ == "__main__":
    main()
