"""The closed loop that the gains make on the reduced model, and what is said of it."""

from __future__ import annotations

import math
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from cmg_mj import load_plant, load_scenario, prepare
from cmg_mj.core.reduced_model import hold_matrices
from cmg_mj.inputs.files import bundled, folder
from cmg_mj.laws.state_feedback import StateFeedback, closed_loop_poles
from cmg_mj.linear.verdict import GainsVerdict, judge_gains
from cmg_mj.stages.notch import Notch
from tests.command import cmg_mj

pytestmark = pytest.mark.usefixtures("elsewhere")


@pytest.fixture
def half() -> str:
    """The bundled rig with flywheels of half the inertia."""
    for name in ("scissored_pair.xml", "cube.xml"):
        text = (folder("models") / name).read_text()
        text = text.replace('diaginertia="5.6e-4 11e-4 5.6e-4"', 'diaginertia="2.8e-4 5.5e-4 2.8e-4"')
        Path(name.replace("scissored_pair", "half")).write_text(text)
    return "plant.model='half.xml'"


def loop(*overrides: str, name: str = "push_recovery") -> GainsVerdict:
    experiment = prepare(load_scenario(name, overrides))
    assert isinstance(experiment.law, StateFeedback)
    return judge_gains(experiment.design)


@pytest.mark.daily_cases("push_recovery", "two_axes", "single_gimbal")
@pytest.mark.parametrize("name", bundled("scenarios"))
def test_the_bundled_scenarios_give_no_hint(name: str) -> None:
    assert loop(name=name).hint is None
    assert "hint" not in cmg_mj("check", name).out


def test_without_sampling_and_delay_the_poles_are_those_of_the_law() -> None:
    fast_loop = loop("controller.rate_hz=2000", "sensors.accelerometer.rate_hz=2000", "sensors.encoder.rate_hz=2000")
    model, gains = load_plant().reduced, (35.0, 4.0, -1.0, 0.3)
    np.testing.assert_allclose(
        np.sort(np.real(fast_loop.loop.poles)), np.sort(np.real(closed_loop_poles(model, gains))), rtol=5e-3
    )
    assert fast_loop.loop.distance == pytest.approx(1.0, abs=0.01)  # Table 2's gains are an LQR's, as good as


def test_an_lqr_keeps_its_distance() -> None:
    assert loop("controller.lqr.state_cost=[1, 1, 1, 1]", "controller.rate_hz=1000").loop.distance > 0.9


@pytest.mark.daily_cases("0.04-0.0005")
@pytest.mark.parametrize("h", [5e-4, pytest.param(1e-4, marks=pytest.mark.slow)])
@pytest.mark.parametrize("latency", [0.04, 0.06])
def test_stable_is_what_the_loop_step_by_step_is(latency: float, h: float) -> None:
    outcome = loop(f"sensors.accelerometer.latency_s={latency}", f"sensors.encoder.latency_s={latency}")
    is_stable = abs(tilts(h, 6.0, 0.005, latency)[-1]) < 0.01
    assert (outcome.loop.words == "stable") == is_stable == (latency < 0.05)


def tilts(h: float, seconds: float, period: float, latency: float = 0.0) -> np.ndarray:
    """The linearisation stepped finely from a tilt, with the command held and the signals late."""
    model, K = load_plant().reduced, np.array([35.0, 4.0, -1.0, 0.3])
    steps, late = round(seconds / h), round(latency / h)
    x = np.zeros((steps + 1, 4))
    x[0, 0], u = 0.01, 0.0
    for k in range(steps):
        if k % round(period / h) == 0:
            u = -K @ x[max(k - late, 0)]
        x[k + 1] = x[k] + h * (model.A_e @ x[k] + model.B_e[:, 0] * u)
    return x[:, 0]


@pytest.mark.daily_cases("0.08-False", "0.1-True")
@pytest.mark.parametrize(("period", "unstable"), [(1.0, True), (0.1, True), (0.08, False)])
def test_a_period_at_which_the_loop_is_unstable(period: float, unstable: bool) -> None:
    grown = np.abs(tilts(5e-4, 40.0 * period, period)[:: round(period / 5e-4)])
    assert bool(not grown[-1] <= grown[10]) is unstable


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (
            ["controller.gains=[-35, 4, -1, 0.3]"],
            'unstable .*; controller.gains = "scaled" or .controller.lqr. finds gains',
        ),
        (["controller.rate_hz=10"], "unstable on .*, sampled every 0.1 s .*; a higher rate or less latency is needed"),
        (["sensors.accelerometer.rate_hz=10"], "unstable on .*, sampled every 0.1 s"),
        (["sensors.accelerometer.latency_s=0.045"], "poorly damped on .*, 0.045 s late .damping ratio 0.09"),
        (["sensors.accelerometer.latency_s=0.02"], "little margin on .*, 0.02 s late"),
        (["controller.gains=[17.5, 2.0, -0.5, 0.15]"], "little margin on .* within 0.60 of -1, good is 0.7 or more"),
        (["sensors.accelerometer.latency_s=0.5"], "unstable"),
    ],
)
def test_hints(settings: list[str], words: str) -> None:
    hint = loop(*settings).hint
    assert hint is not None
    assert re.search(words, hint), hint


def test_a_latency_of_a_sensor_that_is_not_used_does_not_count() -> None:
    assert loop("sensors.fog.latency_s=0.1").hint is None
    assert "unstable" in str(loop("sensors.fog.latency_s=0.1", "controller.feedback='fog'").hint)


def test_half_the_flywheel_is_hinted_at(half: str) -> None:
    """With Table 2's gains it falls soon after the push."""
    outcome = cmg_mj("run", "push_recovery", "--set", half, "--set", "duration_s=4", "--out", "it", "--json")
    assert "cmg-mj: hint: controller: the closed loop has little margin" in outcome.err
    assert '"outcome": "fell"' in outcome.out
    assert "hint" in cmg_mj("check", "half.xml").out


def test_a_model_with_its_scenario_beside_it_is_not_judged_by_other_gains(half: str) -> None:
    Path("half.toml").write_text('[plant]\nmodel = "half.xml"\n', encoding="utf-8")
    plugin = Path("half_plugin")
    plugin.mkdir()
    for name in ("half.xml", "cube.xml"):
        Path(plugin, name).write_text(Path(name).read_text())
    for model, scenario in (("half.xml", "half.toml"), ("half_plugin/half.xml", "half.toml")):
        out = cmg_mj("check", model).out
        assert "hint" not in out
        assert f"run it      cmg-mj run {scenario}" in out
    Path("half.toml").write_text('[plant]\nmodel = "other.xml"\n', encoding="utf-8")
    assert "run it      cmg-mj run push_recovery --set plant.model=half.xml" in cmg_mj("check", "half.xml").out


def test_a_notch_is_in_the_rigid_loop() -> None:
    """The loop, sample after sample, obeys the polynomial of its poles."""
    plain, notched = loop(), loop("controller.notch_hz=8")

    model, K, notch = load_plant().reduced, np.array([35.0, 4.0, -1.0, 0.3]), Notch(8.0, 0.005, math.inf)
    A, B, _ = hold_matrices(model.A_e, model.B_e, 0.005)
    x, tilts = np.array([0.01, 0.0, 0.0, 0.0]), []
    memory = notch.init(0.0)
    for _ in range(40):
        tilts.append(float(x[0]))
        memory, u = notch.step(memory, float(-K @ x))
        x = A @ x + B[:, 0] * u
    for poles, is_whole in ((notched.loop.poles, True), (plain.loop.poles, False)):
        remainder = np.convolve(tilts, np.poly(np.exp(0.005 * poles)).real, "valid")
        assert (np.abs(remainder).max() < 1e-9) == is_whole
    assert notched.loop.distance < 0.7 < plain.loop.distance
    assert loop("controller.notch_hz=2").loop.words == "UNSTABLE"
    assert "or a notch above 8 Hz is needed" in (notched.hint or "")
    out = cmg_mj("check", "push_recovery", "--set=controller.notch_hz=8").out
    assert "              notch at 8 Hz on the command\n" in out


@pytest.mark.parametrize("mass", ["1.66", "166"])
def test_inertia_gravity_and_the_ceiling_are_the_whole_rigs(mass: str) -> None:
    """MuJoCo's mass matrix and centre of mass say the same. A frame of 166 kg a module is beyond any controller."""
    for path in folder("models").glob("*.xml"):
        Path(path.name).write_text(path.read_text().replace('mass="1.66"', f'mass="{mass}"'))
    model = mujoco.MjModel.from_xml_path("scissored_pair.xml")
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("equilibrium").id)
    mujoco.mj_forward(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    body, dof = int(model.joint("tilt").bodyid[0]), int(model.joint("tilt").dofadr[0])
    arm = np.linalg.norm(data.subtree_com[body] - data.xanchor[model.joint("tilt").id])
    gravity = float(model.body_subtreemass[body] * 9.81 * arm)
    start, tilted = "plant.model=scissored_pair.xml", "plant.initial_tilt_deg=0.1"
    for command in (["scissored_pair.xml"], ["push_recovery", "--set", start]):
        checked = cmg_mj("check", *command)
        assert f"inertia {inertia[dof, dof]:.4g} kg m^2, gravity {gravity:.4g} N m, momentum 0.6908" in checked.out
        (most,) = re.findall(
            r"any controller.* recovers from at most ([\d.]+) deg, or a push of 4\.\d+ N m", checked.out
        )
        assert (float(most) < 1.0) == (mass == "166")
        hint = f"hint        plant.initial_tilt_deg = 1: no controller recovers from more than {most} deg on this plant"
        assert (hint in checked.out) == (mass == "166")
    settings = [word for one in (start, tilted, "push.0.torque_n_m=10") for word in ("--set", one)]
    hints = cmg_mj("check", "push_recovery", *settings).out.partition("hint")[2]
    assert "initial_tilt" not in hints
    assert "push.0.torque_n_m = 10: no controller recovers from more than" in hints
