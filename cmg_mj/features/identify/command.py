"""The command that identifies a rig from one log."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cmg_mj.cli.arguments import json_option
from cmg_mj.cli.terminal import note, shell_command, show, users_code
from cmg_mj.core.errors import InputError
from cmg_mj.features.replay.command import log_options

if TYPE_CHECKING:
    from cmg_mj.features.replay.log import ReadOptions
    from cmg_mj.scenario.rig_file import PlacedAccelerometer

SIGNATURE = "# Written by cmg-mj identify, which may replace this file"


@click.command()
@click.argument("log", metavar="LOG")
@log_options
@click.option(
    "--accelerometer",
    "accelerometers",
    multiple=True,
    metavar="FIRST,SECOND[,UNIT]",
    help="Headings of an accelerometer's two axes in the tilting plane, and their unit.  [default: the unit that both "
    "headings end in, or else m_s2]",
)
@click.option(
    "--below-hz",
    type=click.FloatRange(0.1),
    metavar="HZ",
    help="Compare the channels below this frequency.  [default: 8, or less where noise hides the motion]",
)
@click.option(
    "--momentum",
    type=click.FloatRange(0.0, min_open=True),
    metavar="N_M_S",
    help="Spin momentum of the flywheels together, if it is known: with the gimbals' angle it gives the inertia.",
)
@click.option("--judge", metavar="LOG", help="A second log, whose motion the result foretells.")
@click.option(
    "-o",
    "--out",
    default="rig.toml",
    show_default=True,
    metavar="FILE",
    help="Rig file to write; the plot gets the same name with .png.",
)
@click.option("--overwrite", is_flag=True, help="Replace the files of an earlier call.")
@json_option()
@users_code()
def identify(
    options: ReadOptions,
    log: str,
    accelerometers: tuple[str, ...],
    below_hz: float | None,
    momentum: float | None,
    judge: str | None,
    out: str,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Find where the accelerometers of a rig sit, and what is wrong with its sensors, from one LOG.

    \b
      cmg-mj identify LOG.csv --columns time=t_ms,tilt=pot_rad,rate=gyro_dps \\
        --accelerometer x1,y1 --accelerometer x2,y2 --judge OTHER.csv

    Prints places, angles, scales, offsets, delays and noise with 95 % intervals, and writes a rig file, which replay
    and tune-log take as --rig, with a plot of the residuals' spectra. The motion comes from an angle sensor (tilt), a
    gyro (rate), or both. docs/identify.md has the details.
    """  # noqa: D301  (click wants the character itself)
    import tomli_w

    from cmg_mj.features.identify import report
    from cmg_mj.features.identify.identify import identify_rig
    from cmg_mj.features.identify.signals import Signals
    from cmg_mj.features.replay.reading import read_channels
    from cmg_mj.results.folder import whole_file

    path, picture = Path(out), Path(out).with_suffix(".png")
    _check_target(path, picture, overwrite=overwrite)
    if accelerometers:
        options = replace(options, rig=options.rig.model_copy(update={"accelerometer": _unplaced(accelerometers)}))
    channels = read_channels(log, options)
    for remark in channels.notes:
        note(f"{channels.name}: {remark}")
    rig = identify_rig(channels, below_hz, momentum)
    sizes = report.noises(rig.geometry)
    judged = {channels.name: report.judge(rig, rig.signals)}
    if judge:
        other = read_channels(judge, options)
        judged[f"{other.name} (judges)"] = report.judge(rig, Signals(other, rig.signals.below_hz))
    try:
        with whole_file(path) as temporary:
            temporary.write_text(f"{SIGNATURE}\n\n{tomli_w.dumps(report.rig_fields(rig, sizes))}", encoding="utf-8")
        report.plot(picture, rig.geometry)
    except OSError as error:
        raise InputError(f"-o {out}: cannot be written: {error.strerror}") from error
    show(report.figures(rig, sizes, judged), report.tables(rig, sizes, judged), as_json)
    note(f"Written to {path}. Use it: {shell_command('cmg-mj', 'replay', log, '--rig', path)}")


def _check_target(path: Path, picture: Path, *, overwrite: bool) -> None:
    """Refuse to replace files of others, and those of an earlier call without being asked to."""
    if path.suffix != ".toml":
        raise InputError(f"-o {path}: a rig file ends in .toml")
    if path.exists() and not path.read_bytes().startswith(SIGNATURE.encode()):
        raise InputError(f"-o {path}: is there, and not by this command: give another name")
    for file in (path, picture):
        if file.exists() and not overwrite:
            raise InputError(f"-o {path}: {file} exists; give another name, or --overwrite")


def _unplaced(texts: tuple[str, ...]) -> tuple[PlacedAccelerometer, ...]:
    """Parse `--accelerometer x1,y1,g`."""
    from cmg_mj.features.replay.log import unit_of_name
    from cmg_mj.scenario.rig_file import PlacedAccelerometer

    found = []
    for text in texts:
        first, second, *rest = parts = [*map(str.strip, text.split(",")), ""][: max(2, text.count(",") + 1)]
        if len(rest) > 1 or not all(parts):
            raise InputError(f"--accelerometer {text}: write the headings of its two axes and perhaps a unit: x1,y1,g")
        by_name = {unit_of_name("acceleration", name) for name in (first, second)}
        unit = rest[0] if rest else (by_name.pop() if len(by_name) == 1 else None) or "m_s2"
        found.append(PlacedAccelerometer(columns=(first, second), unit=unit, place_m=(0.0, 0.0)))
    return tuple(found)
