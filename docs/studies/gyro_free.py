"""The worth of the angular acceleration: `gyro_free` and `kalman` beside the ten observers of y1, y2 and u.

    python docs/studies/gyro_free.py [--worlds 100] [--noise 200,400,800] [--e 0,0.5,1,1.5] [--parts bars,...]

About eleven minutes of processor time with 10 worlds; tables of the docs have 100.

push_recovery with every observer in a loop of its own; world i has the same noise for all, so differences are taken
world by world. Means over the worlds; intervals are of 95 %. The parts:

- bars: `gyro_free` by the best of the ten that stood in every world of the cell, over the whole run and in the push
  window, against the bars that were set before; by the floor of its signals; with an offset of 5 mg on either
  accelerometer by its own error without.
- kalman: `kalman` less (9), (10) and (11), with its defaults and tuned at each noise: the torque's noises that have
  the least error in the loop on seeds of their own, over the whole run and in the push window.
- start: what `bias_start` is worth: the error by the floor, with parts that are offset or a degree off by its own error
  without, and the falls at the largest e with 5 mg on the inner accelerometer.
- limits: the e at which half of 20 worlds fall, in steps of 1/16 degree.
- model: what a filter of y1 and the acceleration alone could gain that knows the model, the gimbals' motion, the push
  and e: two floors. A filter that takes y2 for a sensor of the rate is below both (`gimbal_gyro.py`).
- taps: the floor of y1 alone by taps and memory, and the same fit with the acceleration beside it.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from functools import cache
from itertools import pairwise, product

import numpy as np
from beyond.floor import velocity_floor

from cmg_mj.observers import OBSERVERS as BUNDLED
from cmg_mj.results.floors import TiltFloor
from cmg_mj.results.intervals import Interval, mean_interval
from cmg_mj.results.result import Result
from cmg_mj.results.tables import markdown_table
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.stages.push import inside, push_windows

SEED, TUNING_SEED, TUNING_WORLDS = 70_000, 71_000, 10
OBSERVERS = tuple(name for name in BUNDLED if name != "free_pivot")
"""free_pivot, which is a second gyro_free here, has a study of its own."""
NEW = ("gyro_free", "kalman")
PRESENT = tuple(name for name in OBSERVERS if name not in NEW)
OF_THE_PAPER = ("linear", "ltv", "homogeneous")
ERROR, PUSH_ERROR = "velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s"
BARS = {200.0: (0.25, 0.12), 400.0: (0.35, 0.18), 800.0: (0.50, 0.25)}
FLOOR_BAR, OFFSET_BAR = 1.1, 1.25
OFFSETS = ("[5,0]", "[0,5]")
STARTS = (0.1, 0.35, 1.0)
TRUTH = 'controller.feedback="truth"'
WHITE, WALK = (0.014, 0.02, 0.028, 0.04, 0.057, 0.08, 0.11), (0.003, 0.03)
STEP_DEG, LARGEST = 1.0 / 16.0, 64


def experiment(observer: str, noise: float, *more: str, seed: int = SEED) -> Experiment:
    """Push recovery with an observer in the loop at one sensor noise."""
    sensors = f"sensors.accelerometer.noise_density_ug_rthz={noise:g}"
    return prepare(load_scenario("push_recovery", [f"seed={seed}", sensors, *more], observer))


@cache
def cells(
    observer: str, noise: float, biases: tuple[float, ...], worlds: int, *more: str, seed: int = SEED
) -> list[Result]:
    """The same worlds at every e, one result each."""
    vary = {"equilibrium_bias_deg": np.repeat(biases, worlds)}
    numbers = list(range(worlds)) * len(biases)
    return (
        experiment(observer, noise, *more, seed=seed)
        .run_many(numbers, settings=vary, keep_trajectory=False)
        .split(len(biases))
    )


def ratio(a: np.ndarray, b: np.ndarray) -> Interval:
    """Ratio of two means over the worlds that stood in both, with its interval to first order."""
    both = np.isfinite(a) & np.isfinite(b)
    a, b = a[both], b[both]
    mean = float(a.mean() / b.mean())
    half = mean_interval((a - mean * b) / b.mean()).half
    return Interval(mean, mean - half, mean + half)


def against(of: Interval, bar: float) -> str:
    """A ratio, its upper end, and whether that is under the bar."""
    return f"{of.mean:.3f} (to {of.high:.3f}) {'<=' if of.high <= bar else '> !'} {bar:g}"


def best(results: dict[str, Result], key: str) -> str:
    """The smallest mean among those that stood in every world."""
    means = {name: result.mean(key) for name, result in results.items() if result.stood.all()}
    return min((mean, name) for name, mean in means.items() if mean is not None)[1]


def bars(noises: Sequence[float], biases: tuple[float, ...], worlds: int) -> None:
    """Print the tables of `gyro_free`."""
    errors, rows = [], []
    for noise in noises:
        runs = {name: cells(name, noise, biases, worlds) for name in OBSERVERS}
        off = {
            offset: cells("gyro_free", noise, biases, worlds, f"sensors.accelerometer.bias_mg={offset}")
            for offset in OFFSETS
        }
        for i, e in enumerate(biases):
            here = {name: runs[name][i] for name in runs}
            present = {name: here[name] for name in PRESENT}
            of, row = here["gyro_free"], [f"{noise:g}", f"{e:g}"]
            errors.append([*row, *(_mean(result) for result in here.values())])
            row.append(f"{int(of.stood.sum())}")
            for key, bar in zip((ERROR, PUSH_ERROR), BARS.get(noise, (math.nan, math.nan)), strict=True):
                rival = best(present, key)
                row += [f"`{rival}`", against(ratio(of.values(key), present[rival].values(key)), bar)]
            row.append(against(ratio(of.values(ERROR), of.values(ERROR, "floor_accel")), FLOOR_BAR))
            for offset in OFFSETS:
                moved = off[offset][i]
                fell = f" [{moved.fell.sum()} fell]" if moved.fell.any() else ""
                row.append(against(ratio(moved.values(ERROR), of.values(ERROR)), OFFSET_BAR) + fell)
            rows.append(row)
    print(f"\nVelocity RMS error, in the push window after the stroke [rad/s], {worlds} worlds:\n")
    print(markdown_table(["ug/rtHz", "e [deg]", *(f"`{name}`" for name in OBSERVERS)], errors))
    print("\n`gyro_free`: its error by that of others, and whether the upper end is under the bar:\n")
    headings = ["ug/rtHz", "e [deg]", "stood", "best of ten", "by it", "in push window", "by it"]
    print(markdown_table([*headings, "by the floor", "5 mg inner, by none", "5 mg outer, by none"], rows), flush=True)


def _mean(result: Result) -> str:
    if not result.stood.any():
        return "all fell"
    fell = f" [{result.fell.sum()} fell]" if result.fell.any() else ""
    return f"{result.mean(ERROR):.4f} / {result.mean(PUSH_ERROR):.4f}{fell}"


def start(noises: Sequence[float], biases: tuple[float, ...], worlds: int) -> None:
    """Print what `bias_start` is worth."""
    fields = [f"sensors.accelerometer.bias_mg={offset}" for offset in OFFSETS]
    fields.append("sensors.accelerometer.misalignment_deg=[0,1]")

    def falls(observer: str, noise: float, setting: str) -> str:
        result = cells(observer, noise, (max(biases),), worlds, setting, fields[0])[0]
        return f"{result.fell.sum()} of {worlds}"

    rows = []
    for noise in noises:
        for at in STARTS:
            setting = f"observer.bias_start={at}"
            of, *moved = (
                cells("gyro_free", noise, biases[:1], worlds, setting, *more)[0] for more in _none_and(fields)
            )
            row = [f"{noise:g}", f"{at:g}", f"{of.mean(ERROR):.4f}"]
            row.append(against(ratio(of.values(ERROR), of.values(ERROR, "floor_accel")), FLOOR_BAR))
            *offset, turned = (ratio(result.values(ERROR), of.values(ERROR)) for result in moved)
            row += [against(by_none, OFFSET_BAR) for by_none in offset]
            row.append(f"{turned.mean:.3f} (to {turned.high:.3f})")
            rows.append([*row, falls("gyro_free", noise, setting)])
        rows.append([f"{noise:g}", "true feedback", "-", "-", "-", "-", "-", falls("linear", noise, TRUTH)])
    print(f"\n`gyro_free` by its `bias_start` at e = {biases[0]:g} deg, and the falls at e = {max(biases):g} deg:\n")
    headings = ["ug/rtHz", "bias_start", "error [rad/s]", "by the floor", "5 mg inner, by none", "5 mg outer, by none"]
    print(markdown_table([*headings, "outer 1 deg off, by none", "fell, 5 mg inner"], rows), flush=True)


def _none_and(fields: Sequence[str]) -> list[tuple[str, ...]]:
    return [(), *((field,) for field in fields)]


@cache
def tuned(noise: float, biases: tuple[float, ...], key: str) -> tuple[str, ...]:
    """The torques' noise of `kalman` that has the least mean error in the loop, over all e, on seeds of its own."""

    def loss(settings: tuple[str, ...]) -> float:
        found = cells("kalman", noise, biases, TUNING_WORLDS, *settings, seed=TUNING_SEED)
        means = [result.mean(key) if result.stood.all() else None for result in found]
        return math.inf if None in means else sum(mean for mean in means if mean is not None)

    tried = product(WHITE, WALK)
    return min(((f"observer.torque_white={white}", f"observer.torque_walk={walk}") for white, walk in tried), key=loss)


def kalman(noises: Sequence[float], biases: tuple[float, ...], worlds: int) -> None:
    """Print `kalman` against (9), (10), (11), and what the other observers are to it."""
    others = (*OF_THE_PAPER, "high_gain", "adaptive")
    for key, where in ((ERROR, "over the whole run"), (PUSH_ERROR, "in the push window")):
        for fitted in (False, True):
            rows = []
            for noise in noises:
                settings = tuned(noise, biases, key) if fitted else ()
                of = cells("kalman", noise, biases, worlds, *settings)
                said = ", ".join(setting.partition("=")[2] for setting in settings) or "default"
                for i, e in enumerate(biases):
                    row = [f"{noise:g}", f"{e:g}", said, f"{of[i].mean(key):.4f}"]
                    rows.append(row + [_less(of[i], cells(name, noise, biases, worlds)[i], key) for name in others])
            how = "tuned at each noise for this" if fitted else "its defaults"
            print(f"\n`kalman`, {how}, {where}: its error, and less that of others")
            print("(in 1e-3 rad/s, with the interval's half):\n")
            headings = ["ug/rtHz", "e [deg]", "white, walk", "error [rad/s]", *(f"less `{name}`" for name in others)]
            print(markdown_table(headings, rows), flush=True)


def _less(of: Result, other: Result, key: str) -> str:
    difference = of.values(key) - other.values(key)
    if not np.isfinite(difference).any() or not other.stood.all():
        return f"{other.fell.sum()} fell"
    interval = mean_interval(difference)
    said = "better" if interval.high < 0.0 else "worse" if interval.low > 0.0 else "level"
    return f"{1e3 * interval.mean:+.1f} ±{1e3 * interval.half:.1f} {said}"


def limits(noises: Sequence[float]) -> None:
    """Print the e at which half of 20 worlds fall."""

    def falls(of: Experiment, sign: float, steps: int) -> bool:
        vary = {"equilibrium_bias_deg": [sign * steps * STEP_DEG] * 20}
        return int(of.run_many(20, settings=vary, keep_trajectory=False).fell.sum()) >= 10

    rows = []
    cases = [(f"`{name}`", name, ()) for name in (*NEW, "adaptive", "high_gain", "linear")]
    for noise, (label, name, more) in product(noises, [*cases, ("true feedback", "linear", (TRUTH,))]):
        of, found = experiment(name, noise, *more), []
        for sign in (-1.0, 1.0):
            stands, fell = -1, LARGEST
            while fell - stands > 1:
                middle = (stands + fell) // 2
                stands, fell = (stands, middle) if falls(of, sign, middle) else (middle, fell)
            found.append(f"{fell * STEP_DEG:.4f}" if fell < LARGEST else f"over {LARGEST * STEP_DEG:g}")
        rows.append([f"{noise:g}", label, *found])
    print("\nThe e at which half of 20 worlds fall [deg], to 1/16 degree:\n")
    print(markdown_table(["ug/rtHz", "in the loop", "e < 0", "e > 0"], rows, text_columns=2), flush=True)


def model(noises: Sequence[float]) -> None:
    """Print the two floors: of y1 and its acceleration for any motion, and of y1 with all else known."""
    rows = []
    for noise in noises:
        of = experiment("gyro_free", noise)
        dt, reduced, said = of.design.constructor_arguments
        free = of.run_many(1, keep_trajectory=False).mean(ERROR, "floor_accel") or math.nan
        known = velocity_floor(reduced, dt, said.tilt)
        rows.append([f"{noise:g}", f"{free:.5f}", f"{known:.5f}", f"{100.0 * (1.0 - known / free):.1f} %"])
    print("\nThe floor of y1 and its acceleration for any motion, and that of y1 with model, push, e and the gimbals'")
    print("motion known [rad/s]. So much a model takes off where y2 tells nothing of the rate (see gimbal_gyro.py).\n")
    print(markdown_table(["ug/rtHz", "any motion", "all known", "less"], rows), flush=True)


def taps(worlds: int) -> None:
    """Print the floor of y1 alone by how it is fitted, on the noise of the scenario."""
    rows = []
    for name in ("gyro_free", "high_gain", "linear"):
        of = experiment(name, 400.0)
        t = of.run_many(worlds).trajectory
        assert t is not None
        pushed = inside(t["time_s"], push_windows(of.scenario.push))
        own = TiltFloor(of.law.dt, 1).edges
        for label, edges in (
            (f"{len(own) - 1} over 0.5 s, as in the tables", own),
            ("100 over 0.5 s", list(range(101))),
            ("40 over 0.2 s", list(range(41))),
            ("200 over 1 s", list(range(201))),
        ):
            row = [f"`{name}`", label]
            y1, a = t["y1_rad"], t["acceleration_rad_s2"]
            of_y1, of_a = _shares(y1, y1[:1], edges), _shares(a, 0.0 * a[:1], edges)
            for seen in (of_y1, np.concatenate([of_y1, of_a], axis=2)):
                row += [_fitted(seen[rows_], t["x2_rad_s"][rows_]) for rows_ in (pushed | True, pushed)]
            rows.append(row)
    print(
        f"\nThe best filter of the past, fitted afterwards, {worlds} worlds: error [rad/s] if every world has its own,"
    )
    print("if all have one, and of one in worlds that it was not fitted in:\n")
    both = ("y1: whole run", "in push window")
    print(
        markdown_table(["in the loop", "taps", *both, "y1 and acceleration: whole run", both[1]], rows, text_columns=2),
        flush=True,
    )


def _shares(signal: np.ndarray, before: np.ndarray, edges: Sequence[int]) -> np.ndarray:
    """Sums of a signal over shares of the past, (n_rows, n_worlds, n_taps); before the start it was another."""
    past = np.vstack([np.repeat(before, edges[-1], axis=0), signal])
    sums = np.cumsum(past, axis=0)
    ends = [sums[edges[-1] - edge :][: len(signal)] for edge in edges]
    return np.stack([newer - older for newer, older in pairwise(ends)], axis=2)


def _fitted(seen: np.ndarray, rate: np.ndarray) -> str:
    half = rate.shape[1] // 2

    def left(fitted: slice, judged: slice) -> np.ndarray:
        inputs = seen[:, fitted].reshape(-1, seen.shape[2])
        taps = np.linalg.lstsq(inputs.T @ inputs, inputs.T @ rate[:, fitted].ravel(), rcond=1e-13)[0]
        return np.sqrt(np.mean((seen[:, judged] @ taps - rate[:, judged]) ** 2, axis=0))

    first, second, every = slice(0, half), slice(half, None), slice(None)
    apart = np.concatenate([left(first, second), left(second, first)])
    own = [left(slice(i, i + 1), slice(i, i + 1)).item() for i in range(rate.shape[1])]
    return f"{np.mean(own):.4f}, {left(every, every).mean():.4f}, {apart.mean():.4f}"


def main() -> None:
    """Print the parts that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=100)
    parser.add_argument("--noise", default="200,400,800")
    parser.add_argument("--e", default="0,0.5,1,1.5")
    parser.add_argument("--parts", default="bars,start,kalman,limits,model,taps")
    of = parser.parse_args()
    noises, biases = ([float(part) for part in text.split(",")] for text in (of.noise, of.e))
    parts = {
        "bars": lambda: bars(noises, tuple(biases), of.worlds),
        "start": lambda: start(noises, tuple(biases), of.worlds),
        "kalman": lambda: kalman(noises, tuple(biases), of.worlds),
        "limits": lambda: limits(noises),
        "model": lambda: model(noises),
        "taps": lambda: taps(min(of.worlds, 20)),
    }
    for part in of.parts.split(","):
        parts[part]()


if __name__ == "__main__":
    main()
