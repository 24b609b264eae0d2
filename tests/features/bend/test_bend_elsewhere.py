"""A frame that bends in Studio and in the linear loop: features and packages that know it by its sections alone."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from cmg_mj import InputError, load_scenario, prepare
from cmg_mj.features.studio.session import drawn_plant
from tests.linear.test_loop import assert_push_moves_both_alike, experiment


def test_a_frame_that_bends_is_drawn_as_it_is_stepped() -> None:
    settings = ("bend.frequency_hz=20", "bend.damping_ratio=0.01", "bend.share=0.2")
    plant = prepare(load_scenario("push_recovery", (*settings, "bend.beyond=sensors"))).plant
    drawn = drawn_plant(plant)
    one, other = plant.new_data(), drawn.new_data()
    mujoco.mj_step(plant.model, one, 20)
    mujoco.mj_step(drawn.model, other, 20)
    np.testing.assert_array_equal(one.qpos, other.qpos)
    assert drawn.model.nv == prepare(load_scenario("push_recovery")).plant.model.nv + 1


@pytest.mark.slow
def test_a_bend_is_in_the_linear_loop() -> None:
    assert_push_moves_both_alike({"bend__frequency_hz": 60.0})


def test_the_reduced_model_is_rigid() -> None:
    with pytest.raises(InputError, match="bend: the reduced model is rigid; take"):
        experiment(bend__frequency_hz=20.0).linear_closed_loop("reduced")
