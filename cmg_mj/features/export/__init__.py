"""Exports a controller as C for a board: the observer, the measurement and the law.

    from pathlib import Path
    from cmg_mj import load_scenario, prepare
    from cmg_mj.features.export import export

    controller = prepare(load_scenario("push_recovery", observer="linear")).axis_controller()
    files = export(controller, Path("board"), precision="single")
    # [board/linear.h, board/linear.c, board/linear_example.c, board/linear_test_vector.h]

CasADi symbols run through the observer's Python code once and record its operations; each operation is then printed in
C. Random signals compare the formulas with Python always, and the C where there is a compiler.
"""

from cmg_mj.features.export.save import check_installed, export, generate_code, write_code

__all__ = ["check_installed", "export", "generate_code", "write_code"]
