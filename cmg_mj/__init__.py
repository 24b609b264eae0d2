"""A bench for gyroscopic stabilisation: a six-body MuJoCo scissored pair, real sensors, velocity observers.

Names are imported when they are first used, so that the packages without physics (observers, sensors, the law) can be
used without MuJoCo. Type checkers read the imports instead; a test holds both lists to the same names.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cmg_mj.controllers.controller import Controller as Controller
    from cmg_mj.controllers.laws import LAWS as LAWS
    from cmg_mj.controllers.laws import FeedbackState as FeedbackState
    from cmg_mj.controllers.laws import Law as Law
    from cmg_mj.controllers.laws import StateFeedback as StateFeedback
    from cmg_mj.controllers.laws import lqr_gains as lqr_gains
    from cmg_mj.controllers.laws import make_law as make_law
    from cmg_mj.errors import InputError as InputError
    from cmg_mj.errors import RunStopped as RunStopped
    from cmg_mj.observers import OBSERVERS as OBSERVERS
    from cmg_mj.observers import Estimate as Estimate
    from cmg_mj.observers import Measurement as Measurement
    from cmg_mj.observers import Observer as Observer
    from cmg_mj.observers import make_observer as make_observer
    from cmg_mj.observers.reduced_model import ReducedModel as ReducedModel
    from cmg_mj.plant.mounting import MountedRobot as MountedRobot
    from cmg_mj.plant.mounting import mount as mount
    from cmg_mj.plant.plant import Plant as Plant
    from cmg_mj.plant.plant import load_plant as load_plant
    from cmg_mj.replay.log_replay import ReplayResult as ReplayResult
    from cmg_mj.replay.log_replay import replay_log as replay_log
    from cmg_mj.replay.logs import Log as Log
    from cmg_mj.replay.logs import ReadOptions as ReadOptions
    from cmg_mj.replay.logs import read_log as read_log
    from cmg_mj.results.result import Outcome as Outcome
    from cmg_mj.results.result import Result as Result
    from cmg_mj.results.trajectory import Trajectory as Trajectory
    from cmg_mj.scenario.disturbances import Push as Push
    from cmg_mj.scenario.loading import load_scenario as load_scenario
    from cmg_mj.scenario.loading import parse_scenario as parse_scenario
    from cmg_mj.scenario.plant_settings import PlantSettings as PlantSettings
    from cmg_mj.scenario.schema import Scenario as Scenario
    from cmg_mj.sensors.accelerometer import Accelerometer as Accelerometer
    from cmg_mj.sensors.encoder import Encoder as Encoder
    from cmg_mj.sensors.fog import Fog as Fog
    from cmg_mj.sensors.sampled import Sensors as Sensors
    from cmg_mj.sensors.tilt import RadialTilt as RadialTilt
    from cmg_mj.simulation.callback import control as control
    from cmg_mj.simulation.callback import control_callback as control_callback
    from cmg_mj.simulation.experiment import Experiment as Experiment
    from cmg_mj.simulation.experiment import prepare as prepare
    from cmg_mj.simulation.plugin import plugin as plugin
    from cmg_mj.studies.sweeps.api import SweepResult as SweepResult
    from cmg_mj.studies.sweeps.api import sweep as sweep

NAMES_OF_MODULES = {
    "controllers.controller": ("Controller",),
    "controllers.laws": ("LAWS", "FeedbackState", "Law", "StateFeedback", "lqr_gains", "make_law"),
    "errors": ("InputError", "RunStopped"),
    "observers": ("OBSERVERS", "Estimate", "Measurement", "Observer", "make_observer"),
    "observers.reduced_model": ("ReducedModel",),
    "plant.mounting": ("MountedRobot", "mount"),
    "plant.plant": ("Plant", "load_plant"),
    "replay.log_replay": ("ReplayResult", "replay_log"),
    "replay.logs": ("Log", "ReadOptions", "read_log"),
    "results.result": ("Outcome", "Result"),
    "results.trajectory": ("Trajectory",),
    "scenario.disturbances": ("Push",),
    "scenario.loading": ("load_scenario", "parse_scenario"),
    "scenario.plant_settings": ("PlantSettings",),
    "scenario.schema": ("Scenario",),
    "sensors.accelerometer": ("Accelerometer",),
    "sensors.encoder": ("Encoder",),
    "sensors.fog": ("Fog",),
    "sensors.sampled": ("Sensors",),
    "sensors.tilt": ("RadialTilt",),
    "simulation.callback": ("control", "control_callback"),
    "simulation.experiment": ("Experiment", "prepare"),
    "simulation.plugin": ("plugin",),
    "studies.sweeps.api": ("SweepResult", "sweep"),
}
"""The public names, by the module that defines them."""
_MODULE_OF_NAME = {name: module for module, names in NAMES_OF_MODULES.items() for name in names}

# pyright: reportUnsupportedDunderAll=false
__all__ = sorted(_MODULE_OF_NAME)


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF_NAME:
        raise AttributeError(f"module 'cmg_mj' has no attribute {name!r}")
    return getattr(importlib.import_module(f"cmg_mj.{_MODULE_OF_NAME[name]}"), name)
