"""`--dry-run`: what it says, and what it does without."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from cmg_mj.features.sweeps import chunks as plan
from cmg_mj.features.sweeps import study
from cmg_mj.features.sweeps.study import Chunk, SweepStudy, parse_axis
from cmg_mj.scenario.loading import load_scenario
from tests.command import cmg_mj

BIAS, TORQUE = "plant.equilibrium_bias_deg", "plant.initial_tilt_deg"


def test_ctrl_c_after_it_has_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(study: SweepStudy, piece: Chunk, tick: Callable[[float], None]) -> None:
        tick(0.1)
        tick(0.2)
        raise KeyboardInterrupt

    monkeypatch.setattr(plan, "compute", interrupt)
    assert cmg_mj("sweep", "push_recovery", "--vary", f"{BIAS}=0,1", "--dry-run").status == 130


@pytest.mark.parametrize(
    ("axis_text", "options", "points"),
    [
        ("-1:1", {"design": "sample", "n": 20_000_000}, 20_000_000),
        ("-1:1", {"design": "sobol", "n": 2**22}, 2**24),
        ("-1:1:10000", {}, 100_000_000),
    ],
)
def test_the_points_of_a_very_large_study_are_not_drawn(
    axis_text: str, options: dict[str, Any], points: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    counts: list[int] = []
    sample = study.sampled

    def count_points(dimensions: int, n: int, *arguments: Any, **options: Any) -> Any:
        counts.append(n)
        return sample(dimensions, n, *arguments, **options)

    monkeypatch.setattr(study, "sampled", count_points)
    monkeypatch.setattr(
        plan, "compute", lambda study, piece, tick: [study.points[number] for number, _ in piece.trials]
    )
    axes = tuple(parse_axis(field, axis_text, field) for field in (BIAS, TORQUE))
    takes = plan.estimate_cost(SweepStudy(load_scenario("push_recovery"), axes, ("linear",), 2, **options))
    assert counts == [plan.POINTS]
    assert (takes["points"], takes["trials"]) == (points, 2 * points)
    assert takes["chunks"] == -(-2 * points // study.CHUNK)
