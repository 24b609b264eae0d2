"""One BLAS thread a process; and for the tests that need it an empty folder, and Ctrl-C as at a terminal."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest_plugins = ["tests.tiers"]

# BLAS reads these once, when NumPy loads it. pytest imports this file before it starts its workers, which inherit them,
# as does every process that a test starts. As many threads as cores in each of them fight one another: a test of one
# second alone has taken 99.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty current folder; what a command adds to the places to import from is taken back."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Ctrl-C is heard, also where the tests were started with it ignored: by nohup, or in the background.

    Here and in processes started meanwhile, which would inherit "ignored", but have the default instead of a handler.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
