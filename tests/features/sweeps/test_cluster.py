"""`--cluster`: the same trials as in one process, whatever happens to the workers."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import pyarrow.parquet as pq
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.sweeps.cluster import compute_there, packed
from cmg_mj.scenario.resolve import versions
from tests.command import COMMAND, HANGS_AFTER_S, ROOT, CommandOutcome, cmg_mj, cmg_mj_process, environment
from tests.features.sweeps.synthetic_trials import BIAS, make_study

needs_distributed = pytest.mark.skipif(
    find_spec("distributed") is None,
    reason='distributed is not installed: python -m pip install "cmg_mj[cluster]"',
)
SWEEP = ["sweep", "push_recovery", "--vary", f"{BIAS}=0,1", "--set", "push=[]", "--set", "duration_s=0.5"]
DEAD_ADDRESS = "tcp://127.0.0.1:9"

KILLER = """
import os, pathlib, signal, time
from cmg_mj.observers.linear import LinearDifferentiator

class {name}(LinearDifferentiator):
    elementwise = True
    def step(self, state, y, u):
        {what}
        return super().step(state, y, u)
"""
KILL = "os.kill(os.getpid(), signal.SIGKILL)"
IN_A_TRIAL = "getattr(y.y1, 'ndim', 0) and pathlib.Path('cluster').exists()"
"""In a trial, of many worlds, and not when the observer is tried before it."""
KILLS_ITSELF = f"{IN_A_TRIAL} and {KILL}"


def sweep(cwd: Path, out: str, *arguments: str) -> CommandOutcome:
    return cmg_mj_process(*SWEEP, "--out", out, *arguments, cwd=cwd)


def told(err: str) -> list[str]:
    """The lines of a sweep but for those that come where it takes long: workers that start late, a line a minute."""
    slow = re.compile(r"cmg-mj: (--cluster \S+: no worker is there yet; waiting for one|\d+ of \d+ trials\b.*)")
    return [line for line in err.splitlines() if not slow.fullmatch(line)]


def living(group: int) -> list[str]:
    """The processes of a group, but for those that have ended and nobody has asked about."""
    process_list = subprocess.run(["ps", "-eo", "pgid=,stat=,args="], capture_output=True, text=True, check=True).stdout
    parts = [line.split(maxsplit=2) for line in process_list.splitlines()]
    return [args[0] for pgid, stat, *args in parts if int(pgid) == group and not stat.startswith("Z")]


def trials(folder: Path) -> list[dict]:
    return pq.read_table(folder / "trials.parquet").to_pylist()


@pytest.mark.slow
@needs_distributed
def test_two_workers_find_what_one_process_finds(tmp_path: Path) -> None:
    observers = ("--observers", "linear,gyro_free,homogeneous", "--worlds", "3")
    assert sweep(tmp_path, "one", *observers).status == 0
    said = sweep(tmp_path, "two", *observers, "--cluster", "local:2")
    assert said.status == 0, said
    assert told(said.err)[0].startswith("Written to two."), said
    assert (tmp_path / "two" / "trials.parquet").read_bytes() == (tmp_path / "one" / "trials.parquet").read_bytes()
    for chunk in (tmp_path / "one" / "chunks").iterdir():
        assert (tmp_path / "two" / "chunks" / chunk.name).read_bytes() == chunk.read_bytes()


@pytest.mark.slow
@needs_distributed
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL here")
def test_a_chunk_that_kills_three_workers_is_rows_with_a_reason_and_its_neighbours_are_not(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(KILLER.format(name="Always", what=KILLS_ITSELF))
    observers = ("--observers", "linear,mine:Always,gyro_free,homogeneous", "--worlds", "2")
    assert sweep(tmp_path, "one", *observers).status == 0
    (tmp_path / "cluster").touch()
    outcome = sweep(tmp_path, "two", *observers, "--cluster", "local:2")
    assert outcome.status == 0, outcome
    for alone, on_cluster in zip(trials(tmp_path / "one"), trials(tmp_path / "two"), strict=True):
        if alone["observer"] == "mine:Always":
            assert (on_cluster["outcome"], on_cluster["reason"]) == ("stopped", "its chunk has killed 3 workers")
        else:
            assert on_cluster == alone


@pytest.mark.slow
@needs_distributed
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="no process groups here")
@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_keeps_what_is_finished_and_leaves_no_process(tmp_path: Path) -> None:
    """To the workers too, as at a terminal."""
    arguments = [*SWEEP, "--set", "duration_s=8", "--worlds", "60", "--observers", "all", "--cluster", "local:2"]
    process = subprocess.Popen(
        [*COMMAND, *arguments, "--out", "out"],
        cwd=tmp_path,
        env=environment(),
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    chunks = tmp_path / "out" / "chunks"
    while process.poll() is None and not (chunks.exists() and any(chunks.glob("*.parquet"))):
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=HANGS_AFTER_S)
    assert process.returncode == 130, err
    (line,) = told(err)
    assert line == "cmg-mj: interrupted; finished trials are kept in out, and the same command resumes the sweep"
    kept = [path.name for path in chunks.iterdir()]
    assert kept
    assert all(name.endswith(".parquet") for name in kept)
    until = time.monotonic() + HANGS_AFTER_S
    while alive := living(process.pid):
        assert time.monotonic() < until, alive
        time.sleep(0.1)


@contextmanager
def cluster(folder: Path, worker: Path) -> Iterator[tuple[str, subprocess.Popen]]:
    """A scheduler on the loopback and one worker that is started elsewhere."""
    file = folder / "scheduler.json"
    quiet = {
        "stdout": subprocess.DEVNULL,
        "stderr": subprocess.DEVNULL,
        "env": environment(DASK_TEMPORARY_DIRECTORY=str(folder)),
    }

    def start(kind: str, at: Path, *options: str) -> subprocess.Popen:
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", "--host", "127.0.0.1", "--no-dashboard"]
        return subprocess.Popen([*command, *options, "--scheduler-file", str(file)], cwd=at, **quiet)

    scheduler = start("scheduler", ROOT, "--dashboard-address", "127.0.0.1:0", "--port", "0")
    worker_process = start("worker", worker, "--nthreads", "1", "--no-nanny")
    try:
        while not file.exists():
            time.sleep(0.05)
        yield json.loads(file.read_text())["address"], scheduler
    finally:
        for process in (worker_process, scheduler):
            process.kill()
            process.wait()


@pytest.mark.slow
@needs_distributed
def test_an_observer_that_a_worker_cannot_import_is_one_line(tmp_path: Path) -> None:
    sweep_folder, worker_folder = tmp_path / "here", tmp_path / "there"
    sweep_folder.mkdir()
    worker_folder.mkdir()
    (sweep_folder / "mine.py").write_text(KILLER.format(name="Mine", what="pass"))
    with cluster(tmp_path, worker_folder) as (address, scheduler):
        assert sweep(sweep_folder, "fine", "--cluster", address).status == 0
        outcome = sweep(sweep_folder, "out", "--observers", "mine:Mine", "--cluster", address)
        assert f"--cluster {address}: worker tcp://127.0.0.1:" in outcome.complaint
        assert "observer.kind = 'mine:Mine': cannot be imported: ModuleNotFoundError" in outcome.complaint
        scheduler.kill()
        scheduler.wait()
        assert "cannot be reached" in sweep(sweep_folder, "gone", "--cluster", address).complaint


@needs_distributed
def test_a_worker_of_another_version_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("distributed.get_worker", lambda: SimpleNamespace(address="tcp://there"))
    with pytest.raises(InputError, match=r"^worker tcp://there: mujoco \S+ there, 2\.0 here"):
        compute_there(packed(make_study({BIAS: "0"})), 0, {**versions(), "mujoco": "2.0"})


@pytest.mark.parametrize("dry", [[], ["--dry-run"]])
def test_without_distributed_it_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dry: list[str]) -> None:
    monkeypatch.setattr("cmg_mj.features.sweeps.cluster.find_spec", lambda name: None)
    outcome = cmg_mj(*SWEEP, "--out", str(tmp_path / "out"), "--cluster", DEAD_ADDRESS, *dry)
    assert outcome.complaint == '--cluster: distributed is not installed: python -m pip install "cmg_mj[cluster]"'
    assert not (tmp_path / "out").exists()
