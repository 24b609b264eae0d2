"""The command that makes an engine plugin of MuJoCo."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from cmg_mj.cli.arguments import RunArguments, claim_output, export_options, json_option, out_option
from cmg_mj.cli.terminal import note, note_hints, say_written, shell_command, show, users_code

if TYPE_CHECKING:
    from cmg_mj.features.plugin.make import Start


@click.command()
@out_option()
@click.option(
    "--name", metavar="NAME", help="Name of the plugin, behind the prefix cmg_mj.  [default: OBSERVER's name]"
)
@export_options
@click.option(
    "--start",
    type=click.Choice(["keyframe", "spinning"]),
    default="keyframe",
    show_default=True,
    help="Spin the flywheels up in the program, with the model's keyframe, or in the plugin.",
)
@click.option("--no-sensors", is_flag=True, help="Omit the plugin's own sensors from the model.")
@json_option()
@users_code()
def plugin(
    observer: str,
    out: str | None,
    name: str | None,
    scenario: str,
    settings: tuple[str, ...],
    start: Start,
    no_sensors: bool,
    as_json: bool,
) -> None:
    """Compile OBSERVER, a name or your own as package.module:Class, with sensors and law as a plugin of MuJoCo.

    \b
    Writes a folder:
      libcmg_mj_NAME.so   the library, which a program loads with mj_loadPluginLibrary
      NAME.xml            the scenario's model, which names the library; its keyframe is "start"
      NAME_example.py, NAME_example.c, Makefile, and the C of the library
    """  # noqa: D301  (click wants the character itself)
    from cmg_mj.features.plugin.make import make_plugin, require_stable_periods, write_plugin
    from cmg_mj.runs.experiment import prepare

    experiment = prepare(RunArguments(scenario, settings, None, out, as_json).scenario(observer))
    require_stable_periods(experiment)
    note_hints(experiment.hints)
    made = make_plugin(experiment, name, sensors=not no_sensors, start=start)
    with claim_output(out, f"plugin-{made.name}") as folder:
        result = write_plugin(made, folder)
    place, library = result.library.parent, result.library.name
    figures = {"plugin": result.name, "library": library, "model": result.model.name, "build": made.build}
    show(figures, "\n".join(f"{key:<8}{value}" for key, value in figures.items()), as_json)
    say_written(folder, place, f"Try it: {shell_command('python', place / f'{made.name}_example.py')}", as_json)
    if not as_json:
        note(f'a program loads it before the model: mujoco.mj_loadPluginLibrary("{result.library}")')
