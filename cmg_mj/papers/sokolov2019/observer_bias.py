"""Sections IV-B and IV-C: what an equilibrium bias e does to the estimates of (9) and (10)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.linear_check import poles_as_pairs
from cmg_mj.papers.recorded import trajectory_of
from cmg_mj.papers.sokolov2019 import paper
from cmg_mj.papers.sokolov2019.rig import NO_NOISE, experiment

REST_S = 35.0
"""Time until the law's slowest poles, -0.19 +- 0.29j 1/s, have faded to 1e-3 [s]."""


class Rest(NamedTuple):
    """The rest of a run without noise."""

    x: np.ndarray
    """Largest |x1| [rad], |x2| [rad/s], |x3| [rad] over the last second, (3,)."""
    x2_estimate: float
    """The observer's rate [rad/s]."""
    x_e: float
    """The integrator [rad s]."""


def find_rest(observer: str, e_deg: float, angles: str) -> Rest:
    """Release the rig with a bias and wait; the law on `estimated` or `measured` angles."""
    settings = [*NO_NOISE, f"plant.equilibrium_bias_deg={e_deg}", "plant.initial_tilt_deg=0.1", "push=[]"]
    result = experiment([*settings, f"duration_s={REST_S}", f"controller.angle_source={angles}"], observer).run()
    if not result.stood.all():
        return Rest(np.full(3, math.inf), math.nan, math.nan)
    last = trajectory_of(result).between(REST_S - 1.0, REST_S)
    x = np.array([np.abs(last[name]).max() for name in ("x1_rad", "x2_rad_s", "x3_rad")])
    return Rest(x, float(last[f"estimate/{observer}/x2_rad_s"].mean()), float(last["x_e_rad_times_s"].mean()))


def biased_luenberger(e_deg: float = 0.25) -> Claim:
    """Judge section IV-B: the integrator compensates the offset even if (9) is biased."""
    model, e = paper.printed_model(), math.radians(e_deg)
    poles = np.linalg.eigvals(paper.error_matrix(model))
    x_hat = paper.rest_of_9(model, e)
    rests = {angles: find_rest("luenberger", e_deg, angles) for angles in ("estimated", "measured")}
    k1, k2, _, k4 = paper.K_E
    x_e = {"estimated": -(k1 * x_hat[0] + k2 * x_hat[1]) / k4, "measured": (k1 * e - k2 * x_hat[1]) / k4}
    largest_rest = max(float(rest.x.max()) for rest in rests.values())
    error = max(abs(rest.x2_estimate / x_hat[1] - 1.0) for rest in rests.values())
    x_e_error = max(abs(rest.x_e / x_e[angles] - 1.0) for angles, rest in rests.items())
    return Claim(
        place="Section IV-B",
        statement="A - L C is Hurwitz; with a bias e the estimate of (9) is off, but the integrator still brings x to "
        "zero.",
        assumes={"e": f"{e_deg:g} deg"},
        holds=largest_rest < 2e-3 and error < 0.02 and x_e_error < 0.02 and float(np.real(poles).max()) < 0.0,
        conditions="With y1 = x1 - e the bias enters y as -C_e e and the error as +L C_e e; the other sign is printed.",
        otherwise="It does not come to rest as the linear equations say.",
        figures={
            "largest_rest_state": largest_rest,
            "rate_estimate_rad_s": rests["estimated"].x2_estimate,
            "rate_estimate_closed_form_rad_s": float(x_hat[1]),
            "integrator_rad_s": {angles: rest.x_e for angles, rest in rests.items()},
            "integrator_closed_form_rad_s": {angles: float(value) for angles, value in x_e.items()},
            "poles_of_A_LC_1_s": poles_as_pairs(poles),
        },
    )


def homogeneous_vicinity(biases_deg: Sequence[float] = (0.0, 0.25, 0.5)) -> Claim:
    """Judge section IV-C: the error of (10) ends in a vicinity of the origin, whose size e decides."""
    model = paper.printed_model()
    rates = {e: find_rest("homogeneous", e, "measured").x2_estimate for e in biases_deg}
    forms = {e: paper.rest_of_10(model, math.radians(e)) for e in biases_deg}
    error = max(abs(rates[e] - forms[e]) / max(abs(forms[e]), 5e-3) for e in biases_deg)
    return Claim(
        place="Section IV-C",
        statement=(
            "With alpha in (1/2, 1] the error of (10) converges to a vicinity of the origin: sin(y1) replaces sin(x1)."
        ),
        is_general=True,
        assumes={"e": f"{', '.join(f'{e:g}' for e in biases_deg)} deg"},
        holds=error < 0.1,
        conditions=f"Tried with the k1, k2 and alpha = {paper.TABLE_II['homogeneous']['alpha']:g} of Table II.",
        otherwise="The vicinity is not of the size that the equations give.",
        figures={
            "rate_estimate_rad_s": {f"{e:g}_deg": rates[e] for e in biases_deg},
            "rate_estimate_closed_form_rad_s": {f"{e:g}_deg": forms[e] for e in biases_deg},
        },
    )


def claims(on_share: OnShare) -> list[Claim]:
    """Judge section IV but for Proposition 1."""
    first = biased_luenberger()
    on_share(0.4)
    return [first, homogeneous_vicinity()]
