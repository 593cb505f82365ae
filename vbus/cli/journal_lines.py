"""Journals as lines for people: what ``explain`` and ``replay`` print of them."""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from pathlib import Path
from typing import Final

from vbus.chips.base import CONNECTOR_FAMILY
from vbus.chips.packets import STATUS, CommandPackets, Cycle, Packet
from vbus.circuit.stream import PacketReader, PacketStream, PacketTaker
from vbus.cli.output import Line
from vbus.cli.sources import opened
from vbus.core.errors import VbusError
from vbus.core.kernel import MS
from vbus.core.signals import Violation
from vbus.protocols.quantities import format_instant
from vbus.record.format import NOT_YET, Entry, Header, JournalReader, Jump
from vbus.record.rows import PORTS, WRITE
from vbus.record.view import Sessions, show, violation_of

# Some megabytes of lines: an open packet holds back lines of a whole homing run, not more.
_WAITING: Final = 5000


def instant(ps: int) -> str:
    """Return an instant in microseconds with all its digits that tell."""
    return format_instant(ps) if ps >= 0 else f"{ps} ps"


def decoded(path: Path, first: int, last: int | None, quiet: bool = False) -> Iterator[str]:
    """Give a journal in the manual's words, all of it or some entries.

    Lines on a terminal are progress enough: there is a bar only while they go elsewhere.
    """
    quiet = quiet or last is not None or sys.stdout.isatty()
    with opened(path, "decoding", quiet) as reader:
        if last is not None:
            yield from _entries(reader, first, last)
            return
        header = _header(reader.header)
        yield Line(f"# {path}: {header}", journal=str(path), header=header)
        yield from _explained(reader)
        for text in map(_went_back, reader.jumps):
            yield Line(f"# {path}: {text}", journal=str(path), jump=text)
        if reader.damage:
            yield Line(f"# {path}: {reader.damage}", journal=str(path), damage=reader.damage)


def _went_back(jump: Jump) -> str:
    return (
        f"at {instant(jump.left)} the board went back to {instant(jump.to)}; {jump.undone} entries"
        " are undone, and not shown"
    )


def _explained(reader: JournalReader) -> Iterator[str]:
    """Give a whole journal as lines; equal cycles in a row are gone through at once."""
    # Fast way: a driver's journal takes a seventh of the time of view.show of every entry
    # (tests/unit/cli/test_journal_lines.py).
    watch = _Lines(reader.header)
    sessions = Sessions()
    ready = watch.ready
    for number, when, span, key, value, times in reader.stretches():
        session = sessions.by_port.get(key // PORTS)
        if key % PORTS <= WRITE and session is not None and type(value) is int:
            write = key % PORTS == WRITE
            watch.cycles(session.selected, when + span, span, times, write, value)
        else:
            show(reader.entry(number, when, span, key, value), sessions, watch.stream)
            watch.drain()
        if ready:
            yield from ready
            ready.clear()
    watch.stream.finish()
    watch.drain()
    watch.tell()
    yield from ready


def _header(header: Header) -> str:
    """Return what a journal says of the run it holds, in one line."""
    file = f" of {header.file or 'a board file'}" if header.text else ", made in Python"
    return (
        f'board "{header.board}"{file} (SHA-256 {header.digest[:12]}), {header.policy},'
        f" seed {header.seed}; vbus {header.vbus}, Python {header.python}, format {header.format}"
    )


@dataclass(slots=True)
class _Held:
    """A line that is held back to be counted: from when until when, and how often."""

    text: str
    begun: int
    ended: int
    times: int
    before: int = 0
    """When it came the last time but one, of lines that come in turns."""

    def again(self, when: int) -> None:
        """It comes once more, in its turn."""
        self.before, self.ended = self.ended, when
        self.times += 1

    def take_last(self) -> "_Held":
        """Return its last time as a line of its own; the others stay."""
        last = _Held(self.text, self.ended, self.ended, 1)
        self.ended = self.before
        self.times -= 1
        return last


class _Lines(PacketReader):
    """Packets and violations as lines, in the order in which they ended.

    A packet that is cut short is known to be one only when another begins, so lines wait for what
    is still open; at most :data:`_WAITING` of them. Equal ones in a row, as of a driver that polls,
    are one line.
    """

    def __init__(self, header: Header) -> None:
        self.stream: PacketStream = PacketStream(header.families, header.settings, (self,))
        self.ready: list[Line] = []
        """Lines before which none can come any more."""
        self._statuses: dict[tuple[str, bool, int], str] = {}
        """What a status byte reads, by chip, way, and address with byte: it stands outside
        packets, so its text hangs on nothing else."""
        self._first: int | None = None
        """Instant of the last cycle of the oldest packet still open (ps), if any is."""
        self._waiting: list[tuple[int, int, str, int, int]] = []
        """Instant, number, text, how often in a row, instant of the last time."""
        self._count: int = 0
        self._cards: set[str] = {
            name for name, family in header.families.items() if family == CONNECTOR_FAMILY
        }
        self._held: list[_Held] = []
        """The lines that are held back to be counted: one, or those of a chip's cycle and of the
        access on its card's bus, which come in turns."""

    def cycles(self, chip: str, when: int, span: int, times: int, write: bool, value: int) -> None:
        """Take bus cycles that follow each other and are equal.

        Args:
            chip: names of the chips.
            when: latching edge of the first (ps).
            span: from each to the next (ps).
            times: how many they are.
            write: whether the host wrote.
            value: 256 times the address, plus the byte.
        """
        # Several chips, or one that has not taken a cycle.
        if chip not in self.stream.decoders or self.stream.lost:
            for turn in range(times):
                self.stream.bus_cycle(when + turn * span, "", chip, write, value >> 8, value & 0xFF)
                self.drain()
            return
        text = self._statuses.get((chip, write, value))
        # A driver that polls reads one status byte thousands of times: its text is made once.
        if text is not None:
            self._put(when, text, times, when + (times - 1) * span)
            return
        line = ""
        for turn in range(times):
            before = line
            line = self._cycle(chip, Cycle(when, write, value >> 8, value & 0xFF))
            # The first of a stretch may end what came before it, so the second decides.
            if turn == 1 and line and line == before:  # so does each of the rest
                self._put(when + span, line, times - 2, when + (times - 2) * span)
                return
            when += span

    def _cycle(self, chip: str, cycle: Cycle) -> str:
        """Take one cycle; return its line if it is one by itself and no packet is open."""
        packets = [packet for _, packet in self.stream.decoded(chip, cycle)]
        if not packets:
            self._first = cycle.when  # it belongs to one that is open
            return ""
        for packet in packets:
            text = self._told(chip, packet)
        self.drain()
        if len(packets) > 1 or len(packet.cycles) > 1:
            return ""
        # Of other packets the text may depend on what stands before them.
        if packet.kind == STATUS and isinstance(self.stream.decoders[chip], CommandPackets):
            self._statuses[chip, cycle.write, cycle.address << 8 | cycle.data] = text
        return text if self._first is None else ""

    def packet(self, chip: str, packet: Packet) -> None:
        """Take down a packet's line."""
        self._told(chip, packet)

    def _told(self, chip: str, packet: Packet) -> str:
        text = f"{chip} {packet.cited}"
        self._wait(packet.end, text)
        return text

    def violation(self, violation: Violation) -> None:
        """Show a finding where it was made."""
        v = violation
        self._wait(v.when, f"{v.chip} ! {v.rule}: {v.detail}  [{v.clause}]")

    def _wait(self, when: int, text: str, times: int = 1, last: int = 0) -> None:
        # The count keeps lines of one instant in the order in which they came.
        heappush(self._waiting, (when, self._count, text, times, last or when))
        self._count += 1

    def _put(self, when: int, text: str, times: int, last: int) -> None:
        """Take a line that opens and ends no packet, so many times."""
        if times < 1:
            return
        if self._waiting or self._first is not None:
            self._wait(when, text, times, last)
        else:
            self._fold(when, text, times, last)

    def drain(self) -> None:
        """Tell the lines before which none can come any more."""
        waiting = self._waiting
        self._first = first = self.stream.unfinished()
        # A line is safe once no open packet began before it; at the bound it is shown out of order
        # rather than never.
        while waiting and (first is None or waiting[0][0] <= first or len(waiting) > _WAITING):
            when, _, text, times, last = heappop(waiting)
            self._fold(when, text, times, last)

    def _fold(self, when: int, text: str, times: int, last: int) -> None:
        held = self._held
        # A card's access and its chip's cycle come in turns: both are counted, each in its own
        # line.
        if len(held) == 2 and times == 1:
            first, second = held
            turn = second if first.times > second.times else first
            if text == turn.text:
                turn.again(when)
                return
            if turn is second:  # the first came once more, and something else than the second
                again = first.take_last()
                self.tell()
                held.append(again)
        if len(held) == 1:
            if text == held[0].text:
                held[0].times += times
                held[0].ended = last
                return
            if held[0].times == times == 1 and text.partition(" ")[0] in self._cards:
                held.append(_Held(text, when, last, 1))
                return
        self.tell()
        held.append(_Held(text, when, last, times))

    def tell(self) -> None:
        """Tell what is held back."""
        for line in self._held:
            more = line.ended - line.begun
            folded = f"  x {line.times}, {more / MS:.6g} ms" if line.times > 1 else ""
            self.ready.append(
                Line(
                    f"{instant(line.begun)} {line.text}{folded}",
                    when_ps=line.begun, until_ps=line.ended, times=line.times, text=line.text,
                )
            )  # fmt: skip
        self._held.clear()


def _entries(reader: JournalReader, first: int, last: int) -> Iterator[str]:
    """Give entries as they were made, each with the packet that ends in it."""
    sessions = Sessions()
    ended: list[str] = []
    taker = PacketTaker(lambda chip, packet: ended.append(f"{chip} {packet.text}"))
    stream = PacketStream(reader.header.families, reader.header.settings, (taker,))
    count = 0
    for entry in reader:
        show(entry, sessions, stream)
        count += 1
        if first <= entry.number <= last:
            text = line(entry, sessions)
            yield Line(text, entry=entry.number, when_ps=entry.when, call=entry.op, text=text)
            for packet in ended:
                yield Line(f"    {packet}", entry=entry.number, packet=packet)
        ended.clear()
        if entry.number >= last:
            return
    # Nothing was shown: an answer of no lines would look like an empty entry.
    if count <= first:
        raise VbusError(f"the journal has no entry {first}; its last one is {count - 1}")


def line(entry: Entry, sessions: Sessions) -> str:
    """Return one entry as one line."""
    place = f"{entry.number}: {instant(entry.when)}"
    if entry.op == "violation":
        violation = violation_of(entry)
        return f"{place} ! {violation.chip} {violation.rule}: {violation.detail}"
    if entry.op == "fault":
        _, name, target, what, text = entry.args
        return f"{place} fault {name} {target}: {what}" + (f"; {text}" if text else "")
    if entry.op == "arm":
        name, target, when, until, values = entry.args
        given = "".join(f" {key}={value}" for key, value in values.items())
        return f"{place} arm {name} {target}{given}, when {when}, until {until}"
    if entry.op == "clear":
        return f"{place} clear fault #{entry.args[0]}"
    if entry.op == "cycle":
        chips, *cycle = entry.args
        return f"{place} {sessions.host(entry)} {chips} {Cycle(entry.when, *cycle)} (strobes)"
    if entry.op == "end":
        return f"{place} end: {entry.args[0]} entries, state {entry.args[1]}"
    where = f"{sessions.host(entry)} {sessions.chip(entry)}"
    if entry.op == "arrive":
        edges = ", ".join(
            f"wire {wire} {level} of node {node}" for _, node, _, wire, level, _ in entry.args[0]
        )
        return f"{place} edges arrive: {edges}"
    if entry.op == "made":
        when, host, chips, *cycle = entry.args
        return f"{place} {host} {chips} {Cycle(when, *cycle)} (ordered)"
    if entry.op == "orders":
        return f"{place} {entry.args[0]} will order cycles for given instants"
    if entry.op == "order":
        host, when, chips, kind, address, data, pin = entry.args
        what = f"pin {pin} {data}" if pin else Cycle(when, kind == 1, address, data)
        return f"{place} {host} orders for {instant(when)}: {'+'.join(chips)} {what}"
    if entry.op in ("read", "write") and not entry.error:
        data = entry.args[1] if entry.op == "write" else entry.reply
        return f"{place} {where} {Cycle(entry.after, entry.op == 'write', entry.args[0], data)}"
    asked = " ".join(str(item) for item in entry.args)
    answer = "" if entry.reply is None else f" -> {entry.reply}"
    refused = f" refused, number {entry.error}" if entry.error not in (0, NOT_YET) else ""
    held = " (not finished)" if entry.limit >= 0 or entry.error == NOT_YET else ""
    return f"{place} {where} {entry.op} {asked}".rstrip() + answer + refused + held
