"""What a replay writes."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from cmg_mj.replay.log_replay import ReplayResult
from cmg_mj.replay.plot import plot_replay
from cmg_mj.replay.report import figures_of
from cmg_mj.results.run_folder import RunFolder, claimed, write_text
from cmg_mj.results.summary_keys import finite
from cmg_mj.results.trajectory import ESTIMATES, Layout, Trajectory
from cmg_mj.scenario.differences import safe_name

SETTINGS = "replay.toml"


def distinct(names: Sequence[str]) -> list[str]:
    """Logs' names as parts of file names, no two alike: a number behind those that have come before."""
    found: list[str] = []
    for name in map(safe_name, names):
        number, wanted = 1, name
        while wanted.casefold() in [one.casefold() for one in found]:
            number += 1
            wanted = f"{name}-{number}"
        found.append(wanted)
    return found


def files_of_replay(names: Sequence[str]) -> list[str]:
    """Names of what a replay of these logs writes."""
    each = (
        [("signals.parquet", "plot.png")]
        if len(names) == 1
        else [(f"signals-{name}.parquet", f"plot-{name}.png") for name in names]
    )
    return ["summary.json", SETTINGS, "recording.rrd", *(file for files in each for file in files)]


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
        folder: Where. What is there and was not written by cmg_mj stays.
        replays: What to write.
        names: The logs' names, from `distinct`.
        settings_toml: What was asked for.
        complete: Whether these are all logs that were to be replayed.

    Returns:
        Where they are: the folder, or one in it (see `RunFolder.write`).

    Raises:
        InputError: The folder, or a file, cannot be written.
    """
    writers: list[Any] = [
        lambda path: write_text(path, json.dumps(finite(figures_of(replays)), indent=2)),
        lambda path: write_text(path, settings_toml),
        lambda path: _record(path, replays, names, settings_toml),
    ]
    for replayed in replays:
        writers += [signals(replayed).save, lambda path, replayed=replayed: plot_replay(path, replayed)]
    with claimed(folder) as it:
        return it.write(dict(zip(files_of_replay(names), writers, strict=True)), complete=complete)


def signals(replayed: ReplayResult) -> Trajectory:
    """All signals and estimates of a log as one table, evenly sampled, in SI and radians."""
    log = replayed.log
    kept = [name for name in log.columns if np.isfinite(log[name]).any()]
    names = tuple(replayed.estimates)
    extra = tuple(tuple(name for name in replayed.estimates[kind] if name not in ESTIMATES) for kind in names)
    columns = {name: np.ascontiguousarray(log[name]) for name in kept}
    for kind in names:
        columns |= {f"estimate/{kind}/{name}": values for name, values in replayed.estimates[kind].items()}
    metadata = {"replay": finite(figures_of([replayed])["logs"][0])}
    return Trajectory(columns, metadata, Layout(names, extra))


def settings_of(paths: Sequence[str], replay: Mapping[str, Any], read: Mapping[str, Any]) -> str:
    """What was asked for, as TOML: the logs, how they were read, and with what they were replayed."""
    return tomli_w.dumps({"logs": list(paths), **({"log": dict(read)} if read else {}), "replay": dict(replay)})


def _record(path: Path, replays: Sequence[ReplayResult], names: Sequence[str], settings_toml: str) -> None:
    from cmg_mj.replay.recording import write_replay  # 0.4 s of import, needed only here

    write_replay(path, replays, names, settings_toml)
