"""A comparison from Python."""

from __future__ import annotations

from typing import Any

import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.runs.api import compare
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.scenario.schema import Scenario


def scenario() -> Scenario:
    return load_scenario("push_recovery", ["duration_s=0.4", "push=[]"])


def test_a_comparison_as_a_mapping_and_a_frame() -> None:
    pytest.importorskip("pandas")
    compared = compare(scenario(), ["linear", "gyro_free"], 2)
    assert list(dict(compared)) == list(compared) == ["linear", "gyro_free"]
    means: Any = compared.to_pandas().groupby("observer")["velocity_rms_error_rad_s"].mean()
    for summary in compared.summaries[:2]:
        assert means[summary["observer"]] == pytest.approx(summary["velocity_rms_error_rad_s"], rel=1e-12)


@pytest.mark.parametrize(
    ("observers", "worlds", "message"),
    [
        (["linear", "linear"], 2, "different names"),
        ("linear", 2, "different names"),
        ([], 2, "different names"),
        (["linear"], 0, "worlds = 0"),
        (["liner"], 1, "did you mean 'linear'"),
    ],
)
def test_a_comparison_that_cannot_be_is_refused(observers: Any, worlds: int, message: str) -> None:
    with pytest.raises(InputError, match=message):
        compare(scenario(), observers, worlds)
