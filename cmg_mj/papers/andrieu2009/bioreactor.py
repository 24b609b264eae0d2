"""The bioreactor of section 3: Contois model (14), observability form (15), bounds on its increments."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property, reduce
from typing import Any

import numpy as np

from cmg_mj.core.arrays import Scalar, clip, signed_power
from cmg_mj.papers.claim import Array, Claim
from cmg_mj.papers.recorded import largest_size

# --- andrieu2009 as printed: system (1), and the bioreactor's and its observers' parameters of section 3 ---


def f2(g: Scalar, x2: Scalar, u: Scalar, p: float) -> Scalar:
    """Return x2' of (1), with the value of g at x1."""
    return g * x2 + signed_power(x2, 1.0 + p) + u


def Omega(g: Scalar, x2_hat: Scalar, p: float) -> Scalar:
    """Return (9) for (1), section 2.1: Gamma(u, y) = |g(y)| + 1 + p, v_2 = p."""
    return (abs(g) + 1.0 + p) * (1.0 + abs(x2_hat) ** p)


# Section 3.1. Normalised variables and time: no units.
HBAR, HBAR_OF_OBSERVERS = 1.0, 0.8
U_MIN, U_MAX = 0.01, 0.7
NOISE = 0.05
"""Standard deviation of the measurement disturbance; said to be a tenth of the range of eta1, which it is not."""
P, B = 0.9, 0.410
PHI1, PHI2, PHI3 = 0.03, 1.0, 3.0
L1, L2 = 0.01, 0.01


def dilution(t: float) -> float:
    """Return the input u, section 3.1."""
    return 0.410 if t < 10.0 else 0.02 if t < 20.0 else 0.6 if t < 35.0 else 0.1


# --- The bioreactor of section 3: Contois model (14), observability form (15), bounds on its increments ---


# Normalised variables: no units; time is the paper's, in its normalised seconds.
@dataclass(frozen=True)
class Bioreactor:
    """(14) with one value of hbar, and the set M_eta in which it stays."""

    hbar: float

    @cached_property
    def eps2(self) -> float:
        """The largest epsilon_2 that u_min >= eps2/(hbar (1 - eps2) + eps2) allows."""
        return U_MIN * self.hbar / (1.0 - U_MIN + U_MIN * self.hbar)

    @cached_property
    def eps1(self) -> float:
        """epsilon_1 that belongs to it."""
        return (1.0 - U_MAX) * self.eps2 / (self.hbar * U_MAX)

    def slope(self, eta1: Scalar, eta2: Scalar, u: Scalar) -> tuple[Scalar, Scalar]:
        """Return the right-hand side of (14)."""
        growth = self.to_x2(eta1, eta2)
        return growth - u * eta1, -growth + u * (1.0 - eta2)

    def to_x2(self, eta1: Scalar, eta2: Scalar) -> Scalar:
        """Return the second component of F, the growth in (14)."""
        return eta1 * eta2 / (self.hbar * eta1 + eta2)

    def to_eta2(self, x1: Scalar, x2: Scalar) -> Scalar:
        """Return the second component of F's inverse."""
        return self.hbar * x1 * x2 / (x1 - x2)

    def x2_bounds(self, x1: Scalar) -> tuple[Scalar, Scalar]:
        """Return the least and largest x2 of M_x at an x1 that lies in [eps1, 1 - eps2]."""
        return self.to_x2(x1, self.eps2), self.to_x2(x1, 1.0 - x1)

    def limit(self, x1: Scalar, x2: Scalar) -> tuple[Scalar, Scalar]:
        """Return x_1s and x_2s."""
        x1 = clip(x1, self.eps1, 1.0 - self.eps2)
        return x1, clip(x2, *self.x2_bounds(x1))

    def coefficients(self, u: Scalar, x1: Scalar) -> tuple[Scalar, Scalar, Scalar, Scalar]:
        """Return m0 to m3 of (15)."""
        hbar, first, second = self.hbar, self.hbar * x1, self.hbar * x1**2
        return u / hbar, -u - 1.0 / hbar - 2.0 * u / first, 2.0 / first + u / second, (hbar - 1.0) / second

    def f2(self, u: Scalar, x1: Scalar, x2: Scalar) -> Scalar:
        """Return f2 of (15)."""
        m0, m1, m2, m3 = self.coefficients(u, x1)
        return m0 + x2 * (m1 + x2 * (m2 + x2 * m3))

    def f2_slope(self, u: Scalar, x1: Scalar, x2: Scalar) -> Scalar:
        """Return df2/dx2."""
        _, m1, m2, m3 = self.coefficients(u, x1)
        return m1 + x2 * (2.0 * m2 + 3.0 * m3 * x2)

    def domain(self, points: int) -> tuple[Array, Array, Array]:
        """Return a grid of M_u x M_x with its corners, denser at small x1: u, x1, x2, each (points, points, points)."""
        x1 = np.geomspace(self.eps1, 1.0 - self.eps2, points)[:, None, None]
        low, high = self.x2_bounds(x1)
        x2 = low + (high - low) * np.linspace(0.0, 1.0, points)[None, :, None]
        u = np.linspace(U_MIN, U_MAX, points)[None, None, :]
        u, x1, x2 = np.broadcast_arrays(u, x1, x2)
        return u, x1, x2

    @cached_property
    def df2_max(self) -> float:
        """df_2max: the largest |df2/dx2| over M_u x M_x, for the constant gain."""
        return largest_size(self.f2_slope(*self.domain(120)))

    def Omega1(self, u: Scalar, x1: Scalar, x2_hat: Scalar) -> Scalar:
        """Return Omega_1, for the updated gain: the largest |slope of a secant of f2 from x2_hat|.

        The secant's slope is a parabola in x2, so it is largest at an end of the interval or at the vertex.

        Args:
            u: Input.
            x1: x_1s.
            x2_hat: Estimate, limited.

        Returns:
            The bound.
        """
        _, m1, m2, m3 = self.coefficients(u, x1)
        low, high = self.x2_bounds(x1)
        m = m2 + m3 * x2_hat
        vertex = clip(-0.5 * m / _not_zero(m3), low, high)
        return _largest(lambda x2: m1 + m * (x2_hat + x2) + m3 * x2**2, low, high, vertex)

    def Omega2(self, u: Scalar, x1: Scalar, x2_hat: Scalar, p: float, *, with_misprint: bool = False) -> Scalar:
        """Return Omega_2, for the updated gain and the homogeneous correction.

        Its last term is m3 x2^(2-p); the paper prints m2 there, which is not what its inequality needs. Its derivative
        by x2 has one zero, so it is largest at an end of the interval or there.

        Args:
            u: Input.
            x1: x_1s.
            x2_hat: Estimate, limited.
            p: Power of the error term.
            with_misprint: Take m2 in the last term.

        Returns:
            The bound.
        """
        _, m1, m2, m3 = self.coefficients(u, x1)
        low, high = self.x2_bounds(x1)
        m, last = m2 + m3 * x2_hat, m2 if with_misprint else m3
        stationary = clip(-m * (1.0 - p) / (_not_zero(last) * (2.0 - p)), low, high)
        at_estimate, share = m1 + m * x2_hat, x2_hat**p
        return _largest(lambda x2: at_estimate + share * x2 ** (1.0 - p) * (m + last * x2), low, high, stationary)

    def local_c_inf(self, u: Scalar, x1: Scalar, x2: Scalar, x2_hat: Scalar, p: float) -> Scalar:
        """Return what c_inf of the same bound is the largest value of."""
        _, _, m2, m3 = self.coefficients(u, x1)
        return np.abs((m2 + m3 * x2_hat) * x2 ** (1.0 - p) + m3 * x2 ** (2.0 - p))


def _largest(function: Any, *arguments: Scalar) -> Scalar:
    return reduce(np.maximum, (np.abs(function(x2)) for x2 in arguments))


def _not_zero(m: Scalar) -> Scalar:
    """Replace 0 by a tiny number: for hbar = 1, m3 = 0 and there is no stationary point."""
    return np.where(m == 0.0, 1e-300, m)


# --- Section 3, the bioreactor before it is simulated: its set, coordinates, bounds on its increments ---

ROUNDING = 1e-9


def least_inflow(reactor: Bioreactor, u_min: float, u_max: float) -> float:
    """Return the least component of the flow into M_eta over its boundary and all inputs, not below 0 if invariant."""
    u = np.linspace(u_min, u_max, 401)[:, None]
    eps1, eps2 = reactor.eps1, reactor.eps2
    along = (1.0 - eps1 - eps2) * np.linspace(0.0, 1.0, 401)[None, :]
    left_inflow, _ = reactor.slope(eps1, eps2 + along, u)
    _, lower_inflow = reactor.slope(eps1 + along, eps2, u)
    outer_flow = np.add(*reactor.slope(eps1 + along, 1.0 - (eps1 + along), u))
    return min(left_inflow.min(), lower_inflow.min(), -outer_flow.max())


def invariance() -> Claim:
    """Judge M_eta."""
    reactor = Bioreactor(HBAR)
    inflow = {hbar: least_inflow(Bioreactor(hbar), U_MIN, U_MAX) for hbar in (HBAR, HBAR_OF_OBSERVERS)}
    return Claim(
        "Section 3, (14), M_eta",
        "M_eta = {eta1 >= eps1, eta2 >= eps2, eta1 + eta2 <= 1} is forward invariant for u in [u_min, u_max].",
        holds=min(inflow.values()) > -ROUNDING,
        figures={
            "least_inflow_per_time": inflow,
            "least_inflow_too_large_input_per_time": least_inflow(reactor, U_MIN, 1.1 * U_MAX),
            "eps1": reactor.eps1,
            "eps2": reactor.eps2,
        },
    )


def coordinate_errors(hbar: float) -> tuple[float, float]:
    """Return the largest relative errors of (15) along (14), by central differences of F, and of F's inverse."""
    reactor, count, span = Bioreactor(hbar), 2000, 1e-4
    rng = np.random.default_rng(0)
    eta1, eta2, _ = 0.02 + 0.94 * rng.dirichlet((1.0, 1.0, 1.0), count).T
    u = rng.uniform(U_MIN, U_MAX, count)
    x2 = reactor.to_x2(eta1, eta2)
    slope1, slope2 = reactor.slope(eta1, eta2, u)
    ahead, behind = (reactor.to_x2(eta1 + h * slope1, eta2 + h * slope2) for h in (span, -span))
    numeric_slope = (ahead - behind) / (2.0 * span)
    error = largest_size(reactor.f2(u, eta1, x2) - numeric_slope) / largest_size(numeric_slope)
    return error, largest_size(reactor.to_eta2(eta1, x2) / eta2 - 1.0)


def coordinates() -> Claim:
    """Judge (15)."""
    slope, inverse = map(max, coordinate_errors(HBAR), coordinate_errors(HBAR_OF_OBSERVERS))
    return Claim(
        "Section 3, (15)",
        "In the coordinates x = F(eta) the system has the explicit observability canonical form, with f2 a "
        "cubic in x2.",
        holds=slope < 1e-6 and inverse < 1e-9,
        figures={"largest_f2_error_ratio": slope, "largest_inverse_error_ratio": inverse},
    )


@cache
def increments_over_domain(hbar: float, p: float = P, points: int = 32) -> dict[str, float]:
    """Evaluate both inequalities of section 3 over a grid of (u, x1, x2, x2_hat).

    Args:
        hbar: Parameter of the bioreactor.
        p: Power of the error term.
        points: Points of the grid along each.

    Returns:
        Largest quotients: of |f2(x2) - f2(x2_hat)| and its bounds, `by_...`; of |df2/dx2| and Omega_2 at one point; of
        the bounds. `printed` is Omega_2 ending in m2 x2^(2-p), `local` has c_inf at each point, not its maximum.
    """
    reactor = Bioreactor(hbar)
    u, x1, x2 = (grid[..., None] for grid in reactor.domain(points))
    low, high = reactor.x2_bounds(x1)
    x2_hat = low + (high - low) * np.linspace(0.0, 1.0, points)
    d = np.abs(x2 - x2_hat)
    distinct = d > 1e-9  # nearer, the increments are rounding errors
    increment = np.where(distinct, np.abs(reactor.f2(u, x1, x2) - reactor.f2(u, x1, x2_hat)), 0.0)
    local = reactor.local_c_inf(u, x1, x2, x2_hat, p)
    any_x2_hat = np.linspace(reactor.x2_bounds(reactor.eps1)[0], reactor.x2_bounds(1.0 - reactor.eps2)[1], points)
    c_inf = reactor.local_c_inf(u, x1, x2, any_x2_hat, p).max()
    # The bounds do not depend on x2: one value of it will do.
    point = u[:, :1], x1[:, :1], x2_hat[:, :1]
    Omega1 = reactor.Omega1(*point)
    Omega2, printed = (reactor.Omega2(*point, p, with_misprint=flag) for flag in (False, True))
    slope = np.abs(reactor.f2_slope(*point))
    ratio = Omega2 / Omega1

    def largest_quotient(Omega: Array, c: Array | float) -> float:
        return (increment / np.where(distinct, Omega * d + c * d ** (1.0 + p), 1.0)).max()

    return {
        "by_Omega1_ratio": largest_quotient(Omega1, 0.0),
        "by_Omega2_ratio": largest_quotient(Omega2, c_inf),
        "by_Omega2_printed_ratio": largest_quotient(printed, c_inf),
        "by_Omega2_local_ratio": largest_quotient(Omega2, local),
        "by_Omega2_local_printed_ratio": largest_quotient(printed, local),
        "c_inf": c_inf,
        "slope_over_Omega2_ratio": (slope / Omega2).max(),
        "slope_over_Omega2_printed_ratio": (slope / printed).max(),
        "Omega2_over_Omega1_ratio": ratio.max(),
        "share_Omega2_above_Omega1_ratio": (ratio > 1.0 + ROUNDING).mean(),
        "Omega1_over_largest_ratio": Omega1.max() / reactor.df2_max,
    }


def increments() -> Claim:
    """Judge the two inequalities, and the misprint."""
    quotients = increments_over_domain(HBAR_OF_OBSERVERS)
    bounds = [quotients[name] for name in ("by_Omega1_ratio", "by_Omega2_ratio", "by_Omega2_local_ratio")]
    printed = max(quotients["by_Omega2_local_printed_ratio"], quotients["slope_over_Omega2_printed_ratio"])
    correction = (
        "With m3, not m2, in the last term of Omega_2: only then is it the first of the two terms into which the "
        "secant's slope is parted."
    )
    return Claim(
        "Section 3, Omega_1, Omega_2, c_inf",
        "|f2(x2) - f2(x2_hat)| is at most Omega_1 |x2 - x2_hat|, and at most Omega_2 |x2 - x2_hat| + c_inf "
        "|x2 - x2_hat|^(1+p).",
        holds=max(bounds) <= 1.0 + ROUNDING,
        conditions=correction if printed > 1.0 + ROUNDING else "",
        otherwise=correction,
        figures=quotients,
    )


def order_of_bounds() -> Claim:
    """Judge df2/dx2 <= Omega_2 <= Omega_1 <= df2_max."""
    quotients = increments_over_domain(HBAR_OF_OBSERVERS)
    figures = {
        "df2_max_per_time": Bioreactor(HBAR_OF_OBSERVERS).df2_max,
        "slope_over_Omega2_ratio": quotients["slope_over_Omega2_ratio"],
        "Omega2_over_Omega1_ratio": quotients["Omega2_over_Omega1_ratio"],
        "share_Omega2_above_Omega1": quotients["share_Omega2_above_Omega1_ratio"],
        "Omega1_over_df2_max_ratio": quotients["Omega1_over_largest_ratio"],
    }
    return Claim(
        "Section 3, order of the bounds",
        "df2/dx2 <= Omega_2 <= Omega_1 <= df2_max over the whole domain.",
        holds={
            "df2/dx2 <= Omega_2": figures["slope_over_Omega2_ratio"] <= 1.0 + ROUNDING,
            "Omega_2 <= Omega_1": figures["Omega2_over_Omega1_ratio"] <= 1.0 + ROUNDING,
            "Omega_1 <= df2_max": figures["Omega1_over_df2_max_ratio"] <= 1.0 + ROUNDING,
        },
        conditions="With m3, not m2, in the last term of Omega_2.",
        otherwise=f"Omega_2 <= Omega_1 fails at {1e2 * figures['share_Omega2_above_Omega1']:.2g} % of the points for "
        f"hbar = 0.8, by at most {1e2 * (figures['Omega2_over_Omega1_ratio'] - 1.0):.2g} %; the largest quotient for "
        f"hbar = 1 is {increments_over_domain(HBAR)['Omega2_over_Omega1_ratio']:.6f}. Of hbar = 0.6 to 1.5 it holds "
        "from 0.9 on; the paper gives the bounds for any hbar, and its observers have 0.8.",
        figures=figures,
    )


def noise_level() -> Claim:
    """Judge the noise, said to be 10 % of the domain."""
    reactor = Bioreactor(HBAR)
    tenth = 0.1 * (1.0 - reactor.eps2 - reactor.eps1)
    return Claim(
        "Section 3.1, the noise",
        f"The noise on eta1 has the standard deviation {NOISE}, said to be a tenth of the range of eta1.",
        holds=abs(tenth - NOISE) < 0.005,
        otherwise=f"The two figures do not agree, nor do {NOISE} and a tenth of the range that eta1 visits, 0.06 after "
        f"t = 5. All else here uses {NOISE}; Fig. 2's order holds with either.",
        figures={"tenth_of_domain": tenth, "noise_used": NOISE},
    )
