"""Where the closed loop of aranovskiy2020 rests: (7), (8) and the text after (10), on the six-body model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.experiment import prepare
from cmg_mj.intervals import Interval, mean_interval
from cmg_mj.law import TABLE_2_GAINS
from cmg_mj.observers import make_observer
from cmg_mj.papers.aranovskiy2020.linearisation import printed_model
from cmg_mj.papers.claim import Claim, OnShare, verdict
from cmg_mj.picture import Line, Panel, Picture
from cmg_mj.replay import replay
from cmg_mj.scenario import load_scenario
from cmg_mj.trajectory import Trajectory

SEED = 73_000
WORLDS = 6
DURATION_S = 26.0
AVERAGED_S = 6.0
"""The last so many seconds are averaged [s]; the slowest poles, -0.2 +- 0.29j 1/s, have then faded to 2 %."""
BIAS_DEG = 0.5
DT = 0.005

CASES = {
    "the true rate, (8)": ("homogeneous", ['controller.feedback="truth"']),
    "(10), estimated angles": ("ltv", ['controller.angles="estimated"']),
    "(11), estimated angles": ("homogeneous", ['controller.angles="estimated"']),
}
"""What the law is fed with -> observer and settings."""


class Rest(NamedTuple):
    """Means over the last seconds, over the worlds."""

    x1: Interval
    """Tilt [deg]."""
    x3: Interval
    """Gimbal angle [deg]."""
    x_e: Interval
    """Integrator [rad s]."""
    x2_estimated: Interval
    """The observer's rate, whose true mean is zero [rad/s]."""
    example: Trajectory
    """World 0."""


def rest_of(case: str, worlds: int, seed: int, extra: Sequence[str] = ()) -> Rest:
    """Let the rig come to rest, without a push."""
    observer, settings = CASES[case]
    common = [f"seed={seed}", f"duration_s={DURATION_S}", "push=[]", "plant.initial_tilt_deg=0.0"]
    common.append(f"plant.equilibrium_bias_deg={BIAS_DEG}")
    result = prepare(load_scenario("push_recovery", [*common, *settings, *extra], observer)).run_many(worlds)
    trajectory = result.trajectory
    assert trajectory is not None
    late = trajectory["time_s"] >= DURATION_S - AVERAGED_S

    def mean(name: str, factor: float = 1.0) -> Interval:
        return mean_interval(factor * trajectory[name][late].mean(axis=0))

    degrees = math.degrees(1.0)
    rate = mean(f"estimate/{observer}/x2_rad_s")
    return Rest(mean("x1_rad", degrees), mean("x3_rad", degrees), mean("x_e_rad_times_s"), rate, trajectory.world(0))


def steady(observer: str, e_deg: float, sigma: float, seed: int = SEED) -> tuple[float, float]:
    """What an observer makes of the rig at rest on average: y2 = 0, u = 0, y1 = -e and white noise.

    The noise matters to (11) alone: its gains fall with the size of its error, so that noise adds to its bias.

    Args:
        observer: Its name.
        e_deg: The bias [deg].
        sigma: Standard deviation of y1's noise [rad].
        seed: Of the noise.

    Returns:
        The means of its x1 [rad] and x2 [rad/s].
    """
    ticks, settling, copies = 1200, 400, 64
    noise = np.random.default_rng(seed).normal(0.0, sigma, (ticks, copies))
    noise = np.hstack([noise, -noise])  # whose mean is zero
    columns = {"y1_rad": noise - math.radians(e_deg), "y2_rad": np.zeros_like(noise), "u_rad_s": np.zeros_like(noise)}
    estimate = replay(make_observer(observer, DT, printed_model()), Trajectory(columns))
    return float(estimate.x1[settling:].mean()), float(estimate.x2[settling:].mean())


def expected_integrator(case: str, e_deg: float, sigma: float, seed: int = SEED) -> float:
    """x_e at which the law's command is zero [rad s]: 0 = k1 x1 + k2 x2 + k4 x_e, of what the law is fed with."""
    k1, k2, _, k4 = TABLE_2_GAINS
    observer, settings = CASES[case]
    x1, x2 = steady(observer, e_deg, sigma, seed)
    if any("truth" in setting for setting in settings):
        x2 = 0.0
    if not any("estimated" in setting for setting in settings):
        x1 = -math.radians(e_deg)
    return -(k1 * x1 + k2 * x2) / k4


def holds(rest: Rest, expected_x_e: float) -> bool:
    """Whether x rests at zero and the integrator where it should, within a twentieth of e and of the offset."""
    return abs(rest.x1.mean) < BIAS_DEG / 20.0 and abs(rest.x_e.mean / expected_x_e - 1.0) < 0.05


def run(on_share: OnShare) -> list[Claim]:
    """All claims of this module."""
    rests: dict[str, Rest] = {}
    for i, case in enumerate(CASES):
        rests[case] = rest_of(case, WORLDS, SEED)
        on_share((i + 1) / (len(CASES) + 1))
    static = rest_of("the true rate, (8)", 2, SEED, ["controller.gains=[35.0, 4.0, -1.0, 0.0]"])
    on_share(1.0)
    return [_of_8(rests["the true rate, (8)"], static), _after_10(rests)]


def _of_8(rest: Rest, static: Rest) -> Claim:
    k1, _, k3, k4 = TABLE_2_GAINS
    x_e = k1 / k4 * math.radians(BIAS_DEG)
    x3 = k1 / k3 * BIAS_DEG
    off = abs(static.x3.mean / x3 - 1.0)
    return Claim(
        place="(7), (8) on the rig",
        says="Without the integrator the gimbal rests away from zero; with it x converges to zero.",
        found=(
            f"Six bodies, e = {BIAS_DEG:g} deg, the true rate in the law. k4 = 0: x3 rests at {static.x3.mean:.2f} "
            f"deg (k1/k3 e = {x3:.2f}). With K_e, mean over the last {AVERAGED_S:g} s of {DURATION_S:g}, {WORLDS} "
            f"seeds: tilt {rest.x1.mean:+.4f} +- {rest.x1.half:.4f} deg, gimbal {rest.x3.mean:+.2f} deg, x_e = "
            f"{rest.x_e.mean:.3f} rad s (+k_e1/k_e4 e = {x_e:.3f})."
        ),
        verdict=verdict(holds(rest, x_e) and off < 0.05, "sign"),
        why="With the signs that follow from y1 = x1 - e: k1/k3 e and +k_e1/k_e4 e.",
        figures={
            "gimbal_rest_without_integrator_deg": static.x3.mean,
            "gimbal_rest_expected_deg": x3,
            "tilt_rest_deg": list(rest.x1),
            "gimbal_rest_deg": list(rest.x3),
            "integrator_rest_rad_s": list(rest.x_e),
            "integrator_expected_rad_s": x_e,
        },
    )


def _after_10(rests: dict[str, Rest]) -> Claim:
    observed = {case: rest for case, rest in rests.items() if case.startswith("(")}
    example = rests["the true rate, (8)"].example
    sigma = float(np.std(example["y1_rad"] - example["x1_rad"]))
    expected = {case: expected_integrator(case, BIAS_DEG, sigma) for case in observed}
    quiet = steady("homogeneous", BIAS_DEG, 0.0)[1]
    all_hold = all(holds(rest, expected[case]) for case, rest in observed.items())
    listed = "; ".join(
        f"{case}: rate estimated {rest.x2_estimated.mean:+.4f} rad/s, tilt {rest.x1.mean:+.4f} +- {rest.x1.half:.4f} "
        f"deg, x_e {rest.x_e.mean:.3f} rad s ({expected[case]:.3f} expected)"
        for case, rest in observed.items()
    )
    lines = [
        Line(rest.example["time_s"], rest.example["x_e_rad_times_s"], case, color=i)
        for i, (case, rest) in enumerate(rests.items())
    ]
    tilts = [
        Line(rest.example["time_s"], np.degrees(rest.example["x1_rad"]), color=i, width=0.5)
        for i, rest in enumerate(rests.values())
    ]
    return Claim(
        place="After (10), the equilibrium",
        says="The integral action makes x = 0 the equilibrium even with an observer whose estimate e biases.",
        found=(
            f"The same rig with an observer in the law, {WORLDS} seeds. {listed}. Without noise (11) would estimate "
            f"{quiet:+.4f} rad/s: its gains fall with the size of its error, so noise adds to its bias."
        ),
        verdict=verdict(all_hold),
        why="" if all_hold else "The rest is not where it should be.",
        figures={
            key: value
            for case, rest in observed.items()
            for key, value in (
                (f"tilt_rest {case}_deg", list(rest.x1)),
                (f"integrator_rest {case}_rad_s", list(rest.x_e)),
                (f"integrator_expected {case}_rad_s", expected[case]),
                (f"rate_estimated {case}_rad_s", list(rest.x2_estimated)),
            )
        },
        pictures=[
            Picture(
                "aranovskiy2020-equilibrium",
                f"aranovskiy2020, Section III and after (10): the way to rest from the upright, e = {BIAS_DEG:g} deg, "
                "world 0",
                [Panel("integrator x_e [rad s]", lines), Panel("tilt x1 [deg]", tilts)],
            )
        ],
    )
