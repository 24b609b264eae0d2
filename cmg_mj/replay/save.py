"""The files that a replay writes."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from cmg_mj.replay.log_replay import ReplayResult
from cmg_mj.replay.plot import plot_replay
from cmg_mj.replay.report import log_figures, replay_figures
from cmg_mj.results.folder import RunFolder, claimed, write_text
from cmg_mj.results.summary_keys import finite
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.scenario.differences import safe_name

SETTINGS = "replay.toml"


def distinct_names(names: Sequence[str]) -> list[str]:
    """Return logs' names as parts of file names, the repeated ones numbered."""
    distinct: list[str] = []
    for name in map(safe_name, names):
        number, candidate = 1, name
        while candidate.casefold() in [other.casefold() for other in distinct]:
            number += 1
            candidate = f"{name}-{number}"
        distinct.append(candidate)
    return distinct


def files_of_replay(names: Sequence[str]) -> list[str]:
    """Return the names of the files of a replay of some logs."""
    files = ["summary.json", SETTINGS, "recording.rrd"]
    for suffix in [""] if len(names) == 1 else [f"-{name}" for name in names]:
        files += [f"signals{suffix}.parquet", f"plot{suffix}.png"]
    return files


def save_replay(
    folder: RunFolder | Path,
    replays: Sequence[ReplayResult],
    names: Sequence[str],
    settings_toml: str,
    *,
    complete: bool = True,
) -> Path:
    """Write summary.json, replay.toml, recording.rrd, and of every log signals.parquet and plot.png, all at once.

    Args:
        folder: The folder. Files in it that cmg_mj did not write stay.
        replays: The replays.
        names: The logs' names, from `distinct_names`.
        settings_toml: The request, as TOML.
        complete: Whether these are all logs that were requested.

    Returns:
        The folder of the files: the given one, or one in it (see `RunFolder.write`).

    Raises:
        InputError: The folder, or a file, cannot be written.
    """
    from cmg_mj.replay.recording import write_replay  # 0.4 s of import, needed only here

    writers: list[Callable[[Path], None]] = [
        lambda path: write_text(path, json.dumps(finite(replay_figures(replays)), indent=2)),
        lambda path: write_text(path, settings_toml),
        lambda path: write_replay(path, replays, names, settings_toml),
    ]
    for replayed in replays:
        writers += [signals(replayed).save, lambda path, replayed=replayed: plot_replay(path, replayed)]
    with claimed(folder) as claim:
        return claim.write(dict(zip(files_of_replay(names), writers, strict=True)), complete=complete)


def signals(replayed: ReplayResult) -> Trajectory:
    """Return all signals and estimates of a log as one table, with the log's figures as metadata."""
    return replace(replayed.trajectory, metadata={"replay": finite(log_figures(replayed))})
