"""The command that replays users' logs, and the options of every command that reads one."""

from __future__ import annotations

import functools
import math
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cmg_mj.cli.arguments import claim_folder, names_of, of_observers, output_path, released_at_the_end
from cmg_mj.cli.terminal import INTERRUPTED, CtrlC, final_path, note, progress, say_written, show, users_code
from cmg_mj.errors import InputError
from cmg_mj.results.summary_keys import finite

if TYPE_CHECKING:
    from cmg_mj.replay.logs import Log


@dataclass(frozen=True)
class LogArguments:
    """How logs are read: what the options of a log say.

    Attributes:
        columns: `--columns`.
        options: The others, as `read_log` takes them.
    """

    columns: dict[str, str]
    options: dict[str, Any]

    def read(self, path: str) -> Log:
        """One log."""
        from cmg_mj.replay.logs import read_log

        return read_log(path, self.columns, **self.options)

    @property
    def given(self) -> dict[str, Any]:
        """What was given, as TOML can hold it."""
        kept = {"columns": self.columns, **self.options}
        return {name: _listed(value) for name, value in kept.items() if value not in (None, {}, ())}


def _listed(value: Any) -> Any:
    return [_listed(item) for item in value] if isinstance(value, tuple) else value


READING = ("columns", "units", "scale", "offset", "rate", "max_gap", "delay", "radii", "between")
"""The names of `LOG_OPTIONS`."""
LOG_OPTIONS = (
    click.option(
        "--columns",
        multiple=True,
        metavar="ROLE=HEADING,...",
        help="Which column is what: time, tilt, rate (the reference), inner_x, inner_z, outer_x, outer_z, "
        "acceleration, gimbal (or gimbal1, gimbal2), command. Not for a run's own recording.",
    ),
    click.option(
        "--units",
        multiple=True,
        metavar="ROLE=UNIT,...",
        help="Units of columns whose heading does not end in theirs, as in pitch_deg.",
    ),
    click.option("--scale", multiple=True, metavar="ROLE=FACTOR,...", help="Such as rate=-1, or rate=1.015."),
    click.option("--offset", multiple=True, metavar="ROLE=VALUE,...", help="Added after that, in the column's unit."),
    click.option("--rate", type=float, metavar="HZ", help="Rate of rows without a time; with one, resample to it."),
    click.option("--max-gap", type=float, metavar="SECONDS", help="Longer gaps part the log.  [default: 5 rows]"),
    click.option("--delay", type=float, default=0.0, metavar="SECONDS", help="How far the reference lags behind."),
    click.option("--radii", metavar="INNER,OUTER", help="Distances of two accelerometers from the pivot [m]."),
    click.option("--between", metavar="START:END", help="Only this part, in seconds from the first row on."),
)


def of_a_log(command: Callable) -> Callable:
    """Options of every command that reads logs, which it takes as one `LogArguments`."""

    @functools.wraps(command)
    def read_so(
        *before: Any,
        columns: tuple[str, ...],
        units: tuple[str, ...],
        scale: tuple[str, ...],
        offset: tuple[str, ...],
        rate: float | None,
        max_gap: float | None,
        delay: float,
        radii: str | None,
        between: str | None,
        **others: Any,
    ) -> Any:
        from cmg_mj.replay.logs.columns import assignments

        if rate is not None and not 0.1 <= rate <= 1e6:
            raise InputError(f"--rate {rate:g}: must be from 0.1 to 1e6 Hz")
        if max_gap is not None and not 0.0 <= max_gap < math.inf:
            raise InputError(f"--max-gap {max_gap:g}: must be a number of seconds not below 0")
        options = {
            "units": assignments(units, "--units"),
            "scale": _numbers(assignments(scale, "--scale"), "--scale"),
            "offset": _numbers(assignments(offset, "--offset"), "--offset"),
            "rate_hz": rate,
            "max_gap_s": max_gap,
            "delay_s": delay,
            "radii_m": None if radii is None else _pair(radii, ",", "--radii", "INNER,OUTER, such as 0.05,0.15"),
            "between_s": None if between is None else span(between, "--between"),
        }
        reading = LogArguments(assignments(columns, "--columns"), options)
        return command(*before, reading=reading, **others)

    for decorate in reversed(LOG_OPTIONS):
        read_so = decorate(read_so)
    return read_so


def each_once(logs: Sequence[str]) -> None:
    """Refuse a log that is named twice: it would count twice in means and intervals."""
    seen: dict[Path, str] = {}
    for log in logs:
        path = Path(os.path.realpath(log))
        path = path.parent if path.name == "trajectory.parquet" else path
        if path in seen:
            raise InputError(f"{log}: the same log as {seen[path]}" if log != seen[path] else f"{log}: given twice")
        seen[path] = log


def _numbers(texts: dict[str, str], option: str) -> dict[str, float]:
    found = {}
    for role, text in texts.items():
        try:
            found[role] = float(text)
        except ValueError:
            raise InputError(f"{option} {role}={text}: must be a number") from None
    return found


def _pair(text: str, separator: str, option: str, example: str) -> tuple[float, float]:
    first, _, second = text.partition(separator)
    try:
        pair = float(first), float(second)
    except ValueError:
        pair = math.nan, math.nan
    if not all(map(math.isfinite, pair)):
        raise InputError(f"{option} {text!r}: write {example}")
    return pair


def span(text: str, option: str) -> tuple[float, float]:
    """`10:60` -> its ends [s]."""
    start, end = _pair(text, ":", option, "START:END in seconds, such as 10:60")
    if not start < end:
        raise InputError(f"{option} {text}: must end after its start")
    return start, end


@click.command(short_help="Replay your own log through every observer.")
@click.argument("logs", metavar="LOG...", nargs=-1, required=True)
@of_a_log
@click.option("--window", "windows", multiple=True, metavar="START:END", help="Score this part [s] on its own as well.")
@click.option(
    "--model",
    metavar="RIG",
    help="Your pendulum: an MJCF rig, or inertia=,gravity_torque= [kg m^2, N m], with gimbals also momentum=,"
    "gimbal_inertia= [N m s, kg m^2].",
)
@of_observers
@click.option("--set", "settings", multiple=True, metavar="OBSERVER.NAME=VALUE", help="An observer's parameter.")
@click.option(
    "--noise",
    default="",
    metavar="NAME=VALUE,...",
    help="What observers are told of the sensors: accelerometer [ug/rtHz], or tilt [deg] and acceleration [rad/s^2] of "
    "one sample.  [default: 400; 0.1, 1]",
)
@click.option("--skip", type=float, metavar="SECONDS", help="Not judged after each start.  [default: 1]")
@click.option("--out", metavar="FOLDER", help="Folder to write to; by default one in runs/.")
@click.option("--markdown", is_flag=True, help="Print the tables as Markdown.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures alone, as JSON, on standard output.")
@users_code()
def replay(
    reading: LogArguments,
    logs: tuple[str, ...],
    windows: tuple[str, ...],
    model: str | None,
    observers: str,
    settings: tuple[str, ...],
    noise: str,
    skip: float | None,
    out: str | None,
    markdown: bool,
    as_json: bool,
) -> None:
    """Replay LOG, CSV or Parquet, through every observer: a table, plots, a rerun recording, all signals as Parquet.

    \b
      cmg-mj replay LOG.csv --columns time=t_ms,tilt=pitch_deg,rate=gyro_dps
      cmg-mj replay runs/push_recovery-homogeneous-0

    Without a reference the table has the reconstruction error (the tilt integrated from the estimated rate against the
    measured one) and the roughness. Without --model only those observers take part that need none. The recording of a
    run, whose columns are known, replays to the figures of the run. docs/replay.md has the details.
    """  # noqa: D301  (click wants the character itself)
    from cmg_mj.replay import observer_inputs as told
    from cmg_mj.replay import report
    from cmg_mj.replay import save as files
    from cmg_mj.replay.parameter_options import parameters_of
    from cmg_mj.replay.user_noise import noise_numbers
    from cmg_mj.replay.user_pendulum import model_of

    names = names_of(observers)
    spans = [span(text, "--window") for text in windows]
    noises, parameters = noise_numbers(noise), parameters_of(settings)
    for kind in parameters:
        if kind not in names:
            raise InputError(f"--set {kind}: is not among --observers {','.join(names)}")
    pendulum = None if model is None else model_of(model)
    given = LogArguments(reading.columns, {**reading.options, **({"windows_s": tuple(spans)} if spans else {})})
    each_once(logs)
    read = [given.read(path) for path in logs]
    distinct = files.distinct([log.name for log in read])
    asked = {
        "observers": names,
        **({"model": model} if model else {}),
        **({"parameters": parameters} if parameters else {}),
        **({"noise": noises} if noises else {}),
        **({"skip_s": skip} if skip is not None else {}),
    }
    toml = files.settings_of(logs, asked, given.given)
    written = files.files_of_replay(distinct)
    if out is not None:
        folder = claim_folder(output_path(out), written)
    else:
        from cmg_mj.results.run_folder import unused_folder

        more = f"-and-{len(read) - 1}-more" if len(read) > 1 else ""
        name = f"replay-{distinct[0]}{more}"
        folder = released_at_the_end(unused_folder(Path("runs"), name, written, toml, files.SETTINGS))
    replays = []
    with CtrlC() as ctrl_c:
        try:
            with progress("Replay", float(len(read)), ctrl_c) as on_progress:
                for i, log in enumerate(read):
                    done = told.replay_prepared(
                        log,
                        names,
                        model=pendulum,
                        noises=noises,
                        parameters=parameters,
                        skip_s=skip,
                        on_share=lambda share, i=i, log=log: on_progress(i + share, f"Replay {log.name}"),
                    )
                    replays.append(done)
        except KeyboardInterrupt:
            if not replays:
                note("interrupted before the first log was done; nothing was written")
                sys.exit(INTERRUPTED)
        complete = len(replays) == len(read)
        try:
            place = files.save_replay(folder, replays, distinct[: len(replays)], toml, complete=complete)
        finally:
            figures = finite(report.figures_of(replays))
            table = report.replay_markdown(replays) if markdown else report.replay_tables(replays)
            show(figures, table, as_json)
    say_written(folder, place, f"Open the recording: rerun {place / 'recording.rrd'}", as_json)
    if ctrl_c.noted or not complete:
        note(f"interrupted; {len(replays)} of {len(read)} logs are in {final_path(folder, place)}")
        sys.exit(INTERRUPTED)
