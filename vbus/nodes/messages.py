"""What nodes tell each other to keep one virtual time: msgpack arrays, checked before use."""

from typing import Final

import msgspec

from vbus.core.errors import NodeMismatchError
from vbus.core.kernel import NEVER

Edge = tuple[int, int, int, int, int, bool]
"""What travels on a wire: instant it was sent (ps), node's rank, the node's running number, wire's
rank, level the node drives (-1: none), and whether by open-drain pins only."""

VERSION: Final = 1
MOST_WIRES: Final = 1 << 16
LARGEST: Final = 16 << 20
"""Longest message that is looked at (bytes): a bound of memory."""


class NodeMessage(msgspec.Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """What every message begins with.

    Attributes:
        digest: of the board file; see :class:`~vbus.nodes.plan.Plan`.
        node: rank of the node that sends it.
        round: running number of the report, ping, mark or message with edges, from 0.
    """

    digest: str
    node: int
    round: int


class NodeReport(NodeMessage, frozen=True, tag="r"):
    """A node has done everything before an instant.

    Attributes:
        horizon: everything before this instant is done (ps).
        following: before this instant the node sends no edge of its own (ps).
        until: how far its hosts want time to run (ps); -1: they want nothing.
        edges: sent since the report before.
    """

    horizon: int
    following: int
    until: int
    edges: tuple[Edge, ...]


class Reports(NodeMessage, frozen=True, tag="s"):
    """What nodes of one process have reported; ``node`` and ``round`` are those of the first.

    Attributes:
        reports: in the order in which they were made.
    """

    reports: tuple[NodeReport, ...]


class Alive(NodeMessage, frozen=True, tag="a"):
    """A node lives; ``round`` is the latest it has reported.

    Attributes:
        state: what it does: ``"waits"``, ``"runs"``, ``"rests"``, ``"done"``.
    """

    state: str


class Need(NodeMessage, frozen=True, tag="n"):
    """A node lacks reports of another, from ``round`` on: it has begun, or a message was lost.

    Attributes:
        other: rank of the node whose reports it lacks.
    """

    other: int


class Ping(NodeMessage, frozen=True, tag="p"):
    """What does your clock say? Instants in ns of each process' own clock.

    Attributes:
        sent: when it was asked.
        clock: names the clock of the one who asks; empty if it does not know.
    """

    sent: int
    clock: str = ""


class Pong(NodeMessage, frozen=True, tag="q"):
    """The answer to a :class:`Ping`, and when chip time began.

    Attributes:
        other: rank of the node that asked.
        sent: when it asked, by its clock.
        came: when the ping came, by the clock of the one who answers.
        answered: when the answer was sent.
        epoch: when chip time was 0, by the same clock; -1 if that is not known yet.
        shared: whether the one who asked goes by that clock, too.
    """

    other: int
    sent: int
    came: int
    answered: int
    epoch: int
    shared: bool = False


class WireEdges(NodeMessage, frozen=True, tag="w"):
    """Edges on wires, in real time.

    Attributes:
        edges: what it sends.
    """

    edges: tuple[Edge, ...]


class Mark(NodeMessage, frozen=True, tag="m"):
    """A node has reached an instant of chip time, the one numbered ``round``.

    Attributes:
        at: when that was, by the clock all nodes have agreed on (ns).
        uncertainty: how far that may be from the truth (ns).
    """

    at: int
    uncertainty: int = 0


Message = NodeReport | Reports | Alive | Need | Ping | Pong | WireEdges | Mark

_encoder: Final = msgspec.msgpack.Encoder()
_decoder: Final = msgspec.msgpack.Decoder(Message)


def encode(message: Message) -> bytes:
    """Return the bytes of a message."""
    return bytes((VERSION,)) + _encoder.encode(message)


def decode(data: bytes, sender: str, nodes: int, wires: int) -> Message:
    """Return the message behind bytes.

    Args:
        data: as received.
        sender: name of the node they came from, for error messages.
        nodes: how many nodes there are.
        wires: how many wires.

    Raises:
        NodeMismatchError: they are none, or say what cannot be.
    """
    if len(data) > LARGEST:
        raise _bad(sender, f"a message of {len(data)} bytes; at most {LARGEST} are allowed")
    if not data or data[0] != VERSION:
        found = f"version {data[0]}" if data else "an empty message"
        raise _bad(sender, f"{found}; this vbus speaks version {VERSION}")
    try:
        message: Message = _decoder.decode(data[1:])
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise _bad(sender, f"bytes that are no message ({error})") from None
    wrong = _wrong(message, nodes, wires)
    if wrong:
        raise _bad(sender, f"a message that cannot be: {wrong}")
    return message


def _bad(sender: str, what: str) -> NodeMismatchError:
    return NodeMismatchError(sender, f"node {sender} has sent {what}; the message is ignored")


def _wrong(message: Message, nodes: int, wires: int) -> str:
    if not 0 <= message.node < nodes:
        return f"node {message.node} of {nodes}"
    if message.round < -1:
        return f"round {message.round}"
    if isinstance(message, Need | Pong) and not 0 <= message.other < nodes:
        return f"node {message.other} of {nodes}"
    if isinstance(message, Mark) and message.uncertainty < 0:
        return f"an uncertainty of {message.uncertainty} ns"
    if isinstance(message, WireEdges):
        return _wrong_edges(message.node, message.edges, wires, NEVER)
    if isinstance(message, Reports):
        wrong = (_wrong(report, nodes, wires) for report in message.reports)
        return next(filter(None, wrong), "")
    if isinstance(message, NodeReport):
        if not 0 <= message.horizon <= message.following <= NEVER:
            return f"horizon {message.horizon}, next event {message.following}"
        if message.until > NEVER:
            return f"until {message.until}"
        return _wrong_edges(message.node, message.edges, wires, max(message.horizon, 1))
    return ""


def _wrong_edges(sender: int, edges: tuple[Edge, ...], wires: int, before: int) -> str:
    for sent, node, _, wire, level, _ in edges:
        if node != sender or not 0 <= wire < wires or not -1 <= level <= 255:
            return f"an edge of node {node} on wire {wire} to level {level}"
        if not 0 <= sent < before:
            return f"an edge at {sent} ps, horizon {before} ps"
    return ""
