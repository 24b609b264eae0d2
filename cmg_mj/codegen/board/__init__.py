"""Runs an exported controller on an emulated Cortex-M7, a processor in the loop.

with on_a_board(controller) as board:
    decision = board.update(accelerations, encoders)
"""

from cmg_mj.codegen.board.deploy import on_a_board
from cmg_mj.codegen.board.qemu import Board, Cost

__all__ = ["Board", "Cost", "on_a_board"]
