"""The worth of `free_pivot` and every other observer on rigs that are not at rest: one factor at a time.

    python docs/studies/free_pivot_grid.py [--worlds 100] [--parts open,loop] [--jobs 2] [--only pivot] [--seed 130000]
        [--keep FOLDER]

About five minutes a part on two quiet cores.

push_recovery (400 ug/rtHz, e = 0.5 deg, a push of 1 N m for 0.1 s). Every cell differs from it in one thing. Noise of
the pivot has its RMS and its corner; a sine has the same RMS, so that its amplitude is 1.41 times that. The parts:

- open: the law is fed the true rate, all observers run open loop on the same worlds. Means of the velocity RMS error
  over the run; `free_pivot` by the best other observer (zero, gyros and floors do not count), and by `gyro_free`;
  start-up, the RMS error from 1 to 1.5 s over that from 8 s on; the bound; "told"; the bars, and whether they are met.
- loop: each in a loop of its own: falls, and errors. If both `free_pivot` and `gyro_free` fall in some world, every
  other observer runs too. Fisher's exact test (one-sided: more falls) compares it with the one that falls least. A
  frame that bends is a mast with a fifth of the inertia; its loop has a notch at the mode (`controller.notch_hz`).

The bound is the error of the stationary Kalman filter that knows what no observer is told: that the accelerometers
have no offset, how strong the pivot's motion is, and its corner (a second-order Butterworth low-pass) or the frequency
of its sine (nothing is then left of it). Vibration counts as so much more white noise. Where the pivot rests and
nothing shakes it is `floor_accel`. A bend is not in it.

"Early" is the error from 1 to 1.5 s of the same filter from the first sample on, if it does not know the
accelerometers' offset: it expects what `gyro_free` expects (`bias_start`, `rate_start`). Where that exceeds 1.2 times
the error that `free_pivot` has from 8 s on, no filter that has to cope with such an offset can keep its bar.

"told" is `free_pivot` that is told the pivot's RMS and does not learn it: its error and its start-up. How much of a
slow start-up is due to learning, and how much to the accelerometers' unknown offset, is to be seen there.

With `--keep` every cell is written down once it is done, and another call goes on where one was stopped.

`free_pivot` was tuned on other seeds, 40000 to 94000 (docs/assumptions.md).
"""

from __future__ import annotations

import argparse
import hashlib
import inspect
import json
import math
import re
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.core.types import Measurement, Observer
from cmg_mj.observers import OBSERVERS, make_observer
from cmg_mj.observers.free_pivot import FreePivot
from cmg_mj.observers.gyro_free import GyroFree
from cmg_mj.results.tables import markdown_table
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario

Row = list[list[str]]
SEED = 130_000
OURS, BASE = "free_pivot", "gyro_free"
ERROR = "velocity_rms_error_rad_s"
BEST_BAR, START_BAR, STRONG_BAR = 1.2, 1.2, 0.35
START_S, SETTLED_S = (1.0, 1.5), 8.0
SIGNIFICANT = 0.05
ACCELEROMETER = "sensors.accelerometer."


class Cell(NamedTuple):
    """One line of the tables."""

    name: str
    settings: tuple[str, ...] = ()
    motion: tuple[str, float, float] | None = None
    """Kind of the pivot's motion, its RMS [m/s^2], its corner or frequency [Hz]."""
    reported: bool = False
    """No bar: printed beside the bound alone."""
    loop: tuple[str, ...] = ()
    """More settings of the loop on its own estimate."""


def pivot(kind: str, rms: float, frequency: float) -> Cell:
    """A pivot that moves across the axis."""
    if kind == "noise":
        entry = f'{{kind="noise", acceleration_m_s2={rms!r}, corner_hz={frequency!r}}}'
    else:
        entry = f'{{kind="sine", acceleration_m_s2={math.sqrt(2.0) * rms!r}, frequency_hz={frequency!r}}}'
    word = "to" if kind == "noise" else "sine,"
    return Cell(f"pivot {rms:g} m/s2 {word} {frequency:g} Hz", (f"pivot=[{entry}]",), (kind, rms, frequency))


def grid() -> list[Cell]:
    """Every cell."""
    cells = [Cell(f"noise {n} ug/rtHz", (f"{ACCELEROMETER}noise_density_ug_rthz={n}",)) for n in (200, 400, 800)]
    cells += [Cell(f"e {e:g} deg", (f"plant.equilibrium_bias_deg={e}",)) for e in (0.0, 0.5, 1.5)]
    places = ("inner", (1.0, 0.0)), ("outer", (0.0, 1.0))
    for field, size, unit in (("bias_mg", 5.0, "5 mg off"), ("misalignment_deg", 1.0, "1 deg off")):
        cells += [
            Cell(f"{where} {unit}", (f"{ACCELEROMETER}{field}={[size * part for part in parts]}",))
            for where, parts in places
        ]
    for mg in (4, 20, 100):
        cells.append(Cell(f"vibration {mg} mg", (f"{ACCELEROMETER}vibration_mg={mg}",), reported=mg > 4))
    for rms in (0.05, 0.2, 0.5):
        cells += [pivot("noise", rms, corner) for corner in (1.0, 5.0, 15.0)]
        cells += [pivot("sine", rms, frequency) for frequency in (1.0, 3.0, 10.0)]
    mast = "bend.beyond=sensors", "bend.share=0.2"
    for hz in (10.0, 20.0, 40.0):
        settings = (f"bend.frequency_hz={hz}", *mast)
        cells.append(Cell(f"bend of {hz:g} Hz", settings, loop=(f"controller.notch_hz={hz}",)))
    return cells


def experiment(cell: Cell, observer: str, seed: int, *more: str) -> Experiment:
    """Push recovery in a cell."""
    return prepare(load_scenario("push_recovery", [f"seed={seed}", *more, *cell.settings], observer))


class Matched(NamedTuple):
    """The Kalman filter that knows the pivot's motion but not its course."""

    error: float
    """Stationary, without an offset of the accelerometers [rad/s]."""
    early: float
    """From 1 to 1.5 s, with an offset that it does not know [rad/s]."""


def matched_bound(
    noise: MeasurementNoise,
    dt: float,
    motion: tuple[str, float, float] | None,
    gravity: float,
    *,
    offset: float,
    rate: float,
) -> Matched:
    """Compute the errors of the filter that is told all but the course of the motion.

    States are x1, x2, this sample's n (`acceleration_floor` has their equations), b, and the pivot's share of y1 with
    its rate: the output of a low-pass of second order that white noise drives, or an oscillation, sampled exactly.
    `offset` and `rate` are the standard deviations of b [rad/s^2] and x2 [rad/s] at the start.
    """
    from scipy.linalg import expm, solve_discrete_are

    a, c = noise.acceleration * dt * dt / noise.tilt, noise.correlation
    F, P = np.zeros((6, 6)), np.zeros((6, 6))
    F[:4, :4] = [[1.0, 1.0, -a / 3.0, -a / 2.0], [0.0, 1.0, -a / 2.0, -a], [0.0] * 4, [0.0, 0.0, 0.0, 1.0]]
    gain = np.array([-a / 6.0, -a / 2.0, 1.0, 0.0, 0.0, 0.0])
    Q = np.outer(gain, gain)
    P[:4, :4] = np.diag(np.square([1.0 / noise.tilt, rate * dt / noise.tilt, 1.0, offset / noise.acceleration]))
    F[4:, 4:] = 0.5 * np.eye(2)  # if the pivot rests, something stable that nothing drives
    if motion is not None:
        kind, rms, frequency = motion
        w = 2.0 * math.pi * frequency * dt
        A = np.array([[0.0, 1.0], [-w * w, -math.sqrt(2.0) * w if kind == "noise" else 0.0]])
        F[4:, 4:] = phi = expm(A)
        P[4:, 4:] = stationary = np.diag([1.0, w * w]) * (rms / gravity / noise.tilt) ** 2
        Q[4:, 4:] = stationary - phi @ stationary @ phi.T  # nothing drives an oscillation
    C, R = np.array([1.0, 0.0, c, 0.0, 1.0, 0.0]), 1.0 - c * c
    variances = []
    for _ in range(round(START_S[1] / dt)):
        K = P @ C / (C @ P @ C + R)
        corrected = np.eye(6) - np.outer(K, C)
        P = corrected @ P @ corrected.T + R * np.outer(K, K)
        variances.append(P[1, 1])
        P = F @ P @ F.T + Q
    early = np.mean([variances[round(START_S[0] / dt) : round(START_S[1] / dt)]])
    known = [0, 1, 2, 4, 5] if motion is not None and motion[0] == "noise" else [0, 1, 2]
    part = np.ix_(known, known)
    P, C = solve_discrete_are(F[part].T, C[known, None], Q[part], np.array([[R]])), C[known]
    settled = P[1, 1] - (P[1] @ C) ** 2 / (C @ P @ C + R)
    return Matched(math.sqrt(settled) * noise.tilt / dt, math.sqrt(early) * noise.tilt / dt)


class OpenLoop(NamedTuple):
    """A cell's errors with the law fed the true rate."""

    errors: dict[str, np.ndarray]
    """Observer, or zero -> velocity RMS error of every world that stood [rad/s]."""
    start: dict[str, float]
    """Observer -> start-up error over the settled one."""
    settled: float
    """Error of `free_pivot` from 8 s on [rad/s]."""
    bound: Matched
    told: tuple[float, float]
    """Error [rad/s] and start-up of `free_pivot` that is told the pivot's RMS."""


def open_loop(cell: Cell, seed: int, worlds: int) -> OpenLoop:
    """Run a cell, all observers on the same worlds."""
    feedback = ('controller.feedback="truth"', f"open_loop_observers={[name for name in OBSERVERS if name != BASE]}")
    setup = experiment(cell, BASE, seed, *feedback)
    result = setup.run_many(worlds)
    names = [*OBSERVERS, "zero"]
    errors = {name: result.values(ERROR, None if name == BASE else name)[result.stood] for name in names}
    t = result.trajectory
    assert t is not None
    rate, y1, a = (t[name][:, result.stood] for name in ("x2_rad_s", "y1_rad", "acceleration_rad_s2"))
    dt, model, noise = setup.design.constructor_arguments
    gravity = setup.plant.gravity
    time = dt * np.arange(len(rate))

    def rms(estimate: np.ndarray, since: float, until: float = math.inf) -> float:
        return float(np.sqrt(np.square(estimate - rate)[(time >= since) & (time < until)].mean()))

    def start_up(estimate: np.ndarray) -> float:
        return rms(estimate, *START_S) / rms(estimate, SETTLED_S)

    settled = rms(t[f"estimate/{OURS}/x2_rad_s"][:, result.stood], SETTLED_S)
    start = {name: start_up(t[f"estimate/{name}/x2_rad_s"][:, result.stood]) for name in (OURS, BASE)}
    sigma = cell.motion[1] / gravity if cell.motion else 0.0
    told = {"pivot_start": sigma, "pivot_floor": sigma, "pivot_s": 1e9, "learn_s": 1e9}
    estimates = replayed(make_observer(OURS, dt, model, noise, **told), y1, a)
    by_told = float(np.sqrt(np.square(estimates - rate).mean(axis=0)).mean()), start_up(estimates)
    vibration = setup.scenario.sensors.accelerometer.vibration_mg
    if vibration:
        sigma = 1e-3 * vibration * gravity
        noise = with_white(noise, setup.plant.pair_tilt.noise(sigma, gravity))
    start_at = {"offset": GyroFree.bias_start, "rate": GyroFree.rate_start}
    bound = matched_bound(noise, dt, cell.motion, gravity, **start_at)
    return OpenLoop(errors, start, settled, bound, by_told)


def replayed(observer: Observer, y1: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Rates that an observer of y1 and its acceleration estimates, (n_ticks, n_worlds)."""
    state, rates = observer.init(Measurement(y1[0], 0.0 * y1[0], acceleration[0])), [0.0 * y1[0]]
    for y in zip(y1[1:], acceleration[1:], strict=True):
        state, estimate = observer.step(state, Measurement(y[0], 0.0 * y[0], y[1]), 0.0)
        rates.append(estimate.x2)
    return np.array(rates)


def with_white(noise: MeasurementNoise, more: MeasurementNoise) -> MeasurementNoise:
    """Add the variances of two noises of the same correlation."""
    both = (math.hypot(noise.tilt, more.tilt), math.hypot(noise.acceleration, more.acceleration))
    return MeasurementNoise(*both, noise.correlation, noise.gimbal)


def best_other(errors: dict[str, np.ndarray]) -> str:
    """The observer of the least mean error, but for ours."""
    return min((float(errors[name].mean()), name) for name in OBSERVERS if name != OURS)[1]


def open_rows(cell: Cell, seed: int, worlds: int) -> list[list[str]]:
    """The row of the verdicts, and that of all observers' errors."""
    run = open_loop(cell, seed, worlds)
    means = {name: 1e3 * float(values.mean()) for name, values in run.errors.items()}
    best = best_other(run.errors)
    by_best, by_base = means[OURS] / means[best], means[OURS] / means[BASE]
    misses = []
    if by_best > BEST_BAR:
        misses.append(f"{by_best:.2f} > {BEST_BAR:g} of `{best}`")
    if cell.motion is not None:
        limit = STRONG_BAR if cell.motion == ("noise", 0.5, 5.0) else 1.0
        if by_base > limit:
            misses.append(f"{by_base:.2f} > {limit:g} of `{BASE}`")
    if run.start[OURS] > START_BAR:
        forbidden = ", forbidden by the bound" if run.bound.early > START_BAR * run.settled else ""
        misses.append(f"start-up {run.start[OURS]:.2f} > {START_BAR:g}{forbidden}")
    verdict = ("reported: " if cell.reported else "") + ("; ".join(misses) if misses else "met")
    row = [cell.name, f"{means['zero']:.1f}", f"{means[BASE]:.1f}", f"{means[OURS]:.1f}", f"`{best}`", f"{by_best:.2f}"]
    row += [f"{by_base:.2f}", f"{1e3 * run.bound.error:.1f}"]
    row += [f"{1e3 * run.bound.early:.1f}", f"{1e3 * START_BAR * run.settled:.1f}"]
    row += [*(f"{run.start[name]:.2f}" for name in (OURS, BASE))]
    row += [f"{1e3 * run.told[0]:.1f}", f"{run.told[1]:.2f}", verdict]
    return [row, [cell.name, *(f"{means[name]:.1f}" for name in [*OBSERVERS, "zero"])]]


def read_or_compute(work: Callable[[Cell, int, int], Row], folder: str, cell: Cell, seed: int, worlds: int) -> Row:
    """A cell's rows, computed unless they are in the folder already, of this very cell and observer."""
    identity = hashlib.sha256(f"{cell} {inspect.getsource(FreePivot)}".encode()).hexdigest()[:8]
    name = re.sub(r"[^a-z0-9.]+", "_", f"{work.__name__} {cell.name} {seed} {worlds} {identity}".lower())
    file = Path(folder, f"{name}.json") if folder else None
    if file is not None and file.exists():
        return json.loads(file.read_text(encoding="utf-8"))
    row = work(cell, seed, worlds)
    if file is not None:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(row), encoding="utf-8")
    return row


def in_loop(cell: Cell, observer: str, seed: int, worlds: int) -> tuple[int, float | None]:
    """Falls and the mean error of an observer in its own loop [rad/s]."""
    result = experiment(cell, observer, seed, *cell.loop).run_many(worlds, keep_trajectory=False)
    return int((~result.stood).sum()), result.mean(ERROR)


def more_falls(ours: int, others: int, worlds: int) -> float:
    """Fisher's exact test, one-sided: how likely so many more falls are by chance."""
    from scipy.stats import hypergeom

    return float(hypergeom.sf(ours - 1, 2 * worlds, ours + others, worlds))


def loop_rows(cell: Cell, seed: int, worlds: int) -> list[list[str]]:
    """The row of a cell with observers in loops of their own."""
    runs = {name: in_loop(cell, name, seed, worlds) for name in (OURS, BASE)}
    fell = runs[OURS][0]
    if fell and runs[BASE][0]:  # otherwise none can fall less
        runs |= {name: in_loop(cell, name, seed, worlds) for name in OBSERVERS if name not in runs}
    rival = min((runs[name][0], name) for name in runs if name != OURS)[1]
    p = more_falls(fell, runs[rival][0], worlds)
    errors = ["-" if runs[name][1] is None else f"{1e3 * float(runs[name][1] or 0.0):.1f}" for name in (OURS, BASE)]
    least = f"`{rival}` {runs[rival][0]}" if fell else "none can be fewer"
    verdict = "met" if p > SIGNIFICANT else "more falls"
    row = [cell.name, str(fell), str(runs[BASE][0]), least, f"{p:.2g}", *errors]
    return [[*row, f"reported: {verdict}" if cell.reported else verdict]]


def numbered(only: str) -> list[tuple[int, Cell]]:
    """The cells whose names contain a word, with the numbers that their seeds follow."""
    return [(i, cell) for i, cell in enumerate(grid()) if only in cell.name]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=100)
    parser.add_argument("--parts", default="open,loop")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", default="", help="only cells whose name contains this")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--keep", default="", metavar="FOLDER")
    options = parser.parse_args(arguments)
    cells = numbered(options.only)
    seeds = [options.seed + 1000 * i for i, _ in cells]
    chosen, counts = [cell for _, cell in cells], [options.worlds] * len(cells)
    with ProcessPoolExecutor(options.jobs, get_context("spawn")) as pool:
        if "open" in options.parts:
            work = partial(read_or_compute, open_rows, options.keep)
            rows = list(pool.map(work, chosen, seeds, counts))
            print(f"\nOpen loop, the law fed the true rate, {options.worlds} worlds [1e-3 rad/s]:\n")
            headings = ["cell", "zero", f"`{BASE}`", f"`{OURS}`", "best other", "by it", f"by `{BASE}`", "bound"]
            headings += [
                "its early",
                f"{START_BAR:g} x settled",
                "start-up",
                f"of `{BASE}`",
                "told",
                "its start-up",
                "bars",
            ]
            print(markdown_table(headings, [row for row, _ in rows]))
            print("\nAll observers, the same worlds [1e-3 rad/s]:\n")
            print(
                markdown_table(["cell", *(f"`{name}`" for name in OBSERVERS), "`zero`"], [row for _, row in rows]),
                flush=True,
            )
        if "loop" in options.parts:
            work = partial(read_or_compute, loop_rows, options.keep)
            rows = list(pool.map(work, chosen, seeds, counts))
            print(f"\nEach in its own loop, {options.worlds} worlds; errors of the worlds that stood [1e-3 rad/s]:\n")
            headings = ["cell", f"`{OURS}` fell", f"`{BASE}` fell", "fewest falls of another", "p", f"`{OURS}`"]
            print(markdown_table([*headings, f"`{BASE}`", "bar"], [row for (row,) in rows]))


if __name__ == "__main__":
    main()
