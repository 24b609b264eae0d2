"""The tilt from two accelerometers, and the gyro, on a frame in arbitrary motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.tilt import PairTilt
from cmg_mj.plant.plant import load_plant
from cmg_mj.sensors.accelerometer import Accelerometer
from tests.plant.full_model import states
from tests.sensors.test_sampled import readings

N_STATES = 1_000


@pytest.mark.parametrize("model", ["scissored_pair.xml", "single_gimbal.xml"])
@pytest.mark.parametrize("bias_deg", [0.0, 1.5])
def test_two_accelerometers_show_the_tilt_in_any_motion(model: str, bias_deg: float) -> None:
    """Any posture, all rates (the yaw's among them) and accelerations, from random torques on the joints.

    Both sites lie on one ray through a pivot that stays where it is, so whatever the rotation, their
    accelerations are in the ratio of their radii. Yaw therefore does no harm; it would if the tilt axis
    missed the yaw axis, and the pivot moved.
    """
    rng = np.random.default_rng(8)
    plant = load_plant(model=model, equilibrium_bias_deg=bias_deg)
    n = plant.model.nv
    qpos = rng.uniform(-math.pi, math.pi, (N_STATES, n))
    qvel = rng.uniform(-5.0, 5.0, (N_STATES, n)) + plant.model.key_qvel[plant.key]
    torques = rng.uniform(-3.0, 3.0, (N_STATES, n))
    forces, rates, accelerations = [], [], []
    for data in states(plant.model, qpos, qvel, torques):
        parts = [data.sensor(f"accelerometer_{place}").data for place in ("inner", "outer")]
        forces.append([part[i] for part in parts for i in (0, 2)])
        rates.append(data.sensor("fog").data[1])
        accelerations.append(data.qacc[[plant.yaw, plant.tilt]].copy())
    assert np.all(np.abs(accelerations).max(axis=0) > 50.0)

    inner_x, inner_z, outer_x, outer_z = np.array(forces).T
    alone = [np.arctan2(-inner_x, inner_z), np.arctan2(-outer_x, outer_z)]
    estimates = np.array([plant.pair_tilt(inner_x, inner_z, outer_x, outer_z), *alone])
    errors = np.abs(np.angle(np.exp(1j * (estimates - qpos[:, plant.tilt] + plant.tilt_zero))))
    assert errors[0].max() < 1e-9
    assert np.all(np.degrees(np.median(errors[1:], axis=1)) > 5.0)
    # The gyro's second axis is the tilt axis, and the yaw does not reach it.
    np.testing.assert_allclose(rates, qvel[:, plant.tilt], rtol=0.0, atol=1e-12)


def test_offset_of_biased_accelerometers() -> None:
    """At rest and upright: an outward bias b of either shifts the horizontal part of gravity by its weight times b."""
    tilt, g = PairTilt(0.06, 0.18), 9.81
    weights = (1.5, -0.5)  # r_outer/(r_outer - r_inner), -r_inner/(...)

    def offset(angle: float, inner: float, outer: float) -> float:
        return tilt.offset(angle, lambda f: (f[0] + inner, f[1], f[2] + outer, f[3]), g)

    for bias in ((0.3, 0.0), (0.0, 0.3), (-0.2, 0.1)):
        shift = weights[0] * bias[0] + weights[1] * bias[1]
        assert offset(0.0, *bias) == pytest.approx(-math.atan2(shift, g), rel=1e-12)
    assert offset(0.2, 0.0, 0.0) == pytest.approx(0.0, abs=1e-16)
    common_offset = offset(0.1, 0.3, 0.3)  # alike on both: gravity turned, whatever the distances
    assert common_offset == pytest.approx(math.atan2(g * math.sin(0.1) - 0.3, g * math.cos(0.1)) - 0.1, rel=1e-12)


ERRORS = [
    {},
    {"bias_mg": (8.0, 0.0)},
    {"bias_mg": (-3.0, 5.0)},
    {"scale_error": (0.01, -0.02)},
    {"misalignment_deg": (0.2, -1.0)},
    {"cross_axis": (-0.02, 0.02)},
    {"bias_mg": (-3.0, 5.0), "scale_error": (0.01, 0.0), "misalignment_deg": (0.2, 1.0), "cross_axis": (0.02, 0.01)},
]


@pytest.mark.parametrize("errors", ERRORS, ids=str)
def test_apparent_bias_is_what_the_tilt_at_rest_lacks(errors: dict[str, Any]) -> None:
    """At the equilibrium gravity pulls at zero; what y1 shows there is the apparent bias, turned round."""
    plant = load_plant(equilibrium_bias_deg=0.8, initial_tilt_deg=0.0)
    accelerometer = Accelerometer(noise_density_ug_rthz=0.0, counts_per_g=0.0, **errors)
    data = plant.new_data()
    ideal = plant.ideal_readings(data.sensordata.tolist(), data.qvel.tolist())
    reading = plant.pair_tilt(*readings(accelerometer, ideal)[0].tolist())

    assert plant.apparent_bias(accelerometer) == pytest.approx(-reading, abs=1e-9)
