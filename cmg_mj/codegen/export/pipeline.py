"""An export: traced, compared, printed, compared, written."""

from __future__ import annotations

import copy
import shlex
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

from cmg_mj.codegen.export import check
from cmg_mj.codegen.export.c_code import Precision, operations
from cmg_mj.codegen.export.c_files import Texts
from cmg_mj.codegen.export.constants import constants_of
from cmg_mj.codegen.export.example import example, vector
from cmg_mj.codegen.export.names import files_of, name_of
from cmg_mj.codegen.export.trace import trace
from cmg_mj.controllers.controller import Controller
from cmg_mj.controllers.dry_run import dry_run_observer
from cmg_mj.controllers.laws import StateFeedback
from cmg_mj.errors import InputError, raised
from cmg_mj.results.run_folder.folder import write_text


class Code(NamedTuple):
    """A controller as C, compared with Python.

    Attributes:
        files: Name -> text.
        figures: What it is and how it was compared, as JSON can hold it.
    """

    files: dict[str, str]
    figures: dict[str, Any]


def code(controller: Controller, precision: Precision, name: str | None = None) -> Code:
    """Make a controller's C, and compare it with Python.

    Args:
        controller: The controller.
        precision: Of every number in C.
        name: What it is to be called in C.

    Returns:
        The code.

    Raises:
        InputError: It cannot be exported, or C is not what Python runs.
    """
    if type(controller.law) is not StateFeedback:
        raise InputError(
            f"law {type(controller.law).__name__}: cannot be exported: C has the law (8) alone; set "
            "controller.kind=state_feedback"
        )
    cls = type(controller.observer)
    try:
        return _code(controller, precision, name_of(controller.observer, name))
    except InputError as error:
        raise InputError(f"{cls.__module__}:{cls.__qualname__} cannot be exported: {error}") from error


def _code(controller: Controller, precision: Precision, name: str) -> Code:
    if controller.feedback != "observer":
        raise InputError(
            f"controller.feedback = {controller.feedback!r}: what is exported has the observer's rate alone; set "
            "controller.feedback=observer"
        )
    try:
        tried, traced_one = copy.deepcopy(controller.observer), copy.deepcopy(controller.observer)
    except Exception as error:  # a user's observer may hold anything
        raise InputError(f"it cannot be copied: {raised(error)}") from error
    dry_run_observer(tried, None)
    constants = constants_of(controller)
    traced = trace(traced_one, constants)
    off = check.check_trace(controller, traced, constants, seeds=(1, 2, 3))

    texts = Texts(controller, traced, constants, precision, name)
    samples = check.signals(controller, 0, precision)
    expected = check.in_python(controller, samples)
    allowed = check.allowed(controller, samples, expected, precision)
    beside = (
        example(name, check.columns(controller)),
        vector(name, precision, samples.tolist(), expected.tolist(), allowed.tolist()),
    )
    files = dict(zip(files_of(name), (texts.header(), texts.source(), *beside), strict=True))
    compile_with = check.compiler()
    figures = {
        "observer": name,
        "precision": precision,
        "files": list(files),
        "numbers_in_state": len(traced.state),
        "operations": {part: operations(getattr(traced, part)) for part in ("measure", "step", "law")},
        "trace_off_by": off,
        "compiler": None if compile_with is None else shlex.join(compile_with),
        "c_off_by": None,
        "beyond_rounding": [],
    }
    if compile_with is not None:
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary)
            try:
                for file, text in files.items():
                    write_text(folder / file, text)
            except OSError as error:
                raise InputError(f"temporary folder {folder}: cannot be written: {error.strerror}") from error
            off_by = figures["c_off_by"] = check.check_c(folder, name, compile_with)
        bounds = zip(check.columns(controller), check.rounded(expected, precision), strict=True)
        figures["beyond_rounding"] = [name for name, bound in bounds if off_by[name] > bound]
    return Code(files, figures)
