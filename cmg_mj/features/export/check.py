"""Compares the traced formulas, and the C, with Python on random signals."""

from __future__ import annotations

import copy
import math
import operator
import re
import shlex
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from cmg_mj.core.arrays import clip
from cmg_mj.core.axis import AxisControl, Delivered
from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.core.straight_line import PYTHON, compiled, print_operations
from cmg_mj.core.types import STATE_SIGNALS, reads_gyro
from cmg_mj.features.export.c_code import CALLS, Precision
from cmg_mj.features.export.compiler import build, run
from cmg_mj.features.export.constants import Constants
from cmg_mj.features.export.formula import Formula
from cmg_mj.features.export.trace import LawNotExportable, Traced, law_arguments
from cmg_mj.laws import StateFeedback
from cmg_mj.linear.slopes import law_slopes

TICKS = 400

SHARE = {"double": 1e-9, "single": 1e-4}
"""Share of its largest value by which a number may be off, besides the effect of one rounding of the inputs."""

ROUNDINGS = 4
"""Multiple of the effect of one rounding by which a number may be off."""

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")
GRAVITY = 9.81
GYRO_OFFSET = 0.35


def signals(controller: AxisControl, seed: int, precision: Precision) -> np.ndarray:
    """Simulate sensors of a restless rig: the tilt swings, the gimbals wander, both with noise; then all rest.

    Args:
        controller: The controller of the sensors.
        seed: Seed of the random numbers; odd seeds swing little.
        precision: Precision in which the numbers are exact.

    Returns:
        Raw accelerations [m/s^2], encoders [rad] and, if it is read, the gyro [rad/s], (TICKS, 4 + gimbals + 0 or 1).
    """
    rng = np.random.default_rng(seed)
    t = controller.law.dt * np.arange(TICKS)
    size, noise = (0.2, 0.05) if seed % 2 == 0 else (0.01, 0.002)
    w, phase = 2.0 * np.pi * rng.uniform(0.2, 1.5, 3), rng.uniform(0.0, 2.0 * np.pi, 3)
    swings = size / 3.0 * np.sin(np.outer(t, w) + phase)
    tilt, acceleration = swings.sum(axis=1), (-(w**2) * swings).sum(axis=1)
    x, z = -GRAVITY * np.sin(tilt), GRAVITY * np.cos(tilt)
    forces = controller.plant.tilt.forces(x, z, acceleration)
    gimbal = 5.0 * size * np.sin(w[0] * t)
    gimbals = zip(controller.plant.gimbal_angle.directions, controller.plant.gimbal_angle.zeros, strict=True)
    encoders = [zero + direction * gimbal + 1e-3 * rng.normal(size=TICKS) for direction, zero in gimbals]
    shown = [force + noise * rng.normal(size=TICKS) for force in forces] + encoders
    if reads_gyro(controller.observer):
        shown.append(GYRO_OFFSET + np.gradient(tilt, t) + 0.1 * noise * rng.normal(size=TICKS))
    samples = np.array(shown).T
    samples[-TICKS // 4 :] = samples[-TICKS // 4]  # equal readings, as a resolution makes them
    return samples.astype(np.float32).astype(float) if precision == "single" else samples


def in_python(controller: AxisControl, samples: np.ndarray) -> np.ndarray:
    """Compute the estimates and u by the controller, (n, 4 + extra signals)."""
    law, observer = copy.deepcopy((controller.law, controller.observer))
    fresh = replace(controller, observers=(observer,), law=law, feedback="observer")
    deciding = None
    rows, end = [], 4 + len(fresh.plant.gimbal_angle.zeros)
    for k, row in enumerate(samples.tolist()):
        delivered = Delivered(row[:4], row[4:end], 0.0, *row[end:])
        deciding, tick = fresh.decide(deciding, k * fresh.period, delivered, 0.0)
        deciding = deciding._replace(held=tick.u)
        rows.append([*tick.estimates[0], tick.u])
    return np.array(rows)


CALLED = (*CALLS, "divide")
"""NumPy's functions that are called where a formula is computed, because Python's own raise."""
OTHERWISE = {"divide": operator.truediv, **{name: getattr(np, name) for name in ("hypot", "floor", "ceil", "rint")}}
"""Functions that `math` rounds otherwise than math.h, or does not have."""
WORDS = {
    **PYTHON,
    **{name: f"{name}({{0}})" if getattr(np, name).nin == 1 else f"{name}({{0}}, {{1}})" for name in CALLED},
    "bitwise_and": PYTHON["logical_and"],
    "bitwise_or": PYTHON["logical_or"],
}
"""NumPy's function -> Python on floats, which rounds as C does."""


def as_in_c(name: str) -> Callable[..., float]:
    """Find what C computes by NumPy's name: NaN or infinity where Python raises."""
    in_numpy = getattr(np, name)
    function = OTHERWISE[name] if name in OTHERWISE else getattr(math, CALLS[name])

    def call(*arguments: float) -> float:
        try:
            return float(function(*arguments))
        except (ArithmeticError, ValueError):
            return float(in_numpy(*arguments))

    return call


def in_floats(formula: Formula) -> Callable[..., list[float]]:
    """Compile a formula as a function of floats."""
    texts, lines = print_operations(formula.tape, formula.outputs, WORDS)
    names = [formula.tape.operations[place].value for place in formula.inputs]
    results = ", ".join(f"float({texts[place]})" for place in formula.outputs)
    known = {"inf": math.inf, "nan": math.nan, **{name: as_in_c(name) for name in CALLED}}
    return compiled("formula", names, [*lines, f"return [{results}]"], known)


@np.errstate(all="ignore")
def in_formulas(controller: AxisControl, traced: Traced, constants: Constants, samples: np.ndarray) -> np.ndarray:
    """Compute the estimates and u by the traced formulas, in the order of the C, (n, 4 + extra signals).

    Raises:
        InputError: A number of the state is not finite.
        LawNotExportable: A number of the law's state is not finite.
    """
    law = traced.law
    measure, init, step, law_step = map(in_floats, (traced.measure, traced.init, traced.step, law.step))
    law_init = None if law.init is None else in_floats(law.init)
    of_measure, of_law = ([part.value for part in parts] for parts in (constants.of_measure, constants.of_law))
    limit = of_law[-1]
    extra = len(controller.extra_signals[0])
    n = len(traced.state)
    end = 4 + constants.gimbals
    law_state, law_constants = [*law.state, "x_e"][: law.numbers], of_law if law.is_state_feedback else []
    state, memory, rows, u = [0.0], [0.0], [], 0.0
    for k, row in enumerate(samples.tolist()):
        y = [*measure(*row[:end], *of_measure), *row[end:]]
        if k == 0:
            state, estimate = init(*y), [y[0], 0.0, y[1], *[0.0] * extra]
            memory = memory if law_init is None else law_init(*y[:3])
        else:
            result = step(*state, *y, u)
            state, estimate = result[:n], result[n:]
        if k < constants.trimmed:
            memory[-1] = constants.trim_gain.value * estimate[constants.trim_part]
        x1, x3 = (y[0], y[1]) if controller.angle_source == "measured" else (estimate[0], estimate[2])
        known = dict(zip(law_arguments(extra), [*y[:3], x1, estimate[1], x3, *estimate[3:], u], strict=True))
        u, *memory = law_step(*(known[name] for name in law.arguments), *memory, *law_constants)
        u = clip(u, -limit, limit)
        for refusal, names, numbers in ((InputError, traced.state, state), (LawNotExportable, law_state, memory)):
            for name, value in zip(names, numbers, strict=True):
                if not math.isfinite(value):  # and the estimate is: Python has gone on
                    where = f"({name}) at sample {k}, where the C stops"
                    raise refusal(f"its state holds {value} {where}: hold numbers that are finite")
        rows.append([*estimate, u])
    return np.array(rows)


def columns(controller: AxisControl) -> list[str]:
    """Name the compared columns: the parts of an estimate, and u."""
    return [*STATE_SIGNALS, *controller.extra_signals[0], "u_rad_s"]


def rounded(controller: AxisControl, expected: np.ndarray, precision: Precision) -> np.ndarray:
    """Return how far each column may be off by rounding, u also by that of the estimate, (4 + extra signals,)."""
    off = SHARE[precision] * np.abs(expected).max(axis=0)
    with suppress(InputError):  # a law without a slope
        slopes = np.abs(law_slopes(controller.law, len(controller.extra_signals[0])).D[0, 4:])
        if controller.angle_source == "measured":
            slopes[[0, 2]] = 0.0
        off[-1] += slopes @ off[:-1]
    return off


def allowed(controller: AxisControl, samples: np.ndarray, expected: np.ndarray, precision: Precision) -> np.ndarray:
    """Return how far each column may be off, by rounding and by its effect in the observer, (4 + extra signals,).

    An observer that switches may amplify little to much: rounding may move whatever a last digit of the inputs moves.
    """
    kind = np.float32 if precision == "single" else np.float64
    near = samples.astype(kind)
    ends = np.where(np.random.default_rng(0).random(samples.shape) < 0.5, -np.inf, np.inf).astype(kind)
    moved = np.abs(in_python(controller, np.nextafter(near, ends).astype(float)) - expected)
    return rounded(controller, expected, precision) + ROUNDINGS * moved.max(axis=0)


def check_trace(controller: AxisControl, traced: Traced, constants: Constants, seeds: Sequence[int]) -> float:
    """Compare the formulas with Python, in double precision.

    Returns:
        The largest difference.

    Raises:
        InputError: The formulas and Python differ by more than is allowed, or the state does not stay finite.
        LawNotExportable: The law is to blame for that.
    """
    largest = 0.0
    for seed in seeds:
        samples = signals(controller, seed, "double")
        try:
            expected = in_python(controller, samples)
        except RunStopped as error:
            fault = LawNotExportable if str(error).startswith("law ") else InputError
            raise fault(f"it cannot be compared on random signals: {error}") from error
        differs = in_python(controller, samples) != expected
        if differs.any():
            raise _refusal(controller, np.argwhere(differs)[0, 1])(
                "in Python it is not twice the same on the same signals, so that nothing can be compared"
            )
        off = np.abs(in_formulas(controller, traced, constants, samples) - expected)
        share = off / np.maximum(allowed(controller, samples, expected, "double"), np.finfo(float).tiny)
        if not np.all(share <= 1.0):
            tick, part = np.argwhere(~(share <= 1.0))[0]
            name = columns(controller)[part]
            raise _refusal(controller, part)(
                f"traced, it is not what Python runs: on random signals {name} is off by {off[tick, part]:.3g} at "
                f"sample {tick}. Does it look at the type of a number, or remember something outside of its state?"
            )
        largest = max(largest, float(off.max()))
    return largest


def _refusal(controller: AxisControl, part: int) -> type[InputError]:
    """Return the error for the first column that is off: u alone is the law's fault, unless that is (8)."""
    is_command = part == len(columns(controller)) - 1
    return LawNotExportable if is_command and type(controller.law) is not StateFeedback else InputError


def check_c(folder: Path, name: str, compiler: Sequence[str]) -> dict[str, float]:
    """Compile an export's example, which compares the C with the test vector, and run it.

    Args:
        folder: Folder of the files.
        name: Prefix of the files.
        compiler: Command of the compiler.

    Returns:
        Part of an estimate, or u -> its largest difference.

    Raises:
        InputError: The example does not compile, or the C differs from Python.
    """
    program = folder / f"{name}_example"
    sources = [str(folder / f"{name}.c"), str(folder / f"{name}_example.c")]
    build([*compiler, *FLAGS, *sources, "-o", str(program), "-lm"], f"the C compiler {shlex.join(compiler)}")
    process = run([str(program)], "the compiled example")
    program.unlink()
    if process.returncode:
        raise InputError(
            f"the C is not what Python runs: {'; '.join(process.stdout.splitlines())}. "
            "In single precision: do numbers cancel, as in a covariance that begins at 1 beside a variance of 1e-5? "
            "Begin smaller, or take --precision double"
        )
    differences = re.findall(r"^(\w+): off by at most (\S+),", process.stdout, re.MULTILINE)
    return {part: float(off) for part, off in differences}
