"""The command that mounts a pair on a robot."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cmg_mj.cli.arguments import check_observer
from cmg_mj.cli.terminal import note, note_hints, own_stdout, users_code
from cmg_mj.errors import InputError

if TYPE_CHECKING:
    from cmg_mj.plant.mounting import MountedRobot


@click.command(short_help="Mount a pair on a robot of your own: any MJCF in, a rig out.")
@click.argument("robot", metavar="ROBOT.xml")
@click.option("--body", required=True, metavar="NAME", help="The body that carries the pair and its sensors.")
@click.option(
    "--axis",
    default="y",
    show_default=True,
    help="About what it tilts: a hinge's name, or a direction in the body's frame, x, y or '0.1 1 0'. Of a body that "
    "hangs on a hinge along it, that hinge; of a free one, the line that it stands on.",
)
@click.option("-o", "--out", metavar="FILE", default="balanced.xml", show_default=True, help="What to write.")
@click.option("--at", metavar="'X Y Z'", help="The pair's middle in the body's frame [m].  [default: its mass's]")
@click.option("--cubes", default=2, show_default=True, metavar="N", help="How many modules.")
@click.option("--scale", default=1.0, show_default=True, metavar="S", help="Of the modules' lengths.")
@click.option("--name", default="", help="Of the axis; a second one on the same robot needs one.")
@click.option("--keyframe", metavar="NAME", help="In which the robot stands.  [default: its reference pose]")
@click.option(
    "--hold",
    type=click.Choice(["constraints", "servos"]),
    default="constraints",
    show_default=True,
    help="What holds the robot's other joints: constraints all of them, or its own servos those that have one.",
)
@click.option("--free", multiple=True, metavar="JOINT", help="A joint that nothing holds. May be given again.")
@click.option("--free-base", is_flag=True, help="Let it stand on the floor: its root's joints make way for a free one.")
@click.option("--observer", default="homogeneous", show_default=True, metavar="NAME", help="With which it is to stand.")
@click.option("--json", "as_json", is_flag=True, help="Print what the pair can do as JSON, and nothing else.")
@click.option("--overwrite", is_flag=True, help="Write over what an earlier mount has written.")
@users_code()
def mount(
    robot: str,
    body: str,
    axis: str,
    out: str,
    at: str | None,
    cubes: int,
    scale: float,
    name: str,
    keyframe: str | None,
    hold: str,
    free: tuple[str, ...],
    free_base: bool,
    observer: str,
    as_json: bool,
    overwrite: bool,
) -> None:
    """Mount control moment gyroscopes on a robot, and say what they can do there.

    Writes the robot with the pair on it, which plain MuJoCo loads too, and beside it a scenario to run: its gains are
    Table 2's, carried over by the robot's time scale and the pair's authority, and it is pushed with 0.6 of what it
    bears.
    """
    import mujoco

    from cmg_mj.observers.registry import observer_class
    from cmg_mj.plant.mounting import mount as mounted_on
    from cmg_mj.plant.mounting.mounted import check_target, with_scenario
    from cmg_mj.plant.plant import load_plant
    from cmg_mj.studies.push_limits.mount_report import mount_report_lines, scenario_text, write_scenario
    from cmg_mj.studies.push_limits.prospects import LOW_CEILING_DEG, prospects, smallest_sufficient_scale
    from cmg_mj.studies.push_limits.recoverable_states import ceiling

    along = axis.split() if len(axis.split()) == 3 else axis

    def mounted_at(size: float) -> MountedRobot:
        try:
            return mounted_on(
                Path(robot),
                body,
                axis=along,  # type: ignore[arg-type]
                at=_point(at),
                cubes=cubes,
                scale=size,
                name=name,
                keyframe=keyframe,
                hold=hold,  # type: ignore[arg-type]
                free=free,
                base="free" if free_base else "as_is",
            )
        except InputError:
            raise
        except (ValueError, KeyError, mujoco.FatalError) as error:  # of MuJoCo's editing: what nobody has foreseen
            said = " ".join(str(error.args[0] if error.args else error).split()).removeprefix("Error: ")
            raise InputError(f"{robot}: MuJoCo cannot put a pair on it: {said}") from error

    target = Path(out).expanduser()
    check_observer("--observer", observer)
    observer_class(observer)
    check_target(target, Path(robot).expanduser())
    for path in (target, target.with_suffix(".toml")):
        if path.exists() and not overwrite:
            raise InputError(f"-o {out}: {path} exists; give another name, or --overwrite")
    found = mounted_at(scale)
    with with_scenario(target) as model:
        found.save(model)
        can = prospects(write_scenario(model, found.path, observer, axis=name), name)
        experiment = write_scenario(model, found.path, observer, can, name)
        plant = experiment.plant.single_axis(name)
        enough = None
        if math.degrees(can.ceiling.tilt) < LOW_CEILING_DEG:

            def ceiling_at(size: float) -> float:
                trial = mounted_at(size).save(model.with_name(f".{target.stem}.trial.xml"))
                try:
                    return ceiling(
                        load_plant(model=str(trial)).single_axis(name).reduced, experiment.law.rate_limit
                    ).tilt
                finally:
                    trial.unlink()

            enough = smallest_sufficient_scale(ceiling_at, scale)
        scenario = scenario_text(target.name, found.path, observer, can, name)
        model.with_suffix(".toml").write_text(scenario, encoding="utf-8")
    if as_json:
        figures = can.figures() | {"model": str(target), "held": list(found.held), "scale_that_suffices": enough}
        click.echo(json.dumps(figures, indent=2), file=own_stdout())
        return
    click.echo("\n".join(mount_report_lines(found, plant, can, enough)), file=own_stdout())
    note_hints(can.hints)
    note(f"wrote {target} and {target.with_suffix('.toml')}; try: cmg-mj run {target.with_suffix('.toml')}")


def _point(at: str | None) -> list[float] | None:
    if at is None:
        return None
    try:
        point = [float(part) for part in at.replace(",", " ").split()]
    except ValueError:
        point = []
    if len(point) != 3:
        raise InputError(f"--at {at}: must be three numbers, such as '0 0 0.1' [m]")
    return point
