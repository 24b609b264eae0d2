"""Fit `high_gain` to the gyro, as section V of aranovskiy2020 fits its observers, and say which d_inf is best.

The loop is closed on the gyro (scenario observer_tuning), the observer is replayed on what was recorded, and the RMS
of (estimate - gyro) over all worlds, from the start of the push to one second after it, is minimised over the
logarithms of l1 and l2, for each d_inf of a grid (0 is the linear correction). The rest is not tuned: phi1, phi2, phi3
are those of andrieu2009 section 3.1 (phi2 = 1 is the least that its proof allows), and b is half of what (21) allows.
Seeds are used nowhere else. After that the winner and the best linear one are put into the loop on other worlds.

    python docs/studies/tune_high_gain.py         # about two minutes
"""

import math
import statistics

import numpy as np
from scipy.optimize import minimize

from cmg_mj.experiment import prepare
from cmg_mj.observers import Measurement, make_observer
from cmg_mj.papers.andrieu2009.bi_limit import largest_b
from cmg_mj.scenario import load_scenario

SEED, LOOP_SEED, WORLDS = 30_000, 31_000, 20
D_INF = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
PHI2 = (1.0, 3.0, 10.0)

experiment = prepare(load_scenario("observer_tuning", [f"seed={SEED}", "companions=[]"]))
recorded = experiment.run_many(WORLDS).trajectory
assert recorded is not None
push = experiment.scenario.push[0]
window = (recorded["time_s"] >= push.start_s) & (recorded["time_s"] <= push.end_s + 1.0)
end = int(np.flatnonzero(window)[-1]) + 1


def parameters(log_l: np.ndarray, d_inf: float, phi2: float = 1.0) -> dict[str, float]:
    """The observer's parameters; l1 and l2 act times phi2."""
    l1, l2 = np.exp(log_l) / phi2
    bound = largest_b(2, d_inf)
    return {"l1": l1, "l2": l2, "d_inf": d_inf, "b": 0.5 * bound if math.isfinite(bound) else 1.0, "phi2": phi2}


def error(given: dict[str, float]) -> float:
    """RMS of the velocity error against the gyro, over all worlds and the window [rad/s]."""
    o = make_observer("high_gain", experiment.law.dt, experiment.plant.reduced, **given)
    y1, y2, u, gyro = (recorded[name] for name in ("y1_rad", "y2_rad", "u_rad_s", "fog_rad_s"))
    state = o.init(Measurement(y1[0], y2[0]))
    squares = np.zeros(len(y1))
    for k in range(1, end):
        state, estimate = o.step(state, Measurement(y1[k], y2[k]), u[k - 1])
        squares[k] = np.mean((estimate.x2 - gyro[k]) ** 2)
    return math.sqrt(np.mean(squares[window]))


def tuned(d_inf: float, phi2: float) -> tuple[float, dict[str, float]]:
    """The least error, and where."""
    start = np.log([30.0, 12.0])
    simplex = start + np.array([[0.0, 0.0], [0.3, 0.0], [0.0, 0.3]])
    fit = minimize(
        lambda log_l: error(parameters(log_l, d_inf, phi2)),
        start,
        method="Nelder-Mead",
        options={"xatol": 0.01, "fatol": 1e-6, "initial_simplex": simplex},
    )
    return fit.fun, parameters(fit.x, d_inf, phi2)


def loop(given: dict[str, float]) -> list[float]:
    """Velocity RMS error of every world of push_recovery [rad/s]."""
    settings = [f"seed={LOOP_SEED}", "observer.kind=high_gain", *(f"observer.{k}={v}" for k, v in given.items())]
    result = prepare(load_scenario("push_recovery", settings)).run_many(WORLDS, keep_trajectory=False)
    print(f"  in the loop {sum(outcome.kind == 'done' for outcome in result.outcomes)} of {WORLDS} stand", end="")
    return [summary["velocity_rms_error_rad_s"] for summary in result.summaries]


fits = {}
print("| d_inf | phi2 | l1 | l2 | velocity RMS error [rad/s] |\n|---|---|---|---|---|")
for d_inf in D_INF:
    for phi2 in PHI2 if d_inf else PHI2[:1]:  # for d_inf = 0 only the products l1 phi2, l2 phi2 count
        found, given = tuned(d_inf, phi2)
        fits[found] = given
        print(f"| {d_inf:g} | {phi2:g} | {given['l1']:.4g} | {given['l2']:.4g} | {found:.5f} |", flush=True)
best, linear = fits[min(fits)], next(given for given in fits.values() if given["d_inf"] == 0.0)
print("best:", {name: f"{value:.4g}" for name, value in best.items()})
errors = {}
for name, given in (("best", best), ("best with d_inf = 0", linear)):
    print(name, end=":")
    errors[name] = loop(given)
    print(f", velocity RMS error {statistics.fmean(errors[name]):.4f} rad/s")
gain = [b - a for a, b in zip(*errors.values(), strict=True)]
standard_error = statistics.stdev(gain) / math.sqrt(WORLDS)
print(f"difference {statistics.fmean(gain):.4f} +- {standard_error:.4f} rad/s (standard error)")
