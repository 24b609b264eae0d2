"""Exports a controller as C for a board: the observer, the measurement and the law.

    from pathlib import Path
    from cmg_mj import load_scenario, prepare
    from cmg_mj.features.export import export

    controller = prepare(load_scenario("push_recovery", observer="linear")).axis_controller()
    files = export(controller, Path("board"), precision="single")
    # [board/linear.h, board/linear.c, board/linear_example.c, board/linear_test_vector.h]

Symbols run through the observer's Python code once, and a tape records its operations; each operation is then printed
in C. Random signals compare the formulas with Python always, and the C where there is a compiler.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cmg_mj.core.errors import InputError

if TYPE_CHECKING:
    from cmg_mj.core.axis import AxisControl
    from cmg_mj.core.controller import Controller
    from cmg_mj.features.export.pipeline import Code
    from cmg_mj.results.folder import RunFolder

__all__ = ["export", "generate_code", "write_code"]


def export(
    controller: Controller,
    out: Path | RunFolder,
    *,
    precision: Literal["double", "single"] = "double",
    name: str | None = None,
) -> list[Path]:
    """Write a controller as C, compared with Python.

    Args:
        controller: The controller: its observer, law, tilt estimate, the gimbals' directions and zeros. Its sensors'
            errors, seed and open-loop observers do not count.
        out: Folder to write to; made if need be.
        precision: Precision of every number in C.
        name: Prefix of everything in C; by default the observer's name, or a name derived from a user's class.

    Returns:
        The files: NAME.h, NAME.c, NAME_example.c, NAME_test_vector.h.

    Raises:
        InputError: The controller cannot be exported, the C differs from Python, or the folder cannot be written.
    """
    control, *others = controller.axes
    if others:
        raise InputError(f"export: a controller of {len(controller.axes)} axes; it takes one")
    return write_code(out, generate_code(control, precision, name))


def generate_code(controller: AxisControl, precision: Literal["double", "single"], name: str | None = None) -> Code:
    """Generate a controller's C and compare it with Python, as `export` does, without writing it."""
    from cmg_mj.features.export import pipeline

    return pipeline.generate_code(controller, precision, name)


def write_code(out: Path | RunFolder, code: Code) -> list[Path]:
    """Write the files of a generated code."""
    from cmg_mj.results.folder import claimed, write_text

    with claimed(out) as folder:
        place = folder.write(
            {name: lambda path, text=text: write_text(path, text) for name, text in code.files.items()},
            all_or_none=True,  # the example needs the code, and the code its test vector to be believed
        )
    return [place / name for name in code.files]
