"""A run in a viewer while it goes on: what is streamed, and that the run does not care what becomes of the viewer."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from cmg_mj.errors import InputError
from cmg_mj.experiment import prepare
from cmg_mj.live import LiveRun, Pace, shown_before
from cmg_mj.push import Push
from cmg_mj.recording import live as stream
from cmg_mj.recording.growing import Growing
from cmg_mj.recording.stream import set_up
from cmg_mj.recording.viewer import Viewer, start_viewer, url_of
from cmg_mj.run_folder import RunFolder
from cmg_mj.runs import save_run, summary_of, to_record
from cmg_mj.scenario import load_scenario
from cmg_mj.trajectory import Trajectory
from tests.command import cmg_mj, cmg_mj_process
from tests.run_folders import assert_whole

pytestmark = pytest.mark.usefixtures("elsewhere")

SHORT = ("duration_s=3.0", "push.0.start_s=0.4", "push.0.duration_s=0.1")
TWO_ENDS = ("tilt/settle_band", "command/limit", "bias/true")
"""Straight lines, of which a recording has the ends and a stream the ends of every piece."""
NOT_ALIKE = "/__properties"
"""The name of the recording, and when it was made."""


@pytest.fixture
def receiver() -> Iterator[Viewer]:
    """A viewer without a screen that keeps all it is sent in a file."""
    viewer = start_viewer(["--save", "received.rrd"])
    yield viewer
    end(viewer, signal.SIGKILL)


def end(viewer: Viewer, how: signal.Signals) -> None:
    """The viewer and what started it, and nothing else: they have a session of their own."""
    if viewer.process.poll() is None:
        os.killpg(viewer.process.pid, how)
        viewer.process.wait()


def content(path: Path) -> dict[tuple[str, str], dict[int | None, object]]:
    """(entity, component) -> time [ns], None where there is none, -> value: all that a recording holds."""
    found: dict[tuple[str, str], dict[int | None, object]] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a stream has no footer
        chunks = list(RrdReader(path).stream())
    for chunk in chunks:
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if name != "sim_time" and not name.startswith("rerun.controls")]
        times = [None] * batch.num_rows
        if not chunk.is_static:
            times = batch.column("sim_time").to_numpy(zero_copy_only=False).astype(np.int64).tolist()
        for name in names:
            rows = found.setdefault((chunk.entity_path, name), {})
            for at, value in zip(times, batch.column(name).to_pylist(), strict=True):
                if value is not None:
                    assert at is None or at not in rows or rows[at] == value  # a page may be written anew
                    rows[at] = value
    return found


def assert_alike(streamed: Path, saved: Path) -> None:
    ours, whole = content(streamed), content(saved)
    assert {key for key in ours if NOT_ALIKE not in key[0]} == {key for key in whole if NOT_ALIKE not in key[0]}
    for key, rows in whole.items():
        if key[0].startswith(NOT_ALIKE):
            continue
        if key[0].endswith(TWO_ENDS) and key[1] == "Scalars:scalars":
            assert {str(value) for value in ours[key].values()} == {str(value) for value in rows.values()}
            assert (min(ours[key]), max(ours[key])) == (min(rows), max(rows))
        else:
            assert ours[key] == rows, key


@pytest.mark.parametrize(
    "settings",
    [
        SHORT,
        (*SHORT, 'companions=["adaptive", "linear"]', "plant.equilibrium_bias_deg=0.5"),
        (*SHORT, "push.0.torque_n_m=40.0"),  # falls
        (*SHORT, "push.0.start_s=0.401", "push.0.duration_s=0.001", "plant.initial_tilt_deg=0.0"),
        ("duration_s=0.005", "push=[]"),
    ],
    ids=["push", "companions", "fall", "between ticks", "one tick"],
)
def test_the_stream_is_the_recording(receiver: Viewer, settings: tuple[str, ...]) -> None:
    """Every entity, every component, every value at its time."""
    experiment = prepare(load_scenario("push_recovery", settings))
    view = LiveRun(experiment, receiver.url, Pace(5.0))
    with view:
        result = experiment.run(**view.options())
        view.ended(result)
        save_run(RunFolder(Path("it"), []), experiment, result)
    assert view.lost == ""
    until_it_is_still(Path("received.rrd"))
    assert_alike(Path("received.rrd"), Path("it/recording.rrd"))


@pytest.mark.parametrize("ticks", [1, 2, 3, 64])
@pytest.mark.parametrize("push", [(0.05, 0.05), (0.051, 0.001), (0.052, 0.07)], ids=str)
def test_wherever_it_is_cut_into_pieces(ticks: int, push: tuple[float, float], tmp_path: Path) -> None:
    """With pushes that begin and end at ticks and between them; a second one comes before the rig has settled."""
    pushes = [Push(torque_n_m=2.0, start_s=push[0], duration_s=push[1])]
    pushes.append(Push(torque_n_m=-1.0, start_s=0.2, duration_s=0.015))
    scenario = load_scenario("push_recovery", ["duration_s=0.6", "plant.timestep_s=0.001"])
    experiment = prepare(scenario.model_copy(update={"push": pushes}))
    result = experiment.run()
    assert result.trajectory is not None
    growing = Growing(shown_before(experiment), rows(result.trajectory, 0, 0))
    with rr.RecordingStream("cmg-mj") as rec:
        memory = rec.memory_recording()
        set_up(rec, "")
        growing.begin(rec)
        for first in range(0, len(result.trajectory) - ticks, ticks):
            growing.add(rec, rows(result.trajectory, first, first + ticks))
        growing.end(rec, to_record(experiment, result))
        Path("streamed.rrd").write_bytes(memory.drain_as_bytes())
    save_run(RunFolder(Path("it"), []), experiment, result)
    assert_alike(Path("streamed.rrd"), Path("it/recording.rrd"))


def rows(trajectory: Trajectory, first: int, end: int) -> Trajectory:
    return replace(trajectory, columns={name: values[first:end] for name, values in trajectory.columns.items()})


def until_it_is_still(path: Path) -> None:
    sizes = [-1, -2]
    while sizes[-1] != sizes[-2]:
        time.sleep(0.5)
        sizes.append(path.stat().st_size)
