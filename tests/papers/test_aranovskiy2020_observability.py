"""The uniform observability that (10) of aranovskiy2020 needs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cmg_mj.papers.aranovskiy2020 import riccati
from cmg_mj.papers.aranovskiy2020.paper import A_prime, C

SEED = 910_000


def test_gramian_by_integration() -> None:
    """An a far larger than the rig's, held; Phi integrated by scipy."""
    a, T = 3.0, 0.5

    def slope(t: float, z: np.ndarray) -> np.ndarray:
        Phi = z[:9].reshape(3, 3)
        return np.concatenate([(A_prime(a) @ Phi).ravel(), (Phi.T @ C.T @ C @ Phi).ravel()])

    start = np.concatenate([np.eye(3).ravel(), np.zeros(9)])
    gramian = solve_ivp(slope, (0.0, T), start, rtol=1e-10, atol=1e-12).y[9:, -1].reshape(3, 3)
    values = np.linalg.eigvalsh(gramian)
    bounds = riccati.gramian_bounds(np.full(101, a), 0.005, T)
    assert bounds == pytest.approx((values[0], values[-1]), rel=1e-6)


def test_for_any_a_and_not_without_the_tilt() -> None:
    for a in (-10.0, 0.0, 0.0145, 10.0):
        assert riccati.observability_margin(a) > 1e-3
        assert riccati.observability_margin(a, C[1:]) < 1e-12
    assert riccati.observability(SEED).verdict == "reproduced within stated conditions"
