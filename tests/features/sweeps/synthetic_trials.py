"""Trials whose figures are known, without a run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pyarrow as pa

from cmg_mj.features.sweeps.cells import Trials
from cmg_mj.features.sweeps.chunks import compute, table_of
from cmg_mj.features.sweeps.study import SweepStudy, parse_axis
from cmg_mj.scenario.loading import load_scenario

VELOCITY, PUSH = "velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s"
BIAS, NOISE, RATE = "plant.equilibrium_bias_deg", "sensors.accelerometer.noise_density_ug_rthz", "controller.rate_hz"

Error = Callable[[dict[str, Any], str, int], float | None]
"""Point, observer, world -> the velocity error; None for a fall."""


def make_trials(
    axes_text: dict[str, str], observers: tuple[str, ...], worlds: int, error: Error, **options: Any
) -> Trials:
    """A sweep whose velocity errors are given."""
    axes = tuple(parse_axis(field, text, field) for field, text in axes_text.items())
    study = SweepStudy(load_scenario("push_recovery"), axes, observers, worlds, **options)
    rows = []
    for number, point in enumerate(study.points):
        for observer in observers:
            for world in range(worlds):
                result = error(point, observer, world)
                row = {"point": number, **point, "observer": observer, "world": world, "seed": 0}
                rows.append(row | {"outcome": "fell" if result is None else "done", VELOCITY: result})
    return Trials(study, [table_of(study, rows)])


def all_trials(study: SweepStudy) -> pa.Table:
    """Run a study in this process."""
    return pa.concat_tables(table_of(study, compute(study, chunk)) for chunk in study.chunks)
