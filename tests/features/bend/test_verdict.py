"""The loop around a frame that bends: the verdict's figures, and the simulation from a small tilt beside them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj import Experiment, load_scenario, prepare
from cmg_mj.features.bend import Bend
from cmg_mj.features.bend.verdict import BentVerdict, judge_bend
from cmg_mj.linear.plant import linearise
from cmg_mj.linear.verdict import Verdict, margins
from cmg_mj.plant.plant import load_plant
from tests.command import cmg_mj

MAST = ["bend.beyond=sensors", "bend.share=0.2", "observer.kind=gyro_free"]
QUIET = [
    *("plant.equilibrium_bias_deg=0", "plant.initial_tilt_deg=0.02", "push=[]", "open_loop_observers=[]"),
    *("sensors.accelerometer.noise_density_ug_rthz=0", "sensors.accelerometer.counts_per_g=0"),
    *("sensors.encoder.counts_per_revolution=0", "duration_s=5"),
]


def experiment(*settings: str) -> Experiment:
    return prepare(load_scenario("push_recovery", settings))


def verdict_of(*settings: str) -> BentVerdict:
    subject = experiment(*settings)
    result = judge_bend(subject.design, subject.plant)
    assert result is not None
    return result


@pytest.mark.parametrize(("hz", "is_stable", "distance"), [(22, False, None), (24, True, 0.112)])
def test_a_mast_near_the_border_is_what_the_simulation_does(hz: int, is_stable: bool, distance: float | None) -> None:
    """The mode at the dominant pole grows or decays in MuJoCo as that pole says."""
    settings = [f"bend.frequency_hz={hz}", *MAST]
    verdict = verdict_of(*settings)
    assert verdict.is_stable == is_stable
    assert verdict.distance == (None if distance is None else pytest.approx(distance, abs=1e-3))
    if not is_stable:
        assert np.abs(experiment(*settings).linear_closed_loop().poles()).max() == pytest.approx(1.00115, abs=1e-5)
    subject = experiment(*settings, *QUIET)  # the observer's gains go with the noise that it is told
    poles: Any = subject.linear_closed_loop().poles()
    swinging = np.log(poles[(np.abs(poles) > 0.9) & (poles.imag > 0.1)]) / subject.law.dt
    pole = swinging[np.argmax(swinging.real)]
    trajectory: Any = subject.run().trajectory
    # The swing's size over windows of whole turns, by its Fourier sum at the pole's frequency.
    u = trajectory["u_rad_s"]
    time = np.arange(len(u)) * subject.law.dt
    window = round(12.0 * 2.0 * math.pi / pole.imag / subject.law.dt)
    shape = np.hanning(window)

    def size(start_s: float) -> float:
        at = int(np.searchsorted(time, start_s))
        part = slice(at, at + window)
        return float(abs(np.sum(shape * u[part] * np.exp(-1j * pole.imag * time[part]))))

    assert math.log(size(3.0) / size(1.5)) / 1.5 == pytest.approx(pole.real, abs=0.05 * abs(pole.real) + 0.02)


def test_the_plant_with_its_bend_held_is_the_rigid_plant() -> None:
    bent, rigid = linearise(load_plant(sections={"bend": Bend(20.0)}), rigid=True), linearise(load_plant())
    for hz in (0.7, 3.0, 8.0, 19.0, 33.0):
        s = 2j * math.pi * hz
        answers = [plant.C @ np.linalg.solve(s * np.eye(len(plant.A)) - plant.A, plant.B) for plant in (bent, rigid)]
        np.testing.assert_allclose(answers[0][[0, 3, 4]], answers[1][[0, 3, 4]], rtol=1e-4)


def test_margins_are_those_of_an_integrator_behind_a_delay() -> None:
    omega = 2.0 * np.pi * np.geomspace(0.05, 20.0, 2000)
    result = margins(2.0 * np.exp(-0.1j * omega) / (1j * omega), omega)
    assert result.largest_gain == pytest.approx(math.pi / (2.0 * 0.1 * 2.0), rel=1e-3)
    assert result.phase_deg == pytest.approx(90.0 - math.degrees(0.1 * 2.0), rel=1e-3)
    assert result.phase_at_hz == pytest.approx(2.0 / (2.0 * math.pi), rel=1e-3)
    assert result.least_gain == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("hz", [10, 40])
@pytest.mark.parametrize("place", ["sensors", "both"])
@pytest.mark.parametrize("rate", ["fog", "homogeneous", "gyro_free"])
@pytest.mark.parametrize("notched", [False, True])
def test_its_verdict_is_that_of_the_simulation(hz: float, place: str, rate: str, notched: bool) -> None:
    settings = [f"bend.frequency_hz={hz}", f"bend.beyond={place}", "bend.share=0.5"]
    settings += ["controller.feedback=fog"] if rate == "fog" else [f"observer.kind={rate}"]
    settings += [f"controller.notch_hz={hz}"] if notched else []
    verdict = verdict_of(*settings)
    bending, rigid = (
        experiment("duration_s=6.0", *settings, *more).run_many(3) for more in ([], ["bend.frequency_hz=0"])
    )
    commands = [result.mean("command_rms_rad_s") or math.inf for result in (bending, rigid)]
    swings = bool(bending.fell.any()) or commands[0] > 1.2 * commands[1]
    if not verdict.is_stable or verdict.distance is None or verdict.distance > 0.15:
        assert verdict.is_stable != swings


@pytest.mark.usefixtures("elsewhere")
def test_check_and_hints_say_what_the_bend_does() -> None:
    Path("bend.toml").write_text('[bend]\nfrequency_hz = 20\n[observer]\nkind = "gyro_free"\n')
    out = cmg_mj("check", "bend.toml").out
    assert "UNSTABLE" in out
    assert "hint        bend.frequency_hz = 20" in out
    assert "UNSTABLE (with a rigid frame: UNSTABLE)" in verdict_of("bend.frequency_hz=20", *SLOW).words


SLOW = ["observer.kind=linear", "observer.tau=0.3"]


def test_a_small_distance_of_the_rigid_loop_is_not_the_bends_fault() -> None:
    good = Verdict(np.array([-1.0]), 1.0, 0.8)
    near, bad = good._replace(distance=0.3), good._replace(poles=np.array([1.0]))
    assert BentVerdict(near, good).fault
    assert not BentVerdict(near, near).fault
    assert BentVerdict(bad, good).fault
    assert not BentVerdict(bad, bad).fault
