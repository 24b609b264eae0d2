"""Section 4.2: the correction K along a chain of integrators."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.integrate import solve_ivp

from cmg_mj.core.arrays import signed_power
from cmg_mj.papers.andrieu2009.bi_limit import BiLimitCorrection, weights
from cmg_mj.papers.claim import Claim


def theorem_2() -> Claim:
    """Judge Theorem 2, and Definition 1."""
    sizes, dimensions = (1e-3, 1.0, 1e3), (1, 2, 3)
    ends, limits = {}, {}
    for n in dimensions:
        for share in (0.0, 0.5, 0.9):
            d_inf = share / (n - 1) if n > 1 else share
            K = BiLimitCorrection(recursive_l(n), d_inf)
            ends[f"n={n}, d_inf={d_inf:g}"] = chain_errors(K, sizes, 3, 40.0)
            if d_inf:
                limits[f"n={n}, d_inf={d_inf:g}"] = [max(limits_error(K, scale)) for scale in (1e4, 1e8, 1e12)]
    largest_end = max(ends.values())
    limits_shrink = all(a > b > c for a, b, c in limits.values())
    growth = chain_errors(BiLimitCorrection((1.0, 2.0, 0.9), 0.2), (1.0,), 3, 40.0)
    by_simulation = (
        "Convergence is shown by simulation from random errors, the construction of W for two dimensions only, by the "
        "claim on (19) and (20)."
    )
    return Claim(
        place="Section 4.2, Theorem 2 (and Definition 1)",
        statement="There is a K, homogeneous in the bi-limit, with which the error of a chain of integrators "
        "converges, for any n and any d_inf in [0, 1/(n-1)).",
        is_general=True,
        holds=largest_end < 1e-3 and limits_shrink,
        conditions=by_simulation,
        otherwise=by_simulation,
        figures={
            "largest_final_error_ratio": ends,
            "deviation_from_limits_ratio": limits,
            "poor_l_final_error_ratio": growth,
        },
    )


def limits_error(correction: BiLimitCorrection, scale: float) -> tuple[float, float]:
    """Measure, by Definition 1, the errors of K, dilated, from its approximations at 0 and at infinity, |e1| <= 1.

    Args:
        correction: K.
        scale: Lambda for infinity; its inverse for 0.

    Returns:
        The largest deviation of a component at 0 and at infinity, over its approximation's largest value.
    """
    e1 = np.linspace(-1.0, 1.0, 41)
    r = weights(correction.n, correction.d_inf)
    zero_error = inf_error = 0.0
    linear, power = e1, e1
    dilated = correction(e1 / scale), correction(scale ** r[0] * e1)
    for i in range(correction.n):
        linear = correction.l[i] * linear
        power = signed_power(correction.l[i] * power, r[i + 1] / r[i])
        zero_error = max(zero_error, float(np.abs(scale * dilated[0][i] + linear).max() / np.abs(linear).max()))
        inf_error = max(inf_error, float(np.abs(dilated[1][i] / scale ** r[i + 1] + power).max() / np.abs(power).max()))
    return zero_error, inf_error


def chain_errors(
    correction: BiLimitCorrection, sizes: Sequence[float], count: int, span: float, seed: int = 0
) -> float:
    """Let dE/dtau = S E + K(e1) run from random E of the given sizes.

    Args:
        correction: K.
        sizes: Lengths of E at the start.
        count: Random directions for each.
        span: Time tau to run.
        seed: Seed of the directions.

    Returns:
        The worst length at the end, over the length at the start; infinite if a solution could not be followed.
    """
    rng = np.random.default_rng(seed)
    n, largest_ratio = correction.n, 0.0

    def slope(_: float, E: np.ndarray) -> list[float]:
        *numbers, last = correction(float(E[0]))
        if not math.isfinite(last):  # LSODA would go on for ever
            raise OverflowError
        return [*(float(E[i + 1]) + number for i, number in enumerate(numbers)), last]

    for size in sizes:
        for _ in range(count):
            start = rng.normal(size=n)
            start *= size / np.linalg.norm(start)
            try:
                solution = solve_ivp(slope, (0.0, span), start, "LSODA", rtol=1e-6, atol=1e-9 * size)
            except OverflowError:
                return math.inf
            end = float(np.linalg.norm(solution.y[:, -1]))
            largest_ratio = max(largest_ratio, end / size if solution.success and math.isfinite(end) else math.inf)
    return largest_ratio


def recursive_l(n: int, ratio: float = 2.0) -> tuple[float, ...]:
    """Return l_i = ratio^(n - i)."""
    return tuple(ratio ** (n - i) for i in range(1, n + 1))
