"""Hypotheses 1 to 3 of aranovskiy2020, kept and broken: what body A does, by the paper's own momentum."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from cmg_mj.papers.aranovskiy2020 import hypotheses
from cmg_mj.papers.recorded import trajectory_of
from tests.plant import paper_model as paper

SEED = 910_000
SMALL = {"flywheel speed": 0.01, "gimbal offset": 1.0, "servo gain": 0.02}


@cache
def ran() -> hypotheses.MismatchRuns:
    return hypotheses.run_all(hypotheses.MISMATCHES, 2, SEED, 6.0)


def test_body_a_turns_as_the_papers_own_momentum_says() -> None:
    """dT/d(q_a') of the paper's T, with the yaw inertia it lacks, is conserved in every broken rig.

    Without bias: e moves a centre of mass, of which the paper's T does not know.
    """
    largest = [case._replace(sizes=case.sizes[-1:]) for case in hypotheses.MISMATCHES]
    runs = hypotheses.run_all(largest, 1, SEED, 3.0, ["plant.equilibrium_bias_deg=0"])
    plant = runs.plant
    exact = paper.scissored_pair(float(plant.model.body("thrust_bearing").inertia[2]))
    for result in runs.broken.values():
        run = trajectory_of(result).world(0)
        qpos = np.stack([run[f"angle/{name}_rad"] for name in plant.joint_names], axis=-1)
        qvel = np.stack([run[f"rate/{name}_rad_s"] for name in plant.joint_names], axis=-1)
        momentum = exact.momenta(qpos, qvel)[:, 0]
        carried_by_a = hypotheses.inertias(plant)[0] * np.abs(qvel[:, 0]).max()
        assert np.abs(momentum - momentum[0]).max() < 1e-6 * carried_by_a
        assert carried_by_a > 1e-4  # it does turn


@pytest.mark.parametrize("kind", [m.kind for m in hypotheses.MISMATCHES])
def test_conservation_foretells_the_rate_of_body_a(kind: str) -> None:
    (case,) = (m for m in hypotheses.MISMATCHES if m.kind == kind)
    assert hypotheses.measure_yaw(ran(), case, case.sizes[0])["conservation_miss"] < 0.03


@pytest.mark.parametrize("kind", SMALL)
def test_small_mismatch_is_foreseen_from_the_symmetric_rig(kind: str) -> None:
    """Turn and sign, tick by tick."""
    symmetric = trajectory_of(ran().symmetric)
    rate = trajectory_of(ran().broken[kind, SMALL[kind]])["rate/yaw_rad_s"]
    prediction = hypotheses.predict_yaw_rate(kind, SMALL[kind], ran().plant, symmetric)
    assert np.abs(prediction - rate).max() < 0.12 * np.abs(rate).max()
    opposite = hypotheses.predict_yaw_rate(kind, -SMALL[kind], ran().plant, symmetric)
    assert np.abs(opposite - rate).max() > 1.5 * np.abs(rate).max()


def test_tilt_and_its_estimate_hardly_notice() -> None:
    for case in hypotheses.MISMATCHES:
        result = hypotheses.measure_yaw(ran(), case, case.sizes[-1])
        assert abs(result["velocity_rms_error_by_symmetric"].mean - 1.0) < 0.05
    assert ran().symmetric.stood.all()


def test_verdicts_are_computed() -> None:
    """The same claims with falsified numbers come out otherwise."""
    assert hypotheses.symmetric_claim(ran()).verdict == "reproduced"
    assert hypotheses.broken_claim(ran()).verdict == "reproduced within stated conditions"
    assert hypotheses.hypothesis_3(ran()).verdict == "reproduced within stated conditions"
    spoiled = ran()._replace(symmetric=ran().broken["flywheel speed", 0.1])
    assert hypotheses.symmetric_claim(spoiled).verdict == "not reproduced"
