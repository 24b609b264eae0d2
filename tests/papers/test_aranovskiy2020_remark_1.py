"""Remark 1 of aranovskiy2020: the Riccati equation of (10) by several methods, and as it is printed."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from cmg_mj.features.replay import replay
from cmg_mj.observers import Estimate, Measurement, make_observer
from cmg_mj.papers.aranovskiy2020 import forms_of_10, riccati
from cmg_mj.papers.aranovskiy2020.paper import A_prime, C, Q, printed_model, settled_gains
from cmg_mj.papers.aranovskiy2020.riccati import transient
from cmg_mj.papers.pair import DT, run_of_10
from cmg_mj.results.trajectory import Trajectory

SEED = 910_000


def test_methods_converge_with_their_orders_and_ours_is_exact() -> None:
    for method, order in (("explicit Euler", 1.0), ("Runge-Kutta 4", 4.0)):
        errors = [transient(method, rate).error for rate in (1000.0, 2000.0)]
        assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3)
    assert transient("exact step (ours)", 37.0).error < 1e-10


def test_plain_form_agrees_with_ours_at_a_small_step() -> None:
    """(10) written out with 3x3 matrices is the same observer: the difference fades with the step."""
    differences = []
    for dt in (1e-3, 5e-4):
        plain, exact = forms_of_10.Plain(forms_of_10.euler, dt), forms_of_10.make_exact(dt)
        y = Measurement(0.01, 0.2)
        a, b = plain.init(y), exact.init(y)
        x, estimate = a[0], Estimate(0.0, 0.0, 0.0)
        for k in range(round(0.3 / dt)):
            y = Measurement(0.01 + 0.03 * math.sin(9.0 * k * dt), 0.2)
            a, x = plain.step(a, y, 0.3)
            b, estimate = exact.step(b, y, 0.3)
        differences.append(abs(x[1] - estimate.x2))
    assert differences[1] < 0.65 * differences[0]
    assert differences[1] < 0.02
    assert abs(2.0 * differences[1] - differences[0]) < 0.05 * differences[1]  # in proportion to it, to nothing


def test_the_printed_riccati_equation_makes_no_symmetric_matrix_and_hardly_matters() -> None:
    """It settles at a root of its nine equations. Judged as printed: symmetric, or as good as what is."""
    corrected_H, printed_H = riccati.settle(forms_of_10.rk4), riccati.settle(forms_of_10.rk4_as_printed)
    A, lost = A_prime(), C.T @ C
    for H, first in ((corrected_H, A), (printed_H, printed_model().A)):
        slope = H @ first.T + A @ H - H @ lost @ H + Q
        assert np.abs(slope).max() < 1e-6 * np.abs(H @ lost @ H).max()
    assert abs(printed_H[0, 1] / printed_H[1, 0] - 1.0) > 0.02
    corrected, printed = forms_of_10.Plain(forms_of_10.rk4), forms_of_10.Plain(forms_of_10.rk4_as_printed)
    rate = forms_of_10.compare(corrected, printed, SEED)
    assert 0.0 < rate.difference < 0.02 * rate.error
    assert riccati.misprint_claim(corrected_H, printed_H, rate).verdict == "reproduced within stated conditions"
    mattering = rate._replace(difference=0.1 * rate.error)
    assert riccati.misprint_claim(corrected_H, printed_H, mattering).verdict == "not reproduced"
    assert riccati.misprint_claim(corrected_H, corrected_H, mattering).verdict == "reproduced"


@pytest.mark.parametrize("exact_gain", [False, True])
def test_ten_by_euler_on_floats_and_arrays_is_the_plain_one(exact_gain: bool) -> None:
    run = run_of_10(SEED)
    plain = replay(forms_of_10.Plain(forms_of_10.euler), run).x2
    by_floats = replay(forms_of_10.TenByEuler(DT, printed_model(), exact_gain=exact_gain), run).x2
    late = slice(200 if exact_gain else 0, None)
    np.testing.assert_allclose(by_floats[late], plain[late], atol=2e-4 if exact_gain else 1e-9)
    columns = {name: np.stack([run[name]] * 2, axis=1) for name in ("y1_rad", "y2_rad", "u_rad_s")}
    by_arrays = replay(forms_of_10.TenByEuler(DT, printed_model(), exact_gain=exact_gain), Trajectory(columns)).x2
    np.testing.assert_allclose(by_arrays[:, 1], by_floats, rtol=1e-9, atol=1e-12)


def test_eleven_by_euler_approaches_the_benchs() -> None:
    """The difference fades with the step; with a J2 whose drag on the rate is seen."""
    model, differences = dataclasses.replace(printed_model(), J2=-0.03), []
    for dt in (1e-3, 2.5e-4):
        euler, exact = forms_of_10.ElevenByEuler(dt, model), make_observer("homogeneous", dt, model)
        y = Measurement(0.01, 0.2)
        a, b, rates = euler.init(y), exact.init(y), (0.0, 0.0)
        for k in range(round(0.3 / dt)):
            y = Measurement(0.01 + 0.03 * math.sin(9.0 * (k + 1) * dt), 0.2)
            (a, first), (b, second) = euler.step(a, y, 4.0), exact.step(b, y, 4.0)
            rates = first.x2, second.x2
        differences.append(abs(rates[0] - rates[1]))
    assert differences[1] < 0.4 * differences[0]
    assert differences[1] < 0.01


def test_the_cost_of_an_update(tmp_path: Path) -> None:
    """As the instructions are recorded, (11) is the dearest; were its powers for nothing, (10) would be."""
    recorded = json.loads(riccati.RECORDED.read_text())
    claim = riccati.cost()
    assert claim.verdict == "not reproduced"
    times = claim.figures["update_us"]
    assert times["ltv, plain Runge-Kutta 4"] > times["ltv, plain Euler"]
    assert times["ltv"] > times["homogeneous"] > times["linear"] > 0.0
    path = tmp_path / "cheap.json"
    path.write_text(json.dumps(recorded | {"homogeneous": 2.0 * recorded["linear"]}))
    assert riccati.cost(path).verdict == "reproduced"


def test_settled_gains_solve_the_algebraic_riccati_equation() -> None:
    H = solve_continuous_are(A_prime().T, C.T, Q, np.eye(2))
    assert settled_gains() == pytest.approx((H[0, 0], H[0, 1]), rel=1e-9)
