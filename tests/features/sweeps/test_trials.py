"""Trials are the runs that they say they are; what fails is a row with its reason."""

from __future__ import annotations

from typing import Unpack

import numpy as np
import pytest

from cmg_mj.features.sweeps import chunks
from cmg_mj.observers import Estimate, Measurement
from cmg_mj.results.result import Result
from cmg_mj.runs.experiment import Experiment, prepare, run_batch
from cmg_mj.runs.simulate import SimulationOptions
from cmg_mj.scenario.loading import load_scenario
from tests.features.sweeps.synthetic_trials import BIAS, VELOCITY, all_trials, make_study

SETTINGS = ("duration_s=0.6", "push=[]")
TILT = "plant.initial_tilt_deg"


@pytest.mark.slow
def test_a_baselines_trials_are_those_beside_the_true_rate() -> None:
    baselines = ("zero", "mems_as_bought", "mems_gyro")
    rows = all_trials(make_study({BIAS: "0,0.5"}, (*baselines, "linear"), settings=SETTINGS)).to_pylist()
    setup = prepare(load_scenario("push_recovery", [*SETTINGS, "controller.feedback=truth", f"{BIAS}=0.5"], "kalman"))
    run: Result = setup.run_many(2, keep_trajectory=False)
    for name in baselines:
        errors = [row[VELOCITY] for row in rows if row["observer"] == name and row[BIAS] == 0.5]
        assert errors == run.values(VELOCITY, name).tolist()
    assert np.all(run.values(VELOCITY, "zero") > 0.0)


def test_values_that_do_not_fit_are_rows_with_a_reason() -> None:
    rows = all_trials(make_study({"sensors.encoder.rate_hz": "200,333.7"}, ("linear",), settings=SETTINGS)).to_pylist()
    assert [row["outcome"] for row in rows] == ["done", "done", "refused", "refused"]
    assert "does not fit" in rows[2]["reason"]
    assert rows[2][VELOCITY] is None


class Fails:
    """Raises where any rig is tilted far; loses itself where one is tilted farther."""

    def __init__(self, dt: float, model: object) -> None:
        pass

    def init(self, y: Measurement) -> None:
        return None

    def step(self, state: None, y: Measurement, u: float) -> tuple[None, Estimate]:
        if np.any((np.abs(y.y1) > 0.06) & (np.abs(y.y1) < 0.12)):
            raise ZeroDivisionError("too far")
        return None, Estimate(y.y1, np.where(np.abs(y.y1) < 0.12, 0.0, np.nan) * y.y1, y.y2)


FAILS = "tests.features.sweeps.test_trials:Fails"


@pytest.mark.slow
def test_an_observer_that_raises_costs_its_own_trials_alone() -> None:
    """Its neighbours in the batch have the figures, and the ends, of their own runs."""
    tilts = "0,5,0.5,10,1"
    rows = all_trials(make_study({TILT: tilts}, (FAILS,), 3, SETTINGS)).to_pylist()
    assert [row["outcome"] for row in rows[::3]] == ["done", "stopped", "done", "stopped", "done"]
    for number, row in enumerate(rows):
        tilt = tilts.split(",")[number // 3]
        alone = all_trials(make_study({TILT: tilt}, (FAILS,), 3, SETTINGS)).to_pylist()[number % 3]
        assert row == alone | {"point": number // 3}
    assert all("ZeroDivisionError: too far" in row["reason"] for row in rows[3:6])
    assert all("not finite" in row["reason"] for row in rows[9:12])


def test_a_batch_that_cannot_begin_is_tried_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    batches = []

    def fail(experiments: list[Experiment], worlds: list[int], **options: Unpack[SimulationOptions]) -> Result:
        batches.append(len(worlds))
        if any(experiment.scenario.plant.initial_tilt_deg == 5.0 for experiment in experiments):
            raise MemoryError("not in there")
        return run_batch(experiments, worlds, **options)

    monkeypatch.setattr(chunks, "run_batch", fail)
    study = make_study({TILT: "0,5,1,2"}, ("linear",), 1, SETTINGS)
    ends = [(row["outcome"], row["reason"] or "") for row in chunks.compute(study, *study.chunk(0))]
    assert ends == [("done", ""), ("stopped", "MemoryError: not in there"), ("done", ""), ("done", "")]
    assert batches == [4, 2, 1, 1, 2]
