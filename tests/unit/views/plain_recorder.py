"""The recorder of a port in its plainest form: a decorator for a kind of host port."""

from collections.abc import Callable
from functools import cache
from typing import Any, Final

from vbus.board.card.cards import Card
from vbus.board.host_bus import HostBus, Hosts
from vbus.chips.base import Chip
from vbus.circuit.circuit import Circuit
from vbus.record.recorded_bus import SessionRows
from vbus.record.rows import JournalRows

CALLS: Final = (
    "read", "write", "select", "claim", "unclaim", "wait", "delay", "at", "now", "sync", "lines",
    "drive", "release", "sample", "pin", "getpin", "events", "take_events",
)  # fmt: skip
"""What a host calls, but for the end."""


@cache
def recorded(port: type[HostBus]) -> type[HostBus]:
    """Return a kind of port under a journal: every call is written down when it returns.

    A call that is refused, or that time has to run on for first, is written down as often as it is
    made. The new kind takes two arguments more: the rows, and the number of its session in the
    journal.

    Args:
        port: the kind of port.
    """

    def begin(
        self: Any, board: Circuit, hosts: Hosts, label: str, chips: list[Chip], cycle_ps: int,
        card: Card | None, rows: JournalRows, number: int,
    ) -> None:  # fmt: skip
        port.__init__(self, board, hosts, label, chips, cycle_ps, card)
        self.polls.every_cycle = True
        self.notes = SessionRows(board, rows, number, label, chips, cycle_ps)
        self.strobes.found = self.notes

    def end(self: Any) -> None:
        self.notes.end(self, port.close)

    methods = {name: _recorded(getattr(port, name), name) for name in CALLS}
    return type(f"Recorded{port.__name__}", (port,), {
        "__doc__": port.__doc__, "__init__": begin, "close": end, **methods
    })  # fmt: skip


def _recorded(call: Callable[..., Any], name: str) -> Callable[..., Any]:
    op = "edges" if name == "take_events" else name

    def made(self: Any, *args: int) -> Any:
        return self.notes.call(self, op, [*args], call)

    return made
