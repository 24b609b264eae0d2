"""The head of a run's scenario.toml: how to run it again to the same numbers, where that needs options."""

from __future__ import annotations

import shlex

from cmg_mj.results.result import Driver
from cmg_mj.results.wire import WireSettings


def rerun_head(driver: Driver, world: int, wire: WireSettings | None = None) -> str:
    """Write the head as comments; empty where the scenario alone gives the same run.

    Args:
        driver: Who calls the controller, or is it.
        world: Number of the world.
        wire: Settings of the wire to a real board, if one decides.
    """
    why, command = "", "cmg-mj run scenario.toml"
    if wire is not None:
        why += f"Run on a board at {_printable(wire.port)} (docs/board.md), where ticks may be lost. "
        command += f" --driver board {_printable(shlex.join(wire.options()))}"
    elif driver == "board":
        why += "Run on the emulated board (docs/board.md), whose numbers are not quite the host's. "
        command += " --driver board"
    if world:
        why += f"World {world}: its noise is not that of world 0. "
        command += f" --world {world}"
    return f"# {why}To the same numbers it runs with\n#     {command}\n\n" if why else ""


def _printable(text: str) -> str:
    """Return a text that stays on its line of a comment."""
    return "".join(character if character.isprintable() else "?" for character in text)
