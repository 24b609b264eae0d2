"""A bench for gyroscopic stabilisation: a six-body MuJoCo scissored pair, real sensors, velocity observers.

Names are imported when they are first used, so that the rooms without physics (observers, sensors, the law) can be used
without MuJoCo.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cmg_mj.controllers.controller import Controller
    from cmg_mj.controllers.laws import LAWS, FeedbackState, Law, StateFeedback, lqr_gains, make_law
    from cmg_mj.errors import InputError, RunStopped
    from cmg_mj.observers import OBSERVERS, Estimate, Measurement, Observer, make_observer
    from cmg_mj.observers.reduced_model import ReducedModel
    from cmg_mj.plant.mounting import MountedRobot, mount
    from cmg_mj.plant.plant import Plant, load_plant
    from cmg_mj.replay.log_replay import ReplayResult, replay_log
    from cmg_mj.replay.logs import Log, read_log
    from cmg_mj.results.result import Outcome, Result
    from cmg_mj.results.trajectory import Trajectory
    from cmg_mj.scenario.disturbances import Push
    from cmg_mj.scenario.loading import load_scenario, parse_scenario
    from cmg_mj.scenario.plant_settings import PlantSettings
    from cmg_mj.scenario.schema import Scenario
    from cmg_mj.sensors.sampled import Accelerometer, Encoder, Fog, Sensors
    from cmg_mj.sensors.tilt import RadialTilt
    from cmg_mj.simulation.callback import control, control_callback
    from cmg_mj.simulation.experiment import Experiment, prepare
    from cmg_mj.studies.sweeps.api import SweepResult, sweep

_HOMES = {
    "simulation.callback": ("control", "control_callback"),
    "controllers.controller": ("Controller",),
    "errors": ("InputError", "RunStopped"),
    "observers": ("OBSERVERS", "Estimate", "Measurement", "Observer", "make_observer"),
    "plant.plant": ("Plant", "load_plant"),
    "scenario.plant_settings": ("PlantSettings",),
    "scenario.disturbances": ("Push",),
    "observers.reduced_model": ("ReducedModel",),
    "replay.log_replay": ("ReplayResult", "replay_log"),
    "simulation.experiment": ("Experiment", "prepare"),
    "controllers.laws": ("LAWS", "FeedbackState", "Law", "StateFeedback", "lqr_gains", "make_law"),
    "replay.logs": ("Log", "read_log"),
    "plant.mounting": ("MountedRobot", "mount"),
    "scenario.loading": ("load_scenario", "parse_scenario"),
    "scenario.schema": ("Scenario",),
    "sensors.sampled": ("Accelerometer", "Encoder", "Fog", "Sensors"),
    "results.result": ("Outcome", "Result"),
    "studies.sweeps.api": ("SweepResult", "sweep"),
    "sensors.tilt": ("RadialTilt",),
    "results.trajectory": ("Trajectory",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "LAWS",
    "OBSERVERS",
    "Accelerometer",
    "Controller",
    "Encoder",
    "Estimate",
    "Experiment",
    "FeedbackState",
    "Fog",
    "InputError",
    "Law",
    "Log",
    "Measurement",
    "MountedRobot",
    "Observer",
    "Outcome",
    "Plant",
    "PlantSettings",
    "Push",
    "RadialTilt",
    "ReducedModel",
    "ReplayResult",
    "Result",
    "RunStopped",
    "Scenario",
    "Sensors",
    "StateFeedback",
    "SweepResult",
    "Trajectory",
    "control",
    "control_callback",
    "load_plant",
    "load_scenario",
    "lqr_gains",
    "make_law",
    "make_observer",
    "mount",
    "parse_scenario",
    "prepare",
    "read_log",
    "replay_log",
    "sweep",
]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"cmg_mj.{_HOME[name]}"), name)
    raise AttributeError(f"module 'cmg_mj' has no attribute {name!r}")
