"""The cost of the physics step and MuJoCo's integrators, and their distance from the limit.

    python docs/studies/steps.py [--scenario push_recovery] [--worlds 64] [--set plant.flywheel_imbalance_kg_m=1e-5 ...]

About three minutes of processor time with 8 worlds, more than eight with 64.

For every integrator and step: how far the summary's figures, means over the worlds, are from those of the reference
(the first integrator at the first step), and which is the farthest; how far a run without noise is from the
reference's; processor time of all threads a simulated world-second.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.results.result import Result
from cmg_mj.results.summary_keys import NESTED
from cmg_mj.results.tables import markdown_table
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario

INTEGRATORS = ("RK4", "implicit", "implicitfast", "Euler", "discrete")
STEPS_MS = (0.25, 0.5, 1.0, 2.5, 5.0)
SETTLE = "settle_time_s"
"""It hangs on single worlds: one whose tilt touches the band once more moves the mean by a per cent."""
SHARES = ("_fraction", "_fit", "_fit_push")
NO_NOISE = (
    "sensors.accelerometer.noise_density_ug_rthz=0",
    "sensors.accelerometer.counts_per_g=0",
    "sensors.encoder.counts_per_revolution=0",
)


def experiment(of: argparse.Namespace, observer: str, integrator: str, step_ms: float, *more: str) -> Experiment:
    """The scenario with an observer, an integrator and a step."""
    settings = [f"plant.integrator={integrator}", f"plant.timestep_s={step_ms / 1e3!r}", *of.set, *more]
    return prepare(load_scenario(of.scenario, settings, observer))


def figures(result: Result) -> dict[str, float]:
    """The summary's figures, means over the worlds that stood; the share of falls."""
    means = {key: result.mean(key) for key in result.summaries[0] if key not in NESTED}
    return {key: value for key, value in means.items() if value} | {"fell_fraction": float(result.fell.mean())}


def farthest(values: dict[str, float], limits: dict[str, float]) -> tuple[float, str]:
    """The largest distance but for settle time, and whose: relative, of shares and fits as they are."""
    distances = [
        (abs(values[key] - limit) / (1.0 if key.endswith(SHARES) else abs(limit)), key)
        for key, limit in limits.items()
        if key in values and key != SETTLE
    ]
    return max(distances, default=(np.nan, "none"))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--scenario", default="push_recovery")
    parser.add_argument("--observers", default="linear,homogeneous,adaptive")
    parser.add_argument("--integrators", default=",".join(INTEGRATORS))
    parser.add_argument("--steps-ms", default=",".join(map(str, STEPS_MS)))
    parser.add_argument("--worlds", type=int, default=64)
    parser.add_argument("--set", action="append", default=[])
    of = parser.parse_args()
    steps = [float(step) for step in of.steps_ms.split(",")]
    for observer in of.observers.split(","):
        rows = []
        limits: dict[str, float] = {}
        straight: dict[str, np.ndarray] = {}
        for integrator in of.integrators.split(","):
            for step in steps:
                try:
                    noisy = experiment(of, observer, integrator, step)
                except InputError:  # the rates do not fit this step
                    continue
                start = time.process_time()
                result = noisy.run_many(of.worlds, keep_trajectory=False)
                cost = (time.process_time() - start) / (of.worlds * result.seconds)
                silent = experiment(of, observer, integrator, step, *NO_NOISE).run().trajectory
                assert silent is not None
                motion = {name: silent[name] for name in ("x1_rad", "x2_rad_s", "x3_rad")}
                values = figures(result)
                if not limits:
                    limits, straight = values, motion
                off, whose = farthest(values, limits)
                common = min(len(motion["x1_rad"]), len(straight["x1_rad"]))
                apart = [np.abs(motion[name][:common] - straight[name][:common]).max() for name in motion]
                rows.append(
                    [
                        integrator,
                        f"{step:g}",
                        f"{values.get('velocity_rms_error_rad_s', np.nan):.4f}",
                        f"{100.0 * off:.2f} % ({whose})",
                        f"{100.0 * abs(values.get(SETTLE, np.nan) / limits.get(SETTLE, np.nan) - 1.0):.2f} %",
                        *(f"{value:.1e}" for value in apart),
                        f"{1e3 * cost:.2f}",
                    ]
                )
        headings = [
            "integrator",
            "step [ms]",
            "velocity RMS error",
            "farthest figure",
            "settle time",
            "x1 [rad]",
            "x2 [rad/s]",
            "x3 [rad]",
        ]
        print(f"\n`{observer}`, {of.scenario}, {of.worlds} worlds:\n")
        print(markdown_table([*headings, "CPU [ms/world-s]"], rows), flush=True)


if __name__ == "__main__":
    main()
