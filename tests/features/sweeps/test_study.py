"""A sweep's study: what is varied, its points and chunks, and what is refused before anything is computed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features import sweeps as swept
from cmg_mj.features.sweeps import chunks
from cmg_mj.features.sweeps import study as module
from cmg_mj.features.sweeps.study import CHUNK, check_values, locate_tracks, parse_axis, varied_tracks
from cmg_mj.scenario.loading import load_scenario
from tests.command import cmg_mj
from tests.features.sweeps.synthetic_trials import BIAS, NOISE, RATE, make_study

RATES = f"{RATE}+sensors.accelerometer.rate_hz"
INNER, OUTER = "plant.accelerometer_inner_m", "plant.accelerometer_outer_m"
SHORT = ("duration_s=0.1", "push=[]")
BROKEN = """
class Broken:
    def __init__(self, dt, model):
        raise ValueError("never")

    def init(self, y):
        pass

    def step(self, state, y, u):
        pass
"""


@pytest.mark.parametrize(
    ("variation", "values"),
    [
        ("0,0.5,1.0", (0, 0.5, 1.0)),
        ("-1.5:1.5:7", (-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5)),
        ("0:0.3:4", (0.0, 0.1, 0.2, 0.3)),
        ("log:1:100:3", (1.0, 10.0, 100.0)),
        ("1:-1:3", (1.0, 0.0, -1.0)),
        ("[0,0],[5,0]", ([0, 0], [5, 0])),
        ("RK4,implicit", ("RK4", "implicit")),
        ("true,false", (True, False)),
        ([1.0, np.int64(2)], (1.0, 2)),
    ],
)
def test_lists_and_ranges(variation: Any, values: tuple) -> None:
    assert parse_axis("a.b", variation, "--vary").values == values


def test_values_at_shares_of_a_range_and_of_a_list() -> None:
    axis = parse_axis("a.b", "log:100:800", "--vary")
    assert axis.at(np.array([0.0, 1.0])) == [100.0, 800.0]
    assert axis.at(np.array([0.5])) == pytest.approx([np.sqrt(80_000.0)])
    assert parse_axis("a.b", axis.as_field(), "file") == axis
    words = parse_axis("a.b", "RK4,implicit,Euler", "--vary")
    assert words.at(np.array([0.0, 0.33, 0.34, 0.66, 0.67, 1.0])) == ["RK4", "RK4", *["implicit"] * 2, *["Euler"] * 2]


@pytest.mark.parametrize(
    "variation",
    ["", "1,,2", "1:2:x", "1:2:3:4", "1:1:3", "2:1", "nan:1", "log:0:1:3", "0:1:1", "0:1:1000000", "1,1"],
)
def test_other_texts_are_refused(variation: str) -> None:
    with pytest.raises(InputError, match=r"--vary a\.b"):
        parse_axis("a.b", variation, f"--vary a.b={variation}")


def test_a_grid_is_every_combination_and_fields_may_go_together() -> None:
    sweep = make_study({RATES: "100,200", BIAS: "0,1,2"}, worlds=3)
    assert (sweep.n_points, sweep.trials) == (6, 36)
    assert sweep.point(4) == {RATE: 200, "sensors.accelerometer.rate_hz": 200, BIAS: 1}
    assert sweep.as_fields({})["vary"] == {RATES: [100, 200], BIAS: [0, 1, 2]}
    check_values(sweep)
    with pytest.raises(InputError, match=r"sensors\.accelerometer\.rate_hzz: no such field"):
        check_values(make_study({f"{RATES}z": "100,200"}))


def test_every_trial_is_in_one_chunk() -> None:
    sweep = make_study({BIAS: "0:1:800"}, worlds=5)
    every = [sweep.chunk(number) for number in range(sweep.n_chunks)]
    assert [len(trials) for _, trials in every] == [sweep.chunk_size(number) for number in range(sweep.n_chunks)]
    assert max(len(trials) for _, trials in every) == CHUNK
    trials = [(observer, *trial) for observer, trials in every for trial in trials]
    assert len(set(trials)) == len(trials) == sweep.trials == 8000


def test_trials_that_run_in_one_batch_stand_together() -> None:
    sweep = make_study({BIAS: "0,1", RATE: "100,200"})
    rates: list[Any] = [sweep.point(point)[RATE] for point, _ in sweep.chunk(0)[1]]
    assert rates == sorted(rates)


def test_a_design_takes_each_value_of_a_list_equally_often() -> None:
    sweep = make_study({BIAS: "-1:1", RATE: "50,100,200,400", NOISE: "log:100:800:4"}, sample=64)
    points = [sweep.point(number) for number in range(64)]
    rates = [point[RATE] for point in points]
    assert {rate: rates.count(rate) for rate in set(rates)} == dict.fromkeys([50, 100, 200, 400], 16)
    assert len({(point[RATE], point[NOISE]) for point in points}) == 16  # every combination is there
    assert len({point[BIAS] for point in points}) == 64


@pytest.mark.parametrize("design", [{"sample": 2**24}, {}])
def test_the_points_of_a_very_large_study_are_not_drawn(
    design: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    counts: list[int] = []
    sample = module.sampled
    monkeypatch.setattr(module, "sampled", lambda d, n, seed: counts.append(n) or sample(d, n, seed))
    monkeypatch.setattr(chunks, "compute", lambda study, _, trials, __: [study.point(number) for number, _ in trials])
    study = make_study(dict.fromkeys((BIAS, "plant.initial_tilt_deg"), "-1:1" if design else "-1:1:10000"), **design)
    cost = chunks.estimate_cost(study)
    assert counts == [chunks.POINTS]
    assert cost["points"] == study.n_points == (2**24 if design else 100_000_000)
    assert cost["chunks"] == 2 * -(-2 * study.n_points // CHUNK)


# --- refused before anything is computed


@pytest.fixture
def nothing_is_computed(monkeypatch: pytest.MonkeyPatch, elsewhere: None) -> None:
    for name in ("cmg_mj.features.sweeps.chunks", "cmg_mj.features.sweeps"):
        monkeypatch.setattr(f"{name}.compute", lambda *_, **__: pytest.fail("computed"))


@pytest.mark.usefixtures("nothing_is_computed")
@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ([], "--vary"),
        (["plant.equilibrium_bias=0,1"], "plant.equilibrium_bias: no such field; did you mean"),
        ([f"{BIAS}=0,90"], f"{BIAS} = 90"),
        ([f"{BIAS}=0:1"], f"--vary {BIAS}"),
        ([f"{BIAS}+{BIAS}=0,1"], f"--vary {BIAS}: given twice"),
        (["seed=1,2"], "--vary seed"),
        ([f"{BIAS}+compare.worlds=1,2"], "--vary compare.worlds"),
        (["observer.k1=10,20", "--observers", "homogeneous,linear"], "observer.k1: no such field of linear"),
        (["observer.k1=10,20", "--observers", "zero,homogeneous"], "--vary observer.k1"),
        ([f"{BIAS}=0,1", "--observers", "linear,ltv,linear"], "observers: 'linear'"),
        ([f"{BIAS}=0,1", "--observers", "linear,broken:Broken"], "observer broken:Broken: ValueError: never"),
        ([f"{INNER}=0.05,0.5"], f"--vary {INNER}=0.5"),
        (["plant.model=nope.xml"], "plant.model = 'nope.xml'"),
        ([f"{BIAS}=0,1", "--cluster", "nonsense"], "--cluster nonsense"),
        ([f"{BIAS}=0,1", "--cluster", "local:0"], "--cluster local:0"),
        ([f"{BIAS}=0:1:11", "--vary", f"{NOISE}=100:400:10", "--worlds", "10000"], "1100000 trials"),
    ],
)
def test_refused_on_the_command_line(arguments: list[str], field: str) -> None:
    Path("broken.py").write_text(BROKEN)
    vary = ["--vary"] if arguments else []
    assert field in cmg_mj("sweep", "push_recovery", *vary, *arguments, "--out", "out").complaint
    assert not Path("out").exists()


@pytest.mark.usefixtures("nothing_is_computed")
@pytest.mark.parametrize(
    ("sweep", "field"),
    [
        ('design = "sample"\nn = -4', "n = -4"),
        ('design = "nope"', "s.toml: sweep.design = 'nope'"),
        ("observers = [1]", "s.toml: sweep.observers"),
        ("observers = ['nope']", "observers: 'nope'"),
        ("order = [1, 2]", "s.toml: sweep.order: no such field"),
    ],
)
def test_refused_in_a_study_file(sweep: str, field: str) -> None:
    Path("s.toml").write_text(f'scenario = "push_recovery"\n[sweep]\n{sweep}\n[vary]\n"{BIAS}" = [0, 1]\n')
    assert field in cmg_mj("sweep", "s.toml", "--out", "out").complaint
    assert not Path("out").exists()


@pytest.mark.usefixtures("nothing_is_computed")
@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"worlds": 1.5}, "worlds = 1.5"),
        ({"sample": 2.0}, "--sample, n = 2.0"),
        ({"observers": "linear"}, "observers = 'linear'"),
        ({"observers": ["zeroo"]}, "did you mean 'zero'"),
        ({"vary": {BIAS: None}}, "must be a list of values, or text"),
    ],
)
def test_refused_from_python(options: dict[str, Any], field: str) -> None:
    arguments: dict[str, Any] = {"vary": {BIAS: [0, 1]}} | options
    with pytest.raises(InputError, match=field):
        swept.sweep("push_recovery", **arguments)


def test_values_from_python() -> None:
    """One alone, and numpy's: a column of numbers."""
    worlds: Any = np.int64(1)
    vary = {BIAS: 0.5, NOISE: np.array([200.0, 400.0]), RATE: [np.int64(100)]}
    result = swept.sweep(load_scenario("push_recovery", SHORT), vary, ["linear"], worlds=worlds)
    columns = ["point", *vary]
    assert [str(result.trials.schema.field(name).type) for name in columns] == ["int64", "double", "double", "int64"]
    assert result.trials.select(columns).to_pylist()[1] == {"point": 1, BIAS: 0.5, NOISE: 400.0, RATE: 100}


def test_values_that_fit_only_with_another_are_allowed() -> None:
    result = swept.sweep(load_scenario("push_recovery", SHORT), {INNER: [0.05, 0.5], OUTER: [0.2, 0.6]}, worlds=1)
    assert result.trials["outcome"].to_pylist() == ["done", "done", "refused", "done"]


def test_a_baselines_loop_does_not_depend_on_an_observer() -> None:
    settings = ("controller.angle_source=estimated", "controller.bias_trim_s=0.5")
    study = make_study({BIAS: "0,1"}, ("zero", "kalman"), 1, settings)
    controller = study.scenario_with("zero").controller
    assert (controller.feedback, controller.angle_source, controller.bias_trim_s) == ("truth", "measured", 0.0)
    with pytest.raises(InputError, match=r"zero: .* controller\.kind = 'lqg'"):
        make_study({BIAS: "0,1"}, ("zero", "kalman"), 1, ("controller.kind=lqg",)).scenario_with("zero")


# --- tracks of the pivot

MOTION = {"kind": "track", "file": "walk.csv"}
STUDY = """
[scenario]
duration_s = 0.1
push = []
[[scenario.pivot]]
kind = "track"
file = "walk.csv"
[vary]
"pivot.0.file" = ["walk.csv", "ride.csv"]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "there").mkdir()
    for name in ("walk", "ride"):
        (tmp_path / "there" / f"{name}.csv").write_text("t,a\n0,0.1\n1,0.2\n", encoding="utf-8")
    return tmp_path / "there"


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("pivot.0.file", ["walk.csv", "nowhere.csv"]),
        ("pivot", [[MOTION], [MOTION, {"kind": "step"}], []]),
        ("pivot.1", [MOTION, {"kind": "step"}]),
        ("pivot.0.column+pivot.0.file", ["walk.csv"]),
    ],
    ids=["file", "all motions", "a motion", "together"],
)
def test_varied_tracks_get_whole_paths(field: str, values: list[Any], folder: Path) -> None:
    whole = locate_tracks(parse_axis(field, values, "vary"), folder)
    walk = str(folder / "walk.csv")
    assert str(list(whole.values)) == str(values).replace("walk.csv", walk)
    assert set(varied_tracks(whole)) - {"nowhere.csv"} == {walk}


def test_other_fields_keep_their_values(folder: Path) -> None:
    for axis in (parse_axis("pivot.0.kind", "walk.csv,sine", "vary"), parse_axis("pivot.0.scale", "1:2", "vary")):
        assert locate_tracks(axis, folder) == axis
        assert varied_tracks(axis) == []


@pytest.mark.slow
def test_a_study_file_names_tracks_from_where_it_lies(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that it varies, too; `--vary` likewise."""
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    monkeypatch.chdir(folder.parent)
    for more in ([], ["--vary", "pivot.0.file=ride.csv,walk.csv"]):
        outcome = cmg_mj("sweep", "there/study.toml", *more, "--dry-run")
        assert outcome.status == 0, outcome
