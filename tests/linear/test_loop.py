"""The closed loop as a system of python-control: against algebra, against the simulation, and what it refuses."""

# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportOptionalSubscript=false
# (python-control has no types)

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import control
import mujoco
import numpy as np
import pytest
from scipy.linalg import expm

from cmg_mj import Experiment, InputError, Measurement, Scenario, load_scenario, mount, parse_scenario, prepare
from cmg_mj.core.sensor import Memory, Sensor, SensorStage, Signal, Site
from cmg_mj.core.straight_line import Tables
from cmg_mj.core.types import IdealReading
from cmg_mj.features.mounting.write import write_scenario
from cmg_mj.inputs.files import folder
from cmg_mj.linear.loop import INPUTS, TAKES
from cmg_mj.linear.plant import linearise
from cmg_mj.linear.slopes import observer_slopes
from cmg_mj.observers import OBSERVERS
from cmg_mj.sensors.accelerometer import Accelerometer
from tests.command import ROOT
from tests.features.mounting.push_robots import cart_pole

DT = 0.005
QUIET = {
    "accelerometer": {"noise_density_ug_rthz": 0.0, "counts_per_g": 0.0},
    "encoder": {"counts_per_revolution": 0.0},
    "mems_gyro": {
        "noise_density_deg_s_rthz": 1e-6,
        "bias_instability_deg_h": 0.01,
        "counts_per_deg_s": 0.0,
        "warming_k_min": 0.0,
    },
}


def experiment(
    kind: str = "linear", torque: float = 0.0, scenario: Scenario | None = None, **settings: Any
) -> Experiment:
    """A rig, by default the bundled one, at e = 0 and rest, with sensors that show what is there, pushed at 0.5 s."""
    fields = (scenario or load_scenario("push_recovery")).as_fields()
    fields["plant"] |= {"equilibrium_bias_deg": 0.0, "initial_tilt_deg": 0.0}
    fields |= {"observer": {"kind": kind}, "open_loop_observers": [], "sensors": QUIET, "duration_s": 3.0}
    fields["push"] = [{"start_s": 0.5, "duration_s": 0.1, "torque_n_m": torque}] if torque else []
    made = prepare(parse_scenario(fields))
    return made.with_settings({name.replace("__", "."): value for name, value in settings.items()})


def sampled_model(of: Experiment) -> tuple[np.ndarray, np.ndarray]:
    """F and G of [x1, x2, x3, x_e] on the reduced model; the law's integrator takes Euler's step."""
    model = of.plant.reduced
    whole = np.zeros((4, 4))
    whole[:3, :3], whole[:3, 3:] = model.A, model.B
    whole = expm(whole * DT)
    F, G = np.eye(4), np.zeros((4, 1))
    F[:3, :3], G[:3], F[3, 2] = whole[:3, :3], whole[:3, 3:], -DT
    return F, G


def worst_difference(of: Experiment, system: Any = None) -> float:
    """The largest difference between the run and the linear system, its own or another, over the signal's largest."""
    trajectory = of.run().trajectory
    system = system or of.linear_closed_loop()
    inputs = np.zeros((len(INPUTS), len(trajectory)))
    inputs[0] = trajectory["push_n_m"]
    response = control.forced_response(system, inputs=inputs, timepts=np.arange(len(trajectory)) * DT)
    linear = dict(zip(system.output_labels, response.outputs, strict=True))
    kind = of.scenario.observer.kind
    pairs = [(linear[name], trajectory[name]) for name in ("x1_rad", "x3_rad", "u_rad_s")]
    pairs.append((linear["estimated_x2_rad_s"], trajectory[f"estimate/{kind}/x2_rad_s"]))
    return max(float(np.max(np.abs(a - b)) / np.max(np.abs(b))) for a, b in pairs)


def test_poles_with_the_true_rate_are_those_of_the_exact_discretisation() -> None:
    of = experiment(controller__feedback="truth")
    F, G = sampled_model(of)
    system = of.linear_closed_loop("reduced")
    wanted = np.linalg.eigvals(F - G @ np.array([of.law.gains]))
    for pole in wanted:
        assert np.min(np.abs(system.poles() - pole)) < 1e-7
    assert system.dt == DT


def test_kalman_fed_back_has_the_poles_of_gains_and_filter_apart() -> None:
    """The separation principle: the filter's model is the plant, and all that is fed back is its estimate."""
    noisy = {"sensors__accelerometer__noise_density_ug_rthz": 400.0, "sensors__encoder__counts_per_revolution": 4096.0}
    of = experiment("kalman", controller__angle_source="estimated", **noisy)
    F, G = sampled_model(of)
    observer: Any = of.design.observer()
    noise = observer.process_noise
    Q = np.array([[getattr(noise, f"p{min(i, j)}{max(i, j)}") for j in range(1, 5)] for i in range(1, 5)])
    A, C = np.eye(4), np.zeros((2, 4))
    A[:3, :3] = F[:3, :3]
    model = of.plant.reduced
    torque = np.zeros((4, 4))
    torque[:3, :3], torque[1, 3] = model.A, 1.0 / (model.gimbals * model.J1)
    A[:, 3] = expm(torque * DT)[:, 3]
    C[0, 0] = C[1, 2] = 1.0
    R = np.diag(observer.measurement_noise)
    _, P, _ = control.dlqe(A, np.eye(4), C, Q, R)
    M = np.linalg.solve(C @ P @ C.T + R, C @ P).T
    wanted = [*np.linalg.eigvals(F - G @ np.array([of.law.gains])), *np.linalg.eigvals((np.eye(4) - M @ C) @ A)]
    poles = of.linear_closed_loop("reduced").poles()
    for pole in wanted:
        assert np.min(np.abs(poles - pole)) < 2e-6
    rest = [pole for pole in poles if np.min(np.abs(wanted - pole)) > 2e-6]
    assert np.abs(rest) == pytest.approx(0.0, abs=1e-9)  # the command before, which every sample forgets


def test_lqg_has_the_poles_of_gains_and_filter_apart() -> None:
    of = experiment(controller__kind="lqg", observer__kind="finite_difference")
    law: Any = of.law
    F, G = sampled_model(of)
    G[3] = -0.5 * DT * DT  # x_e is exact for a u held
    filter_poles = np.linalg.eigvals(law.transition[0] @ (np.eye(4) - law.innovation_gain @ law.C))
    wanted = [*np.linalg.eigvals(F - G @ np.array([law.gains])), *filter_poles]
    poles = of.linear_closed_loop("reduced").poles()
    for pole in wanted:
        assert np.min(np.abs(poles - pole)) < 1e-6


def test_the_run_of_a_small_push_is_that_of_the_linear_system() -> None:
    """Ten times smaller a push, and the share that differs is less than a twentieth: it is of second order."""
    large, small = (worst_difference(experiment("adaptive", torque, duration_s=1.5)) for torque in (0.3, 0.03))
    assert small < 2e-4
    assert large > 20.0 * small


AT_REST = dict.fromkeys(("linear", "luenberger", "ltv", "linear_high_gain", "finite_difference"), 1.2e-3)
SETTLING = dict.fromkeys(("kalman", "gyro_free", "free_pivot", "mems_fused"), 0.03)
"""At the push, half a second after the start, their gains are not yet those at rest."""


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "bound"), {**AT_REST, **SETTLING}.items())
def test_runs_of_small_pushes_are_those_of_the_linear_system(kind: str, bound: float) -> None:
    assert worst_difference(experiment(kind, 0.03)) < bound


ALL_AT_ONCE: dict[str, Any] = {
    "sensors__accelerometer__rate_hz": 1000.0,
    "sensors__accelerometer__latency_s": 0.003,
    "sensors__accelerometer__skew_s": 0.001,
    "sensors__accelerometer__bandwidth_hz": 184.0,
    "sensors__accelerometer__scale_error": (0.02, -0.01),
    "sensors__accelerometer__misalignment_deg": (0.3, -0.2),
    "sensors__encoder__latency_s": 0.007,
    "plant__accelerometer_outer_misplaced_mm": 2.0,
}
BESIDE_THE_LINE = ALL_AT_ONCE | {
    "sensors__accelerometer__scale_error": (0.0, 0.0),  # there it tilts the rig so far that sines count
    "plant__accelerometer_inner_across_m": 0.15,
    "plant__accelerometer_outer_angle_deg": 90.0,
}


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    [
        ALL_AT_ONCE,
        {"controller__feedback": "fog", "sensors__fog__latency_s": 0.006, "sensors__fog__bias_deg_h": 0.0},
        {"controller__feedback": "truth", "controller__notch_hz": 40.0},
        {"controller__angle_source": "estimated", "sensors__accelerometer__latency_s": 0.01},
        {"controller__rate_hz": 100.0, "sensors__accelerometer__skew_s": 0.001},
        BESIDE_THE_LINE,
    ],
    ids=["sensors", "fog", "notch", "estimated", "slow", "beside the line"],
)
def test_all_that_a_scenario_has_in_the_loop_is_in_the_system(settings: dict[str, Any]) -> None:
    assert_push_moves_both_alike(settings)


def assert_push_moves_both_alike(settings: dict[str, Any]) -> None:
    """As differences from the same run without the push: constant errors tilt the rig for good."""
    if "sensors__fog__latency_s" in settings:
        settings = settings | {"sensors__fog__angle_random_walk_deg_rth": 0.0}
    dt = 1.0 / settings.get("controller__rate_hz", 200.0)
    pushed, still = (experiment("adaptive", torque, **settings) for torque in (0.02, 1e-9))
    system = pushed.linear_closed_loop()
    runs = [each.run().trajectory for each in (pushed, still)]
    inputs = np.zeros((len(INPUTS), len(runs[0])))
    inputs[0] = runs[0]["push_n_m"]
    linear = control.forced_response(system, inputs=inputs, timepts=np.arange(len(runs[0])) * dt).outputs
    for i, name in enumerate(["x1_rad", "x2_rad_s", "x3_rad", "u_rad_s"]):
        moved = runs[0][name] - runs[1][name]
        assert np.max(np.abs(linear[i] - moved)) < 1e-2 * np.max(np.abs(moved)), name


@dataclass(frozen=True)
class _Sluggish(SensorStage):
    """Shows a share of each step at once, and the rest sample by sample."""

    share: float

    def init(self, signal: Signal, ideal: IdealReading, tables: Tables) -> Memory:
        return signal

    def step(
        self, memory: Memory, signal: Signal, ideal: IdealReading, sample: int, tables: Tables
    ) -> tuple[Memory, Signal]:
        shown = [before + self.share * (x - before) for before, x in zip(memory, signal, strict=True)]
        return shown, shown


@pytest.mark.parametrize("share", [0.3, 1.0])
def test_a_stage_that_the_loop_has_never_heard_of_is_in_it(monkeypatch: pytest.MonkeyPatch, share: float) -> None:
    """With the true rate the sluggish accelerometers make one more state: what they show of the tilt."""
    at_work = Accelerometer.at_work

    def sluggish(self: Accelerometer, site: Site) -> Sensor:
        sensor = at_work(self, site)
        return replace(sensor, stages=(*sensor.stages, _Sluggish(share)))

    monkeypatch.setattr(Accelerometer, "at_work", sluggish)
    of = experiment(controller__feedback="truth")
    F, G = sampled_model(of)
    k1, *others = of.law.gains
    closed = np.zeros((5, 5))  # x1, x2, x3, x_e, and what was shown at the tick before
    closed[4, [0, 4]] = share, 1.0 - share
    closed[:4, :4] = F - G @ np.array([[0.0, *others]])
    closed[:4] -= k1 * G * closed[4]
    system = of.linear_closed_loop("reduced")
    z = np.exp(1j * np.array([0.5, 8.0, 60.0]) * DT)
    noise = -k1 * np.append(G[:, 0], 0.0)  # it comes after the sensors
    for point, response in zip(z, system["x1_rad", "y1_noise_rad"](z), strict=True):
        assert response == pytest.approx(np.linalg.solve(point * np.eye(5) - closed, noise)[0], rel=1e-6)
    for pole in np.linalg.eigvals(closed):
        assert np.min(np.abs(system.poles() - pole)) < 1e-7 or abs(pole) < 1e-12


def test_a_process_that_nothing_drives_is_left_out() -> None:
    plain = experiment("adaptive").linear_closed_loop()
    noisy = experiment("adaptive", sensors__accelerometer__bias_instability_ug=500.0).linear_closed_loop()
    assert noisy.state_labels == plain.state_labels
    np.testing.assert_allclose(noisy.A, plain.A, atol=1e-12)


def test_a_turned_accelerometer_shows_the_same_whatever_it_errs_by() -> None:
    """Turned by 90 degrees, what shows the tilt is gravity's rounding at rest: no difference may be a share of that."""
    errors = {"sensors__accelerometer__misalignment_deg": (-0.3, 0.25), "sensors__accelerometer__skew_s": 0.001}
    straight, turned = (
        experiment("linear_high_gain", plant__accelerometer_outer_angle_deg=angle, **errors).linear_closed_loop()
        for angle in (0.0, 90.0)
    )
    z = np.exp(1j * np.array([0.5, 8.0, 60.0]) * DT)
    for name in ("push_n_m", "y1_noise_rad"):
        np.testing.assert_allclose(turned["u_rad_s", name](z), straight["u_rad_s", name](z), rtol=1e-6)


@pytest.mark.slow
def test_means_of_the_accelerometers_are_those_of_a_run(tmp_path: Path) -> None:
    for path in folder("models").glob("*.xml"):
        shown = [
            f'<frame{kind} name="accelerometer_{place}_{name}" objtype="site" objname="accelerometer_{place}"/>'
            for place in ("inner", "outer")
            for kind, name in (("linvel", "velocity"), ("xaxis", "x"), ("zaxis", "z"))
        ]
        text = path.read_text()
        if path.name == "scissored_pair.xml":
            text = text.replace("</sensor>", "".join(shown) + "</sensor>")
        (tmp_path / path.name).write_text(text)
    settings = {
        "plant__model": str(tmp_path / "scissored_pair.xml"),
        "plant__accelerometer_outer_angle_deg": 20.0,
        "plant__accelerometer_inner_across_m": 0.05,
        "sensors__accelerometer__latency_s": 0.005,
    }
    means, instants = (
        experiment("gyro_free", 0.03, sensors__accelerometer__averaged=averaged, **settings)
        for averaged in (True, False)
    )
    assert worst_difference(means) < 2e-3
    assert worst_difference(means, instants.linear_closed_loop()) > 0.02


BORDERS: list[tuple[str, str, Any, Any]] = [
    ("linear", "sensors__accelerometer__latency_s", 0.005, 0.015),
    ("linear_high_gain", "sensors__accelerometer__latency_s", 0.0, 0.005),
    ("adaptive", "sensors__accelerometer__latency_s", 0.03, 0.04),
    ("linear", "sensors__accelerometer__bandwidth_hz", 44.0, 10.0),
    ("gyro_free", "sensors__accelerometer__skew_s", 0.0, 0.005),
]
"""Observer, field, and a value on either side of where the loop ceases to be stable."""


def is_stable(of: Experiment) -> bool:
    return bool(np.max(np.abs(of.linear_closed_loop().poles())) < 1.0)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "field", "stable", "unstable"), BORDERS)
def test_the_simulation_grows_where_a_pole_is_outside(kind: str, field: str, stable: Any, unstable: Any) -> None:
    for value, wanted in ((stable, True), (unstable, False)):
        of = experiment(kind, 0.01, **{field: value})
        assert is_stable(of) == wanted
        tilt = np.abs(of.run().trajectory["x1_rad"])
        n = len(tilt)
        assert bool(np.max(tilt[-n // 6 :]) < np.max(tilt[n // 3 : n // 2])) == wanted


@pytest.mark.parametrize("value", [0.005, 0.015])
def test_a_latency_decides_on_stability(value: float) -> None:
    assert is_stable(experiment("linear", sensors__accelerometer__latency_s=value)) == (value < 0.01)


@pytest.mark.slow
@pytest.mark.parametrize("release", [["slider"], []], ids=["slides", "held"])
def test_a_mounted_robot_has_a_loop(release: list[str], tmp_path: Path) -> None:
    """On a cart that slides or is held; a tilt that is taken about the wrong point makes a pole outside, and a fall."""
    spec = mujoco.MjSpec.from_string(cart_pole(1.0, 0.0, 5e-4))
    model = mount(spec, "pole", axis="hinge", release=release).save(tmp_path / "cart.xml")
    scenario = write_scenario(model, model, "adaptive").scenario
    assert worst_difference(experiment("adaptive", 0.01, scenario)) < 3e-3
    if release:
        wrong = experiment("adaptive", 0.01, scenario, plant__pivot_slides=False)
        assert not is_stable(wrong)
        assert wrong.run().fell.all()
        with pytest.raises(InputError, match=r"its pivot slides; take linear_closed_loop\(plant=\"rig\"\)"):
            wrong.linear_closed_loop("reduced")


@pytest.mark.slow
def test_a_robot_on_contacts_has_the_loop_of_its_reduced_model(tmp_path: Path) -> None:
    spec = mujoco.MjSpec.from_file(str(ROOT / "examples/robots/torso.xml"))
    model = mount(spec, "torso", axis="x", scale=1.21).save(tmp_path / "torso.xml")
    standing = write_scenario(model, model, "adaptive")
    with pytest.raises(InputError, match=r"it stands freely, on contacts, .* take linear_closed_loop\(plant="):
        standing.linear_closed_loop()
    assert np.max(np.abs(standing.linear_closed_loop("reduced").poles())) < 1.0


def test_the_loop_transfer_follows_from_the_disturbed_gimbals() -> None:
    of = experiment(controller__feedback="truth")
    F, G = sampled_model(of)
    system = of.linear_closed_loop("reduced")["u_rad_s", "gimbal_rate_noise_rad_s"]
    for omega in (1.0, 8.0, 60.0):
        z = np.exp(1j * omega * DT)
        wanted = (np.array([of.law.gains]) @ np.linalg.solve(z * np.eye(4) - F, G)).item()
        H = system(z)
        assert pytest.approx(wanted, rel=1e-6) == -H / (1.0 + H)


def test_python_control_takes_it(recwarn: pytest.WarningsRecorder) -> None:
    system = experiment("luenberger").linear_closed_loop()
    assert system.input_labels == list(INPUTS)
    assert system.output_labels[:4] == ["x1_rad", "x2_rad_s", "x3_rad", "u_rad_s"]
    assert system.output_labels[4:] == ["estimated_x1_rad", "estimated_x2_rad_s", "estimated_x3_rad"]
    assert np.max(np.abs(control.poles(system))) < 1.0
    tilt = system["x1_rad", "push_n_m"]
    response = control.step_response(tilt, 60.0)
    assert response.outputs[-1] == pytest.approx(control.dcgain(tilt), rel=1e-3)
    magnitude, phase, _ = control.frequency_response(tilt, np.array([1.0, 10.0]))
    assert np.all(np.isfinite([magnitude, phase]))
    # A constant torque is balanced by gravity, with the gimbals back at upright.
    reduced = experiment().plant.reduced
    assert control.dcgain(tilt) == pytest.approx(-1.0 / (reduced.gimbals * reduced.gravity_torque), rel=1e-4)


def test_an_equilibrium_bias_is_a_constant_error_of_y1() -> None:
    """It ends in no tilt error of the true equilibrium, as the integrator of (8) wants: x1 is y1 plus e."""
    system = experiment("adaptive").linear_closed_loop()
    assert control.dcgain(system["x3_rad", "y1_noise_rad"]) == pytest.approx(0.0, abs=1e-6)
    assert control.dcgain(system["x1_rad", "y1_noise_rad"]) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("kind", OBSERVERS)
def test_observers_with_a_slope_are_those_listed(kind: str) -> None:
    of = experiment(kind)
    if kind in TAKES:
        system = of.linear_closed_loop()
        assert "estimated_x2_rad_s" in system.output_labels
        assert np.max(np.abs(system.poles())) < 1.0
    else:
        with pytest.raises(InputError, match=f"observer.kind = '{kind}': has no slope at rest; .* adaptive, finite"):
            of.linear_closed_loop()


@pytest.mark.parametrize(
    ("settings", "plant", "message"),
    [
        ({"plant__gimbal_backlash_arcmin": 6.0}, "rig", "gimbal_backlash_arcmin = 6: backlash is not linear; set"),
        ({"sensors__encoder__rate_hz": 100.0}, "rig", "sensors.encoder.rate_hz = 100: .* the control rate, 200 Hz"),
        ({}, "reducd", "plant = 'reducd': did you mean 'reduced'"),
    ],
)
def test_refuses_what_is_not_covered(settings: dict[str, Any], plant: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        experiment(**settings).linear_closed_loop(plant)


def test_axes_have_a_loop_each() -> None:
    both = prepare(load_scenario("two_axes", ["observer.kind=linear"]))
    with pytest.raises(InputError, match=r"tilts about several axes .* lock the others"):
        both.linear_closed_loop()
    first, second = both.axes
    for part in (first, second):
        assert np.max(np.abs(part.linear_closed_loop("reduced").poles())) < 1.0
        with pytest.raises(InputError, match=r"the rig tilts about .* too, .* lock the others"):
            part.linear_closed_loop()
    locked = prepare(load_scenario("two_axes", ["observer.kind=linear", 'plant.locked_axes=["pitch"]']))
    assert is_stable(locked)


def test_the_minimal_rig_answers_as_the_whole_one() -> None:
    plant = experiment().plant
    A, B, C, _, _ = linearise(plant)
    rig = linearise(plant).minimal()
    assert len(rig.A) < len(A)
    tilt = np.zeros(len(A))
    tilt[: plant.model.nv] = plant.axis.line.motion(plant.model, plant.new_data())
    np.testing.assert_array_equal(C[0], tilt)
    for omega in (0.3, 4.0, 90.0):
        s = 1j * omega
        whole = tilt @ np.linalg.solve(s * np.eye(len(A)) - A, B[:, 0])
        minimal = rig.C[0] @ np.linalg.solve(s * np.eye(len(rig.A)) - rig.A, rig.B[:, 0])
        assert minimal == pytest.approx(whole, rel=1e-5)


class _Pair(NamedTuple):
    slow: float
    fast: np.ndarray


@dataclass(frozen=True)
class _Memory:
    pair: _Pair
    parts: dict[str, list[float]]
    count: int = 0


class _Odd:
    """x2 = 2 y1 before - y2 + u, out of a state of all kinds."""

    def init(self, y: Measurement) -> Any:
        return _Memory(_Pair(y.y1, np.array([y.y2, 0.0])), {"a": [0.0]})

    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        rate = 2.0 * state.pair.slow - state.pair.fast[0] + state.parts["a"][0]
        after = _Pair(y.y1, np.array([y.y2, 0.0]))
        return replace(state, pair=after, parts={"a": [u]}), (y.y1, rate, y.y2)


def test_states_of_all_kinds_are_taken() -> None:
    slopes = observer_slopes(_Odd())
    assert ["_".join(path) for path in slopes.paths] == ["pair_slow", "pair_fast_0", "pair_fast_1", "parts_a_0"]
    assert slopes.C[1] == pytest.approx([2.0, -1.0, 0.0, 1.0])
    assert slopes.B[[0, 1, 3]][:, [0, 1, 3]] == pytest.approx(np.eye(3))


class _Drifts(_Odd):
    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        return replace(state, parts={"a": [1.0 + state.parts["a"][0]]}), (0.0, 0.0, 0.0)


class _Raises(_Odd):
    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        raise KeyError("gone")


@pytest.mark.parametrize(
    ("observer", "message"),
    [(_Raises(), "fails near rest: KeyError: 'gone'"), (_Drifts(), "does not come to rest while nothing moves")],
)
def test_an_observer_that_cannot_be_linear_says_why(
    monkeypatch: pytest.MonkeyPatch, observer: Any, message: str
) -> None:
    monkeypatch.setattr("cmg_mj.linear.slopes.MAX_SAMPLES", 1000)
    with pytest.raises(InputError, match=message):
        observer_slopes(observer)
