"""Many worlds by MuJoCo's rollout and Batch on two threads: those of run_many, bit for bit."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from mujoco import rollout

from cmg_mj.features.plugin.driver import initial_states
from tests.features.plugin.made import ALL_IMPERFECTIONS, QUANTITIES, Made, make, needs_compiler

pytestmark = [needs_compiler, pytest.mark.slow]

THREADS = 2
FULL = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)


def by_rollout(made: Made, states: np.ndarray, steps: int) -> np.ndarray:
    """Sensordata after each step, (n_worlds, steps, n_numbers); a drive that turns the rig is not the plugin's."""
    data = [mujoco.MjData(made.model) for _ in range(THREADS)]
    controls = np.broadcast_to(made.start().ctrl, (len(states), steps, made.model.nu))
    return rollout.rollout(made.model, data, states, controls)[1]


@pytest.mark.parametrize(
    ("scenario", "worlds", "settings"),
    [
        ("push_recovery", 64, ("push=[]", "seed=5")),
        ("push_recovery", 3, ("push=[]", *ALL_IMPERFECTIONS)),
        ("two_axes", 4, ("push=[]",)),
    ],
)
def test_rollout_is_run_many(scenario: str, worlds: int, settings: tuple[str, ...]) -> None:
    made = make("gyro_free", *settings, scenario=scenario)
    experiment = made.experiment
    trajectory = experiment.run_many(worlds).trajectory
    assert trajectory is not None
    states = initial_states(made.model, made.start(), experiment.scenario.seed, worlds)
    steps = len(trajectory) * experiment.controller().period
    shown = by_rollout(made, states, steps)
    compared = set()
    for axis in experiment.plant.axis_names:
        own, prefix = (f"{axis}/", f"balance/{axis}/") if axis else ("", "balance/")
        parts = [f"estimate/gyro_free/{part}" for part in ("x1_rad", "x2_rad_s", "x3_rad")]
        for quantity, names in {"estimate": parts, **{name: [column] for name, column in QUANTITIES.items()}}.items():
            sensor = made.model.sensor(prefix + quantity)
            for i, name in enumerate(names):
                column = trajectory[f"{own}{name}" if trajectory.axes else name]
                numbers = shown[:, :: experiment.controller().period, sensor.adr[0] + i].T
                # -0 may be 0: a run of many worlds has no -0 where a run of one, and the plugin, have it.
                np.testing.assert_array_equal(numbers, column, err_msg=f"{prefix}{quantity} {name}")
            compared.add(sensor.name)
    names = {made.model.sensor(i).name for i in range(made.model.nsensor)}
    assert compared == {name for name in names if name.startswith("balance/") and not name.endswith("/sample")}


def test_rollout_goes_on_where_it_stopped() -> None:
    """The states between two pieces hold all, and other data may take them on, of another world before."""
    made = make("adaptive", "push=[]", *ALL_IMPERFECTIONS)
    states = initial_states(made.model, made.start(), 0, 5)
    data = [mujoco.MjData(made.model) for _ in range(THREADS)]
    whole, shown = rollout.rollout(made.model, data, states, nstep=700)
    first, _ = rollout.rollout(made.model, data, states, nstep=333)
    order = [4, 2, 0, 1, 3]
    then, shown_then = rollout.rollout(made.model, data, first[order, -1], nstep=367)
    np.testing.assert_array_equal(then, whole[order, 333:])
    np.testing.assert_array_equal(shown_then, shown[order, 333:])
