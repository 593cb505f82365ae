"""Damaged files whose checksums fit: refused in words, and what refuses them stays as it was.

One value of a snapshot or a journal is exchanged for another, as a mistake or a hostile hand would.
``VBUS_DAMAGED=2500`` tries so many of each board instead of the usual few.
"""

import hashlib
import io
import os
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from random import Random
from typing import Any

import msgpack
import pytest

from tests.unit.faults.bench import DC, LM, MC, MCP, STEPPER, Lm, Mc, Mcp, build
from vbus.board import snapshot
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.snapshot import Hosts
from vbus.circuit.stream import PacketReader
from vbus.core.errors import SnapshotError, VbusError
from vbus.core.kernel import END, MS, NS, US
from vbus.protocols.byte import ByteProtocol
from vbus.record.format import CODE, MAGIC, JournalError, JournalReader, block, rows_block
from vbus.record.journal import Journal
from vbus.record.replay import Replay
from vbus.record.rows import AGAIN, FULL, OTHER
from vbus.record.view import play

TRIED = int(os.environ.get("VBUS_DAMAGED", "60"))
ALL = [(LM, DC, Lm), (MCP, DC, Mcp), (MC, STEPPER, Mc)]
Host = type[Lm | Mcp | Mc]
Path = tuple[Any, ...]

ODD = (
    0, 1, -1, 2, (1 << 63) - 1, -(1 << 63), (1 << 64) - 1, 1.5, float("nan"), float("inf"), None,
    True, "", "x", b"", b"abc", (), (1,), {}, {"a": 1}, "x" * 50,
)  # fmt: skip


def places(value: Any, path: Path = ()) -> Iterator[Path]:
    """Yield where there is a value, from the outside in."""
    yield path
    items = value.items() if isinstance(value, dict) else ()
    if isinstance(value, tuple | list):
        items = enumerate(value)
    for key, inner in items:
        yield from places(inner, (*path, key))


def at(value: Any, path: Path) -> Any:
    for key in path:
        value = value[key]
    return value


def put(value: Any, path: Path, new: Any) -> Any:
    """Return the value with another one at a place."""
    if not path:
        return new
    key, *rest = path
    if isinstance(value, dict):
        return value | {key: put(value[key], tuple(rest), new)}
    return (*value[:key], put(value[key], tuple(rest), new), *value[key + 1 :])


def damaged(random: Random, content: Any) -> tuple[Path, Any]:
    """Return where something is exchanged, and the content with that."""
    path = random.choice([*places(content)][1:])
    old = at(content, path)
    new: Any = random.choice(ODD)
    kind = random.randrange(3)
    if kind == 0 and isinstance(old, int):
        new = old + random.choice((1, -1, 256, 1 << 32))
    elif kind == 1 and isinstance(old, tuple | list | str | bytes):
        new = old[1:]
    elif kind == 1 and isinstance(old, dict):
        new = dict([*old.items()][1:])
    return path, put(content, path, new)


def working(chip: str, plant: str, host: Host) -> tuple[Board, Hosts]:
    """Return a board in motion, with a fault that acts and half a request."""
    board = build(chip, plant)
    made = host(board)
    made.spin()
    board.run_for(3 * MS)
    board.faults.arm("clock_off", until="for 9 ms")
    wire = ByteProtocol(made.port)
    wire.receive(b"\x32\x00")
    return board, {0: wire}


@pytest.mark.parametrize("fits", [False, True], ids=["hash as it was", "hash made to fit"])
@pytest.mark.parametrize(("chip", "plant", "host"), ALL)
def test_a_damaged_snapshot_is_refused_and_the_board_stays_as_it_was(
    chip: str, plant: str, host: Host, fits: bool
) -> None:
    board, wires = working(chip, plant, host)
    taken = snapshot.take(board, wires)
    start = len(snapshot.MAGIC) + 32
    content = msgpack.unpackb(snapshot.write(taken)[start:], use_list=False, strict_map_key=False)
    before, totals = board.state_hash(), board.counters
    refused = 0
    for seed in range(TRIED):
        path, found = damaged(Random(seed), content)
        with suppress(OverflowError):  # nothing a file could hold
            if fits and path[0] == 8:
                digest = hashlib.sha256(msgpack.packb(found[8])).hexdigest()
                found = (*found[:10], digest)
            body = msgpack.packb(found)
            file = snapshot.MAGIC + hashlib.sha256(body).digest() + body
            try:
                snapshot.restore(board, snapshot.read(file), wires)
            except SnapshotError:
                refused += 1
                assert board.state_hash() == before, path
                assert board.counters == totals, path
            else:
                board.run_for(20 * US)
                board.catch_up()
                snapshot.restore(board, taken, wires)
                assert board.state_hash() == before, path
            assert len(board.ports) == 1
    assert refused > TRIED // 3


CHIP = ("chips", 0)
AXIS = (*CHIP, "axis")
MOTOR = (*AXIS, "encoder", "plant")
COURSE = ("faults", "acts", "courses", 0, 1, 1)


@pytest.mark.parametrize(
    ("which", "path", "value", "reason"),
    [
        (0, ("kernel", "now"), 1 << 62, r"the state does not fit: .* is past"),
        (0, (*CHIP, "_cycle"), -(1 << 40), "chip x: its state is not of 3"),
        (0, (*CHIP, "_reset_end"), -(1 << 63), "chip x: its state is not of 3"),
        (1, (*AXIS, "_at_sample"), -(1 << 40), "chip x: its state is not of 3"),
        (2, (*CHIP, "cycles", "_slot"), -(1 << 63), "chip x: its state is not of 3"),
        (1, (*COURSE, 0), 1 << 32, "a clock that jumps from cycle"),
        (2, (*COURSE, 3), (1 << 64) - 1, "a clock of 25000000 Hz with a period of"),
        (2, (*COURSE, 2), -1, "a clock of 25000000 Hz with a period of -1/"),
        (1, (*MOTOR, "current"), 4e9, "a motor that takes 4e"),
        (1, (*MOTOR, "velocity"), -1e12, "a shaft that turns at -1e"),
        (1, (*MOTOR, "count"), 1 << 32, "a shaft that has turned to"),
        (1, (*MOTOR, "points", 1), -(2.0**63), "a shaft that has turned to"),
    ],
)
def test_a_state_that_would_take_for_ever_to_run_is_refused(
    which: int, path: Path, value: float, reason: str
) -> None:
    board, wires = working(*ALL[which])
    taken = snapshot.take(board, wires)
    before = board.state_hash()
    plain = msgpack.packb(taken.state)
    state = put(msgpack.unpackb(plain, use_list=False, strict_map_key=False), path, value)
    digest = hashlib.sha256(msgpack.packb(state)).hexdigest()
    file = snapshot.write(replace(taken, state=state, digest=digest))
    with pytest.raises(SnapshotError, match=reason):
        snapshot.restore(board, snapshot.read(file), wires)
    assert board.state_hash() == before


def blocks(data: bytes) -> Iterator[Any]:
    """Yield what a journal's blocks hold."""
    position = len(MAGIC)
    while position < len(data):
        size = int.from_bytes(data[position : position + 4], "big")
        body = zlib.decompress(data[position + 8 : position + 8 + size])
        yield msgpack.unpackb(body, strict_map_key=False)
        position += 8 + size


@pytest.mark.parametrize(("chip", "plant", "host"), ALL)
def test_a_damaged_journal_is_played_or_refused_in_words(chip: str, plant: str, host: Host) -> None:
    file = io.BytesIO()
    board = build(chip, plant)
    journal = Journal(board, file, board.text, "b.toml")
    made = host(board)
    made.spin()
    port = made.port
    board.faults.arm("clock_off", until="for 9 ms")
    journal.outside("arm", ["clock_off", "x", "now", "for 9 ms", {"ppm": 100}])
    port.events(1)
    for level in (0, 1):
        port.lines(1, level)
        port.pin(0, level)
        port.delay(100 * NS)
    port.sample()
    port.sync()
    port.wait(5)
    port.close()
    journal.close()
    content = tuple(blocks(file.getvalue()))
    refused = 0
    for seed in range(TRIED):
        _, found = damaged(Random(seed), content)
        with suppress(OverflowError):
            data = MAGIC + b"".join(map(block, found))
            try:
                reader = JournalReader(io.BytesIO(data))
                play(reader.header, reader, PacketReader())
                reader = JournalReader(io.BytesIO(data))
                twin = load_board_text(reader.header.text, "b.toml")
                Replay(twin, reader, reader.header.families).run()
            except VbusError:
                refused += 1
    assert refused > TRIED // 4


def entry(op: str, value: Any, start: float = 0) -> bytes:
    """Return a journal with one entry."""
    board = build()
    file = io.BytesIO()
    Journal(board, file, board.text, "b.toml")
    others = [CODE[op], value, start, 0]
    return file.getvalue() + rows_block(0, OTHER.to_bytes(2, "big"), others)


@pytest.mark.parametrize(
    ("op", "value", "start", "text"),
    [
        ("delay", [["long"], True, 0, -1], 0, r"entry 0: Expected `int`, got `str` - at `\$\[0\]"),
        ("open", ["host0"], 0, "entry 0: Expected `array` of length 4, got 1"),
        ("violation", [1, 2], 0, "entry 0: Expected `array` of length 8, got 2"),
        ("now", [[], 5, 0, -1], END + 1, f"from {END + 1} to {END + 1} ps; time ends at {END} ps"),
        ("now", [[], 5, 0, -1], -1, "entry 0: from -1 to -1 ps; time ends at"),
        ("now", [[], 5, 0, -1], 1.5, "entry 0: from 1.5 to 1.5 ps; time ends at"),
        ("read", [[0], None, 0, -1], 0, "entry 0: a read that has neither data nor a refusal"),
    ],
)
def test_an_entry_that_cannot_be_is_named(op: str, value: Any, start: float, text: str) -> None:
    with pytest.raises(JournalError, match=text):
        list(JournalReader(io.BytesIO(entry(op, value, start))))


@pytest.mark.parametrize(
    ("op", "value", "text"),
    [
        ("now", [[], 5, 0, -1], "entry 0, now: session 0 has not begun"),
        ("open", [["h", ["y"], 0], None, 0, -1], "entry 0, open: no chip called 'y'"),
        ("arm", ["bad", "x", "now", "once", {}], 'entry 0, arm: there is no fault "bad"'),
    ],
)
def test_a_call_that_cannot_be_made_is_named(op: str, value: Any, text: str) -> None:
    reader = JournalReader(io.BytesIO(entry(op, value)))
    with pytest.raises(JournalError, match=text):
        Replay(build(), reader, reader.header.families).run()


def test_a_block_unpacks_to_a_bounded_size(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vbus.record.format.LARGEST", 4000)
    data = entry("fault", [0, "a", "x", "y", "z" * 5000])
    with pytest.raises(JournalError, match="makes no sense: it holds more than 4000 bytes"):
        list(JournalReader(io.BytesIO(data)))


def test_a_block_may_unpack_to_forty_megabytes() -> None:
    data = entry("fault", [0, "a", "x", "y", "z" * 40_000_000])
    (found,) = JournalReader(io.BytesIO(data))
    assert len(found.args[4]) == 40_000_000


def test_a_block_has_a_bounded_number_of_entries() -> None:
    start = entry("now", [[], 5, 0, -1])
    again = OTHER.to_bytes(2, "big") + (AGAIN | FULL).to_bytes(2, "big")
    data = start + rows_block(1, again, [0, 0x84, 0, 0])
    with pytest.raises(JournalError, match=rf"entry {FULL + 2}: more than {FULL} entries"):
        list(JournalReader(io.BytesIO(data)))
