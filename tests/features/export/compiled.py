"""An export compiled, and driven from here; and what the sensors of a closed loop have shown."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj import load_scenario, prepare
from cmg_mj.core.axis import AxisControl
from cmg_mj.core.controller import Controller
from cmg_mj.features.export import export

COMPILER = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler is installed")

WARNINGS = ("-Wall", "-Wextra", "-pedantic", "-Wdouble-promotion", "-Wconversion", "-Wsign-conversion", "-Wshadow")
STRICT = ("-std=c99", *WARNINGS, "-Werror", "-O2", "-ffp-contract=off")
TYPES = {"double": np.float64, "single": np.float32}


def compile_c(*arguments: object) -> None:
    assert COMPILER is not None
    subprocess.run([COMPILER, *STRICT, *map(str, arguments)], check=True, timeout=300)


def read_by_every_compiler(*sources: Path) -> None:
    """Without a warning; nothing is compiled."""
    for compiler in filter(None, map(shutil.which, ("gcc", "clang"))):
        subprocess.run([compiler, *STRICT, "-fsyntax-only", *map(str, sources)], check=True, timeout=300)


def controller(kind: str, *settings: str) -> Controller:
    return prepare(load_scenario("push_recovery", settings, kind)).axis_controller()


def control(kind: str, *settings: str) -> AxisControl:
    return controller(kind, *settings).axes[0]


class Compiled:
    """An export as a shared library, compiled without a warning, and what its example says."""

    def __init__(self, kind: str, precision: Any, folder: Path, *settings: str) -> None:
        self.type = TYPES[precision]
        loop = controller(kind, *settings)
        (axis,) = loop.axes
        files = export(loop, folder, precision=precision)
        self.name = files[0].stem
        self.width = 3 + len(axis.extra_signals[0])
        self.gyro_at = 4 + len(axis.plant.gimbal_angle.zeros) if axis.reads_gyro else None
        self.header, self.source, self.example, _ = files
        read_by_every_compiler(self.source, self.example)
        self.library = folder / "export.so"
        compile_c("-shared", "-fPIC", self.source, "-o", self.library, "-lm")
        compile_c(self.source, self.example, "-o", folder / "example", "-lm")
        self.output = subprocess.run([folder / "example"], capture_output=True, text=True, check=False).stdout
        self._loaded = ctypes.CDLL(str(self.library))
        self._controller = np.full(1024, np.nan, self.type)  # memory that nobody has cleared

    def run(self, samples: np.ndarray) -> np.ndarray:
        """Call `update` with raw samples, (n, 4 + gimbals + gyros); return estimates and u, (n, 4 + extra signals)."""
        statuses, results = self.statuses(samples)
        assert not statuses.any()
        return results

    def statuses(self, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """`start`, then `update` with raw samples, (n, 4 + gimbals); what it returns (n,), and the results as `run`."""
        self._call("start", self._controller)
        return self.go_on(samples)

    def go_on(self, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Call `update` with raw samples; as `statuses` without `start`."""
        samples = np.ascontiguousarray(samples, self.type)
        results = np.full((len(samples), self.width + 1), np.nan, self.type)
        statuses = [
            self._call("update", self._controller, sample[:4], sample[4:], *self._gyro(sample), result, result[-1:])
            for sample, result in zip(samples, results, strict=True)
        ]
        return np.array(statuses), results.astype(float)

    def _gyro(self, sample: np.ndarray) -> list[Any]:
        kind = {np.float64: ctypes.c_double, np.float32: ctypes.c_float}[self.type]
        return [] if self.gyro_at is None else [kind(sample[self.gyro_at])]

    def numbers(self, count: int) -> np.ndarray:
        """The controller's first numbers: the observer's state, x_e, u. Writing to them changes the controller."""
        return self._controller[:count]

    def _call(self, function: str, *arguments: Any) -> int:
        pointers = [x.ctypes.data_as(ctypes.c_void_p) if isinstance(x, np.ndarray) else x for x in arguments]
        return getattr(self._loaded, f"{self.name}_{function}")(*pointers)


class Recording:
    """A closed loop of push_recovery over 15 s, or until it fell.

    Attributes:
        samples: Raw accelerations, encoders and, if it is read, the gyro, (n, 4 + gimbals + gyros).
        results: The controller's estimates and u, (n, 4 + extra signals).
        rate: The true tilt rate [rad/s], (n,).
    """

    def __init__(self, kind: str, *settings: str) -> None:
        experiment = prepare(load_scenario("push_recovery", settings, kind))
        controller = experiment.axis_controller()
        (axis,) = controller.axes
        samples, results, rates = [], [], []

        def record_tick(_: float) -> None:
            state, tick = controller.state, controller.ticks[0]
            forces, encoders, _, gyro = axis.delivered(state.sampled[0], state.step or 0)
            samples.append([*forces, *encoders, *([gyro] if axis.reads_gyro else [])])
            results.append([*tick.estimates[0], tick.u])
            rates.append(state.readings.rate)

        experiment.simulate(experiment.plant, controller, on_progress=record_tick)
        self.samples, self.results, self.rate = np.array(samples), np.array(results), np.array(rates)


@cache
def record(kind: str, *settings: str) -> Recording:
    return Recording(kind, *settings)
