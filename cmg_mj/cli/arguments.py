"""Arguments that several commands take, and what is made of them."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from cmg_mj.errors import InputError, nearest

if TYPE_CHECKING:
    from cmg_mj.results.result import Driver
    from cmg_mj.results.run_folder import RunFolder
    from cmg_mj.scenario.schema import Scenario
    from cmg_mj.simulation.experiment import Experiment


MOST_WORLDS = 10_000
"""One takes about 0.1 MB of memory."""


@dataclass(frozen=True)
class RunArguments:
    """What the arguments of every command that runs a scenario say.

    Attributes:
        name: The scenario, as the user named it.
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

    def scenario(self, observer: str | None = None) -> Scenario:
        """The scenario with what the options change."""
        from cmg_mj.scenario.loading import load_scenario

        settings = [_letters(setting) for setting in self.settings]
        scenario = load_scenario(self.name, settings, observer)
        return scenario if self.seed is None else scenario.model_copy(update={"seed": self.seed})

    def folder(
        self, what: str, names: Sequence[str], experiment: Experiment, driver: Driver = "native", world: int = 0
    ) -> RunFolder:
        """The folder to write these files to: without --out it is named for what is run and what differs in it."""
        from cmg_mj.results.run_folder import unused_folder
        from cmg_mj.scenario.differences import folder_suffix, safe_name

        if self.out is not None:
            return claim_folder(output_path(self.out), names)
        what = safe_name(what) + ("-board" if driver == "board" else "")
        parts = (
            safe_name(Path(self.name).stem),
            what,
            str(experiment.scenario.seed),
            *([f"world{world}"] if world else []),
        )
        name = "-".join(parts) + folder_suffix(experiment.differences)
        return released_at_the_end(unused_folder(Path("runs"), name, names, experiment.as_toml(driver, world)))


def _letters(argument: str) -> str:
    """The letters that were typed, also where Python takes a terminal for one of ASCII."""
    try:
        return os.fsencode(argument).decode("utf-8")
    except UnicodeError:
        return argument


def run_options(command: Callable, *, required: bool = True) -> Callable:
    """Arguments of every command that runs a scenario, which it takes as one `RunArguments`.

    Args:
        command: The command.
        required: Whether a scenario must be named.

    Returns:
        The command.
    """

    @functools.wraps(command)
    def with_arguments(
        scenario: str | None, settings: tuple, seed: int | None, out: str | None, as_json: bool, **others: Any
    ) -> Any:
        return command(RunArguments(scenario or "", settings, seed, out, as_json), **others)

    for decorate in reversed(
        (
            click.argument("scenario", required=required),
            click.option(
                "--set",
                "settings",
                multiple=True,
                metavar="FIELD=VALUE",
                help="Replace a field of the scenario, such as plant.initial_tilt_deg=2.0; may be given again.",
            ),
            click.option("--seed", type=click.IntRange(0, 2**128 - 1), metavar="N", help="Seed of the sensors' noise."),
            click.option("--out", metavar="FOLDER", help="Folder to write to; by default one in runs/."),
            click.option(
                "--json", "as_json", is_flag=True, help="Print the summary alone, as JSON, on standard output."
            ),
        )
    ):
        with_arguments = decorate(with_arguments)
    return with_arguments


of_observers = click.option(
    "--observers",
    default="all",
    show_default=True,
    metavar="NAMES",
    help="Names with commas between, or all; your own as package.module:Class.",
)


def claim_folder(path: Path, names: Sequence[str] = ()) -> RunFolder:
    """The folder for what a command writes: no other may write to it until the command is done."""
    from cmg_mj.results.run_folder import RunFolder

    return released_at_the_end(RunFolder(path, names))


def released_at_the_end(folder: RunFolder) -> RunFolder:
    """The same, until the command is done; a folder it has made and has written nothing to goes with it."""
    click.get_current_context().call_on_close(folder.release)
    return folder


def refuse_given(names: Sequence[str], why: str) -> None:
    """Refuse options of the command at hand that were given and would be ignored.

    Args:
        names: Its parameters' names.
        why: What they are for.
    """
    context = click.get_current_context()
    for parameter in context.command.params:
        if parameter.name in names and context.get_parameter_source(parameter.name) == ParameterSource.COMMANDLINE:
            raise InputError(f"{max(parameter.opts, key=len)}: {why}")


def output_path(out: str) -> Path:
    """The folder that `--out` names."""
    if out == "":
        raise InputError("--out '': name a folder, . for the current one")
    return Path(out)


def names_of(observers: str) -> list[str]:
    """Observers with commas between, or all of them; one that is named again counts once."""
    return list(dict.fromkeys(named_observers(observers)))


def named_observers(observers: str) -> list[str]:
    """Observers with commas between, or all of them, as they are named."""
    from cmg_mj.observers import OBSERVERS

    names = list(OBSERVERS) if observers == "all" else [name.strip() for name in observers.split(",") if name.strip()]
    if not names:
        raise InputError(f"--observers {observers!r}: give names with commas between, or all")
    for name in names:
        check_observer("--observers", name)
    return names


def check_observer(option: str, name: str) -> None:
    """Refuse an observer that does not exist."""
    from cmg_mj.observers import OBSERVERS

    if ":" not in name and name not in OBSERVERS:
        raise InputError(
            f"{option} {name!r}: no such observer; {nearest(name, OBSERVERS)}, or your own as package.module:Class"
        )
