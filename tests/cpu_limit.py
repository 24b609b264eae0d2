"""`--cpu-limit SECONDS`: a test of the daily tier that takes more processor time fails.

Counted is the processor time of this process and of the children it has waited for, from a test's set-up to its
teardown. Wall time is not: other work on the machine lengthens it. What the machine is slower by than the one where
the limit was set is measured at once when a test is over the limit, and the limit raised by as much. A moment's rush on
a busy machine is not seen by that: a test that is over fails if it is so again in a process of its own.

Libraries that code imports when it first needs them are imported before the first test, and a figure is drawn: the
first test of a worker would pay for what any test would.
"""

from __future__ import annotations

import gc
import importlib
import io
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Generator
from importlib.util import find_spec

import numpy as np
import pytest

from tests.command import HANGS_AFTER_S
from tests.tiers import tier

REFERENCE_S = 0.0125
"""Processor time of `calibration_loop` where the limit was set."""
IMPORTED_LATE = (
    "scipy.signal",
    "scipy.stats",
    "scipy.optimize",
    "scipy.integrate",
    "matplotlib.pyplot",
    "matplotlib.backends.backend_agg",
    "rerun.blueprint",
    "pyarrow.parquet",
    "casadi",
    "distributed",
    "gymnasium",
    "control",
    "mujoco.studio",
)


def processor_seconds() -> float:
    """Processor time of this process and of its children that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def calibration_loop() -> float:
    """Return the processor time of work such as most tests do: Python's own, and NumPy's on a few numbers.

    It takes no memory from the system: how long that takes differs by a factor of three from one moment to the next,
    where a test's time differs by a third.
    """
    start = time.process_time()
    matrix, vector = np.eye(3), np.ones(3)
    for _ in range(6000):
        vector = matrix @ vector * 0.999 + 0.001
        float(vector[0])
    return time.process_time() - start


def slowness() -> float:
    """How many times longer than the reference's this machine takes now; at least 1."""
    return max(1.0, statistics.median(calibration_loop() for _ in range(15)) / REFERENCE_S)


def warm_up() -> None:
    """Import what tests would import late, and draw: matplotlib reads its fonts when it first writes a word."""
    for name in IMPORTED_LATE:
        if find_spec(name.partition(".")[0]) and find_spec(name):
            importlib.import_module(name)
    from matplotlib.figure import Figure

    figure = Figure(layout="constrained")
    figure.add_subplot(title="word", xlabel="$x_1$")
    figure.savefig(io.BytesIO(), format="png")
    gc.collect()
    gc.freeze()  # what is there by now stays: no test pays for the garbage collector to look through it


ALONE = "CMG_MJ_ALONE"
"""Set in the environment of the second try, which is the last."""


OVER = "of processor time with its set-up and its children"
"""Part of the message that a test is over the limit."""


def failure_alone(item: pytest.Item, limit: float) -> str:
    """Run a test that was over the limit again, in a process of its own; return how it failed there, or nothing."""
    command = [sys.executable, "-m", "pytest", "-n", "0", "-p", "no:cacheprovider", f"--cpu-limit={limit}", item.nodeid]
    environment = {**os.environ, ALONE: "1", "PYTEST_ADDOPTS": ""}
    environment.pop("PYTEST_XDIST_WORKER", None)
    try:
        process = subprocess.run(
            command,
            cwd=item.config.rootpath,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=HANGS_AFTER_S,
        )
    except subprocess.TimeoutExpired:
        return f"in a process of its own it has not ended after {HANGS_AFTER_S:g} s"
    if process.returncode == 0:
        return ""
    is_over = OVER in process.stdout and "\nFAILED " not in process.stdout
    reason = "is over the limit again" if is_over else f"fails otherwise, with exit status {process.returncode}"
    return f"in a process of its own it {reason}:\n{process.stdout[-2000:]}"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option."""
    parser.addoption("--cpu-limit", type=float, metavar="SECONDS", help="most processor time of a daily test")


def pytest_configure(config: pytest.Config) -> None:
    """Measure only if it is asked for."""
    limit = config.getoption("--cpu-limit")
    if limit is not None:
        config.pluginmanager.register(CpuLimit(limit))


class CpuLimit:
    """Measures every test of the daily tier.

    Attributes:
        limit: Processor time [s].
        start: When the current test began [s of processor time].
    """

    def __init__(self, limit: float) -> None:
        self.limit, self.start = limit, 0.0

    def pytest_collection_finish(self) -> None:
        """Let no test pay for what the first of them would do for all."""
        warm_up()

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self) -> Generator[None, object, object]:
        """Note the beginning, before the set-up."""
        self.start = processor_seconds()
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Fail at the teardown a test that took too long."""
        report = yield
        if call.when == "teardown" and report.passed and tier(item) == "daily":
            used = processor_seconds() - self.start
            if used > self.limit:
                slower = slowness()
                if used <= self.limit * slower:
                    return report
                is_last = ALONE in os.environ
                failure = "" if is_last else failure_alone(item, self.limit)
                if is_last or failure:
                    report.outcome = "failed"
                    report.longrepr = (
                        f"{item.nodeid}: {used:.2f} s {OVER}, on a machine "
                        f"{slower:.2f} times slower than the reference's; a test without the mark `slow` may take "
                        f"{self.limit:g} s: shorten it, share what it makes, or mark it\n{failure}"
                    )
        return report
