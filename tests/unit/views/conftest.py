"""Small boards with something to record on them."""

import io
from collections.abc import Callable

import pytest

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.core.kernel import MS, US
from vbus.record.format import Entry, Header, JournalReader
from vbus.record.journal import Journal

LM629 = """\
[board]
name = "bench"
time = "lockstep"
power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "m"
[plants.m]
model = "dc_motor"
"""


def lm629_command(port: HostBus, code: int, *words: int) -> None:
    """Give a command as a careful driver does."""
    while port.read(0) & 1:
        pass
    port.write(0, code)
    for word in words:
        while port.read(0) & 1:
            pass
        port.write(1, word >> 8)
        port.write(1, word & 0xFF)


def lm629_words(port: HostBus, code: int, count: int) -> int:
    """Read some words."""
    lm629_command(port, code)
    value = 0
    for _ in range(count):
        while port.read(0) & 1:
            pass
        value = value << 16 | port.read(1) << 8 | port.read(1)
    return value


def lm629_move(port: HostBus) -> None:
    """A short move, with positions read and one thing done wrong."""
    lm629_command(port, 0x1E, 0x000A, 300, 2000)
    lm629_command(port, 0x04)
    lm629_command(port, 0x1F, 0x002A, 0, 400, 1, 0, 0, 500)
    lm629_command(port, 0x01)
    port.write(0, 0x01)
    port.delay(20 * MS)
    for _ in range(5):
        lm629_words(port, 0x0A, 2)
        port.delay(3 * MS)


Recorded = tuple[Header, list[Entry]]


def read(data: bytes) -> Recorded:
    """Read a journal from memory."""
    reader = JournalReader(io.BytesIO(data))
    return reader.header, list(reader)


def record(text: str, *work: Callable[[HostBus], None], close: bool = True) -> bytes:
    """Record hosts, one after the other, and return the journal."""
    board = load_board_text(text)
    file = io.BytesIO()
    journal = Journal(board, file, text, "board.toml")
    for number, host in enumerate(work):
        port = board.open_port(f"host{number}")
        host(port)
        port.close()
    if close:
        journal.close()
    else:
        journal.flush()
    return file.getvalue()


@pytest.fixture(scope="session")
def moved() -> bytes:
    """The journal of a move."""
    return record(LM629, lm629_move)


def board_of(header: Header) -> Board:
    """Build a board from a journal's header."""
    return load_board_text(header.text, header.file)


def strobed(port: HostBus) -> None:
    """A host that moves the lines itself: write RDSIGS, read a status byte, use pins and time."""
    cs, ps, rd, wr = (port.line_number(name) for name in ("/CS", "/PS", "/RD", "/WR"))

    def level(line: int, value: int) -> None:
        port.lines(1 << line, value << line)
        port.delay(200_000)

    level(ps, 0)
    level(cs, 0)
    port.drive(0x0C)
    level(wr, 0)
    level(wr, 1)
    port.release()
    level(rd, 0)
    port.sample()
    level(rd, 1)
    level(rd, 0)
    port.delay(1000)
    level(wr, 0)
    level(wr, 1)
    level(rd, 1)
    level(cs, 1)
    port.pin(port.pin_number("/RST"), 0)
    port.delay(10 * US)
    port.pin(port.pin_number("/RST"), 1)
    port.getpin(port.pin_number("HI"))
    port.wait(5 * MS)
    port.now()
    port.sync()
