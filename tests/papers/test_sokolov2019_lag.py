"""sokolov2019, Section V: the lags that MuJoCo oscillates at against the sampled loop's eigenvalues."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cmg_mj.papers.sokolov2019 import lag
from cmg_mj.papers.sokolov2019.lag import oscillation, rig_matrices
from cmg_mj.papers.sokolov2019.rig import Servo, experiment, read_servo
from cmg_mj.results.trajectory import Trajectory
from tests.plant import paper_model


def synthetic(rates: list[np.ndarray], t: np.ndarray) -> Trajectory:
    return Trajectory({"time_s": t, "x2_rad_s": np.array(rates).T})


def test_what_counts_as_sustained() -> None:
    t = np.arange(0.0, 6.0, 0.005)
    wave = np.sin(24.0 * t)
    fallen = np.where(t > 5.0, np.nan, wave)
    rates = [np.exp(-0.05 * t) * wave, np.exp(0.05 * t) * wave, wave, 1e-4 * wave, fallen]
    assert lag.is_sustained(synthetic(rates, t)).tolist() == [False, True, True, False, True]


SERVO = read_servo(experiment().plant)


def test_servo_is_the_models() -> None:
    assert (SERVO.kp, SERVO.kv) == (85.6, 0.731)
    assert SERVO.inertia == pytest.approx(paper_model.I_c + paper_model.I_d, rel=1e-12)
    assert SERVO.damp(0.02).lag_s == SERVO.soften(0.02).lag_s == pytest.approx(0.02)
    soft = SERVO.soften(0.02)
    assert soft.kv == pytest.approx(2.0 * math.sqrt(soft.kp * soft.inertia))


@pytest.mark.parametrize("lag_ms", [8.5, 15.0, 22.0])
def test_pole_of_the_sampled_loop_is_mujocos(lag_ms: float) -> None:
    """Decay and frequency of a small release of the compiled bodies, against the eigenvalue."""
    loop, _, dt = lag.linearise("linear")
    slow_servo = SERVO.damp(1e-3 * lag_ms)
    pole = oscillation(loop(slow_servo), dt)
    settings = ["plant.initial_tilt_deg=0.02", "duration_s=3.0"]
    trajectory = lag.releases({"linear": [slow_servo]}, settings)["linear"]
    t, x2 = trajectory["time_s"], trajectory["x2_rad_s"][:, 0]
    window = (t > 0.8) & (t < 1.6)  # when the faster poles have faded
    # A free oscillation obeys x[k+2] = 2 r cos(w) x[k+1] - r^2 x[k], here for steps of eight ticks.
    x = [x2[window][8 * i :] for i in range(3)]
    n = len(x[2])
    (a, b), *_ = np.linalg.lstsq(np.column_stack([x[1][:n], x[0][:n]]), x[2], rcond=None)
    pole_on_mujoco = np.log(np.roots([1.0, -a, -b]).astype(complex)[0]) / (8.0 * dt)
    assert abs(pole_on_mujoco.imag) == pytest.approx(pole.imag, rel=0.02)
    assert pole_on_mujoco.real == pytest.approx(pole.real, abs=0.15)


@pytest.fixture(scope="module")
def lags() -> lag.Lags:
    return lag.lags()


def test_thresholds_on_mujoco_are_the_predicted_ones(lags: lag.Lags) -> None:
    linear, (low, high) = lags.predictions["linear"], lags.thresholds["linear"]
    assert high is not None
    assert 0.5 * (low + high) == pytest.approx(linear["servo_lag_s"], abs=2e-4)
    for name in ("linear", "luenberger"):
        assert lags.latencies[name][1] == pytest.approx(lags.predictions[name]["latency_s"], abs=1.1e-3)
    sweep = lags.sweeps["linear"]
    assert sweep.sustained.tolist() == (sweep.lags_s > linear["servo_lag_s"]).tolist()
    assert not sweep.sustained[0]
    for name in ("luenberger", "homogeneous"):
        assert not lags.sweeps[name].sustained.any()


def test_the_flywheels_torque_on_the_gimbal_counts(lags: lag.Lags, monkeypatch: pytest.MonkeyPatch) -> None:
    """A loop model without it predicts another threshold, and MuJoCo tells the two apart."""

    def matrices_without(model, servo):
        A, B = rig_matrices(model, servo)
        A[3, 1] = 0.0
        return A, B

    monkeypatch.setattr(lag, "rig_matrices", matrices_without)
    prediction = lag.predict("linear")["servo_lag_s"]
    assert isinstance(prediction, float)
    assert abs(prediction - lags.thresholds["linear"][0]) > 1e-3


def test_claim_of_the_lag(lags: lag.Lags) -> None:
    claim = lag.claim(lags)
    assert claim.verdict == "reproduced within stated conditions"
    assert claim.figures["predicted"]["linear"]["damping_ratio"] == pytest.approx(0.118, abs=0.01)
    slower = lags._replace(thresholds={**lags.thresholds, "homogeneous": (0.01, 0.011)})
    assert lag.claim(slower).verdict == "not reproduced"


@pytest.mark.parametrize(
    ("observer", "servos", "settings", "sustained"),
    [
        # As the linearised loop says, a soft servo does not make it oscillate up to 100 ms.
        ("linear", [SERVO.soften(lag_s) for lag_s in (0.02, 0.04, 0.07, 0.1)], [], [False] * 4),
        # It oscillates from 64 ms on, beyond what RK4 takes at 1 ms.
        ("luenberger", [SERVO.damp(lag_s) for lag_s in (0.060, 0.069)], ["plant.timestep_s=0.0005"], [False, True]),
    ],
)
def test_other_servos(observer: str, servos: list[Servo], settings: list[str], sustained: list[bool]) -> None:
    assert lag.is_sustained(lag.releases({observer: servos}, settings)[observer]).tolist() == sustained
