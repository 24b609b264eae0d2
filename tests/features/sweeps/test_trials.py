"""Trials are the runs that they say they are; what fails is a row with its reason."""

from __future__ import annotations

from functools import cache
from typing import Unpack

import numpy as np
import pyarrow as pa
import pytest

from cmg_mj.features.sweeps import chunks as work
from cmg_mj.features.sweeps.study import SweepStudy, parse_axis
from cmg_mj.observers import Estimate, Measurement
from cmg_mj.results.result import Result
from cmg_mj.results.summary_keys import ID_COLUMNS
from cmg_mj.runs.experiment import Experiment, prepare, run_batch
from cmg_mj.runs.simulate import SimulationOptions
from cmg_mj.scenario.loading import load_scenario
from tests.features.sweeps.synthetic_trials import all_trials

SETTINGS = ("duration_s=0.6", "push=[]")


def study(
    axes_text: dict[str, str], observers: tuple[str, ...] = ("linear", "gyro_free"), worlds: int = 2
) -> SweepStudy:
    axes = [parse_axis(field, text, field) for field, text in axes_text.items()]
    return SweepStudy(load_scenario("push_recovery", SETTINGS), tuple(axes), observers, worlds)


def small() -> SweepStudy:
    return study(
        {
            "plant.equilibrium_bias_deg": "0,1",
            "sensors.accelerometer.noise_density_ug_rthz": "200,400",
            "controller.rate_hz": "100,200",
        }
    )


@cache
def trials() -> pa.Table:
    return all_trials(small())


@pytest.mark.slow
def test_each_trial_is_the_run_of_its_own_row() -> None:
    """`cmg-mj run` with the row's own values, to the last bit."""
    sweep = small()
    assert trials().num_rows == sweep.trials == 32
    for row in trials().to_pylist()[::5]:
        settings = [f"{axis.field}={row[axis.field]}" for axis in sweep.axes]
        alone = prepare(load_scenario("push_recovery", [*SETTINGS, *settings], row["observer"]))
        (summary,) = alone.run(world=row["world"]).summaries
        assert {key: row[key] for key in summary if key in row} == {key: summary[key] for key in summary if key in row}


def test_the_noise_of_a_world_is_the_same_in_every_cell() -> None:
    rows = all_trials(study({"plant.equilibrium_bias_deg": "0,0.0001"}, ("linear",), 3)).to_pylist()
    errors = np.array([row["velocity_rms_error_rad_s"] for row in rows]).reshape(2, 3)
    np.testing.assert_allclose(errors[0], errors[1], rtol=1e-2)
    assert np.ptp(errors[0]) > 0.05 * errors[0].mean()


def test_values_that_do_not_fit_are_rows_with_a_reason() -> None:
    rows = all_trials(study({"sensors.encoder.rate_hz": "200,333.7"}, ("linear",))).to_pylist()
    assert [row["outcome"] for row in rows] == ["done", "done", "refused", "refused"]
    assert "does not fit" in rows[2]["reason"]
    assert rows[2]["velocity_rms_error_rad_s"] is None


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
    tilts = {"plant.initial_tilt_deg": "0,5,0.5,10,1"}
    rows = all_trials(study(tilts, (FAILS,), 3)).to_pylist()
    assert [row["outcome"] for row in rows[::3]] == ["done", "stopped", "done", "stopped", "done"]
    for number, row in enumerate(rows):
        tilt = tilts["plant.initial_tilt_deg"].split(",")[number // 3]
        alone = all_trials(study({"plant.initial_tilt_deg": tilt}, (FAILS,), 3)).to_pylist()[number % 3]
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

    monkeypatch.setattr(work, "run_batch", fail)
    sweep = study({"plant.initial_tilt_deg": "0,5,1,2"}, ("linear",), 1)
    rows = work.compute(sweep, sweep.chunks[0])
    assert [(row["outcome"], row["reason"] or "") for row in rows] == [
        ("done", ""),
        ("stopped", "MemoryError: not in there"),
        ("done", ""),
        ("done", ""),
    ]
    assert batches == [4, 2, 1, 1, 2]


def test_columns_are_those_of_a_worlds_table() -> None:
    assert [name for name in trials().schema.names if name in ID_COLUMNS] == [
        n for n in ID_COLUMNS if n != "in_loop_of"
    ]
