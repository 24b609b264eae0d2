"""The features, a row each: what joins them to the rest. Without its folder and its row the rest runs on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Command(NamedTuple):
    """A command of `cmg-mj`, imported when it runs."""

    entry: str
    """`module:function`."""
    help: str
    """Its line in `cmg-mj --help`."""


class Feature(NamedTuple):
    """A folder that can be removed."""

    commands: Mapping[str, Command] = {}
    driver: str = ""
    """What `run --driver NAME` calls, `module:function`: (experiment, world, **options) -> Result."""
    needs: tuple[str, ...] = ()
    """Features without which it does not run."""


FEATURES = {
    "studio": Feature(
        {
            "studio": Command(
                "cmg_mj.features.studio.command:studio", "Open a scenario in MuJoCo Studio with its controller running."
            )
        }
    ),
    "sweeps": Feature(
        {
            "sweep": Command(
                "cmg_mj.features.sweeps.command:sweep", "Run a scenario with varied fields, observers and noise."
            )
        }
    ),
    "papers": Feature(
        {
            "reproduce": Command(
                "cmg_mj.papers.command:reproduce", "Reproduce the four papers, claim by claim, with verdicts."
            )
        },
        needs=("replay", "tuning"),
    ),
    "tuning": Feature(
        {
            "tune": Command(
                "cmg_mj.features.tuning.command:tune", "Fit an observer's parameters to the gyro of a scenario."
            ),
            "tune-log": Command(
                "cmg_mj.features.tuning.command:tune_log",
                "Fit an observer's parameters to the reference of your own logs.",
            ),
        },
        needs=("replay",),
    ),
    "replay": Feature(
        {"replay": Command("cmg_mj.features.replay.command:replay", "Replay your own log through every observer.")}
    ),
    "export": Feature(
        {
            "export": Command(
                "cmg_mj.features.export.command:export", "Write an observer and the control law around it as C code."
            )
        }
    ),
    "board": Feature(driver="cmg_mj.features.board.processor:run_on_a_board", needs=("export",)),
    "plugin": Feature(
        {
            "plugin": Command(
                "cmg_mj.features.plugin.command:plugin", "Compile the controller into MuJoCo: a library, and a model."
            )
        },
        driver="cmg_mj.features.plugin.make:run_with_plugin",
        needs=("export",),
    ),
    "mounting": Feature(
        {
            "mount": Command(
                "cmg_mj.features.mounting.command:mount", "Mount a scissored pair on your own robot, with a scenario."
            )
        },
        needs=("plugin", "tuning"),
    ),
}
"""Name of the folder -> its row."""

COMMANDS = {name: command for feature in FEATURES.values() for name, command in feature.commands.items()}
"""Command -> its row, in the order of `cmg-mj --help`."""
DRIVERS = {name: feature.driver for name, feature in FEATURES.items() if feature.driver}
"""Driver of `run` -> its function."""
