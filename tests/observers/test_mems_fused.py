"""The cheap gyro in the loop: the same reading and estimate as the baseline's, in runs, batches and replays."""

from __future__ import annotations

import numpy as np
import pytest

from cmg_mj.core.types import STATE_SIGNALS
from cmg_mj.results.baselines import GYROS, MEMS_FUSED, FusedGyro
from cmg_mj.results.trajectory import GYRO
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.runs.open_loop import replay
from cmg_mj.scenario.loading import load_scenario
from tests.observers.reference import DT, NOISE, observer
from tests.observers.reference import run as walk
from tests.recorded import recorded

ERROR = "velocity_rms_error_rad_s"


def push(*settings: str, kind: str = MEMS_FUSED) -> Experiment:
    return prepare(load_scenario("push_recovery", ["duration_s=0.6", "push.0.start_s=0.2", *settings], kind))


def test_the_baseline_is_its_open_loop() -> None:
    y1, gyro = np.random.default_rng(0).normal(0.3, 0.1, (2, 400))
    white = NOISE.gyro * (0.5 / DT) ** 0.5
    baseline = FusedGyro(white, NOISE.gyro_walk, [NOISE.tilt], DT).rates(gyro[:, None], y1[:, None])[1:, 0]
    estimates, _ = walk(observer(MEMS_FUSED), y1, g=gyro)
    np.testing.assert_allclose(estimates[:, 1], baseline, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("setting", ["mems_gyro.reading=calibrated", "accelerometer.rate_hz=50"])
def test_in_a_run_it_reads_the_baselines_gyro(setting: str) -> None:
    setting = f"sensors.{setting}"
    plain = push(setting, kind="gyro_free").run()
    beside = push(setting, 'open_loop_observers=["mems_fused"]', kind="gyro_free").run()
    assert GYRO not in recorded(plain)
    assert beside.mean(ERROR, MEMS_FUSED) == pytest.approx(plain.mean(ERROR, MEMS_FUSED), rel=1e-9)
    assert beside.mean(ERROR) == plain.mean(ERROR)  # the other sensors' noise is as it was


def test_it_closes_the_loop_and_is_replayed_bit_by_bit() -> None:
    """20 deg/s of offset do not matter; the gyro shows the rate, its offset and 3 % of scale error."""
    experiment = push()
    result, batch = experiment.run(), experiment.run_many(2)
    t = recorded(result)
    assert result.stood.all()
    assert (batch.values(ERROR) < 0.01).all()
    np.testing.assert_array_equal(recorded(batch)[GYRO][:, 0], t[GYRO])
    for name, values in zip(STATE_SIGNALS, replay(experiment.design.observer(), t), strict=True):
        np.testing.assert_array_equal(values, t[f"estimate/{MEMS_FUSED}/{name}"])
    offset = t[GYRO] - 1.03 * t["x2_rad_s"]
    assert abs(np.degrees(abs(offset.mean())) - 20.0) < 0.3
    assert np.degrees(np.ptp(offset)) < 0.5
    assert MEMS_FUSED not in result.summaries[0]["references"]  # type: ignore[operator]
    assert set(GYROS) - {MEMS_FUSED} <= set(result.summaries[0]["references"])  # type: ignore[arg-type]
