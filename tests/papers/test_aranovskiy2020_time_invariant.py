"""The time-invariant observers with which aranovskiy2020 could not stabilise its rig."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping

import numpy as np
import pytest

from cmg_mj.features.replay import replay
from cmg_mj.observers import make_observer
from cmg_mj.papers.aranovskiy2020 import section_5 as ti
from cmg_mj.papers.aranovskiy2020.paper import printed_model
from cmg_mj.papers.aranovskiy2020.section_5 import BIASES_DEG, FROZEN, GAINS, LINEAR, MEASURED, MODELS, PREDECESSOR
from cmg_mj.papers.pair import DT
from cmg_mj.results.trajectory import Trajectory

SEED = 910_000


def test_the_predecessors_observer_falls_from_half_a_degree() -> None:
    fates = ti.find_fates([ti.choose_observer((PREDECESSOR, LINEAR))], (0.25, 0.5), 6, SEED, 6.0)[0]
    assert fates[0.25].fell == 0.0
    assert fates[0.5].fell == 1.0
    assert fates[0.5].error is None
    observers = [ti.choose_observer(cell) for cell in ((PREDECESSOR, MEASURED), (FROZEN, MEASURED))]
    measured, frozen, whole = (of[0.5] for of in ti.find_fates([*observers, ("ltv", [])], (0.5,), 3, SEED, 6.0))
    assert measured.fell == frozen.fell == whole.fell == 0.0
    assert frozen.error == pytest.approx(whole.error, rel=0.02)  # as good as (10) itself


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


@pytest.mark.parametrize(
    ("falling", "whole", "holds"),
    [
        ({(PREDECESSOR, LINEAR): 0.5, (PREDECESSOR, MEASURED): 1.0}, math.inf, True),
        ({(FROZEN, MEASURED): 0.5}, math.inf, True),
        ({}, math.inf, False),
        ({(PREDECESSOR, LINEAR): 1.0}, math.inf, False),
        ({("slow", LINEAR): 0.0}, math.inf, False),
        ({(PREDECESSOR, LINEAR): 0.5}, 0.5, False),
    ],
    ids=["one falls", "another", "none", "only at a larger bias", "only a gain that nobody printed", "so does (10)"],
)
def test_the_remark_holds_where_a_printed_gain_falls_and_ten_stands(
    falling: Mapping[ti.Cell, float], whole: float, holds: bool
) -> None:
    """Made-up fates: bias from which on a cell, or (10), falls."""

    def fates(first: float) -> dict[float, ti.Fate]:
        return {e: ti.Fate(1.0, None) if e >= first else ti.Fate(0.0, 0.05) for e in BIASES_DEG}

    cells = {(g, m): fates(falling.get((g, m), math.inf)) for g in GAINS for m in MODELS}
    claim = ti.remark_claim(cells, fates(whole))
    assert (claim.verdict, claim.holds) == ("cannot be tested", holds)  # no gain is printed
