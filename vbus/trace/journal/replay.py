"""A journal played again: the same calls at the same instants, and the first difference."""

import copy
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final

from vbus.board.board import Board
from vbus.signals import Observer, Violation
from vbus.trace.decode import decoder_of, settings_for_decoders
from vbus.trace.journal.format import Entry
from vbus.trace.journal.journal import end_of, version_of
from vbus.trace.journal.player import Player
from vbus.trace.journal.view import Sessions, violation_of
from vbus.trace.packets import Cycle, Decoder, Packet

AHEAD: Final = 64
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
    """Violations by chip: what the journal has and what the run has, not matched yet."""

    def __init__(self) -> None:
        self.recorded: dict[str, deque[tuple[int, Violation]]] = {}
        self.found: dict[str, deque[tuple[int, Violation]]] = {}
        self.entry: int = 0

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
                    return _different(number, was, now)
        return None

    def rest(self) -> Divergence | None:
        """Return the earliest violation that stands on one side only."""
        left = [
            Divergence(number, v.when, "unconsumed", v.chip, told(v), "nothing", v.clause)
            for queue in self.recorded.values()
            for number, v in queue
        ] + [
            Divergence(number, v.when, "missing", v.chip, "nothing", told(v), v.clause)
            for queue in self.found.values()
            for number, v in queue
        ]
        return min(left, key=_place, default=None)


def _place(divergence: Divergence) -> int:
    return divergence.entry


def _different(number: int, was: Violation, now: Violation) -> Divergence:
    return Divergence(number, was.when, "violation", was.chip, told(was), told(now), was.clause)


def told(violation: Violation) -> str:
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
        self._strobed: deque[Entry] = deque()
        """Cycles of the journal that strobes made in the call that comes next."""
        self._found: list[list[Any]] = []
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
        count, state, told, observations = entry.args
        if count != entry.number:
            return Divergence(
                entry.number, entry.when, "unconsumed", "the end", f"{count} entries before it",
                f"{entry.number} entries before it",
            )  # fmt: skip
        self._player.come(entry)
        self.board.catch_up()
        left = self._findings.compare() or self._findings.rest()
        if left is not None:
            return left
        state_now, told_now, observations_now = end_of(self.board, version_of(state))
        same = told_now == told and (bool(observations or observations_now) or state_now == state)
        if not same:
            return Divergence(
                entry.number, entry.when, "state", "the end", f"state hash {state}",
                f"state hash {state_now}: all replies agree, but the board stands otherwise",
            )  # fmt: skip
        return None

    def _entry(self, entry: Entry) -> Divergence | None:
        self._player.come(entry)
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
            self._feed(entry, entry.args[1] if entry.op == "write" else reply)
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
        found, self._found = self._found, []
        if not found and not self._strobed:
            return None
        recorded = list(self._strobed)
        self._strobed.clear()
        for number in range(max(len(recorded), len(found))):
            was = recorded[number] if number < len(recorded) else None
            now = found[number] if number < len(found) else None
            if was is not None and now == list(was.args):
                self._cycles += 1
                self._packets_of(was.after, now)
                continue
            entry = was or call
            sides = (list(was.args) if was else None, now)
            chip = (sides[0] or sides[1] or ["-"])[0]
            where = f"{self._sessions.host(call)}, {chip}: strobes"
            kind = "reply" if was and now else "unconsumed" if was else "missing"
            texts = [self._cycle_text(entry.after, side) for side in sides]
            clause = next((c for _, c in texts if c), "")
            return Divergence(entry.number, entry.when, kind, where, texts[0][0], texts[1][0],
                              clause)  # fmt: skip
        return None

    def _packets_of(self, when: int, args: list[Any]) -> list[Packet]:
        chips, write, address, data = args
        cycle = Cycle(when, write, address, data)
        return [
            packet
            for chip in chips.split("+")
            if chip in self._decoders
            for packet in self._decoders[chip].feed(cycle)
        ]

    def _cycle_text(self, when: int, args: list[Any] | None) -> tuple[str, str]:
        """Return a cycle, with the packet that ends in it, and the packet's clause."""
        if args is None:
            return "nothing", ""
        text = str(Cycle(when, *args[1:]))
        decoders = self._decoders
        self._decoders = copy.deepcopy(decoders)
        packets = self._packets_of(when, args)
        for chip in args[0].split("+"):
            if not packets and chip in self._decoders:
                packets = self._decoders[chip].finish()
        self._decoders = decoders
        if not packets:
            return text, ""
        return f"{text} in {packets[-1].text}", packets[-1].clause

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
        self._found.append([chip, write, address, data])

    # -- both sides, decoded ------------------------------------------------------------------

    def _feed(self, entry: Entry, data: int) -> list[tuple[Cycle, Packet]]:
        cycle = Cycle(entry.after, entry.op == "write", entry.args[0], data)
        return [
            (cycle, packet)
            for chip in self._sessions.chip(entry).split("+")
            if chip in self._decoders
            for packet in self._decoders[chip].feed(cycle)
        ]

    def _decoded(self, entry: Entry, reply: int) -> Divergence:
        """Play on until the packet with the difference is whole on both sides."""
        chip = self._sessions.chip(entry)
        decoder = self._decoders.get(chip.partition("+")[0])
        address = entry.args[0]
        recorded = f"{entry.reply:02X}H"
        now = f"{reply:02X}H"
        clause = ""
        if decoder is not None:
            was = Cycle(entry.after, False, address, entry.reply)
            got = Cycle(entry.after, False, address, reply)
            sides = (decoder, copy.deepcopy(decoder))
            packets = [self._after(sides[0], was), self._after(sides[1], got)]
            ahead = 0
            while not all(packets) and ahead < AHEAD:
                following = next(self._entries, None)
                ahead += 1
                if following is None:
                    break
                if following.op not in ("read", "write") or following.error:
                    break
                self._player.come(following)
                again, error = self._call(following)
                if self._sessions.chip(following) != chip or error:
                    continue
                write = following.op == "write"
                for side, data in enumerate(
                    (following.args[1] if write else following.reply,
                     following.args[1] if write else again)
                ):  # fmt: skip
                    cycle = Cycle(following.after, write, following.args[0], data)
                    for packet in sides[side].feed(cycle):
                        first = (was, got)[side]
                        if packets[side] is None and first in packet.cycles:
                            packets[side] = packet
            for side in (0, 1):
                first = (was, got)[side]
                for packet in sides[side].finish() if packets[side] is None else ():
                    if first in packet.cycles:
                        packets[side] = packet
            shown = [packet.text if packet else "" for packet in packets]
            recorded = f"{recorded} in {shown[0]}" if shown[0] else recorded
            now = f"{now} in {shown[1]}" if shown[1] else now
            clause = next((packet.clause for packet in packets if packet), "")
        return Divergence(
            entry.number, entry.after, "reply", self._where(entry), recorded, now, clause
        )

    @staticmethod
    def _after(decoder: Decoder, cycle: Cycle) -> Packet | None:
        for packet in decoder.feed(cycle):
            if cycle in packet.cycles:
                return packet
        return None


def _settled(op: str, reply: Any) -> Any:
    """Return what of a reply is the same whoever watches the board.

    How long SYNC promises that no output moves is a lower bound: it is shorter while somebody, a
    waveform for instance, watches lines of the chip.
    """
    return reply[0] if op == "sync" and reply is not None else reply


def _answer(reply: Any, error: int) -> str:
    return f"refused, number {error}" if error else str(reply)
