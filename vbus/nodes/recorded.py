"""The board, or the node, that a journal is of."""

from vbus.board.board import Board
from vbus.board.build import build
from vbus.board.config import read_board_file, read_board_text
from vbus.errors import ConfigError, VbusError
from vbus.nodes.machine import node_of
from vbus.nodes.node import Node
from vbus.nodes.plan import Plan, plan_of
from vbus.trace.journal.format import Header


class RebuiltBoard:
    """What a journal was recorded on, made again, at instant 0.

    Args:
        header: of the journal.
        name: of the journal, for messages.
        board_file: a board file in place of the journal's own.

    Attributes:
        board: the board, or that of the node.
        node: the node; None if the board has none.
        plan: of the machine the node belongs to; None if the board has no nodes.

    Raises:
        VbusError: the board was made in Python, or its file has mistakes or no such node.
    """

    def __init__(self, header: Header, name: str, board_file: str = "") -> None:
        self.node: Node | None = None
        self.plan: Plan | None = None
        if board_file:
            file, source = read_board_file(board_file)
        elif header.text:
            file, source = read_board_text(header.text, header.file)
        else:
            raise VbusError(f"{name}: it was recorded on a board made in Python")
        if not file.nodes:
            self.board: Board = build(file, source)
            return
        self.plan = plan_of(file)
        mine = header.board.removeprefix(f"{file.board.name}.")
        if mine not in self.plan.nodes:
            raise ConfigError(f'{name}: it is of "{header.board}", which is no node of {file.path}')
        self.node = node_of(file, source, mine)
        self.board = self.node.board
