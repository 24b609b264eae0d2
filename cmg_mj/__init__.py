"""A bench for gyroscopic stabilisation: a six-body MuJoCo scissored pair, real sensors, velocity observers.

Names are imported when they are first used, so that the packages without physics (observers, sensors, the law) can be
used without MuJoCo. The imports below list them once: type checkers follow the imports, and this module reads their
lines.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cmg_mj.core.axes import MultiAxisController as MultiAxisController
    from cmg_mj.core.controller import Controller as Controller
    from cmg_mj.core.controller import Tick as Tick
    from cmg_mj.core.errors import InputError as InputError
    from cmg_mj.core.errors import RunStopped as RunStopped
    from cmg_mj.core.reduced_model import ReducedModel as ReducedModel
    from cmg_mj.core.tilt import MeasurementNoise as MeasurementNoise
    from cmg_mj.core.tilt import RadialTilt as RadialTilt
    from cmg_mj.features.export import export as export
    from cmg_mj.features.mounting import MountedRobot as MountedRobot
    from cmg_mj.features.mounting import mount as mount
    from cmg_mj.features.pivot import Pivot as Pivot
    from cmg_mj.features.plugin.make import plugin as plugin
    from cmg_mj.features.replay.log import Log as Log
    from cmg_mj.features.replay.log import ReadOptions as ReadOptions
    from cmg_mj.features.replay.log_replay import ReplayResult as ReplayResult
    from cmg_mj.features.replay.log_replay import replay_log as replay_log
    from cmg_mj.features.replay.reading import read_log as read_log
    from cmg_mj.features.sweeps import SweepResult as SweepResult
    from cmg_mj.features.sweeps import sweep as sweep
    from cmg_mj.features.tuning import TuningResult as TuningResult
    from cmg_mj.features.tuning import tune as tune
    from cmg_mj.laws import LAWS as LAWS
    from cmg_mj.laws import FeedbackState as FeedbackState
    from cmg_mj.laws import Law as Law
    from cmg_mj.laws import StateFeedback as StateFeedback
    from cmg_mj.laws import lqr_gains as lqr_gains
    from cmg_mj.laws import make_law as make_law
    from cmg_mj.observers import OBSERVERS as OBSERVERS
    from cmg_mj.observers import Estimate as Estimate
    from cmg_mj.observers import Measurement as Measurement
    from cmg_mj.observers import Observer as Observer
    from cmg_mj.observers import make_observer as make_observer
    from cmg_mj.plant.plant import Plant as Plant
    from cmg_mj.plant.plant import load_plant as load_plant
    from cmg_mj.results.metrics import MetricsSettings as MetricsSettings
    from cmg_mj.results.result import Outcome as Outcome
    from cmg_mj.results.result import Result as Result
    from cmg_mj.results.trajectory import Trajectory as Trajectory
    from cmg_mj.runs.api import Comparison as Comparison
    from cmg_mj.runs.api import compare as compare
    from cmg_mj.runs.callback import control as control
    from cmg_mj.runs.callback import control_callback as control_callback
    from cmg_mj.runs.comparison import ComparedObserver as ComparedObserver
    from cmg_mj.runs.controller import controller as controller
    from cmg_mj.runs.experiment import Experiment as Experiment
    from cmg_mj.runs.experiment import prepare as prepare
    from cmg_mj.runs.save import RunReport as RunReport
    from cmg_mj.runs.save import report_run as report_run
    from cmg_mj.runs.save import save_run as save_run
    from cmg_mj.scenario.loading import load_scenario as load_scenario
    from cmg_mj.scenario.loading import parse_scenario as parse_scenario
    from cmg_mj.scenario.plant_settings import PlantSettings as PlantSettings
    from cmg_mj.scenario.schema import AxisSettings as AxisSettings
    from cmg_mj.scenario.schema import ControllerSettings as ControllerSettings
    from cmg_mj.scenario.schema import LqrSettings as LqrSettings
    from cmg_mj.scenario.schema import ObserverSettings as ObserverSettings
    from cmg_mj.scenario.schema import Scenario as Scenario
    from cmg_mj.sensors import Sensors as Sensors
    from cmg_mj.sensors.accelerometer import Accelerometer as Accelerometer
    from cmg_mj.sensors.accelerometer import Encoder as Encoder
    from cmg_mj.sensors.gyros import Fog as Fog
    from cmg_mj.sensors.gyros import MemsGyro as MemsGyro
    from cmg_mj.stages.push import Push as Push
    from cmg_mj.stages.swing import Swing as Swing
    from cmg_mj.view.recording.save import show_recording as show_recording


def _listed_names() -> dict[str, str]:
    """Read the imports above: public name -> the module that it is imported from."""
    with open(f"{__path__[0]}/__init__.py", encoding="utf-8") as source:
        imports = [line.split() for line in source if line.startswith("    from cmg_mj.")]  # from A import B as B
    return {name: module for _, module, _, name, *_ in imports}


_MODULE_OF_NAME = _listed_names()

# pyright: reportUnsupportedDunderAll=false
__all__ = sorted(_MODULE_OF_NAME)


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF_NAME:
        raise AttributeError(f"module 'cmg_mj' has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULE_OF_NAME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
