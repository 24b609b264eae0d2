"""The model that Studio draws has every number that a scenario changes on the model that the runner steps."""

from __future__ import annotations

import dataclasses
from functools import cache

import mujoco
import numpy as np
import pytest

from cmg_mj import load_scenario, prepare
from cmg_mj.features.studio.session import PHYSICS_ARRAYS, copy_physics_numbers, drawn_plant
from cmg_mj.runs.experiment import Experiment
from cmg_mj.scenario.plant_settings import PlantSettings

VARIATIONS = {
    "equilibrium_bias_deg": 1.5,
    "gimbal_armature_kg_m2": 1e-3,
    "gimbal_friction_n_m": 0.01,
    "gimbal_damping_n_m_s": 0.01,
    "servo_stiffness_n_m_rad": 100.0,
    "servo_damping_n_m_s_rad": 1.0,
    "accelerometer_inner_m": 0.1,
    "accelerometer_outer_m": 0.5,
    "accelerometer_inner_across_m": 0.02,
    "accelerometer_outer_across_m": -0.02,
    "accelerometer_inner_angle_deg": 90.0,
    "accelerometer_outer_angle_deg": 180.0,
    "accelerometer_inner_misplaced_mm": 3.0,
    "accelerometer_outer_misplaced_mm": -3.0,
    "tilt_friction_n_m": 0.01,
    "tilt_damping_n_m_s": 0.01,
    "flywheel_speed_rad_s": 200.0,
    "flywheel_imbalance_kg_m": 1e-5,
    "tilt_inertia_kg_m2": 0.4,
    "tilt_gravity_n_m": 7.0,
    "flywheel_momentum_n_m_s": 0.5,
    "turn_rate_rad_s": 0.1,
}
OUTSIDE_THE_MODEL = {"initial_tilt_deg", "gimbal_backlash_arcmin", "pivot_slides"}
OPTIONS = {"timestep_s", "integrator"}
COMPILE_OPTIONS = {"model", "lock_thrust_bearing", "locked_axes"}
VIEW_ARRAYS = ("cam_", "light_")


@cache
def experiment(scenario: str) -> Experiment:
    return prepare(load_scenario(scenario))


def arrays(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    """All arrays but the addresses of names."""
    attributes = {name: getattr(model, name) for name in dir(model) if not name.startswith(("_", "name"))}
    return {name: value for name, value in attributes.items() if isinstance(value, np.ndarray)}


def test_every_setting_of_a_plant_is_here() -> None:
    fields = {field.name for field in dataclasses.fields(PlantSettings)}
    assert fields == {*VARIATIONS, *OUTSIDE_THE_MODEL, *OPTIONS, *COMPILE_OPTIONS}


@pytest.mark.parametrize("name", VARIATIONS)
@pytest.mark.parametrize("scenario", ["push_recovery", "two_axes"])
def test_what_a_setting_changes_is_copied(scenario: str, name: str) -> None:
    if name == "turn_rate_rad_s" and scenario != "two_axes":
        pytest.skip("the scissored pair has no yaw servo")
    if name in ("tilt_inertia_kg_m2", "tilt_gravity_n_m") and scenario == "two_axes":
        pytest.skip("a pendulum is of one axis")
    base = experiment(scenario)
    fields = {f"plant.{name}": VARIATIONS[name], "plant.timestep_s": base.plant.timestep}
    variation = base.with_settings(fields).plant.model
    before = arrays(base.plant.model)
    changed = {array for array, value in arrays(variation).items() if not np.array_equal(value, before[array])}
    changed = {array for array in changed if not array.startswith(VIEW_ARRAYS)}
    assert changed
    assert changed <= set(PHYSICS_ARRAYS)
    drawing = drawn_plant(base.plant).model
    copy_physics_numbers(drawing, variation)
    assert all(np.array_equal(getattr(drawing, array), getattr(variation, array)) for array in changed)
    copy_physics_numbers(drawing, base.plant.model)
    assert all(np.array_equal(getattr(drawing, array), before[array]) for array in changed)


@pytest.mark.parametrize("scenario", ["push_recovery", "single_gimbal", "two_axes"])
def test_only_visual_geoms_differ(scenario: str) -> None:
    plant = experiment(scenario).plant
    drawn_arrays, stepped_arrays = arrays(drawn_plant(plant).model), arrays(plant.model)
    visual = ("geom_", "mesh_", "mat_", "tex_", "bvh_", "body_geom", "body_bvh", *VIEW_ARRAYS)
    assert all(
        np.array_equal(drawn_arrays[name], value, equal_nan=True)
        for name, value in stepped_arrays.items()
        if not name.startswith(visual)
    )
