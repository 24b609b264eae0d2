"""sokolov2019, Sections IV-B and IV-C: closed forms against MuJoCo, at other biases than the report's."""

from __future__ import annotations

import pytest

from cmg_mj.papers.sokolov2019 import equations, paper


def test_observers_biases() -> None:
    """Closed forms against MuJoCo, at another bias than the report's."""
    biased = equations.biased_luenberger(e_deg=-0.15)
    vicinity = equations.homogeneous_vicinity((-0.4,))
    assert biased.verdict == "reproduced within stated conditions"
    assert vicinity.verdict == "illustrated"  # by one alpha
    assert biased.figures["rate_estimate_rad_s"] > 0.0


def test_a_wrong_vicinity_is_not_reproduced(monkeypatch: pytest.MonkeyPatch) -> None:
    right = paper.rest_of_10
    monkeypatch.setattr(paper, "rest_of_10", lambda *args: 1.2 * right(*args))
    assert equations.homogeneous_vicinity((0.4,)).verdict == "not reproduced"
