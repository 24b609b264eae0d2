"""The head of a run's scenario.toml: how to run it again to the same numbers, where that needs options."""

from __future__ import annotations


def rerun_head(driver: str, world: int) -> str:
    """Write the head as comments; empty where the scenario alone gives the same run.

    Args:
        driver: Who calls the controller, or is it.
        world: Number of the world.
    """
    why, command = "", "cmg-mj run scenario.toml"
    if driver == "board":
        why += "Run on the emulated board (docs/board.md), whose numbers are not quite the host's. "
        command += " --driver board"
    if world:
        why += f"World {world}: its noise is not that of world 0. "
        command += f" --world {world}"
    return f"# {why}To the same numbers it runs with\n#     {command}\n\n" if why else ""
