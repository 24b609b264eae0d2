"""Kills processes that write results over one another, and looks at what they leave: a program for test_kills.py.

It forks, which pytest's own processes, with threads in them, had better not.
"""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cmg_mj.results.run_folder import RunFolder, swap, written_names
from cmg_mj.results.run_folder.manifest import HIDDEN

EVENTS = {"open", "os.link", "os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.chmod", "os.utime"}
"""Events that change files, as Python's audit hooks name them."""

written_names.NAMES = (*written_names.NAMES, "[a-d]")  # as if cmg_mj wrote files of these names
OLD, NEW = {"a": "old", "b": "old", "c": "old"}, {"b": "new", "c": "new", "d": "new"}


def fork(child: Callable[[], None]) -> int:
    """Run it in a process of its own; the process."""
    process = os.fork()
    if process == 0:
        try:
            child()
            os._exit(0)
        except BaseException as error:
            print(repr(error), file=sys.stderr, flush=True)
            os._exit(1)
    return process


def wait_for(process: int) -> int:
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


def save(texts: dict[str, str], complete: bool = True) -> None:
    with RunFolder(Path("it")) as folder:
        writers = {name: lambda path, text=text: path.write_text(text) and None for name, text in texts.items()}
        folder.write(writers, complete=complete)


def read_files() -> dict[str, str]:
    """Read the files as a plain reader does."""
    return {file.name: file.read_text() for file in Path("it").iterdir() if file.is_file()}


def kill_at_every_event(swap_folders: bool) -> None:
    """Kill before every single change of a file; a result is never in parts, and the next run finds it tidy.

    Args:
        swap_folders: Folders change names; otherwise files are moved, and the next run finishes what is begun then.
    """
    if not swap_folders:
        swap._swap_folders = lambda new, folder, lock: False
    user_file = {"notes": "mine"}
    finished, kills, times_new = False, 0, 0
    while not finished:
        save(OLD)
        Path("it/notes").write_text("mine")

        def save_and_die(n_events: int = kills) -> None:
            n_remaining = n_events

            def hook(event: str, arguments: tuple[Any, ...]) -> None:
                nonlocal n_remaining
                if event in EVENTS:
                    if n_remaining == 0:
                        os.kill(os.getpid(), signal.SIGKILL)
                    n_remaining -= 1

            sys.addaudithook(hook)
            save(NEW)

        status = wait_for(fork(save_and_die))
        assert status in (0, -signal.SIGKILL), status
        finished = status == 0
        if swap_folders:
            assert read_files() in (OLD | user_file, NEW | user_file), (kills, read_files())
        times_new += read_files() == NEW | user_file
        with RunFolder(Path("it")):
            pass
        assert read_files() in (OLD | user_file, NEW | user_file), (kills, read_files())
        left = sorted(str(file) for file in Path().rglob("*"))
        assert left == sorted(
            ["it", f"it/{HIDDEN}", f"it/{HIDDEN}/files.json", *(f"it/{name}" for name in read_files())]
        ), left
        kills += 1
    assert kills - 1 > times_new > 1, "some kills came before the new result was there, and some after"
    print(f"{kills - 1} kills")


def kill_at_random(times: int) -> None:
    """Kill whole runs being saved over one another: every file is of one and the same run."""
    from cmg_mj import parse_scenario, prepare
    from cmg_mj.studies import save as runs

    results = []
    for seed in (1, 2):
        experiment = prepare(parse_scenario({"duration_s": 0.05, "seed": seed}))
        results.append((experiment, experiment.run()))
    runs.save_run(Path("it"), runs.report_run(*results[0]))
    Path("it/notes").write_text("mine")

    def save_for_ever() -> None:
        while True:
            for experiment, result in results:
                runs.save_run(Path("it"), runs.report_run(experiment, result))

    chance = random.Random(8)
    seeds = []
    for _ in range(times):
        process = fork(save_for_ever)
        time.sleep(chance.uniform(0.05, 0.4))
        os.kill(process, signal.SIGKILL)
        assert wait_for(process) == -signal.SIGKILL
        seeds.append(wait_for(fork(lambda: os._exit(10 + seed_of(Path("it"))))) - 10)
        assert seeds[-1] in (1, 2), seeds
        assert (Path("it") / "notes").read_text() == "mine"
    runs.save_run(Path("it"), runs.report_run(*results[0]))
    assert os.listdir() == ["it"], os.listdir()
    assert os.listdir(f"it/{HIDDEN}") == ["files.json"]
    print(f"{times} kills, seeds {seeds}")


def seed_of(folder: Path) -> int:
    """The seed of a run, which all its files agree on."""
    from cmg_mj.results.trajectory import Trajectory
    from tests.run_folders import recorded_scenario

    (seed,) = {
        tomllib.loads((folder / "scenario.toml").read_text())["seed"],
        json.loads((folder / "summary.json").read_text())["seed"],
        Trajectory.load(folder / "trajectory.parquet").metadata["scenario"]["seed"],
        tomllib.loads(recorded_scenario(folder))["seed"],
    }
    return seed


if __name__ == "__main__":
    {
        "whole": lambda: kill_at_every_event(True),
        "moved": lambda: kill_at_every_event(False),
        "random": lambda: kill_at_random(20),
    }[sys.argv[1]]()
