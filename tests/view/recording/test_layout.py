"""The layout of a recording, read from its blueprint: observers switched on, order, and the rig in view."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from rerun.chunk import RrdReader

from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.runs.save import report_run
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.stages.swing import Swing
from cmg_mj.view.recording import RecordingHeader, Run, write_recording
from cmg_mj.view.recording.layout import EYE, pages
from cmg_mj.view.recording.run import legend, numbered_parts
from cmg_mj.view.recording.scene import MAX_TRAVEL, enclosing_ball
from cmg_mj.view.recording.signals import make_branches
from tests.recorded import recorded

SHORT = ("duration_s=0.6", "push.0.start_s=0.2")
FIELD_OF_VIEW = math.radians(55.0)
"""The viewer's, from top to bottom; views of the rig are wider than high."""


@dataclass
class View:
    """One view of a blueprint: its title, the entities asked for, and those that are switched off in its legend."""

    name: str = ""
    contents: list[str] = field(default_factory=list)
    off: set[str] = field(default_factory=set)


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
        if "ViewBlueprint:display_name" in values:
            (view.name,) = values["ViewBlueprint:display_name"]
        if "ViewContents:query" in values:
            view.contents = values["ViewContents:query"]
        if values.get("SeriesLines:visible_series") == [False]:
            view.off.add(re.sub(r"^ViewContents/overrides(/.*?)/visualizers.*", r"\1", entity_path))
    return list(result.values())


def select(layout: Sequence[View], name: str) -> list[View]:
    return [view for view in layout if view.name == name]


def record(experiment: Experiment) -> Run:
    result = experiment.run()
    summary = report_run(experiment, result).summary
    return Run(experiment.scenario.observer.kind, recorded(result), summary, result.outcomes[0])


def write(path: Path, experiment: Experiment, runs: Sequence[Run]) -> Path:
    header = RecordingHeader(experiment.plant, 4.7, pushes=experiment.scenario.push)
    write_recording(path, header, runs)
    return path


@pytest.fixture(scope="module")
def all_observers() -> tuple[Experiment, Run]:
    """A run with every observer."""
    experiment = prepare(load_scenario("observer_tuning", SHORT))
    return experiment, record(experiment)


def test_the_best_observers_are_on(all_observers: tuple[Experiment, Run], tmp_path: Path) -> None:
    experiment, run = all_observers
    layout = views(write(tmp_path / "it.rrd", experiment, [run]))
    entries = legend(run.observers, always=["homogeneous"])
    off = {entry.part for entry in entries if not entry.is_best}
    assert len(entries) - len(off) == 3
    for title, folder in (
        ("Tilt rate [rad/s]", "rate_estimate"),
        ("Estimation error of the tilt rate [rad/s]", "rate_error"),
    ):
        (view,) = select(layout, title)
        assert view.off == {f"/homogeneous/{folder}/{part}" for part in off}
        assert f"/homogeneous/{folder}/**" in view.contents


def test_the_best_runs_are_on(all_observers: tuple[Experiment, Run], tmp_path: Path) -> None:
    experiment, run = all_observers
    names = ["b", "a", "d", "c"]
    runs = [replace(run, name=name, summary={"velocity_rms_error_rad_s": i}) for i, name in enumerate(names)]
    layout = views(write(tmp_path / "it.rrd", experiment, runs))
    for title in ("Tilt, true [deg]", "Command, gimbal rate [rad/s]"):
        (first,) = (view for view in select(layout, title) if len(view.contents) > 2)
        assert [entity.split("/")[1] for entity in first.contents] == ["1_b", "2_a", "3_d", "4_c"]
        assert {entity.split("/")[1] for entity in first.off} == {"4_c"}
    assert {len(view.contents) for view in select(layout, "Phase")} == {1, 3}
    header = RecordingHeader(
        experiment.plant, 4.7, swings=[Swing(1.5, 0.3), Swing(2.0, 0.1, start_s=1.0, duration_s=2.0)]
    )
    text = pages(header, make_branches(header, runs))["summary"]
    assert "0.1 N m at 2 Hz from 1 s to 3 s" in text
    assert [line.split("|")[1].strip() for line in text.splitlines() if line.startswith("| ")][1:5] == [
        *("**b**", "**a**", "**d**", "c")
    ]


def test_numbers_put_paths_into_the_order_given() -> None:
    assert numbered_parts(["alone"]) == ["alone"]
    assert numbered_parts(["b", "a"]) == ["1_b", "2_a"]
    assert numbered_parts([*"zyxwvutsrqp"])[0] == "01_z"


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


@pytest.mark.parametrize("scenario", ["push_recovery", "single_gimbal", "two_axes"])
def test_a_rig_is_framed_whole(scenario: str) -> None:
    plant = prepare(load_scenario(scenario, ())).plant
    qpos = plant.new_data().qpos[None]
    rig = enclosing_ball(plant, qpos)
    points = corners(plant.drawn_model, qpos[0])
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
    assert at_start < ball.radius < MAX_TRAVEL * at_start
