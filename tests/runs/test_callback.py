"""One controller, three ways to drive it: the runner, MuJoCo's control callback, a user's own loop. One trajectory."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from typing import Any

import mujoco
import numpy as np
import pytest
from mujoco import rollout

import cmg_mj
from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.observers import OBSERVERS, Estimate, Measurement
from cmg_mj.plant.plant import load_plant
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.callback import control, control_callback
from cmg_mj.runs.experiment import Experiment
from cmg_mj.sensors import Sensors
from cmg_mj.sensors.accelerometer import Accelerometer
from tests.recorded import push_recovery, recorded

SHORT = ("duration_s=0.5", "push.0.start_s=0.2", "push.0.duration_s=0.1")
INTEGRATORS = ["RK4", "Euler", "implicitfast", "implicit", "discrete"]

SETTINGS = [
    *(pytest.param((f"observer.kind={kind}",), id=kind) for kind in sorted(OBSERVERS)),
    *(pytest.param((f"plant.integrator={name}", "observer.kind=ltv"), id=name) for name in INTEGRATORS[1:]),
    pytest.param(("controller.rate_hz=1000",), id="control at 1 kHz"),
    pytest.param(("controller.rate_hz=50", "plant.integrator=Euler"), id="control at 50 Hz"),
    pytest.param(
        tuple(f"sensors.{kind}.rate_hz=1000" for kind in ("accelerometer", "encoder", "fog")), id="sensors at 1 kHz"
    ),
    pytest.param(("sensors.accelerometer.rate_hz=500", "sensors.encoder.rate_hz=100"), id="sensors at other rates"),
    pytest.param(("sensors.accelerometer.latency_s=0.003", "sensors.encoder.latency_s=0.01"), id="latency"),
    pytest.param(("controller.feedback=fog", "sensors.fog.latency_s=0.002"), id="gyro"),
    pytest.param(("plant.timestep_s=0.0005", "controller.rate_hz=400"), id="half the step"),
    pytest.param(("plant.model=single_gimbal.xml", "plant.lock_thrust_bearing=true"), id="single gimbal"),
]

DAILY = (
    "adaptive",
    "gyro_free",
    "homogeneous",
    "ltv",
    "Euler",
    "sensors at other rates",
    "latency",
    "gyro",
    "half the step",
    "single gimbal",
)


@cache
def experiment(settings: tuple[str, ...] = ()) -> Experiment:
    return push_recovery(*SHORT, *settings)


@cache
def native(settings: tuple[str, ...] = ()) -> Trajectory:
    return recorded(experiment(settings).run())


class Loop:
    """A user's own loop from fresh data at the keyframe: physics steps, pushes by hand, and a record at the ticks.

    Without a forward pass before the first step, MuJoCo's accelerometers then still show zero.
    """

    def __init__(self, setup: Experiment) -> None:
        self.setup, self.plant = setup, setup.plant
        self.controller = setup.axis_controller()
        self.data = mujoco.MjData(self.plant.model)
        self.start()
        self.last_tick: Any = None
        self.rows: list[tuple] = []

    def start(self) -> None:
        """The scenario's initial state as a user would set it, without any forward pass."""
        mujoco.mj_resetDataKeyframe(self.plant.model, self.data, self.plant.key)
        tilt = math.radians(self.setup.scenario.plant.initial_tilt_deg)
        self.data.qpos[self.plant.tilt] = self.plant.tilt_zero - self.plant.bias + tilt

    def push(self) -> None:
        """Set the torque of this instant."""
        t = self.data.time
        self.data.qfrc_applied[self.plant.tilt] = sum(
            push.torque_n_m for push in self.setup.scenario.push if push.start_s <= t + 1e-9 < push.end_s - 1e-9
        )

    def step(self, before: Callable[[], object] = lambda: None) -> None:
        """Push, call a driver, take a physics step, and note a new tick with the state it was taken at."""
        self.push()
        angles = self.data.qpos.copy()
        before()
        mujoco.mj_step(self.plant.model, self.data)
        if self.controller.tick is not self.last_tick:
            self.last_tick = self.controller.tick
            self.rows.append((*angles, *self.signals()))

    def signals(self) -> tuple[float, ...]:
        tick = self.controller.tick
        assert tick is not None
        return (tick.y1, tick.y2, tick.fog, tick.u, tick.x_e, *tick.estimates[0])

    def steps(self) -> Iterator[int]:
        return iter(range(round(self.setup.scenario.duration_s / self.plant.model.opt.timestep)))

    def by_control(self) -> Loop:
        for _ in self.steps():
            self.step(lambda: control(self.plant, self.controller, self.data))
        return self

    def by_callback(self, action: Callable[[], object] = lambda: None) -> Loop:
        with control_callback(self.plant, self.controller):
            for _ in self.steps():
                self.step()
                action()
        return self


def assert_same_run(rows: list[tuple], trajectory: Trajectory) -> None:
    kind = trajectory.observers[0]
    signals = ("y1_rad", "y2_rad", "fog_rad_s", "u_rad_s", "x_e_rad_times_s")
    names = ("x1_rad", "x2_rad_s", "x3_rad", *trajectory.extra_signals(kind))
    estimates = tuple(f"estimate/{kind}/{name}" for name in names)
    expected = np.hstack([trajectory.qpos(), *(trajectory[name][:, None] for name in (*signals, *estimates))])
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(np.array(rows), expected, rtol=0.0, atol=1e-9)


# --- one trajectory ------------------------------------------------------------------------------------


@pytest.mark.daily_cases(*DAILY)
@pytest.mark.parametrize("settings", SETTINGS)
def test_callback_and_a_users_loop_equal_the_runner(settings: tuple[str, ...]) -> None:
    callback = recorded(experiment(settings).run(driver="callback"))
    assert callback.columns.keys() == native(settings).columns.keys()
    for name, values in native(settings).columns.items():
        np.testing.assert_allclose(callback[name], values, rtol=0.0, atol=1e-9, err_msg=name)
    assert_same_run(Loop(experiment(settings)).by_control().rows, native(settings))
    assert_same_run(Loop(experiment(settings)).by_callback().rows, native(settings))


def test_the_callback_drives_one_world_only() -> None:
    setup = experiment()
    with pytest.raises(InputError, match="drives one world, not a batch"):
        setup.simulate([setup.plant] * 2, setup.controller([0, 1]), driver="callback")


# --- what a user may do in between ---------------------------------------------------------------------


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_forward_passes_in_between_change_nothing(integrator: str) -> None:
    """Once, twice or not at all after a step, as a viewer or a logger does; the first is where sensors are read."""
    settings = (f"plant.integrator={integrator}",)
    loop = Loop(experiment(settings))
    calls = iter([0, 1, 2] * 1000)

    def look() -> None:
        loop.push()
        for _ in range(next(calls)):
            mujoco.mj_forward(loop.plant.model, loop.data)

    assert_same_run(loop.by_callback(look).rows, native(settings))


def test_a_forward_pass_before_the_first_step_changes_nothing() -> None:
    loop = Loop(experiment())
    with control_callback(loop.plant, loop.controller):
        mujoco.mj_forward(loop.plant.model, loop.data)
        for _ in loop.steps():
            loop.step()
    assert_same_run(loop.rows, native())


@pytest.mark.daily_cases("RK4-1", "Euler-1", "RK4-2", "RK4-123", "Euler-2", "Euler-123")
@pytest.mark.parametrize("steps", [1, 2, 3, 5, 7, 123])
@pytest.mark.parametrize("integrator", ["RK4", "Euler"])
def test_resetting_the_time_restarts_the_controller(integrator: str, steps: int) -> None:
    """Noise, observer and integrator start again: the run after the reset is a fresh one."""
    settings = (f"plant.integrator={integrator}",)
    loop = Loop(experiment(settings))
    with control_callback(loop.plant, loop.controller):
        for _ in range(steps):
            loop.step()
        loop.start()
        loop.rows = []
        for _ in loop.steps():
            loop.step()
    # After a single call, the tick at t = 0 still stands: it is the one a restarted controller would take again.
    whole = native(settings)
    n_rows = len(loop.rows)
    assert n_rows >= len(whole) - 1
    assert_same_run(
        loop.rows, replace(whole, columns={name: values[-n_rows:] for name, values in whole.columns.items()})
    )


# --- how often -----------------------------------------------------------------------------------------


class Counted:
    """Counts its steps, and fails at one of them if it is told to."""

    def __init__(self, dt: float, model: ReducedModel, fail_at: int = -1) -> None:
        self.dt, self.fail_at = dt, fail_at
        self.calls: Counter[str] = Counter()

    def init(self, y: Measurement) -> float:
        self.calls["init"] += 1
        return y.y1

    def step(self, state: float, y: Measurement, u: float) -> tuple[float, Estimate]:
        self.calls["step"] += 1
        if self.calls["step"] == self.fail_at:
            raise KeyError("lost")
        return y.y1, Estimate(y.y1, 0.5 * (y.y1 - state) / self.dt, y.y2)


def count_steps(*settings: str) -> tuple[Experiment, Controller, Counter[str]]:
    setup = experiment((f"observer.kind={__name__}:Counted", *settings))
    controller = setup.axis_controller()
    observer: Any = controller.observer
    return setup, controller, observer.calls


@pytest.mark.daily_cases("RK4-1000", "RK4-40", "Euler-200", "implicitfast-200", "implicit-200", "discrete-200")
@pytest.mark.parametrize("rate_hz", [1000, 200, 40])
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_observer_advances_once_a_control_period(integrator: str, rate_hz: int) -> None:
    """RK4 calls back four times a step, the others once."""
    settings = (f"plant.integrator={integrator}", f"controller.rate_hz={rate_hz}", "plant.timestep_s=0.001")
    setup, controller, calls = count_steps(*settings)
    plant, data = setup.plant, setup.plant.new_data()
    counts: Counter[str] = Counter()
    with control_callback(plant, controller) as callback:

        def count_calls(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            counts["callback"] += 1
            callback(model, data)

        mujoco.set_mjcb_control(count_calls)
        mujoco.mj_step(plant.model, data, 400)
    assert counts["callback"] == 400 * (4 if integrator == "RK4" else 1)
    assert calls == {"init": 1, "step": 400 * rate_hz // 1000 - 1}


def test_half_steps_of_the_user_advance_it_once_too() -> None:
    """mj_step1 and mj_step2, which step RK4 models by Euler's method."""
    setup, controller, calls = count_steps("plant.timestep_s=0.001")
    plant, data = setup.plant, setup.plant.new_data()
    with control_callback(plant, controller):
        for _ in range(200):
            mujoco.mj_step1(plant.model, data)
            mujoco.mj_step2(plant.model, data)
    assert calls == {"init": 1, "step": 39}


# --- coming and going ----------------------------------------------------------------------------------


def other_callback(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Somebody else's."""


@contextmanager
def other_callback_function() -> Iterator[None]:
    mujoco.set_mjcb_control(other_callback)
    try:
        yield
    finally:
        mujoco.set_mjcb_control(None)


def test_it_restores_what_was_there() -> None:
    setup = experiment()
    with other_callback_function():
        with control_callback(setup.plant, setup.axis_controller()) as outer:
            with control_callback(setup.plant, setup.axis_controller()) as inner:
                assert mujoco.get_mjcb_control() is inner
            assert mujoco.get_mjcb_control() is outer
        assert mujoco.get_mjcb_control() is other_callback
        setup.run(driver="callback")
        assert mujoco.get_mjcb_control() is other_callback


def test_a_rig_loads_while_a_callback_is_installed() -> None:
    with other_callback_function():
        load_plant()


def test_an_exception_comes_out_of_mj_step_and_takes_the_callback_out() -> None:
    setup, controller, calls = count_steps("observer.fail_at=7")
    plant, data = setup.plant, setup.plant.new_data()
    message = r"Counted .*0\.035 s(.|\n)*KeyError: 'lost'"
    with other_callback_function():
        with pytest.raises(RunStopped, match=message) as info, control_callback(plant, controller):
            mujoco.mj_step(plant.model, data, 400)
        assert mujoco.get_mjcb_control() is other_callback
    assert isinstance(info.value.__cause__, KeyError)
    assert calls["step"] == 7


def test_rollout_runs_the_callback() -> None:
    """mujoco.rollout writes zeros into the controls between the calls."""
    plant = load_plant()
    full = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)
    start = np.zeros(mujoco.mj_stateSize(plant.model, full))
    mujoco.mj_getState(plant.model, plant.new_data(), start, full)
    with control_callback(plant, cmg_mj.controller(plant, "ltv")):
        states, _ = rollout.rollout(plant.model, mujoco.MjData(plant.model), start[None], nstep=2000)
    lean = states[0, :, 1 + plant.tilt] - plant.tilt_zero  # after the time
    assert np.abs(np.degrees(lean)).max() < 3.0
    assert (
        np.abs(states[0, -1, 1 + plant.model.nq + plant.axis.modules[0].flywheel] - plant.axis.modules[0].speed) < 1.0
    )


def test_leaving_steps_out_is_said() -> None:
    plant = load_plant(timestep_s=0.001)
    controller, data = cmg_mj.controller(plant, "linear"), plant.new_data()
    for _ in range(5):  # steps 0, 2, 4, 6, 8: step 5 is left out
        control(plant, controller, data)
        mujoco.mj_step(plant.model, data, 2)
    with pytest.raises(InputError, match="call it at least every 5 physics steps"):
        control(plant, controller, data)


def test_a_start_between_two_samples_of_a_slow_sensor() -> None:
    plant = load_plant()
    controller = cmg_mj.controller(plant, "linear", sensors=Sensors(accelerometer=Accelerometer(rate_hz=100.0)))
    data = plant.new_data()
    data.time = 0.005
    assert control(plant, controller, data)
