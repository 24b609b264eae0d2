"""A plant whose inertia and gravity torque are set: its reduced model and MuJoCo's own motion show them."""

from __future__ import annotations

import math
import re
from typing import Any

import mujoco
import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.bend import Bend
from cmg_mj.plant.plant import Plant, load_plant
from tests.recorded import push_recovery

J, TORQUE = 0.17, 6.4
SET: dict[str, Any] = {"tilt_inertia_kg_m2": J, "tilt_gravity_n_m": TORQUE}


def whole(plant: Plant) -> tuple[float, float]:
    """The inertia and the gravity torque of all shares together."""
    reduced = plant.reduced
    return reduced.gimbals * reduced.J1, reduced.gimbals * reduced.gravity_torque


@pytest.mark.parametrize("given", [("tilt_inertia_kg_m2",), ("tilt_gravity_n_m",), tuple(SET)])
@pytest.mark.parametrize(("model", "size"), [("scissored_pair.xml", 1.0), ("single_gimbal.xml", 0.5)])
def test_the_reduced_model_shows_what_is_set(model: str, size: float, given: tuple[str, ...]) -> None:
    """What is not set stays."""
    own = load_plant(model=model)
    fields: dict[str, Any] = {name: size * SET[name] for name in given}
    changed = load_plant(model=model, **fields)
    inertia, torque = whole(own)
    expected = fields.get("tilt_inertia_kg_m2", inertia), fields.get("tilt_gravity_n_m", torque)
    assert whole(changed) == pytest.approx(expected, rel=1e-9)
    assert changed.reduced.J_d == pytest.approx(own.reduced.J_d, rel=1e-12)
    assert changed.model.body_mass == pytest.approx(own.model.body_mass, rel=1e-15)


def times_and_tilts(start: float, duration: float, **settings: Any) -> tuple[np.ndarray, np.ndarray]:
    """A swing of MuJoCo's about the pivot with still wheels, from a tilt at rest [s, rad]."""
    plant = load_plant(equilibrium_bias_deg=0.0, lock_thrust_bearing=True, **settings)
    model, data = plant.model, plant.new_data()
    mujoco.mj_resetDataKeyframe(model, data, plant.key)
    data.qvel[:] = data.ctrl[:] = 0.0
    plant.axis.line.tilt(data, start)
    model.opt.timestep = 5e-4
    rows = []
    while data.time < duration:
        rows.append((data.time, data.qpos[plant.tilt] - plant.tilt_zero))
        mujoco.mj_step(model, data)
    return np.array(rows).T[0], np.array(rows).T[1]


def test_it_swings_below_the_pivot_with_that_period() -> None:
    time, tilt = times_and_tilts(math.pi - 0.01, 3.0, **SET)
    hanging = tilt - math.pi
    ends = np.flatnonzero(np.diff(np.sign(hanging)))
    crossings = time[ends] - hanging[ends] * np.diff(time)[0] / (hanging[ends + 1] - hanging[ends])
    assert 2.0 * np.mean(np.diff(crossings)) == pytest.approx(2.0 * math.pi * math.sqrt(J / TORQUE), rel=1e-4)


def test_it_falls_with_that_rate() -> None:
    time, tilt = times_and_tilts(1e-4, 0.5, **SET)
    assert tilt[-1] == pytest.approx(1e-4 * math.cosh(math.sqrt(TORQUE / J) * time[-1]), rel=1e-4)


def test_the_equilibrium_bias_keeps_the_gravity_torque() -> None:
    """With e the plant balances at a tilt of -e, whatever is set."""
    plant = load_plant(equilibrium_bias_deg=1.5, initial_tilt_deg=0.0, **SET)
    data = plant.new_data()
    data.qvel[:] = 0.0
    mujoco.mj_forward(plant.model, data)
    assert data.qfrc_bias[plant.tilt] == pytest.approx(0.0, abs=1e-9)
    plant.axis.line.tilt(data, 0.1)  # from the keyframe, where the bias leans already
    mujoco.mj_forward(plant.model, data)
    assert -data.qfrc_bias[plant.tilt] == pytest.approx(TORQUE * math.sin(0.1 + plant.bias), rel=1e-9)


def test_less_than_the_rest_of_the_plant_has_is_refused_with_the_least() -> None:
    with pytest.raises(InputError, match=r"plant\.tilt_inertia_kg_m2 = 0\.05: must be at") as refused:
        load_plant(tilt_inertia_kg_m2=0.05, tilt_gravity_n_m=TORQUE)
    least = float(re.findall(r"at least ([\d.]+),", str(refused.value))[0])
    assert load_plant(tilt_inertia_kg_m2=least + 1e-4, tilt_gravity_n_m=TORQUE)
    with pytest.raises(InputError, match="must be at least"):
        load_plant(tilt_inertia_kg_m2=least - 1e-4, tilt_gravity_n_m=TORQUE)


def test_what_it_cannot_stand_for_is_refused() -> None:
    with pytest.raises(InputError, match="of one axis"):
        load_plant(model="two_axes.xml", **SET)
    with pytest.raises(InputError, match="does not bend"):
        load_plant(**SET, sections={"bend": Bend(frequency_hz=20.0)})


def test_the_loop_stands_with_it() -> None:
    settings = [f"plant.{name}={value}" for name, value in SET.items()]
    result = push_recovery("duration_s=4.0", "controller.gains=scaled", *settings).run()
    assert result.outcomes[0].kind == "done"
