"""A bench for gyroscopic stabilisation: a six-body MuJoCo scissored pair, real sensors, velocity observers.

Names are imported when they are first used, so that the rooms without physics (observers, sensors, the law) can be used
without MuJoCo.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cmg_mj.callback import control, installed
    from cmg_mj.controller import Controller
    from cmg_mj.errors import InputError, RunStopped
    from cmg_mj.experiment import Experiment, prepare
    from cmg_mj.laws import LAWS, Fed, Law, StateFeedback, lqr_gains, make_law
    from cmg_mj.logs import Log, read_log
    from cmg_mj.mounting import Mounted, mount
    from cmg_mj.observers import OBSERVERS, Estimate, Measurement, Observer, make_observer
    from cmg_mj.plant import Plant, load_plant
    from cmg_mj.plant_settings import PlantSettings
    from cmg_mj.push import Push
    from cmg_mj.reduced import ReducedModel
    from cmg_mj.replay.replayed import Replayed, replay_log
    from cmg_mj.result import Outcome, Result
    from cmg_mj.scenario import load_scenario, parse_scenario
    from cmg_mj.schema import Scenario
    from cmg_mj.sensors import Accelerometer, Encoder, Fog, Sensors
    from cmg_mj.sweeps.swept import Swept, sweep
    from cmg_mj.tilt import RadialTilt
    from cmg_mj.trajectory import Trajectory

_HOMES = {
    "callback": ("control", "installed"),
    "controller": ("Controller",),
    "errors": ("InputError", "RunStopped"),
    "observers": ("OBSERVERS", "Estimate", "Measurement", "Observer", "make_observer"),
    "plant": ("Plant", "load_plant"),
    "plant_settings": ("PlantSettings",),
    "push": ("Push",),
    "reduced": ("ReducedModel",),
    "replay.replayed": ("Replayed", "replay_log"),
    "experiment": ("Experiment", "prepare"),
    "laws": ("LAWS", "Fed", "Law", "StateFeedback", "lqr_gains", "make_law"),
    "logs": ("Log", "read_log"),
    "mounting": ("Mounted", "mount"),
    "scenario": ("load_scenario", "parse_scenario"),
    "schema": ("Scenario",),
    "sensors": ("Accelerometer", "Encoder", "Fog", "Sensors"),
    "result": ("Outcome", "Result"),
    "sweeps.swept": ("Swept", "sweep"),
    "tilt": ("RadialTilt",),
    "trajectory": ("Trajectory",),
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
    "Fed",
    "Fog",
    "InputError",
    "Law",
    "Log",
    "Measurement",
    "Mounted",
    "Observer",
    "Outcome",
    "Plant",
    "PlantSettings",
    "Push",
    "RadialTilt",
    "ReducedModel",
    "Replayed",
    "Result",
    "RunStopped",
    "Scenario",
    "Sensors",
    "StateFeedback",
    "Swept",
    "Trajectory",
    "control",
    "installed",
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
