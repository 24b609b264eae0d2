"""The layout of a recording, read from its blueprint: observers switched on, axes, order, and the rig in view."""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import rerun.blueprint as rrb
from cmg_mj.visualization.plots.readability import fall_start, labelled_ticks
from cmg_mj.visualization.recording.blueprint import ACTUATOR_PLOTS, COLUMN, TILT_PLOTS, _sized
from cmg_mj.visualization.recording.branch import make_branches
from cmg_mj.visualization.recording.camera import FARTHEST, enclosing_ball
from cmg_mj.visualization.recording.legend import legend, numbered_parts
from cmg_mj.visualization.recording.summary import ROW_TABLES, summary_page
from rerun.chunk import RrdReader

from cmg_mj.observers import OBSERVERS
from cmg_mj.results.result import Outcome
from cmg_mj.scenario.disturbances import Swing
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.simulation.experiment import Experiment, prepare
from cmg_mj.studies.compare.comparison import prepare_comparison
from cmg_mj.studies.save import report_run
from cmg_mj.visualization.recording import RecordingHeader, Run, write_recording
from cmg_mj.visualization.recording.run import best_observers
from cmg_mj.visualization.recording.views import EYE, Choice, plot_view

SHORT = ("duration_s=0.6", "push.0.start_s=0.2")
FIELD_OF_VIEW = math.radians(55.0)
"""The viewer's, from top to bottom; views of the rig are wider than high."""


@dataclass
class View:
    """One view of a blueprint.

    Attributes:
        name: Its title.
        contents: The entities asked for.
        hidden: Entities that are switched off, out of the legend.
        grey: Entities that are switched off in the legend.
        legend: Entities whose line is in the legend, whether on or off.
        axis: Range of y.
        eye: Position and target of the camera.
    """

    name: str = ""
    contents: list[str] = field(default_factory=list)
    hidden: set[str] = field(default_factory=set)
    grey: set[str] = field(default_factory=set)
    legend: set[str] = field(default_factory=set)
    axis: tuple[float, float] | None = None
    eye: dict[str, np.ndarray] = field(default_factory=dict)


def views(path: Path) -> list[View]:
    reader = RrdReader(path)
    (store,) = reader.blueprints()
    result: dict[str, View] = {}
    for chunk in reader.stream(store=store):
        match = re.match(r"/view/([^/]+)/?(.*)", chunk.entity_path)
        if not match:
            continue
        view, entity_path = result.setdefault(match[1], View()), match[2]
        batch = chunk.to_record_batch()
        values: dict[str, Any] = {name: batch.column(name).to_pylist()[0] for name in batch.schema.names if ":" in name}
        entity = re.sub(r"^ViewContents/overrides(/.*?)/visualizers.*", r"\1", entity_path)
        if "ViewBlueprint:display_name" in values:
            (view.name,) = values["ViewBlueprint:display_name"]
        if "ViewContents:query" in values:
            view.contents = values["ViewContents:query"]
        if values.get("EntityBehavior:visible") == [False]:
            view.hidden.add(entity)
        if "SeriesLines:visible_series" in values:
            view.legend.add(entity)
            if values["SeriesLines:visible_series"] == [False]:
                view.grey.add(entity)
        if "ScalarAxis:range" in values:
            (view.axis,) = values["ScalarAxis:range"]
        for name in ("position", "look_target"):
            if values.get(f"EyeControls3D:{name}"):
                view.eye[name] = np.array(values[f"EyeControls3D:{name}"][0])
    return list(result.values())


def select(layout: Sequence[View], name: str) -> list[View]:
    return [view for view in layout if view.name == name]


def record(experiment: Experiment) -> Run:
    result = experiment.run()
    assert result.trajectory is not None
    summary = report_run(experiment, result).summary
    return Run(experiment.scenario.observer.kind, result.trajectory, summary, result.outcomes[0])


def summary_of_runs(experiment: Experiment, runs: Sequence[Run]) -> str:
    header = RecordingHeader(experiment.plant, pushes=experiment.scenario.push)
    return summary_page(header, make_branches(header, runs))


def best_runs(runs: Sequence[Run]) -> list[str]:
    return [entry.name for entry in legend({run.name: run.ranking for run in runs}) if entry.is_best]


def write(path: Path, experiment: Experiment, runs: Sequence[Run]) -> Path:
    header = RecordingHeader(experiment.plant, pushes=experiment.scenario.push, rate_limit_rad_s=4.7)
    write_recording(path, header, runs)
    return path


@pytest.fixture(scope="module")
def all_observers() -> tuple[Experiment, Run]:
    """A run with every observer."""
    experiment = prepare(load_scenario("observer_tuning", SHORT))
    return experiment, record(experiment)


@pytest.fixture(scope="module")
def comparison() -> tuple[Experiment, list[Run]]:
    """Every observer closes the loop."""
    experiments = prepare_comparison(load_scenario("push_recovery", SHORT), list(OBSERVERS))
    return experiments[0], [record(experiment) for experiment in experiments]


# --- many observers ------------------------------------------------------------------------------------------


def test_the_best_open_loop_observers_are_on(all_observers: tuple[Experiment, Run], tmp_path: Path) -> None:
    experiment, run = all_observers
    layout = views(write(tmp_path / "it.rrd", experiment, [run]))
    few = best_observers(run)
    assert few[0] == "homogeneous"
    assert len(few) == 3
    names = list(run.observers)
    off = {f"{i:02}_{name}" for i, name in enumerate(names, 1) if name not in few}
    for title, folder in (
        ("Tilt rate [rad/s]", "rate_estimate"),
        ("Estimation error of the tilt rate [rad/s]", "rate_error"),
    ):
        first, second = sorted(select(layout, title), key=lambda view: len(view.grey))
        assert first.hidden == {f"/homogeneous/{folder}/{part}" for part in off}
        assert second.grey == first.hidden
        assert f"/homogeneous/{folder}/**" in first.contents
        assert not first.grey | second.hidden


@pytest.mark.slow
def test_the_best_runs_are_on(comparison: tuple[Experiment, list[Run]], tmp_path: Path) -> None:
    experiment, runs = comparison
    layout = views(write(tmp_path / "it.rrd", experiment, runs))
    few = best_runs(runs)
    best_parts = {f"{i:02}_{run.name}" for i, run in enumerate(runs, 1) if run.name in few}
    for title in ("Tilt, true [deg]", "Command, gimbal rate [rad/s]"):
        first, second = sorted(
            (view for view in select(layout, title) if len(view.contents) > 2), key=lambda v: len(v.grey)
        )
        assert len(first.contents) == len(runs)
        assert first.contents == second.contents == sorted(first.contents)
        assert {entity.split("/")[1] for entity in set(first.contents) - first.hidden} == best_parts
        assert second.legend == set(second.contents)
        assert {entity.split("/")[1] for entity in second.legend - second.grey} == best_parts
    lanes = {len(view.contents) for view in select(layout, "Phase")}
    assert lanes == {1, len(few), len(runs)}
    text = summary_of_runs(experiment, runs)
    names = [line.split("|")[1].strip().strip("*") for line in text.splitlines() if line.startswith("| ")]
    assert [name for name in names if name] == [run.name for run in runs] * len(ROW_TABLES)


def test_tables_fit_their_view(comparison: tuple[Experiment, list[Run]]) -> None:
    """As wide as those that were looked at, in a window of 1400 pixels."""
    experiment, runs = comparison
    text = summary_of_runs(experiment, runs)
    tables = [part.splitlines() for part in text.split("\n\n") if part.startswith("|")]
    assert len(tables) == len(ROW_TABLES)
    for lines in tables:
        widths = [[len(cell.strip(" *")) for cell in line.split("|")] for line in lines if line.startswith("| ")]
        assert np.max(widths, axis=0).sum() <= 76


def test_a_noisy_observer_takes_no_axis(all_observers: tuple[Experiment, Run], tmp_path: Path) -> None:
    experiment, run = all_observers
    noisy = run.trajectory["estimate/finite_difference/x2_rad_s"]
    for view in select(views(write(tmp_path / "it.rrd", experiment, [run])), "Tilt rate [rad/s]"):
        assert view.axis is not None
        low, high = view.axis
        true = run.trajectory["x2_rad_s"]
        assert low < true.min()
        assert true.max() < high
        assert high - low < 3.0 * np.ptp(true)
        assert high - low < 0.15 * np.ptp(noisy)


def test_a_fall_takes_no_axis_from_those_that_stand(comparison: tuple[Experiment, list[Run]], tmp_path: Path) -> None:
    experiment, runs = comparison
    columns = {**runs[0].trajectory.columns, "x1_rad": runs[0].trajectory["x1_rad"] + 0.5}
    trajectory = replace(runs[0].trajectory, columns=columns)
    fallen_run = replace(runs[0], trajectory=trajectory, outcome=Outcome("fell", 0.6))
    two = [fallen_run, runs[1]]
    (view,) = select(views(write(tmp_path / "it.rrd", experiment, two)), "Tilt, true [deg]")
    assert view.axis is not None
    assert view.axis[1] < np.degrees(0.3)


def test_a_fall_does_not_flatten_what_went_before(comparison: tuple[Experiment, list[Run]], tmp_path: Path) -> None:
    """The run falls from 0.5 s on; alone it has the axis, by what was before."""
    experiment, runs = comparison
    run = runs[0]
    time, true = run.trajectory["time_s"], run.trajectory["x1_rad"]
    fall = np.where(time > 0.5, np.expm1(50.0 * (time - 0.5)), 0.0)
    columns = {**run.trajectory.columns, "x1_rad": true + fall}
    fallen = replace(run, trajectory=replace(run.trajectory, columns=columns), outcome=Outcome("fell", 0.6))
    (view,) = select(views(write(tmp_path / "it.rrd", experiment, [fallen])), "Tilt [deg]")
    assert view.axis is not None
    start = fall_start(time, true + fall, fell=True)
    assert start < 0.55
    before = np.degrees(true[time <= start])
    assert view.axis[0] < before.min()
    assert before.max() < view.axis[1] < before.max() + 3.0 * np.ptp(before) + 1.0
    assert np.degrees(fall[-1]) > 100.0


@pytest.mark.parametrize(("name", "overrides"), [("push_recovery", SHORT), ("two_axes", ("duration_s=0.6", "push=[]"))])
def test_every_axis_has_a_scale(name: str, overrides: tuple[str, ...]) -> None:
    """At least two ticks that the viewer labels, in a window of 900 points, whatever the range of the data."""
    experiment = prepare(load_scenario(name, overrides))
    result = experiment.run()
    header = RecordingHeader(experiment.plant, pushes=experiment.scenario.push, rate_limit_rad_s=4.7)
    (branch, *_) = make_branches(header, report_run(experiment, result).runs)
    for column, height in ((TILT_PLOTS, 778.0), (ACTUATOR_PLOTS, COLUMN)):
        for plot in _sized(column, height):
            shown = plot_view(plot, branch, Choice(best_observers(branch.run)))
            axis = shown.properties["ScalarAxis"]
            assert isinstance(axis, rrb.ScalarAxis)
            assert axis.range is not None
            low, high = axis.range.as_arrow_array().to_pylist()[0]
            assert len(labelled_ticks((low, high), plot.points)) >= 2, plot.title


def test_bounds_out_of_sight_leave_the_legend(all_observers: tuple[Experiment, Run], tmp_path: Path) -> None:
    experiment, run = all_observers
    command = 0.01 * run.trajectory["u_rad_s"]
    columns = {**run.trajectory.columns, "u_rad_s": command}
    still = replace(run, trajectory=replace(run.trajectory, columns=columns))
    for shown, hidden in ((run, set()), (still, {"/homogeneous/command/limit"})):
        (view,) = select(views(write(tmp_path / "it.rrd", experiment, [shown])), "Command, gimbal rate [rad/s]")
        assert view.hidden == hidden


def test_errors_are_drawn_to_the_scale_of_the_rate(all_observers: tuple[Experiment, Run], tmp_path: Path) -> None:
    experiment, run = all_observers
    layout = views(write(tmp_path / "it.rrd", experiment, [run]))
    errors = select(layout, "Estimation error of the tilt rate [rad/s]")
    assert len(errors) == 2
    for view in errors:
        assert view.axis is not None
        assert view.axis[0] < 0.0 < view.axis[1]
        assert view.axis[1] - view.axis[0] >= np.ptp(run.trajectory["x2_rad_s"])


def test_swings_are_summarised_as_swings(all_observers: tuple[Experiment, Run]) -> None:
    experiment, run = all_observers
    swings = [Swing(1.5, 0.3), Swing(2.0, 0.1, start_s=1.0, duration_s=2.0)]
    header = RecordingHeader(experiment.plant, swings=swings)
    text = summary_page(header, make_branches(header, [run]))
    assert "No push." in text
    assert "Swings: 0.3 N m at 1.5 Hz from 0 s to the end; 0.1 N m at 2 Hz from 1 s for 2 s." in text


def test_numbers_put_paths_into_the_order_given() -> None:
    names = [f"observer_{letter}" for letter in "zyxwvutsrqp"]
    parts = numbered_parts(names)
    assert parts == sorted(parts)
    assert numbered_parts(["alone"]) == ["alone"]
    assert numbered_parts(["b", "a"]) == ["1_b", "2_a"]


# --- the camera ----------------------------------------------------------------------------------------------


def move(model: mujoco.MjModel, scale: float, shift: np.ndarray) -> mujoco.MjModel:
    """The same rig, larger or smaller, elsewhere."""
    for name in ("body_pos", "geom_pos", "geom_size", "geom_aabb", "site_pos", "jnt_pos", "body_ipos"):
        getattr(model, name)[:] *= scale
    model.body_pos[1] += shift
    return model


def corners(model: mujoco.MjModel, qpos: np.ndarray) -> np.ndarray:
    """Return the corners of all boxes around geoms of moving bodies, (n, 3) [m]."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    signs = 2.0 * np.array(list(np.ndindex(2, 2, 2))) - 1.0
    boxes = [
        data.geom_xpos[i]
        + (model.geom_aabb[i, :3] + model.geom_aabb[i, 3:] * signs) @ data.geom_xmat[i].reshape(3, 3).T
        for i in range(model.ngeom)
        if model.geom_bodyid[i]
    ]
    return np.concatenate(boxes)


@pytest.mark.parametrize("scenario", ["push_recovery", "single_gimbal"])
@pytest.mark.parametrize(("scale", "shift"), [(1.0, (0, 0, 0)), (10.0, (0, 0, 0)), (0.1, (0, 0, 0)), (1.0, (5, -3, 1))])
def test_a_rig_is_framed_whole(
    monkeypatch: pytest.MonkeyPatch, scenario: str, scale: float, shift: tuple[float, float, float]
) -> None:
    plant = prepare(load_scenario(scenario, ())).plant
    model = move(copy.copy(plant.drawn_model), scale, np.array(shift, float))
    monkeypatch.setitem(plant.__dict__, "drawn_model", model)
    qpos = plant.new_data().qpos[None]
    rig = enclosing_ball(plant, qpos)
    points = corners(model, qpos[0])
    eye = rig.centre + rig.radius * np.array(EYE)
    gaze = (rig.centre - eye) / np.linalg.norm(rig.centre - eye)
    to_points = points - eye
    angles = np.arccos(to_points @ gaze / np.linalg.norm(to_points, axis=1))
    assert angles.max() < FIELD_OF_VIEW / 2.0
    assert angles.max() > 0.6 * FIELD_OF_VIEW / 2.0


def test_a_rig_is_framed_where_it_goes() -> None:
    plant = prepare(load_scenario("push_recovery", ())).plant
    start = plant.new_data().qpos
    end_pose = start.copy()
    end_pose[plant.tilt] += math.radians(60.0)
    ball = enclosing_ball(plant, np.stack([start, end_pose]))
    for qpos in (start, end_pose):
        distance = np.linalg.norm(corners(plant.drawn_model, qpos) - ball.centre, axis=1)
        assert distance.max() <= ball.radius * (1.0 + 1e-9)
    at_start = enclosing_ball(plant, start[None]).radius
    assert enclosing_ball(plant, np.full((3, len(start)), math.nan)).radius == at_start
    assert at_start < ball.radius < FARTHEST * at_start
