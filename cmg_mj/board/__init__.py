"""The processor in the loop: an exported controller on an emulated Cortex-M7.

with on_a_board(controller) as board:
    decision = board.update(accelerations, encoders)
"""

from cmg_mj.board.emulated import Board, Cost
from cmg_mj.board.with_controller import on_a_board

__all__ = ["Board", "Cost", "on_a_board"]
