"""Worlds of different experiments in one batch are those experiments' own, to the last bit."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.runs.batch import BATCHED_FIELDS, stack_worlds, world_value
from cmg_mj.runs.experiment import Experiment, run_batch
from cmg_mj.scenario.schema import Scenario
from cmg_mj.sensors import Sensors
from cmg_mj.sensors.accelerometer import Accelerometer
from cmg_mj.sensors.gyros import Fog
from tests.recorded import assert_same_bits, push_recovery, recorded

N = 6
TRACK = Path(__file__).parents[1] / "features/pivot/track.csv"
MOVING = (
    'pivot=[{kind="noise", acceleration_m_s2=0.1, corner_hz=5.0},'
    f" {{kind='track', file='{TRACK}', direction='vertical'}}]"
)


def experiment(observer: str, *more: str) -> Experiment:
    return push_recovery("duration_s=2.6", *more, observer=observer)


def values(seed: int = 3) -> dict[str, Any]:
    """Every field that worlds of one batch may differ in, with other values in each."""
    rng = np.random.default_rng(seed)
    small = rng.uniform(0.0, 1.0, (8, N))
    return {
        "plant.equilibrium_bias_deg": rng.uniform(-1.0, 1.0, N),
        "plant.initial_tilt_deg": rng.uniform(-1.0, 1.0, N),
        "plant.gimbal_armature_kg_m2": 1e-3 * (1.0 + small[0]),
        "plant.gimbal_friction_n_m": 0.02 * small[1],
        "plant.gimbal_damping_n_m_s": 0.1 + 0.1 * small[2],
        "plant.gimbal_backlash_arcmin": [0.0, 0.0, 5.0, 10.0, 20.0, 30.0],
        "plant.servo_stiffness_n_m_rad": 60.0 + 30.0 * small[5],
        "plant.servo_damping_n_m_s_rad": 0.6 + 0.2 * small[6],
        "plant.accelerometer_inner_m": 0.05 + 0.03 * small[0],
        "plant.accelerometer_outer_m": 0.15 + 0.05 * small[2],
        "plant.accelerometer_inner_misplaced_mm": 5.0 * small[1],
        "plant.accelerometer_outer_misplaced_mm": 5.0 * small[3],
        "plant.tilt_friction_n_m": 0.005 * small[3],
        "plant.tilt_damping_n_m_s": 0.01 * small[4],
        "plant.flywheel_imbalance_kg_m": 1e-5 * small[5],
        "plant.timestep_s": [0.0025] * N,
        "controller.gains": [[35.0 + i, 4.0, -1.0, 0.3] for i in range(N)],
        "controller.rate_limit_rad_s": 2.0 + small[6],
        "sensors.accelerometer.noise_density_ug_rthz": 100.0 + 500.0 * small[7],
        "sensors.accelerometer.bias_mg": [[float(i), -2.0 * i] for i in range(N)],
        "sensors.accelerometer.vibration_mg": 4.0 * small[0],
        "sensors.fog.angle_random_walk_deg_rth": 0.01 + 0.01 * small[0],
        "push.0.torque_n_m": rng.uniform(-1.5, 1.5, N),
        "pivot.0.acceleration_m_s2": 0.2 * small[4],
        "pivot.1.scale": [0.5, 1.0, 1.0, 2.0, -1.0, 0.0],
    }


def test_these_are_all_fields_that_may_differ() -> None:
    sections = (name for name in values() if name.partition(".")[0] in Scenario.model_fields)
    fields = {re.sub(r"\.\d\.", ".", name) for name in sections} - {"plant.timestep_s"}
    assert fields | {"controller.lqr"} == BATCHED_FIELDS.keys()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("observer", "more"),
    [
        ("homogeneous", ()),
        ("adaptive", ("controller.bias_trim_s=1.0", "sensors.accelerometer.skew_s=0.0025")),
        ("ltv", ()),
    ],
)
def test_each_world_is_its_own_experiments(observer: str, more: tuple[str, ...]) -> None:
    setup = experiment(observer, MOVING, *more)
    worlds = [5, 5, 0, 1, 2, 9]
    pool = setup.run_many(worlds, settings=values())
    for i, (world_experiment, world) in enumerate(zip(setup.with_varied(values()), worlds, strict=True)):
        alone = world_experiment.run(world=world)
        assert pool.summaries[i] == alone.summaries[0]
        assert_same_bits(recorded(pool).world(i), recorded(alone))


@pytest.mark.parametrize(
    ("kind", "vary"),
    [
        ("gyro_free", {"sensors.accelerometer.noise_density_ug_rthz": [200.0, 400.0]}),
        ("kalman", {"accelerometer_outer_m": [0.2, 0.25]}),
    ],
)
def test_an_observer_that_uses_the_noise_keeps_worlds_of_other_noise_apart(kind: str, vary: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=f"the sensors' noise, which {kind} is told, differs"):
        experiment(kind).run_many(2, settings=vary)


def test_gains_by_other_weights_run_together() -> None:
    weights = [[100.0, 1.0, 1.0, 0.1], [10.0, 1.0, 1.0, 0.1]]
    setup = experiment("homogeneous", "duration_s=0.3", "push=[]", f"controller.lqr.state_cost={weights[0]}")
    result = setup.run_many([1, 1], settings={"controller.lqr.state_cost": weights}, keep_trajectory=False)
    assert result.summaries[0] == setup.run(world=1).summaries[0] != result.summaries[1]


def test_as_many_experiments_as_worlds() -> None:
    with pytest.raises(InputError, match="2 worlds and 1 plants"):
        run_batch([experiment("linear")], [0, 1])


# --- stacked -------------------------------------------------------------------------------------------------


def test_a_stack_gives_every_world_its_own_back() -> None:
    worlds = [Sensors(Accelerometer(bias_mg=(0.0, float(i))), fog=Fog(bias_deg_h=float(i))) for i in range(3)]
    stack = stack_worlds(worlds)
    np.testing.assert_array_equal(stack.fog.bias_deg_h, [0.0, 1.0, 2.0])
    assert [world_value(stack, i) for i in range(3)] == worlds
    assert world_value(worlds[0], 2) == worlds[0]


def test_what_is_no_number_cannot_differ() -> None:
    with pytest.raises(InputError, match="must have one value for all worlds of a batch"):
        stack_worlds(["a", "b"])
