"""Plugins made for tests, each under a name of its own: a process registers a name once."""

from __future__ import annotations

import itertools
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
import pytest

from cmg_mj import load_scenario, prepare
from cmg_mj.features.plugin.make import Plugin, plugin
from cmg_mj.features.plugin.model import plugin_mjcf
from cmg_mj.features.plugin.tables import FLAGS
from cmg_mj.plant.tilt_line import apply_torques
from cmg_mj.results.result import Result
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import Experiment
from tests.features.export.compiled import COMPILER

needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler is installed")

_numbers = itertools.count()
_folder = tempfile.TemporaryDirectory()

ALL_IMPERFECTIONS = (
    "sensors.accelerometer.scale_error=[0.02, -0.01]",
    "sensors.accelerometer.misalignment_deg=[0.5, -0.3]",
    "sensors.accelerometer.cross_axis=[0.02, 0.01]",
    "sensors.accelerometer.bias_mg=[3, -4]",
    "sensors.accelerometer.skew_s=0.003",
    "sensors.accelerometer.bandwidth_hz=94",
    "sensors.accelerometer.bias_instability_ug=200",
    "sensors.accelerometer.latency_s=0.0031",
    "sensors.accelerometer.range_g=1.01",
    "sensors.encoder.latency_s=0.004",
    "plant.gimbal_backlash_arcmin=10",
)
EFFECTS = (
    "sensors.accelerometer.vibration_mg=4.0",
    "sensors.accelerometer.wheel_harmonics_mg=[2.0, 1.0]",
    "controller.notch_hz=20",
)
EXACT = (
    "sensors.accelerometer.noise_density_ug_rthz=0",
    "sensors.accelerometer.counts_per_g=0",
    "sensors.encoder.counts_per_revolution=0",
)


QUANTITIES = {
    "tilt": "y1_rad",
    "gimbal_angle": "y2_rad",
    "acceleration": "acceleration_rad_s2",
    "command": "u_rad_s",
    "integrator": "x_e_rad_times_s",
}
"""Sensor of the plugin -> column of a run."""


SENSORS = {"exact": EXACT, "default": (), "all": ALL_IMPERFECTIONS}


SHORT = ("duration_s=0.5", "push.0.start_s=0.2")


class Made(NamedTuple):
    """A plugin with its experiment, loaded."""

    experiment: Experiment
    plugin: Plugin
    model: mujoco.MjModel

    def start(self) -> mujoco.MjData:
        data = mujoco.MjData(self.model)
        mujoco.mj_resetDataKeyframe(self.model, data, self.model.key("start").id)
        return data


@cache
def make(kind: str, *settings: str, scenario: str = "push_recovery") -> Made:
    experiment = prepare(load_scenario(scenario, settings, kind))
    number = next(_numbers)
    made = plugin(experiment, Path(_folder.name) / str(number), name=f"test_{number}")
    mujoco.mj_loadPluginLibrary(str(made.library))
    return Made(experiment, made, mujoco.MjModel.from_xml_path(str(made.model)))


@cache
def quick() -> Made:
    """Made as fast as can be: the export compares on few signals, the compiler does not optimise."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("cmg_mj.features.export.check.TICKS", 40)
        patch.setattr("cmg_mj.features.plugin.tables.FLAGS", (*FLAGS, "-O0"))
        return make("gyro_free", *SHORT)


def variant(made: Made, settings: Mapping[str, str | float]) -> Made:
    """The same library with a model of other settings, such as the integrator's, that leave its C as it is."""
    experiment = made.experiment.with_settings(settings)
    text = plugin_mjcf(experiment.plant, made.plugin.name, {"start": "keyframe", "build": build_of(made)})
    return Made(experiment, made.plugin, mujoco.MjModel.from_xml_string(text))


def build_of(made: Made) -> str:
    """The fingerprint of the library in the model's <config>."""
    match = re.search(r'key="build" value="(\w+)"', made.plugin.model.read_text(encoding="utf-8"))
    assert match is not None
    return match[1]


def torques_at(experiment: Experiment, step: int) -> list[float]:
    """The pushes' torques about the axes during a physics step."""
    h, names = experiment.plant.timestep, experiment.plant.axis_names
    torques = [0.0] * len(names)
    for push in experiment.scenario.push:
        about = push.axis or names[0]
        if about in names and round(push.start_s / h) <= step < round(push.end_s / h):
            torques[names.index(about)] += push.torque_n_m
    return torques


def run(made: Made, data: mujoco.MjData, ticks: int, first_step: int = 0) -> dict[str, np.ndarray]:
    """Step MuJoCo alone; at each control tick: qpos and qvel before it, and what the plugin's sensors show."""
    model, lines = made.model, [axis.line for axis in made.experiment.plant.axes]
    steps = made.experiment.controller().period
    sensors = [model.sensor(i) for i in range(model.nsensor)]
    shown = {s.name: slice(int(s.adr[0]), int(s.adr[0] + s.dim[0])) for s in sensors if s.name.startswith("balance/")}
    rows: dict[str, list[np.ndarray]] = {name: [] for name in ("qpos", "qvel", *shown)}
    for step in range(first_step, first_step + ticks * steps):
        is_tick = step % steps == 0
        if is_tick:
            rows["qpos"].append(data.qpos.copy())
            rows["qvel"].append(data.qvel.copy())
        apply_torques(data.qfrc_applied, lines, torques_at(made.experiment, step))
        mujoco.mj_step(model, data)
        if is_tick:
            for name, place in shown.items():
                rows[name].append(data.sensordata[place].copy())
    return {name: np.array(values) for name, values in rows.items()}


def columns(trajectory: Trajectory, names: Sequence[str]) -> np.ndarray:
    return np.stack([trajectory[name] for name in names], axis=1)


def pairs(
    made: Made, rows: dict[str, np.ndarray], trajectory: Trajectory
) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """What the plugin's program and the runner have of every quantity at every control tick."""
    observer = made.experiment.scenario.observer.kind
    yield "qpos", rows["qpos"], columns(trajectory, trajectory.layout.positions())
    yield "qvel", rows["qvel"], columns(trajectory, trajectory.layout.rates())
    for axis in made.experiment.plant.axis_names:
        own = trajectory.along(axis) if trajectory.axes else trajectory
        prefix = f"balance/{axis}/" if axis else "balance/"
        parts = ["x1_rad", "x2_rad_s", "x3_rad", *own.extra_signals(observer)]
        yield (
            f"{prefix}estimate",
            rows[f"{prefix}estimate"],
            columns(own, [f"estimate/{observer}/{part}" for part in parts]),
        )
        for quantity, column in QUANTITIES.items():
            yield prefix + quantity, rows[prefix + quantity][:, 0], own[column]
        yield f"{prefix}sample", rows[f"{prefix}sample"][:, 0], np.arange(float(len(trajectory)))


def assert_same_run(one: Result, other: Result) -> None:
    """Every column of both is the same, bit for bit; one may be of a batch of one world."""
    assert one.trajectory is not None
    assert other.trajectory is not None
    assert list(one.trajectory.columns) == list(other.trajectory.columns)
    for name, values in one.trajectory.columns.items():
        np.testing.assert_array_equal(values, np.squeeze(other.trajectory[name]), err_msg=name)


def bits(numbers: np.ndarray) -> np.ndarray:
    """Numbers as their 64 bits: -0 is not 0."""
    return np.ascontiguousarray(numbers, dtype=float).view(np.uint64)


def check_against_runner(made: Made) -> None:
    """Every number at every control tick of a run is the runner's, bit for bit."""
    trajectory = made.experiment.run().trajectory
    assert trajectory is not None
    rows = run(made, made.start(), len(trajectory))
    for name, plugin_numbers, runner_numbers in pairs(made, rows, trajectory):
        np.testing.assert_array_equal(plugin_numbers, runner_numbers, err_msg=name)
        np.testing.assert_array_equal(bits(plugin_numbers), bits(runner_numbers), err_msg=f"{name}, bits")
