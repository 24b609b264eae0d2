"""The features, a row each: what joins them to the rest. Without its folder and its row the rest runs on."""

from __future__ import annotations

import functools
import pkgutil
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple


class Command(NamedTuple):
    """A command of `cmg-mj`, imported when it runs."""

    entry: str
    """`module:function`."""
    help: str
    """Its line in `cmg-mj --help`."""


class Judgement(NamedTuple):
    """A feature's words on a scenario."""

    rows: Sequence[tuple[str, str]] = ()
    """Rows of `cmg-mj check`: label, text."""
    hints: Sequence[str] = ()
    """Clauses on what is no mistake and yet likely to make the plant fall."""


class Feature(NamedTuple):
    """A folder that can be removed. An entry is `module:name`, imported when it is asked for: see `entries`."""

    section: str = ""
    """Settings that a scenario has under the feature's name, a `Section`."""
    is_list: bool = False
    """Whether there may be several: `[[name]]`."""
    check: str = ""
    """Refuses what does not fit: (scenario, plant)."""
    edit: str = ""
    """Changes a parsed model: (spec, model as resolved, plant settings, section) -> finish(compiled model)."""
    disturbance: str = ""
    """Makes what acts from outside: (sections, plants, seed, worlds) -> Disturbance."""
    between: str = ""
    """Makes the stage between the axes: (section, plant, controls of the axes) -> AxesStage, or None."""
    judge: str = ""
    """Says what `cmg-mj check` prints of it: (design, plant) -> Judgement."""
    commands: Mapping[str, Command] = {}
    driver: str = ""
    """What `run --driver NAME` calls, `module:function`: (experiment, world, **options) -> Result."""
    needs: tuple[str, ...] = ()
    """Features without which it does not run."""


FEATURES = {
    "bend": Feature(
        section="cmg_mj.features.bend:Bend",
        edit="cmg_mj.features.bend.edit:bend_frame",
        judge="cmg_mj.features.bend.verdict:describe_bend",
    ),
    "gait": Feature(
        section="cmg_mj.features.gait:Gait",
        edit="cmg_mj.features.gait.tiles:lay_tiles",
        check="cmg_mj.features.gait.walk:check_gait",
        disturbance="cmg_mj.features.gait.tiles:tiled_floor",
        between="cmg_mj.features.gait.walk:walking",
        judge="cmg_mj.features.gait.walk:describe_gait",
    ),
    "pivot": Feature(
        section="cmg_mj.features.pivot:Pivot",
        is_list=True,
        check="cmg_mj.features.pivot.moving_pivot:check_pivots",
        disturbance="cmg_mj.features.pivot.moving_pivot:moving_pivot",
        judge="cmg_mj.features.pivot.moving_pivot:describe_pivots",
    ),
    "track": Feature(
        section="cmg_mj.features.track:Track",
        is_list=True,
        check="cmg_mj.features.track.motion:check_tracks",
        disturbance="cmg_mj.features.track.motion:track_motion",
    ),
    "studio": Feature(
        commands={
            "studio": Command(
                "cmg_mj.features.studio.command:studio", "Open a scenario in MuJoCo Studio with its controller running."
            )
        },
    ),
    "sweeps": Feature(
        commands={
            "sweep": Command(
                "cmg_mj.features.sweeps.command:sweep", "Run a scenario with varied fields, observers and noise."
            )
        }
    ),
    "papers": Feature(
        commands={
            "reproduce": Command(
                "cmg_mj.papers.command:reproduce", "Reproduce the four papers, claim by claim, with verdicts."
            )
        },
        needs=("replay", "tuning"),
    ),
    "tuning": Feature(
        commands={
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
        commands={
            "replay": Command("cmg_mj.features.replay.command:replay", "Replay your own log through every observer.")
        }
    ),
    "identify": Feature(
        commands={
            "identify": Command(
                "cmg_mj.features.identify.command:identify",
                "Find places and errors of a rig's sensors from a log.",
            )
        },
        needs=("replay",),
    ),
    "export": Feature(
        commands={
            "export": Command(
                "cmg_mj.features.export.command:export", "Write an observer and the control law around it as C code."
            )
        }
    ),
    "board": Feature(driver="cmg_mj.features.board.processor:run_on_a_board", needs=("export",)),
    "plugin": Feature(
        commands={
            "plugin": Command(
                "cmg_mj.features.plugin.command:plugin", "Compile the controller into MuJoCo: a library, and a model."
            )
        },
        driver="cmg_mj.features.plugin.make:run_with_plugin",
        needs=("export",),
    ),
    "mounting": Feature(
        commands={
            "mount": Command(
                "cmg_mj.features.mounting.command:mount", "Mount a scissored pair on your own robot, with a scenario."
            )
        },
        needs=("plugin",),
    ),
}
"""Name of the folder -> its row."""

COMMANDS = {name: command for feature in FEATURES.values() for name, command in feature.commands.items()}
"""Command -> its row, in the order of `cmg-mj --help`."""
DRIVERS = {name: feature.driver for name, feature in FEATURES.items() if feature.driver}
"""Driver of `run` -> its function."""


@functools.cache
def entries(kind: str) -> dict[str, Any]:
    """Import what the features have of a kind, such as `section`: name of the feature -> the class or function."""
    return {name: pkgutil.resolve_name(entry) for name, row in FEATURES.items() if (entry := getattr(row, kind))}
