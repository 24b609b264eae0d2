"""No observer is below the floor of its signals, and how near gyro_free comes to its own; kalman beside the paper's."""

from __future__ import annotations

import numpy as np
import pytest

from cmg_mj.core.types import needs
from cmg_mj.observers import OBSERVER_CLASSES, OBSERVERS
from cmg_mj.results.summary_keys import open_loop_figures
from tests.acceptance.cases import GROUP, closed_loop, open_loop_run

SEED = 7
ERROR, PUSH_ERROR = "velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s"
TILT_ONLY = [name for name in OBSERVERS if not needs(OBSERVER_CLASSES.find(name))]


def loop(name: str, key: str, reference: str | None = None, worlds: int = GROUP) -> np.ndarray:
    """A figure of push_recovery, (worlds,)."""
    return closed_loop(name, (), SEED, worlds).values(key, reference)


def upper_end(a: np.ndarray, b: np.ndarray) -> float:
    """Return the upper end of the 95 % interval of the ratio of two means over the same worlds, to first order."""
    ratio = a.mean() / b.mean()
    return ratio + 2.09 * np.std((a - ratio * b) / b.mean(), ddof=1) / np.sqrt(len(a))


def test_these_see_y1_alone() -> None:
    assert TILT_ONLY == ["linear", "finite_difference", "super_twisting", "linear_high_gain"]


@pytest.mark.slow
@pytest.mark.parametrize("key", [ERROR, PUSH_ERROR])
def test_no_observer_of_y1_alone_is_below_its_floor(key: str) -> None:
    """On one and the same motion, in no world: the floor is found afterwards, in each world by itself."""
    result = open_loop_run(SEED, GROUP)
    worlds = [{result.observers[0]: s, **open_loop_figures(s)} for s in result.summaries]
    for name in TILT_ONLY:
        assert all(world[name][key] > world["floor_y1"][key] for world in worlds), name


@pytest.mark.slow
@pytest.mark.parametrize(("key", "limit"), [(ERROR, 1.1), (PUSH_ERROR, 1.3)])
def test_gyro_free_is_at_its_floor(key: str, limit: float) -> None:
    """Above it but for chance, and by little. A push's edges are no straight line, as the floor has it."""
    errors, floor = loop("gyro_free", key, worlds=100), loop("gyro_free", key, "floor_accel", worlds=100)
    assert np.ptp(floor) == 0.0
    assert upper_end(errors, floor) > 1.0
    assert upper_end(errors, floor) < limit


@pytest.mark.slow
def test_gyro_free_is_several_times_nearer_than_the_best_of_y1_y2_and_u() -> None:
    for key, most in ((ERROR, 0.35), (PUSH_ERROR, 0.18)):
        others = [
            name for name in OBSERVERS if name not in ("gyro_free", "free_pivot", "mems_fused", "kalman", "luenberger")
        ]
        best = min(others, key=lambda name, key=key: np.nan_to_num(loop(name, key), nan=np.inf).mean())
        assert upper_end(loop("gyro_free", key), loop(best, key)) < most, best


@pytest.mark.slow
@pytest.mark.parametrize(("ug", "printed", "over_fused"), [(400, 0.0149, 7.2), (100, 0.0045, 2.7), (70, 0.0035, 2.2)])
def test_gyro_free_with_parts_of_three_generations(ug: int, printed: float, over_fused: float) -> None:
    """docs/results.md, on other seeds: the errors, and their ratios to the fused gyro of an MPU-6050."""
    result = closed_loop("gyro_free", (f"sensors.accelerometer.noise_density_ug_rthz={ug}.0",), SEED, 40)
    errors, fused = result.values(ERROR), result.values(ERROR, "mems_fused")
    assert abs(errors.mean() - printed) < 0.05 * printed
    assert abs(errors.mean() / fused.mean() - over_fused) < 0.1 * over_fused
