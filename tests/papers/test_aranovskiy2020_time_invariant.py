"""The time-invariant observers with which aranovskiy2020 could not stabilise its rig."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping

import numpy as np
import pytest

from cmg_mj.features.replay import replay
from cmg_mj.observers import make_observer
from cmg_mj.papers.aranovskiy2020 import time_invariant as ti
from cmg_mj.papers.aranovskiy2020.paper import printed_model
from cmg_mj.papers.aranovskiy2020.rig import DT
from cmg_mj.papers.aranovskiy2020.time_invariant import BIASES_DEG, FROZEN, GAINS, LINEAR, MEASURED, MODELS, PREDECESSOR
from cmg_mj.results.trajectory import Trajectory

SEED = 910_000
STANDS, FALLS = ti.Fate(0.0, 0.05), ti.Fate(1.0, None)


def test_the_predecessors_observer_falls_from_half_a_degree() -> None:
    fates = ti.find_fates([ti.choose_observer((PREDECESSOR, LINEAR))], (0.25, 0.5), 6, SEED, 6.0)[0]
    assert fates[0.25].fell == 0.0
    assert fates[0.5].fell == 1.0
    assert fates[0.5].error is None
    assert ti.find_fates([ti.choose_observer((PREDECESSOR, MEASURED))], (0.5,), 3, SEED, 6.0)[0][0.5].fell == 0.0


def test_ten_with_a_frozen_gain_is_as_good_as_ten() -> None:
    frozen = ti.find_fates([ti.choose_observer((FROZEN, MEASURED))], (0.5,), 3, SEED, 6.0)[0][0.5]
    whole = ti.find_fates([("ltv", [])], (0.5,), 3, SEED, 6.0)[0][0.5]
    assert frozen.fell == whole.fell == 0.0
    assert frozen.error == pytest.approx(whole.error, rel=0.02)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("gain", GAINS)
def test_bias_of_the_rate_at_rest_by_replay(gain: str, model: str) -> None:
    """Its size and its sign: y1 = -e, and the estimated rate is below zero."""
    kind, settings = ti.choose_observer((gain, model))
    fields: dict = dict(setting.removeprefix("observer.").split("=", 1) for setting in settings)
    fields = {name: json.loads(value) for name, value in fields.items()}
    if model == MEASURED:
        fields["alpha"] = 1.0
    e = math.radians(0.01)
    signals = {"y2_rad": np.zeros(2000), "u_rad_s": np.zeros(2000), "y1_rad": np.full(2000, -e)}
    x2 = replay(make_observer(kind, DT, printed_model(), **fields), Trajectory(signals)).x2[-1]
    assert x2 == pytest.approx(-e * ti.rate_bias((gain, model)), rel=1e-3)


def test_gains_have_the_speed_they_are_named_for() -> None:
    speeds = [GAINS[gain].speed for gain in GAINS]
    assert speeds == sorted(speeds)
    for name in ("slow", "fast", FROZEN):
        poles = np.roots([1.0, *GAINS[name]])
        assert np.abs(poles) == pytest.approx([GAINS[name].speed] * 2)
        # Q[0] = 1 beside 2 sqrt(Q[1]) = 4472 turns the frozen gain's by that little.
        assert -poles.real / np.abs(poles) == pytest.approx([math.sqrt(0.5)] * 2, rel=1e-3)


def factorial(falling: Mapping[ti.Cell, float], whole: float = math.inf) -> ti.Factorial:
    """Fates that fall from a bias on."""

    def fates(first: float) -> dict[float, ti.Fate]:
        return {e: FALLS if e >= first else STANDS for e in BIASES_DEG}

    cells = {(g, m): fates(falling.get((g, m), math.inf)) for g in GAINS for m in MODELS}
    return ti.Factorial(cells, fates(whole))


def test_one_remark_one_verdict() -> None:
    claim = ti.remark(factorial({(PREDECESSOR, LINEAR): 0.5, (PREDECESSOR, MEASURED): 1.0, ("slow", LINEAR): 0.25}))
    assert (claim.verdict, claim.holds) == ("cannot be tested", True)  # no gain is printed
    assert "with the predecessor's gain and gravity at the estimate." in claim.reason
    assert "A constant gain is not the cause" in claim.reason
    assert "from 0.5 deg with gravity at the estimate, from 1 deg with gravity at y1" in claim.reason
    assert claim.figures[f"{PREDECESSOR}, {LINEAR}"]["fell_fraction"] == [0.0, 0.0, 1.0, 1.0]
    # Frozen, too, falls: then it may well be the constancy.
    frozen_claim = ti.remark(factorial({(PREDECESSOR, LINEAR): 0.5, (FROZEN, MEASURED): 0.5}))
    assert frozen_claim.holds
    assert "A constant gain is not the cause" not in frozen_claim.reason
    assert "the frozen gain and gravity at y1" in frozen_claim.reason


@pytest.mark.parametrize(
    ("falling", "whole"),
    [
        ({}, math.inf),
        ({(PREDECESSOR, LINEAR): 1.0}, math.inf),
        ({("slow", LINEAR): 0.0}, math.inf),
        ({(PREDECESSOR, LINEAR): 0.5}, 0.5),
    ],
    ids=["none falls", "only at a larger bias", "only a gain that nobody printed", "so does (10)"],
)
def test_it_is_not_reproduced_where(falling: Mapping[ti.Cell, float], whole: float) -> None:
    claim = ti.remark(factorial(falling, whole))
    assert (claim.verdict, claim.holds) == ("cannot be tested", False)
