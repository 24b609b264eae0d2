"""Generates a controller's C: traces the formulas, compares them with Python, prints them, compares the C."""

from __future__ import annotations

import copy
import shlex
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from cmg_mj.core.axis import AxisControl
from cmg_mj.core.errors import InputError, raised, shown
from cmg_mj.core.types import reads_gyro
from cmg_mj.features.export import check
from cmg_mj.features.export.c_code import Precision
from cmg_mj.features.export.c_files import CodePrinter, format_example, format_test_vector
from cmg_mj.features.export.compiler import find_compiler
from cmg_mj.features.export.constants import Constants, class_path, constants_of
from cmg_mj.features.export.names import name_of
from cmg_mj.features.export.trace import LawNotExportable, Traced, trace
from cmg_mj.results.folder import write_text
from cmg_mj.stages.notch import Notch
from cmg_mj.stages.trim import Trim


class Code(NamedTuple):
    """A controller as C, compared with Python.

    Attributes:
        files: Name -> text.
        figures: Its sizes and differences from Python, as `--json` prints them.
    """

    files: dict[str, str]
    figures: dict[str, Any]


def generate_code(controller: AxisControl, precision: Precision, name: str | None = None) -> Code:
    """Generate a controller's C and compare it with Python; see `export`."""
    require_exportable(controller)
    with _named(controller):
        return _generate(controller, precision, name_of(controller.observer, name))


def require_traceable(controller: AxisControl) -> None:
    """Refuse an observer or a law that no formula expresses; all else of the controller is left out.

    Raises:
        InputError: It is none.
    """
    trims = tuple(stage for stage in controller.memories if isinstance(stage, Trim))
    with _named(controller):
        _traced(replace(controller, commands=(), memories=trims))


@contextmanager
def _named(controller: AxisControl) -> Iterator[None]:
    """Name the observer or the law in an error."""
    try:
        yield
    except LawNotExportable as error:
        raise InputError(f"law {type(controller.law).__name__}: cannot be exported: {error}") from error
    except InputError as error:
        raise InputError(f"{class_path(controller.observer)} cannot be exported: {error}") from error


def require_exportable(controller: AxisControl) -> None:
    """Refuse what C does not have; an option that it misses otherwise, the comparison with Python finds.

    Raises:
        InputError: Something in use cannot be exported; the message names it.
    """
    if controller.feedback != "observer":
        raise InputError(
            f"controller.feedback = {shown(controller.feedback)}: cannot be exported: C has the observer's rate alone; "
            "set controller.feedback=observer"
        )
    for stage in (*controller.commands, *controller.memories):
        if isinstance(stage, Notch):
            raise InputError("controller.notch_hz: cannot be exported: C has no notch; set controller.notch_hz=0.0")
        if not isinstance(stage, Trim):
            raise InputError(f"{type(stage).__name__}: cannot be exported: C has no such stage")


def _copied(part: Any, refusal: type[InputError]) -> Any:
    try:
        return copy.deepcopy(part)
    except Exception as error:  # a user's observer or law may hold anything
        raise refusal(f"it cannot be copied: {raised(error)}") from error


def _traced(controller: AxisControl) -> tuple[Traced, Constants, float]:
    """Trace a controller; return the formulas, their constants, and their difference from Python."""
    for_trace, law_for_trace = _copied(controller.observer, InputError), _copied(controller.law, LawNotExportable)
    constants = constants_of(controller)
    traced = trace(for_trace, law_for_trace, constants)
    return traced, constants, check.check_trace(controller, traced, constants, seeds=(1, 2, 3))


def _generate(controller: AxisControl, precision: Precision, name: str) -> Code:
    traced, constants, off = _traced(controller)
    printer = CodePrinter(controller, traced, constants, precision, name)
    samples = check.signals(controller, 0, precision)
    expected = check.in_python(controller, samples)
    allowed = check.allowed(controller, samples, expected, precision)
    gyro = reads_gyro(controller.observer)
    vector = format_test_vector(name, precision, samples.tolist(), expected.tolist(), allowed.tolist(), gyro)
    files = {
        f"{name}.h": printer.header(),
        f"{name}.c": printer.source(),
        f"{name}_example.c": format_example(name, precision, check.columns(controller), gyro),
        f"{name}_test_vector.h": vector,
    }
    compiler = find_compiler()
    figures: dict[str, Any] = {
        "observer": name,
        "precision": precision,
        "files": list(files),
        "numbers_in_state": len(traced.state),
        "operations": {
            "measure": traced.measure.operations(),
            "step": traced.step.operations(),
            "law": traced.law.step.operations(),
        },
        "trace_off_by": off,
        "compiler": None if compiler is None else shlex.join(compiler),
        "c_off_by": None,
        "beyond_rounding": [],
    }
    if compiler is not None:
        with tempfile.TemporaryDirectory() as temporary:
            for file, text in files.items():
                write_text(Path(temporary, file), text)
            off_by = figures["c_off_by"] = check.check_c(Path(temporary), name, compiler)
        bounds = zip(check.columns(controller), check.rounded(controller, expected, precision), strict=True)
        figures["beyond_rounding"] = [name for name, bound in bounds if off_by[name] > bound]
    return Code(files, figures)


def export_table(figures: Mapping[str, Any]) -> str:
    """Print the figures of an export as text."""
    operations = figures["operations"]
    lines = [
        f"{figures['observer']}, {figures['precision']} precision",
        f"  numbers in the observer's state   {figures['numbers_in_state']}",
        f"  operations an update              {sum(operations.values())}, of them the observer {operations['step']}",
        f"  formulas, off from Python by      {_difference(figures['trace_off_by'])}",
    ]
    if figures["c_off_by"] is not None:
        lines.append(f"  C, off from Python, by {figures['compiler']}:")
        width = max(map(len, figures["c_off_by"]))
        lines += [f"    {name:<{width}}  {_difference(off)}" for name, off in figures["c_off_by"].items()]
    return "\n".join(lines)


def _difference(size: float) -> str:
    return f"{size:.2g}" if size else "0 (bit for bit)"
