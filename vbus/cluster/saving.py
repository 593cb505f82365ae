"""A node's part of a snapshot of its machine, as it travels."""

from typing import Final

import msgspec

from vbus.nodes.conductor import Conductor

NO_ROUNDS: Final = "a snapshot is for virtual time; this board is realtime"


class SavedNode(msgspec.Struct, frozen=True):
    """What a snapshot of a machine has of one node; bytes travel in base64.

    Attributes:
        round: the round at whose end it was taken.
        when_ps: the node's instant (ps).
        file: name of the board file where the node runs.
        text: the board file.
        hosts: of each attached host its label, its chips, and what a bus cycle costs it (ps).
        data: what :meth:`~vbus.nodes.conductor.Conductor.save` gives.
    """

    round: int
    when_ps: int
    file: str
    text: str
    hosts: tuple[tuple[str, tuple[str, ...], int], ...]
    data: bytes


def saved(conductor: Conductor) -> SavedNode:
    """Return the part of a node that has just ended a round."""
    board = conductor.node.board
    hosts = [
        (port.label, tuple(chip.name for chip in port.chips), port.cycle_ps) for port in board.ports
    ]
    return SavedNode(
        conductor.participant.round, board.now, board.file, board.text, tuple(hosts),
        conductor.save(),
    )  # fmt: skip
