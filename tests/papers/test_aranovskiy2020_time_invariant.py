"""The time-invariant observers with which aranovskiy2020 could not stabilise its rig."""

from __future__ import annotations

import pytest

from cmg_mj.papers.aranovskiy2020 import time_invariant
from cmg_mj.papers.aranovskiy2020.time_invariant import BIASES_DEG, FROZEN, LUENBERGER, WHOLE, Fate, fates_of

SEED = 910_000


def test_the_luenberger_observer_falls_from_half_a_degree() -> None:
    found = fates_of(LUENBERGER, (0.25, 0.5), 6, SEED, 6.0)
    assert found[0.25].fell == 0.0
    assert found[0.5].fell == 1.0
    assert found[0.5].error is None


def test_ten_with_a_frozen_gain_is_as_good_as_ten() -> None:
    frozen, whole = (fates_of(label, (0.5,), 3, SEED, 6.0)[0.5] for label in (FROZEN, WHOLE))
    assert frozen.fell == whole.fell == 0.0
    assert frozen.error == pytest.approx(whole.error, rel=0.02)


def test_verdicts_follow_the_falls() -> None:
    stands, falls = Fate(0.0, 0.05), Fate(1.0, None)
    rigs = {e: (falls if e >= 0.5 else stands) for e in BIASES_DEG}
    calm, fallen = dict.fromkeys(BIASES_DEG, stands), dict.fromkeys(BIASES_DEG, falls)
    found = {LUENBERGER: rigs, FROZEN: calm, WHOLE: calm}
    claim = time_invariant.luenberger_claim(found)
    assert claim.verdict == "reproduced within stated conditions"
    assert "a bias of 0.5 deg or more; it stands at 0, 0.25 deg" in claim.why
    assert time_invariant.frozen_claim(found).verdict == "not reproduced"
    turned = {LUENBERGER: calm, FROZEN: fallen, WHOLE: calm}
    assert time_invariant.luenberger_claim(turned).verdict == "not reproduced"
    assert time_invariant.frozen_claim(turned).verdict == "reproduced"
