"""A controller as C for a board: the observer, and all that is around it.

    from pathlib import Path
    from cmg_mj import load_scenario, prepare
    from cmg_mj.codegen.export import export

    controller = prepare(load_scenario("push_recovery", observer="linear")).axis_controller()
    files = export(controller, Path("board"), precision="single")
    # [board/linear.h, board/linear.c, board/linear_example.c, board/linear_test_vector.h]

The observer's Python code is run once on symbols, which write down what it does with them (CasADi); each operation is
then printed in C. What is written has been compared with Python on random signals: the formulas always, and the C where
there is a compiler.
"""

from __future__ import annotations

from contextlib import nullcontext
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cmg_mj.errors import InputError, raised

if TYPE_CHECKING:
    from cmg_mj.codegen.export.pipeline import Code
    from cmg_mj.controllers.controller import Controller
    from cmg_mj.results.run_folder import RunFolder


def export(
    controller: Controller,
    out: Path | RunFolder,
    *,
    precision: Literal["double", "single"] = "double",
    name: str | None = None,
) -> list[Path]:
    """Write a controller as C, compared with Python.

    Args:
        controller: What is exported: its observer, law, tilt estimate, the gimbals' directions and zeros. Its sensors'
            errors, seed and open-loop observers do not count.
        out: Folder to write to; made if need be.
        precision: Of every number in C.
        name: What everything in C begins with; by default the observer's name, or what that of a user's class makes.

    Returns:
        The files: NAME.h, NAME.c, NAME_example.c, NAME_test_vector.h.

    Raises:
        InputError: It cannot be exported, C is not what Python runs, CasADi is missing, or the folder holds files of
            the user's that would be written over.
    """
    return save(out, code(controller, precision, name))


def code(controller: Controller, precision: Literal["double", "single"], name: str | None = None) -> Code:
    """The same without writing it: the files' texts, and figures of the comparison."""
    check_installed()
    from cmg_mj.codegen.export import pipeline as work

    return work.code(controller, precision, name)


def save(out: Path | RunFolder, made: Code) -> list[Path]:
    """Write what `code` has made."""
    from cmg_mj.results.run_folder import RunFolder
    from cmg_mj.results.run_folder.folder import write_text

    with nullcontext(out) if isinstance(out, RunFolder) else RunFolder(out, made.files) as folder:
        place = folder.write(
            {name: lambda path, text=text: write_text(path, text) for name, text in made.files.items()},
            all_or_none=True,  # the example needs the code, and the code its test vector to be believed
        )
    return [place / name for name in made.files]


def check_installed() -> None:
    """See whether CasADi is there, before anything is computed.

    Raises:
        InputError: It is not.
    """
    if find_spec("casadi") is None:
        raise InputError('export: casadi is not installed: python -m pip install "cmg_mj[export]"')
    try:
        import casadi  # noqa: F401
    except Exception as error:
        raise InputError(f"export: casadi cannot be imported: {raised(error)}") from error
