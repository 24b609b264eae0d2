"""The recording, read back without a viewer."""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import rerun as rr
from cmg_mj.visualization.recording.summary import ROW_TABLES
from rerun.chunk import RrdReader

from cmg_mj.errors import InputError
from cmg_mj.results import trajectory
from cmg_mj.results.baselines import REFERENCES
from cmg_mj.results.result import Outcome
from cmg_mj.results.summary_keys import KEYS, format_figure, heading
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.scenario.disturbances import Push
from cmg_mj.scenario.loading import Scenario, load_scenario
from cmg_mj.scenario.schema import MetricsSettings
from cmg_mj.simulation.experiment import Experiment, prepare
from cmg_mj.visualization.recording import RecordingHeader, Run, save, stream, write_recording
from cmg_mj.visualization.recording.run import POSE_RATE_HZ, phases, torque_steps
from cmg_mj.visualization.recording.scene import FLYWHEEL_SLOWDOWN
from cmg_mj.visualization.recording.shapes import drawn_shapes
from cmg_mj.visualization.recording.signals import instant, time_column

SHORT = ("duration_s=0.5", "push.0.start_s=0.2", "push.0.duration_s=0.1", 'open_loop_observers=["linear"]')
NANOSECONDS = 1e9
RERUN = "import sys; from rerun_cli.__main__ import main; sys.exit(main())"


def scenario(*overrides: str) -> Scenario:
    return load_scenario("push_recovery", [*SHORT, *overrides])


def record(experiment: Experiment, name: str | None = None) -> Run:
    result = experiment.run()
    assert result.trajectory is not None
    name = name or experiment.scenario.observer.kind
    return Run(name, result.trajectory, result.summaries[0], result.outcomes[0])


def write(path: Path, experiment: Experiment, runs: list[Run]) -> Path:
    header = RecordingHeader(
        experiment.plant,
        title="A title",
        pushes=experiment.scenario.push,
        settings=experiment.scenario.metrics,
        rate_limit_rad_s=experiment.law.rate_limit,
        scenario_toml='kind = "made up"',
    )
    write_recording(path, header, runs)
    return path


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return prepare(scenario())


@pytest.fixture(scope="module")
def run(experiment: Experiment) -> Run:
    return record(experiment)


@pytest.fixture(scope="module")
def path(experiment: Experiment, run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("recording") / "recording.rrd", experiment, [run])


def entities(path: Path) -> set[str]:
    return {chunk.entity_path for chunk in RrdReader(path).stream()}


def column(path: Path, entity: str, component: str) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and values of one component of one entity."""
    stream = RrdReader(path).stream().filter(content=entity, components=component, has_timeline="sim_time")
    batches = [chunk.to_record_batch() for chunk in stream]
    times = np.concatenate([b.column("sim_time").to_numpy(zero_copy_only=False) for b in batches])
    values = [row for b in batches for row in b.column(component).to_pylist()]
    assert np.all(np.diff(times.astype(np.int64)) > 0)
    return times.astype("timedelta64[ns]").astype(np.int64) / NANOSECONDS, np.array(values, dtype=object)


def scalars(path: Path, entity: str) -> tuple[np.ndarray, np.ndarray]:
    times, values = column(path, entity, "Scalars:scalars")
    return times, np.array(values.tolist(), dtype=float).squeeze(-1)


def static(path: Path, entity: str, component: str) -> list:
    stream = RrdReader(path).stream().filter(content=entity, components=component, is_static=True)
    (chunk,) = list(stream)
    (row,) = chunk.to_record_batch().column(component).to_pylist()
    return row


def rerun(home: Path, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run the rerun command, in a home of its own: it keeps settings there, and asks about usage data."""
    command = [sys.executable, "-c", RERUN, "rrd", *map(str, arguments)]
    return subprocess.run(command, env=os.environ | {"HOME": str(home)}, capture_output=True, text=True, check=False)


# --- what is there -------------------------------------------------------------------------------------------


def test_everything_promised_is_there(path: Path, experiment: Experiment) -> None:
    branch_entities = {
        *("phase", "tilt/true", "tilt/measured", "tilt/settle_band", "rate/true", "rate/true_by_gyro"),
        *(f"{kind}/{name}" for kind in ("rate_estimate", "rate_error") for name in ("1_homogeneous", "2_linear")),
        *("command/u", "command/limit", "integrator/x_e", "rig/frame/push"),
        *(f"{kind}/{module}" for kind in ("gimbal", "flywheel") for module in ("cube1", "cube2")),
        *(f"rig/{body}" for body in ("thrust_bearing", "frame", "cube1.gimbal", "cube2.flywheel")),
        *("rig/world/floor", "rig/frame/site/fog", "rig/frame/cube1/servo", "rig/cube1.gimbal/cube1/ring"),
        "rig/cube2.flywheel/slowed/cube2/disc",
    }
    expected = {"/summary", "/scenario", *(f"/homogeneous/{entity}" for entity in branch_entities)}
    assert expected <= entities(path)
    geoms = [name for name in entities(path) if name.startswith("/homogeneous/rig/")]
    model = experiment.plant.drawn_model
    # Every geom and site, every moving body, and besides: two slowed flywheels, one push.
    assert len(geoms) == model.ngeom + model.nsite + (model.nbody - 1) + 2 + 1


def test_values_equal_the_trajectory(path: Path, run: Run, experiment: Experiment) -> None:
    t = run.trajectory
    expected = {
        "tilt/true": np.degrees(t["x1_rad"]),
        "tilt/measured": np.degrees(t["y1_rad"]),
        "rate/true": t["x2_rad_s"],
        "rate/true_by_gyro": t["fog_rad_s"],
        "rate_estimate/1_homogeneous": t["estimate/homogeneous/x2_rad_s"],
        "rate_estimate/2_linear": t["estimate/linear/x2_rad_s"],
        "rate_error/2_linear": t["estimate/linear/x2_rad_s"] - t["x2_rad_s"],
        "command/u": t["u_rad_s"],
        "integrator/x_e": t["x_e_rad_times_s"],
        "gimbal/cube1": np.degrees(t["angle/cube1/gimbal_rad"]) - 90.0,
        "gimbal/cube2": np.degrees(t["angle/cube2/gimbal_rad"]) - 90.0,
        "flywheel/cube1": t["rate/cube1/flywheel_rad_s"],
        "flywheel/cube2": -t["rate/cube2/flywheel_rad_s"],
    }
    for entity, values in expected.items():
        times, recorded_values = scalars(path, f"/homogeneous/{entity}")
        assert np.array_equal(np.rint(times * NANOSECONDS), np.rint(t["time_s"] * NANOSECONDS)), entity
        np.testing.assert_allclose(recorded_values, values, rtol=1e-13, atol=1e-13, err_msg=entity)
        assert np.ptp(recorded_values) > 0.0, entity
    _, limits = column(path, "/homogeneous/command/limit", "Scalars:scalars")
    assert limits.tolist() == [[experiment.law.rate_limit, -experiment.law.rate_limit]] * 2


def test_an_observer_keeps_its_colour(path: Path) -> None:
    colors = {
        (kind, name): tuple(static(path, f"/homogeneous/{kind}/{name}", "SeriesLines:colors"))
        for kind in ("rate_estimate", "rate_error")
        for name in ("1_homogeneous", "2_linear")
    }
    assert colors["rate_estimate", "2_linear"] == colors["rate_error", "2_linear"]
    assert len(set(colors.values())) == 2
    assert static(path, "/homogeneous/rate_estimate/2_linear", "SeriesLines:names") == ["linear"]


def test_an_estimated_bias_is_drawn_beside_the_true_one(tmp_path: Path) -> None:
    """In degrees, in the loop and open loop; the summary has its figures."""
    setup = prepare(
        scenario("observer.kind=adaptive", "open_loop_observers=['homogeneous_adaptive']", "metrics.bias_from_s=0.1")
    )
    run = record(setup)
    path = write(tmp_path / "bias.rrd", setup, [run])
    assert {"/adaptive/bias/1_adaptive", "/adaptive/bias/2_homogeneous_adaptive", "/adaptive/bias/true"} <= entities(
        path
    )
    for i, name in enumerate(("adaptive", "homogeneous_adaptive"), 1):
        _, estimate = scalars(path, f"/adaptive/bias/{i}_{name}")
        np.testing.assert_allclose(estimate, np.degrees(run.trajectory[f"estimate/{name}/bias_rad"]), rtol=1e-12)
    _, true = scalars(path, "/adaptive/bias/true")
    np.testing.assert_allclose(true, setup.scenario.plant.equilibrium_bias_deg, rtol=1e-12)
    (summary,) = static(path, "/summary", "TextDocument:text")
    assert heading("bias_estimate_deg") in summary


def test_summary_scenario_name_and_layout(path: Path, run: Run) -> None:
    (summary,) = static(path, "/summary", "TextDocument:text")
    assert {key for keys in ROW_TABLES for key in keys} <= run.summary.keys()
    assert heading("bias_estimate_deg") not in summary
    summary_keys = [key for key in KEYS if heading(key) in summary]
    assert summary_keys == [key for key in KEYS if key in run.summary]
    assert "# A title" in summary
    assert "+1 N m for 0.1 s at 0.2 s" in summary
    rows = [[cell.strip() for cell in line.split("|")] for line in summary.splitlines()]
    assert ["", heading("tilt_rms_deg"), format_figure("tilt_rms_deg", run.summary["tilt_rms_deg"]), ""] in rows
    assert ["", "Outcome", "done at 0.5 s", ""] in rows
    (observers,) = static(path, "/observers", "TextDocument:text")
    names = [[cell.strip() for cell in line.split("|")][1] for line in observers.splitlines() if "|" in line]
    rows = ["**homogeneous**", "**linear**", *REFERENCES]
    assert [name for name in names if name and not name.startswith(":-")] == 2 * rows  # two tables, for their width
    assert 'kind = "made up"' in static(path, "/scenario", "TextDocument:text")[0]
    assert static(path, "/__properties", "RecordingInfo:name") == ["A title: homogeneous"]
    assert len(RrdReader(path).blueprints()) == 1
    timelines = {name for chunk in RrdReader(path).stream() for name in chunk.timeline_names}
    assert timelines == {"sim_time"}


# --- the mechanism -------------------------------------------------------------------------------------------


def matrix(xyzw: np.ndarray) -> np.ndarray:
    flat = np.empty(9)
    mujoco.mju_quat2Mat(flat, np.roll(xyzw, 1))
    return flat.reshape(3, 3)


def pose(path: Path, entity: str, k: int) -> tuple[float, np.ndarray, np.ndarray]:
    times, translations = column(path, entity, "Transform3D:translation")
    _, quaternions = column(path, entity, "Transform3D:quaternion")
    assert len(times) == len(translations) == len(quaternions)
    (translation,), (quaternion,) = translations[k], quaternions[k]
    return times[k], np.array(translation, float), np.array(quaternion, float)


@pytest.mark.daily_cases("0", "25")
@pytest.mark.parametrize("k", [0, 7, 25, -1])
def test_bodies_stand_where_kinematics_puts_them(path: Path, run: Run, experiment: Experiment, k: int) -> None:
    model = experiment.plant.drawn_model
    data = mujoco.MjData(model)
    for body in range(1, model.nbody):
        name = model.body(body).name.replace("/", ".")
        time, translation, quaternion = pose(path, f"/homogeneous/rig/{name}", k)
        tick = int(np.argmin(np.abs(run.trajectory["time_s"] - time)))
        assert time == pytest.approx(run.trajectory["time_s"][tick], abs=1e-9)
        data.qpos[:] = run.trajectory.qpos()[tick]
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(translation, data.xpos[body], atol=1e-7)
        np.testing.assert_allclose(matrix(quaternion), data.xmat[body].reshape(3, 3), atol=5e-7)
    times, _ = column(path, "/homogeneous/rig/frame", "Transform3D:translation")
    assert times[-1] == run.trajectory["time_s"][-1]
    assert np.diff(times)[:-1] == pytest.approx(1.0 / POSE_RATE_HZ)


@pytest.mark.parametrize("module", [0, 1])
def test_flywheels_are_drawn_slowed(path: Path, run: Run, experiment: Experiment, module: int) -> None:
    plant = experiment.plant
    joint, k = plant.axis.modules[module].flywheel, 30
    name = plant.model.body(plant.model.jnt_bodyid[joint]).name.replace("/", ".")
    _, true_place, true_turn = pose(path, f"/homogeneous/rig/{name}", k)
    time, place, turn = pose(path, f"/homogeneous/rig/{name}/slowed", k)
    qpos = run.trajectory.qpos()[int(np.argmin(np.abs(run.trajectory["time_s"] - time)))]
    data = mujoco.MjData(plant.model)
    data.qpos[:] = qpos
    data.qpos[joint] = qpos[joint] / FLYWHEEL_SLOWDOWN
    mujoco.mj_kinematics(plant.model, data)
    body = plant.model.jnt_bodyid[joint]
    rotation = matrix(true_turn) @ matrix(turn)
    np.testing.assert_allclose(rotation, data.xmat[body].reshape(3, 3), atol=1e-6)
    np.testing.assert_allclose(true_place + matrix(true_turn) @ place, data.xpos[body], atol=1e-7)


def test_shapes_span_what_mujoco_draws(path: Path, experiment: Experiment) -> None:
    model = experiment.plant.drawn_model
    frame = "/homogeneous/rig/frame"
    for name in ("cube1/edge_y_pp", "cube2/edge_x_nn"):
        geom = model.geom(name)
        axis = matrix(np.roll(geom.quat, -1))[:, 2]
        (start,) = static(path, f"{frame}/{name}", "Capsules3D:translations")
        (length,) = static(path, f"{frame}/{name}", "Capsules3D:lengths")
        (xyzw,) = static(path, f"{frame}/{name}", "Capsules3D:quaternions")
        # Rerun's capsule runs from its translation along its z; MuJoCo's both ways from its centre.
        ends = [np.array(start), np.array(start) + matrix(np.array(xyzw))[:, 2] * length]
        expected = [geom.pos - axis * geom.size[1], geom.pos + axis * geom.size[1]]
        np.testing.assert_allclose(ends, expected, atol=1e-7)
    hinge = model.geom("hinge")
    assert static(path, f"{frame}/hinge", "Cylinders3D:lengths") == pytest.approx([2.0 * hinge.size[1]])
    servo = model.geom("cube1/servo")
    (half,) = static(path, f"{frame}/cube1/servo", "Boxes3D:half_sizes")
    assert half == pytest.approx(servo.size)
    corners = np.array(static(path, "/homogeneous/rig/world/floor", "Mesh3D:vertex_positions"))
    assert corners.min(axis=0) == pytest.approx([-1.0, -1.0, 0.0])
    assert corners.max(axis=0) == pytest.approx([1.0, 1.0, 0.0])


SHAPES = """
<mujoco>
  <asset><mesh name="wedge" vertex="0 0 0  .1 0 0  0 .1 0  0 0 .1"/></asset>
  <worldbody>
    <geom name="ball" type="sphere" size=".1" pos="1 2 3"/>
    <geom name="egg" type="ellipsoid" size=".1 .2 .3"/>
    <geom name="sheet" type="plane" size="0 .5 1" euler="90 0 0"/>
    <geom name="wedge" type="mesh" mesh="wedge" pos="1 0 0" euler="0 0 90" rgba="1 0 0 .5"/>
    <geom type="box" size=".1 .1 .1"/>
    <geom name="collision" type="sphere" size=".1" group="3"/>
    <geom name="glass" type="sphere" size=".1" rgba="1 1 1 0"/>
  </worldbody>
</mujoco>
"""


def test_other_robots_shapes() -> None:
    model = mujoco.MjModel.from_xml_string(SHAPES)
    shapes = {name: shape for _, name, shape in drawn_shapes(model, 0.25)}
    assert shapes.keys() == {"ball", "egg", "sheet", "wedge", "geom4"}
    assert isinstance(shapes["ball"], rr.Ellipsoids3D)
    egg, plane, mesh = shapes["egg"], shapes["sheet"], shapes["wedge"]
    assert isinstance(egg, rr.Ellipsoids3D)
    assert egg.half_sizes is not None
    assert isinstance(plane, rr.Mesh3D)
    assert plane.vertex_positions is not None
    assert isinstance(mesh, rr.Mesh3D)
    assert mesh.vertex_positions is not None
    assert egg.half_sizes.as_arrow_array().to_pylist() == [pytest.approx([0.1, 0.2, 0.3])]
    sheet = np.array(plane.vertex_positions.as_arrow_array().to_pylist())
    assert np.ptp(sheet, axis=0) == pytest.approx([2.0, 0.0, 1.0], abs=1e-6)
    wedge = np.array(mesh.vertex_positions.as_arrow_array().to_pylist())
    corners = [[1, 0, 0], [1, 0.1, 0], [0.9, 0, 0], [1, 0, 0.1]]
    assert {tuple(v) for v in np.round(wedge, 5) + 0.0} == {tuple(map(float, corner)) for corner in corners}


# --- push and phases -----------------------------------------------------------------------------------------


def test_the_push_is_an_arrow_while_it_lasts(path: Path) -> None:
    entity = "/homogeneous/rig/frame/push"
    start_times, vectors = column(path, entity, "Arrows3D:vectors")
    end_times, _ = column(path, entity, "Clear:is_recursive")
    assert start_times.tolist() == [0.2]
    assert end_times.tolist() == [0.3]
    # A positive torque about +y moves the frame's upper edge, on the diagonal of its x and z, towards +x and -z.
    ((vector,),) = vectors
    assert vector[0] > 0.0 > vector[2]
    assert vector[0] == pytest.approx(-vector[2])
    assert vector[1] == 0.0


def test_the_torque_as_steps() -> None:
    pushes = [Push(1.0, 0.5, 2.0), Push(1.25, 1.0, -3.0), Push(9.0)]
    assert torque_steps(pushes, end_s=5.0) == [(1.0, 2.0), (1.25, -1.0), (1.5, -3.0), (2.25, 0.0)]
    assert torque_steps(pushes, end_s=1.5) == [(1.0, 2.0), (1.25, -1.0)]


def test_times_are_rounded_to_the_nanosecond() -> None:
    milliseconds = np.arange(20_000)
    times = time_column(milliseconds * 0.001).as_arrow_array().to_numpy(zero_copy_only=False)
    assert np.array_equal(times.astype(np.int64), milliseconds * 1_000_000)
    assert instant(0.001 * 4.35e3) == np.timedelta64(4_350, "ms")


def test_phases_are_recorded(path: Path, run: Run, experiment: Experiment) -> None:
    times, states = column(path, "/homogeneous/phase", "StateChange:state")
    recorded_phases = [(time, state) for time, (state,) in zip(times, states, strict=True)]
    expected = phases(run, experiment.scenario.push, experiment.scenario.metrics)
    assert recorded_phases == [(round(time, 9), name) for time, name in expected]
    assert [state for _, state in recorded_phases][:3] == ["balancing", "push", "recovering"]


def make_run(x1_deg: dict[float, float], end_s: float, kind: str = "done") -> Run:
    """A run of 100 Hz whose tilt steps at given times."""
    time = np.arange(round(end_s * 100.0)) / 100.0
    x1 = np.zeros(len(time))
    for start, value in x1_deg.items():
        x1[time >= start - 1e-9] = np.radians(value)
    return Run("x", Trajectory({"time_s": time, "x1_rad": x1}), {}, Outcome(kind, end_s))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("run", "pushes", "expected"),
    [
        pytest.param(
            make_run({0.0: 0.5, 1.0: 3.0, 1.5: 0.5}, 4.0),
            [Push(1.0, 0.1)],
            [(0.0, "balancing"), (1.0, "push"), (1.1, "recovering"), (1.5, "settled")],
            id="one push",
        ),
        pytest.param(make_run({0.0: 3.0, 0.7: 0.5}, 2.0), [], [(0.0, "recovering"), (0.7, "settled")], id="no push"),
        pytest.param(make_run({}, 2.0), [Push(0.5)], [(0, "balancing"), (0.5, "push"), (0.6, "settled")], id="calm"),
        pytest.param(
            make_run({1.0: 3.0, 1.5: 0.0, 2.0: 3.0}, 3.0),
            [Push(1.0, 0.1), Push(2.0, 0.5), Push(2.2, 0.5)],
            [
                *[(0.0, "balancing"), (1.0, "push"), (1.1, "recovering"), (1.5, "settled")],
                *[(2.0, "push"), (2.7, "recovering")],
            ],
            id="overlapping pushes",
        ),
        pytest.param(
            make_run({1.0: 20.0}, 1.5, "fell"),
            [Push(1.0, 0.1), Push(9.0)],
            [(0.0, "balancing"), (1.0, "push"), (1.1, "recovering"), (1.5, "fallen")],
            id="fall",
        ),
        pytest.param(make_run({}, 0.0, "fell"), [Push(1.0)], [(0.0, "fallen")], id="fall at once"),
        pytest.param(
            make_run({}, 0.5, "interrupted"),
            [Push(0.0)],
            [(0, "push"), (0.1, "settled"), (0.5, "interrupted")],
            id="interrupted",
        ),
    ],
)
def test_phases(run: Run, pushes: list[Push], expected: list[tuple[float, str]]) -> None:
    actual = phases(run, pushes, MetricsSettings())
    assert [name for _, name in actual] == [name for _, name in expected]
    assert [time for time, _ in actual] == pytest.approx([time for time, _ in expected])


def test_settled_when_the_summary_says(experiment: Experiment) -> None:
    run = record(prepare(scenario("duration_s=3.0")))
    push_end = max(push.end_s for push in experiment.scenario.push)
    settle_times = [
        time for time, name in phases(run, experiment.scenario.push, MetricsSettings()) if name == "settled"
    ]
    settle_time = run.summary["settle_time_s"]
    assert isinstance(settle_time, float)
    assert settle_times == [pytest.approx(push_end + settle_time)]


# --- the file ------------------------------------------------------------------------------------------------


def test_rerun_verifies_it_and_finds_a_cut(path: Path, tmp_path: Path) -> None:
    assert rerun(tmp_path, "verify", path).returncode == 0
    cut_path = tmp_path / "cut.rrd"
    cut_path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    assert rerun(tmp_path, "verify", cut_path).returncode != 0


def test_the_same_run_gives_the_same_recording(path: Path, experiment: Experiment, tmp_path: Path) -> None:
    repetition = write(tmp_path / "again.rrd", experiment, [record(experiment)])
    compare = ("compare", "--unordered")
    assert rerun(tmp_path, *compare, path, repetition).returncode == 0
    other = write(tmp_path / "other.rrd", experiment, [record(prepare(scenario("seed=1")))])
    assert rerun(tmp_path, *compare, path, other).returncode != 0


def test_two_observers_have_a_branch_each(tmp_path: Path) -> None:
    experiments = [prepare(scenario().with_observer(kind)) for kind in ("homogeneous", "ltv")]
    runs = [record(experiment) for experiment in experiments]
    path = write(tmp_path / "compare.rrd", experiments[0], runs)
    for i, run in enumerate(runs, 1):
        for signal, entity in (
            ("x2_rad_s", "rate/true"),
            (f"estimate/{run.name}/x2_rad_s", f"rate_estimate/1_{run.name}"),
        ):
            _, recorded_values = scalars(path, f"/{i}_{run.name}/{entity}")
            assert np.array_equal(recorded_values, run.trajectory[signal])
    branches = [
        {name.removeprefix(f"/{i}_{run.name}") for name in entities(path) if name.startswith(f"/{i}_{run.name}/")}
        for i, run in enumerate(runs, 1)
    ]
    assert {name for name in branches[0] if "/rig/" in name} == {name for name in branches[1] if "/rig/" in name}
    (summary,) = static(path, "/summary", "TextDocument:text")
    assert re.search(r"\| +homogeneous \| +ltv \|", summary)


@pytest.mark.daily_cases("0", "2")
@pytest.mark.parametrize("ticks", [0, 1, 2])
def test_a_run_of_no_length(run: Run, experiment: Experiment, tmp_path: Path, ticks: int) -> None:
    short = replace(run.trajectory, columns={name: values[:ticks] for name, values in run.trajectory.columns.items()})
    end = ticks * experiment.law.dt
    short_run = replace(run, trajectory=short, summary={"settle_time_s": None}, outcome=Outcome("fell", end))
    path = write(tmp_path / "short.rrd", experiment, [short_run])
    assert rerun(tmp_path, "verify", path).returncode == 0
    times, _ = column(path, "/homogeneous/rig/frame", "Transform3D:translation")
    assert len(times) == (1 if ticks < 2 else 2)
    _, states = column(path, "/homogeneous/phase", "StateChange:state")
    assert "fallen" in [state for (state,) in states]


def test_a_fall_in_the_first_tick(tmp_path: Path) -> None:
    experiment = prepare(scenario("plant.initial_tilt_deg=40.0"))
    run = record(experiment)
    assert (run.outcome.kind, len(run.trajectory)) == ("fell", 0)
    path = write(tmp_path / "fell.rrd", experiment, [run])
    _, translation, quaternion = pose(path, "/homogeneous/rig/cube1.gimbal", 0)
    body = experiment.plant.new_data().body("cube1/gimbal")
    np.testing.assert_allclose(translation, body.xpos, atol=1e-7)
    np.testing.assert_allclose(matrix(quaternion), body.xmat.reshape(3, 3), atol=1e-6)


def test_an_open_loop_observer_that_diverged(run: Run, experiment: Experiment, tmp_path: Path) -> None:
    columns = dict(run.trajectory.columns)
    columns["estimate/linear/x2_rad_s"] = columns["x2_rad_s"].copy()
    columns["estimate/linear/x2_rad_s"][50:] = [*[1e300, -np.inf], *[np.nan] * (len(run.trajectory) - 52)]
    path = write(tmp_path / "nan.rrd", experiment, [replace(run, trajectory=replace(run.trajectory, columns=columns))])
    _, recorded_values = scalars(path, "/homogeneous/rate_estimate/2_linear")
    assert np.array_equal(recorded_values, columns["estimate/linear/x2_rad_s"], equal_nan=True)


def test_a_users_observer_may_have_any_name(run: Run, experiment: Experiment, tmp_path: Path) -> None:
    name = "my_lab.observers:Kalman"
    columns = {key.replace("/linear/", f"/{name}/"): values for key, values in run.trajectory.columns.items()}
    layout = replace(run.trajectory.layout, observers=("homogeneous", name))
    users_run = replace(run, name=name, trajectory=replace(run.trajectory, columns=columns, layout=layout))
    path = write(tmp_path / "named.rrd", experiment, [users_run])
    part = rr.escape_entity_path_part(name)
    assert {f"/{part}/rig/frame", f"/{part}/rate_estimate/2_{part}"} <= entities(path)
    color = static(path, f"/{part}/rate_estimate/2_{part}", "SeriesLines:colors")
    assert color != static(path, f"/{part}/rate_estimate/1_homogeneous", "SeriesLines:colors")


@pytest.mark.daily_cases("long")
@pytest.mark.parametrize("name", ["my_lab.observers:Kalman", "a/b (c) é", "x" * 300], ids=["class", "odd", "long"])
def test_rerun_does_not_complain_of_a_name(
    run: Run, experiment: Experiment, tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str
) -> None:
    write(tmp_path / "named.rrd", experiment, [replace(run, name=name)])
    assert capfd.readouterr() == ("", "")


def test_runs_need_names_of_their_own(run: Run, experiment: Experiment, tmp_path: Path) -> None:
    for runs in ([], [run, run]):
        with pytest.raises(ValueError, match="different names"):
            write(tmp_path / "recording.rrd", experiment, runs)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.daily_cases("old1-pipe", "old0-memory")
@pytest.mark.parametrize("through", ["pipe", "memory"])
@pytest.mark.parametrize("old", [[], ["recording.rrd"]])
def test_a_full_disk_leaves_no_half_file(
    run: Run,
    experiment: Experiment,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    through: str,
    old: list[str],
) -> None:
    for name in old:
        (tmp_path / name).write_text("old")
    if through == "memory":
        monkeypatch.setattr(stream, "PIPES", "/nowhere")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (5000, before[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            write(tmp_path / "recording.rrd", experiment, [run])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [(name, "old") for name in old]


def test_a_pipe_and_memory_record_alike(
    run: Run, experiment: Experiment, path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stream, "PIPES", "/nowhere")
    other = write(tmp_path / "other.rrd", experiment, [run])
    assert rerun(tmp_path, "compare", path, other).returncode == 0


def test_stretches_record_what_the_whole_does(
    run: Run, experiment: Experiment, path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trajectory, "STRETCH", 33)
    other = write(tmp_path / "other.rrd", experiment, [run])
    assert rerun(tmp_path, "verify", other).returncode == 0
    assert rows_by_entity(other) == rows_by_entity(path)


def rows_by_entity(path: Path) -> dict[tuple[str, str], list[tuple]]:
    """Entity and component -> (time, value), in order, but for the bounds, which are drawn from end to end."""
    rows: dict[tuple[str, str], list[tuple]] = {}
    for chunk in RrdReader(path).stream().filter(has_timeline="sim_time"):
        batch = chunk.to_record_batch()
        names = {"Scalars:scalars", "Transform3D:translation", "StateChange:state"} & set(batch.schema.names)
        if chunk.entity_path.rpartition("/")[2] not in ("settle_band", "limit"):
            times = batch.column("sim_time").cast("int64").to_pylist()
            for name in names:
                row = rows.setdefault((chunk.entity_path, name), [])
                row += zip(times, batch.column(name).to_pylist(), strict=True)
    return {key: sorted(row) for key, row in rows.items()}


def test_an_interrupted_recording_leaves_nothing(
    run: Run, experiment: Experiment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(save, "log_phases", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write(tmp_path / "recording.rrd", experiment, [run])
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written(run: Run, experiment: Experiment, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        write(tmp_path / "missing" / "recording.rrd", experiment, [run])


def test_rerun_turned_off_by_the_environment(
    run: Run, experiment: Experiment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RERUN", "off")
    with pytest.raises(InputError, match="RERUN"):
        write(tmp_path / "recording.rrd", experiment, [run])
    assert list(tmp_path.iterdir()) == []


def test_strict_mode_is_left_as_it_was(path: Path) -> None:
    assert path.exists()
    assert rr.strict_mode() is False
