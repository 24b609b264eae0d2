"""An observer's parameters fitted to the gyro, as section V of aranovskiy2020 does.

The loop is closed on the gyro, its recording is replayed through the observer, and the observer's parameters are
fitted on one set of worlds and scored on another.
"""

from cmg_mj.features.tuning.fit import NoiseLevelResult
from cmg_mj.features.tuning.logs import tune_on_logs
from cmg_mj.features.tuning.simulations import (
    Recorded,
    TuningResult,
    best_noise,
    halves,
    record,
    recorder,
    tune,
    tuned_scenario,
)

__all__ = [
    "NoiseLevelResult",
    "Recorded",
    "TuningResult",
    "best_noise",
    "halves",
    "record",
    "recorder",
    "tune",
    "tune_on_logs",
    "tuned_scenario",
]
