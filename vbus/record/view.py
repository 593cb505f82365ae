"""A journal as observers see a run: bus cycles with their chips, and violations."""

from collections.abc import Iterable, Iterator

from msgspec import Struct

from vbus.circuit.stream import PacketReader, PacketStream
from vbus.core.signals import Observer, Violation
from vbus.record.format import Entry, Header


class RecordedSession(Struct):
    """One host of a journal: its name, what it may select, and what it has selected."""

    label: str
    chips: list[str]
    selected: str = ""

    def select(self, mask: int) -> None:
        """Choose chips; their names are joined as in traces."""
        names = [name for bit, name in enumerate(self.chips) if mask >> bit & 1]
        self.selected = "+".join(names) or "-"


def violation_of(entry: Entry) -> Violation:
    """Return the finding an entry holds."""
    return Violation(*entry.args)


class Sessions:
    """The sessions of a journal, as far as its entries have been followed."""

    def __init__(self) -> None:
        self.by_port: dict[int, RecordedSession] = {}

    def follow(self, entry: Entry) -> None:
        """Take an entry into account."""
        if entry.op == "open":
            label, chips, _ = entry.args
            self.by_port[entry.port] = session = RecordedSession(label, list(chips))
            # The protocol's own beginning: the first chip is selected.
            session.select(1)
        elif entry.op == "select" and not entry.error and entry.port in self.by_port:
            self.by_port[entry.port].select(entry.args[0])

    def chip(self, entry: Entry) -> str:
        """Return the names of the chips an entry is about, or ``"-"``."""
        session = self.by_port.get(entry.port)
        return session.selected if session is not None else "-"

    def host(self, entry: Entry) -> str:
        """Return the host an entry comes from, or ""."""
        session = self.by_port.get(entry.port)
        return session.label if session is not None else ""


def show(entry: Entry, sessions: Sessions, observer: Observer) -> None:
    """Show ``observer`` what one entry holds, and follow it."""
    # A refused call made no cycle.
    if entry.op in ("read", "write") and not entry.error:
        write = entry.op == "write"
        observer.bus_cycle(
            entry.after,
            sessions.host(entry),
            sessions.chip(entry),
            write,
            entry.args[0],
            entry.args[1] if write else entry.reply,
        )
    elif entry.op == "cycle":
        chips, write, address, data = entry.args
        observer.bus_cycle(entry.when, sessions.host(entry), chips, write, address, data)
    elif entry.op == "made":
        observer.bus_cycle(*entry.args)
    elif entry.op == "violation":
        observer.violation(violation_of(entry))
    elif entry.op == "fault":
        observer.fault(*entry.args)
    else:
        sessions.follow(entry)


def shown(entries: Iterable[Entry], observer: Observer) -> Iterator[Entry]:
    """Give the entries of a journal, and show ``observer`` first what each holds."""
    sessions = Sessions()
    for entry in entries:
        show(entry, sessions, observer)
        yield entry


def play(header: Header, entries: Iterable[Entry], *readers: PacketReader) -> int:
    """Show readers what a journal holds, its packets included; return the number of entries."""
    stream = PacketStream(header.families, header.settings, readers)
    count = last = 0
    for entry in shown(entries, stream):
        count += 1
        # Entries come in order of their calls; a long one may end after the next has.
        last = max(last, entry.after)
    stream.settled(last)
    return count
