"""How long a host may go on before it is said to hang, counted in chip time and bus cycles."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

from vbus.board.board import Board
from vbus.board.snapshot import fork
from vbus.chips.base import Chip
from vbus.chips.packets import Packet
from vbus.circuit.stream import LatestLines, PacketReader
from vbus.core.errors import SnapshotError
from vbus.core.kernel import END, MS, NEVER, SECOND
from vbus.core.signals import Violation
from vbus.core.wall_clock import monotonic, process_time
from vbus.faults.armed import BEGUN
from vbus.protocols.quantities import format_instant
from vbus.views.findings.report import NoEffect

LAST_LINES: Final = 40
"""Lines of a transcript that are stored: a screen of them."""
AGAIN: Final = "the same polls again"
"""The line for several polls in turn that read nothing new, so that they hide no other line."""
UNBOUNDED: Final = 1 << 62
"""More than any host does."""
IN_VAIN: Final = 10_000
"""Polls that read nothing new, after which a host hangs if nothing on its board can change. Not
measured."""
POLLING: Final = 10.0
"""Seconds of wall time after which one hangs that might be, where time is the wall clock's: far
above the stalls of a busy machine."""
PATIENCE: Final = 120.0
"""The same where time is virtual: a machine that has not come to a verdict by then is too slow."""
LOOK: Final = 1000
"""Polls after which the wall clock is looked at: a look costs a fraction of one poll."""
FOREKNOWN: Final = 10
"""Times as many polls are allowed where something moves: a host may pass time by polls."""
LOOKS_AHEAD: Final = 16
"""Looks at a twin of the board, each twice as far ahead as the one before; not measured."""
GRACE: Final = 10_000
"""Bus cycles, and milliseconds of chip time, that are left to a host that hung and is to end; not
measured."""


KINDS: Final = 16
"""Packets that a loop of polls may consist of: fewer would miss loops over several axes, and each
more is compared with every packet."""
COMMANDS: Final = 8
"""Packets before the polls that a message shows: what the host waits for is among them.
Not measured."""


class Polls:
    """Counts packets that a host has read, all of which it knew from the polls before them.

    A packet with other values is news, and so is whatever the host writes.

    Args:
        every: how many it takes to have a look at them, and then how many more.

    Attributes:
        count: how many there are since the last news.
        commands: the latest of what the host has written.
    """

    def __init__(self, every: int) -> None:
        self.count: int = 0
        self.commands: LatestLines = LatestLines(maxlen=COMMANDS)
        self._every: int = every
        self._look_at: int = every
        self._known: set[str] = set()
        self._seen: dict[str, Packet] = {}
        self._since: int = 0
        self._begun: float = 0.0
        self._worked: float = 0.0
        self._before: float = 0.0
        self._seconds: float = 0.0
        """What :meth:`seconds` has returned; of polls before the last news, ``_before``."""

    def take(self, packet: Packet, text: str) -> bool:
        """Take a packet and what it says; tell whether to have a look."""
        if text in self._known:
            self.count += 1
            self._seen[text] = packet
            if self.count < self._look_at:
                return False
            self._look_at += self._every
            return True
        before = self._seconds
        self.reset()
        if packet.cycles[-1].write:
            self.commands.add(packet.end, text)
            self._known.clear()
        else:
            self._seconds = before
            if len(self._known) == KINDS:
                self._known.clear()
            self._known.add(text)
        self._since = packet.end
        return False

    def reset(self) -> None:
        """Count anew."""
        self.count = 0
        self._look_at = self._every
        self._seen.clear()
        self._begun = self._seconds = 0.0

    def seconds(self) -> float:
        """Return the wall time of polls in which this was asked about them, since the last write.

        It is at most twice the time that the processor had for them: on a busy machine no host
        hangs sooner.
        """
        if not self._begun:
            self._begun, self._worked = monotonic(), process_time()
            self._before = self._seconds
        else:
            took = min(monotonic() - self._begun, 2 * (process_time() - self._worked))
            self._seconds = self._before + took
        return self._seconds

    def loop(self) -> list[tuple[str, Packet]]:
        """Return the packets of which the polls consist, each with the name of its chip."""
        return [(text.partition(" ")[0], packet) for text, packet in self._seen.items()]

    def __str__(self) -> str:
        return f"{' and '.join(sorted(self._seen))} since {format_instant(self._since)}"


class HostStuck(BaseException):
    """A host of this process has passed one of its :class:`Limits`.

    No driver that catches every ``Exception`` and tries again can catch this one.
    """


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds of a host's run. The first three count what repeats, so a verdict repeats too.

    Attributes:
        cycles: bus cycles. Where ``polling`` is a bound, long stretches of polls that tell nothing
            new have that alone.
        chip_time: instant at which the host must be done (ps).
        polls: polls that tell nothing new, where nothing on the board can change any more.
        polling: seconds of wall time for polls that tell nothing new. Where time is virtual, this
            and ``wall`` say nothing of the host: they end what takes a machine too long.
        wall: seconds of wall time, for a host that does nothing at all on the bus.
    """

    cycles: int = 100_000
    chip_time: int = 60 * SECOND
    polls: int = UNBOUNDED
    polling: float = float("inf")
    wall: float = 60.0


class HostWatch(PacketReader):
    """Counts a host's bus cycles, keeps the last ones in the manual's words, and knows its limits.

    Args:
        board: the board; the watch observes it from now on.
        limits: the bounds.
        over: is called, with a sentence, when a bound is passed.
        times: begin each line with the instant of its first packet's end.

    Attributes:
        over: called at a bound; may be replaced while the board runs.
        ended: whether the host must not go on.
        stuck: which bound was passed first, as a sentence; "" if none was.
        slow: whether that is one of wall time on a board whose time is virtual.
        details: what it polled and what was commanded before, once a bound has been passed.
    """

    def __init__(
        self,
        board: Board,
        limits: Limits,
        over: Callable[[str], None] | None = None,
        times: bool = False,
    ) -> None:
        self._connectors: set[str] = {chip.name for chip in board.chips if chip.CONNECTOR}
        self._reached: int = -1
        """Instant of the latest cycle at a chip: the access on a card's bus that has made it comes
        after it, and is no cycle more."""
        self.cycles: int = 0
        self.over: Callable[[str], None] | None = over
        self.ended: bool = False
        self.stuck: str = ""
        self.slow: bool = False
        self.details: list[str] = []
        self._named: bool = False
        self.violations: list[Violation] = []
        self.faulted: dict[str, int] = {}
        """Instant at which a fault first began, by chip; "" is a link, and so every chip."""
        self.no_effect: NoEffect = NoEffect()
        """Which bus cycles had no effect."""
        self._board: Board = board
        self._chips: list[str] = [chip.name for chip in board.chips]
        self._lines: LatestLines = LatestLines(maxlen=LAST_LINES)
        self._limits: Limits = limits
        self._most: int = limits.cycles
        self._news_at: int = 0
        """Until this instant the polls are known to read something new (ps)."""
        self._ahead: list[str] = []
        """How the chips would be when the chip time is over, if the polls are in vain till then."""
        self._judged: int = 0
        """Bus cycles before the stretch of polls that has not been looked at yet."""
        self._until: int = limits.chip_time
        self._polls: Polls = Polls(min(limits.polls, LOOK))
        self._to_look: bool = False
        """Whether the packet before the next cycle asks for a look at the polls."""
        self._times: bool = times
        self._timer = board.kernel.onlooker(self._late)
        """Runs when the chip time is over, also of a host that makes no bus cycle."""
        self._set_timer()
        board.observe(self)
        for found in board.violations:  # a clock that the part does not take
            self.violation(found)

    @property
    def lines(self) -> list[str]:
        """The latest packets and violations."""
        return [
            f"{format_instant(line.when)} {line.counted()}" if self._times else line.counted()
            for line in self._lines
        ]

    def packet(self, chip: str, packet: Packet) -> None:
        """Note what bus cycles say."""
        if chip in self._connectors and packet.end == self._reached:
            return
        self.no_effect.add(packet)
        text = f"{chip} {packet.text}"
        polls, lines = self._polls, self._lines
        # One strobe may reach several chips: any of their packets may ask for it.
        self._to_look = polls.take(packet, text) or self._to_look
        if not polls.count:
            self._judged = self.cycles + 1  # the cycle itself comes after its packets
        lines.add(packet.end, AGAIN if polls.count and lines[-1].text != text else text)

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Count a cycle."""
        if chip in self._connectors:
            if when == self._reached:
                return
        else:
            self._reached = when
        self.cycles += 1
        if self._to_look:
            self._to_look = False
            self._look()
        if self.cycles > self._most:
            beside = self._most - self._limits.cycles
            but = f", beside {beside} of polls that gave it nothing new" if beside > 0 else ""
            self.pass_bound(f"it made more than {self._limits.cycles} bus cycles{but}")

    @property
    def left(self) -> int:
        """How much chip time is left (ps)."""
        return max(self._until - self._board.now, 0)

    def _set_timer(self) -> None:
        due = max(self._until + 1, self._board.now)
        self._timer.at(due if due <= END else NEVER)

    def _late(self) -> None:
        self.pass_bound(f"it was not done after {self._limits.chip_time / SECOND:g} s of chip time")

    def _look(self) -> None:
        """Many polls have read nothing new: find out whether more of them could."""
        polls, limits = self._polls, self._limits
        if polls.count >= limits.polls and self._unchanging():
            self.pass_bound(
                f"it polled {polls.count} times and read nothing new, and nothing on the board"
                f" can change any more: {polls}"
            )
        elif polls.count >= FOREKNOWN * limits.polls and self._in_vain():
            self.pass_bound(
                f"it polled {polls.count} times and read nothing new, and would read nothing"
                f" new before {format_instant(self._until)} of chip time: {polls}"
            )
        elif polls.seconds() > limits.polling:
            self.pass_wall(
                f"it has polled for {limits.polling:g} s of wall time and read nothing new (if"
                ' it may: let time pass between polls, or raise its budget of "polling"):'
                f" {polls}"
            )
        elif limits.polling < float("inf"):
            self._most += self.cycles - self._judged
            self._judged = self.cycles

    def _unchanging(self) -> bool:
        """Whether the board knows that nothing changes unless this host does something else."""
        board = self._board
        return (
            len(board.ports) <= 1
            and board.beyond is None  # else other nodes may change it
            and not board.disturbed
            and board.kernel.next_due == NEVER
            and all(chip.resting() for chip in board.chips)
        )

    def _in_vain(self) -> bool:
        """Whether the polls read nothing new before the chip time is over.

        A twin of the board is let run, so that chip time decides and not the wall clock. Only where
        nothing but its chips and plants is known to act on the board.
        """
        board = self._board
        if (
            board.policy == "realtime"
            or board.now < self._news_at
            or self._until > END
            or len(board.ports) > 1
            or board.beyond is not None
            or board.disturbed
            or board.kernel.next_due != NEVER
        ):
            return False
        self._news_at = END
        loop = self._polls.loop()
        if any(name in self._connectors for name, _ in loop):
            return False
        try:
            twin = fork(board)
        except SnapshotError:  # made in Python, or with a part of the caller's own
            return False
        start, span = board.now, self._until - board.now
        for look in reversed(range(LOOKS_AHEAD)):
            twin.run_until(max(start + (span >> look), twin.now))
            if any(not _again(twin, name, packet) for name, packet in loop):
                self._news_at = twin.now
                return False
        self._ahead = [
            f"{chip.name} would have {values} at {format_instant(twin.now)}"
            for chip in twin.chips
            if (values := _values(chip))
        ]
        return True

    def violation(self, violation: Violation) -> None:
        """Note a violation; the packet of a cycle that is lost for it says so itself."""
        self.violations.append(violation)
        stream = self._board.stream
        if stream is not None and stream.loses(violation):
            return
        text = f"{violation.chip} ! {violation.rule}: {violation.detail}"
        self._lines.add(violation.when, text)

    def fault(self, when: int, name: str, target: str, what: str, text: str) -> None:
        """Remember on which chip a fault has begun."""
        if what == BEGUN:
            chip = target.partition(".")[0]
            self.faulted.setdefault(chip if chip in self._chips else "", when)

    def pass_wall(self, sentence: str) -> None:
        """A bound of wall time is passed: where time is virtual, that says nothing of the host."""
        board = self._board
        if board.policy != "realtime" and not self.stuck:
            self.slow = True
            sentence += (
                f"; by then it had made {self.cycles} bus cycles, at {format_instant(board.now)} of"
                " chip time, and its budgets of both were not used up"
            )
        self.pass_bound(sentence)

    @property
    def progress(self) -> tuple[int, int]:
        """Bus cycles, and the instant (ps): what stands still while a host does nothing."""
        return self.cycles, self._board.now

    def pass_bound(self, sentence: str, threads: Sequence[str] = ()) -> None:
        """Say that the host hangs, and what its threads do, and let it end."""
        self.ended = True
        self._most = min(self._most, self.cycles)
        if not self.stuck:
            self.stuck = sentence
            self.details = [*threads, *self._detailed()]
            self._named = bool(threads)
        if self.over is not None:
            self.over(self.stuck)

    def add_threads(self, threads: Sequence[str]) -> None:
        """Say what the host's threads do, unless that was said when it passed its bound."""
        if self.ended and not self._named:
            self._named = True
            self.details += threads

    def _detailed(self) -> Iterator[str]:
        for chip in self._board.chips:
            values = _values(chip)
            if values:
                yield f"{chip.name} has {values}"
        yield from self._ahead
        if self._polls.commands:
            yield "commands before:"
        for line in self._polls.commands:
            yield f"    {format_instant(line.when)} {line.counted()}"
        for left in self._board.left_over():
            yield f"{left.chip} notes {left.rule}: {left.detail}"

    def check(self) -> None:
        """End a host that must not go on.

        Raises:
            HostStuck: it has passed a bound; again whenever it asks for more.
        """
        __tracebackhide__ = True
        if self.ended:
            raise HostStuck(self.report())

    def report(self) -> str:
        """Return the report about a host that hangs."""
        return "\n".join([self.verdict("the host hangs"), *self.details])

    def verdict(self, hangs: str) -> str:
        """Return the bound that was passed, after what it says of the host, or of the machine."""
        return f"{'the machine was too slow' if self.slow else hangs}: {self.stuck}"

    @contextmanager
    def excused(self) -> Iterator[None]:
        """Do not count the chip time that passes in the block: no host lets it pass."""
        begun = self._board.now
        self._timer.cancel()
        try:
            yield
        finally:
            self._until += self._board.now - begun
            if not self.ended:
                self._set_timer()

    def close(self) -> None:
        """Look no more: the host has come to its end."""
        self._timer.cancel()
        self._board.unobserve(self)

    def relent(self) -> None:
        """Let a host that hung put its machine in order: it may do a little more."""
        if self.ended:
            self.ended = False
            self._most = self.cycles + GRACE
            self._until = self._board.now + GRACE * MS
            self._set_timer()
            self._polls.reset()


def _values(chip: Chip) -> str:
    return ", ".join(f"{name} {value}" for name, value in chip.telemetry().items())


def _again(board: Board, name: str, packet: Packet) -> bool:
    """Make the cycles of a packet again; tell whether all that it reads is the same."""
    chip = next(one for one in board.chips if one.name == name)
    for cycle in packet.cycles:
        ready = chip.ready_at()
        if ready > END:
            return True
        board.run_until(max(board.now, ready))
        if cycle.write:
            chip.write(cycle.address, cycle.data)
            continue
        chip.begin_read(cycle.address)
        if chip.end_read() != cycle.data:
            return False
    return True
