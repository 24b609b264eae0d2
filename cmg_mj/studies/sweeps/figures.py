"""What a sweep's report shows as pictures: curves over one varied field, maps over two."""

from __future__ import annotations

from cmg_mj.studies.sweeps.cells import Trials
from cmg_mj.studies.sweeps.curves import CURVES, curves
from cmg_mj.studies.sweeps.maps import MAPS, maps
from cmg_mj.visualization.plots.figure_spec import Picture

NAMES = tuple(f"{name}.png" for name in (*MAPS.values(), CURVES))
"""Files that may be written."""


def pictures_of(trials: Trials) -> list[Picture]:
    """One numeric field varied: curves; two in a grid: a map a figure; else none."""
    study = trials.study
    varied = [axis.field for axis in study.axes if axis.is_range or len(axis.values) > 1]
    if not all(_numeric(value) for axis in study.axes if axis.field in varied for value in axis.values):
        return []
    if len(varied) == 1 and study.design != "sobol":
        found = [curves(trials, varied[0])]
    elif len(varied) == 2 and study.design == "grid":
        found = maps(trials, varied[0], varied[1])
    else:
        return []
    return [picture for picture in found if picture.panels]


def _numeric(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
