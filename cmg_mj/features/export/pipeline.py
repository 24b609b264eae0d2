"""Generates a controller's C: traces the formulas, compares them with Python, prints them, compares the C."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import shlex
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, TypedDict, TypeVar

import numpy as np

from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError, TomlValue, raised, shown
from cmg_mj.core.types import Observer
from cmg_mj.features.export import check
from cmg_mj.features.export.c_code import Precision, operations
from cmg_mj.features.export.c_files import CodePrinter, LawPrinter, format_example, format_test_vector
from cmg_mj.features.export.constants import constants_of
from cmg_mj.features.export.names import export_files, name_of
from cmg_mj.features.export.symbol import LawNotExportable
from cmg_mj.features.export.trace import trace
from cmg_mj.laws import Law, StateFeedback
from cmg_mj.results.folder import write_text
from cmg_mj.stages.trim import Trim

Part = TypeVar("Part", Observer, Law)


class Figures(TypedDict):
    """The sizes of an export and its differences from Python, as `--json` prints them."""

    observer: str
    precision: Precision
    files: list[str]
    numbers_in_state: int
    operations: dict[str, int]
    trace_off_by: float
    compiler: str | None
    c_off_by: dict[str, float] | None
    beyond_rounding: list[str]


class Code(NamedTuple):
    """A controller as C, compared with Python.

    Attributes:
        files: Name -> text.
        figures: The figures of the export.
        law: The printer of the law's part, for C that is joined to it.
    """

    files: dict[str, str]
    figures: Figures
    law: LawPrinter


def generate_code(controller: Controller, precision: Precision, name: str | None = None, suffix: str = "") -> Code:
    """Generate a controller's C, whose name has a suffix, and compare it with Python; see `export`."""
    refuse_unexported(controller)
    cls = type(controller.observer)
    try:
        return _generate(controller, precision, name_of(controller.observer, name) + suffix)
    except LawNotExportable as error:
        raise InputError(f"law {type(controller.law).__name__}: cannot be exported: {error}") from error
    except InputError as error:
        raise InputError(f"{cls.__module__}:{cls.__qualname__} cannot be exported: {error}") from error


def _copied(part: Part, refusal: type[InputError]) -> Part:
    try:
        return copy.deepcopy(part)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a user's observer or law may hold anything
        raise refusal(f"it cannot be copied: {raised(error)}") from error


def _generate(controller: Controller, precision: Precision, name: str) -> Code:
    for_trace, law_for_trace = _copied(controller.observer, InputError), _copied(controller.law, LawNotExportable)
    constants = constants_of(controller)
    traced = trace(for_trace, law_for_trace, constants)
    off = check.check_trace(controller, traced, constants, seeds=(1, 2, 3))

    printer = CodePrinter(controller, traced, constants, precision, name)
    samples = check.signals(controller, 0, precision)
    expected = check.in_python(controller, samples)
    allowed = check.allowed(controller, samples, expected, precision)
    other_files = (
        format_example(name, precision, check.columns(controller)),
        format_test_vector(name, precision, samples.tolist(), expected.tolist(), allowed.tolist()),
    )
    files = dict(zip(export_files(name), (printer.header(), printer.source(), *other_files), strict=True))
    compiler = check.find_compiler()
    figures: Figures = {
        "observer": name,
        "precision": precision,
        "files": list(files),
        "numbers_in_state": len(traced.state),
        "operations": {
            "measure": operations(traced.measure),
            "step": operations(traced.step),
            "law": operations(traced.law.step),
        },
        "trace_off_by": off,
        "compiler": None if compiler is None else shlex.join(compiler),
        "c_off_by": None,
        "beyond_rounding": [],
    }
    if compiler is not None:
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary)
            try:
                for file, text in files.items():
                    write_text(folder / file, text)
            except OSError as error:
                raise InputError(f"temporary folder {folder}: cannot be written: {error.strerror}") from error
            off_by = figures["c_off_by"] = check.check_c(folder, name, compiler)
        bounds = zip(check.columns(controller), check.rounded(expected, precision), strict=True)
        figures["beyond_rounding"] = [name for name, bound in bounds if off_by[name] > bound]
    return Code(files, figures, printer.law)


def export_table(figures: Figures) -> str:
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


EXPORTED_OPTIONS = ("angle_source", "memories", "commands")
"""Options of a `Controller` that its C has."""
SIMULATION_OPTIONS = ("seed", "worlds", "axis", "open_loop_observers")
"""Options that concern the simulation around a controller alone."""
EXPORTED_LAW_FIELDS = ("dt", "gains", "rate_limit")
"""Fields of the law (8) that its C has; another law is traced whole."""
REASONS = {
    "feedback": "what is exported has the observer's rate alone",
    "notch_hz": "no notch is exported, so that a frame that needs one has to be stiffer, or another setting cures it",
}
"""Option of a `Controller` -> why its C has none, where that is known."""


def refuse_unexported(controller: Controller) -> None:
    """Refuse every option of the controller, and every field of (8), that C does not have and that is in use.

    Raises:
        InputError: There is one; the message names it, and the value without it.
    """
    law = controller.law
    option_defaults = {
        option.name: None if option.default is option.empty else option.default
        for cls in type(controller).__mro__
        for option in inspect.signature(cls.__init__).parameters.values()
        if option.kind is option.KEYWORD_ONLY and option.name not in EXPORTED_OPTIONS + SIMULATION_OPTIONS
    }
    _refuse_in_use(controller, option_defaults)
    for stage in controller.command_stages:
        name = f"{type(stage).__name__.lower()}_hz"
        reason = REASONS.get(name, "C has no such stage")
        raise InputError(f"controller.{name}: cannot be exported: {reason}; set controller.{name}=0.0")
    for memory in controller.memories:
        if not isinstance(memory, Trim):
            raise InputError(f"{type(memory).__name__}: cannot be exported: C has no such stage")
    if type(law) is StateFeedback:
        fields = [field for field in dataclasses.fields(law) if field.name not in EXPORTED_LAW_FIELDS]
        _refuse_in_use(law, {field.name: _default_of(field) for field in fields})


def _default_of(field: dataclasses.Field[TomlValue]) -> TomlValue:
    """Return a field's default; None without one."""
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return None if field.default is dataclasses.MISSING else field.default


def _refuse_in_use(part: Controller | Law, defaults: Mapping[str, TomlValue]) -> None:
    """Refuse a name whose value is not its default, and one that is no attribute: its value is not known.

    Args:
        part: The controller or its law.
        defaults: Name of an attribute -> its default; None is no default.
    """
    for name, default in defaults.items():
        setting = f"controller.{name}"
        if not hasattr(part, name):
            raise InputError(f"{setting}: cannot be exported: {type(part).__qualname__} has no attribute {name!r}")
        value = getattr(part, name)
        if not np.any(value != default):
            continue
        reason = REASONS.get(name, "C has no such option")
        if default is not None:
            reason += f"; set {setting}={default if isinstance(default, str) else shown(default)}"
        raise InputError(f"{setting} = {shown(value)}: cannot be exported: {reason}")
