"""A controller as C for a board: the observer, and everything around it.

from cmg_mj import load_scenario, prepare
from cmg_mj.export import export

controller = prepare(load_scenario("push_recovery", [], "linear")).controller()
files = export(controller, Path("board"), precision="single")
# [board/linear.h, board/linear.c, board/linear_example.c, board/linear_test_vector.h]
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cmg_mj.errors import InputError

if TYPE_CHECKING:
    from cmg_mj.controller import Controller
    from cmg_mj.run_folder import RunFolder


def export(
    controller: Controller, out: Path | RunFolder, *, precision: Literal["double", "single"] = "double"
) -> list[Path]:
    """Write a controller as C.

    Args:
        controller: What is exported: its observer, law, tilt, gimbal directions and zeros.
        out: Folder to write to; made if need be.
        precision: Of every number in the C.

    Returns:
        The files: NAME.h, NAME.c, NAME_example.c, NAME_test_vector.h.

    Raises:
        InputError: It cannot be exported, or CasADi is missing.
    """
    if find_spec("casadi") is None:
        raise InputError('export: casadi is not installed: python -m pip install "cmg_mj[export]"')
    from cmg_mj.export import work

    return work.export(controller, out, precision)
