"""The recording, read back without a viewer."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from cmg_mj.core.errors import InputError
from cmg_mj.results.baselines import BASELINES
from cmg_mj.results.result import Outcome
from cmg_mj.results.summary_keys import KEYS, capitalised, format_figure, heading
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs import live
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.runs.live import LiveView
from cmg_mj.runs.save import recording_header
from cmg_mj.scenario.loading import Scenario, load_scenario
from cmg_mj.scenario.schema import MetricsSettings
from cmg_mj.stages.push import Push
from cmg_mj.view.recording import RecordingHeader, Run, write_recording
from cmg_mj.view.recording.run import phases
from cmg_mj.view.recording.save import pipe_into
from cmg_mj.view.recording.scene import FLYWHEEL_SLOWDOWN, POSE_RATE_HZ
from tests.recorded import assert_same_bits, recorded

SHORT = ("duration_s=0.5", "push.0.start_s=0.2", "push.0.duration_s=0.1", 'open_loop_observers=["linear"]')
NANOSECONDS = 1e9
RERUN = "import sys; from rerun_cli.__main__ import main; sys.exit(main())"


def scenario(*overrides: str) -> Scenario:
    return load_scenario("push_recovery", [*SHORT, *overrides])


def record(experiment: Experiment, name: str | None = None) -> Run:
    result = experiment.run()
    name = name or experiment.scenario.observer.kind
    return Run(name, recorded(result), result.summaries[0], result.outcomes[0])


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


def test_everything_promised_is_there(path: Path, experiment: Experiment) -> None:
    branch_entities = {
        *("phase", "tilt/true", "tilt/measured", "tilt/settle_band", "rate/true", "rate/true_by_gyro"),
        *(f"{kind}/{name}" for kind in ("rate_estimate", "rate_error") for name in ("1_homogeneous", "2_linear")),
        *("command/u", "command/limit", "integrator/x_e", "rig/frame/push"),
        *(f"{kind}/{module}" for kind in ("gimbal", "flywheel") for module in ("cube1", "cube2")),
        *(f"rig/{body}" for body in ("thrust_bearing", "frame", "cube1.gimbal", "cube2.flywheel")),
        *("rig/world/floor", "rig/frame/site/fog", "rig/frame/cube1/servo", "rig/cube1.gimbal/cube1/ring"),
        "rig/cube2.flywheel/cube2/disc",
    }
    expected = {"/summary", "/scenario", *(f"/homogeneous/{entity}" for entity in branch_entities)}
    assert expected <= entities(path)
    geoms = [name for name in entities(path) if name.startswith("/homogeneous/rig/")]
    model = experiment.plant.drawn_model
    # Every geom and site, every moving body, and one push besides.
    assert len(geoms) == model.ngeom + model.nsite + (model.nbody - 1) + 1


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
    assert heading("bias_estimate_deg")[1:] in static(path, "/summary", "TextDocument:text")[0]


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


@pytest.mark.parametrize("k", [0, 25])
def test_bodies_stand_where_kinematics_puts_them(path: Path, run: Run, experiment: Experiment, k: int) -> None:
    model = experiment.plant.drawn_model
    data = mujoco.MjData(model)
    for body in range(1, model.nbody):
        name = model.body(body).name.replace("/", ".")
        time, translation, quaternion = pose(path, f"/homogeneous/rig/{name}", k)
        tick = int(np.argmin(np.abs(run.trajectory["time_s"] - time)))
        assert time == pytest.approx(run.trajectory["time_s"][tick], abs=1e-9)
        data.qpos[:] = run.trajectory.qpos()[tick]
        data.qpos[[module.flywheel for module in experiment.plant.axis.modules]] /= FLYWHEEL_SLOWDOWN
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(translation, data.xpos[body], atol=1e-7)
        np.testing.assert_allclose(matrix(quaternion), data.xmat[body].reshape(3, 3), atol=5e-7)
    times, _ = column(path, "/homogeneous/rig/frame", "Transform3D:translation")
    assert times[-1] == run.trajectory["time_s"][-1]
    assert np.diff(times)[:-1] == pytest.approx(1.0 / POSE_RATE_HZ)


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
    corners = np.array(static(path, "/homogeneous/rig/world/floor", "Mesh3D:vertex_positions"))
    assert corners.min(axis=0) == pytest.approx([-1.0, -1.0, 0.0])
    assert corners.max(axis=0) == pytest.approx([1.0, 1.0, 0.0])


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


def test_phases_are_recorded(path: Path, run: Run, experiment: Experiment) -> None:
    times, states = column(path, "/homogeneous/phase", "StateChange:state")
    expected = phases(run, experiment.scenario.push, experiment.scenario.metrics)
    assert [*zip(times, states.ravel(), strict=True)] == [(round(time, 9), name) for time, name in expected]


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
    ],
)
def test_phases(run: Run, pushes: list[Push], expected: list[tuple[float, str]]) -> None:
    actual = phases(run, pushes, MetricsSettings())
    assert [name for _, name in actual] == [name for _, name in expected]
    assert [time for time, _ in actual] == pytest.approx([time for time, _ in expected])


def test_two_observers_have_a_branch_each(run: Run, experiment: Experiment, tmp_path: Path) -> None:
    other = record(prepare(scenario().with_observer("ltv")))
    path = write(tmp_path / "compare.rrd", experiment, [run, other])
    for i, branch in enumerate((run, other), 1):
        _, rate = scalars(path, f"/{i}_{branch.name}/rate/true")
        assert np.array_equal(rate, branch.trajectory["x2_rad_s"])


def test_pages_name_and_layout(path: Path, run: Run) -> None:
    (summary,) = static(path, "/summary", "TextDocument:text")
    rows = [line.split("|")[1].strip() for line in summary.splitlines() if line.startswith("| ")]
    assert rows[2:] == [capitalised(heading(key)) for key in KEYS if key in run.summary]
    assert format_figure("tilt_rms_deg", run.summary["tilt_rms_deg"]) in summary
    (observers,) = static(path, "/observers", "TextDocument:text")
    assert all(name in observers for name in ("homogeneous", "linear", *BASELINES))
    assert static(path, "/__properties", "RecordingInfo:name") == ["A title: homogeneous"]
    assert len(RrdReader(path).blueprints()) == 1
    assert {name for chunk in RrdReader(path).stream() for name in chunk.timeline_names} == {"sim_time"}


def test_the_same_run_gives_the_same_recording(path: Path, experiment: Experiment, tmp_path: Path) -> None:
    again = write(tmp_path / "again.rrd", experiment, [record(experiment)])
    other = write(tmp_path / "other.rrd", experiment, [record(prepare(scenario("seed=1")))])
    assert rerun(tmp_path, "verify", path).returncode == 0
    assert rerun(tmp_path, "compare", "--unordered", path, again).returncode == 0
    assert rerun(tmp_path, "compare", "--unordered", path, other).returncode != 0


def test_a_full_disk_leaves_the_old_file(
    run: Run, experiment: Experiment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "recording.rrd"
    path.write_text("old")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (5000, before[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            write(path, experiment, [run])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    monkeypatch.setenv("RERUN", "off")
    with pytest.raises(InputError, match="RERUN"):
        write(path, experiment, [run])
    assert [file.read_text() for file in tmp_path.iterdir()] == ["old"]


@pytest.mark.parametrize("name", ["push_recovery", "two_axes"])
def test_a_viewer_receives_the_run_while_it_goes_on(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Series and poses are those of the run, which is the one that nobody looks at."""
    path = tmp_path / "live.rrd"
    monkeypatch.setattr(live.subprocess, "Popen", lambda *_, **__: None)
    monkeypatch.setattr(rr.RecordingStream, "connect_grpc", lambda rec: rec.save(path))
    experiment = prepare(load_scenario(name, ["duration_s=0.5", "push=[]"]))
    view = LiveView(recording_header(experiment), experiment.scenario.observer.kind)
    trajectory = recorded(experiment.run(**view.options(lambda _: None)))
    view.show()
    view._rec.disconnect()
    runs = {f"/{i}_{axis}": trajectory.along(axis) for i, axis in enumerate(trajectory.axes, 1)}
    for branch, columns in (runs or {"/homogeneous": trajectory}).items():
        times, rate = scalars(path, f"{branch}/rate/true")
        assert np.array_equal(rate, columns["x2_rad_s"])
        np.testing.assert_allclose(times, columns["time_s"], atol=1e-9)
        assert len(column(path, f"{branch}/rig/frame", "Transform3D:translation")[0]) > 10
    assert_same_bits(trajectory, recorded(experiment.run()))


def test_a_full_disk_is_an_error_and_nobody_waits() -> None:
    with pytest.raises(OSError, match="No space left"), pipe_into(Path("/dev/full")) as pipe:
        Path(pipe).write_bytes(bytes(10_000_000))
