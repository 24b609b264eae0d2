"""Arguments that several commands take, and their checks."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.core import ParameterSource

from cmg_mj.errors import InputError, nearest

if TYPE_CHECKING:
    from cmg_mj.results.result import Driver
    from cmg_mj.results.run_folder import RunFolder
    from cmg_mj.scenario.schema import Scenario
    from cmg_mj.simulation.experiment import Experiment


R = TypeVar("R")

MOST_WORLDS = 10_000
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

    def scenario(self, observer: str | None = None) -> Scenario:
        """Load the scenario and apply the options."""
        from cmg_mj.scenario.loading import load_scenario

        settings = [_as_utf8(setting) for setting in self.settings]
        scenario = load_scenario(self.name, settings, observer)
        return scenario if self.seed is None else scenario.model_copy(update={"seed": self.seed})

    def folder(
        self, label: str, names: Sequence[str], experiment: Experiment, driver: Driver = "native", world: int = 0
    ) -> RunFolder:
        """Claim the folder for files: --out, or one in runs/ named for the scenario, the label and the settings."""
        from cmg_mj.results.run_folder import unused_folder
        from cmg_mj.scenario.differences import folder_suffix, safe_name

        if self.out is not None:
            return claim_folder(output_path(self.out), names)
        label = safe_name(label) + ("-board" if driver == "board" else "")
        parts = (
            safe_name(Path(self.name).stem),
            label,
            str(experiment.scenario.seed),
            *([f"world{world}"] if world else []),
        )
        name = "-".join(parts) + folder_suffix(experiment.differences)
        return released_at_the_end(unused_folder(Path("runs"), name, names, experiment.as_toml(driver, world)))


def _as_utf8(argument: str) -> str:
    """Decode an argument as UTF-8, also where Python takes the terminal for one of ASCII."""
    try:
        return os.fsencode(argument).decode("utf-8")
    except UnicodeError:
        return argument


def run_options(command: Callable[..., R]) -> Callable[..., R]:
    """Add the arguments of every command that runs a scenario, which it takes as one `RunArguments`."""

    @functools.wraps(command)
    def with_arguments(
        scenario: str, settings: tuple[str, ...], seed: int | None, out: str | None, as_json: bool, **others: Any
    ) -> R:
        return command(RunArguments(scenario, settings, seed, out, as_json), **others)

    for decorate in reversed((click.argument("scenario"), with_settings, with_seed, with_out, with_json)):
        with_arguments = decorate(with_arguments)
    return with_arguments


with_settings = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="FIELD=VALUE",
    help="Set a field of the scenario, such as plant.initial_tilt_deg=2.0. May be given again.",
)
with_seed = click.option("--seed", type=click.IntRange(0, 2**128 - 1), metavar="N", help="Seed of the sensors' noise.")
with_out = click.option("--out", metavar="FOLDER", help="Folder to write to.  [default: a new one in runs/]")
with_json = click.option("--json", "as_json", is_flag=True, help="Print only the figures, as JSON, on standard output.")
with_observer = click.option(
    "--observer", metavar="NAME", help="Observer in the loop: a name, or your own as package.module:Class."
)
with_observers = click.option(
    "--observers",
    default="all",
    show_default=True,
    metavar="NAMES",
    help="Observers separated by commas, or all; your own as package.module:Class.",
)


def claim_folder(path: Path, names: Sequence[str] = ()) -> RunFolder:
    """Claim a folder for a command's files; no other may write to it until the command is done."""
    from cmg_mj.results.run_folder import RunFolder

    return released_at_the_end(RunFolder(path, names))


def released_at_the_end(folder: RunFolder) -> RunFolder:
    """Release a folder when the command is done; a new folder without files is removed then."""
    click.get_current_context().call_on_close(folder.release)
    return folder


def refuse_unused(names: Sequence[str], why: str) -> None:
    """Refuse options of the current command that are on the command line and would be ignored.

    Args:
        names: Names of the command's parameters.
        why: The purpose of these options, for the message.
    """
    context = click.get_current_context()
    for parameter in context.command.params:
        if parameter.name in names and context.get_parameter_source(parameter.name) == ParameterSource.COMMANDLINE:
            raise InputError(f"{max(parameter.opts, key=len)}: {why}")


def output_path(out: str) -> Path:
    """Return the folder that `--out` names."""
    if out == "":
        raise InputError("--out '': name a folder, . for the current one")
    return Path(out)


def names_of(observers: str) -> list[str]:
    """Parse observers separated by commas, or `all`; a repeated name counts once."""
    return list(dict.fromkeys(named_observers(observers)))


def named_observers(observers: str) -> list[str]:
    """Parse observers separated by commas, or `all`; repeated names stay."""
    from cmg_mj.observers import OBSERVERS

    names = list(OBSERVERS) if observers == "all" else [name.strip() for name in observers.split(",") if name.strip()]
    if not names:
        raise InputError(f"--observers {observers!r}: give names separated by commas, or all")
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
