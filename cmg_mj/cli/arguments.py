"""Arguments that several commands take, and what is made of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cmg_mj.errors import InputError, nearest

if TYPE_CHECKING:
    from cmg_mj.experiment import Experiment
    from cmg_mj.schema import Scenario


def of_a_run(command: Callable) -> Callable:
    """Arguments of every command that runs a scenario."""
    for decorate in reversed(
        (
            click.argument("scenario"),
            click.option(
                "--set",
                "settings",
                multiple=True,
                metavar="FIELD=VALUE",
                help="Replace a field of the scenario, such as plant.initial_tilt_deg=2.0; may be given again.",
            ),
            click.option("--seed", type=click.IntRange(min=0), metavar="N", help="Seed of the sensors' noise."),
            click.option("--out", metavar="FOLDER", help="Folder to write to; by default one in runs/."),
            click.option(
                "--json", "as_json", is_flag=True, help="Print the summary alone, as JSON, on standard output."
            ),
        )
    ):
        command = decorate(command)
    return command


of_observers = click.option(
    "--observers",
    default="all",
    show_default=True,
    metavar="NAMES",
    help="Names with commas between, or all; your own as package.module:Class.",
)


def scenario_of(name: str, settings: Sequence[str], seed: int | None, observer: str | None) -> Scenario:
    """The scenario with what the options change."""
    from cmg_mj.scenario import load_scenario

    scenario = load_scenario(name, settings, observer)
    return scenario if seed is None else scenario.model_copy(update={"seed": seed})


def folder_of(out: str | None, default: str, experiment: Experiment) -> Path:
    """The folder to write to."""
    from cmg_mj.runs import output_folder, unused_folder

    if out == "":
        raise InputError("--out '': name a folder, . for the current one")
    return output_folder(unused_folder(Path("runs"), default, experiment) if out is None else Path(out))


def names_of(observers: str) -> list[str]:
    """Observers with commas between, or all of them; no name twice."""
    from cmg_mj.observers import OBSERVERS

    names = list(OBSERVERS) if observers == "all" else [name.strip() for name in observers.split(",") if name.strip()]
    if not names:
        raise InputError(f"--observers {observers!r}: give names with commas between, or all")
    for name in names:
        check_observer("--observers", name)
    return list(dict.fromkeys(names))


def check_observer(option: str, name: str) -> None:
    """Refuse an observer that does not exist."""
    from cmg_mj.observers import OBSERVERS

    if ":" not in name and name not in OBSERVERS:
        raise InputError(
            f"{option} {name!r}: no such observer; {nearest(name, OBSERVERS)}, or your own as package.module:Class"
        )
