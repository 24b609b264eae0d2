"""The command that makes an engine plugin of MuJoCo."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from cmg_mj.cli.arguments import RunArguments, check_observer, claim_output, json_option, out_option, settings_option
from cmg_mj.cli.terminal import note, note_hints, say_written, shell_command, show, users_code
from cmg_mj.errors import InputError

if TYPE_CHECKING:
    from cmg_mj.simulation.plugin_files import Start


_NOT_CALLED = (
    "`import mujoco` loads no plugin in this Python environment: its cmg_mj has no entry point in the group "
    "mujoco.plugins; install cmg_mj again"
)


@click.command(short_help="Compile the controller into MuJoCo: a library, and a model.")
@click.argument(
    "observer",
    required=False,
    callback=lambda context, parameter, name: None if name is None else check_observer("OBSERVER", name),
)
@out_option()
@click.option(
    "--name", metavar="NAME", help="Name of the plugin, behind the prefix cmg_mj.  [default: OBSERVER's name]"
)
@click.option(
    "--scenario",
    default="push_recovery",
    show_default=True,
    metavar="NAME",
    help="Scenario that gives the plant, the sensors, the gains and the rates.",
)
@settings_option("Set a field of the scenario, such as observer.k1=25 or controller.rate_hz=400.")
@click.option(
    "--start",
    type=click.Choice(["keyframe", "spinning"]),
    default="keyframe",
    show_default=True,
    help="Spin the flywheels up in the program, with the model's keyframe, or in the plugin.",
)
@click.option("--no-sensors", is_flag=True, help="Omit the plugin's own sensors from the model.")
@click.option(
    "--install",
    metavar="PATH",
    help="Let `import mujoco` load a plugin that this command has made: its folder, library, or name in runs/.",
)
@click.option("--uninstall", metavar="NAME", help="Remove an installed plugin.")
@click.option("--list", "lists", is_flag=True, help="List the installed plugins, and those that do not load.")
@json_option()
@users_code()
def plugin(
    observer: str | None,
    out: str | None,
    name: str | None,
    scenario: str,
    settings: tuple[str, ...],
    start: Start,
    no_sensors: bool,
    install: str | None,
    uninstall: str | None,
    lists: bool,
    as_json: bool,
) -> None:
    """Compile OBSERVER, a name or your own as package.module:Class, with sensors and law as a plugin of MuJoCo.

    \b
    Writes a folder:
      libcmg_mj_NAME.so   the library
      NAME.xml            the scenario's model, which names the library; its keyframe is "start"
      NAME_example.py, NAME_example.c, Makefile, and the C of the library

    No program loads the library by itself until --install copies the library into a folder of yours.
    """  # noqa: D301  (click wants the character itself)
    if install is not None or uninstall is not None or lists:
        _check_alone()
        if install is not None:
            _install(install, as_json)
        elif uninstall is not None:
            _uninstall(uninstall, as_json)
        else:
            _list(as_json)
        return
    if observer is None:
        raise InputError("plugin: name an OBSERVER to make a plugin, or give --install, --uninstall or --list")
    from cmg_mj.codegen.engine_plugin.install import has_another
    from cmg_mj.simulation.experiment import prepare
    from cmg_mj.simulation.plugin_files import (
        check_tools,
        make_plugin,
        require_stable_periods,
        write_plugin_or_sources,
    )

    check_tools()
    experiment = prepare(RunArguments(scenario, settings, None, out, as_json).scenario(observer))
    require_stable_periods(experiment)
    note_hints(experiment.hints)
    made = make_plugin(experiment, name, sensors=not no_sensors, start=start)
    with claim_output(out, f"plugin-{made.name}") as folder:
        result = write_plugin_or_sources(made, folder)
    figures = {
        "plugin": result.name,
        "library": result.library.name,
        "model": result.model.name,
        "build": made.code.build,
    }
    _show(figures, as_json)
    place = result.library.parent
    say_written(folder, place, f"Try it: {shell_command('python', place / f'{made.name}_example.py')}", as_json)
    if has_another(result.library):
        remedy = shell_command("cmg-mj", "plugin", "--install", result.library)
        note(f"hint: {result.name} is installed from another library: {remedy}")


def _check_alone() -> None:
    """Refuse what --install, --uninstall and --list do not go with."""
    context = click.get_current_context()
    options = [
        parameter.opts[0] if isinstance(parameter, click.Option) else parameter.human_readable_name
        for parameter in context.command.params
        if parameter.name and context.get_parameter_source(parameter.name) == ParameterSource.COMMANDLINE
    ]
    first = next(option for option in options if option in ("--install", "--uninstall", "--list"))
    others = [option for option in options if option not in (first, "--json")]
    if others:
        raise InputError(f"plugin: {first} does not go with {', '.join(others)}")


def _install(target: str, as_json: bool) -> None:
    from cmg_mj.codegen.engine_plugin.install import find_library, install, is_called, list_plugins

    library = find_library(target)
    manifests = [status.manifest for status in list_plugins()[1]]
    result = install(library)
    _show({"plugin": result.plugin, "library": str(library), "mujoco": result.mujoco, "sha256": result.sha256}, as_json)
    if not as_json:
        name = result.plugin.removeprefix("cmg_mj.")
        for other in manifests:
            if other is not None and other.plugin == result.plugin and other.sha256 != result.sha256:
                note(f"the library replaces the one from {other.source}, whose models no longer load")
        loads = "`import mujoco` loads it from now on" if is_called() else _NOT_CALLED
        note(f"installed: {loads}. Remove it: cmg-mj plugin --uninstall {name}")


def _uninstall(name: str, as_json: bool) -> None:
    from cmg_mj.codegen.engine_plugin.install import uninstall

    _show({"uninstalled": uninstall(name)}, as_json)


def _list(as_json: bool) -> None:
    from cmg_mj.codegen.engine_plugin.install import is_called, list_plugins

    folder, plugins = list_plugins()
    figures = [
        {
            "name": plugin.name,
            "mujoco": plugin.manifest and plugin.manifest.mujoco,
            "sha256": plugin.manifest and plugin.manifest.sha256,
            "source": plugin.manifest and plugin.manifest.source,
            "problem": plugin.problem or None,
        }
        for plugin in plugins
    ]
    lines = [
        f"{plugin.name}  "
        + (f"not loaded: {plugin.problem}" if plugin.problem else f"from {plugin.manifest and plugin.manifest.source}")
        for plugin in plugins
    ]
    place = folder or "CMG_MJ_PLUGINS is empty: no plugin is loaded"
    show({"folder": folder, "plugins": figures}, "\n".join([*(lines or ["no plugin is installed"]), place]), as_json)
    if plugins and not is_called():
        note(f"hint: {_NOT_CALLED}")


def _show(figures: dict[str, str], as_json: bool) -> None:
    width = max(map(len, figures)) + 1
    show(figures, "\n".join(f"{key:<{width}}{value}" for key, value in figures.items()), as_json)
