"""Where the laws of aranovskiy2020 and sokolov2019 rest: integrated, not solved for."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cmg_mj.papers.aranovskiy2020 import paper as pair
from cmg_mj.papers.linear_check import law_rests
from cmg_mj.papers.sokolov2019 import paper as single


@pytest.mark.parametrize("paper", [pair, single], ids=["aranovskiy2020", "sokolov2019"])
def test_rests_by_integrating_the_nonlinear_model(paper: ModuleType) -> None:
    """The reduced model under either law with y1 = x1 - e: the signs are a plus, not the printed minus."""
    model, e = paper.printed_model(), 1e-3
    is_so, figures = law_rests(model, paper.K_E, 1, 2)
    assert is_so
    static, integral = figures["gimbal_rest_of_1_rad_per_rad"], figures["integrator_rest_of_2_s_per_rad"]
    for k4, index, rest in ((0.0, 2, static), (paper.K_E[3], 3, integral)):
        gains = np.array([*paper.K_E[:3], k4])

        def slope(t: float, z: np.ndarray, gains: np.ndarray = gains) -> list[float]:
            x1, x2, x3, x_e = z.tolist()
            u = -float(gains @ [x1 - e, x2, x3, x_e])
            return [x2, model.tilt_acceleration(x1, x2, x3, u), u, -x3]

        final = solve_ivp(slope, (0.0, 100.0), np.zeros(4), rtol=1e-9, atol=1e-12).y[:, -1]
        assert final[index] / e == pytest.approx(rest, rel=1e-3)
        np.testing.assert_allclose(final[:2], 0.0, atol=1e-6)
