"""Makes an engine plugin of MuJoCo from a scenario."""

from __future__ import annotations

from pathlib import Path

from cmg_mj.results.folder import RunFolder
from cmg_mj.scenario.schema import Scenario
from cmg_mj.simulation.experiment import Experiment, prepare
from cmg_mj.simulation.plugin_files import (
    Plugin,
    Start,
    check_tools,
    make_plugin,
    require_stable_periods,
    write_plugin_or_sources,
)


def plugin(
    scenario: Scenario | Experiment,
    out: Path | RunFolder,
    *,
    name: str | None = None,
    sensors: bool = True,
    start: Start = "keyframe",
) -> Plugin:
    """Make an engine plugin of MuJoCo: wherever MuJoCo loads its model, the robot balances.

    Args:
        scenario: The scenario, or one that has been prepared.
        out: Folder to write to; made if need be.
        name: The plugin's name behind `cmg_mj.`; by default the observer's.
        sensors: Whether the model has sensors that show estimate, command and the rest.
        start: `keyframe`: a program sets the flywheels' rates, as the keyframe `start` does; `spinning`: the plugin
            does, for programs that reset to qpos0.

    Returns:
        What was written.

    Raises:
        InputError: Something in use cannot be exported, the control period is too long, CasADi is missing, or the
            folder holds files of the user's that would be overwritten. Without a compiler, all but the library is
            written.
    """
    check_tools()
    experiment = scenario if isinstance(scenario, Experiment) else prepare(scenario)
    require_stable_periods(experiment)
    return write_plugin_or_sources(make_plugin(experiment, name, sensors=sensors, start=start), out)
