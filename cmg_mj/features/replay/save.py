"""Replay of several logs on request, as `cmg-mj replay` runs it, and the files that it writes."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import tomli_w

from cmg_mj.core.errors import InputError
from cmg_mj.features.replay.inputs import model_of, replay_prepared
from cmg_mj.features.replay.log import Log, ReadOptions
from cmg_mj.features.replay.log_replay import ReplayResult
from cmg_mj.features.replay.plot import plot_replay
from cmg_mj.features.replay.reading import check_distinct_logs, read_log
from cmg_mj.features.replay.report import log_figures, replay_figures
from cmg_mj.observers.parameter_options import Parameters
from cmg_mj.results.folder import RunFolder, claimed, write_text
from cmg_mj.results.summary_keys import finite
from cmg_mj.scenario.resolve import safe_name

SETTINGS = "replay.toml"


@dataclass
class LogReplays:
    """Request to replay some logs, and the replays that are done. The logs are read at once.

    Attributes:
        paths: The logs' files.
        observers: Names of the observers.
        options: Options with which all logs are read.
        model: The pendulum as `model_of` takes it.
        noises: Noises from `noise_numbers`.
        parameters: Observer -> parameter -> value, where not the default.
        settle_s: Time at the start of each part that is not scored [s]; None for `replay_prepared`'s.
        logs: The logs.
        names: Their names in file names.
        results: The replays that are done.
    """

    paths: Sequence[str]
    observers: Sequence[str]
    options: ReadOptions
    model: str | None = None
    noises: Mapping[str, float] = field(default_factory=dict)
    parameters: Parameters = field(default_factory=dict)
    settle_s: float | None = None

    def __post_init__(self) -> None:
        for kind in self.parameters:
            if kind not in self.observers:
                raise InputError(f"--set {kind}: is not among --observers {','.join(self.observers)}")
        self._model = None if self.model is None else model_of(self.model)
        check_distinct_logs(self.paths)
        self.logs: list[Log] = [read_log(path, self.options) for path in self.paths]
        self.names = distinct_names([log.name for log in self.logs])
        self.results: list[ReplayResult] = []

    def as_toml(self) -> str:
        """Return the request as TOML."""
        replay = {
            "observers": list(self.observers),
            "model": self.model,
            "parameters": self.parameters,
            "noise": self.noises,
            "settle_s": self.settle_s,
        }
        options = self.options.as_toml()
        return tomli_w.dumps(
            {
                "logs": list(self.paths),
                **({"log": options} if options else {}),
                "replay": {name: value for name, value in replay.items() if value not in (None, {})},
            }
        )

    @property
    def complete(self) -> bool:
        """Return whether all logs have been replayed."""
        return len(self.results) == len(self.logs)

    @property
    def folder_name(self) -> str:
        """Name of the folder of the files by default."""
        return f"replay-{self.names[0]}" + (f"-and-{len(self.logs) - 1}-more" if len(self.logs) > 1 else "")

    def run(self, on_progress: Callable[[float, str], None]) -> None:
        """Replay the logs.

        Args:
            on_progress: Called with the logs done so far, parts of one included, and the current one's name. It may
                raise `KeyboardInterrupt`; the results until then are kept.
        """
        for i, log in enumerate(self.logs):
            self.results.append(
                replay_prepared(
                    log,
                    self.observers,
                    model=self._model,
                    noises=self.noises,
                    parameters=self.parameters,
                    settle_s=self.settle_s,
                    on_share=lambda share, i=i, log=log: on_progress(i + share, f"Replay {log.name}"),
                )
            )

    def save(self, folder: RunFolder | Path) -> Path:
        """Write summary.json, replay.toml, recording.rrd, and of every log that is done its signals and plot, at once.

        Args:
            folder: The folder. Files in it that cmg_mj did not write stay.

        Returns:
            The folder of the files: the given one, or one in it (see `RunFolder.write`).

        Raises:
            InputError: The folder, or a file, cannot be written.
        """
        from cmg_mj.features.replay.recording import write_replay  # 0.4 s of import, needed only here

        names = self.names[: len(self.results)]
        writers: list[Callable[[Path], None]] = [
            lambda path: write_text(path, json.dumps(finite(replay_figures(self.results)), indent=2)),
            lambda path: write_text(path, self.as_toml()),
            lambda path: write_replay(path, self.results, names, self.as_toml()),
        ]
        for replayed in self.results:
            signals = replace(replayed.trajectory, metadata={"replay": finite(log_figures(replayed))})
            writers += [signals.save, lambda path, replayed=replayed: plot_replay(path, replayed)]
        with claimed(folder) as claim:
            return claim.write(dict(zip(files_of_replay(names), writers, strict=True)), complete=self.complete)


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
