"""A snapshot of a whole machine: every node at the end of one round, as a value and as a file.

At the end of a round each node has reported to the others all it has sent, so no message is under
way. Nodes that have each loaded their own part go on together, in any number of processes.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, Final

import msgspec

from vbus.board import snapshot as of_board
from vbus.board.snapshot import VERSION, Snapshot, seal, unseal
from vbus.core.errors import SnapshotError
from vbus.core.kernel import NEVER
from vbus.nodes.conductor import Conductor

MAGIC: Final = b"vbus machine snapshot\n"
NO_ROUNDS: Final = "a snapshot is for virtual time; this board is realtime"

_Content = tuple[
    str, Annotated[int, msgspec.Meta(ge=0, le=NEVER)],
    Annotated[dict[str, bytes], msgspec.Meta(min_length=1)],
]  # fmt: skip


class SavedNode(msgspec.Struct, frozen=True):
    """A node's part of a snapshot of its machine, as it travels; bytes do so in base64.

    Attributes:
        round: the round at whose end it was taken.
        data: a snapshot of the node's board, as the content of a file.
    """

    round: int
    data: bytes


class MachineSnapshot(msgspec.Struct, frozen=True):
    """A machine at the end of one round.

    Attributes:
        board: name of the machine.
        round: the round.
        nodes: snapshots of the boards of its nodes, by their names.
    """

    board: str
    round: int
    nodes: dict[str, Snapshot]

    @property
    def when(self) -> int:
        """How far the node that is farthest has come (ps)."""
        return max((part.when for part in self.nodes.values()), default=0)


def saved(conductor: Conductor) -> SavedNode:
    """Return the part of a node that has just ended a round."""
    return SavedNode(conductor.participant.round, of_board.write(conductor.save()))


def restore(conductors: Sequence[Conductor], nodes: Mapping[str, Snapshot]) -> None:
    """Bring nodes of a machine to where snapshots of them were taken; the others do so elsewhere.

    What hosts of the snapshots held is let go, as if they had just ended.

    Raises:
        SnapshotError: one is missing, of another machine or version of its board file, or does not
            fit.
    """
    for conductor in conductors:
        name = conductor.node.name
        if name not in nodes:
            raise SnapshotError(f"the snapshot has no node {name}")
        conductor.load(nodes[name])


def read_nodes(data: bytes, name: str) -> dict[str, Snapshot]:
    """Return the nodes in a file's content: a snapshot of a machine, or of one node.

    Args:
        data: the bytes.
        name: what to call it in an error.

    Raises:
        SnapshotError: it is none, was cut short or damaged, or is of a later version.
    """
    if is_machine(data):
        return read(data, name).nodes
    part = of_board.read(data, name)
    return {part.board.rpartition(".")[2]: part}


def is_machine(data: bytes) -> bool:
    """Whether the content of a file is, or claims to be, a snapshot of a machine."""
    return data.startswith(MAGIC)


def write(snapshot: MachineSnapshot) -> bytes:
    """Return a snapshot as the content of a file."""
    nodes = {name: of_board.write(part) for name, part in snapshot.nodes.items()}
    return seal(MAGIC, VERSION, snapshot.board, snapshot.round, nodes)


def read(data: bytes, name: str = "the snapshot") -> MachineSnapshot:
    """Return the snapshot in a file's content.

    Args:
        data: the bytes.
        name: what to call it in an error.

    Raises:
        SnapshotError: it is none, was cut short or damaged, or is of a later version.
    """
    kind = "snapshot of a machine of nodes"
    board, number, nodes = unseal(MAGIC, data, name, kind, _Content)
    parts = {node: of_board.read(part, f"{name}, node {node}") for node, part in nodes.items()}
    return MachineSnapshot(board, number, parts)
