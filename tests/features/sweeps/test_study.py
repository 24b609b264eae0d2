"""A sweep's points, trials and chunks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import sobol_indices, uniform

from cmg_mj.core.errors import InputError
from cmg_mj.features.sweeps.study import CHUNK, SweepStudy, check_values, parse_axis
from cmg_mj.scenario.loading import load_scenario

BIAS, NOISE = "plant.equilibrium_bias_deg", "sensors.accelerometer.noise_density_ug_rthz"


def study(*settings: str, worlds: int = 3, **options: Any) -> SweepStudy:
    parts = [setting.partition("=") for setting in settings]
    axes = [parse_axis(field, text, f"--vary {field}") for field, _, text in parts]
    return SweepStudy(load_scenario("push_recovery"), tuple(axes), ("linear", "ltv"), worlds, **options)


def test_a_grid_is_every_combination() -> None:
    sweep = study(f"{BIAS}=0,1", f"{NOISE}=200,400,800")
    assert sweep.points[1] == {BIAS: 0, NOISE: 400}
    assert (len(sweep.points), sweep.cells, sweep.trials) == (6, 12, 36)


def test_fields_that_go_together() -> None:
    rates = "controller.rate_hz+sensors.accelerometer.rate_hz"
    sweep = study(f"{rates}=100,200", f"{BIAS}=0,1")
    assert sweep.points[2] == {"controller.rate_hz": 200, "sensors.accelerometer.rate_hz": 200, BIAS: 0}
    assert len(sweep.points) == 4
    assert sweep.as_fields({})["vary"] == {rates: [100, 200], BIAS: [0, 1]}
    check_values(sweep)
    with pytest.raises(InputError, match=r"sensors\.accelerometer\.rate_hzz: no such field"):
        check_values(study("controller.rate_hz+sensors.accelerometer.rate_hzz=100,200"))
    with pytest.raises(InputError, match=r"controller\.rate_hz: given twice"):
        study("controller.rate_hz+controller.rate_hz=100,200")
    with pytest.raises(InputError, match="write FIELD=VALUES"):
        study("controller.rate_hz+=100,200")


def test_every_trial_is_in_one_chunk() -> None:
    sweep = study(f"{BIAS}=0:1:800", worlds=5)
    assert max(len(chunk.trials) for chunk in sweep.chunks) == CHUNK
    trials = [(chunk.observer, *trial) for chunk in sweep.chunks for trial in chunk.trials]
    assert len(set(trials)) == len(trials) == sweep.trials == 8000
    assert [chunk.number for chunk in sweep.chunks] == list(range(len(sweep.chunks)))


def test_trials_that_run_in_one_batch_stand_together() -> None:
    sweep = study(f"{BIAS}=0,1", "controller.rate_hz=100,200")
    rates: list[Any] = [sweep.points[point]["controller.rate_hz"] for point, _ in sweep.chunks[0].trials]
    assert rates == sorted(rates)


def test_a_design_for_indices_is_saltellis() -> None:
    """scipy's own indices of a function, from its values at these points."""
    d, n = 3, 64
    sweep = study("a=0:1", "b=0:1", "c=0:1", design="sobol", n=n)
    assert len(sweep.points) == n * (d + 2)
    x = np.array([list(point.values()) for point in sweep.points])
    y = 4.0 * x[:, 0] + 2.0 * x[:, 1] * x[:, 2]
    f_A, f_B, f_AB = y[None, :n], y[None, n : 2 * n], y[2 * n :].reshape(d, 1, n)
    result = sobol_indices(func={"f_A": f_A, "f_B": f_B, "f_AB": f_AB}, n=n)
    generator: Any = {"random_state": np.random.default_rng(1)}  # as all versions of scipy call it

    def function(z: np.ndarray) -> np.ndarray:
        return 4.0 * z[0] + 2.0 * z[1] * z[2]

    expected = sobol_indices(func=function, n=8192, dists=[uniform()] * d, **generator)
    np.testing.assert_allclose(result.first_order, expected.first_order, atol=0.1)
    np.testing.assert_allclose(result.total_order, expected.total_order, atol=0.1)


@pytest.mark.parametrize("design", ["sample", "sobol"])
def test_a_design_takes_each_value_of_a_list_equally_often(design: Any) -> None:
    rates = "controller.rate_hz"
    sweep = study(f"{BIAS}=-1:1", f"{rates}=50,100,200,400", f"{NOISE}=log:100:800:4", design=design, n=64)
    assert {type(point[rates]) for point in sweep.points} == {int}
    for field, values in ((rates, [50, 100, 200, 400]), (NOISE, [100.0, 200.0, 400.0, 800.0])):
        actual_values, times = np.unique(
            np.array([point[field] for point in list(sweep.points)[:64]]), return_counts=True
        )
        assert (actual_values.tolist(), times.tolist()) == (values, [16] * 4)
    points: list[dict[str, Any]] = list(sweep.points)
    pairs = {(point[rates], point[NOISE]) for point in points}
    assert len(pairs) == 16  # and every combination is there
    assert len({point[BIAS] for point in points[:64]}) == 64
    assert sum(len(chunk.trials) for chunk in sweep.chunks) == sweep.trials
