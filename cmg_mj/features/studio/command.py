"""The command that opens a scenario in MuJoCo Studio."""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

import click

from cmg_mj.cli.arguments import RunArguments, observer_option, seed_option, settings_option
from cmg_mj.cli.terminal import note_hints, users_code
from cmg_mj.core.errors import InputError

if TYPE_CHECKING:
    from cmg_mj.runs.experiment import Experiment

VIEWERS = ("web", "native", "opengl", "opengl_software", "vulkan", "vulkan_software")


@click.command()
@click.argument("scenario")
@observer_option()
@settings_option()
@seed_option()
@click.option(
    "--viewer",
    type=click.Choice(VIEWERS),
    default="web",
    show_default=True,
    help="web serves a browser on this machine only; the others open a window and need Python 3.12 or newer.",
)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    metavar="N",
    help="Port of the web view.  [default: the first free one from 8080 on]",
)
@click.option("--browser", is_flag=True, help="Open the web view in a browser.")
@users_code()
def studio(
    scenario: str,
    observer: str | None,
    settings: tuple[str, ...],
    seed: int | None,
    viewer: str,
    port: int,
    browser: bool,
) -> None:
    """Open SCENARIO in MuJoCo Studio with its controller running. Close the viewer or press Ctrl-C to end.

    Without user actions the trajectory equals that of cmg-mj run. A panel pushes the plant, switches the observer and
    the feedback, and sets the bias and the accelerometers' noise (docs/studio.md).
    """
    from cmg_mj.runs.experiment import prepare

    arguments = RunArguments(scenario, settings, seed, None, False)

    def prepare_now(model: str) -> Experiment:
        """Prepare the scenario from its current file, with another plant if one was dropped on the viewer."""
        if not model:
            return prepare(arguments.scenario(observer))
        return prepare(arguments.scenario(observer)).with_settings({"plant.model": model})

    first = prepare_now("")
    note_hints(first.hints)
    if importlib.util.find_spec("mujoco.studio") is None:
        raise InputError("this MuJoCo comes without Studio: install the wheel from PyPI, python -m pip install mujoco")
    from cmg_mj.features.studio.open import open_in_studio

    open_in_studio(prepare_now, first.scenario.title or scenario, viewer, port, browser)
