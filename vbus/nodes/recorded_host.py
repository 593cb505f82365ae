"""A host's port on a node that writes down every call made on it."""

from collections.abc import Callable
from typing import Any

from vbus.board.cards import Card
from vbus.board.host_bus import Hosts
from vbus.chips.base import Chip
from vbus.circuit.circuit import Circuit
from vbus.nodes.host import NodeBus
from vbus.protocols.port import NotYet, PortError
from vbus.signals import Observer
from vbus.trace.journal.format import CODE, NOT_YET
from vbus.trace.journal.rows import PORTS, JournalRows


def _recorded(op: str, waits: bool = False) -> Callable[..., Any]:
    """Return a call of :class:`NodeBus` that is written down, also if it is refused or unfinished.

    Args:
        op: its name.
        waits: whether a reply that says nothing means that time has to run on first.
    """
    call = getattr(NodeBus, op)

    def made(self: "RecordedNodeBus", *args: int) -> Any:
        if self.closing:
            return call(self, *args)
        when = int(self.board.now)
        try:
            reply = call(self, *args)
        except NotYet:
            self.note(when, op, [*args], None, NOT_YET, self.board.limit)
            raise
        except PortError as error:
            self.note(when, op, [*args], None, error.code)
            raise
        limit = self.board.limit if waits and not reply else -1
        self.note(when, op, [*args], reply, 0, limit)
        return reply

    made.__doc__ = call.__doc__
    return made


class _Strobes(Observer):
    """Writes down the bus cycles that a host makes by strobes."""

    def __init__(self, bus: "RecordedNodeBus") -> None:
        self._bus: RecordedNodeBus = bus

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Write a cycle down."""
        self._bus.note(when, "cycle", [chip, write, address, data], None)


class RecordedNodeBus(NodeBus):
    """A :class:`NodeBus` under a journal; a call that has to wait is written down as often as made.

    Args:
        board: the node's board.
        hosts: its hosts.
        label: the host's name in traces.
        chips: what the session may select, in order.
        cycle_ps: cost of a whole cycle; 0 for the default.
        card: address decoding, if any.
        rows: where calls are written down.
        number: of this session in the journal.

    Attributes:
        closing: whether the session ends: what it lets go of then is part of its end.
    """

    def __init__(
        self,
        board: Circuit,
        hosts: Hosts,
        label: str,
        chips: list[Chip],
        cycle_ps: int,
        card: Card | None,
        rows: JournalRows,
        number: int,
    ) -> None:
        super().__init__(board, hosts, label, chips, cycle_ps, card)
        self.strobes.found = _Strobes(self)
        self._rows: JournalRows = rows
        self._session: int = number
        self.closing: bool = False
        self.note(board.now, "open", [label, [chip.name for chip in chips], cycle_ps], None)

    def note(
        self, when: int, op: str, args: list[Any], reply: Any, error: int = 0, limit: int = -1
    ) -> None:
        """Write a call down: what was asked and answered, or why not."""
        key = self._session * PORTS + CODE[op]
        self._rows.other(key, [args, reply, error, limit], when, self.board.now)

    read = _recorded("read")
    write = _recorded("write")
    select = _recorded("select")
    claim = _recorded("claim")
    unclaim = _recorded("unclaim")
    wait = _recorded("wait", waits=True)
    delay = _recorded("delay", waits=True)
    at = _recorded("at")
    now = _recorded("now")
    sync = _recorded("sync")
    lines = _recorded("lines")
    drive = _recorded("drive")
    release = _recorded("release")
    sample = _recorded("sample")
    pin = _recorded("pin")
    getpin = _recorded("getpin")
    events = _recorded("events")

    def take_events(self) -> list[tuple[int, int]]:
        """Return and forget the edges seen since the last call."""
        when = self.board.now
        edges = super().take_events()
        if edges:
            self.note(when, "edges", [], edges)
        return edges

    def close(self) -> None:
        """The session has ended."""
        when = self.board.now
        first, self.closing = not self.closing, True
        super().close()
        if first:
            self.note(when, "close", [], None)
