"""`cmg-mj tune`: against planted parameters, closed forms and brute force; and what it says to wrong input."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter
from scipy import stats

from cmg_mj.cli import studies
from cmg_mj.errors import InputError
from cmg_mj.experiment import prepare
from cmg_mj.intervals import Interval, mean_interval, paired_verdict, ratio_interval
from cmg_mj.observers import Estimate, make_observer
from cmg_mj.reduced import ReducedModel
from cmg_mj.replay import replay
from cmg_mj.scenario import load_scenario
from cmg_mj.schema import Scenario
from cmg_mj.trajectory import Trajectory
from cmg_mj.tuning import Recorded, best_noise, record, tune, tuning_table
from cmg_mj.tuning.parameters import Number, numbers_of, parameters_of, replaced
from cmg_mj.tuning.recorded import tuning_scenario, window_of
from cmg_mj.tuning.search import crossing, search
from tests.command import cmg_mj
from tests.observers.reference import DT, PAPER

# --- intervals ------------------------------------------------------------------------------------------------


def test_mean_interval_is_scipys() -> None:
    values = np.random.default_rng(0).normal(2.0, 0.5, 13)
    expected = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert mean_interval(values) == pytest.approx((values.mean(), expected.low, expected.high), rel=1e-12)


def test_mean_interval_covers_the_mean_in_95_percent_of_samples() -> None:
    rng = np.random.default_rng(1)
    hits = [low <= 3.0 <= high for _, low, high in (mean_interval(rng.normal(3.0, 2.0, 6)) for _ in range(2000))]
    assert stats.binomtest(sum(hits), len(hits), 0.95).pvalue > 1e-3


def test_ratio_interval_of_an_exact_ratio() -> None:
    values = np.array([1.0, 2.0, 5.0])
    assert ratio_interval(3.0 * values, values) == pytest.approx((3.0, 3.0, 3.0))


@pytest.mark.parametrize(
    ("low", "high", "verdict"), [(0.1, 0.3, "better"), (-0.1, 0.3, "tie"), (0.0, 0.2, "tie"), (-0.3, -0.1, "worse")]
)
def test_verdict_of_a_paired_difference(low: float, high: float, verdict: str) -> None:
    assert paired_verdict(Interval((low + high) / 2.0, low, high)) == verdict


def test_one_world_makes_no_interval() -> None:
    with pytest.raises(InputError, match="two worlds or more"):
        mean_interval([1.0])


# --- which numbers can be tuned -------------------------------------------------------------------------------


def numbers(kind: str, *chosen: str) -> list[Number]:
    def make(**parameters: Any) -> Any:
        return make_observer(kind, DT, PAPER, **parameters)

    return numbers_of(kind, parameters_of(kind, make(), {}), make, chosen)


def test_every_number_is_found_also_in_tuples() -> None:
    assert [n.name for n in numbers("linear")] == ["tau"]
    assert [n.name for n in numbers("ltv")] == ["Q[0]", "Q[1]", "Q[2]", "H0[0]", "H0[1]", "H0[2]"]
    assert [n.name for n in numbers("luenberger")] == ["L[0][0]", "L[1][0]", "L[2][1]"]  # zeros stay zero
    assert [n.name for n in numbers("ltv", "Q[1]", "H0")] == ["Q[1]", "H0[0]", "H0[1]", "H0[2]"]


def test_limits_are_where_the_observer_refuses() -> None:
    (alpha,) = numbers("homogeneous", "alpha")
    assert alpha.low == pytest.approx(0.5, abs=1e-9)
    assert alpha.low > 0.5  # open there
    assert alpha.high == pytest.approx(1.0, abs=1e-12)
    (tau,) = numbers("linear")
    assert (tau.low, tau.high) == pytest.approx((0.02 / 1000.0, 0.02 * 1000.0))


@pytest.mark.parametrize("kind", ["linear", "ltv", "homogeneous", "luenberger", "super_twisting", "linear_high_gain"])
def test_the_observer_takes_each_number_at_its_limits(kind: str) -> None:
    given = parameters_of(kind, make_observer(kind, DT, PAPER), {})
    for number in numbers(kind):
        for size in (number.low, number.high):
            make_observer(kind, DT, PAPER, **replaced(given, [number], [size]))


def test_a_sign_stays() -> None:
    number = Number("L", (0, 1), -3.0, 0.1, 10.0)
    assert replaced({"L": ((1.0, -3.0), (0.0, 2.0))}, [number], [5.0]) == {"L": ((1.0, -5.0), (0.0, 2.0))}


@dataclass(frozen=True)
class Own:
    """A user's observer: a plain dataclass, integers among its numbers, a limit that only its constructor knows."""

    dt: float
    model: ReducedModel
    gain: float = 2
    order: int = 3
    on: bool = True
    name: str = "own"

    def __post_init__(self) -> None:
        if self.gain > 10.0:
            raise ValueError("gain: at most 10")

    def init(self, y: Any) -> Any:
        return y.y1

    def step(self, state: Any, y: Any, u: Any) -> tuple[Any, Estimate]:
        rate = self.gain * (y[0] - state) / self.dt
        if self.gain < 0.05:
            raise RuntimeError("lost")
        if self.gain > 5.0:
            rate = rate * math.nan
        return y[0], Estimate(y[0], rate, y[1])


OWN = f"{__name__}:Own"


def test_a_users_own_observer_is_read_as_well() -> None:
    (gain,) = numbers(OWN)
    assert gain.name == "gain"
    assert gain.given == 2.0
    assert gain.high == pytest.approx(10.0)


# --- the search -----------------------------------------------------------------------------------------------


def number(name: str, given: float, low: float = 1e-3, high: float = 1e3) -> Number:
    return Number(name, (), given, low, high)


@pytest.mark.parametrize("best", [0.0021, 0.3, 4.0, 700.0])
def test_one_number_is_found_wherever_it_is(best: float) -> None:
    sizes, loss = search(lambda s: 1.0 + math.log(s[0] / best) ** 2, [number("a", 1.0)])
    assert sizes == pytest.approx([best], rel=5e-3)
    assert loss == pytest.approx(1.0, abs=1e-4)


def test_the_given_size_on_a_point_of_the_grid_does_not_narrow_the_search() -> None:
    """The minimum lies beyond the neighbour at which a rounded twin of the given size once ended the search."""
    sizes, _ = search(lambda s: 1.0 + math.log(s[0] / 0.0266) ** 2, [number("tau", 0.02, 0.02 / 1000.0, 20.0)])
    assert sizes == pytest.approx([0.0266], rel=5e-3)


def test_the_deeper_of_two_valleys_is_taken() -> None:
    def loss(s: Any) -> float:
        x = math.log(s[0])
        return 2.0 - math.exp(-((x + 4.0) ** 2)) - 1.5 * math.exp(-((x - 4.0) ** 2))

    sizes, _ = search(loss, [number("a", math.exp(-4.0))])
    assert math.log(sizes[0]) == pytest.approx(4.0, abs=0.02)


def test_several_numbers_in_a_bent_valley() -> None:
    def loss(s: Any) -> float:
        a, b, c = np.log(s)
        return 1.0 + (a - 0.5) ** 2 + 10.0 * (b - a**2) ** 2 + (c + a) ** 2

    sizes, _ = search(loss, [number(name, 1.0) for name in "abc"], starts=1)
    np.testing.assert_allclose(np.log(sizes), [0.5, 0.25, -0.5], atol=0.02)


def test_a_minimum_on_a_limit_and_a_region_without_loss() -> None:
    def loss(s: Any) -> float:
        a, b = np.log(s)
        return math.inf if b > 1.0 else 2.0 - 0.1 * a + (b - 0.8) ** 2

    sizes, _ = search(loss, [number("a", 1.0, 0.1, 2.0), number("b", 1.0)])
    assert sizes[0] == pytest.approx(2.0, rel=1e-3)
    assert math.log(sizes[1]) == pytest.approx(0.8, abs=0.02)


def test_where_nothing_works_the_loss_is_infinite() -> None:
    assert search(lambda s: math.inf, [number("a", 1.0)])[1] == math.inf


def test_crossing() -> None:
    assert crossing([1.0, 2.0, 4.0], [-3.0, -1.0, 1.0]) == pytest.approx(3.0)
    assert crossing([1.0, 2.0], [0.0, 1.0]) == 1.0
    assert crossing([1.0, 2.0], [1.0, 2.0]) is None


# --- planted parameters: the gyro shows what an observer with known parameters would say ----------------------


def planted(kind: str, parameters: Mapping[str, Any], seed: int, gyro_noise: float, worlds: int = 4) -> Recorded:
    """A recording whose gyro is an observer's estimate: the loss of those parameters is zero."""
    rng = np.random.default_rng(seed)
    t = np.arange(150) * DT
    phases = rng.uniform(0.0, 6.0, (2, worlds))
    y1 = 0.05 * np.sin(9.0 * t[:, None] + phases[0]) + 0.02 * np.sin(31.0 * t[:, None] + phases[1])
    y1 = y1 + rng.normal(0.0, 2e-3, y1.shape)
    u = 2.0 * np.sin(5.0 * t)[:, None] + rng.normal(0.0, 0.5, y1.shape)
    columns = {"time_s": t, "y1_rad": y1, "y2_rad": DT * np.cumsum(u, axis=0), "u_rad_s": u}
    columns["fog_rad_s"] = columns["x2_rad_s"] = np.zeros_like(y1)
    model = prepare(load_scenario("observer_tuning")).plant.reduced
    rate = replay(make_observer(kind, DT, model, **parameters), Trajectory(columns)).x2
    gyro = rate + rng.normal(0.0, gyro_noise, rate.shape) if gyro_noise else rate
    return Recorded(Trajectory({**columns, "fog_rad_s": gyro, "x2_rad_s": rate}), (0.15, 0.75))


def recorder(
    kind: str, truth: Callable[[float, bool], Mapping[str, Any]], gyro_noise: float = 0.0
) -> Callable[..., Recorded]:
    """Recordings with parameters that depend on the noise and on whether the worlds are held out."""

    def recorded(scenario: Scenario, worlds: range, *, noise_ug_rthz: float, warm_up_s: float) -> Recorded:
        return planted(kind, truth(noise_ug_rthz, worlds.start > 0), worlds.start, gyro_noise)

    return recorded


@pytest.mark.parametrize(
    ("kind", "chosen", "truth"),
    [
        ("linear", [], {"tau": 0.0337123}),
        ("homogeneous", ["k1", "k2", "alpha"], {"k1": 33.0123, "k2": 410.123, "alpha": 0.77123}),
        ("ltv", ["Q[1]"], {"Q": (1.0, 2.34567e5, 1.0)}),
        ("luenberger", ["L[0][0]", "L[1][0]"], {"L": ((31.0123, 0.0), (320.123, 0.0), (0.0, 20.0))}),
    ],
)
def test_planted_parameters_are_found(kind: str, chosen: list[str], truth: dict) -> None:
    scenario = load_scenario("observer_tuning", observer=kind)
    study = tune(scenario, worlds=4, parameters=chosen, recorded=recorder(kind, lambda *_: truth), starts=1)
    (level,) = study.levels
    for name, value in truth.items():
        np.testing.assert_allclose(level.parameters[name], value, rtol=0.02)
    assert level.rms.max() < 0.02 * level.given_rms.min()
    assert level.verdict == "better"
    assert level.ratio.low > 20.0


def test_the_verdict_is_of_the_worlds_that_were_not_fitted() -> None:
    """Fitted worlds want 0.05, the others Table 2's: the fit is perfect and the verdict is worse."""
    truth = recorder("linear", lambda _, held_out: {"tau": 0.02 if held_out else 0.05}, gyro_noise=1e-4)
    study = tune(load_scenario("observer_tuning", observer="linear"), worlds=4, recorded=truth)
    (level,) = study.levels
    assert level.sizes["tau"] == pytest.approx(0.05, rel=0.01)
    assert level.fit_rms < 0.01 * level.fit_given_rms
    assert level.verdict == "worse"
    assert level.ratio.high < 1.0


def test_where_the_given_parameters_are_the_best_the_verdict_is_a_tie() -> None:
    recorded = recorder("linear", lambda *_: {"tau": 0.02})
    study = tune(load_scenario("observer_tuning", observer="linear"), worlds=4, recorded=recorded)
    assert study.levels[0].sizes == {"tau": 0.02}
    assert study.levels[0].verdict == "tie"


def test_the_verdict_is_that_of_the_ratio_in_the_table() -> None:
    """Differences of 1 in large errors, ratios either side of 1: the difference alone would say better."""
    tuned = np.array([0.100, 0.101, 0.102, 10.0])
    recorded = recorder("linear", lambda *_: {"tau": 0.02})
    level = tune(load_scenario("observer_tuning", observer="linear"), worlds=4, recorded=recorded).levels[0]
    for factor, verdict in (([1.2, 1.3, 1.25, 1.22], "better"), ([0.9, 1.1, 1.0, 1.3], "tie"), ([0.8] * 4, "worse")):
        changed = dataclasses.replace(level, rms=tuned, given_rms=tuned * factor)
        assert changed.verdict == verdict
        assert (changed.ratio.low > 1.0) == (verdict == "better")
        assert (changed.ratio.high < 1.0) == (verdict == "worse")


@pytest.mark.parametrize(
    ("zeros", "said"), [((0.104, 0.10402), "0.1040 rad/s"), ((0.1, 0.2), "0.1000 to 0.2000 rad/s")]
)
def test_an_estimate_of_zero_is_one_number_where_it_is_the_same(zeros: tuple[float, float], said: str) -> None:
    recorded = recorder("linear", lambda *_: {"tau": 0.03})
    study = tune(load_scenario("observer_tuning", observer="linear"), worlds=2, recorded=recorded)
    levels = [dataclasses.replace(study.levels[0], zero_rms=zero) for zero in zeros]
    caption = str(tuning_table(dataclasses.replace(study, levels=levels)).caption)
    assert f"An estimate of zero: {said}." in caption


def test_numbers_that_do_not_matter_are_left_alone() -> None:
    recorded = recorder("ltv", lambda *_: {"Q": (1.0, 2.3e5, 1.0)})
    scenario = load_scenario("observer_tuning", observer="ltv")
    study = tune(scenario, worlds=4, recorded=recorded, parameters=["Q[1]", "Q[2]"])
    assert study.idle == ["Q[2]"]  # the third state decouples
    assert [n.name for n in study.numbers] == ["Q[1]"]
    assert study.levels[0].parameters["Q"][2] == 1.0


def test_the_noise_at_which_the_given_parameters_are_best() -> None:
    """Planted: the best tau is 0.02 sqrt(noise/300), a straight line on logarithms, so 0.02 is best at 300."""
    recorded = recorder("linear", lambda noise, _: {"tau": 0.02 * math.sqrt(noise / 300.0)})
    scenario = load_scenario("observer_tuning", observer="linear")
    study = tune(scenario, worlds=4, recorded=recorded, noise_ug_rthz=[800.0, 100.0, 400.0])
    assert [level.noise_ug_rthz for level in study.levels] == [100.0, 400.0, 800.0]
    best = best_noise(study)
    assert best.where == "found"
    assert best.noise_ug_rthz == pytest.approx(300.0, rel=0.02)
    for noises, side in (([400.0, 800.0], "below"), ([100.0, 200.0], "above")):
        beyond = tune(scenario, worlds=4, recorded=recorded, noise_ug_rthz=noises)
        assert best_noise(beyond) == (side, None)
        assert f"best at a noise {side} these, if at any" in str(tuning_table(beyond).caption)
    assert best_noise(dataclasses.replace(study, levels=study.levels[:1])) == ("not bracketed", None)


def test_of_several_numbers_the_level_with_the_least_loss_counts() -> None:
    """Planted: the given epsilon is nearly the best at 200; the gyro's own noise keeps every loss from zero."""
    truths = {100.0: 0.02, 200.0: 0.029, 400.0: 0.04}
    recorded = recorder("linear_high_gain", lambda noise, _: {"epsilon": truths[noise], "a1": 1.5}, gyro_noise=0.05)
    scenario = load_scenario("observer_tuning", observer="linear_high_gain")
    options: dict[str, Any] = {"worlds": 4, "recorded": recorded, "parameters": ["epsilon", "a1"], "starts": 1}
    study = tune(scenario, noise_ug_rthz=list(truths), **options)
    assert best_noise(study) == ("found", 200.0)
    assert "the given parameters lose least at 200 ug/rtHz." in str(tuning_table(study).caption)
    thousands = [dataclasses.replace(level, noise_ug_rthz=16.0 * level.noise_ug_rthz) for level in study.levels]
    caption = str(tuning_table(dataclasses.replace(study, levels=thousands)).caption)
    assert "lose least at 3200 ug/rtHz." in caption  # not 3.2e+03
    # Two noises have nothing between them: 200 may be the best, and what is below it was not tried.
    assert best_noise(tune(scenario, noise_ug_rthz=[200.0, 400.0], **options)) == ("below", None)


def test_parameters_at_which_an_observer_fails_are_no_candidates() -> None:
    """`Own` raises below 0.05, is not a number above 5, and is refused above 10."""
    recorded = recorder("finite_difference", lambda *_: {})  # which is `Own` with a gain of 1
    study = tune(load_scenario("observer_tuning", observer=OWN), worlds=4, recorded=recorded)
    assert study.levels[0].sizes["gain"] == pytest.approx(1.0, rel=0.01)


def test_given_parameters_that_lose_the_observer_are_worse_than_any() -> None:
    recorded = recorder("finite_difference", lambda *_: {})
    study = tune(load_scenario("observer_tuning", ["observer.gain=7.0"], OWN), worlds=4, recorded=recorded)
    assert study.levels[0].verdict == "better"
    assert study.levels[0].sizes["gain"] == pytest.approx(1.0, rel=0.01)


# --- the recording --------------------------------------------------------------------------------------------


def test_the_window_is_from_the_push_to_a_second_after_it() -> None:
    assert window_of(load_scenario("observer_tuning")) == pytest.approx((2.0, 3.1))
    assert window_of(load_scenario("observer_tuning", ["duration_s=2.5"])) == pytest.approx((2.0, 2.5))
    assert window_of(load_scenario("observer_tuning", ["push=[]"])) == (0.0, 10.0)


def test_no_observer_takes_part_in_the_loop_of_the_recording() -> None:
    """Whatever the scenario closes its loop on, the motion recorded is the gyro's loop's."""
    gyro = record(load_scenario("observer_tuning", ["seed=5"]), range(3))
    settings = ["seed=5", "duration_s=10", 'controller.angles="estimated"']
    other = record(load_scenario("push_recovery", settings, "luenberger"), range(3))
    for name in ("y1_rad", "y2_rad", "u_rad_s", "fog_rad_s"):
        np.testing.assert_array_equal(gyro.trajectory[name], other.trajectory[name])
    assert tuning_scenario(load_scenario("push_recovery")).controller.feedback == "fog"


def test_scores_are_those_of_the_scenario_itself() -> None:
    """The companions of an ordinary run, summed up by hand, have the errors that the tuning minimises."""
    scenario = load_scenario("observer_tuning", ["seed=5", 'companions=["ltv"]', "duration_s=3.2"], "linear")
    run = prepare(scenario).run_many(3).trajectory
    assert run is not None
    inside = (run["time_s"] > 1.9999) & (run["time_s"] < 3.0999)
    recorded = record(scenario, range(3))
    model = prepare(scenario).plant.reduced
    for name in ("linear", "ltv"):
        off = (run[f"estimate/{name}/x2_rad_s"] - run["fog_rad_s"])[inside]
        np.testing.assert_allclose(recorded.errors(make_observer(name, DT, model)), np.sqrt((off**2).mean(axis=0)))


def test_half_a_second_of_warm_up_is_enough_for_the_papers_observers() -> None:
    scenario = load_scenario("observer_tuning", ["seed=6"])
    whole, short = (record(scenario, range(4), warm_up_s=span) for span in (2.0, 0.5))
    model = prepare(scenario).plant.reduced
    for name in ("linear", "ltv", "homogeneous"):
        of = make_observer(name, DT, model)
        np.testing.assert_allclose(short.errors(of), whole.errors(of), rtol=1e-3)


def test_worlds_that_fell_are_left_out_and_too_many_are_refused() -> None:
    falling = load_scenario("observer_tuning", ["plant.equilibrium_bias_deg=20.0"])
    with pytest.raises(InputError, match="3 of 3 worlds fell"):
        record(falling, range(3))


def test_noise_is_that_of_the_level() -> None:
    quiet, loud = (record(load_scenario("observer_tuning"), range(2), noise_ug_rthz=n) for n in (100.0, 800.0))
    spread = [np.diff(r.trajectory["y1_rad"][:300], axis=0).std() for r in (quiet, loud)]
    assert 4.0 < spread[1] / spread[0] < 9.0


# --- the command ----------------------------------------------------------------------------------------------


@pytest.fixture
def quick(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A short scenario with a push, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    Path("quick.toml").write_text("title = 'Quick'\nduration_s = 0.6\n[[push]]\nstart_s = 0.2")
    return "quick.toml"


def test_command_prints_a_table_and_writes_what_reruns(quick: str) -> None:
    said = cmg_mj("tune", quick, "--observer", "linear", "--worlds", 3, "--out", "tuned")
    assert said.status == 0
    assert "Quick: linear, seed 0" in said.out
    assert "given 0.02" in said.out
    assert said.err == "Written to tuned. Run with the tuned observer: cmg-mj run tuned/scenario.toml\n"
    figures = json.loads(Path("tuned/tuned.json").read_text())
    (level,) = figures["levels"]
    tuned = load_scenario("tuned/scenario.toml")
    assert tuned.observer.kind == "linear"
    assert tuned.observer.parameters == level["parameters"]
    assert cmg_mj("run", "tuned/scenario.toml", "--json").status == 0


def test_json_has_every_figure(quick: str) -> None:
    said = cmg_mj("tune", quick, "--observer", "linear", "--worlds", 3, "--noise", "200,400", "--json")
    figures = json.loads(said.out)
    assert figures["tuned"] == ["tau"]
    assert figures["worlds_fitted"] == 3
    assert figures["window_s"] == pytest.approx([0.2, 0.6])
    assert [level["noise_density_ug_rthz"] for level in figures["levels"]] == [200.0, 400.0]
    assert "given_best_at_noise_density_ug_rthz" in figures
    for level in figures["levels"]:
        mean, low, high = level["held_out_ratio"]
        assert low <= mean <= high
        ratio = level["held_out_given_rms_error_rad_s"] / level["held_out_rms_error_rad_s"]
        assert mean == pytest.approx(ratio, rel=0.05)
        assert level["verdict"] == ("better" if low > 1.0 else "worse" if high < 1.0 else "tie")
    assert figures["given_best_noise_is"] in ("found", "below", "above", "not bracketed")
    assert json.loads(Path("runs/tune-linear-0/tuned.json").read_text()) == figures


def test_several_noises_make_a_scenario_each(quick: str) -> None:
    said = cmg_mj("tune", quick, "--observer", "linear", "--worlds", 2, "--noise", "200,400", "--out", "t", "--json")
    assert said.err == ""
    for noise in (200.0, 400.0):
        scenario = load_scenario(f"t/scenario-{noise:g}.toml")
        assert scenario.sensors.accelerometer.noise_density_ug_rthz == noise


def test_an_interruption_keeps_the_noises_that_are_done(quick: str) -> None:
    def until_the_second(share: float) -> None:
        if share > 0.6:
            raise KeyboardInterrupt

    scenario = load_scenario(quick, ["observer.kind=linear"])
    study = tune(scenario, worlds=2, noise_ug_rthz=[200.0, 400.0], on_share=until_the_second)
    assert [level.noise_ug_rthz for level in study.levels] == [200.0]

    def at_once(share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tune(scenario, worlds=2, noise_ug_rthz=[200.0, 400.0], on_share=at_once)


def test_without_a_push_it_says_what_the_window_is(quick: str) -> None:
    said = cmg_mj("tune", quick, "--observer", "linear", "--worlds", 2, "--set", "push=[]")
    assert "There is no push: the window is the whole run" in said.out


def test_a_users_own_observer_by_its_path(quick: str) -> None:
    said = cmg_mj("tune", quick, "--observer", OWN, "--worlds", 2, "--json")
    assert json.loads(said.out)["tuned"] == ["gain"]


def test_help_names_the_experiment() -> None:
    assert "observer_tuning" in (studies.tune.help or "")


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--observer", "liner"], "--observer 'liner': no such observer; did you mean 'linear'?"),
        (["--observer", "linear", "--parameters", "tua"], "--parameters tua: linear has no such number to tune; did"),
        (["--observer", "finite_difference"], "observer finite_difference has no number to tune"),
        (
            ["--observer", "ltv", "--parameters", "H0[2],Q[2]", "--worlds", "2"],
            "the rate that ltv estimates does not depend on",
        ),
        (["--observer", "linear", "--noise", "100,loud"], "--noise 'loud': must be numbers not below 0"),
        (["--observer", "linear", "--noise", ","], "--noise ',': give numbers with commas between"),
        (["--observer", "linear", "--noise=-1"], "--noise '-1': must be numbers not below 0"),
        (["--observer", "linear", "--range", "tau"], "--range 'tau': write NAME=LOW:HIGH"),
        (["--observer", "linear", "--range", "tau=3:1"], "--range tau=3:1: must be two positive numbers"),
        (["--observer", "linear", "--range", "L=1:3"], "--range L: not tuned; tuned: tau"),
        (["--observer", "linear", "--out", ""], "--out '': name a folder"),
        (["--observer", "linear", "--worlds", "1"], "Invalid value for '--worlds'"),
        (
            ["--observer", "linear", "--set", "observer.tau=-1"],
            "quick.toml with --observer linear --set observer.tau=-1",
        ),
    ],
)
def test_wrong_input_is_one_line(quick: str, arguments: list[str], line: str) -> None:
    assert cmg_mj("tune", quick, *arguments).complaint.startswith(line)


def test_figures_are_plain_json(quick: str) -> None:
    """Nothing that JSON does not know, such as NaN."""
    said = cmg_mj("tune", quick, "--observer", "homogeneous", "--parameters", "k1", "--worlds", 2, "--json")
    assert TypeAdapter(dict).validate_json(said.out)
    assert "NaN" not in said.out
    assert "Infinity" not in said.out
