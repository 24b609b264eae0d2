"""The observers of aranovskiy2020 tuned again as its Section V does: fitted to the gyro, scored on other seeds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from cmg_mj.intervals import Interval, ratio_interval
from cmg_mj.papers.aranovskiy2020.rig import push_recovery
from cmg_mj.papers.claim import OnShare
from cmg_mj.scenario import load_scenario
from cmg_mj.schema import Scenario
from cmg_mj.tuning import Level, Recorded, Study, record, tune

SEED = 74_000
WORLDS = 12
DEFAULT_NOISE = 400.0
WARM_UP_S = 0.5
"""Replayed before the window [s]: many times the time constants of the three."""
GENTLE = ["push.0.torque_n_m=0.3", "plant.equilibrium_bias_deg=0.0"]
"""A push of which (11) has less to learn, on a rig without bias."""


@dataclass(frozen=True)
class Tuned:
    """What is tuned of an observer, and at which sensor noises.

    Attributes:
        observer: Its name.
        equation: Its number in the paper.
        parameters: What is tuned of it.
        noise_ug_rthz: Noise densities [ug/sqrt(Hz)].
        printed: Table 2's line.
        share: Of the time that all take.
    """

    observer: str
    equation: str
    parameters: Sequence[str]
    noise_ug_rthz: Sequence[float]
    printed: str
    share: float


LINEAR = Tuned("linear", "(9)", ["tau"], (100.0, 200.0, 400.0), "tau = 0.02", 0.1)
LTV = Tuned("ltv", "(10)", ["Q[1]"], (200.0, 400.0, 800.0), "Q = diag(1, 5e6, 1)", 0.32)
HOMOGENEOUS = Tuned(
    "homogeneous",
    "(11)",
    ["k1", "k2", "alpha"],
    (400.0, 1600.0, 3200.0, 6400.0),
    "[k1, k2, alpha] = [20, 150, 0.85]",
    0.45,
)
CASES = (LINEAR, LTV, HOMOGENEOUS)
GENTLE_SHARE = 1.0 - sum(case.share for case in CASES)


def recorder() -> Callable[..., Recorded]:
    """Recordings of the tuning experiment that are made once and serve every observer."""
    kept: dict[tuple, Recorded] = {}

    def recorded(scenario: Scenario, worlds: range, *, noise_ug_rthz: float, warm_up_s: float) -> Recorded:
        key = (worlds, noise_ug_rthz, scenario.seed, scenario.plant, tuple(scenario.push))
        if key not in kept:
            kept[key] = record(scenario, worlds, noise_ug_rthz=noise_ug_rthz, warm_up_s=warm_up_s)
        return kept[key]

    return recorded


def study_of(
    case: Tuned,
    seed: int,
    worlds: int,
    noise_ug_rthz: Sequence[float] | None = None,
    settings: Sequence[str] = (),
    recorded: Callable[..., Recorded] | None = None,
    on_share: OnShare | None = None,
) -> Study:
    """Tune one observer.

    Args:
        case: Which, and what of it.
        seed: Of the noise.
        worlds: How many are fitted, and as many held out.
        noise_ug_rthz: Other noise densities [ug/sqrt(Hz)].
        settings: Settings `section.field=value` of the tuning experiment that differ.
        recorded: Makes the recordings.
        on_share: Called with the share done.

    Returns:
        The study.
    """
    return tune(
        load_scenario("observer_tuning", [f"seed={seed}", *settings], case.observer),
        worlds=worlds,
        parameters=case.parameters,
        noise_ug_rthz=case.noise_ug_rthz if noise_ug_rthz is None else noise_ug_rthz,
        warm_up_s=WARM_UP_S,
        starts=1,
        recorded=recorded or recorder(),
        on_share=on_share,
    )


def nearest(study: Study, noise_ug_rthz: float) -> Level:
    """The level whose noise is nearest, by its logarithm."""
    return min(study.levels, key=lambda level: abs(math.log(level.noise_ug_rthz / noise_ug_rthz)))


def at_default(study: Study) -> Level:
    """The level of the default noise, which every case has."""
    return next(level for level in study.levels if level.noise_ug_rthz == DEFAULT_NOISE)


def zero_is_closer(level: Level) -> bool:
    """Whether an estimate of zero is closer to the gyro than either the given or the tuned parameters."""
    return level.zero_rms < min(level.given_rms.mean(), level.rms.mean())


def in_the_loop(case: Tuned, level: Level, worlds: int, seed: int) -> Interval:
    """Velocity RMS error in the closed loop, Table 2's by the tuned, world by world, after the push of Figs 5 to 7."""
    tuned = [f"observer.{name}={size}" for name, size in level.sizes.items()]
    given_error, tuned_error = (
        push_recovery(case.observer, seed, settings)
        .run_many(worlds, keep_trajectory=False)
        .values("velocity_rms_error_rad_s")
        for settings in ([], tuned)
    )
    return ratio_interval(given_error, tuned_error)
