"""Trials whose figures are known, without a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import pyarrow as pa

from cmg_mj.features.sweeps.cells import Trials
from cmg_mj.features.sweeps.chunks import compute, table_of, trials_schema
from cmg_mj.features.sweeps.study import SweepStudy, parse_axis
from cmg_mj.scenario.loading import load_scenario

VELOCITY, PUSH = "velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s"
BIAS, NOISE, RATE = "plant.equilibrium_bias_deg", "sensors.accelerometer.noise_density_ug_rthz", "controller.rate_hz"

Error = Callable[[dict[str, Any], str, int], float | str | None]
"""Point, observer, world -> the velocity error; None for a fall, another outcome by its name."""


def make_study(
    varied: Mapping[str, Any],
    observers: tuple[str, ...] = ("linear", "ltv"),
    worlds: int = 2,
    settings: tuple[str, ...] = (),
    **design: Any,
) -> SweepStudy:
    """A study of push_recovery."""
    axes = tuple(parse_axis(field, values, f"--vary {field}") for field, values in varied.items())
    return SweepStudy(load_scenario("push_recovery", settings), axes, observers, worlds, **design)


def make_trials(
    varied: Mapping[str, Any], observers: tuple[str, ...], worlds: int, error: Error, **design: Any
) -> Trials:
    """A sweep whose velocity errors are given."""
    study = make_study(varied, observers, worlds, **design)
    rows = []
    for number in range(study.n_points):
        point = study.point(number)
        for observer in observers:
            for world in range(worlds):
                result = error(point, observer, world)
                outcome = "fell" if result is None else result if isinstance(result, str) else "done"
                row = {"point": number, **point, "observer": observer, "world": world, "seed": 0, "outcome": outcome}
                rows.append(row | {VELOCITY: None if isinstance(result, str) else result})
    return Trials(study, [table_of(rows, trials_schema(study))])


def all_trials(study: SweepStudy) -> pa.Table:
    """Run a study in this process."""
    chunks = (compute(study, *study.chunk(number)) for number in range(study.n_chunks))
    return pa.concat_tables(table_of(rows, trials_schema(study)) for rows in chunks)
