"""What happens on a board, as rows of lanes: of a journal that is played again, or of a live one.

A chip is looked at when its samples are made, so every value has the instant from which on it held.
Looking changes nothing: no reply, no instant, no finding, no hash.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Any, Final

from vbus.board.board import Board
from vbus.chips.packets import IGNORED, STATUS, WHOLE, CommandPackets, Cycle, Packet
from vbus.circuit.stream import PacketReader, decoder_of
from vbus.core.signals import Violation
from vbus.record.format import Entry
from vbus.record.replay import Outcome, Replay
from vbus.views.clauses import clause_frame
from vbus.views.scope.axis_sampler import AxisSampler, SampleSchedule
from vbus.views.scope.frames import (  # fmt: skip
    ALL,
    CHIPS,
    LABELS,
    MARKS,
    NOW,
    PACKETS,
    SAMPLES,
    WORDS,
    Column,
    frame,
    kinds,
    small,
    texts,
)
from vbus.views.scope.lane import Lane
from vbus.views.scope.lanes import GAP_MARK, MARK_LANE, Lanes, Lateness

COMMAND: Final = 0
WRITTEN: Final = 1
READ: Final = 2
STATUS_READ: Final = 3
VIOLATED: Final = 4
OTHER: Final = 5
"""Kinds of packets."""

MOST_ROWS: Final = 8192
"""Rows of a frame at most: a page reads one after the other, and can draw between them.
250,000 rows a second are 30 frames (docs/performance.md)."""

Columns = Callable[[Sequence[float]], Column]


class Recorder(PacketReader):
    """Records every lane of a board from :meth:`start` to :meth:`stop`.

    Args:
        board: the board.
        edges: take every edge of its pins at its instant, which leaves traces in saved states; or
            else look at the levels when samples are made.
        strobes: record the lines of the host buses too; with ``edges`` alone.
        late: of a board that runs now: tells how it keeps to the wall clock.
    """

    def __init__(
        self,
        board: Board,
        edges: bool,
        strobes: bool = False,
        late: Callable[[], Lateness] | None = None,
    ) -> None:
        self.board: Board = board
        self.lanes: Lanes = Lanes(board, strobes and edges, late and late())
        self._late: Callable[[], Lateness] | None = late
        self._edges: bool = edges
        self._running: bool = False
        self._at_samples: bool = True
        self._looks: dict[str, AxisSampler] = {}
        times = SampleSchedule(board.kernel)
        for chip in board.chips:
            mine = {pin.net.name for pin in chip.pins.values()} if not edges else ()
            levels = [row for name, row in self.lanes.nets.items() if name in mine]
            self._looks[chip.name] = look = AxisSampler(board, times, chip, self.lanes, levels)
            look.on_interrupt = self._interrupt
        self._labels: dict[tuple[str, str], int] = {}
        self._new: list[tuple[str, str]] = []
        """Labels that are not sent yet: what a packet says, and its cycles."""
        self._described: bool = False
        self._broken: dict[str, list[tuple[int, dict[str, Any]]]] = {}
        """Violations by chip since its latest packet."""
        self._hosts: set[str] = set()
        self._commanded: set[str] = {
            chip.name for chip in board.chips if isinstance(decoder_of(chip.FAMILY), CommandPackets)
        }
        self._known_until: int = -1
        self._taken: int = 0
        """When frames were taken last (ps)."""

    def start(self, after: int = -1) -> None:
        """Begin to record.

        Args:
            after: what happens until then (ps) is known already; it is left out.
        """
        self._running = True
        self._known_until = after
        # A node that has come back makes again what the page has seen.
        if after > self.board.now:
            self.board.kernel.onlooker(self._leave_out_known).at(after)
        if self._edges:
            for net, lane in self.lanes.nets.values():
                net.observe(self)
                lane.note(self.board.now, net.value)
        self.board.observe(self)
        for look in self._looks.values():
            look.look()
            # Pages of a run that is over may ask for any register; of a live one they say when.
            look.look_inside(self._edges)

    def look_inside(self, on: bool) -> None:
        """Record the registers of every chip from now on, or no longer."""
        for look in self._looks.values():
            look.look_inside(on and self._running)

    def look_at_samples(self, on: bool) -> None:
        """Take down each sample from now on, or only what holds when frames are taken."""
        self._at_samples = on
        for look in self._looks.values():
            look.look_at_samples(on)

    def stop(self) -> None:
        """Record no more; may be called again."""
        if self._running:
            self._running = False
            if self.board.stream is not None:
                self.board.stream.finish(self)
            self.board.unobserve(self)
            for look in self._looks.values():
                look.stop()
            for net, _ in self.lanes.nets.values() if self._edges else ():
                net.unobserve(self)

    # -- what happens -------------------------------------------------------------------------

    def edge(self, when: int, net: str, level: int) -> None:
        """Take down an edge."""
        self.lanes.nets[net][1].note(when, level)

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Mark a host's first, and look at a chip that rested."""
        if host not in self._hosts:
            self._hosts.add(host)
            self._mark(when, host, "host")
        for name in chip.split("+"):
            if name in self._looks:
                self._looks[name].meet(write, address, data)

    def packet(self, chip: str, packet: Packet) -> None:
        """Take down a packet."""
        said = packet.cited, " ".join(map(_cycle, packet.cycles))
        label = self._labels.get(said)
        if label is None:
            label = self._labels[said] = len(self._labels)
            self._new.append(said)
        kind = self._kind(chip, packet)
        # A breach is known before the packet it is in.
        for when, mark in self._broken.pop(chip, ()):
            # A breach between two packets belongs to neither.
            if packet.begin <= when <= packet.end:
                mark["label"] = label
                kind = VIOLATED
        length = packet.end - packet.begin
        inner = [cycle.when - packet.begin for cycle in packet.cycles[1:-1]]
        self.lanes.packets[chip].rows.append((packet.begin, length, label, kind, inner or 0))

    def _kind(self, chip: str, packet: Packet) -> int:
        if packet.kind == STATUS:
            return STATUS_READ
        if packet.kind == IGNORED:
            return VIOLATED
        if packet.kind != WHOLE:
            return OTHER
        if chip in self._commanded:
            return COMMAND
        return WRITTEN if packet.cycles[0].write else READ

    def violation(self, violation: Violation) -> None:
        """Mark a breach."""
        v = violation
        mark = self._mark(v.when, f"{v.chip}: {v.detail}", "violation", v.rule, v.clause)
        self._broken.setdefault(v.chip, []).append((v.when, mark))

    def fault(self, when: int, name: str, target: str, what: str, text: str) -> None:
        """Mark what a fault does, and look at every chip."""
        self._mark(when, f"{name} {target}: {what}" + (f"; {text}" if text else ""), "fault")
        for look in self._looks.values():
            look.wake()

    def _interrupt(self, text: str) -> None:
        self._mark(self.board.now, text, "interrupt")

    def _mark(
        self, when: int, text: str, kind: str, rule: str | None = None, clause: str | None = None
    ) -> dict[str, Any]:
        mark = {"text": text, "kind": kind, "rule": rule, "clause": clause, "label": None}
        self.lanes.marks[kind].rows.append((when, mark))
        return mark

    # -- frames -------------------------------------------------------------------------------

    def take(self, column: Columns = small) -> list[bytes]:
        """Return what is new as frames, those that last first and how far time has come last.

        Args:
            column: how numbers are written.
        """
        if self._late is not None:
            self._note_lateness(self._late())
        # Sparse: one value for each message, four a second.
        if not self._at_samples and self._running:
            for look in self._looks.values():
                look.look()
        if self.board.now <= self._known_until:
            self._leave_out_known()
        frames = []
        if not self._described:
            self._described = True
            chips = [look.registers.described for look in self._looks.values()]
            frames.append(frame(CHIPS, ALL, len(chips), 0, texts(chips)))
        if self._new:
            said, cycles = zip(*self._new, strict=True)
            frames.append(frame(LABELS, ALL, len(said), 0, texts(said), texts(cycles)))
            self._new = []
        words = [row for look in self._looks.values() for row in look.registers.take_words()]
        if words:
            frames.append(frame(WORDS, ALL, len(words), 0, texts(words)))
        ticks = Ticks(column)
        for lane in self.lanes.all:
            if lane.times:
                frames += sample_frames(lane, column, ticks)
            if not lane.rows:
                continue
            rows, lane.rows = lane.rows, []
            rows.sort(key=itemgetter(0))  # some are known later than others that began after them
            # A page draws between two frames: it never stands still for a long one.
            for place in range(0, len(rows), MOST_ROWS):
                frames.append(_rows(lane, rows[place : place + MOST_ROWS], column))
        self._taken = self.board.now
        return [*frames, frame(NOW, ALL, 0, self.board.now)]

    def _note_lateness(self, late: Lateness) -> None:
        lanes, now = self.lanes, int(self.board.now)
        if lanes.lag is not None and lanes.overload is not None:
            lanes.lag.note(now, late.lag * 1e-12)
            lanes.overload.note(now, late.overload)
        if lanes.skew is not None and late.skew is not None:
            lanes.skew.note(now, late.skew * 1e-9)

    def leave_out(self) -> None:
        """Forget what is new, and take down every value once more: there is no room for it.

        The labels stay: those of later packets are counted from the first.
        """
        for lane in self.lanes.all:
            lane.forget()
        if GAP_MARK in self.lanes.marks:
            unseen = self.board.now - self._taken
            text = f"{unseen * 1e-12:.3f} s from here on are left out: the scope did not keep up"
            self._mark(self._taken, text, GAP_MARK)

    def _leave_out_known(self) -> None:
        """Forget what is new; the values go on from those there are."""
        for lane in self.lanes.all:
            lane.leave_out()


class Ticks:
    """Columns of instants, each made once: many lanes change at the same.

    Args:
        column: how numbers are written.
    """

    def __init__(self, column: Columns) -> None:
        self._column: Columns = column
        self._made: dict[tuple[int, int, int], tuple[list[int], Column]] = {}
        """By first, last and number: instants, and their column."""

    def column(self, times: list[int]) -> Column:
        """Return instants (ps), each as ticks since the first."""
        first = times[0]
        key = first, times[-1], len(times)
        known, made = self._made.get(key, (None, None))
        if made is None or times != known:
            made = self._column([when - first for when in times])
            self._made[key] = times, made
        return made


def sample_frames(lane: Lane, column: Columns, ticks: Ticks) -> list[bytes]:
    """Return the values of a lane that are not sent yet as frames."""
    times, values = lane.take_values()
    if len(times) <= MOST_ROWS:
        return [_samples(lane, times, values, column, ticks)]
    return [
        _samples(lane, times[at : at + MOST_ROWS], values[at : at + MOST_ROWS], column, ticks)
        for at in range(0, len(times), MOST_ROWS)
    ]


def _samples(
    lane: Lane, times: list[int], values: list[float], column: Columns, ticks: Ticks
) -> bytes:
    columns = ticks.column(times), column(values)
    return frame(SAMPLES, lane.number, len(times), times[0], *columns)


def _rows(lane: Lane, rows: list[tuple[Any, ...]], column: Columns) -> bytes:
    """Return some packets or marks as a frame."""
    first = rows[0][0]
    begins, *others = zip(*rows, strict=True)
    columns = [column([begin - first for begin in begins])]
    if lane.kind == MARK_LANE:
        kind = MARKS
        columns.append(texts(others[0]))
    else:
        kind = PACKETS
        lengths, labels, sorts, inner = others
        columns += [column(lengths), column(labels), kinds(sorts), texts(inner)]
    return frame(kind, lane.number, len(rows), first, *columns)


def _cycle(cycle: Cycle) -> str:
    """Return which way, address and byte: ``w0 1F``."""
    return f"{'w' if cycle.write else 'r'}{cycle.address:X} {cycle.data:02X}"


@dataclass(frozen=True, slots=True)
class Recorded:
    """The lanes of a run that is over.

    Attributes:
        description: what a page gets first.
        frames: all that happened.
        outcome: what came of the replay.
    """

    description: dict[str, Any]
    frames: list[bytes]
    outcome: Outcome


def replayed(
    board: Board, entries: Iterable[Entry], families: dict[str, str], strobes: bool = False
) -> Recorded:
    """Play a journal up to its end, or the first difference; return its lanes.

    Args:
        board: built from the same file, at instant 0, with no ports open.
        entries: the journal's.
        families: chip families by name of chip.
        strobes: whether the lines of the host buses are lanes too.
    """
    recorder = Recorder(board, edges=True, strobes=strobes)
    recorder.start()
    outcome = Replay(board, entries, families).run()
    recorder.stop()
    frames = [clause_frame(families.values()), *recorder.take()]
    return Recorded(recorder.lanes.described(live=False), frames, outcome)
