"""The command that replays users' logs, and the options of every command that reads one."""

from __future__ import annotations

import functools
import math
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import click

from cmg_mj.cli.arguments import (
    Command,
    all_of,
    assignments_option,
    claim_output,
    json_option,
    markdown_option,
    observers_option,
    out_option,
)
from cmg_mj.cli.terminal import (
    CtrlC,
    end_interrupted,
    final_path,
    open_recording,
    progress,
    say_written,
    show,
    users_code,
)
from cmg_mj.core.errors import InputError
from cmg_mj.results.summary_keys import finite

if TYPE_CHECKING:
    from cmg_mj.features.replay.log import ReadOptions

_OPTIONS = (
    click.option(
        "--rig",
        metavar="FILE",
        help="A rig file: places and errors of accelerometers, columns, the pendulum. Other options replace its own.",
    ),
    click.option(
        "--columns",
        multiple=True,
        metavar="ROLE=HEADING,...",
        help="Roles of the columns: time, tilt, rate (the reference), ax, az, inner_x, inner_z, outer_x, outer_z, "
        "acceleration, gyro, gimbal (or gimbal1, gimbal2) and command, or torque. Not for a run's own recording.",
    ),
    click.option(
        "--units",
        multiple=True,
        metavar="ROLE=UNIT,...",
        help="Units of columns whose heading does not end in one, as pitch_deg does.",
    ),
    click.option("--scale", multiple=True, metavar="ROLE=FACTOR,...", help="Factors, such as rate=-1 or rate=1.015."),
    click.option("--offset", multiple=True, metavar="ROLE=VALUE,...", help="Addends after the scale, in column units."),
    click.option(
        "--rate",
        "rate_hz",
        type=click.FloatRange(0.1, 1e6),
        metavar="HZ",
        help="Rate of the rows of a log without times; otherwise the rate to resample to.",
    ),
    click.option(
        "--max-gap",
        "max_gap_s",
        type=click.FloatRange(0.0),
        metavar="SECONDS",
        help="Divide the log at longer gaps.  [default: 5 rows]",
    ),
    click.option(
        "--delay", "delay_s", type=float, default=0.0, metavar="SECONDS", help="Lag of the reference behind the tilt."
    ),
    click.option(
        "--radii", "radii_m", metavar="INNER,OUTER", help="Distances of two accelerometers from the pivot [m]."
    ),
    click.option(
        "--time-range",
        "time_range_s",
        metavar="START:END",
        help="Read only this part, in seconds from the first row on.",
    ),
    click.option("--delimiter", default=",", show_default=True, help="Character between the cells of a CSV."),
    click.option("--encoding", default="utf-8", show_default=True, help="Encoding of a CSV, such as latin-1."),
    click.option("--decimal", default=".", show_default=True, help="Decimal point in a CSV."),
)


pendulum_option = click.option(
    "--model",
    metavar="MJCF|NUMBERS",
    help="Your pendulum: an MJCF file, or inertia=,gravity_torque= [kg m^2, N m], with gimbals also momentum=,"
    "gimbal_inertia= [N m s, kg m^2].",
)
noise_option = click.option(
    "--noise",
    default="",
    metavar="NAME=VALUE,...",
    help="Sensor noise that observers assume: accelerometer [ug/rtHz], or tilt [deg] and acceleration [rad/s^2] of "
    "one sample; gyro [deg/s/rtHz].  [default: from the log, or else accelerometer=400, or tilt=0.1,acceleration=1]",
)


def log_options(command: Command) -> Command:
    """Add the options of every command that reads logs, which it takes as one `ReadOptions`."""

    @functools.wraps(command)
    def with_options(**given: Any) -> None:
        from cmg_mj.features.replay.log import ReadOptions, assignments
        from cmg_mj.observers.parameter_options import finite
        from cmg_mj.scenario.rig_file import Rig, load_rig

        options = {field.name: given.pop(field.name) for field in fields(ReadOptions) if field.name in given}
        rig = options["rig"] = Rig() if options["rig"] is None else load_rig(options["rig"])
        for name in ("columns", "units"):
            options[name] = assignments(options[name], f"--{name}")
        for name in ("scale", "offset"):
            texts = assignments(options[name], f"--{name}")
            options[name] = {role: finite(text, f"--{name} {role}") for role, text in texts.items()}
        if options["radii_m"] is not None:
            options["radii_m"] = pair(options["radii_m"], ",", "--radii", "INNER,OUTER, such as 0.05,0.15")
        if options["time_range_s"] is not None:
            options["time_range_s"] = span(options["time_range_s"], "--time-range")
        usual = vars(ReadOptions())
        for name, value in rig.log.items():
            if isinstance(value, dict):
                options[name] = value | options[name]
            elif options[name] == usual[name]:
                options[name] = value
        command(options=ReadOptions(**options), **given)

    return all_of(*_OPTIONS)(with_options)


def pair(text: str, separator: str, option: str, example: str) -> tuple[float, float]:
    """Parse two finite numbers with a separator between, such as an option's `0.05,0.15`."""
    first, _, second = text.partition(separator)
    try:
        pair = float(first), float(second)
    except ValueError:
        pair = math.nan, math.nan
    if not all(map(math.isfinite, pair)):
        raise InputError(f"{option} {text!r}: write {example}")
    return pair


def span(text: str, option: str) -> tuple[float, float]:
    """Parse `10:60` into its ends [s]."""
    start, end = pair(text, ":", option, "START:END in seconds, such as 10:60")
    if not start < end:
        raise InputError(f"{option} {text}: must end after its start")
    return start, end


@click.command()
@click.argument("logs", metavar="LOG...", nargs=-1, required=True)
@log_options
@click.option("--window", "windows", multiple=True, metavar="START:END", help="Also score this part separately [s].")
@pendulum_option
@observers_option()
@assignments_option("Set an observer's parameter.", "OBSERVER.NAME=VALUE")
@noise_option
@click.option(
    "--settle-s",
    type=float,
    metavar="SECONDS",
    help="Seconds to ignore at the start of each part of a log.  [default: 1; 0 for a run's recording]",
)
@out_option()
@markdown_option()
@json_option()
@users_code()
def replay(
    options: ReadOptions,
    logs: tuple[str, ...],
    windows: tuple[str, ...],
    model: str | None,
    observers: list[str],
    settings: tuple[str, ...],
    noise: str,
    settle_s: float | None,
    out: str | None,
    markdown: bool,
    as_json: bool,
) -> None:
    """Replay each LOG, CSV or Parquet, through every observer.

    \b
      cmg-mj replay LOG.csv --columns time=t_ms,tilt=pitch_deg,rate=gyro_dps
      cmg-mj replay runs/push_recovery-homogeneous-0

    Prints a table, and writes plots, a rerun recording and all signals as Parquet. Without a reference the table has
    the roughness and the reconstruction error, which is the measured tilt less the integral of the estimated rate.
    Observers that need a model take part only with --model. A run's recording replays to the figures of the run.
    docs/replay.md has the details.
    """  # noqa: D301  (click wants the character itself)
    import tomli_w

    from cmg_mj.features.replay import report
    from cmg_mj.features.replay.log_replay import ReplayResult, model_of, replay_prepared
    from cmg_mj.features.replay.noise import noise_numbers
    from cmg_mj.features.replay.reading import read_logs
    from cmg_mj.features.replay.save import distinct_names, save_replays
    from cmg_mj.observers.parameter_options import parameters_of

    options = replace(options, windows_s=tuple(span(text, "--window") for text in windows))
    noises, parameters = noise_numbers(noise), parameters_of(settings)
    for kind in parameters:
        if kind not in observers:
            raise InputError(f"--set {kind}: is not among --observers {','.join(observers)}")
    pendulum = options.rig.model if model is None else model_of(model)
    recordings = read_logs(logs, options)
    names, total = distinct_names(log.name for log in recordings), len(recordings)
    request = {"observers": observers, "model": model, "parameters": parameters, "noise": noises, "settle_s": settle_s}
    request = {name: value for name, value in request.items() if value not in (None, {})}
    log_options = options.as_toml()
    settings_toml = tomli_w.dumps({"logs": logs, **({"log": log_options} if log_options else {}), "replay": request})
    folder = claim_output(out, f"replay-{names[0]}" + (f"-and-{total - 1}-more" if total > 1 else ""))
    results: list[ReplayResult] = []
    with CtrlC() as ctrl_c:
        try:
            with progress("Replay", float(total), ctrl_c) as on_progress:
                for i, log in enumerate(recordings):
                    results.append(
                        replay_prepared(
                            log,
                            observers,
                            model=pendulum,
                            noises=noises,
                            parameters=parameters,
                            settle_s=settle_s,
                            on_share=lambda share, i=i, log=log: on_progress(i + share, f"Replay {log.name}"),
                        )
                    )
        except KeyboardInterrupt:
            if not results:
                end_interrupted("interrupted before the first log was done; nothing was written")
        try:
            place = save_replays(folder, results, names, settings_toml, complete=len(results) == total)
        finally:
            table = report.replay_markdown(results) if markdown else report.replay_tables(results)
            show(finite(report.replay_figures(results)), table, as_json)
    say_written(folder, place, open_recording(place), as_json)
    if ctrl_c.noted or len(results) < total:
        end_interrupted(f"interrupted; {len(results)} of {total} logs are in {final_path(folder, place)}")
