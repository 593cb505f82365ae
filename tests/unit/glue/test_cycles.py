"""Cycles at chips behind glue are told as those of any other host: to observers and journals."""

import io

import pytest

from tests.unit.glue.test_cards import LATCH, WIRED, Slot, move
from tests.unit.glue.test_edges import INDEXED, register
from tests.unit.glue.test_paths import TWO
from tests.unit.views.conftest import read
from tests.unit.views.test_replay import played
from vbus.board.build import load_board_text
from vbus.board.snapshot import restore, take
from vbus.chips.packets import Packet
from vbus.circuit.stream import CountedLine, PacketTaker
from vbus.cli.transcript import Transcript
from vbus.core.kernel import MS, US
from vbus.core.signals import Observer
from vbus.core.state import save
from vbus.record.journal import Journal
from vbus.views.coverage.coverage import CoverageObserver

DECODED = (
    TWO
    + """
[glue.u1]
part = "74HC139"
delay = "15 ns"
hosts = ["1A", "1/G"]
low = ["1B"]

[glue.u1.pins]
1Y0 = "x./CS"
1Y1 = "y./CS"
"""
)
"""A host moves the strobes, and the inputs of a decoder that selects a chip."""


class Timed(Transcript):
    """Each line begins with the instant of its first cycle, in microseconds."""

    def _write(self, line: CountedLine) -> None:
        super()._write(CountedLine(line.when, f"{line.when / US:.3f} {line.text}", line.times))


def transcript(slot: Slot) -> Transcript:
    told = Transcript(io.StringIO())
    slot.board.observe(told)
    return told


def lines(told: Transcript) -> list[str]:
    told.flush()
    assert isinstance(told._file, io.StringIO)
    return told._file.getvalue().splitlines()


@pytest.mark.parametrize("watched", [False, True])
def test_a_cycle_on_a_card_is_told_with_the_cycles_it_makes_at_chips(watched: bool) -> None:
    slot = Slot(WIRED)
    if watched:
        slot.board.watch("x./CS", Observer())
    told = transcript(slot)
    slot.outb(LATCH, 0x01)
    slot.port.delay(4 * MS)
    slot.inb(0x302)
    slot.outb(0x304, 0x00)
    slot.inb(0x306)
    assert lines(told) == [
        "slot w C 01", "y r 0 84", "slot r 2 84", "x+y w 0 00", "slot w 4 00", "slot r 6 FF",
    ]  # fmt: skip


def test_a_driver_on_a_card_covers_commands_and_is_read_in_the_manuals_words() -> None:
    slot = Slot(WIRED)
    families = {chip.name: chip.FAMILY for chip in slot.board.chips}
    packets: list[tuple[str, str]] = []

    def take_packet(chip: str, packet: Packet) -> None:
        packets.append((chip, packet.name))

    coverage = CoverageObserver(families, "driver")
    slot.board.observe(PacketTaker(take_packet))
    slot.board.observe(coverage)
    slot.outb(LATCH, 0x01)
    slot.port.delay(4 * MS)
    move(slot, 0x302, 50)
    slot.inb(0x302)
    commands = [name for chip, name in packets if chip == "y" and name != "RDSTAT"]
    assert commands == ["LFIL", "UDF", "LTRJ", "STT"]
    assert {name for chip, name in packets if chip == "slot"} >= {"read 302H", "write 303H"}
    assert coverage.coverage.families() == ["lm628"]
    found = {item.name: count for item, count in coverage.coverage.groups("lm628")["commands"]}
    assert (found["LTRJ"], found["STT"], found["RDRP"]) == (1, 1, 0)


@pytest.mark.parametrize("watched", [False, True])
def test_cycles_at_a_chip_that_wants_every_edge_are_told_too(watched: bool) -> None:
    slot = Slot(INDEXED)
    if watched:
        slot.board.watch("slot./IOW", Observer())
    told = transcript(slot)
    register(slot, 0x22, 0x12)
    assert [line for line in lines(told) if line[0] == "x"] == ["x w 22 12", "x r 22 12"]


def test_strobes_and_side_pins_before_a_decoder_make_cycles_at_the_chip_it_selects() -> None:
    board = load_board_text(DECODED)
    file = io.BytesIO()
    journal = Journal(board, file, DECODED, "board.toml")
    told = Timed(io.StringIO())
    board.observe(told)
    port = board.open_port("host")
    names = port.pins.line_names()
    bit = {name: 1 << names.index(name) for name in ("main./RD", "main./WR", "main./PS")}
    every = sum(bit.values())

    def select(chip: int, enable: int) -> None:
        port.pin(port.pin_number("u1.1A"), chip)
        port.pin(port.pin_number("u1.1/G"), enable)
        port.delay(US)

    port.lines(every, every - bit["main./PS"])
    select(1, 0)
    port.lines(bit["main./RD"], 0)
    port.delay(US)
    assert port.sample()[0] == 0x84
    port.lines(bit["main./RD"], bit["main./RD"])
    select(0, 0)
    port.drive(0x06)
    port.lines(bit["main./WR"], 0)
    port.delay(US)
    port.pin(port.pin_number("u1.1/G"), 1)  # the select ends the write, 15 ns later
    port.delay(US)
    port.lines(bit["main./WR"], bit["main./WR"])
    port.close()
    assert lines(told) == [
        "2.000 y r 0 84", "4.015 ! x lm628.T7 /CS rose before /WR", "4.015 x w 0 06",
    ]  # fmt: skip
    journal.close()
    header, entries = read(file.getvalue())
    assert header.families == {"x": "lm628", "y": "lm628"}
    cycles = [(entry.after, entry.args) for entry in entries if entry.op == "cycle"]
    assert cycles == [(2 * US, ("y", False, 0, 0x84)), (4_015_000, ("x", True, 0, 0x06))]
    assert played(file.getvalue()).divergence is None
    number = next(entry.number for entry in entries if entry.op == "cycle")
    changed = played(file.getvalue(), changed={number: {"args": ("x", False, 0, 0x84)}})
    assert changed.divergence is not None
    assert changed.divergence.recorded != changed.divergence.now


def test_what_a_latched_address_will_come_to_is_in_a_snapshot() -> None:
    slot, twin = Slot(INDEXED), Slot(INDEXED)
    slot.outb(0x300, 0x22)  # the latch of the MCP-1200
    slot.port.delay(10 * US)
    restore(twin.board, take(slot.board))
    for one in (slot, twin):
        told = transcript(one)
        one.outb(0x301, 0x34)
        assert lines(told) == ["x w 22 34", "slot w 1 34"]
    assert slot.board.state_hash() == twin.board.state_hash()


def test_a_cycle_at_the_chip_itself_is_told_once() -> None:
    """A session that selects chips behind the glue passes it by."""
    board = load_board_text(DECODED)
    told = Transcript(io.StringIO())
    board.observe(told)
    port = board.open_port("host")
    port.pin(port.pin_number("u1.1A"), 1)
    port.write(0, 0x06)
    port.select(3)
    port.read(0)
    found = lines(told)
    assert [line[:7] for line in found if line[0] != "!"] == ["x w 0 0", "x+y r 0"]


def test_a_latched_address_is_followed_without_a_reader_for_it_is_state() -> None:
    board = load_board_text(INDEXED.partition("[cards.slot]")[0])
    port = board.open_port("host")
    names = port.pins.line_names()
    bit = {name: 1 << number for number, name in enumerate(names)}

    def latch(address: int) -> None:
        port.drive(address)
        for level in (0, bit["x./ALE"]):
            port.delay(US)
            port.lines(bit["x./ALE"], level)

    port.lines(sum(bit.values()), sum(bit.values()))
    latch(0x22)
    (watch,) = port.strobes.watches
    assert save(watch)["_address"] == 0x22
