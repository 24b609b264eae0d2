"""An observer's parameters fitted to the gyro, as section V of aranovskiy2020 does.

The loop is closed on the gyro, what was measured and commanded is replayed through the observer, and its parameters
are fitted on one set of worlds and scored on another.
"""

from cmg_mj.tuning.recorded import Recorded, record
from cmg_mj.tuning.study import BestNoise, Level, Study, best_noise, tune, tuned_scenario
from cmg_mj.tuning.written import figures_of, files_of_study, save_study, tuning_table

__all__ = [
    "BestNoise",
    "Level",
    "Recorded",
    "Study",
    "best_noise",
    "figures_of",
    "files_of_study",
    "record",
    "save_study",
    "tune",
    "tuned_scenario",
    "tuning_table",
]
