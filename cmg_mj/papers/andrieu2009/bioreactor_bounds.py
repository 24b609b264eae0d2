"""Section 3, the bioreactor before it is simulated: its set, coordinates, bounds on its increments."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from cmg_mj.papers.andrieu2009.bioreactor import Bioreactor
from cmg_mj.papers.andrieu2009.paper import HBAR, HBAR_OF_OBSERVERS, NOISE, U_MAX, P
from cmg_mj.papers.claim import Claim, OnShare, obtain

ROUNDING = 1e-9


def claims(on_share: OnShare) -> list[Claim]:
    """Judge (14), (15), Omega_1, Omega_2 and their order, the noise."""
    return obtain([invariance, coordinates, increments, order_of_bounds, noise_level], on_share)


def least_inflow(reactor: Bioreactor, u_min: float, u_max: float, points: int = 401) -> float:
    """Return the least component of the flow into M_eta over its boundary and all inputs, not below 0 if invariant."""
    u = np.linspace(u_min, u_max, points)[:, None]
    share = np.linspace(0.0, 1.0, points)[None, :]
    eps1, eps2 = reactor.eps1, reactor.eps2
    left_inflow, _ = reactor.slope(eps1, eps2 + (1.0 - eps1 - eps2) * share, u)
    _, lower_inflow = reactor.slope(eps1 + (1.0 - eps1 - eps2) * share, eps2, u)
    eta1 = eps1 + (1.0 - eps1 - eps2) * share
    outer_flow = np.add(*reactor.slope(eta1, 1.0 - eta1, u))
    return float(min(left_inflow.min(), lower_inflow.min(), -outer_flow.max()))


def invariance() -> Claim:
    """Judge M_eta."""
    inflow = {hbar: least_inflow(Bioreactor(hbar), Bioreactor(hbar).u_min, U_MAX) for hbar in (HBAR, HBAR_OF_OBSERVERS)}
    inflow_at_larger_input = least_inflow(Bioreactor(HBAR), Bioreactor(HBAR).u_min, 1.1 * U_MAX)
    reactor = Bioreactor(HBAR)
    return Claim(
        place="Section 3, (14), M_eta",
        statement="M_eta = {eta1 >= eps1, eta2 >= eps2, eta1 + eta2 <= 1} is forward invariant for u in [u_min, "
        "u_max].",
        holds=min(inflow.values()) > -ROUNDING,
        figures={
            "least_inflow_per_time": {str(hbar): value for hbar, value in inflow.items()},
            "least_inflow_too_large_input_per_time": inflow_at_larger_input,
            "eps1": reactor.eps1,
            "eps2": reactor.eps2,
        },
    )


def coordinate_errors(hbar: float, count: int = 2000, seed: int = 0) -> tuple[float, float]:
    """Return the largest relative errors of (15) along (14), by central differences of F, and of F's inverse."""
    reactor = Bioreactor(hbar)
    rng = np.random.default_rng(seed)
    eta1, eta2, _ = 0.02 + 0.94 * rng.dirichlet((1.0, 1.0, 1.0), count).T
    u = rng.uniform(reactor.u_min, reactor.u_max, count)
    x2 = reactor.to_x2(eta1, eta2)
    slope1, slope2 = reactor.slope(eta1, eta2, u)
    span = 1e-4
    x2_ahead = reactor.to_x2(eta1 + span * slope1, eta2 + span * slope2)
    x2_behind = reactor.to_x2(eta1 - span * slope1, eta2 - span * slope2)
    numeric_slope = (x2_ahead - x2_behind) / (2.0 * span)
    error = np.abs(reactor.f2(eta1, x2, u) - numeric_slope).max() / np.abs(numeric_slope).max()
    return float(error), float(np.abs(reactor.to_eta2(eta1, x2) / eta2 - 1.0).max())


def coordinates() -> Claim:
    """Judge (15)."""
    errors = [coordinate_errors(hbar) for hbar in (HBAR, HBAR_OF_OBSERVERS)]
    slope, inverse = (max(column) for column in zip(*errors, strict=True))
    return Claim(
        place="Section 3, (15)",
        statement="In the coordinates x = F(eta) the system has the explicit observability canonical form, with f2 a "
        "cubic in x2.",
        holds=slope < 1e-6 and inverse < 1e-9,
        figures={"largest_f2_error_ratio": slope, "largest_inverse_error_ratio": inverse},
    )


class Increments(NamedTuple):
    """Quotients of |f2(x2) - f2(x2_hat)| and its bounds, and of the bounds, over a grid of the domain."""

    by_Omega1: float
    by_Omega2: float
    by_Omega2_printed: float
    """Omega_2 ending in m2 x2^(2-p), as printed."""
    by_Omega2_local: float
    """Omega_2 with c_inf at each point in place of its maximum."""
    by_Omega2_local_printed: float
    c_inf: float
    slope_over_Omega2: float
    """The largest |df2/dx2| over Omega_2 at the same point."""
    slope_over_Omega2_printed: float
    Omega2_over_Omega1: float
    share_Omega2_above_Omega1: float
    Omega1_over_largest: float


@functools.cache
def increments_over_domain(hbar: float, p: float = P, points: int = 32) -> Increments:
    """Evaluate both inequalities of section 3 over a grid of (u, x1, x2, x2_hat)."""
    reactor = Bioreactor(hbar)
    x1, x2, u = (grid[..., None] for grid in reactor.domain(points))
    low, high = reactor.x2_bounds(x1)
    x2_hat = low + (high - low) * np.linspace(0.0, 1.0, points)
    d = np.abs(x2 - x2_hat)
    distinct = d > 1e-9  # nearer, the increments are rounding errors
    increment = np.where(distinct, np.abs(reactor.f2(x1, x2, u) - reactor.f2(x1, x2_hat, u)), 0.0)
    _, _, m2, m3 = reactor.coefficients(x1, u)
    c_inf = reactor.c_inf(p, points)
    local = np.abs((m2 + m3 * x2_hat) * x2 ** (1.0 - p) + m3 * x2 ** (2.0 - p))
    # The bounds do not depend on x2: one value of it will do.
    point = u[:, :1], x1[:, :1], x2_hat[:, :1]
    Omega1 = reactor.Omega1(*point)
    Omega2, Omega2_printed = (reactor.Omega2(*point, p, with_misprint=flag) for flag in (False, True))
    slope = np.abs(reactor.f2_slope(*point[1:], point[0]))

    def largest_quotient(Omega: np.ndarray, c: np.ndarray | float) -> float:
        return float((increment / np.where(distinct, Omega * d + c * d ** (1.0 + p), 1.0)).max())

    ratio = Omega2 / Omega1
    return Increments(
        largest_quotient(Omega1, 0.0),
        largest_quotient(Omega2, c_inf),
        largest_quotient(Omega2_printed, c_inf),
        largest_quotient(Omega2, local),
        largest_quotient(Omega2_printed, local),
        c_inf,
        float((slope / Omega2).max()),
        float((slope / Omega2_printed).max()),
        float(ratio.max()),
        float((ratio > 1.0 + ROUNDING).mean()),
        float(Omega1.max() / reactor.df2_max),
    )


def increments() -> Claim:
    """Judge the two inequalities, and the misprint."""
    quotients = increments_over_domain(HBAR_OF_OBSERVERS)
    bounds_hold = max(quotients.by_Omega1, quotients.by_Omega2, quotients.by_Omega2_local) <= 1.0 + ROUNDING
    misprint = max(quotients.by_Omega2_local_printed, quotients.slope_over_Omega2_printed) > 1.0 + ROUNDING
    correction = (
        "With m3, not m2, in the last term of Omega_2: only then is it the first of the two terms into which the "
        "secant's slope is parted."
    )
    return Claim(
        place="Section 3, Omega_1, Omega_2, c_inf",
        statement="|f2(x2) - f2(x2_hat)| is at most Omega_1 |x2 - x2_hat|, and at most Omega_2 |x2 - x2_hat| + c_inf "
        "|x2 - x2_hat|^(1+p).",
        holds=bounds_hold,
        conditions=correction if misprint else "",
        otherwise=correction,
        figures={f"{name}_ratio" if name != "c_inf" else name: value for name, value in quotients._asdict().items()},
    )


def order_of_bounds() -> Claim:
    """Judge df2/dx2 <= Omega_2 <= Omega_1 <= df2_max."""
    quotients = increments_over_domain(HBAR_OF_OBSERVERS)
    exact_quotients = increments_over_domain(HBAR)
    df2_max = Bioreactor(HBAR_OF_OBSERVERS).df2_max
    excess = quotients.Omega2_over_Omega1 - 1.0
    violation = (
        f"Omega_2 <= Omega_1 fails at {1e2 * quotients.share_Omega2_above_Omega1:.2g} % of the points for hbar = 0.8, "
        f"by at most {1e2 * excess:.2g} %; the largest quotient for hbar = 1 is "
        f"{exact_quotients.Omega2_over_Omega1:.6f}."
    )
    return Claim(
        place="Section 3, order of the bounds",
        statement="df2/dx2 <= Omega_2 <= Omega_1 <= df2_max over the whole domain.",
        holds={
            "df2/dx2 <= Omega_2": quotients.slope_over_Omega2 <= 1.0 + ROUNDING,
            "Omega_2 <= Omega_1": excess <= ROUNDING,
            "Omega_1 <= df2_max": quotients.Omega1_over_largest <= 1.0 + ROUNDING,
        },
        conditions="With m3, not m2, in the last term of Omega_2.",
        otherwise=violation,
        figures={
            "df2_max_per_time": df2_max,
            "slope_over_Omega2_ratio": quotients.slope_over_Omega2,
            "Omega2_over_Omega1_ratio": quotients.Omega2_over_Omega1,
            "share_Omega2_above_Omega1": quotients.share_Omega2_above_Omega1,
            "Omega1_over_df2_max_ratio": quotients.Omega1_over_largest,
        },
    )


def noise_level() -> Claim:
    """Judge the noise, said to be 10 % of the domain."""
    reactor = Bioreactor(HBAR)
    tenth = 0.1 * (1.0 - reactor.eps2 - reactor.eps1)
    return Claim(
        place="Section 3.1, the noise",
        statement=f"The noise on eta1 has the standard deviation {NOISE}, said to be a tenth of the range of eta1.",
        holds=abs(tenth - NOISE) < 0.005,
        otherwise=f"The two figures do not agree. All else here uses {NOISE}; Fig. 2's order holds with either.",
        figures={"tenth_of_domain": tenth, "noise_used": NOISE},
    )
