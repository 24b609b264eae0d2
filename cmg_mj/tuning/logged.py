"""An observer's parameters fitted to one part of users' logs and scored on another."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from cmg_mj.errors import InputError
from cmg_mj.logs import Log
from cmg_mj.logs.log import REFERENCE
from cmg_mj.observers import Observer, make_observer
from cmg_mj.reduced import ReducedModel
from cmg_mj.replay import replay
from cmg_mj.replay.replayed import NO_MODEL, replay_log
from cmg_mj.replay.told import Told, told
from cmg_mj.run_folder import RunFolder, claimed, write_text
from cmg_mj.tilt import TiltNoise
from cmg_mj.tuning.parameters import Number, narrowed, numbers_of, parameters_of
from cmg_mj.tuning.search import evaluations
from cmg_mj.tuning.study import Fitter, Level, OnShare, level_of, names_of
from cmg_mj.tuning.written import level_figures, plain, spread

BLOCKS = 10
"""So many stretches of each log's part are scored on their own, for an interval."""
FILES = ("tuned.json",)


@dataclass(frozen=True)
class Logged:
    """The parts of some logs that are fitted, or those that are scored, in stretches of equal length.

    Attributes:
        logs: The parts.
        skip_s: So long from every start of an observer is not judged [s].
    """

    logs: Sequence[Log]
    skip_s: float
    fell: int = 0

    @property
    def worlds(self) -> int:
        """How many stretches."""
        return sum(len(self._stretches(log)) for log in self.logs)

    @property
    def zero_rms(self) -> float:
        """The error of an estimate of zero: the RMS of the reference, mean of the stretches [rad/s]."""
        return float(np.mean([_rms(log[REFERENCE][rows]) for log in self.logs for rows in self._stretches(log)]))

    @property
    def largest_acceleration(self) -> float:
        """Of the tilt, by differences of the reference [rad/s^2]."""
        return max(float(np.nanmax(np.abs(np.diff(log[REFERENCE]) / log.dt))) for log in self.logs)

    def _stretches(self, log: Log) -> list[np.ndarray]:
        judged = np.flatnonzero(log.scored(self.skip_s) & np.isfinite(log[REFERENCE]))
        return [rows for rows in np.array_split(judged, BLOCKS) if len(rows)]

    def errors(self, observers: Sequence[Observer], /) -> np.ndarray:
        """RMS of the estimated rate less the reference in every stretch, (n_stretches,) [rad/s]: an observer a log."""
        found = []
        for log, observer in zip(self.logs, observers, strict=True):
            rate = np.full(len(log), math.nan)
            for part in log.parts:
                with np.errstate(all="ignore"):
                    rate[part] = replay(observer, log.trajectory(part)).x2
            found += [_rms((rate - log[REFERENCE])[rows]) for rows in self._stretches(log)]
        return np.array(found)


def _rms(values: np.ndarray) -> float:
    with np.errstate(all="ignore"):
        return math.sqrt(float(np.mean(values**2)))


@dataclass(frozen=True)
class LogStudy:
    """An observer tuned on logs.

    Attributes:
        kind: The observer.
        given: Its parameters before.
        numbers: What was tuned.
        idle: Names of the numbers that were not, because the estimated rate does not depend on them.
        names: The logs.
        split: The share of each log that was fitted; the rest is scored.
        level: What came out.
        noises: Log by log what the observer was told of the sensors.
    """

    kind: str
    given: Mapping[str, Any]
    numbers: Sequence[Number]
    idle: Sequence[str]
    names: Sequence[str]
    split: float
    level: Level
    noises: Sequence[TiltNoise]


def tune_on_logs(
    logs: Sequence[Log],
    kind: str,
    *,
    model: ReducedModel | None = None,
    noises: Mapping[str, float] | None = None,
    given: Mapping[str, Any] | None = None,
    split: float = 0.5,
    skip_s: float = 1.0,
    parameters: Sequence[str] = (),
    ranges: Mapping[str, tuple[float, float]] | None = None,
    starts: int = 2,
    on_share: OnShare | None = None,
) -> LogStudy:
    """Fit an observer's parameters to the reference of some logs.

    Args:
        logs: With a reference; all with the same sample period.
        kind: The observer.
        model: The pendulum, for an observer that needs it; a run's recording brings its own.
        noises: What `noise_numbers` gives; by default each log's own, as `replay_ready` has them.
        given: Parameters to start from and to compare with, where not the defaults, or those of a run's loop.
        split: The share of each log, from its start, that is fitted; the rest is scored.
        skip_s: So long from every start of an observer is not judged [s].
        parameters: Names to tune; by default every number of the observer.
        ranges: Number -> smallest and largest size.
        starts: Starts of a search in several dimensions.
        on_share: Called now and then with the share done.

    Returns:
        The study.

    Raises:
        InputError: A log has no reference or is too short, the observer cannot take part, or nothing can be tuned.
    """
    if not 0.0 < split < 1.0:
        raise InputError(f"--split {split:g}: must be between 0 and 1, the share that is fitted")
    dt = logs[0].dt
    for log in logs:
        if "reference" not in log.has:
            raise InputError(f"{log.name}: no reference to tune to: name it, --columns rate=...")
        if abs(log.dt / dt - 1.0) > 1e-3:
            raise InputError(f"{log.name}: {1.0 / log.dt:g} Hz, {logs[0].name} {1.0 / dt:g} Hz: give --rate HZ")
    each = [told(log, model=model, noises=noises, parameters={kind: given or {}}) for log in logs]
    given = _common(kind, logs, each)
    fit, held_out = (
        Logged([log.cut(_share(log, split, first=first)) for log in logs], skip_s) for first in (True, False)
    )
    for part, what in zip((*fit.logs, *held_out.logs), (*each, *each), strict=True):
        # An observer that cannot take part is refused, with the reason.
        replay_log(part, [kind], **what._asdict(), skip_s=skip_s)
    makers: list[Callable[..., Observer]] = [
        partial(make_observer, kind, dt, what.model or NO_MODEL, what.noise) for what in each
    ]
    values = parameters_of(kind, makers[0](**given), given)
    numbers = narrowed(numbers_of(kind, values, makers[0], parameters), ranges or {}, "--range")

    def one_a_log(**tried: Any) -> list[Observer]:
        return [make(**tried) for make in makers]

    fitter = Fitter(kind, one_a_log, values, fit, on_share or (lambda share: None))
    still = fitter.idle(numbers)
    if len(still) == len(numbers):
        raise InputError(f"the rate that {kind} estimates does not depend on {names_of(numbers)}")
    numbers = [number for number in numbers if number not in still]
    fitter.expected = evaluations(len(numbers))
    level = level_of(0.0, fitter, numbers, held_out, starts)
    names, noises_told = [log.name for log in logs], [what.noise for what in each]
    return LogStudy(kind, values, numbers, [n.name for n in still], names, split, level, noises_told)


def _common(kind: str, logs: Sequence[Log], each: Sequence[Told]) -> dict[str, Any]:
    """The parameters that the observer is given, the same in all logs."""
    given = dict(each[0].parameters[kind])
    for log, what in zip(logs, each, strict=True):
        if what.parameters[kind] != given:
            raise InputError(
                f"{logs[0].name} and {log.name} ran with different parameters of {kind}: say with which to begin, "
                "--set observer.NAME=VALUE"
            )
    return given


def _share(log: Log, split: float, *, first: bool) -> slice:
    middle = round(split * len(log))
    return slice(0, middle) if first else slice(middle, len(log))


def figures_of_logs(study: LogStudy) -> dict[str, Any]:
    """What `cmg-mj tune --log ... --json` prints."""
    level = level_figures(study.level)
    left_out = ("noise_density_ug_rthz", "worlds_that_fell", "held_out_worlds")
    return {
        "logs": list(study.names),
        "observer": study.kind,
        "split": study.split,
        "given_parameters": plain(study.given),
        "tuned": [number.name for number in study.numbers],
        "idle": list(study.idle),
        "noise": [
            {"tilt_rad": noise.tilt, "acceleration_rad_s2": noise.acceleration, "correlation": noise.correlation}
            for noise in study.noises
        ],
        "held_out_stretches": len(study.level.rms),
        **{key: value for key, value in level.items() if key not in left_out},
    }


def logs_table(study: LogStudy) -> Group:
    """The table that `cmg-mj tune --log` prints."""
    level = study.level
    share = f"{study.split:.0%}"
    lines = [
        f"RMS of the estimated rate less the reference. Fitted on the first {share} of each log, scored on the rest,",
        f"in {len(level.rms)} stretches. An estimate of zero: {level.zero_rms:.4f} rad/s. Fit {level.fit:.3f} tuned, "
        f"{level.given_fit:.3f} given.",
    ]
    if study.idle:
        lines.append(f"Not tuned, because the rate does not depend on them: {', '.join(study.idle)}.")
    if level.edges:
        lines.append("* at a limit of its range.")
    table = Table(title=f"{', '.join(study.names)}: {study.kind}", box=box.SIMPLE_HEAD, title_justify="left")
    for heading in ("parameter", "given", "tuned"):
        table.add_column(heading, justify="left" if heading == "parameter" else "right")
    for number in study.numbers:
        size = math.copysign(level.sizes[number.name], number.given)
        table.add_row(number.name, f"{number.given:.4g}", f"{size:.4g}{'*' if number.name in level.edges else ''}")
    table.add_section()
    table.add_row("held out [rad/s]", f"{level.given_rms.mean():.4f}", f"{level.rms.mean():.4f}")
    table.add_row("given / tuned, 95 %", "", spread(level.ratio))
    table.add_row("tuned is", "", level.verdict)
    return Group(table, Text("\n".join(lines)))


def save_log_study(folder: RunFolder | Path, study: LogStudy) -> Path:
    """Write tuned.json.

    Args:
        folder: Where. What is there and was not written by cmg_mj stays.
        study: What to write.

    Returns:
        Where it is.

    Raises:
        InputError: It cannot be written.
    """
    text = json.dumps(figures_of_logs(study), indent=2)
    with claimed(folder) as it:
        return it.write({FILES[0]: lambda path: write_text(path, text)})
