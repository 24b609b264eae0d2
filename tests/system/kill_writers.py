"""Kills processes that write results over one another, and looks at what they leave: a program for test_kills.py.

It forks, which pytest's own processes, with threads in them, had better not.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cmg_mj.results.folder import MARKER, RunFolder, is_complete, is_own

EVENTS = {"open", "os.mkdir", "os.rename", "os.remove", "os.rmdir", "shutil.rmtree"}
"""Events that change files, as Python's audit hooks name them."""
OLD, NEW = {"a": "old", "b": "old", "c": "old"}, {"b": "new", "c": "new", "d": "new"}


def run_in_a_fork(child: Callable[[], None]) -> int:
    """Run it in a process of its own; its exit code."""
    process = os.fork()
    if process == 0:
        try:
            child()
            os._exit(0)
        except BaseException as error:
            print(repr(error), file=sys.stderr, flush=True)
            os._exit(1)
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


def save(texts: dict[str, str]) -> None:
    with RunFolder(Path("it")) as folder:
        folder.write({name: lambda path, text=text: path.write_text(text) for name, text in texts.items()})


def read_files() -> dict[str, str]:
    """Read the files as a plain reader does."""
    return {file.name: file.read_text() for file in Path("it").glob("*") if file.name != MARKER}


def kill_at_every_event() -> None:
    """Kill before every single change of a file; a result is never in parts, and the next run finds it tidy."""
    Path("notes").write_text("mine")
    finished, kills, seen = False, 0, []
    while not finished:
        save(OLD)

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

        status = run_in_a_fork(save_and_die)
        assert status in (0, -signal.SIGKILL), status
        finished = status == 0
        seen.append(read_files())
        assert seen[-1] in (OLD, NEW, {}), (kills, seen[-1])
        with RunFolder(Path("it")):
            pass
        assert read_files() in (OLD, NEW), (kills, read_files())
        assert is_own(Path("it"))
        assert is_complete(Path("it"))
        assert sorted(os.listdir()) == ["it", "notes"], (kills, os.listdir())
        kills += 1
    assert all(files in seen for files in (OLD, NEW, {})), "some kills came before, between and after the renames"
    print(f"{kills - 1} kills")


if __name__ == "__main__":
    kill_at_every_event()
