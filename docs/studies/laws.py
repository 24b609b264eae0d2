"""The LQG law beside (8) with an observer: docs/laws.md's tables.

python docs/studies/laws.py [--worlds 20] [--e 0.5,1.5] (about a minute and a half on two quiet cores)

push_recovery, the same worlds and noise for every loop. A figure is the mean over the worlds that stood, with its 95 %
interval. The second table has the differences to the LQG law, world by world. The largest bias and push that a loop
tolerates are found in steps, over worlds of another seed: their median over the worlds, and their range.
"""

import argparse
from collections.abc import Sequence

import numpy as np
from bias_limits import MAX_BIAS_DEG, PARTS, SEED, WORLDS, Case, cell, limits

from cmg_mj import load_scenario, prepare
from cmg_mj.results.intervals import format_interval, in_line, known_interval
from cmg_mj.results.result import Result
from cmg_mj.results.tables import markdown_table

LQG = "`lqg`"
LOOPS = {
    LQG: Case("homogeneous", ["controller.kind=lqg"]),
    "(8), `homogeneous`": Case("homogeneous"),
    "(8), `kalman`": Case("kalman"),
    "(8), `gyro_free`": Case("gyro_free"),
    "(8), true rate": Case("homogeneous", ["controller.feedback=truth"]),
}
FIGURES = {
    "tilt RMS [deg]": "tilt_rms_deg",
    "settling [s]": "settle_time_s",
    "gimbal peak [deg]": "gimbal_peak_deg",
    "command RMS [rad/s]": "command_rms_rad_s",
}
PUSHES = np.arange(0.25, 6.01, 0.25)


def figure(values: np.ndarray, sign: str = "") -> str:
    """A mean with its interval; a sign is given to differences, which may be negative."""
    interval = known_interval(values, positive=not sign)
    if interval is None:
        return "-"
    return in_line([f"{interval.mean:{sign}.3f}", *format_interval("{:.3f}", interval)])


def table(e: float, worlds: int) -> None:
    """Figures at one bias, then the differences."""
    settings = f"plant.equilibrium_bias_deg={e}"
    results: dict[str, Result] = {
        name: prepare(load_scenario("push_recovery", [settings, *case.overrides], case.observer)).run_many(
            worlds, keep_trajectory=False
        )
        for name, case in LOOPS.items()
    }
    rows = [
        (name, f"{result.stood.sum()} of {worlds}", *(figure(result.values(key)) for key in FIGURES.values()))
        for name, result in results.items()
    ]
    print(f"\ne = {e:g} degrees\n\n{markdown_table(('loop', 'stood', *FIGURES), rows)}")
    less = [
        (name, *(figure(result.values(key) - results[LQG].values(key), "+") for key in FIGURES.values()))
        for name, result in results.items()
        if name != LQG
    ]
    print(f"\nLess {LQG}, world by world\n\n{markdown_table(('loop', *FIGURES), less)}")


def borne_pushes(case: Case) -> np.ndarray:
    """The hardest push before the first that fells a world, (WORLDS,) [N m]."""
    experiment = prepare(load_scenario("push_recovery", [f"seed={SEED}", *case.overrides], case.observer))
    numbers = np.repeat(np.arange(WORLDS), len(PUSHES)).tolist()
    vary = {"push.0.torque_n_m": np.tile(PUSHES, WORLDS)}
    stands = experiment.run_many(numbers, settings=vary, keep_trajectory=False).stood.reshape(WORLDS, -1)
    count = np.where(stands.all(axis=1), len(PUSHES), np.argmin(stands, axis=1))
    return np.concatenate([[0.0], PUSHES])[count]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--worlds", type=int, default=20)
    parser.add_argument("--e", default="0.5,1.5", help="biases, with commas between [deg]")
    parser.add_argument("--figures-only", action="store_true", help="leave out what the loops bear")
    asked = parser.parse_args(arguments)
    for e in asked.e.split(","):
        table(float(e), asked.worlds)
    if asked.figures_only:
        return
    biases = limits(list(LOOPS.values()))
    rows = [
        (name, cell(below), cell(above), cell(borne_pushes(case)))
        for (name, case), (below, above) in zip(LOOPS.items(), biases, strict=True)
    ]
    step = f"{MAX_BIAS_DEG / PARTS**2:g} degrees"
    print(f"\nBorne, biases in steps of {step} up to {MAX_BIAS_DEG:g}, pushes of 0.1 s in steps of {PUSHES[0]:g} N m\n")
    print(markdown_table(("loop", "-e [deg], push of 1 N m", "e [deg], the same", "push [N m], e = 0.5"), rows))


if __name__ == "__main__":
    main()
