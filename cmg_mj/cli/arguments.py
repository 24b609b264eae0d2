"""Arguments that several commands take, and their checks.

`@..._option()` adds one option to a command, `@..._options` several.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cmg_mj.core.errors import InputError, nearest

if TYPE_CHECKING:
    from cmg_mj.results.folder import RunFolder
    from cmg_mj.runs.experiment import Experiment
    from cmg_mj.scenario.schema import Scenario


Command = Callable[..., None]
Decorator = Callable[[Command], Command]

OVERWRITE, RIG = "cmg_mj.overwrite", "cmg_mj.rig"
MAX_NUMBER = 2**63 - 1
"""Largest seed and number of a world, which tables of results can hold."""
MAX_WORLDS = 10_000
"""Most worlds of a batch; one takes about 0.1 MB of memory."""


@dataclass(frozen=True)
class RunArguments:
    """Arguments of every command that runs a scenario.

    Attributes:
        name: The scenario's name or file, as given.
        settings: `--set`, each FIELD=VALUE.
        seed: `--seed`.
        out: `--out`.
        as_json: `--json`.
    """

    name: str
    settings: tuple[str, ...]
    seed: int | None
    out: str | None
    as_json: bool

    def scenario(self, observer: str | None = None, fields: dict[str, Any] | None = None) -> Scenario:
        """Load the scenario, or take its fields, and apply the options."""
        from cmg_mj.scenario.loading import load_scenario

        scenario = load_scenario(self.name, self.settings, observer, fields)
        return scenario if self.seed is None else scenario.model_copy(update={"seed": self.seed})

    def folder(self, label: str, experiment: Experiment, driver: str = "native", world: int = 0) -> RunFolder:
        """Prepare the folder: --out, or one in runs/ named for the scenario, the label and the settings."""
        from cmg_mj.scenario.resolve import folder_suffix, safe_name

        how, which = "-board" if driver == "board" else "", f"-world{world}" if world else ""
        name = f"{safe_name(Path(self.name).stem)}-{safe_name(label)}{how}-{experiment.scenario.seed}{which}"
        return claim_output(self.out, name + folder_suffix(experiment.differences))


def run_options(command: Command) -> Command:
    """Add the arguments of every command that runs a scenario, which it takes as one `RunArguments`."""

    @functools.wraps(command)
    def with_arguments(scenario: str, **given: Any) -> None:
        own = {name: given.pop(name) for name in ("settings", "seed", "out", "as_json")}
        command(RunArguments(scenario, **own), **given)

    options = all_of(click.argument("scenario"), settings_option(), seed_option(), out_option(), json_option())
    return options(with_arguments)


def all_of(*decorators: Decorator) -> Decorator:
    """Make one decorator of several; `--help` lists their options in this order."""

    def decorate(command: Command) -> Command:
        for decorator in reversed(decorators):
            command = decorator(command)
        return command

    return decorate


def settings_option(help: str = "Set a field of the scenario, such as plant.initial_tilt_deg=2.0.") -> Decorator:
    """Make the option `--set` of a scenario, and `--rig`, whose settings go before."""

    def join(context: click.Context, parameter: click.Parameter, settings: tuple[str, ...]) -> tuple[str, ...]:
        return (*context.meta.get(RIG, ()), *settings)

    def read(context: click.Context, parameter: click.Parameter, path: str | None) -> None:
        if path is not None:
            from cmg_mj.scenario.rig_file import load_rig

            fields = load_rig(path).settings(f"--rig {path}")
            context.meta[RIG] = [f"{field}={value}" for field, value in fields.items()]

    rig = click.option(
        "--rig",
        metavar="FILE",
        is_eager=True,
        expose_value=False,
        callback=read,
        help="Settings of a rig file, as identify writes it: its accelerometers and its pendulum.",
    )
    return all_of(assignments_option(help, "FIELD=VALUE", callback=join), rig)


def assignments_option(help: str, metavar: str, **choice: Any) -> Decorator:
    """Make the option `--set`."""
    return click.option(
        "--set", "settings", multiple=True, metavar=metavar, help=f"{help} May be given again.", **choice
    )


def worlds_option(help: str, default: int | None = None, range: tuple[int, int] = (1, MAX_WORLDS)) -> Decorator:
    """Make the option `--worlds`."""
    return click.option(
        "--worlds", type=click.IntRange(*range), default=default, show_default=True, metavar="N", help=help
    )


def observer_option(role: str = "in the loop", **choice: Any) -> Decorator:
    """Make the option `--observer`, with a `default` or `required`; it refuses an observer that does not exist."""
    return click.option(
        "--observer",
        metavar="NAME",
        show_default=True,
        callback=lambda context, parameter, name: None if name is None else check_observer("--observer", name),
        help=f"Observer {role}: a name, or your own as package.module:Class.",
        **choice,
    )


def observers_option(otherwise: str = "", *, baselines: bool = False) -> Decorator:
    """Make the option `--observers`, whose value is a list of names.

    Args:
        otherwise: The default in words, for the value None; without them it is all observers.
        baselines: Whether baselines that give a rate, such as `zero`, may be named too; the command then checks names.
    """

    def parse(context: click.Context, parameter: click.Parameter, text: str | None) -> list[str] | None:
        from cmg_mj.observers import OBSERVERS

        if text is None:
            return None
        names = list(OBSERVERS) if text == "all" else names_in(text)
        if not names:
            raise InputError(f"--observers {text!r}: give names separated by commas, or all")
        return names if baselines else list(dict.fromkeys(check_observer("--observers", name) for name in names))

    default = f"  [default: {otherwise}]" if otherwise else ""
    more = "; baselines: zero, mems_as_bought, mems_gyro" if baselines else ""
    return click.option(
        "--observers",
        default=None if otherwise else "all",
        show_default=True,
        metavar="NAMES",
        callback=parse,
        help=f"Observers separated by commas, or all; your own as package.module:Class{more}.{default}",
    )


def export_options(command: Command) -> Command:
    """Add the arguments of every command that writes a scenario's controller as C."""
    options = all_of(
        click.argument("observer", callback=lambda context, parameter, name: check_observer("OBSERVER", name)),
        click.option(
            "--scenario",
            default="push_recovery",
            show_default=True,
            metavar="NAME",
            help="Scenario that gives the plant, the sensors, the gains and the rates.",
        ),
        settings_option("Set a field of the scenario, such as observer.k1=25 or controller.rate_hz=400."),
    )
    return options(command)


def seed_option() -> Decorator:
    """Make the option `--seed`."""
    return click.option("--seed", type=click.IntRange(0, MAX_NUMBER), metavar="N", help="Seed of the sensors' noise.")


def out_option() -> Decorator:
    """Make the options `--out` and `--overwrite`; `claim_output` reads the second one."""

    def keep(context: click.Context, parameter: click.Parameter, overwrite: bool) -> None:
        context.meta[OVERWRITE] = overwrite

    return all_of(
        click.option("--out", metavar="FOLDER", help="Folder to write to.  [default: a folder in runs/]"),
        click.option(
            "--overwrite",
            is_flag=True,
            expose_value=False,
            callback=keep,
            help="Replace another result there, if cmg-mj wrote all of it; otherwise FOLDER-2 is taken.",
        ),
    )


def json_option() -> Decorator:
    """Make the option `--json`, which a command takes as `as_json`."""
    return click.option("--json", "as_json", is_flag=True, help="Print only the figures, as JSON, on standard output.")


def markdown_option() -> Decorator:
    """Make the option `--markdown`."""
    return click.option("--markdown", is_flag=True, help="Print the tables as Markdown.")


def claim_output(out: str | None, default: str) -> RunFolder:
    """Prepare the folder that `--out` names, or by default one in runs/.

    Args:
        out: `--out`.
        default: Name of the folder in runs/.

    Returns:
        The folder; a new one without files is removed when the command ends.
    """
    from cmg_mj.results.folder import RunFolder

    folder = RunFolder(output_path(out, default), overwrite=overwrites())
    click.get_current_context().call_on_close(folder.release)
    return folder


def output_path(out: str | None, default: str) -> Path:
    """Return the folder that `--out` names, or by default one in runs/."""
    if out == "":
        raise InputError("--out '': name a folder")
    return Path("runs") / default if out is None else Path(out)


def overwrites() -> bool:
    """Return whether `--overwrite` is given."""
    return click.get_current_context().meta[OVERWRITE]


def names_in(text: str) -> list[str]:
    """Parse names separated by commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


def check_observer(option: str, name: str) -> str:
    """Refuse an observer that does not exist, or return its name."""
    from cmg_mj.observers import OBSERVERS

    if ":" not in name and name not in OBSERVERS:
        raise InputError(
            f"{option} {name!r}: no such observer; {nearest(name, OBSERVERS)}, or your own as package.module:Class"
        )
    return name
