"""Runs an exported controller on an emulated Cortex-M7, or on a real board: a processor in the loop.

with on_a_board(controller) as board:
    decision = board.update(accelerations, encoders)
with on_a_wire(controller, "/dev/ttyACM0") as board:
    ...
"""

from cmg_mj.codegen.board.deploy import on_a_board
from cmg_mj.codegen.board.qemu import Board, Cost
from cmg_mj.codegen.board.wired_board import WiredBoard, on_a_wire, result_of

__all__ = ["Board", "Cost", "WiredBoard", "on_a_board", "on_a_wire", "result_of"]
