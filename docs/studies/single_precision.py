"""The exported C in single precision beside Python, on the same signals: how far apart, and which is nearer the truth.

    python docs/studies/single_precision.py [--observers NAMES] [--worlds 100] (about half a minute)

It needs a C compiler.

push_recovery, the loop closed on the true rate, so that all observers are shown the same. RMS differences of an
observer's rate: of the C; of Python itself, shown y1, y2, acceleration and u rounded to floats once; of Python, shown
them moved by the last digit of a double, up or down. Then the means of its RMS error over the worlds, Python's with
their 95 % interval, and whether that of the C lies within.
"""

from __future__ import annotations

import argparse
import ctypes
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from cmg_mj import load_scenario, prepare
from cmg_mj.core.errors import InputError
from cmg_mj.features.export import export
from cmg_mj.features.export.check import FLAGS
from cmg_mj.features.export.compiler import find_compiler
from cmg_mj.observers import OBSERVERS, Measurement
from cmg_mj.results.intervals import mean_interval
from cmg_mj.results.tables import markdown_table

SIGNALS = ("y1_rad", "y2_rad", "acceleration_rad_s2", "u_rad_s")
HEADINGS = ["observer", "C, off by [rad/s]", "rounded once", "last digit", "error [rad/s]: Python", "C", "within"]


def in_python(observer: str, signals: np.ndarray) -> np.ndarray:
    """Rates by Python in double precision, (ticks, worlds), from signals (4, ticks, worlds)."""
    own = prepare(load_scenario("push_recovery", [], observer)).design.observer()
    y1, y2, acceleration, u = signals
    state, rates = own.init(Measurement(y1[0], y2[0], acceleration[0])), [np.zeros_like(y1[0])]
    for k in range(1, len(y1)):
        state, estimate = own.step(state, Measurement(y1[k], y2[k], acceleration[k]), u[k - 1])
        rates.append(estimate[1])
    return np.array(rates)


def in_c(observer: str, signals: np.ndarray) -> np.ndarray:
    """The same by the exported C in single precision."""
    compile_with = find_compiler()
    if compile_with is None:
        raise InputError("no C compiler was found (CC, cc, gcc, clang)")
    controller = prepare(load_scenario("push_recovery", [], observer)).axis_controller()
    rates = np.zeros(signals.shape[1:])
    with TemporaryDirectory() as folder:
        source = export(controller, Path(folder), precision="single")[1]
        library = source.with_suffix(".so")
        subprocess.run([*compile_with, *FLAGS, "-shared", "-fPIC", source, "-o", library, "-lm"], check=True)
        code = ctypes.CDLL(str(library))
        init, step = getattr(code, f"{observer}_init"), getattr(code, f"{observer}_step")
        init.argtypes = [ctypes.c_char_p, *[ctypes.c_float] * 3]
        step.argtypes = [ctypes.c_char_p, *[ctypes.c_float] * 4, ctypes.c_void_p]
        state, estimate = ctypes.create_string_buffer(1024), (ctypes.c_float * 16)()
        for world in range(signals.shape[2]):
            y1, y2, acceleration, u = signals[:, :, world].tolist()
            init(state, y1[0], y2[0], acceleration[0])
            for k in range(1, len(y1)):
                step(state, y1[k], y2[k], acceleration[k], u[k - 1], estimate)
                rates[k, world] = estimate[1]
    return rates


def row(observer: str, signals: np.ndarray, truth: np.ndarray) -> list[str]:
    """An observer's row of the table."""
    python, c = in_python(observer, signals), in_c(observer, signals)
    once = in_python(observer, signals.astype(np.float32).astype(float))
    ends = np.where(np.random.default_rng(0).random(signals.shape) < 0.5, -np.inf, np.inf)
    last_digit = in_python(observer, np.nextafter(signals, ends))
    apart = [f"{np.sqrt(np.mean((other - python) ** 2)):.1e}" for other in (c, once, last_digit)]
    errors = [np.sqrt(np.mean((rate - truth) ** 2, axis=0)) for rate in (python, c)]
    interval, of_c = mean_interval(errors[0]), errors[1].mean()
    within = "yes" if interval.low <= of_c <= interval.high else "NO"
    return [observer, *apart, f"{interval.mean:.5f} +- {interval.half:.5f}", f"{of_c:.5f}", within]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--observers", default=",".join(OBSERVERS))
    parser.add_argument("--worlds", type=int, default=100)
    of = parser.parse_args()
    result = prepare(load_scenario("push_recovery", ["controller.feedback=truth"])).run_many(of.worlds)
    assert result.trajectory is not None
    signals = np.array([result.trajectory[name] for name in SIGNALS])
    truth = result.trajectory["x2_rad_s"]
    print(markdown_table(HEADINGS, [row(name, signals, truth) for name in of.observers.split(",")]))


if __name__ == "__main__":
    main()
