"""Card adapters declared as data: the manual's ISA circuit, byte ports, one's own (PMD-BUS-12)."""

import pytest

from vbus.board.build import build, card_of
from vbus.board.config import read_board_text
from vbus.core.kernel import MS
from vbus.core.signals import Observer
from vbus.protocols.text import TextProtocol

spec = pytest.mark.spec

BOARD = """
[board]
name = "card"
time = "lockstep"
power_on = "done"

[chips.m]
part = "MC1241A"
clock = "25 MHz"
plants = ["x", "y"]

[plants.x]
model = "ideal"

[plants.y]
model = "ideal"

[cards.slot]
{card}

[[hosts]]
transport = "unix:card.sock"
protocol = "text"
card = "slot"
"""

ISA = 'base = 0x340\ndecode = "isa"\nchips = ["m"]'
BYTE = 'base = 0x210\ndecode = "byte"\nchips = ["m"]'
OWN = """
base = 0x8000
stride = 4
ports = [
  { offset = 3, chip = "m", address = 0 },
  { offset = 1, chip = "m", address = 1 },
]
"""


class Card:
    """A host that knows card addresses only."""

    def __init__(self, card: str, data: int, command: int, status: int, ready: int) -> None:
        file, source = read_board_text(BOARD.replace("{card}", card))
        self.board = build(file, source)
        port = self.board.open_port("pc", card=card_of(file, file.hosts[0]))
        self.text = TextProtocol(port)
        self.data, self.command_at, self.status, self.ready = data, command, status, ready

    def ask(self, line: str) -> str:
        self.text.receive(line.encode() + b"\n")
        return self.text.take().decode().strip()

    def inb(self, address: int) -> int:
        answer = self.ask(f"inb 0x{address:x}")
        assert answer.startswith("OK ")
        return int(answer[3:], 16)

    def outb(self, address: int, value: int) -> None:
        assert self.ask(f"outb 0x{address:x} 0x{value:x}") == "OK"

    def wait(self) -> int:
        for polls in range(1000):
            if self.inb(self.status) & self.ready:
                return polls
        raise AssertionError("HostRdy stays low")

    def command(self, code: int) -> None:
        self.wait()
        self.outb(self.command_at, code)

    def word(self) -> int:
        self.wait()
        return self.inb(self.data) << 8 | self.inb(self.data)


CARDS = {
    "isa": (ISA, 0x340, 0x342, 0x344, 0x80),
    "byte": (BYTE, 0x210, 0x211, 0x211, 0x80),
    "own": (OWN, 0x800C, 0x8004, 0x8004, 0x80),
}


@spec("PMD-BUS-12")
@pytest.mark.parametrize("name", CARDS)
@pytest.mark.parametrize("watched", [False, True])
def test_a_host_reaches_the_chip_through_the_card(name: str, watched: bool) -> None:
    card = Card(*CARDS[name])
    if watched:  # cycles are played as strobes then
        card.board.watch("m.D0-D7", Observer())
    card.command(0x6C)
    assert card.word() == 0x4A10
    assert card.word() == 0x6C + 0x4A10
    card.command(0x29)
    for byte in (0x12, 0x34):
        card.wait()
        card.outb(card.data, byte)
    card.command(0x55)
    assert card.word() == 0x1234
    assert list(card.board.violations) == []


@spec("PMD-BUS-12", "PMD-BUS-7")
@pytest.mark.parametrize("watched", [False, True])
def test_polls_of_one_microsecond_see_the_busy_time_pass(watched: bool) -> None:
    card = Card(*CARDS["isa"])
    if watched:
        card.board.watch("m.~HostWrite", Observer())
    card.command(0x33)
    assert card.wait() == 67  # the 68th poll, 68 us after the command, finds HostRdy high


@spec("PMD-BUS-12")
def test_the_isa_status_port_drives_d7_only() -> None:
    card = Card(*CARDS["isa"])
    assert card.inb(0x344) == 0xFF
    card.outb(0x342, 0x33)
    assert card.inb(0x344) == 0x7F
    assert card.inb(0x342) == 0xFF  # the command port cannot be read
    assert card.inb(0x346) == 0xFF  # nobody answers


@spec("PMD-BUS-12")
def test_d6_of_the_byte_card_is_the_interrupt_line() -> None:
    card = Card(*CARDS["byte"])
    for code, data in ((0x2F, (0, 1)), (0x46, ()), (0x1A, ())):
        card.command(code)
        for byte in data:
            card.wait()
            card.outb(card.data, byte)
    card.wait()
    assert card.inb(0x211) & 0xC0 == 0xC0
    card.board.run_for(MS)
    assert card.inb(0x211) & 0xC0 == 0x80


@spec("PMD-BUS-12", "PMD-RST-1")
@pytest.mark.parametrize("watched", [False, True])
def test_the_isa_reset_port_resets_the_chip_set(watched: bool) -> None:
    card = Card(*CARDS["isa"])
    if watched:
        card.board.watch("m.~HostWrite", Observer())
    card.command(0x02)  # SET_2
    card.wait()
    card.outb(0x348, 0x00)
    at = card.board.now
    assert card.inb(0x344) & 0x80 == 0
    while card.inb(0x344) & 0x80 == 0:
        pass
    assert 2 * MS <= card.board.now - at <= 2 * MS + 1_000_000
    card.command(0x31)
    assert card.word() == 0x0300
