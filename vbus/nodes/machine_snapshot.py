"""A snapshot of a whole machine: every node at the end of one round, as a value and as a file.

At the end of a round each node has told the others all it has sent, so nothing is under way between
them. Nodes that have each loaded their own part go on together, in any number of processes.
"""

from collections.abc import Sequence
from typing import Annotated, Final

import msgpack
import msgspec

from vbus.board.snapshot import seal, unseal
from vbus.errors import SnapshotError
from vbus.kernel import NEVER
from vbus.nodes.conductor import Conductor

MAGIC: Final = b"vbus machine snapshot\n"
VERSION: Final = 1

_Count = Annotated[int, msgspec.Meta(ge=0, le=NEVER)]


class HostThere(msgspec.Struct, frozen=True, array_like=True):
    """A host that was attached to a node.

    Attributes:
        label: its name in traces.
        chips: what it may select.
        cycle_ps: what it says a whole bus cycle costs; 0 is the default.
    """

    label: str
    chips: tuple[str, ...]
    cycle_ps: _Count


class NodePart(msgspec.Struct, frozen=True, array_like=True):
    """What a snapshot has of one node.

    Attributes:
        node: its name.
        when: its instant (ps).
        state: what :meth:`~vbus.nodes.conductor.Conductor.save` gives.
        hosts: the hosts that were attached to it.
    """

    node: str
    when: _Count
    state: bytes
    hosts: tuple[HostThere, ...]


class MachineSnapshot(msgspec.Struct, frozen=True, array_like=True):
    """A machine at the end of one round.

    Attributes:
        version: of the format.
        board: name of the machine.
        file: name of its board file.
        text: the board file.
        vbus: version that made it.
        round: the round.
        nodes: its nodes.
    """

    version: int
    board: str
    file: str
    text: str
    vbus: str
    round: _Count
    nodes: tuple[NodePart, ...]

    @property
    def when(self) -> int:
        """How far the node that is farthest has come (ps)."""
        return max((part.when for part in self.nodes), default=0)

    def part(self, node: str) -> NodePart:
        """Return what it has of a node.

        Raises:
            SnapshotError: nothing.
        """
        for part in self.nodes:
            if part.node == node:
                return part
        raise SnapshotError(f"the snapshot has no node {node}")


def restore(conductors: Sequence[Conductor], snapshot: MachineSnapshot) -> None:
    """Bring nodes of a machine to where a snapshot was taken; the others do the same elsewhere.

    What hosts of the snapshot held is let go, as if they had just ended.

    Raises:
        SnapshotError: it is of another machine or version of its board file, or does not fit.
    """
    for conductor in conductors:
        board = conductor.node.board
        if snapshot.text != board.text:
            raise SnapshotError(
                f'the snapshot was taken on "{snapshot.board}" with another version of its board'
                f' file than this one of "{board.name}"; run that one (vbus snap info --board-file'
                " shows it), or take the snapshot again"
            )
        part = snapshot.part(conductor.node.name)
        guests = [
            board.open_port(host.label, list(host.chips), host.cycle_ps) for host in part.hosts
        ]
        try:
            conductor.load(part.state)
        finally:
            for guest in guests:
                guest.close()


def is_machine(data: bytes) -> bool:
    """Whether the content of a file is, or claims to be, a snapshot of a machine."""
    return data.startswith(MAGIC)


def write(snapshot: MachineSnapshot) -> bytes:
    """Return a snapshot as the content of a file."""
    return seal(MAGIC, msgspec.msgpack.encode(snapshot))


def read(data: bytes, name: str = "the snapshot") -> MachineSnapshot:
    """Return the snapshot in a file's content.

    Args:
        data: the bytes.
        name: what to call it in an error.

    Raises:
        SnapshotError: it is none, was cut short or damaged, or is of a later version.
    """
    body = unseal(MAGIC, data, name, "snapshot of a machine of nodes")
    try:
        content = msgpack.unpackb(body)
        version = content[0]
        if version != VERSION:
            raise SnapshotError(f"{name}: format {version}; this vbus reads format {VERSION}")
        return msgspec.convert(content, MachineSnapshot, builtin_types=(bytes,))
    except (ValueError, TypeError, LookupError, RecursionError) as error:
        raise SnapshotError(f"{name}: its content makes no sense: {error}") from error
