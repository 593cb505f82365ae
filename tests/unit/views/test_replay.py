"""Replays: the same again, and the first difference on both sides."""

import io
from collections.abc import Iterator
from contextlib import suppress
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.unit.views.conftest import (
    LM629,
    board_of,
    lm629_move,
    lm629_words,
    read,
    record,
    strobed,
)
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.boardfile.sections import WaveSection
from vbus.chips.packets import Cycle, Decoder, Packet
from vbus.core.kernel import MS, US
from vbus.core.signals import Observer
from vbus.protocols import codes
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.port import PortError
from vbus.protocols.requests import LEASED, REQUESTS
from vbus.record.difference import Divergence, Findings
from vbus.record.format import OPERATIONS, Entry, JournalReader
from vbus.record.journal import Journal
from vbus.record.replay import Outcome, Replay
from vbus.record.rows import PORTS
from vbus.serve.recording import wave_of

MC1241A = """\
[board]
name = "bench"
time = "lockstep"
[chips.x]
part = "MC1241A"
clock = "25 MHz"
plants = ["none"]
"""
MCP1200 = """\
[board]
name = "bench"
time = "lockstep"
[chips.x]
part = "MCP-1200"
clock = "8 MHz"
plant = "none"
"""


def played(data: bytes, *, without: int = -1, changed: dict[int, dict[str, Any]] | None = None,
           text: str = "") -> Outcome:  # fmt: skip
    """Replay a journal, perhaps with an entry left out or changed, perhaps on another board."""
    header, entries = read(data)
    board = load_board_text(text) if text else board_of(header)
    chosen = [
        replace(entry, **(changed or {}).get(entry.number, {}))
        for entry in entries
        if entry.number != without
    ]
    outcome = Replay(board, chosen, header.families).run()
    again = load_board_text(text) if text else board_of(header)
    assert Replay(again, Stretches(chosen), header.families).run() == outcome
    return outcome


class Stretches(JournalReader):
    """Entries, perhaps changed ones, as a reader gives them: equal bus cycles in a row at once."""

    def __init__(self, entries: list[Entry]) -> None:
        self.entries: dict[int, Entry] = {entry.number: entry for entry in entries}

    def stretches(self) -> Iterator[tuple[int, int, int, int, Any, int]]:
        row: tuple[int, int, int, int, Any] | None = None
        last = times = 0
        for entry in self.entries.values():
            key = max(entry.port, 0) * PORTS + OPERATIONS.index(entry.op)
            value: Any = None
            if entry.op in ("read", "write") and not entry.error:
                data = entry.args[1] if entry.op == "write" else entry.reply
                value = entry.args[0] << 8 | data
            now = entry.number, entry.when, entry.after - entry.when, key, value
            if row and value is not None and now == (row[0] + times, last, *row[2:]):
                times += 1
            else:
                if row:
                    yield *row, times
                row, times = now, 1
            last = entry.after
        if row:
            yield *row, times

    def entry(self, number: int, when: int, span: int, key: int, value: Any) -> Entry:
        return self.entries[number]


def difference(outcome: Outcome) -> Divergence:
    assert outcome.divergence is not None
    return outcome.divergence


def test_a_journal_plays_again_without_a_difference(moved: bytes) -> None:
    outcome = played(moved)
    assert outcome.divergence is None
    assert outcome.ended
    assert outcome.entries == len(read(moved)[1])
    assert outcome.cycles > 100


@pytest.mark.parametrize("mask", [0x80, 0x01])
def test_one_poll_among_equal_ones_that_reads_otherwise_is_found(mask: int) -> None:
    """Less than the journal has, and more; the polls after it read what they did."""

    def polls(port: HostBus) -> None:
        for _ in range(40):
            port.read(0)

    broken = (
        f'{LM629}[[faults]]\nfault = "byte_flipped"\ntarget = "x"\nwhen = "cycle 17"\n'
        f'until = "once"\nmask = {mask}\ncycles = "read"\n'
    )
    data = record(LM629, polls)
    found = difference(played(data, text=broken))
    seventeenth = [entry for entry in read(data)[1] if entry.op == "read"][16]
    assert (found.what, found.entry) == ("reply", seventeenth.number)


@pytest.mark.parametrize("policy", ["lockstep", "realtime"])
def test_strobes_pins_and_time_play_again(policy: str) -> None:
    outcome = played(record(LM629.replace("lockstep", policy), strobed, lm629_move))
    assert outcome.divergence is None
    assert outcome.ended


def test_a_journal_without_its_end_plays_as_far_as_it_goes() -> None:
    outcome = played(record(LM629, lm629_move, close=False))
    assert outcome.divergence is None
    assert not outcome.ended


def find(data: bytes, **wanted: object) -> Entry:
    """Return the first entry of a journal with these attributes."""
    for entry in read(data)[1]:
        if all(getattr(entry, name) == value for name, value in wanted.items()):
            return entry
    raise AssertionError(wanted)


def test_another_byte_is_shown_with_both_packets_and_the_clause(moved: bytes) -> None:
    entries = read(moved)[1]
    rdrp = next(e for e in entries if e.op == "write" and e.args == (0, 0x0A))
    data_reads = [e for e in entries if e.number > rdrp.number and e.args == (1,)]
    wrong = data_reads[3]
    found = difference(played(moved, changed={wrong.number: {"reply": wrong.reply ^ 1}}))
    assert (found.entry, found.what, found.clause) == (wrong.number, "reply", "LM-CMD-11")
    assert found.where == "host0, x: read 1"
    value = int.from_bytes(bytes(e.reply for e in data_reads[:4]), "big")
    assert found.now == f"{wrong.reply:02X}H in RDRP +{value} cnt"
    assert found.recorded == f"{wrong.reply ^ 1:02X}H in RDRP +{value ^ 1} cnt"


def test_a_packet_is_that_of_the_command_that_was_written() -> None:
    data = record(LM629, lambda port: lm629_words(port, 0x0D, 1))  # type: ignore[arg-type, return-value]
    entry = find(data, op="read", args=(1,))
    found = difference(played(data, changed={entry.number: {"reply": entry.reply ^ 1}}))
    assert found.now == f"{entry.reply:02X}H in RDSUM +0"


@pytest.mark.core("interpreted")
@pytest.mark.parametrize("good", range(4))
def test_a_refusal_among_equal_cycles_is_found_at_the_one_that_is_refused(
    good: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = record(LM629, lambda port: [port.read(0) for _ in range(6)])  # type: ignore[arg-type, return-value]
    first = next(entry.number for entry in read(data)[1] if entry.op == "read")
    whole, asked = HostBus.read, [0]

    def refused(port: HostBus, address: int) -> int:
        asked[0] += 1
        if asked[0] > good:
            asked[0] = 0
            raise PortError(codes.BAD_AT, "refused")
        return whole(port, address)

    monkeypatch.setattr(HostBus, "read", refused)
    assert difference(played(data)).entry == first + good


def test_a_first_byte_that_differs_is_shown_in_its_whole_packet(moved: bytes) -> None:
    entries = read(moved)[1]
    first = next(e for e in entries if e.args == (1,) and e.op == "read")
    found = difference(played(moved, changed={first.number: {"reply": 0x7F}}))
    assert found.recorded.startswith("7FH in RDRP +2130")


def test_a_packet_that_the_journal_cuts_short_is_shown_as_far_as_it_goes(moved: bytes) -> None:
    entries = read(moved)[1]
    first = next(e for e in entries if e.args == (1,) and e.op == "read")
    kept = [e for e in entries if e.number < first.number]
    header = read(moved)[0]
    found = difference(
        Replay(board_of(header), [*kept, replace(first, reply=0x7F)], header.families).run()
    )
    cut = "{0} in RDRP cut after 0 of 2 words, byte {0} dropped"
    assert (found.recorded, found.now) == (cut.format("7FH"), cut.format("00H"))


def test_what_an_order_made_is_matched_and_not_the_order() -> None:
    findings = Findings(SimpleNamespace(entry=3))  # type: ignore[arg-type]
    findings.outside("order", ["h", 5, ["x"], 0, 0, 0, ""])
    assert findings.rest() is None
    findings.outside("made", [7, "h", "x", False, 0, 0x84])
    found = findings.rest()
    assert (found.entry, found.when, found.now) == (3, 7, "r 0 84 at 7 ps") if found else found


def test_a_status_byte_that_differs_is_shown_by_its_flags(moved: bytes) -> None:
    status = find(moved, op="read", args=(0,))
    found = difference(played(moved, changed={status.number: {"reply": 0xC4}}))
    assert found.recorded == "C4H in RDSTAT C4H MOTOR_OFF BREAKPOINT TRAJECTORY_COMPLETE"
    assert found.now == "84H in RDSTAT 84H MOTOR_OFF TRAJECTORY_COMPLETE"
    assert found.clause == "LM-CMD-23"


class OddBytes(Decoder):
    """Knows odd bytes of status alone: of two sides only one may be in a packet."""

    def take(self, cycle: Cycle) -> list[Packet]:
        return [Packet("packet", "ODD", "", "X-ODD-1", (cycle,))] if cycle.data & 1 else []

    def finish(self) -> list[Packet]:
        return []


@pytest.mark.parametrize("odd", [True, False])
def test_a_packet_that_only_one_side_has_is_shown_there_with_its_clause(
    moved: bytes, monkeypatch: pytest.MonkeyPatch, odd: bool
) -> None:
    monkeypatch.setattr("vbus.circuit.stream.decoder_of", lambda *_: OddBytes())
    status = next(e for e in read(moved)[1] if e.op == "read" and e.reply & 1 != odd)
    found = difference(played(moved, changed={status.number: {"reply": status.reply ^ 1}}))
    shown = [f"{status.reply ^ 1:02X}H", f"{status.reply:02X}H"]
    shown[not odd] += " in ODD"
    assert [found.recorded, found.now] == shown
    assert (found.entry, found.what, found.clause) == (status.number, "reply", "X-ODD-1")


class LastWrite(Decoder):
    """A read is of what was written last, and where."""

    written = ""

    def take(self, cycle: Cycle) -> list[Packet]:
        if cycle.write:
            self.written = str(cycle)
            return []
        return [Packet("packet", f"AFTER {self.written}", "", "", (cycle,))]

    def finish(self) -> list[Packet]:
        return []


def test_a_packet_knows_where_and_what_was_written_before_it(
    moved: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vbus.circuit.stream.decoder_of", lambda *_: LastWrite())
    entries = read(moved)[1]
    rdrp = next(e for e in entries if e.op == "write" and e.args == (0, 0x0A))
    first = next(e for e in entries if e.number > rdrp.number and e.args == (1,))
    found = difference(played(moved, changed={first.number: {"reply": first.reply ^ 1}}))
    assert found.now == f"{first.reply:02X}H in AFTER w 0 0A"


def test_another_instant_is_a_difference(moved: bytes) -> None:
    entry = find(moved, op="write", args=(0, 0x04))
    found = difference(played(moved, changed={entry.number: {"after": entry.after + 1}}))
    assert (found.entry, found.what) == (entry.number, "instant")


def test_a_violation_in_the_journal_that_does_not_happen_is_unconsumed(moved: bytes) -> None:
    text = LM629 + '[violations]\n"lm628.busy-write" = "off"\n'
    found = difference(played(moved, text=text))
    assert (found.what, found.clause, found.now) == ("unconsumed", "LM-BUS-10", "nothing")
    assert found.recorded.startswith("lm628.busy-write at ")


def test_a_violation_that_is_not_in_the_journal_is_missing(moved: bytes) -> None:
    entry = find(moved, op="violation")
    found = difference(played(moved, without=entry.number, changed=_renumbered(moved, entry)))
    assert (found.what, found.clause, found.recorded) == ("missing", "LM-BUS-10", "nothing")


def test_a_violation_missed_before_a_byte_that_differs_is_the_first_difference(
    moved: bytes,
) -> None:
    violation = find(moved, op="violation")
    read_later = next(
        entry for entry in read(moved)[1] if entry.op == "read" and entry.number > violation.number
    )
    changed = {read_later.number: {"reply": read_later.reply ^ 0x01}}
    assert difference(played(moved, changed=changed)).entry == read_later.number
    text = LM629 + '[violations]\n"lm628.busy-write" = "off"\n'
    found = difference(played(moved, changed=changed, text=text))
    assert (found.entry, found.what) == (violation.number, "unconsumed")


def test_a_violation_missed_after_a_byte_that_differs_is_not_the_first_difference(
    moved: bytes,
) -> None:
    violation = find(moved, op="violation")
    before = next(entry for entry in read(moved)[1] if entry.op == "read")
    assert before.number < violation.number
    text = LM629 + '[violations]\n"lm628.busy-write" = "off"\n'
    changed = {before.number: {"reply": before.reply ^ 0x01}}
    assert difference(played(moved, changed=changed, text=text)).entry == before.number


def _renumbered(data: bytes, gone: Entry) -> dict[int, dict[str, Any]]:
    """Make the rest of a journal look as if an entry had never been there."""
    changes: dict[int, dict[str, Any]] = {}
    for entry in read(data)[1]:
        if entry.number > gone.number:
            changes[entry.number] = {"number": entry.number - 1}
            if entry.op == "end":
                changes[entry.number]["args"] = (entry.args[0] - 1, *entry.args[1:])
    return changes


def test_a_violation_with_other_figures_is_a_difference(moved: bytes) -> None:
    entry = find(moved, op="violation")
    args = (*entry.args[:5], entry.args[5] + 1, *entry.args[6:])
    found = difference(played(moved, changed={entry.number: {"args": args}}))
    assert (found.entry, found.what) == (entry.number, "violation")


@pytest.mark.parametrize("op", ["read", "write", "delay"])
def test_an_entry_left_out_is_noticed(moved: bytes, op: str) -> None:
    entries = [e for e in read(moved)[1] if e.op == op]
    for entry in (entries[0], entries[len(entries) // 2], entries[-1]):
        assert played(moved, without=entry.number).divergence is not None


def test_an_entry_behind_the_end_is_unconsumed(moved: bytes) -> None:
    header, entries = read(moved)
    late = replace(entries[-2], number=entries[-1].number + 1)
    found = difference(Replay(board_of(header), [*entries, late], header.families).run())
    assert (found.what, found.entry) == ("unconsumed", late.number)


def test_another_chip_is_a_difference_and_the_first_one_is_told(moved: bytes) -> None:
    slow = LM629.replace("8 MHz", "6 MHz").replace("LM629N-8", "LM629N-6")
    found = difference(played(moved, text=slow))
    assert found.what in ("reply", "violation", "unconsumed")


def test_the_same_replies_with_another_state_at_the_end_is_a_difference(moved: bytes) -> None:
    end = read(moved)[1][-1]
    for place in (1, 2):
        args = [*end.args[:place], "0" * 64, *end.args[place + 1 :]]
        found = difference(played(moved, changed={end.number: {"args": args}}))
        assert (found.what, found.where) == ("state", "the end")


@pytest.mark.parametrize("recorded", [False, True])
def test_who_looks_at_the_nets_of_either_side_makes_no_difference(recorded: bool) -> None:
    def look(board: Board) -> None:
        board.watch("x./WR", Observer())

    board = load_board_text(LM629)
    if recorded:
        look(board)
    file = io.BytesIO()
    journal = Journal(board, file, LM629)
    port = board.open_port("h")
    lm629_move(port)
    port.close()
    journal.close()
    header, entries = read(file.getvalue())
    again = board_of(header)
    if not recorded:
        look(again)
    assert Replay(again, entries, header.families).run().divergence is None


def test_a_reader_says_after_every_block_how_far_it_is() -> None:
    def polls(port: HostBus) -> None:
        for _ in range(10_000):
            port.read(0)

    data = record(LM629, polls)
    places: list[list[int]] = []
    for use in (list, lambda reader: Replay(board_of(reader.header), reader, {}).run()):
        reader = JournalReader(io.BytesIO(data))
        seen: list[int] = []
        reader.moved = lambda reader=reader, seen=seen: seen.append(reader.position)  # type: ignore[misc]
        use(reader)
        places.append(seen)
    assert places[0] == places[1] == sorted(places[0])
    assert len(places[0]) > 2
    assert places[0][-1] == len(data)


def test_a_cycle_called_before_the_present_instant_is_a_difference() -> None:
    def polls(port: HostBus) -> None:
        for _ in range(3):
            port.read(0)

    header, entries = read(record(LM629, polls))
    late = [replace(one, when=one.when - 1) if one.number == 2 else one for one in entries]
    for source in (late, Stretches(late)):
        found = difference(Replay(board_of(header), source, header.families).run())
        assert (found.entry, found.what) == (2, "instant")
        assert found.now.startswith("it is")


def test_a_realtime_board_plays_again_at_its_instants() -> None:
    text = LM629.replace("lockstep", "realtime")
    board = load_board_text(text)
    file = io.BytesIO()
    journal = Journal(board, file, text)
    one, two = board.open_port("one"), board.open_port("two")
    # The wall clock brings the board to instants of its own, between and before calls.
    for step in range(60):
        board.run_until(board.now + 17_345_678 * (step % 7 + 1))
        board.limit = board.now + 2 * MS
        if step % 5 == 0:
            board.catch_up()
        one.write(0, 0x0A)
        board.run_until(board.now + 31_000_001)
        two.read(0)
        one.read(1)
        two.claim()
        one.claim()
        two.unclaim()
        one.unclaim()
        while not two.delay(5 * MS):
            board.run_until(board.now + 3 * MS + 77)
            one.read(0)
            board.limit = board.now + 2 * MS
        while one.wait(MS) is None:
            board.run_until(board.now + 777_777)
            board.limit = board.now + 300_000
    one.close()
    two.close()
    journal.close()
    outcome = played(file.getvalue())
    assert outcome.divergence is None
    assert outcome.ended


CALLS = st.one_of(
    st.tuples(st.just("read"), st.integers(0, 1)),
    st.tuples(st.just("write"), st.integers(0, 1), st.integers(0, 255)),
    st.tuples(st.just("lines"), st.integers(0, 31), st.integers(0, 31)),
    st.tuples(st.just("drive"), st.integers(0, 255)),
    st.tuples(st.sampled_from(["release", "sample", "now", "sync", "claim", "unclaim"])),
    st.tuples(st.just("pin"), st.integers(0, 9), st.integers(0, 3)),
    st.tuples(st.just("getpin"), st.integers(0, 9)),
    st.tuples(st.just("delay"), st.integers(0, 3 * MS)),
    st.tuples(st.just("wait"), st.integers(0, 100 * US)),
    st.tuples(st.just("select"), st.integers(0, 2)),
    st.tuples(st.just("events"), st.integers(0, 3)),
    st.tuples(st.just("take_events")),
    st.tuples(st.just("at"), st.integers(0, 10 * MS)),
)


@pytest.mark.parametrize("text", [LM629, MC1241A, MCP1200], ids=["lm628", "mc1241a", "mcp1200"])
@settings(max_examples=30, deadline=None)
@given(st.lists(CALLS, max_size=40), st.sampled_from(["lockstep", "slaved", "realtime"]),
       st.lists(st.integers(0, 2 * MS), min_size=1, max_size=5))  # fmt: skip
def test_whatever_a_host_does_plays_again(
    text: str, calls: list[tuple[Any, ...]], policy: str, steps: list[int]
) -> None:
    def host(port: HostBus) -> None:
        for number, (name, *args) in enumerate(calls):
            if policy == "realtime":
                port.board.run_until(port.board.now + steps[number % len(steps)])
                port.board.limit = port.board.now + steps[-1]
            with suppress(PortError):
                getattr(port, name)(*args)

    data = record(text.replace("lockstep", policy), host)
    outcome = played(data)
    assert outcome.divergence is None
    assert outcome.ended


class _Byte:
    """A driver's bus over the byte protocol, with leases: polls it can answer are not sent."""

    def __init__(self, protocol: ByteProtocol) -> None:
        self.protocol = protocol
        self.kept = 0
        self.send(bytes((REQUESTS["LEASES"].code, 1)))
        self._address = -1
        self._data = self._now = self._until = self._polls = 0

    def send(self, data: bytes) -> bytes:
        self.protocol.receive(data)
        reply = bytes(self.protocol.out)
        self.protocol.out.clear()
        return reply

    def read(self, address: int) -> int:
        if address == self._address and self._now + US < self._until:
            self._now += US
            self._polls += 1
            self.kept += 1
            return self._data
        self.settle()
        reply = self.send(bytes((REQUESTS["READ"].code, address)))
        self._address = -1
        if reply[:1] == LEASED.encode():
            self._address, self._data = address, reply[1]
            self._now = int.from_bytes(reply[6:14], "big")
            self._until = int.from_bytes(reply[14:22], "big")
        return reply[1]

    def settle(self) -> None:
        if self._polls:
            code = REQUESTS["POLLED"].code
            assert self.send(bytes((code, self._address)) + self._polls.to_bytes(2, "big")) == b""
        self._polls = 0
        self._address = -1

    def write(self, address: int, data: int) -> None:
        self.settle()
        self.send(bytes((REQUESTS["WRITE"].code, address, data)))

    def delay(self, duration: int) -> None:
        self.settle()
        self.send(bytes((REQUESTS["DELAY"].code,)) + duration.to_bytes(8, "big"))


def _leased() -> tuple[bytes, int]:
    """Record a driver that polls from leases; return the journal and the polls kept back."""
    board = load_board_text(LM629)
    file = io.BytesIO()
    journal = Journal(board, file, LM629)
    port = board.open_port("h")
    host = _Byte(ByteProtocol(port))
    lm629_move(host)  # type: ignore[arg-type]
    host.settle()
    port.close()
    journal.close()
    return file.getvalue(), host.kept


def test_a_leased_run_is_recorded_poll_by_poll_and_plays_again() -> None:
    data, kept = _leased()
    assert kept > 100
    outcome = played(data)
    assert outcome.divergence is None
    assert outcome.ended
    # The same driver without leases: the same journal, entry by entry.
    entries = read(data)[1]
    plain = [e for e in read(record(LM629, lm629_move))[1] if e.op in ("read", "write")]
    cycles = [e for e in entries if e.op in ("read", "write")]
    assert [(e.when, e.after, e.op, e.args, e.reply) for e in cycles] == [
        (e.when, e.after, e.op, e.args, e.reply) for e in plain
    ]


def test_a_poll_from_a_lease_that_would_be_answered_differently_now_is_a_difference() -> None:
    data, _ = _leased()
    slow = LM629.replace("8 MHz", "6 MHz").replace("LM629N-8", "LM629N-6")
    found = difference(played(data, text=slow))
    polls = [e for e in read(data)[1] if e.op == "read" and e.args == (0,)]
    assert (found.what, found.clause) == ("reply", "LM-CMD-23")
    assert found.entry in [poll.number for poll in polls]
    kept_back = polls[20]
    found = difference(played(data, changed={kept_back.number: {"reply": kept_back.reply ^ 1}}))
    assert found.entry == kept_back.number


def test_leased_polls_at_stamps_of_their_own_play_again() -> None:
    text = LM629.replace("lockstep", "slaved")
    board = load_board_text(text)
    file = io.BytesIO()
    journal = Journal(board, file, text)
    port = board.open_port("h")
    port.at(5 * US)
    port.write(0, 0x0A)
    port.at(7 * US)
    assert port.read(0) & 1
    assert port.lease(0) is not None
    assert port.polled_at(0, 8 * US, (1_300_000,) * 8)
    port.close()
    journal.close()
    polls = [e for e in read(file.getvalue())[1] if e.op == "read"]
    assert [e.after for e in polls[1:]] == [8 * US + n * 1_300_000 for n in range(9)]
    outcome = played(file.getvalue())
    assert outcome.divergence is None
    assert outcome.ended


WIRED = (
    LM629
    + """
[chips.y]
part = "MCP-1200"
clock = "8 MHz"
plant = "none"
[nets]
interrupt = ["x.HI", "y./STOP"]
"""
)


@pytest.mark.parametrize("profile", ["full", "sigrok"])
def test_a_run_whose_interrupt_line_is_wired_is_the_same_while_it_is_watched(profile: str) -> None:
    """A host that waits for HI asks with SYNC how far it may run; watched lines promise less."""

    def waiting(port: HostBus) -> None:
        lm629_move(port)
        for _ in range(20):
            _, until = port.sync()
            port.delay(min(until - port.now(), MS))

    data = record(WIRED, waiting)
    header, entries = read(data)
    promised = [entry.reply for entry in entries if entry.op == "sync"]
    assert len({until for _, until in promised}) > 3

    board = board_of(header)
    wish = WaveSection(name="", file="-", profile=profile)
    wave = wave_of(board, wish, io.StringIO(), pytest.fail)
    wave.start()
    outcome = Replay(board, entries, header.families).run()
    wave.stop()
    assert (outcome.divergence, outcome.ended) == (None, True)
    assert board.kernel.observations

    # The levels it tells are compared all the same.
    number, (lines, until) = next((e.number, e.reply) for e in entries if e.op == "sync")
    wrong = played(data, changed={number: {"reply": (lines ^ 1, until)}})
    assert difference(wrong).entry == number
