"""`--dry-run`: what it says, and what it does without."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from cmg_mj.cli.sweeps import _cost_text
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.studies.sweeps import plan, study
from cmg_mj.studies.sweeps.axes import parse_axis
from cmg_mj.studies.sweeps.study import Chunk, SweepStudy
from tests.command import cmg_mj

BIAS, TORQUE = "plant.equilibrium_bias_deg", "plant.initial_tilt_deg"


def test_ctrl_c_before_the_first_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(plan, "compute", interrupt)
    outcome = cmg_mj("sweep", "push_recovery", "--vary", f"{BIAS}=0,1", "--dry-run")
    assert (outcome.status, outcome.out, outcome.err) == (130, "", "cmg-mj: interrupted\n")


def test_ctrl_c_after_it_has_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(study: SweepStudy, piece: Chunk, tick: Callable[[float], None]) -> None:
        tick(0.1)
        tick(0.2)
        raise KeyboardInterrupt

    monkeypatch.setattr(plan, "compute", interrupt)
    assert cmg_mj("sweep", "push_recovery", "--vary", f"{BIAS}=0,1", "--dry-run").status == 130


@pytest.mark.parametrize(
    ("minutes", "words"),
    [(0.0012, "about 0.072 s on"), (0.5, "about 30 s on"), (12.0, "about 12 min on"), (480.0, "about 8.0 h on")],
)
def test_how_long_in_words(minutes: float, words: str) -> None:
    counts = dict.fromkeys(("points", "observers", "worlds", "trials", "chunks"), 1.0)
    assert words in _cost_text({**counts, "minutes": minutes, "memory_mb": 230.0})


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
