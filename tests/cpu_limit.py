"""`--cpu-limit SECONDS`: a test of the daily tier that takes more processor time fails.

Counted is the processor time of this process and of the children it has waited for, from a test's set-up to its
teardown. Wall time is not: other work on the machine lengthens it. What the machine is slower by than the one where
the limit was set is measured at once when a test is over the limit, and the limit raised by as much.

The same test takes up to half as much again from one run to the next (`NOISE`), which is added to the limit. Libraries
that code imports when it first needs them are imported before the first test, so that no test pays for them.
"""

from __future__ import annotations

import gc
import importlib
import os
import statistics
import time
from collections.abc import Generator
from importlib.util import find_spec

import numpy as np
import pytest

from tests.tiers import tier

REFERENCE_S = 0.023
"""Processor time of `calibration_loop` where the limit was set (idle)."""
NOISE = 1.5
"""By so much more than the limit a test takes now and then, whose code is as fast as ever."""
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
    """Return the processor time of work such as the tests do: arrays and many small objects, which caches do not hold.

    Other work on the machine slows these down by more than it does a loop over a few numbers.
    """
    start = time.process_time()
    array = np.arange(400_000, dtype=float)
    for _ in range(6):
        array = array * 0.999 + 1.0
    table = {i * 7919 % 40_009: (i, float(i)) for i in range(40_000)}
    sum(table[i][1] for i in range(40_000) if i in table)
    return time.process_time() - start


def slowness() -> float:
    """Return the ratio of this machine's time to the reference's, at least 1."""
    return max(1.0, statistics.median(calibration_loop() for _ in range(7)) / REFERENCE_S)


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
        """Import what tests would import late."""
        for name in IMPORTED_LATE:
            if find_spec(name.partition(".")[0]) and find_spec(name):
                importlib.import_module(name)
        gc.collect()

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
            seconds = processor_seconds() - self.start
            if seconds > NOISE * self.limit and seconds > NOISE * self.limit * (slower := slowness()):
                report.outcome = "failed"
                report.longrepr = (
                    f"{item.nodeid}: {seconds:.2f} s of processor time with its set-up and its children, on a machine "
                    f"{slower:.2f} times slower than the reference's; a test without the mark `slow` may take "
                    f"{self.limit:g} s: shorten it, share what it makes, or mark it"
                )
        return report
