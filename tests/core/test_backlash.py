"""Play between the servos' motors and the gimbals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.signal import lsim

from cmg_mj.core.axis import CommandStage
from cmg_mj.plant.plant import load_plant
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import Experiment
from cmg_mj.stages.backlash import Backlash
from tests.recorded import push_recovery, recorded

DT = 0.005


def behind(stage: CommandStage, commands: np.ndarray) -> np.ndarray:
    """Return what a stage makes of commands, (n,) of one world on floats, or (n, n_worlds)."""
    rows: Any = commands.tolist() if commands.ndim == 1 else commands
    memory, passed = stage.init(0.0 * rows[0]), []
    for command in rows:
        memory, rate = stage.step(memory, command)
        passed.append(rate)
    return np.array(passed)


def experiment(*settings: str) -> Experiment:
    return push_recovery("duration_s=1.5", "push=[]", "open_loop_observers=[]", *settings)


def test_the_gap_in_radians() -> None:
    assert load_plant(gimbal_backlash_arcmin=60.0).backlash == pytest.approx(np.radians(1.0))
    assert load_plant().backlash == 0.0


@pytest.mark.parametrize("worlds", [None, 3])
def test_the_gimbal_rests_until_the_motor_has_crossed_the_gap(worlds: int | None) -> None:
    """The motor swings by 2 about 0 behind a gap of 1; its angle less half the gap forward, plus half backward."""
    motor = 2.0 * np.sin(np.linspace(0.0, 4.0 * np.pi, 401))
    rates = np.diff(motor) / DT
    gap = 1.0 if worlds is None else np.full(worlds, 1.0)
    commands = rates if worlds is None else np.tile(rates[:, None], worlds)
    turned = behind(Backlash(gap, DT), commands).reshape(len(rates), -1)
    assert np.ptp(turned, axis=1).max() == 0.0
    angle = np.concatenate([[0.0], np.cumsum(turned[:, 0] * DT)])
    assert np.abs(motor - angle).max() == pytest.approx(0.5)
    assert angle[50] == pytest.approx(1.5)  # the top of the first swing
    assert angle[60] == pytest.approx(1.5)  # the motor has turned back by 0.38
    assert angle[150] == pytest.approx(-1.5)
    still = (motor[1:-1] < 2.0 - 1e-9) & (np.abs(np.diff(angle)[1:]) < 1e-12)
    assert still.any()


def test_without_a_gap_the_command_goes_through_as_it_is() -> None:
    rates = np.random.default_rng(0).normal(size=(50, 2))
    gimbal_rates = behind(Backlash(np.array([0.0, 0.1]), DT), rates)
    np.testing.assert_array_equal(gimbal_rates[:, 0], rates[:, 0])
    np.testing.assert_array_equal(gimbal_rates[:, 1], behind(Backlash(0.1, DT), rates[:, 1]))


def gimbals_from_commands(run: Trajectory, gap: float) -> np.ndarray:
    """Where a gap leaves the gimbal behind the recorded commands: the motor's angle, followed at half the gap."""
    motor = np.concatenate([[0.0], np.cumsum(run["u_rad_s"][:-1] * DT)])
    gimbal = np.zeros(len(motor))
    for k in range(1, len(motor)):
        off = motor[k] - gimbal[k - 1]
        gimbal[k] = gimbal[k - 1] + np.sign(off) * max(0.0, abs(off) - gap / 2.0)
    return gimbal


@pytest.mark.parametrize("driver", ["native", "callback"])
def test_the_rigs_gimbals_stay_behind_the_recorded_commands(driver: Any) -> None:
    """But for their servos' motion, I x'' = kp (setpoint - x) - kv x', and what the tilt does to it."""
    gap = np.radians(60.0 / 60.0)
    run = recorded(experiment("plant.gimbal_backlash_arcmin=60.0").run(driver=driver))
    prediction = gimbals_from_commands(run, gap)
    servo = [85.6], [1.56e-3, 0.731, 85.6]

    def off(setpoint: np.ndarray) -> float:
        """By how much of the gap the gimbal is elsewhere."""
        return float(np.abs(run["x3_rad"] - lsim(servo, setpoint, run["time_s"])[1]).max() / gap)

    assert off(prediction) < 0.05
    assert off(gimbals_from_commands(run, 0.0)) > 0.4
    assert np.abs(np.diff(prediction)[20:] == 0.0).mean() > 0.1  # it does rest


def test_observers_get_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    setup, commands = experiment("plant.gimbal_backlash_arcmin=60.0", "duration_s=0.1"), []
    observer: Any = type(setup.axis_controller().observer)
    step = observer.step

    def record_step(self: Any, state: Any, y: Any, u: float) -> Any:
        commands.append(u)
        return step(self, state, y, u)

    monkeypatch.setattr(observer, "step", record_step)
    run = recorded(setup.run())
    assert commands == run["u_rad_s"].tolist()[:-1]
