"""Fit `high_gain` to the gyro, as section V of aranovskiy2020 fits its observers, and say which d_inf is best.

The loop is closed on the gyro (scenario observer_tuning), and the observer is replayed on the recordings. The RMS of
(estimate - gyro) is taken over all worlds, from the start of the push to one second after it. It is minimised over
the logarithms of l1 and l2, for each d_inf of a grid (0 is the linear correction). The other parameters are not
tuned. phi1, phi2, phi3 are those of andrieu2009 section 3.1 (phi2 = 1 is the least that its proof allows). b is half
of the value that (21) allows. Seeds are used nowhere else. After that the winner and the best linear correction are
put into the loop on other worlds.

Run it (about two minutes): python docs/studies/tune_high_gain.py
"""

import math

import numpy as np
from scipy.optimize import minimize

from cmg_mj import load_scenario, make_observer, prepare
from cmg_mj.features.replay import replay
from cmg_mj.papers.andrieu2009.observer import largest_b
from cmg_mj.results.summary_keys import heading
from cmg_mj.results.tables import markdown_table

SEED, LOOP_SEED, WORLDS = 30_000, 31_000, 20
ERROR = "velocity_rms_error_rad_s"
D_INF = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
PHI2 = (1.0, 3.0, 10.0)

experiment = prepare(load_scenario("observer_tuning", [f"seed={SEED}", "open_loop_observers=[]"]))
push = experiment.scenario.push[0]
whole = experiment.run_many(WORLDS).trajectory
assert whole is not None
recorded = whole.between(0.0, push.end_s + 1.0)
scored = recorded["time_s"] >= push.start_s


def parameters(log_l: np.ndarray, d_inf: float, phi2: float = 1.0) -> dict[str, float]:
    """The observer's parameters; l1 and l2 act times phi2."""
    l1, l2 = np.exp(log_l) / phi2
    bound = largest_b(2, d_inf)
    return {"l1": l1, "l2": l2, "d_inf": d_inf, "b": 0.5 * bound if math.isfinite(bound) else 1.0, "phi2": phi2}


def error(given: dict[str, float]) -> float:
    """RMS of the velocity error against the gyro, over all worlds and the window [rad/s]."""
    observer = make_observer("high_gain", experiment.law.dt, experiment.plant.reduced, **given)
    difference = replay(observer, recorded).x2 - recorded["fog_rad_s"]
    return math.sqrt(np.mean(difference[scored] ** 2))


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


def loop(name: str, given: dict[str, float]) -> np.ndarray:
    """Velocity RMS error of every world of push_recovery, (WORLDS,) [rad/s]; NaN where it fell."""
    settings = [f"seed={LOOP_SEED}", "observer.kind=high_gain", *(f"observer.{k}={v}" for k, v in given.items())]
    result = prepare(load_scenario("push_recovery", settings)).run_many(WORLDS, keep_trajectory=False)
    error = result.mean(ERROR)
    print(f"{name}: in the loop {result.stood.sum()} of {WORLDS} stand, velocity RMS error {error:.4f} rad/s")
    return result.values(ERROR)


fits, rows = {}, []
for d_inf in D_INF:
    for phi2 in PHI2 if d_inf else PHI2[:1]:  # for d_inf = 0 only the products l1 phi2, l2 phi2 count
        found, given = tuned(d_inf, phi2)
        fits[found] = given
        rows.append((f"{d_inf:g}", f"{phi2:g}", f"{given['l1']:.4g}", f"{given['l2']:.4g}", f"{found:.5f}"))
print(markdown_table(("d_inf", "phi2", "l1", "l2", heading(ERROR)), rows, text_columns=0))
best, linear = fits[min(fits)], next(given for given in fits.values() if given["d_inf"] == 0.0)
print("best:", {name: f"{value:.4g}" for name, value in best.items()})
best_errors, linear_errors = loop("best", best), loop("best with d_inf = 0", linear)
gain = (linear_errors - best_errors)[np.isfinite(linear_errors - best_errors)]
standard_error = gain.std(ddof=1) / math.sqrt(len(gain))
print(f"difference {gain.mean():.4f} +- {standard_error:.4f} rad/s (standard error)")
