"""Journals: everything a host can do is written down, and survives being cut anywhere."""

import hashlib
import io
import platform
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import vbus
from tests.unit.views.conftest import LM629, lm629_move, read, record, strobed
from vbus.board.build import load_board_text
from vbus.core.kernel import MS
from vbus.protocols.port import PortError
from vbus.record.format import (
    CODE,
    MAGIC,
    OPERATIONS,
    OUTSIDE,
    Entry,
    Header,
    JournalError,
    JournalReader,
    block,
    header_block,
    rows_block,
)
from vbus.record.journal import Journal
from vbus.record.replay import Replay
from vbus.record.rows import FLAG, NUMBER, PAIR, JournalRows

TWO = (
    LM629
    + """
[chips.y]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
"""
)


def test_the_header_names_board_file_versions_seed_and_hash(moved: bytes) -> None:
    header, _ = read(moved)
    assert header.board == "bench"
    assert header.file == "board.toml"
    assert header.text == LM629
    assert header.digest == hashlib.sha256(LM629.encode()).hexdigest()
    assert (header.seed, header.policy, header.format) == (0, "lockstep", 1)
    assert header.families == {"x": "lm628"}
    assert header.vbus == vbus.__version__
    assert header.python == platform.python_version()


def test_a_bus_cycle_has_its_call_and_its_latching_edge() -> None:
    board = load_board_text(LM629)
    file = io.BytesIO()
    journal = Journal(board, file, LM629)
    port = board.open_port("h")
    board.run_until(5_000_000)
    assert port.read(0) == 0x84
    port.write(0, 0x0A)
    journal.flush()
    _, (opened, a_read, a_write) = read(file.getvalue())
    assert (opened.op, opened.args) == ("open", ("h", ["x"], 0))
    assert (a_read.op, a_read.args, a_read.reply) == ("read", (0,), 0x84)
    assert (a_read.when, a_read.after) == (5_000_000, 6_000_000)
    assert (a_write.op, a_write.args, a_write.reply) == ("write", (0, 0x0A), None)
    assert (a_write.when, a_write.after) == (6_000_000, 7_000_000)


def test_everything_a_host_can_do_is_written_down() -> None:
    board = load_board_text(TWO.replace("lockstep", "slaved"))
    file = io.BytesIO()
    journal = Journal(board, file)
    one, two = board.open_port("one"), board.open_port("two")
    one.select(3)
    one.claim()
    one.at(10)
    one.write(0, 0x1D)
    one.unclaim()
    one.wait(MS)
    one.events(1)
    strobed(two)
    one.take_events()
    for call in (lambda: one.select(9), lambda: one.at(1), lambda: two.lines(0x8000_0000, 0)):
        with pytest.raises(PortError):
            call()
    board.limit = board.now + 5
    assert two.delay(MS) is False
    one.close()
    two.close()
    journal.close()
    _, entries = read(file.getvalue())
    opened = [(entry.port, entry.args[0]) for entry in entries if entry.op == "open"]
    assert opened == [(0, "one"), (1, "two")]
    others = {"read", "edges", "fault", "arm", "clear", "jump", "made", *OUTSIDE}
    assert {entry.op for entry in entries} >= set(OPERATIONS) - others
    refused = [(entry.op, entry.error) for entry in entries if entry.error]
    assert refused == [("select", 2), ("at", 3), ("lines", 2)]
    (held,) = [entry for entry in entries if entry.limit >= 0]
    assert (held.op, held.args, held.reply) == ("delay", (MS,), False)
    assert held.limit == held.when + 5


def test_a_violation_stands_before_the_call_it_was_found_in(moved: bytes) -> None:
    _, entries = read(moved)
    place = next(n for n, entry in enumerate(entries) if entry.op == "violation")
    assert entries[place].port == -1
    assert entries[place].args[1:4] == ("x", "lm628.busy-write", "LM-BUS-10")
    assert entries[place + 1].op == "write"
    assert entries[place + 1].after == entries[place].args[0]


def test_the_end_has_the_number_of_entries_and_the_state(moved: bytes) -> None:
    _, entries = read(moved)
    assert entries[-1].op == "end"
    count, state, told, observations = entries[-1].args
    assert count == len(entries) - 1
    assert (bytes.fromhex(state).hex(), len(state), len(told), observations) == (state, 64, 64, 0)


def test_a_journal_cut_at_any_byte_gives_everything_flushed_before() -> None:
    board = load_board_text(LM629)
    file = io.BytesIO()
    journal = Journal(board, file)
    ends = [(len(file.getvalue()), 0)]
    port = board.open_port("h")
    for _ in range(4):
        for _ in range(3):
            port.read(0)
        journal.flush()
        ends.append((len(file.getvalue()), journal.entries))
    data = file.getvalue()
    for size in range(ends[0][0], len(data) + 1):
        reader = JournalReader(io.BytesIO(data[:size]))
        flushed = max(count for end, count in ends if end <= size)
        assert len(list(reader)) == flushed
        whole = size in [end for end, _ in ends]
        assert bool(reader.damage) != whole


@pytest.fixture(scope="session")
def flushed() -> tuple[bytes, list[int], list[Entry]]:
    """A journal of all that a host can do, where its blocks end, and its entries."""
    board = load_board_text(LM629)
    file = io.BytesIO()
    journal = Journal(board, file, LM629, "board.toml")
    ends = [len(file.getvalue())]
    port = board.open_port("h")
    for work in (lm629_move, strobed, lm629_move):
        work(port)
        board.catch_up()
        ends.append(len(file.getvalue()))
    journal.close()
    data = file.getvalue()
    return data, [*ends, len(data)], read(data)[1]


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_what_is_left_after_a_kill_at_any_byte_can_be_read_and_played(
    flushed: tuple[bytes, list[int], list[Entry]], draw: st.DataObject
) -> None:
    data, ends, entries = flushed
    size = draw.draw(st.integers(ends[0], len(data) - 1))
    reader = JournalReader(io.BytesIO(data[:size]))
    left = list(reader)
    assert left == entries[: len(left)]
    written = max(end for end in ends if end <= size)
    assert len(left) >= len(list(JournalReader(io.BytesIO(data[:written]))))
    outcome = Replay(load_board_text(LM629), left, reader.header.families).run()
    assert outcome.divergence is None
    assert outcome.ended is False


@pytest.mark.parametrize("size", range(0, 200, 7))
def test_a_journal_cut_inside_its_header_says_so(moved: bytes, size: int) -> None:
    with pytest.raises(JournalError, match=r"no journal|no header"):
        JournalReader(io.BytesIO(moved[:size]))


def test_a_flipped_bit_is_damage_and_not_an_end(moved: bytes) -> None:
    broken = bytearray(moved)
    broken[-20] ^= 4
    with pytest.raises(JournalError, match="is damaged"):
        read(bytes(broken))


def test_a_missing_block_is_noticed() -> None:
    header = record(LM629, close=False)
    with pytest.raises(JournalError, match="entries 0 to 4 are missing"):
        read(header + rows_block(5, b"\xc0\0", [0, 0, 0, 0]))


def test_a_file_of_another_kind_or_version_is_refused() -> None:
    with pytest.raises(JournalError, match="no journal of version 1: it is empty;"):
        JournalReader(io.BytesIO())
    with pytest.raises(JournalError, match="no journal of version 1"):
        JournalReader(io.BytesIO(b"$date today $end"))
    with pytest.raises(JournalError, match="the header of another version"):
        JournalReader(io.BytesIO(MAGIC + block({"new": 1})))
    header = Header("b", "", "", "", 0, "lockstep", vbus="9.0", format=2)
    with pytest.raises(JournalError, match=r"of format 2, written by vbus 9\.0; this vbus reads"):
        JournalReader(io.BytesIO(header_block(header)))


def test_an_entry_of_a_kind_that_is_not_known_is_refused(moved: bytes) -> None:
    journal = header_block(read(moved)[0]) + rows_block(0, b"\xc0\0", [31, [], 0, 0])
    with pytest.raises(JournalError, match="entry 0 is of a kind this vbus does not know"):
        read(journal)


def test_a_read_that_was_neither_answered_nor_refused_is_no_entry(moved: bytes) -> None:
    head = header_block(read(moved)[0])
    for error in (0, 2):
        row = [CODE["read"], [[0], None, error, -1], 0, 1]
        journal = head + rows_block(0, b"\xc0\0", row)
        if error:
            assert read(journal)[1][0].error == error
        else:
            with pytest.raises(JournalError, match="neither data nor a refusal"):
                read(journal)


def test_a_copy_of_a_journal_that_goes_on_has_an_end_of_its_own() -> None:
    board = load_board_text(LM629)
    file = io.BytesIO()
    journal = Journal(board, file, LM629)
    port = board.open_port("h")
    port.read(0)
    ending = journal.ending()
    _, copied = read(file.getvalue() + ending)
    assert [entry.op for entry in copied] == ["open", "read", "end"]
    assert copied[-1].args[0] == 2
    port.read(0)
    journal.close()
    assert [entry.op for entry in read(file.getvalue())[1]] == ["open", "read", "read", "end"]


class _Full(io.RawIOBase):
    """A disk with room for some bytes, that takes them a few at a time."""

    def __init__(self, room: int) -> None:
        self.data = b""
        self.room = room

    def writable(self) -> bool:
        return True

    def write(self, data: bytes) -> int:  # type: ignore[override]
        if not self.room:
            raise OSError(28, "No space left on device")
        part = bytes(data[: min(self.room, 100)])
        self.room -= len(part)
        self.data += part
        return len(part)


def test_a_full_disk_ends_the_journal_with_a_sentence_and_not_the_board() -> None:
    board = load_board_text(LM629)
    disk = _Full(900)
    told: list[str] = []
    journal = Journal(board, disk, LM629, report=told.append)  # type: ignore[arg-type]
    port = board.open_port("h")
    for _ in range(20):
        lm629_move(port)
        journal.flush()
    assert port.read(0) & 0x80 == 0
    assert len(told) == 1
    assert told[0].startswith("the journal ends after")
    assert told[0].endswith("No space left on device")
    assert JournalReader(io.BytesIO(disk.data)).header.board == "bench"


def test_a_journal_that_is_settled_holds_every_call_so_far() -> None:
    board = load_board_text(LM629)
    file = io.BytesIO()
    journal = Journal(board, file)
    synced: list[int] = []
    board.open_port("h").read(0)
    assert journal.settle()
    assert [entry.op for entry in read(file.getvalue())[1]] == ["open", "read"]
    board.ports[0].read(0)
    assert journal.settle(lambda: synced.append(len(read(file.getvalue())[1])))
    assert synced == [3], "written first"


def test_a_journal_on_a_disk_that_takes_no_more_cannot_be_settled() -> None:
    def fail() -> None:
        raise OSError(5, "Input/output error")

    board = load_board_text(LM629)
    told: list[str] = []
    file = io.BytesIO()
    journal = Journal(board, file, report=told.append)
    assert journal.settle()
    assert not journal.settle(fail)
    assert not journal.settle(), "and never again"
    assert told == [f"the journal ends after {len(file.getvalue())} bytes: Input/output error"]


def test_a_journal_must_come_before_the_first_port() -> None:
    board = load_board_text(LM629)
    board.open_port("early")
    with pytest.raises(Exception, match="before the first port"):
        Journal(board, io.BytesIO())


def test_closing_twice_is_closing_once_and_ports_are_plain_again() -> None:
    board = load_board_text(LM629)
    file = io.BytesIO()
    journal = Journal(board, file)
    journal.close()
    size = len(file.getvalue())
    journal.close()
    assert journal not in board.listeners
    port = board.open_port("h")
    port.read(0)
    journal.flush()
    assert len(file.getvalue()) == size


def test_recording_changes_nothing() -> None:
    plain = load_board_text(LM629)
    port = plain.open_port("h")
    lm629_move(port)
    recorded = load_board_text(LM629)
    Journal(recorded, io.BytesIO())
    other = recorded.open_port("h")
    lm629_move(other)
    assert recorded.state_hash() == plain.state_hash()
    assert recorded.counters == plain.counters


def test_a_poll_costs_less_than_a_byte() -> None:
    def polls(port: object) -> None:
        for _ in range(20_000):
            port.read(0)  # type: ignore[attr-defined]

    assert len(record(LM629, polls)) < 20_000


def tell(entries: list[Entry]) -> list[tuple[object, ...]]:
    return [(e.number, e.when, e.after, e.port, e.op, e.args, e.reply) for e in entries]


def test_rows_are_packed_as_the_format_says(moved: bytes) -> None:
    words = bytes.fromhex("C000 C000 000A 8002 03FF C000 0484 C000 0485")
    others = [2, [["h", ["x"], 0], None, 0, -1], 0, 0, 0, 0x0084, 7, 2]
    others += [36, [[1], None, 0, -1], -3, 1, 32, 0x0200, 5, 4]
    _, entries = read(header_block(read(moved)[0]) + rows_block(0, words, others))
    assert tell(entries) == [
        (0, 0, 0, 0, "open", ("h", ["x"], 0), None),
        (1, 7, 9, 0, "read", (0,), 0x84),
        (2, 9, 11, 0, "read", (0,), 0x0A),
        (3, 11, 13, 0, "read", (0,), 0x0A),
        (4, 13, 15, 0, "read", (0,), 0x0A),
        (5, 15, 17, 0, "write", (1, 0xFF), None),
        (6, 14, 15, 1, "select", (1,), None),
        (7, 15, 17, 0, "read", (2,), 0x84),
        (8, 22, 26, 1, "read", (2,), 0),
        (9, 26, 30, 1, "read", (2,), 0x85),
    ]


def test_cycles_that_follow_each_other_are_one_word_and_the_same_again_is_counted() -> None:
    rows = JournalRows(lambda: None)
    rows.cycle(0, 0x0084, 7, 9)
    for when in (9, 11, 13):
        rows.cycle(0, 0x000A, when, when + 2)
    rows.cycle(0, 0x03FF, 15, 17)
    rows.other(36, [[1], None, 0, -1], 14, 15)
    assert rows.take() == (
        bytes.fromhex("C000 000A 8002 03FF C000"),
        [0, 0x84, 7, 2, 36, [[1], None, 0, -1], -3, 1],
    )
    # The next block begins with a whole cycle, counted from the end of the last one.
    rows.cycle(0, 0x0084, 15, 17)
    assert rows.take() == (bytes.fromhex("C000"), [0, 0x84, 0, 2])


def test_addresses_of_up_to_six_bits_fit_a_word() -> None:
    rows = JournalRows(lambda: None)
    for number, word in enumerate((0x0084, 0x7E55, 0x8055)):
        rows.cycle(0, word, 2 * number, 2 * number + 2)
    assert rows.take()[0] == bytes.fromhex("C000 7E55 C000")


def test_a_block_is_compressed() -> None:
    assert len(block([0x0A] * 10_000)) < 100


def test_a_cycle_by_strobes_that_repeats_takes_less_than_a_byte() -> None:
    file = io.BytesIO()
    board = load_board_text(LM629)
    journal = Journal(board, file)
    port = board.open_port("h")
    select, strobe, place = (1 << port.line_number(name) for name in ("/CS", "/RD", "/PS"))
    port.lines(place, 0)
    for _ in range(1000):
        for mask, level in ((select, 0), (strobe, 0), (strobe, strobe), (select, select)):
            port.lines(mask, level)
            port.delay(200_000)
            port.sample()
    journal.flush()
    assert journal.bytes < 1000
    assert len(read(file.getvalue())[1]) == 13_002


def test_a_delay_is_written_down_however_long_and_also_if_it_is_refused() -> None:
    file = io.BytesIO()
    board = load_board_text(LM629.replace('plant = "m"', 'plant = "none"'))
    journal = Journal(board, file, LM629)
    port = board.open_port("h")
    port.delay(1 << 62)
    port.delay((1 << 62) - (1 << 60))
    for duration in ((1 << 62) - 1, 1 << 62, (1 << 64) - 1):
        with pytest.raises(PortError):
            port.delay(duration)
    journal.close()
    _, (_, *entries, _) = read(file.getvalue())
    assert [(entry.op, *entry.args) for entry in entries] == [
        ("delay", 1 << 62), ("delay", (1 << 62) - (1 << 60)), ("delay", (1 << 62) - 1),
        ("delay", 1 << 62), ("delay", (1 << 64) - 1),
    ]  # fmt: skip
    assert [entry.reply for entry in entries] == [True, True, None, None, None]
    assert [entry.error > 0 for entry in entries] == [False, False, True, True, True]


def test_calls_like_those_before_are_a_word_each() -> None:
    rows = JournalRows(lambda: None)
    lines, delay, sample = (CODE[name] for name in ("lines", "delay", "sample"))
    for turn in range(3):
        now = 100 * turn
        rows.call(lines, 2, 3, 1, 0, 0, now, now)
        rows.call(delay, 1 | FLAG << 2, 60, 0, 1, 0, now, now + 60)
        rows.call(sample, PAIR << 2, 0, 0, 0x84 + turn // 2, 7, now + 60, now + 60)
        rows.call(delay, 1 | FLAG << 2, 40, 0, 1, 0, now + 60, now + 100)
    assert rows.pending == 12
    words, others = rows.take()
    assert words == bytes.fromhex("C000 C000 C000 C000 C001 C002 C003 C004 C001 C002 C000 C004")
    assert others == [
        lines, [[3, 1], None, 0, -1], 0, 0, delay, [[60], True, 0, -1], 0, 60,
        sample, [[], (0x84, 7), 0, -1], 0, 0, delay, [[40], True, 0, -1], 0, 40,
        sample, [[], (0x85, 7), 0, -1], 0, 0,
    ]  # fmt: skip
    # Each block stands for itself.
    rows.call(lines, 2, 3, 1, 0, 0, 300, 300)
    assert rows.take() == (bytes.fromhex("C000"), [lines, [[3, 1], None, 0, -1], 0, 0])


def test_a_call_of_another_length_or_after_a_pause_is_another() -> None:
    rows = JournalRows(lambda: None)
    delay = CODE["delay"]
    for when, after in ((0, 60), (60, 120), (130, 190), (190, 250)):
        rows.call(delay, 1 | FLAG << 2, 60, 0, 1, 0, when, after)
    rows.call(delay + 32, 1 | FLAG << 2, 60, 0, 1, 0, 250, 310)
    rows.call(delay, 1 | NUMBER << 2, 60, 0, 1, 0, 310, 370)
    words, others = rows.take()
    assert words == bytes.fromhex("C000 C001 C000 C001 C000 C000")
    assert others[4:8] == [delay, [[60], True, 0, -1], 10, 60]
    assert others[8] == delay + 32
    assert others[13] == [[60], 1, 0, -1]


def test_after_a_call_either_of_two_may_come_again() -> None:
    rows = JournalRows(lambda: None)
    delay, now = CODE["delay"], 0
    for span in (10, 20, 10, 30, 10, 20, 10, 30, 10, 40):
        rows.call(delay, 1 | FLAG << 2, 60, 0, 1, 0, now, now + span)
        now += span
    words, others = rows.take()
    assert words == bytes.fromhex("C000 C000 C001 C000 C001 C002 C001 C003 C001 C000")
    assert others[3::4] == [10, 20, 30, 40]


def test_strobed_cycles_have_the_names_of_their_chips() -> None:
    rows = JournalRows(lambda: None)
    key = 32 + CODE["cycle"]
    for turn in range(2):
        rows.strobed(key, "x", False, 0, 0x84, turn, turn)
        rows.strobed(key, "x+y", True, 0x1234, 0x0A, turn, turn)
    words, others = rows.take()
    assert words == bytes.fromhex("C000 C000 C000 C002")
    assert others[:8] == [
        key, [["x", False, 0, 0x84], None, 0, -1], 0, 0,
        key, [["x+y", True, 0x1234, 0x0A], None, 0, -1], 0, 0,
    ]  # fmt: skip
    assert others[8:] == [key, [["x", False, 0, 0x84], None, 0, -1], 1, 0]


def test_a_call_between_cycles_stands_between_them() -> None:
    rows = JournalRows(lambda: None)
    lines = CODE["lines"]
    for turn in range(2):
        now = 10 * turn
        rows.cycle(0, 0x84, now, now + 2)
        rows.cycle(0, 0x84, now + 2, now + 4)
        rows.call(lines, 2, 3, 1, 0, 0, now + 4, now + 10)
    words, _ = rows.take()
    assert words == bytes.fromhex("C000 8001 C000 8002 C002")


@pytest.mark.parametrize(
    ("words", "others", "why"),
    [
        ("0084", [], "entry 0: the first cycle is missing"),
        ("8001", [], "entry 0: the first cycle is missing"),
        ("C000 C000", [0, 0x84, 0, 1], "entry 1: an entry is missing"),
        ("C000", [0, 0x84, 0, 1, 0, 0x84, 0, 1], "entry 1: an entry is left over"),
        ("C000 80", [0, 0x84, 0, 1], "entry 0: "),
        ("C001", [], "entry 0: an entry comes once more that has not been"),
        ("C000 C002", [0, 0x84, 0, 1], "entry 1: an entry comes once more that has not been"),
        ("C000", [0, 0x84, 0], "entry 0: "),
        ("C000", [0, 0x84, -1, 1], "from -1 to 0 ps; time ends at"),
    ],
)
def test_a_block_whose_words_make_no_sense_is_refused(
    moved: bytes, words: str, others: list[object], why: str
) -> None:
    journal = header_block(read(moved)[0]) + rows_block(0, bytes.fromhex(words), others)
    with pytest.raises(JournalError, match=why):
        read(journal)


CYCLES = st.tuples(
    st.integers(0, 2),
    st.sampled_from([0, 0, 1, 0x3F, 0x40, 0xFF, 0x1234]),
    st.booleans(),
    st.sampled_from([0, 0x80, 0xFF]),
    st.sampled_from([0, 0, 0, 5, -3]),
    st.sampled_from([1_000_000, 1_000_000, 7]),
    st.integers(1, 3),
)


FORMS: dict[str, tuple[int, int]] = {
    "lines": (2, 0), "delay": (1, FLAG), "getpin": (1, NUMBER), "sample": (0, PAIR)
}  # fmt: skip
CALLS = st.tuples(
    st.sampled_from([*FORMS]),
    st.integers(0, 1),
    st.integers(0, 2),
    st.integers(0, 1),
    st.sampled_from([0, 0, 5]),
    st.sampled_from([0, 60]),
)


@given(st.lists(st.one_of(CYCLES, CALLS, st.integers(0, 9)), max_size=60), st.integers(1, 50))
def test_what_goes_into_the_rows_comes_out_of_the_file(
    moved: bytes, script: list[Any], every: int
) -> None:
    data = header_block(read(moved)[0])
    rows = JournalRows(lambda: None)
    expected: list[tuple[object, ...]] = []
    now = written = 0

    def flush() -> None:
        nonlocal data, written
        if count := int(rows.pending):
            data += rows_block(written, *rows.take())
            written += count

    for step in script:
        if isinstance(step, tuple) and step[0] in FORMS:
            name, session, first, second, gap, span = step
            count, kind = FORMS[name]
            when, now = now + gap, now + gap + span
            reply = 1 if kind == FLAG else second
            key, form = session * 32 + CODE[name], count | kind << 2
            rows.call(key, form, first, second, reply, first, when, now)
            answer = {0: None, FLAG: True, NUMBER: second, PAIR: (second, first)}[kind]
            args = (first, second)[:count]
            expected.append((len(expected), when, now, session, name, args, answer))
            if len(expected) % every == 0:
                flush()
            continue
        session, address, write, byte, gap, span, times = (
            (0, 0, False, 0, 0, 0, 0) if isinstance(step, int) else step
        )
        if isinstance(step, int):
            rows.other(32 + 4, [[step], None, 0, -1], now + step, now + 2 * step)
            expected.append((len(expected), now + step, now + 2 * step, 1, "select", (step,), None))
            now += 2 * step
        for _ in range(times):
            when = max(now + gap, 0)
            rows.cycle(session, address << 9 | write << 8 | byte, when, when + span)
            now = when + span
            row = ("write", (address, byte), None) if write else ("read", (address,), byte)
            expected.append((len(expected), when, now, session, *row))
        if len(expected) % every == 0:
            flush()
    flush()
    assert tell(read(data)[1]) == expected


def test_a_driver_that_polls_for_ever_is_written_block_by_block() -> None:
    file = io.BytesIO()
    board = load_board_text(LM629)
    journal = Journal(board, file)
    port = board.open_port("h")
    for _ in range(4096 - 2):
        port.read(0)
    assert journal.entries == 0
    port.read(0)
    assert journal.entries == 4096
    assert len(read(file.getvalue())[1]) == 4096
