"""The rig's observers `adaptive` and `high_gain`, which are written out by hand, against the papers' general forms."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.observers import Measurement
from cmg_mj.observers.adaptive import Adaptive
from cmg_mj.papers.andrieu2009.observer import BiLimitCorrection, UpdatedHighGain, list_violations
from cmg_mj.papers.dao2023.observer import FriedlandTacker, System
from tests.observers.reference import DT, HEAVY, rough_signals, run
from tests.observers.test_adaptive import MODES, PAIR, adaptive
from tests.observers.test_high_gain import CASES, DEFAULTS, high_gain

HEAVY_PAIR = dataclasses.replace(HEAVY, gimbals=2)

GAINS: dict[str, Any] = {"L": (-9.0, -60.0), "Gamma": (2.0, 3.0, 5.0), "Sigma": 40.0}


def general(rig: Adaptive) -> tuple[FriedlandTacker, Callable[[float, float, float], System]]:
    """The same observer in the general form, and the matrices at measured angles and a gimbal rate."""
    m, known_bias = rig.model, math.radians(rig.known_bias_deg)
    w = 2.0 * math.pi * rig.sinusoid_hz
    constants = int(rig.bias or rig.torque)
    nm = constants + 2 * bool(w)
    Am, Cm = np.zeros((nm, nm)), np.zeros((constants + bool(w), nm))
    Cm[:constants, :constants] = np.eye(constants)
    weights = [rig.Gamma[0] if rig.bias else rig.Gamma[1]] * constants
    if w:
        Am[-2, -1], Am[-1, -2], Cm[-1, -1] = -w, w, 1.0
        weights += [rig.Gamma[2]] * 2
    form = FriedlandTacker(rig.dt, Am, Cm, np.array(rig.L)[:, None], np.diag(weights), np.array([[rig.Sigma]]))

    def matrices(y1: float, y2: float, u: float) -> System:
        D = m.J1 + m.J2 * math.sin(y2) ** 2
        A = np.array([[0.0, 1.0], [0.0, -u * m.J2 * math.sin(2.0 * y2) / D]])
        per_bias, per_torque = m.gravity_torque * math.cos(y1) / D, 1.0 / (m.gimbals * D)
        lower = [per_bias if rig.bias else per_torque] * constants + [per_torque] * bool(w)
        known_input = (u * m.J_d * m.omega_d * math.cos(y2) + m.gravity_torque * math.sin(y1 + known_bias)) / D
        return System(
            A,
            np.array([[0.0] * len(lower), lower]),
            np.array([[0.0], [known_input]]),
            np.array([[1.0, 0.0]]),
            np.zeros((1, len(lower))),
        )

    return form, matrices


def estimates(rig: Adaptive, seed: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Run the rig's form beside the general one: the estimates of either, sample by sample."""
    form, matrices = general(rig)
    y1, y2, u = rough_signals(400, seed=seed)
    state = rig.init(Measurement(float(y1[0]), float(y2[0])))
    reference = form.init(y1[:1], x=np.array([y1[0], 0.0]))
    for k in range(1, 400):
        state, estimate = rig.step(state, Measurement(float(y1[k]), float(y2[k])), float(u[k - 1]))
        system = matrices(0.5 * (y1[k - 1] + y1[k]), 0.5 * (y2[k - 1] + y2[k]), u[k - 1])
        reference = form.step(reference, system, np.ones(1), y1[k : k + 1])
        yield np.array(estimate), np.array([*reference.x, y2[k], *(form.Cm @ reference.xm)])


@pytest.mark.parametrize("model", [PAIR, HEAVY_PAIR, HEAVY], ids=["pair", "heavy pair", "heavy"])
@pytest.mark.parametrize("mode", MODES)
def test_adaptive_equals_friedland_tacker(mode: str, model: ReducedModel) -> None:
    largest_error, largest = 0.0, 0.0
    for estimate, expected in estimates(adaptive(model, **MODES[mode], **GAINS), 1):
        largest_error = max(largest_error, np.abs(estimate - expected).max())
        largest = max(largest, abs(estimate[3]))
    print(f"{mode}: rig's form less general form {largest_error:.1e}; extra signal up to {largest:.2g}")
    assert largest > 1e-3
    assert largest_error < 1e-12


@pytest.mark.parametrize(("parameters", "model"), CASES)
def test_high_gain_equals_updated_high_gain(parameters: dict, model: ReducedModel) -> None:
    k = DEFAULTS | parameters

    def terms(y: Any) -> Any:
        return model.terms(y[0], y[1])

    def f2(u: float, y: Any, x: Any) -> float:
        drift, gain, damping = terms(y)
        return drift + u * (gain - damping * x[0])

    general = UpdatedHighGain(
        dt=DT,
        f=(lambda u, y, x: 0.0, f2),
        correction=BiLimitCorrection((k["l1"], k["l2"]), k["d_inf"]),
        Omega=lambda u, y, x: abs(u * terms(y)[2]),
        b=k["b"],
        phi1=k["phi1"],
        phi2=k["phi2"],
        phi3=k["phi3"],
    )
    y1, y2, u = rough_signals(300, seed=4)
    estimates, states = run(high_gain(model=model, **parameters), y1, y2, u)
    x, L = general.follow((y1, y2), (y1[0], 0.0), u.tolist())
    for i in range(1, len(y1)):
        rig_values = (*estimates[i - 1, :2], states[i].L)
        assert rig_values == pytest.approx((*x[:, i], L[i]), rel=1e-12, abs=1e-12)


def test_the_defaults_of_high_gain_are_inside_the_theorem() -> None:
    rig = high_gain()
    assert list_violations(2, rig.d_inf, rig.b) == []
    assert BiLimitCorrection((rig.l1, rig.l2), rig.d_inf) == BiLimitCorrection((29.5, 12.4), 0.6)
    assert np.roots([1.0, rig.l1, rig.l1 * rig.l2]).real.max() < -10.0
