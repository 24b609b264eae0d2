"""Trials are the runs that they say they are; what fails is a row with its reason."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Unpack

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cmg_mj.errors import InputError
from cmg_mj.observers import Estimate, Measurement
from cmg_mj.results.result import Result
from cmg_mj.results.summary_keys import ID_COLUMNS
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.simulation.experiment import Experiment, prepare, run_batch
from cmg_mj.simulation.simulate import SimulationOptions
from cmg_mj.studies.sweeps import chunk as work
from cmg_mj.studies.sweeps import study as study_module
from cmg_mj.studies.sweeps.api import all_trials
from cmg_mj.studies.sweeps.axes import parse_axis
from cmg_mj.studies.sweeps.chunk_store import Store, merged, run
from cmg_mj.studies.sweeps.study import SweepStudy

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


@pytest.mark.slow
def test_killed_and_gone_on_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Finished trials are not computed again, and the whole is the same as in one go."""
    monkeypatch.setattr(study_module, "CHUNK", 5)
    store = Store(tmp_path, small())
    assert store.open() == 0

    def stop(n_trials: float) -> None:
        if n_trials > 12:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(store, stop)
    chunk_times = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "chunks").iterdir()}
    assert 1 <= len(chunk_times) < len(small().chunks)
    rerun = Store(tmp_path, small())
    assert rerun.open() == 5 * len(chunk_times)
    run(rerun)
    assert (
        chunk_times.items() <= {path.name: path.stat().st_mtime_ns for path in (tmp_path / "chunks").iterdir()}.items()
    )
    merged(rerun, tmp_path / "trials.parquet")
    assert pq.read_table(tmp_path / "trials.parquet").equals(trials())


def test_another_study_in_the_same_folder_is_refused(tmp_path: Path) -> None:
    Store(tmp_path, study({"plant.equilibrium_bias_deg": "0,1"})).open()
    with pytest.raises(InputError, match=r"holds another study: sweep.worlds = 2 there, 3 here; name another folder"):
        Store(tmp_path, study({"plant.equilibrium_bias_deg": "0,1"}, worlds=3)).open()
    with pytest.raises(
        InputError, match=r"another study: vary.plant.equilibrium_bias_deg = \[0, 1\] there, \[0, 2\] here;"
    ):
        Store(tmp_path, study({"plant.equilibrium_bias_deg": "0,2"})).open()


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


FAILS = "tests.studies.sweeps.test_trials:Fails"


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
    assert all("raised ZeroDivisionError: too far at t = " in row["reason"] for row in rows[3:6])
    assert all("not finite" in row["reason"] for row in rows[9:12])


def test_an_observer_that_raises_at_a_rig_that_lies_costs_nothing() -> None:
    """It goes on being told of a world of its batch that has fallen."""
    scenario = load_scenario("push_recovery", [*SETTINGS, "metrics.fall_angle_deg=3"])
    tilt = "plant.initial_tilt_deg"
    rows = all_trials(SweepStudy(scenario, (parse_axis(tilt, "0,5", tilt),), (FAILS,), 1)).to_pylist()
    assert [row["outcome"] for row in rows] == ["done", "fell"]


def test_a_batch_that_cannot_begin_is_tried_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    batches = []

    def fail(experiments: list[Experiment], worlds: list[int], **options: Unpack[SimulationOptions]) -> Result:
        batches.append(len(worlds))
        if any(experiment.scenario.plant.initial_tilt_deg == 5.0 for experiment in experiments):
            raise MemoryError("not in there")
        return run_batch(experiments, worlds, **options)

    monkeypatch.setattr(work, "run_batch", fail)
    shares = []
    sweep = study({"plant.initial_tilt_deg": "0,5,1,2"}, ("linear",), 1)
    rows = work.compute(sweep, sweep.chunks[0], shares.append)
    assert [(row["outcome"], row["reason"] or "") for row in rows] == [
        ("done", ""),
        ("stopped", "MemoryError: not in there"),
        ("done", ""),
        ("done", ""),
    ]
    assert batches == [4, 2, 1, 1, 2]
    assert shares == sorted(shares)  # what runs again is no step back
    assert shares[-1] == pytest.approx(1.0)


def test_columns_are_those_of_a_worlds_table() -> None:
    assert [name for name in trials().schema.names if name in ID_COLUMNS] == [
        n for n in ID_COLUMNS if n != "in_loop_of"
    ]
