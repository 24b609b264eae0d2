"""The law (8), its integrator and limits, and the controller around it, against the paper's numbers and scipy."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from cmg_mj.core.axis import KnownPlant
from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.core.tilt import GimbalAngle, PairTilt
from cmg_mj.core.types import IdealReading
from cmg_mj.laws.state_feedback import StateFeedback, lqr_gains
from cmg_mj.observers import Estimate, Measurement, make_observer
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.design import make_axis
from cmg_mj.scenario.loading import parse_scenario
from cmg_mj.sensors import Sensors
from cmg_mj.sensors.accelerometer import Accelerometer, Encoder
from cmg_mj.sensors.gyros import Fog
from tests.observers.reference import DT, GRAVITY_TORQUE, J1, J2, PAPER
from tests.plant import paper_model as paper
from tests.recorded import push_recovery, recorded

K_E = (35.0, 4.0, -1.0, 0.3)  # aranovskiy2020 Table 2
OTHER_GAINS = (20.0, -3.0, 1.5, 0.4)
RATE_LIMIT = 4.7  # rad/s: 45 rev/min, Dynamixel MX-106R

MOMENTUM = paper.J_d * paper.omega_d

A_E = np.array(
    [[0.0, 1.0, 0.0, 0.0], [GRAVITY_TORQUE / J1, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0]]
)
B_E = np.array([[0.0], [MOMENTUM / J1], [1.0], [0.0]])


def run(*settings: str) -> Trajectory:
    return recorded(push_recovery(*settings).run())


# --- the reduced model that the gains are for ----------------------------------------------------------------


def test_reduced_model_is_the_printed_equation() -> None:
    """The second line of (4), and (6)."""
    for x1, x2, x3, u in np.random.default_rng(4).uniform(-1.0, 1.0, (20, 4)) * [1.0, 9.0, 3.0, 5.0]:
        f2 = slope(np.array([x1, x2, x3]), u)[1]
        assert PAPER.tilt_acceleration(x1, x2, x3, u) == pytest.approx(f2, rel=1e-12, abs=1e-12)
    np.testing.assert_allclose(PAPER.A_e, A_E, rtol=1e-14)
    np.testing.assert_allclose(PAPER.B_e, B_E, rtol=1e-14)


def test_closed_loop_poles_of_table_2() -> None:
    """The law itself, differentiated: A_e - B_e K_e has -10.47 +- 4.60j and -0.203 +- 0.295j."""
    K = [[-StateFeedback(DT)(*row)[0] for row in (1e-3 * np.eye(4)).tolist()]]
    poles = np.linalg.eigvals(A_E - B_E @ (1e3 * np.array(K)))
    expected = [-10.47 - 4.60j, -10.47 + 4.60j, -0.203 - 0.295j, -0.203 + 0.295j]
    result = sorted(poles, key=lambda s: (round(s.real, 2), s.imag))
    np.testing.assert_allclose([s.real for s in result], [s.real for s in expected], atol=6e-3)
    np.testing.assert_allclose([s.imag for s in result], [s.imag for s in expected], atol=6e-3)
    np.testing.assert_allclose([s.real for s in result[2:]], -0.203, atol=6e-4)
    np.testing.assert_allclose([abs(s.imag) for s in result[2:]], 0.295, atol=6e-4)


# --- the law -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("law", "gains"), [(StateFeedback(DT), K_E), (StateFeedback(DT, OTHER_GAINS), OTHER_GAINS)])
def test_law_is_the_papers(law: StateFeedback, gains: tuple[float, float, float, float]) -> None:
    """u = -K_e [y1, x2, y2, x_e], x_e' = -x3 over a control period."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        x = rng.normal(0.0, [0.02, 0.2, 0.5, 1.0]).tolist()
        u, x_e = law(*x)
        assert u == pytest.approx(-(gains[0] * x[0] + gains[1] * x[1] + gains[2] * x[2] + gains[3] * x[3]), rel=1e-12)
        assert x_e == pytest.approx(x[3] - DT * x[2], rel=1e-12)


@pytest.mark.parametrize("limit", [RATE_LIMIT, 2.0])
def test_rate_limit(limit: float) -> None:
    law = StateFeedback(DT) if limit == RATE_LIMIT else StateFeedback(DT, rate_limit=limit)
    x1 = limit / 35.0
    assert law(0.999 * x1, 0.0, 0.0, 0.0)[0] == pytest.approx(-0.999 * limit)
    for sign in (1.0, -1.0):
        assert law(sign * 1.001 * x1, 0.0, 0.0, 0.0)[0] == -sign * limit
        assert law(sign * 9.0, 0.0, 0.0, 0.0)[0] == -sign * limit


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("k4", [0.3, -0.3])
def test_integrator_does_not_wind_up(sign: float, k4: float) -> None:
    """Saturated: x_e moves only if that brings the demand back. The demand moves by k4 x3 dt a period."""
    law = StateFeedback(DT, (35.0, 4.0, -1.0, k4))
    saturating = -sign * 0.5  # demand of sign * 17.5 rad/s
    outward = math.copysign(0.2, sign * k4)
    assert law(saturating, 0.0, outward, 1.0) == (sign * RATE_LIMIT, 1.0)
    u, x_e = law(saturating, 0.0, -outward, 1.0)
    assert (u, x_e) == (sign * RATE_LIMIT, pytest.approx(1.0 + DT * outward))
    assert law(0.0, 0.0, outward, 0.0)[1] == pytest.approx(-DT * outward)  # not saturated: it integrates


def slope(x: np.ndarray, u: float) -> np.ndarray:
    """(4)."""
    x1, x2, x3 = x.tolist()
    gyroscopic = u * (MOMENTUM * math.cos(x3) - J2 * x2 * math.sin(2.0 * x3))
    return np.array([x2, (gyroscopic + GRAVITY_TORQUE * math.sin(x1)) / (J1 + J2 * math.sin(x3) ** 2), u])


# --- LQR -----------------------------------------------------------------------------------------------------

WEIGHTS = [([100.0, 1.0, 1.0, 0.1], 1.0), ([1.0, 1.0, 1.0, 1.0], 0.2), ([2000.0, 5.0, 0.5, 0.05], 3.0)]


def riccati(state_cost: list[float], input_cost: float) -> np.ndarray:
    return solve_continuous_are(A_E, B_E, np.diag(state_cost), np.array([[input_cost]]))


@pytest.mark.parametrize(("state_cost", "input_cost"), WEIGHTS)
def test_lqr_gains_are_those_of_the_riccati_equation(state_cost: list[float], input_cost: float) -> None:
    expected = B_E.T @ riccati(state_cost, input_cost) / input_cost
    np.testing.assert_allclose([lqr_gains(PAPER, state_cost, input_cost)], expected, rtol=1e-6)


def test_lqr_of_a_scenario_reaches_the_law() -> None:
    state_cost, input_cost = WEIGHTS[0]
    scenario = {"controller": {"lqr": {"state_cost": state_cost, "input_cost": input_cost}}}
    expected = (B_E.T @ riccati(state_cost, input_cost) / input_cost).ravel()
    law = prepare(parse_scenario(scenario)).law
    assert isinstance(law, StateFeedback)
    assert law.gains == pytest.approx(tuple(expected), rel=1e-6)
    assert prepare(parse_scenario({})).law == StateFeedback(DT, K_E, RATE_LIMIT)


@pytest.mark.parametrize("state_cost", [[1.0, 1.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
def test_lqr_that_leaves_the_integrator_alone_is_refused(state_cost: list[float]) -> None:
    with pytest.raises(InputError, match=r"^controller\.lqr: no stabilising gain"):
        lqr_gains(PAPER, state_cost, 1.0)


# --- the controller ------------------------------------------------------------------------------------------


class Script:
    """An observer that returns what it was told, and remembers what it was asked."""

    def __init__(self, estimate: Callable[[int], Any]) -> None:
        self.estimate = estimate
        self.calls: list[tuple[float, float, float]] = []

    def init(self, y: Measurement) -> int:
        return 0

    def step(self, state: int, y: Measurement, u: float) -> tuple[int, Any]:
        self.calls.append((y.y1, y.y2, u))
        return state + 1, self.estimate(state + 1)


IDEAL_SENSORS = Sensors(
    Accelerometer(noise_density_ug_rthz=0.0, counts_per_g=0.0),
    Encoder(counts_per_revolution=0.0),
    Fog(angle_random_walk_deg_rth=0.0, bandwidth_hz=0.0, bias_deg_h=0.0),
)


def reading(tilt: float, gimbal: float, rate: float) -> IdealReading:
    """A still rig: gravity in both accelerometers, gimbals moved oppositely from a quarter turn."""
    x, z = -9.81 * math.sin(tilt), 9.81 * math.cos(tilt)
    return IdealReading((x, z, x, z), [math.pi / 2.0 + gimbal, math.pi / 2.0 - gimbal], rate, rate)


PLANT = KnownPlant(PairTilt(0.1, 0.3), GimbalAngle((1.0, -1.0), (math.pi / 2.0, math.pi / 2.0)), 0.001)


def controller(
    observer: Any, law: StateFeedback | None = None, sensors: Sensors = IDEAL_SENSORS, seed: int = 0, **options: Any
) -> Controller:
    return Controller([make_axis(observer, law or StateFeedback(DT), sensors, PLANT, **options)], seed=seed)


READINGS = [reading(0.01, 0.0, 0.5), reading(0.02, 0.1, 0.6), reading(-0.01, 0.2, 0.7), reading(0.03, -0.1, 0.8)]
ESTIMATES = [Estimate(0.01, 0.0, 0.0), *(Estimate(0.001 * k, 0.1 * k, -0.05 * k) for k in (1, 2, 3))]


def ticks(loop: Controller, readings: list[IdealReading] = READINGS) -> list[Any]:
    result = []
    for k, ideal in enumerate(readings):
        assert loop.update(5 * k, ideal)
        result.append(loop.tick)
    return result


def test_measurements_are_tilt_and_half_the_difference_of_the_gimbals() -> None:
    for tick, (tilt, gimbal) in zip(
        ticks(controller(Script(ESTIMATES.__getitem__))),
        [(0.01, 0.0), (0.02, 0.1), (-0.01, 0.2), (0.03, -0.1)],
        strict=True,
    ):
        assert tick.y1 == pytest.approx(tilt, abs=1e-14)
        assert tick.y2 == pytest.approx(gimbal, abs=1e-14)
    lopsided = IdealReading(READINGS[0].accelerations, [math.pi / 2.0 + 0.3, math.pi / 2.0 - 0.1], 0.0, 0.0)
    assert ticks(controller(Script(ESTIMATES.__getitem__)), [lopsided])[0].y2 == pytest.approx(0.2)


def test_observer_gets_the_sample_and_the_command_held_since_the_last() -> None:
    observer = Script(ESTIMATES.__getitem__)
    result = ticks(controller(observer))
    assert observer.calls == [(tick.y1, tick.y2, last.u) for last, tick in itertools.pairwise(result)]


@pytest.mark.parametrize("angles", ["measured", "estimated"])
@pytest.mark.parametrize("feedback", ["observer", "fog", "truth"])
def test_law_acts_on_the_signals_of_its_settings(feedback: Any, angles: Any) -> None:
    """(8) with y1, y2 or their estimates; the rate from the observer, the gyro (here off by 0.02) or the truth."""
    fog = replace(IDEAL_SENSORS.fog, bias_deg_h=math.degrees(0.02) * 3600.0)
    sensors = replace(IDEAL_SENSORS, fog=fog)
    loop = controller(Script(ESTIMATES.__getitem__), sensors=sensors, feedback=feedback, angle_source=angles)
    x_e = 0.0
    for ideal, estimate, tick in zip(READINGS, ESTIMATES, ticks(loop), strict=True):
        assert tick.fog == pytest.approx(ideal.rate + 0.02, rel=1e-12)
        x1, x3 = (estimate.x1, estimate.x3) if angles == "estimated" else (tick.y1, tick.y2)
        x2 = {"observer": estimate.x2, "fog": tick.fog, "truth": ideal.rate}[feedback]
        assert tick.u == pytest.approx(-(35.0 * x1 + 4.0 * x2 - x3 + 0.3 * x_e), rel=1e-12)
        assert tick.x_e == pytest.approx(x_e, abs=1e-15)
        x_e -= DT * x3


def test_open_loop_observers_see_the_same_and_change_nothing() -> None:
    open_loop_observer = Script(lambda k: Estimate(9.0, -9.0 * k, 9.0))
    alone, observer = ticks(controller(Script(ESTIMATES.__getitem__))), Script(ESTIMATES.__getitem__)
    both_ticks = ticks(controller(observer, open_loop_observers=[open_loop_observer]))
    assert open_loop_observer.calls == observer.calls
    assert [tick.u for tick in both_ticks] == [tick.u for tick in alone]
    assert [tick.estimates[1].x2 for tick in both_ticks] == [0.0, -9.0, -18.0, -27.0]


class WithBias(Script):
    """One that estimates the bias and something else besides."""

    extra_signals = ("torque_n_m", "bias_rad")


def test_extra_signals_follow_the_state() -> None:
    loop = controller(WithBias(lambda k: (0.1, 0.2, 0.3, 0.4 * k, 0.5 * k)))
    assert loop.axes[0].extra_signals == [("torque_n_m", "bias_rad")]
    assert [tuple(tick.estimates[0])[3:] for tick in ticks(loop)] == [
        (0.0, 0.0),
        (0.4, 0.5),
        (0.8, 1.0),
        (0.4 * 3, 1.5),
    ]


def test_trim_holds_the_integrator_where_the_bias_asks_for_it() -> None:
    """u = 0 at y1 = -e needs k_e4 x_e = k_e1 e; from the end of the trim on, x_e' = -x3 as ever."""
    result = ticks(controller(WithBias(lambda k: (0.1, 0.2, 0.3, 0.4, 0.01 * k)), bias_trim_s=2.0 * DT))
    expected = [0.0, 35.0 / 0.3 * 0.01]
    expected += [expected[-1] - DT * result[1].y2, expected[-1] - DT * (result[1].y2 + result[2].y2)]
    assert [tick.x_e for tick in result] == pytest.approx(expected, rel=1e-12)
    assert -35.0 * -0.01 - 0.3 * result[1].x_e == pytest.approx(0.0, abs=1e-15)  # at rest at y1 = -e nothing is asked


def test_trim_needs_a_bias_and_an_integrator() -> None:
    with pytest.raises(
        InputError, match=r"controller\.bias_trim_s = 1: needs an observer in the loop that estimates the bias"
    ):
        controller(Script(ESTIMATES.__getitem__), bias_trim_s=1.0)
    with pytest.raises(InputError, match=r"controller\.bias_trim_s = 1: the gain on the integrator is zero"):
        controller(WithBias(ESTIMATES.__getitem__), bias_trim_s=1.0, law=StateFeedback(DT, (35.0, 4.0, 1.0, 0.0)))


def test_reset_starts_the_same_run_again() -> None:
    loop = controller(make_observer("homogeneous", DT, PAPER), sensors=Sensors(), seed=3)
    first = ticks(loop)
    loop.reset()
    assert loop.tick is None
    assert ticks(loop) == first


def test_nothing_is_due_between_ticks() -> None:
    observer = Script(ESTIMATES.__getitem__)
    loop = controller(observer)
    assert (loop.period, loop.steps_per_sample) == (5, 5)
    dues = [loop.update(step, READINGS[0]) for step in range(16)]
    assert [step for step, is_due in enumerate(dues) if is_due] == [0, 5, 10, 15]
    assert len(observer.calls) == 3


@pytest.mark.parametrize(("name", "angles"), [("x2", "measured"), ("x1", "estimated"), ("x3", "estimated")])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_an_estimate_that_is_no_number_stops_the_run(value: float, name: str, angles: Any) -> None:
    """Angles count if the law uses the estimated ones."""
    broken: Any = {name: value}
    observer = Script(lambda k: Estimate(0.0, 0.0, 0.0)._replace(**(broken if k == 2 else {})))
    with pytest.raises(RunStopped, match=rf"Script.* {name} .*0\.01 s"):
        ticks(controller(observer, angle_source=angles))


# --- in the loop ---------------------------------------------------------------------------------------------


def test_recorded_commands_are_the_papers_law() -> None:
    """(8) on the record of a run on the full model, through start, push and saturation."""
    trajectory = run("duration_s=1", "push.0.start_s=0.3", "push.0.torque_n_m=4.0")
    y1, y2, u, x_e = (trajectory[name] for name in ("y1_rad", "y2_rad", "u_rad_s", "x_e_rad_times_s"))
    x2 = trajectory["estimate/homogeneous/x2_rad_s"]
    demand = -(35.0 * y1 + 4.0 * x2 - 1.0 * y2 + 0.3 * x_e)
    np.testing.assert_allclose(u, np.clip(demand, -4.7, 4.7), rtol=0.0, atol=1e-12)
    saturated = np.abs(demand) > 4.7
    assert 0 < saturated.sum() < 100
    assert x_e[0] == 0.0
    is_held = saturated & (y2 * demand > 0.0)
    np.testing.assert_allclose(np.diff(x_e), np.where(is_held, 0.0, -0.005 * y2)[:-1], rtol=0.0, atol=1e-12)


def test_gimbals_move_oppositely_at_the_commanded_rate() -> None:
    """The command arrives as +-u: the gimbals' mean rate, in their own directions, follows it."""
    trajectory = run(
        "duration_s=1", "push=[]", "controller.feedback=truth", "sensors.accelerometer.noise_density_ug_rthz=0"
    )
    first, second = (trajectory[f"angle/cube{i}/gimbal_rad"] - math.pi / 2.0 for i in (1, 2))
    np.testing.assert_allclose(first, -second, atol=1e-6)
    np.testing.assert_allclose(trajectory["x3_rad"], first, atol=1e-6)
    setpoint = np.concatenate([[0.0], np.cumsum(trajectory["u_rad_s"])[:-1]]) * 0.005
    np.testing.assert_allclose(first[100:], setpoint[100:], atol=2e-2)
