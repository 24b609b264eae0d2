"""Whether a loop around a frame that bends is stable: `check` against eigenvalues and against the simulation."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from cmg_mj import load_scenario, prepare
from cmg_mj.linear.march import march
from cmg_mj.linear.plant import linearise
from cmg_mj.runs.experiment import Experiment


def experiment(*settings: str) -> Experiment:
    return prepare(load_scenario("push_recovery", settings))


class Decay(NamedTuple):
    bending: str
    rigid: str


def decay_of(*settings: str, scenario: str = "push_recovery") -> Decay:
    subject = prepare(load_scenario(scenario, settings))
    bending, rigid = (march(subject.design, linearise(subject.plant, rigid=rigid)) for rigid in (False, True))
    return Decay(bending, rigid)


def test_a_rig_without_gains_falls() -> None:
    assert decay_of("bend.frequency_hz=20", "controller.gains=[0, 0, 0, 0]") == ("falls", "falls")


GYRO_FREE, SLOW = ["observer.kind=gyro_free"], ["observer.kind=linear", "observer.tau=0.3"]
CASES = {
    "gyro_free": GYRO_FREE,
    "gyro_free, estimated angle": [*GYRO_FREE, "controller.angle_source=estimated"],
    "gyro_free, notch": [*GYRO_FREE, "controller.notch_hz={hz}"],
    "gyro_free, base": [*GYRO_FREE, "bend.beyond=both", "bend.share=0.5"],
    "linear, slow": SLOW,
    "luenberger": ["observer.kind=luenberger"],
    "luenberger, no bias": ["observer.kind=luenberger", "plant.equilibrium_bias_deg=0"],
    "homogeneous": ["observer.kind=homogeneous"],
    "kalman": ["observer.kind=kalman"],
    "gyro": ["controller.feedback=fog"],
    "true rate": ["controller.feedback=truth"],
    "no gains": ["controller.gains=[0, 0, 0, 0]"],
    "weak gains": ["controller.gains=[1, 1, -1, 0.3]"],
}


@pytest.mark.slow
@pytest.mark.parametrize("hz", [0, 3, 5, 10, 20])
@pytest.mark.parametrize("name", CASES)
def test_it_is_what_the_simulation_does(hz: int, name: str) -> None:
    """Stable is who neither falls nor swings in 12 s; a quiet loop's command has 0.3 to 0.8 rad/s."""
    settings = [setting.replace("{hz}", f"{hz or 20}") for setting in CASES[name]]
    subject = experiment(*settings, f"bend.frequency_hz={hz}", "duration_s=12")
    worlds = subject.run_many(2)
    swings = bool(worlds.fell.any()) or (worlds.mean("command_rms_rad_s") or 0.0) > 1.0
    motions = decay_of(*settings, f"bend.frequency_hz={hz or 20}")
    assert ((motions.bending if hz else motions.rigid) != "decays") == swings


@pytest.mark.slow
def test_a_motion_that_only_its_size_fells_is_told_apart() -> None:
    """`luenberger` takes the gimbals' angle for small, and falls by bias and push together, whatever the frame."""
    settings = ["bend.frequency_hz=20", "observer.kind=luenberger"]
    assert decay_of(*settings) == ("decays if small", "decays if small")
    assert decay_of(*settings, "push=[]") == ("decays", "decays")
    assert experiment("observer.kind=luenberger", "duration_s=6").run().fell.all()
    assert not experiment("observer.kind=luenberger", "duration_s=6", "push=[]").run().fell.any()


@pytest.mark.slow
@pytest.mark.parametrize(("torque", "stands"), [(2.0, True), (3.0, True), (3.5, False), (4.0, False)])
def test_the_push_that_fells_it_is_the_simulations(torque: float, stands: bool) -> None:
    """The accelerometers show a push at once: an observer that uses them is not late."""
    settings = ["observer.kind=gyro_free", f"push.0.torque_n_m={torque}"]
    assert decay_of(*settings, "bend.frequency_hz=60", "bend.share=0.02").rigid == (
        "decays" if stands else "decays if small"
    )
    assert (not experiment(*settings, "duration_s=8").run_many(2).fell.any()) == stands


@pytest.mark.slow
@pytest.mark.parametrize(("hz", "bending"), [(16.5, "swings"), (17.0, "swings"), (17.5, "decays")])
def test_a_mode_that_grows_by_a_thirtieth_in_a_second_is_unstable(hz: float, bending: str) -> None:
    settings = ["observer.kind=kalman", "bend.beyond=both", "bend.share=0.5"]
    assert decay_of(f"bend.frequency_hz={hz}", *settings) == (bending, "decays")
