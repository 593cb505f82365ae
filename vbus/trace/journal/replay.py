"""A journal played again: the same calls at the same instants, and the first difference."""

import copy
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import zip_longest
from operator import attrgetter
from typing import Any, Final

from vbus.board.board import Board
from vbus.signals import Observer, Violation
from vbus.trace.decode import decoder_of, settings_for_decoders
from vbus.trace.journal.format import Entry
from vbus.trace.journal.journal import end_of, version_of
from vbus.trace.journal.player import Player
from vbus.trace.journal.view import Sessions, violation_of
from vbus.trace.packets import Cycle, Decoder, Packet

LOOKAHEAD: Final = 64
"""Entries played on beyond a difference, to decode the whole packet it stands in."""


@dataclass(frozen=True, slots=True)
class Divergence:
    """The first place where a run differs from its journal.

    Attributes:
        entry: number of the entry.
        when: instant (ps).
        what: what differs: ``"reply"``, ``"instant"``, ``"violation"``, ``"missing"`` (happened
            now, not in the journal), ``"unconsumed"`` (in the journal, did not happen) or
            ``"state"``.
        where: host, chip and call.
        recorded: the journal's side, decoded.
        now: the present side, decoded.
        clause: clause of the specification it falls under, or "".
    """

    entry: int
    when: int
    what: str
    where: str
    recorded: str
    now: str
    clause: str = ""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a replay.

    Attributes:
        entries: entries played.
        cycles: bus cycles among them.
        divergence: the first difference, or None.
        ended: whether the journal was closed properly, so that the final state was compared.
    """

    entries: int
    cycles: int
    divergence: Divergence | None
    ended: bool


class _Findings(Observer):
    """Violations by chip, and cycles that were ordered: what the journal has and what the run has.

    Each is kept until it is matched.
    """

    def __init__(self) -> None:
        self.recorded: dict[str, deque[tuple[int, Violation]]] = {}
        self.found: dict[str, deque[tuple[int, Violation]]] = {}
        self.entry: int = 0
        self.ordered: deque[tuple[int, tuple[Any, ...]]] = deque()
        """Bus cycles that came of orders, in the journal."""
        self.made: deque[tuple[int, tuple[Any, ...]]] = deque()
        """Those of the run."""

    def outside(self, order: str, values: list[object]) -> None:
        """Note a bus cycle of the run that came of an order."""
        if order == "made":
            self.made.append((self.entry, tuple(values)))

    def violation(self, violation: Violation) -> None:
        """Note one of the run."""
        self.found.setdefault(violation.chip, deque()).append((self.entry, violation))

    def expect(self, entry: Entry) -> None:
        """Note one of the journal."""
        violation = violation_of(entry)
        self.recorded.setdefault(violation.chip, deque()).append((entry.number, violation))

    def compare(self) -> Divergence | None:
        """Match pairs; return the first that differ. A chip finds its own in their order."""
        for chip, recorded in self.recorded.items():
            found = self.found.get(chip)
            while found and recorded:
                number, was = recorded.popleft()
                _, now = found.popleft()
                if was != now:
                    lines = line_of(was), line_of(now)
                    return Divergence(number, was.when, "violation", chip, *lines, was.clause)
        while self.ordered and self.made:
            number, cycle = self.ordered.popleft()
            _, again = self.made.popleft()
            if cycle != again:
                lines = cycle_line(cycle), cycle_line(again)
                return Divergence(number, cycle[0], "reply", _orderer(cycle), *lines)
        return None

    def rest(self) -> Divergence | None:
        """Return the earliest violation that stands on one side only."""
        left = [
            Divergence(number, v.when, "unconsumed", v.chip, line_of(v), "nothing", v.clause)
            for queue in self.recorded.values()
            for number, v in queue
        ] + [
            Divergence(number, v.when, "missing", v.chip, "nothing", line_of(v), v.clause)
            for queue in self.found.values()
            for number, v in queue
        ]
        for queue, what in ((self.ordered, "unconsumed"), (self.made, "missing")):
            for number, cycle in queue:
                sides = (cycle_line(cycle), "nothing")
                was, now = sides if what == "unconsumed" else sides[::-1]
                left.append(Divergence(number, cycle[0], what, _orderer(cycle), was, now))
        return min(left, key=attrgetter("entry"), default=None)


def cycle_line(cycle: tuple[Any, ...]) -> str:
    """Return a bus cycle that came of an order in one line."""
    when, _, _, write, address, data = cycle
    return f"{'w' if write else 'r'} {address:X} {data:02X} at {when} ps"


def _orderer(cycle: tuple[Any, ...]) -> str:
    return f"{cycle[1]}, {cycle[2]}: ordered cycle"


def line_of(violation: Violation) -> str:
    """Return a violation in one line."""
    v = violation
    return f"{v.rule} at {v.when} ps, measured {v.measured}, limit {v.limit}: {v.detail}"


class Replay:
    """Plays a journal on a board built from the same file.

    Args:
        board: the board, at instant 0, with no ports open.
        entries: the journal's entries, in order.
        families: chip families by name of chip, for decoding.
        progress: called with the entries played, now and then.
    """

    def __init__(
        self,
        board: Board,
        entries: Iterable[Entry],
        families: dict[str, str],
        progress: Callable[[int], None] | None = None,
    ) -> None:
        self.board: Board = board
        settings = settings_for_decoders(board.chips)
        self._entries: Iterator[Entry] = iter(entries)
        self._decoders: dict[str, Decoder] = {
            name: decoder_of(family, settings.get(name, {})) for name, family in families.items()
        }
        self._progress: Callable[[int], None] | None = progress
        self._player: Player = Player(board)
        self._sessions: Sessions = Sessions()
        self._findings: _Findings = _Findings()
        self._strobed: list[Entry] = []
        """Cycles of the journal that strobes made in the call that comes next."""
        self._found: list[tuple[Any, ...]] = []
        """Those of the run."""
        self._cycles: int = 0
        self._played: int = 0
        board.listen(self._findings)

    def run(self) -> Outcome:
        """Play everything, or up to the first difference."""
        ended = False
        for entry in self._entries:
            if entry.number != self._played:
                return self._stop(
                    Divergence(
                        self._played, entry.when, "missing", "the journal",
                        f"entry {entry.number} stands where {self._played} belongs", "",
                    )
                )  # fmt: skip
            self._played += 1
            if self._progress is not None and not self._played & 0xFFF:
                self._progress(self._played)
            self._findings.entry = entry.number
            if ended:
                return self._stop(
                    Divergence(entry.number, entry.when, "unconsumed", "the end", entry.op, "")
                )
            if entry.op == "violation":
                self._findings.expect(entry)
                continue
            if entry.op == "made":
                self._findings.ordered.append((entry.number, entry.args))
                self._cycles += 1
                continue
            if entry.op == "fault":
                continue
            if entry.op == "cycle":
                self._strobed.append(entry)
                continue
            difference = self._end(entry) if entry.op == "end" else self._entry(entry)
            ended = entry.op == "end"
            # What a chip found before this call comes before a difference in the call itself.
            difference = self._findings.compare() or self._compare_strobed(entry) or difference
            if difference is not None:
                return self._stop(difference)
        if not ended:
            self.board.catch_up()
        return Outcome(self._played, self._cycles, self._findings.compare(), ended)

    def _stop(self, difference: Divergence) -> Outcome:
        """Return ``difference``, unless a violation was missed before it."""
        self.board.catch_up()
        missed = self._findings.compare() or self._findings.rest()
        if missed is not None and missed.entry < difference.entry:
            difference = missed
        return Outcome(self._played, self._cycles, difference, False)

    def _end(self, entry: Entry) -> Divergence | None:
        """Compare the end: number of entries, violations, and the whole state."""
        count, state, telemetry, observations = entry.args
        if count != entry.number:
            return Divergence(
                entry.number, entry.when, "unconsumed", "the end", f"{count} entries before it",
                f"{entry.number} entries before it",
            )  # fmt: skip
        self._player.run_to(entry)
        self.board.catch_up()
        left = self._findings.compare() or self._findings.rest()
        if left is not None:
            return left
        state_now, telemetry_now, observations_now = end_of(self.board, version_of(state))
        same = telemetry_now == telemetry and (
            bool(observations or observations_now) or state_now == state
        )
        if not same:
            return Divergence(
                entry.number, entry.when, "state", "the end", f"state hash {state}",
                f"state hash {state_now}: all replies agree, but the board stands otherwise",
            )  # fmt: skip
        return None

    def _entry(self, entry: Entry) -> Divergence | None:
        self._player.run_to(entry)
        if self.board.now != entry.when:
            where = f"{self._sessions.host(entry)}: {entry.op}"
            return Divergence(
                entry.number, entry.when, "instant", where, f"called at {entry.when} ps",
                f"it is {self.board.now} ps already",
            )  # fmt: skip
        reply, error = self._call(entry)
        self._sessions.follow(entry)
        same = _settled(entry.op, reply) == _settled(entry.op, entry.reply)
        same = same and error == entry.error
        if entry.op in ("read", "write") and not error and not entry.error:
            self._cycles += 1
            if not same:
                return self._decoded(entry, reply)
            write = entry.op == "write"
            data = entry.args[1] if write else reply
            self._feed(self._sessions.chip(entry), Cycle(entry.after, write, entry.args[0], data))
        if not same:
            return Divergence(
                entry.number, entry.when, "reply", self._where(entry),
                _answer(entry.reply, entry.error), _answer(reply, error),
            )  # fmt: skip
        if self.board.now != entry.after:
            return Divergence(
                entry.number, entry.when, "instant", self._where(entry),
                f"returned at {entry.after} ps", f"returned at {self.board.now} ps",
            )  # fmt: skip
        return None

    def _compare_strobed(self, call: Entry) -> Divergence | None:
        """Compare the bus cycles that strobes have made in a call."""
        pairs = list(zip_longest(self._strobed, self._found))
        self._strobed.clear()
        self._found.clear()
        for was, now in pairs:
            if was is not None and was.args == now:
                self._cycles += 1
                self._feed(now[0], Cycle(was.after, *now[1:]))
                continue
            entry = was or call
            both = [was.args if was is not None else None, now]
            sides = [
                self._side(args[0], cycle := Cycle(entry.after, *args[1:]), str(cycle))
                if args is not None
                else _Side(None, None, "nothing")
                for args in both
            ]
            kind = "reply" if was and now else "unconsumed" if was else "missing"
            where = f"{self._sessions.host(call)}, {next(filter(None, both))[0]}: strobes"
            return _difference(entry.number, entry.when, kind, where, sides)
        return None

    def _side(self, chips: str, cycle: Cycle, shown: str) -> "_Side":
        """Return one side of a difference in a cycle; its packet is that of the first chip."""
        return _Side(self._decoders.get(chips.partition("+")[0]), cycle, shown)

    def _feed(self, chips: str, cycle: Cycle) -> None:
        for chip in chips.split("+"):
            if chip in self._decoders:
                self._decoders[chip].feed(cycle)

    def _where(self, entry: Entry) -> str:
        asked = " ".join(f"{arg:X}" if isinstance(arg, int) else str(arg) for arg in entry.args)
        return f"{self._sessions.host(entry)}, {self._sessions.chip(entry)}: {entry.op} {asked}"

    def _call(self, entry: Entry) -> tuple[Any, int]:
        """Make one call; return its reply and the number of its refusal."""
        answer = self._player.call(entry)
        if entry.op == "open":
            self._player.ports[entry.port].strobes.found = self._note_strobed
        return answer

    def _note_strobed(self, when: int, chip: str, write: bool, address: int, data: int) -> None:
        self._found.append((chip, write, address, data))

    def _decoded(self, entry: Entry, reply: int) -> Divergence:
        """Play on until the packet with the difference is whole on both sides."""
        chips = self._sessions.chip(entry)
        sides = [
            self._side(chips, Cycle(entry.after, False, entry.args[0], data), f"{data:02X}H")
            for data in (entry.reply, reply)
        ]
        for _ in range(LOOKAHEAD):
            following = None if all(side.known() for side in sides) else next(self._entries, None)
            if following is None or following.op not in ("read", "write") or following.error:
                break
            self._player.run_to(following)
            again, error = self._call(following)
            if self._sessions.chip(following) != chips or error:
                continue
            write = following.op == "write"
            for side, data in zip(sides, (following.reply, again), strict=True):
                data = following.args[1] if write else data
                side.feed(Cycle(following.after, write, following.args[0], data))
        return _difference(entry.number, entry.after, "reply", self._where(entry), sides)


class _Side:
    """One side of a difference: a bus cycle, and the packet it turns out to be in.

    Args:
        decoder: of the chip, as it stood before the cycle; None if there is none.
        cycle: the cycle; None if this side has none.
        shown: what people are told of it.
    """

    def __init__(self, decoder: Decoder | None, cycle: Cycle | None, shown: str) -> None:
        self._decoder: Decoder | None = copy.deepcopy(decoder)
        self._cycle: Cycle | None = cycle
        self._shown: str = shown
        self.packet: Packet | None = None
        if cycle is not None:
            self.feed(cycle)

    def known(self) -> bool:
        """Tell whether nothing that follows can tell more of the packet."""
        return self.packet is not None or self._decoder is None

    def feed(self, cycle: Cycle) -> None:
        """Take the cycle itself, or one that follows."""
        self._take(self._decoder.feed(cycle) if self._decoder is not None else ())

    def finish(self) -> None:
        """Nothing follows: a packet that is still open is cut short."""
        self._take(self._decoder.finish() if self._decoder is not None else ())

    def _take(self, packets: Iterable[Packet]) -> None:
        mine = (packet for packet in packets if self._cycle in packet.cycles)
        self.packet = self.packet or next(mine, None)

    def __str__(self) -> str:
        return f"{self._shown} in {self.packet.text}" if self.packet is not None else self._shown


def _difference(number: int, when: int, what: str, where: str, sides: list[_Side]) -> Divergence:
    """Return the difference between two sides that nothing follows; see :class:`Divergence`."""
    for side in sides:
        side.finish()
    clause = next((side.packet.clause for side in sides if side.packet is not None), "")
    recorded, now = map(str, sides)
    return Divergence(number, when, what, where, recorded, now, clause)


def _settled(op: str, reply: Any) -> Any:
    """Return what of a reply is the same whoever watches the board.

    How long SYNC promises that no output moves is a lower bound: it is shorter while somebody, a
    waveform for instance, watches lines of the chip.
    """
    return reply[0] if op == "sync" and reply is not None else reply


def _answer(reply: Any, error: int) -> str:
    return f"refused, number {error}" if error else str(reply)
