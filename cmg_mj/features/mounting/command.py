"""The command that mounts a pair on a robot."""

from __future__ import annotations

from contextlib import nullcontext
from typing import Any

import click

from cmg_mj.cli.arguments import json_option, observer_option
from cmg_mj.cli.terminal import CtrlC, note, note_hints, progress, shell_command, show, users_code


@click.command(short_help="Mount a scissored pair on your own robot, with a scenario.")
@click.argument("robot", metavar="ROBOT.xml")
@click.option("--body", required=True, metavar="NAME", help="Body that carries the pair and its sensors.")
@click.option(
    "--axis",
    default="y",
    show_default=True,
    metavar="HINGE|DIRECTION",
    help="Tilt axis: a hinge name, or a direction in the body frame (x, y, or '0.1 1 0'). A direction selects the "
    "hinge parallel to it, or, for a free body, the contact line.",
)
@click.option(
    "-o",
    "--out",
    metavar="FILE",
    default="balanced.xml",
    show_default=True,
    help="Model file to write; the scenario gets the same name with .toml.",
)
@click.option(
    "--position",
    metavar="'X Y Z'",
    help="Middle of the row of modules in the body frame [m].  [default: the body's centre of mass]",
)
@click.option("--modules", default=2, show_default=True, metavar="N", help="Number of modules.")
@click.option("--scale", default=1.0, show_default=True, metavar="S", help="Scale of the modules' lengths.")
@click.option("--name", default="", metavar="WORD", help="Name of the axis; a second axis on a robot needs one.")
@click.option("--keyframe", metavar="NAME", help="Keyframe in which the robot stands.  [default: its reference pose]")
@click.option(
    "--hold",
    type=click.Choice(["constraints", "servos"]),
    default="constraints",
    show_default=True,
    help="Hold the other joints by constraints, or by the robot's own servos where a joint has one.",
)
@click.option("--release", multiple=True, metavar="JOINT", help="Joint that nothing holds. May be given again.")
@click.option(
    "--free-base",
    "base",
    is_flag=True,
    # click 8.1 takes a default beside flag_value for a flag that is set.
    callback=lambda *arguments: "free" if arguments[-1] else "as_is",
    help="Replace the joints of the robot's root by a free joint.",
)
@click.option(
    "--rig", metavar="FILE", help="Rig file, as identify writes it, whose two accelerometers the scenario gets."
)
@observer_option(default="gyro_free")
@click.option(
    "--plugin",
    "with_plugin",
    is_flag=True,
    help="Write a plugin of MuJoCo too, into FILE_plugin: the controller as a library, and the model that names it.",
)
@click.option(
    "--quick",
    is_flag=True,
    help="Print only the reduced model's limits, without the trials in MuJoCo (up to a minute).",
)
@json_option()
@click.option("--overwrite", is_flag=True, help="Replace the files of an earlier mount.")
@users_code()
def mount(
    robot: str,
    out: str,
    observer: str,
    with_plugin: bool,
    quick: bool,
    as_json: bool,
    overwrite: bool,
    **request: Any,
) -> None:
    """Mount control moment gyroscopes on a robot, and print the largest push it withstands.

    Writes the robot with the pair as a model that plain MuJoCo loads too, and a scenario to run. The scenario has the
    gains of the papers' Table 2, scaled to the robot, and a push of 0.6 times the largest that the robot withstands
    in MuJoCo.
    """
    from cmg_mj.features.mounting.push import MAX_SEARCH_S, TimeLimit
    from cmg_mj.features.mounting.report import mount_report_lines
    from cmg_mj.features.mounting.write import mount_and_write

    with CtrlC() as ctrl_c, nullcontext() if quick else progress("no push", MAX_SEARCH_S, ctrl_c) as on_progress:
        time_limit = TimeLimit(on_progress=on_progress) if on_progress else None
        result = mount_and_write(
            robot,
            out,
            observer,
            overwrite=overwrite,
            time_limit=time_limit,
            with_plugin=with_plugin,
            **request,
        )
    show(result.figures(), "\n".join(mount_report_lines(result)), as_json)
    if not as_json:
        note_hints(result.push_limits.hints)
        scenario = result.path.with_suffix(".toml")
        note(f"wrote {result.path} and {scenario}; try: {shell_command('cmg-mj', 'run', scenario)}")
        if result.plugin:
            example = result.plugin.model.with_name(f"{result.plugin.model.stem}_example.py")
            note(f"wrote {result.plugin.model.parent}; try: {shell_command('python', example)}")
