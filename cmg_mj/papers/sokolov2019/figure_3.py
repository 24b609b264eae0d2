"""Fig. 3: the law fed by the gyro, the estimators in open loop, a push at 1 s; and what Section V says of (9) there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.signal import lsim, lti

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.features.replay import replay
from cmg_mj.observers import Observer
from cmg_mj.papers.claim import Assumption, Claim, OnShare
from cmg_mj.papers.recorded import push_intervals, rms, trajectory_of
from cmg_mj.papers.sokolov2019.paper import OBSERVERS, TABLE_II
from cmg_mj.papers.sokolov2019.rig import PUSH_AND_NOISE, estimator, experiment
from cmg_mj.results.intervals import Interval, mean_interval
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import Experiment
from cmg_mj.stages.push import Push
from cmg_mj.view.plots.figure import Line, Panel, Picture

SEED, WORLDS = 82_000, 20
AFTER_S = 0.5
"""The push's window ends so long after the push."""
ASSUMED: Mapping[Assumption, str] = {**PUSH_AND_NOISE, "e": "0.5 deg"}
WITH_Y2 = "luenberger and y2"
L1, L2 = (row[0] for row in TABLE_II["luenberger"]["L"][:2])
"""Gains of (9) on y1 less its estimate [1/s, 1/s^2]."""


def stiffness(model: ReducedModel) -> float:
    """Return 150 - m g l/J1: plus (s + 20) s it is the characteristic polynomial of (9) in x1 and x2 [1/s^2]."""
    return L2 - model.gravity_torque / model.J1


def nine_with_y2(prepared: Experiment) -> Observer:
    """Make (9) with all of the model's terms in y2.

    (9) has x2' = M/J1 xhat1 + b u + 150 (y1 - xhat1) with M = m g l, or M/J1 y1 + b u + (150 - M/J1)(y1 - xhat1). So
    (10) with alpha = 1 and k2 = 150 - M/J1 is (9) but for J2, cos y2 and the sine.
    """
    return estimator("homogeneous", prepared, k1=L1, k2=stiffness(prepared.plant.reduced), alpha=1.0)


class Tuning(NamedTuple):
    """The experiment, and what each estimator makes of it."""

    prepared: Experiment
    trajectory: Trajectory
    rates: Mapping[str, np.ndarray]
    """Estimated tilt rates, (n_ticks, n_worlds) [rad/s]."""
    window: np.ndarray
    """True for ticks between the push's start and half a second after its end, (n_ticks,)."""

    @property
    def push(self) -> Push:
        """The only one."""
        (push,) = self.prepared.scenario.push
        return push

    @property
    def error_of_9(self) -> np.ndarray:
        """Estimated less true rate, mean over the worlds, (n_ticks,) [rad/s]."""
        return (self.rates["luenberger"] - self.trajectory["x2_rad_s"]).mean(axis=1)


def tuning_experiment(worlds: int = WORLDS, seed: int = SEED) -> Tuning:
    """Close the loop on the gyro and replay the estimators on it."""
    prepared = experiment([f"seed={seed}", "duration_s=5.0"], feedback="fog")
    trajectory = trajectory_of(prepared.run_many(worlds))
    observers = {name: estimator(name, prepared) for name in OBSERVERS} | {WITH_Y2: nine_with_y2(prepared)}
    rates = {name: replay(observer, trajectory).x2 for name, observer in observers.items()}
    (push,) = prepared.scenario.push
    t = trajectory["time_s"]
    return Tuning(prepared, trajectory, rates, (t >= push.start_s) & (t <= push.end_s + AFTER_S))


def relative_errors(tuning: Tuning) -> dict[str, Interval]:
    """Return the RMS of estimate less gyro in the push's window, by the gyro's RMS there; an estimate of zero has 1."""
    gyro = tuning.trajectory["fog_rad_s"][tuning.window]
    return {name: mean_interval(rms(rates[tuning.window] - gyro) / rms(gyro)) for name, rates in tuning.rates.items()}


def predict_error(tuning: Tuning) -> np.ndarray:
    """Return the error in the rate of (9) that the push alone makes, (n_ticks,) [rad/s].

    The observer does not know the push: d/J1 passes through (s + 20)/(s^2 + 20 s + 150 - M/J1), with the sign turned.
    """
    model = tuning.prepared.plant.reduced
    push = tuning.trajectory["push_n_m"][:, 0] / model.J1
    error = lti([1.0, L1], [1.0, L1, stiffness(model)])
    return -lsim(error, push, tuning.trajectory["time_s"], interp=False)[1]


def y2_reaches_the_rate(prepared: Experiment, seed: int = 0) -> float:
    """Measure the change of (9)'s rate if y2 is replaced by noise of 1 rad, over 200 samples [rad/s]."""
    rng = np.random.default_rng(seed)
    y1, u = rng.normal(size=(2, 200))
    columns = {"y1_rad": y1, "u_rad_s": u}
    observer = estimator("luenberger", prepared)
    x2 = [replay(observer, Trajectory(columns | {"y2_rad": y2})).x2 for y2 in (np.zeros(200), rng.normal(size=200))]
    return float(np.abs(x2[1] - x2[0]).max())


def misses_the_push(tuning: Tuning, relative: Mapping[str, Interval]) -> Claim:
    """Judge Fig. 3."""
    other_errors = {name: relative[name] for name in OBSERVERS if name != "luenberger"}
    at_end = int(np.argmin(np.abs(tuning.trajectory["time_s"] - tuning.push.end_s)))
    ends = {name: mean_interval(rates[at_end]) for name, rates in tuning.rates.items()}
    truth = mean_interval(tuning.trajectory["fog_rad_s"][at_end])
    worlds = tuning.rates["luenberger"].shape[1]
    failures = " and ".join(OBSERVERS[name] for name, error in other_errors.items() if error.low > 1.0)
    return Claim(
        place="Fig. 3",
        statement="At the push, (9) fails completely to estimate x2.",
        assumes=ASSUMED,
        holds=relative["luenberger"].low > max(1.0, *(error.high for error in other_errors.values())),
        conditions=(
            f"{failures} fails there too, if less: so does every estimator that takes the command's effect for motion."
            if failures
            else ""
        ),
        otherwise="Its error is no larger than that of an estimate of zero, or than the others'.",
        figures={
            **{f"relative_error_{name}": list(value) for name, value in relative.items()},
            **{f"rate_at_push_end_{name}_rad_s": list(value) for name, value in ends.items()},
            "rate_at_push_end_gyro_rad_s": list(truth),
            "worlds": worlds,
        },
        pictures=[_picture(tuning)],
    )


def ignores_y2(tuning: Tuning, relative: Mapping[str, Interval]) -> Claim:
    """Judge the reason that Section V gives."""
    reach = y2_reaches_the_rate(tuning.prepared)
    error, with_y2, without_y2 = tuning.error_of_9, relative[WITH_Y2], relative["luenberger"]
    explained_share = 1.0 - np.var((error - predict_error(tuning))[tuning.window]) / np.var(error[tuning.window])
    return Claim(
        place="Section V, (9) and y2",
        statement="(9) ignores y2 completely, and thus is not robust against external disturbances.",
        assumes=ASSUMED,
        holds={"y2 is ignored": reach == 0.0, "the push is missed for this reason": with_y2.high < 1.0},
        otherwise=(
            "(9) does ignore y2, but does not miss the push for this reason: with y2 it misses the push as well."
            if reach == 0.0
            else "y2 does reach its rate."
        ),
        figures={
            "effect_of_y2_rad_s": reach,
            "relative_error_with_y2": list(with_y2),
            "relative_error_without_y2": list(without_y2),
            "gain_by_y2": without_y2.mean - with_y2.mean,
            "variance_explained_by_the_unknown_push": float(explained_share),
        },
    )


def _picture(tuning: Tuning) -> Picture:
    run = tuning.trajectory.world(0).between(0.0, 3.0)
    t, shaded, push = run["time_s"], push_intervals(run), tuning.push
    panels = [
        Panel("tilt y1 [deg]", [Line(t, np.degrees(run["y1_rad"]), "y1", color=7, width=0.8)], "(a)", shaded=shaded),
        Panel("command u [rad/s]", [Line(t, run["u_rad_s"], "u", color=3, width=0.8)], shaded=shaded),
    ]
    for i, (name, equation) in enumerate(OBSERVERS.items()):
        lines = [
            Line(t, tuning.rates[name][: len(t), 0], f"{equation} {name}", color=name, width=0.8),
            Line(t, run["fog_rad_s"], "gyro", "k-", width=1.0),
        ]
        panels.append(Panel("tilt rate [rad/s]", lines, "(b)" if i == 0 else "", shaded=shaded, y_range=(-1.0, 0.6)))
    title = (
        f"sokolov2019, Fig. 3: the law fed by the gyro, a push at {push.start_s:g} s ({push.torque_n_m:g} N m, "
        f"{push.duration_s:g} s; e = {tuning.prepared.scenario.plant.equilibrium_bias_deg:g} deg)"
    )
    return Picture("sokolov2019-fig-3", title, panels)


def claims(on_share: OnShare) -> list[Claim]:
    """Judge Fig. 3, and what Section V says of (9) there."""
    tuning = tuning_experiment()
    on_share(0.8)
    relative = relative_errors(tuning)
    return [misses_the_push(tuning, relative), ignores_y2(tuning, relative)]
