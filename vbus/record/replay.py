"""A journal played again: the same calls at the same instants, and the first difference."""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, zip_longest
from typing import Any, Final

from vbus.board.board import Board
from vbus.chips.packets import PATIENCE, Cycle
from vbus.circuit.stream import PacketStream, settings_for_decoders
from vbus.record.again import Made, Stretch, StretchReplayer
from vbus.record.difference import Divergence, Findings, Side, difference_of
from vbus.record.format import Entry, JournalReader
from vbus.record.journal import end_of
from vbus.record.player import Player
from vbus.record.view import Sessions

# The longest packet, LTRJ of an LM628, has 15 bytes; polls stand between them.
LOOKAHEAD: Final = 64
"""Entries played on beyond a difference, to decode the whole packet it stands in."""
# As many stretches as a block has entries: a packet with its polls is far shorter.
LOOKBACK: Final = 4096
"""Stretches of equal bus cycles before a difference that are decoded, to find where its packet
begins."""
ENOUGH: Final = 2 * PATIENCE
"""Equal cycles of a stretch that are decoded: no decoder tells one more from the one before."""


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


class Replay(Player):
    """Plays a journal on a board built from the same file, and compares.

    Args:
        board: the board, at instant 0, with no ports open.
        entries: the journal's entries, in order; from a reader they are played a stretch of equal
            bus cycles at a time.
        families: chip families by name of chip, for decoding.
    """

    def __init__(self, board: Board, entries: Iterable[Entry], families: dict[str, str]) -> None:
        super().__init__(board)
        self._reader: JournalReader | None = entries if isinstance(entries, JournalReader) else None
        self._stretches: Iterator[Stretch] = (
            iter(self._reader.stretches()) if self._reader else map(_alone, entries)
        )
        self._left: Iterator[Entry] = iter(())
        """What follows of the stretch that is played."""
        self._past: deque[Made] = deque(maxlen=LOOKBACK)
        """Bus cycles that are not decoded yet."""
        self._stream: PacketStream = PacketStream(families, settings_for_decoders(board.chips))
        self._sessions: Sessions = Sessions()
        self._strobed: list[Entry] = []
        """Cycles of the journal that strobes made in the call that comes next."""
        self._making: StretchReplayer = StretchReplayer(
            board, self.ports, self._sessions, self._past
        )
        self._findings: Findings = Findings(self._making)
        self._ended: bool = False
        board.listen(self._findings)

    def run(self) -> Outcome:
        """Play everything, or up to the first difference."""
        making = self._making
        while (stretch := self._next()) is not None:
            self._left = self._expand(stretch, making.same)
            for entry in self._left:
                outcome = self._take(entry) if making.same < 0 else self._differs(entry)
                if outcome is not None:
                    return outcome
        if not self._ended:
            self.board.catch_up()
        return Outcome(making.played, making.cycles, self._findings.compare(), self._ended)

    def call(self, entry: Entry) -> tuple[Any, int]:
        """Make one call; return its reply and the number of its refusal, 0 if there was none."""
        answer = super().call(entry)
        if entry.op == "open":
            self.ports[entry.port].strobes.found = self._making
        return answer

    def _take(self, entry: Entry) -> Outcome | None:
        """Play an entry; return what came of it all if it differs."""
        making = self._making
        if entry.number != making.played:
            return self._stop(
                Divergence(
                    making.played, entry.when, "missing", "the journal",
                    f"entry {entry.number} stands where {making.played} belongs", "",
                )
            )  # fmt: skip
        making.entry = entry.number
        making.played += 1
        if self._ended:
            return self._stop(_difference(entry, "unconsumed", "the end", entry.op, ""))
        if entry.op == "violation":
            self._findings.expect(entry)
        elif entry.op == "made":
            self._findings.expect(entry)
            making.cycles += 1
        elif entry.op == "cycle":
            self._strobed.append(entry)
        elif entry.op != "fault":
            self._ended = entry.op == "end"
            return self._judge(entry, self._end(entry) if self._ended else self._entry(entry))
        return None

    def _judge(self, entry: Entry, difference: Divergence | None) -> Outcome | None:
        """Return what came of it all if a call, or what was found in it, differs."""
        # What a chip found before this call comes before a difference in the call itself.
        difference = self._findings.compare() or self._compare_strobed(entry) or difference
        return self._stop(difference) if difference is not None else None

    # -- stretches of equal cycles ----------------------------------------------------------------

    def _next(self) -> Stretch | None:
        """Return the next stretch of anything but cycles that come out as they were recorded."""
        making = self._making
        # One entry at a time, until nothing is left that a stretch could run past.
        if self._ended or self._strobed or making.found or self._findings.expecting:
            # Something is left to be compared before any cycle.
            making.same = -1
            return next(self._stretches, None)
        return making.run(self._stretches)

    def _differs(self, entry: Entry) -> Outcome | None:
        """Return what came of it all: a cycle of a stretch differs."""
        making = self._making
        making.same = -1
        return self._judge(entry, self._compare(entry, making.reply, making.error))

    def _expand(self, stretch: Stretch, made: int = 0) -> Iterator[Entry]:
        """Give the entries of a stretch, but for the first of them, which have been made."""
        number, when, span, key, value, times = stretch
        for turn in range(max(made, 0), times):
            yield (
                self._reader.entry(number + turn, when + turn * span, span, key, value)
                if self._reader
                else value
            )

    def _stop(self, difference: Divergence) -> Outcome:
        """Return ``difference``, unless a violation was missed before it."""
        self.board.catch_up()
        missed = self._findings.compare() or self._findings.rest()
        if missed is not None and missed.entry < difference.entry:
            difference = missed
        return Outcome(self._making.played, self._making.cycles, difference, False)

    def _end(self, entry: Entry) -> Divergence | None:
        """Compare the end: number of entries, violations, and the whole state."""
        count, state, telemetry, observations = entry.args
        if count != entry.number:
            return _difference(
                entry, "unconsumed", "the end", f"{count} entries before it",
                f"{entry.number} entries before it",
            )  # fmt: skip
        self.run_to(entry)
        self.board.catch_up()
        left = self._findings.compare() or self._findings.rest()
        if left is not None:
            return left
        state_now, telemetry_now, observations_now = end_of(self.board)
        same = telemetry_now == telemetry and (
            bool(observations or observations_now) or state_now == state
        )
        if not same:
            return _difference(
                entry, "state", "the end", f"state hash {state}",
                f"state hash {state_now}: all replies agree, but the board stands otherwise",
            )  # fmt: skip
        return None

    def _entry(self, entry: Entry) -> Divergence | None:
        self.run_to(entry)
        if self.board.now != entry.when:
            where = f"{self._sessions.host(entry)}: {entry.op}"
            return _difference(
                entry, "instant", where, f"called at {entry.when} ps",
                f"it is {self.board.now} ps already",
            )  # fmt: skip
        reply, error = self.call(entry)
        self._sessions.follow(entry)
        return self._compare(entry, reply, error)

    def _compare(self, entry: Entry, reply: Any, error: int) -> Divergence | None:
        """Compare what came of a call with its entry."""
        same = _settled(entry.op, reply) == _settled(entry.op, entry.reply)
        same = same and error == entry.error
        if entry.op in ("read", "write") and not error and not entry.error:
            self._making.cycles += 1
            if not same:
                return self._decoded(entry, reply)
            write = entry.op == "write"
            data = entry.args[1] if write else reply
            chips = self._sessions.chip(entry)
            self._past.append((chips, write, entry.args[0], data, entry.after, 0, 1))
        if not same:
            return _difference(
                entry, "reply", self._where(entry),
                _answer(entry.reply, entry.error), _answer(reply, error),
            )  # fmt: skip
        if self.board.now != entry.after:
            return _difference(
                entry, "instant", self._where(entry),
                f"returned at {entry.after} ps", f"returned at {self.board.now} ps",
            )  # fmt: skip
        return None

    def _compare_strobed(self, call: Entry) -> Divergence | None:
        """Compare the bus cycles that strobes have made in a call."""
        pairs = list(zip_longest(self._strobed, self._making.found))
        self._strobed.clear()
        self._making.found.clear()
        for was, now in pairs:
            # Equal cycles are decoded only if a difference follows.
            if was is not None and was.args == now:
                self._making.cycles += 1
                self._past.append((*now, was.after, 0, 1))
                continue
            self._decode_past()
            entry = was or call
            both = [was.args if was is not None else None, now]
            # The chips are named only where they differ: else the call above names them.
            elsewhere = was is not None and now is not None and was.args[0] != now[0]
            sides = [
                self._side(
                    args[0],
                    cycle := Cycle(entry.after, *args[1:]),
                    f"{args[0]} {cycle}" if elsewhere else str(cycle),
                )
                if args is not None
                else Side(None, None, "nothing")
                for args in both
            ]
            kind = "reply" if was and now else "unconsumed" if was else "missing"
            where = f"{self._sessions.host(call)}, {next(filter(None, both))[0]}: strobes"
            return difference_of(entry.number, entry.when, kind, where, sides)
        return None

    def _side(self, chips: str, cycle: Cycle, shown: str) -> "Side":
        """Return one side of a difference in a cycle; its packet is that of the first chip."""
        return Side(self._stream.decoders.get(chips.partition("+")[0]), cycle, shown)

    def _decode_past(self) -> None:
        """Decode the latest cycles: the packet of the next one may be open."""
        for chips, write, address, data, after, span, times in self._past:
            for turn in range(max(0, times - ENOUGH), times):
                self._stream.bus_cycle(after + turn * span, "", chips, write, address, data)
        self._past.clear()

    def _where(self, entry: Entry) -> str:
        asked = " ".join(f"{arg:X}" if isinstance(arg, int) else str(arg) for arg in entry.args)
        return f"{self._sessions.host(entry)}, {self._sessions.chip(entry)}: {entry.op} {asked}"

    def _decoded(self, entry: Entry, reply: int) -> Divergence:
        """Play on until the packet with the difference is whole on both sides."""
        self._decode_past()
        chips = self._sessions.chip(entry)
        sides = [
            self._side(chips, Cycle(entry.after, False, entry.args[0], data), f"{data:02X}H")
            for data in (entry.reply, reply)
        ]
        left = chain(self._left, chain.from_iterable(map(self._expand, self._stretches)))
        for _ in range(LOOKAHEAD):
            following = None if all(side.known() for side in sides) else next(left, None)
            if following is None or following.op not in ("read", "write") or following.error:
                break
            self.run_to(following)
            again, error = self.call(following)
            if self._sessions.chip(following) != chips or error:
                continue
            write = following.op == "write"
            for side, data in zip(sides, (following.reply, again), strict=True):
                data = following.args[1] if write else data
                side.feed(Cycle(following.after, write, following.args[0], data))
        return difference_of(entry.number, entry.after, "reply", self._where(entry), sides)


def _difference(entry: Entry, what: str, where: str, recorded: str, now: str) -> Divergence:
    return Divergence(entry.number, entry.when, what, where, recorded, now)


def _alone(entry: Entry) -> Stretch:
    """Return an entry as a stretch of itself."""
    return entry.number, entry.when, 0, -1, entry, 1


def _settled(op: str, reply: Any) -> Any:
    """Return the part of a reply that observers of the board cannot change.

    How long SYNC promises that no output moves is a lower bound: it is shorter while an observer, a
    waveform for instance, watches lines of the chip.
    """
    return reply[0] if op == "sync" and reply is not None else reply


def _answer(reply: Any, error: int) -> str:
    return f"refused, number {error}" if error else str(reply)
