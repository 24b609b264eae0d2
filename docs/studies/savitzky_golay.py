"""Where a Savitzky-Golay differentiator of the last samples stands among the observers: on the bench, not on one log.

    python docs/studies/savitzky_golay.py [WORLDS] (about a minute with 8 worlds)

The rate is the slope, at the newest sample, of the polynomial that fits the last samples best (scipy's
`savgol_coeffs`). Window and order are chosen on the worlds of seed 1000, as are the single parameters of `linear` and
`linear_high_gain`, each for its own column; all are judged on the worlds of seed 2000. The others have their defaults.
Open loop: the RMS error of the rate in the windows of the pushes, the loop closed on the gyro. Closed loop: the RMS of
the tilt over 8 s, of the worlds that stood. As a user's observer it runs like any other, from the clone's folder:

    cmg-mj compare push_recovery --observers linear,linear_high_gain,docs.studies.savitzky_golay:SavitzkyGolay
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from cmg_mj import load_scenario, prepare
from cmg_mj.core.arrays import Scalar
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.features.tuning.simulations import record
from cmg_mj.observers import Estimate, Measurement, make_observer
from cmg_mj.runs.side_by_side import run_jobs, run_of
from cmg_mj.scenario.schema import ObserverSettings, Scenario

NAME = "docs.studies.savitzky_golay:SavitzkyGolay"
FITTED, JUDGED = 1000, 2000
SCENARIOS = {
    "push_recovery": ("push_recovery", []),
    "100 ug/rtHz": ("push_recovery", ["sensors.accelerometer.noise_density_ug_rthz=100"]),
    "single_gimbal": ("single_gimbal", []),
}
DURATION_S = 8.0
WINDOWS = (5, 7, 9, 11, 13, 15, 18, 21, 25, 29, 34, 40)
GRIDS = {
    NAME: [{"window": n, "order": order} for order in (1, 2) for n in WINDOWS],
    "linear": [{"tau": tau} for tau in np.geomspace(0.006, 0.08, 16).round(4).tolist()],
    "linear_high_gain": [{"epsilon": eps} for eps in np.geomspace(0.006, 0.08, 16).round(4).tolist()],
}
OTHERS = ("kalman", "homogeneous", "super_twisting", "ltv", "gyro_free")


@dataclass(frozen=True)
class SavitzkyGolay:
    """The slope of the polynomial of the last samples, at the last one.

    Attributes:
        dt: Sample period [s].
        model: The reduced model (not used).
        window: Number of samples.
        order: Order of the polynomial.
    """

    needs: ClassVar[tuple[str, ...]] = ()

    dt: float
    model: ReducedModel
    window: int = 21
    order: int = 1

    @cached_property
    def _weights(self) -> list[float]:
        from scipy.signal import savgol_coeffs

        last = self.window - 1
        weights = savgol_coeffs(self.window, self.order, deriv=1, delta=self.dt, pos=last, use="dot")
        return [float(weight) for weight in np.ravel(weights)]

    def init(self, y: Measurement) -> tuple[Scalar, ...]:
        """Take the tilt to have been what it is."""
        return (y.y1,) * self.window

    def step(self, state: tuple[Scalar, ...], y: Measurement, u: Scalar) -> tuple[tuple[Scalar, ...], Estimate]:
        """Advance by one sample period."""
        state = (*state[1:], y.y1)
        return state, Estimate(y.y1, sum(w * sample for w, sample in zip(self._weights, state, strict=True)), y.y2)


def _open_loop(scenario: Scenario, candidates: list[tuple[str, dict]], worlds: int) -> np.ndarray:
    """Return the mean error of each candidate [rad/s]."""
    recorded = record(scenario, range(worlds))
    experiment = prepare(scenario)
    dt = 1.0 / scenario.controller.rate_hz
    _, model, noise = experiment.design.constructor_arguments
    errors = [recorded.errors(make_observer(kind, dt, model, noise, **parameters)) for kind, parameters in candidates]
    return np.array([float(error.mean()) for error in errors])


def _closed_loop(scenario: Scenario, candidates: list[tuple[str, dict]], worlds: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean RMS of the tilt of each candidate [deg], infinite where more than half fell, and the falls."""
    scenario = scenario.model_copy(update={"duration_s": DURATION_S})
    experiments = [
        prepare(scenario.model_copy(update={"observer": ObserverSettings(kind=kind, **parameters)}))
        for kind, parameters in candidates
    ]
    results = run_jobs([run_of(experiment, worlds) for experiment in experiments], keep_trajectory=False)
    falls = np.array([worlds - int(result.stood.sum()) for result in results])
    tilts = [result.mean("tilt_rms_deg") for result in results]
    half = [
        tilt if tilt is not None and fell <= worlds / 2 else np.inf for tilt, fell in zip(tilts, falls, strict=True)
    ]
    return np.array(half), falls


def _with_falls(tilts: np.ndarray, falls: np.ndarray) -> np.ndarray:
    """Return a loss in which a fall outweighs any tilt."""
    return tilts + 10.0 * falls


def main(worlds: int) -> None:
    """Print a table a scenario."""
    for title, (name, settings) in SCENARIOS.items():
        fit, judge = (load_scenario(name, [*settings, f"seed={seed}"]) for seed in (FITTED, JUDGED))
        all_candidates = [(kind, parameters) for kind, grid in GRIDS.items() for parameters in grid]
        losses = {
            "open": _open_loop(fit, all_candidates, worlds),
            "closed": _with_falls(*_closed_loop(fit, all_candidates, worlds)),
        }
        chosen = {
            loop: [
                min(
                    (pair for pair in zip(loss, all_candidates, strict=True) if pair[1][0] == kind),
                    key=lambda pair: pair[0],
                )[1]
                for kind in GRIDS
            ]
            + [(kind, {}) for kind in OTHERS]
            for loop, loss in losses.items()
        }
        errors = _open_loop(judge, chosen["open"], worlds)
        tilts, falls = _closed_loop(judge, chosen["closed"], worlds)
        print(f"\n{title}, {worlds} worlds:")
        heads = f"{'chosen, open loop':>26}{'error [rad/s]':>15}{'chosen, closed loop':>26}"
        print(f"{'observer':18}{heads}{'tilt [deg]':>12}{'fell':>6}")
        for opened, error, closed, tilt, fell in zip(
            chosen["open"], errors, chosen["closed"], tilts, falls, strict=True
        ):
            text = [
                ", ".join(f"{n}={v}" for n, v in parameters.items()) or "default" for _, parameters in (opened, closed)
            ]
            label = "savitzky_golay" if opened[0] == NAME else opened[0]
            print(f"{label:18}{text[0]:>26}{error:15.4f}{text[1]:>26}{tilt:12.3f}{fell:6d}", flush=True)


if __name__ == "__main__":
    sys.path.insert(0, "")
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 16)
