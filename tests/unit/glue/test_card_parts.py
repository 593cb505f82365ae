"""A card's own parts: selects by ranges of addresses, and registers of each kind."""

from functools import partial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.glue.test_cards import FOLDER, Slot, mapped, move
from tests.unit.glue.test_paths import TWO, steady
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.card.card_bus import CLOCK, CardBus
from vbus.board.snapshot import restore, take
from vbus.core.errors import ConfigError
from vbus.core.kernel import MS, US
from vbus.core.signals import Observer
from vbus.glue.card_buses import BUSES

INDEXED = (FOLDER / "indexed_card.toml").read_text()
INDEX, DATA, CONTROL, ID, ENABLE, REQUEST, SWITCHES = (
    0x280,
    0x281,
    0x282,
    0x283,
    0x285,
    0x286,
    0x287,
)


class Indexed(Slot):
    """A driver of the indexed card: the chip and its port stand in the index register."""

    def inb(self, address: int) -> int:
        if address < 4:
            super().outb(INDEX, address)
        return super().inb(DATA if address < 4 else address)

    def outb(self, address: int, data: int) -> None:
        if address < 4:
            super().outb(INDEX, address)
        super().outb(DATA if address < 4 else address, data)


def running(text: str = INDEXED) -> Indexed:
    slot = Indexed(text)
    slot.outb(CONTROL, 0x01)
    slot.port.delay(4 * MS)
    return slot


def side(slot: Slot, name: str, level: int) -> None:
    slot.port.pin(slot.port.pin_number(name), level)


def test_a_driver_moves_both_axes_through_an_index_register() -> None:
    slot = running()
    move(slot, 0, 50)
    move(slot, 2, -30)
    slot.port.delay(60 * MS)
    assert (slot.position(0), slot.position(2)) == (50, -30)
    assert slot.inb(INDEX) == 0x02 + 1
    assert list(slot.board.violations) == []


def test_a_latch_begins_with_its_reset_value_and_reads_back_what_is_written() -> None:
    slot = Slot(INDEXED.replace("at = 2\n", "at = 2\nreset = 0xA1\n"))
    assert slot.board.find_pin("x./RST").net.value == 1
    assert slot.inb(CONTROL) == 0xA1
    slot.outb(CONTROL, 0x5A)
    assert (slot.inb(CONTROL), slot.board.find_pin("x./RST").net.value) == (0x5A, 0)
    assert slot.port.getpin(slot.port.pin_number("control.Q7")) == 0
    side(slot, "slot.RESET", 1)
    assert slot.board.find_pin("x./RST").net.value == 1
    side(slot, "slot.RESET", 0)
    assert slot.inb(CONTROL) == 0xA1
    assert slot.port.getpin(slot.port.pin_number("control.Q7")) == 1


def test_a_latch_that_is_not_read_back_leaves_the_bus_alone() -> None:
    slot = Slot(INDEXED.replace("at = 2\n", "at = 2\nread_back = false\n"))
    slot.outb(CONTROL, 0x01)
    assert slot.inb(CONTROL) == 0xFF
    assert slot.board.find_pin("x./RST").net.value == 1


def test_fixed_values_stand_at_addresses_of_their_own() -> None:
    slot = running()
    assert [slot.inb(ID), slot.inb(ID + 1)] == [0x4D, 0x43]
    slot.outb(ID, 0x00)
    assert slot.inb(ID) == 0x4D


def test_status_inputs_are_read_as_they_stand() -> None:
    slot = running()
    side(slot, "switches.I0", 1)
    side(slot, "switches.I1", 0)
    assert slot.inb(SWITCHES) == 0x81
    side(slot, "switches.I1", 1)
    assert slot.inb(SWITCHES) == 0x83


def interrupt(slot: Slot, base: int) -> None:
    """RSTI clears, MSKI enables the breakpoint interrupt; a reset of the chip raises HI."""
    slot.command(base, 0x1D, 0x00, 0x00)


def test_pending_bits_are_kept_until_a_one_is_written_and_masked_by_their_enables() -> None:
    slot = running()
    irq = slot.board.find_pin("request.INT").net
    assert slot.inb(REQUEST) == 0x03  # both chips interrupt after their reset
    assert irq.value == 0
    slot.outb(ENABLE, 0x02)
    assert irq.value == 1
    assert slot.inb(SWITCHES) & 4
    interrupt(slot, 0)
    interrupt(slot, 2)
    assert (slot.board.find_pin("x.HI").net.value, slot.inb(REQUEST)) == (0, 0x03)
    slot.outb(REQUEST, 0x02)
    assert (slot.inb(REQUEST), irq.value) == (0x01, 0)
    slot.outb(ENABLE, 0x03)
    assert irq.value == 1
    slot.outb(REQUEST, 0xFE)
    assert slot.inb(REQUEST) == 0x01
    slot.outb(REQUEST, 0x01)
    assert (slot.inb(REQUEST), irq.value) == (0x00, 0)


@pytest.mark.parametrize(("sense", "left"), [("edge", 0x00), ("level", 0x03)])
def test_a_bit_whose_input_still_stands_comes_again_if_levels_are_sensed(
    sense: str, left: int
) -> None:
    slot = running(INDEXED.replace('kind = "pending"', f'kind = "pending"\nsense = "{sense}"'))
    slot.outb(REQUEST, 0x03)
    assert slot.inb(REQUEST) == left


def test_what_registers_hold_is_part_of_what_is_remembered() -> None:
    slot = running()
    cycles = [partial(Slot.inb, slot, 0x280 + offset) for offset in range(8)]
    cycles += [partial(Slot.outb, slot, at, 0x00) for at in (DATA, ID)]
    cycles += [partial(Slot.outb, slot, INDEX, index) for index in (0x01, 0x00)]
    assert steady(slot, *cycles)


STEPS = st.lists(
    st.tuples(st.booleans(), st.integers(0, 7), st.sampled_from([0, 1, 2, 3, 0x1D, 0xFF])),
    min_size=1, max_size=25,
)  # fmt: skip


@given(STEPS, st.booleans())
@settings(max_examples=50)
def test_registers_are_the_same_whoever_looks_on_and_after_a_snapshot(
    steps: list[tuple[bool, int, int]], level: bool
) -> None:
    text = INDEXED.replace('"pending"', '"pending"\nsense = "level"') if level else INDEXED
    runs = []
    for watched in (False, True):
        slot, twin = running(text), Slot(text)
        if watched:
            slot.board.watch("slot./IOW", Observer())
        found: list[object] = []
        for number, (write, offset, data) in enumerate(steps):
            if number == len(steps) // 2 and not watched:
                restore(twin.board, take(slot.board))
                found.append(slot.board.state_hash() == twin.board.state_hash())
            elif number == len(steps) // 2:
                found.append(True)
            if write:
                Slot.outb(slot, 0x280 + offset, data)
            else:
                found.append(Slot.inb(slot, 0x280 + offset))
        slot.port.delay(US)
        found += [part.blocks[-1].state for part in slot.board.glue.parts]
        found += [(v.when, v.rule) for v in slot.board.violations]
        runs.append(found)
    assert runs[0] == runs[1]


def test_the_map_shows_registers_and_says_what_an_index_hides() -> None:
    shown, notes = mapped(INDEXED)
    assert shown[:2] == ["slot 280H: read index, write index", "slot 281H: read x.0, write x.0"]
    assert shown[3:5] == ["slot 283H: read id", "slot 284H: read id"]
    assert notes == [
        '[cards.slot]: chip "y" is never selected at 280H to 287H as the registers stand after'
        " power-on; look at what drives its select"
    ]


RANGES = (
    TWO
    + """
[cards.slot]
bus = "SRAM"
memory = true
base = 0x20000
stride = 4
size = 8
setup = "50 ns"
strobe = "200 ns"
hold = "130 ns"

[cards.slot.pins]
"D0-D7" = "main.D0-D7"
"/OE" = "main./RD"
"/WE" = "main./WR"
A2 = "main./PS"

[cards.slot.selects]
"x./CS" = ["0-1", "4-0x5"]
"y./CS" = ["2-3", "4-5"]

[[hosts]]
transport = "unix:$VBUS_RUNTIME/ranges.sock"
card = "slot"
"""
)


def test_ranges_select_chips_at_strides_of_memory_and_one_of_them_both() -> None:
    slot = Slot(RANGES)
    assert [slot.inb(0x20000 + 4 * n) for n in (0, 2, 6)] == [0x84, 0x84, 0xFF]
    for address in (0x20001, 0x20002, 0x20003):
        assert slot.port.card(address, False) is None
    slot.command(0x20010, 0x1D)
    told: list[tuple[str, bool, int, int]] = []

    class Told(Observer):
        def bus_cycle(
            self, when: int, host: str, chip: str, write: bool, address: int, data: int
        ) -> None:
            told.append((chip, write, address, data))

    slot.board.observe(Told())
    slot.outb(0x20014, 0x12)
    assert told == [("x+y", True, 1, 0x12), ("slot", True, 5, 0x12)]
    shown, notes = mapped(RANGES)
    assert shown == [
        "slot 20000H: read x.0, write x.0", "slot 20004H: read x.1, write x.1",
        "slot 20008H: read y.0, write y.0", "slot 2000CH: read y.1, write y.1",
        "slot 20010H: read x.0+y.0, write x.0+y.0", "slot 20014H: read x.1+y.1, write x.1+y.1",
        "slot 20018H-2001CH: no chip; at 20018H x./CS is high by slot-selects; y./CS is high by"
        " slot-selects",
    ]  # fmt: skip
    assert notes[0] == (
        "[cards.slot]: x.0 and y.0 both answer a read at 20010H and fight; select one of them only"
    )


def test_wait_states_make_the_strobe_longer_by_cycles_of_the_bus_clock() -> None:
    text = RANGES.replace('strobe = "200 ns"\n', "")
    slot, late = Slot(text), Slot(text.replace("size = 8", "size = 8\nwait_states = 20"))
    for one in (slot, late):
        one.inb(0x20000)
    assert {v.rule for v in slot.board.violations} >= {"lm628.T10"}
    assert list(late.board.violations) == []


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('DATA = "1"', 'DATA = "9"', 'found "9"; this card has ports 0 to 7'),
        ('DATA = "1"', 'DATA = "3-1"', 'found "3-1"; this card has ports 0 to 7'),
        ('DATA = "1"', 'DATA = "one"', 'found "one"; write distances from the base'),
        ('DATA = "1"', "DATA = []", "it has no addresses; write some"),
        ('DATA = "1"', 'DATA = "1"\n"!DATA" = "2"', '"DATA" stands here twice; join its ranges'),
        ('DATA = "1"', 'DATA = "1"\nNONE = "2"', 'nothing else is on wire "NONE"'),
        ('DATA = "1"', 'DATA = "1"\n"z./CS" = "2"', 'nothing on the board is called "z"'),
        ("at = 0\n", "at = 8\n", "found 8; this card has ports 0 to 7"),
        ("at = 0\n", 'at = 0\nkind = "ram"', 'found "ram"; allowed are "latch", "status"'),
        ("at = 0\n", 'at = 0\nvalues = "00"', '"values" needs kind = "fixed"'),
        ("at = 2\n", 'at = 2\nsense = "level"\n', '"sense" needs kind = "pending"'),
        ('values = "4D 43"', 'values = "4D 4"', 'found "4D 4"; write hexadecimal bytes'),
        ('values = "4D 43"', 'values = ""', 'found ""; write hexadecimal bytes'),
        ("at = 3\n", "at = 7\n", "found 7; this card has ports 0 to 7"),
        ('Q7"]', 'Q9"]', 'a register of kind "latch" has no pin "Q9" here; it has Q0'),
        ('high = ["I7"]', 'high = ["I0"]', '"I0" is wired already'),
        ("registers.index]", "registers.x]", "[chips.x] has this name too, and pins of its own"),
        ("registers.index]", "registers.pal]", "has this name too, and pins of its own"),
        ("registers.index]", 'registers."a.b"]', "a name begins with a letter"),
    ],
)
def test_a_mistake_in_a_cards_own_parts_is_named(old: str, new: str, message: str) -> None:
    assert old in INDEXED
    with pytest.raises(ConfigError) as told:
        load_board_text(INDEXED.replace(old, new))
    assert message in str(told.value)


def test_parts_of_a_bus_are_for_a_card_that_has_one() -> None:
    text = RANGES.replace('bus = "SRAM"', 'decode = "direct"\nchips = ["x"]')
    with pytest.raises(ConfigError) as told:
        load_board_text(text)
    assert '"pins" needs "bus" (its connector, wired by pins, in place of ports and decode)' in str(
        told.value
    )


MULTIPLEXED = """\
[chips.x]
part = "MCP-1200"
clock = "2 MHz"
plant = "none"

[board]
power_on = "done"

[cards.bus]
bus = "XMEM"
memory = true
base = 0x8000
size = 256
setup = "250 ns"
strobe = "250 ns"
hold = "60 ns"

[cards.bus.pins]
"D0-D7" = "x.DB0-DB7"
"/WR" = "x.R/W"

[glue.pal]
part = "PLD"

[glue.pal.equations]
"x./ALE" = "!bus.ALE"
"x./CS" = "bus.A7 | (bus./RD & bus./WR)"
"x./OE" = "!bus.A7 | bus./RD"

[[hosts]]
transport = "unix:$VBUS_RUNTIME/xmem.sock"
card = "bus"
"""
"""Registers at 8000H to 807FH; a read there loads the output latch, which is read 80H above."""


@pytest.mark.parametrize(("bus", "base"), [("XMEM", 0x8000), ("MUX", 0x2000_8000)])
def test_an_mcp_1200_takes_its_address_from_a_multiplexed_bus(bus: str, base: int) -> None:
    """That of an AVR, and that of a processor with more than 64 KB."""
    slot = Slot(MULTIPLEXED.replace('"XMEM"', f'"{bus}"').replace("0x8000", hex(base)))
    for number, data in ((0x22, 0x5A), (0x2A, 0xC3)):
        slot.outb(base + number, data)
        slot.port.delay(10 * US)
    for number, data in ((0x22, 0x5A), (0x2A, 0xC3)):
        slot.inb(base + number)
        slot.port.delay(10 * US)
        assert slot.inb(base + 0x80 + number) == data
        slot.port.delay(10 * US)
    # R/W rises with /CS: a careful board would hold it.
    assert {violation.rule for violation in slot.board.violations} == {"mcp1200.tWCS"}


VME = (FOLDER.parent / "mcp1200_mmio" / "vme_card.toml").read_text()


def test_a_card_has_registers_beside_a_chip_that_answers_by_its_table() -> None:
    """The chip by whole cycles, which multiplex its address; the latch and the flags by the bus."""
    slot = Slot(VME)
    base = 0x20005000
    assert slot.inb(base + 0xC0) == 0
    slot.outb(base + 0xC0, 0x03)
    slot.port.delay(1 * MS)
    slot.outb(base + 0x22, 0x5A)
    assert [slot.inb(base + at) for at in (0x22, 0xC0, 0xC1, 0xD0)] == [0x5A, 0x03, 0x02, 0xFF]
    assert slot.board.find_pin("irq.1Y").net.value == 0  # idle, and enabled
    slot.outb(base + 0xC0, 0x00)
    assert slot.board.find_pin("x./RESET").net.value == 0
    assert slot.board.find_pin("irq.1Y").net.value == 1
    shown, _ = mapped(VME)
    assert "vme 20005022H: read x.22, write x.22" in shown
    assert "vme 200050C0H: read control, write control" in shown
    assert "vme 200050C1H: read flags" in shown


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("at = 0xC0", "at = 0x20", 'registers.control.at: "x" answers at 32 already; move the'),
        ('decode = "direct"', 'decode = "odd"', 'vme.decode: found "odd"'),
        ('decode = "direct"', "ports = [{ offset = 0, chip = \"x\", address = 0 }]",
         'cards.vme.chips: "chips" needs "decode" (a decode circuit known by name'),
        ('chips = ["x"]', 'chips = ["x"]\nports = [{ offset = 0, chip = "x", address = 0 }]',
         'a card has either "decode" and "chips", or a list of "ports" beside its "bus"'),
        ('decode = "direct"', "block = 4", '"block" needs "decode" (a decode circuit'),
    ],
)  # fmt: skip
def test_what_a_card_with_both_cannot_have_is_named(old: str, new: str, message: str) -> None:
    with pytest.raises(ConfigError) as told:
        load_board_text(VME.replace(old, new))
    assert message in str(told.value)


def test_the_times_and_lines_of_each_bus_are_those_of_its_data_sheet() -> None:
    found = {
        row.bus: (row.lines, row.strobes, row.setup, row.strobe, row.hold, row.wait)
        for row in BUSES.values()
    }
    assert found == {
        "ISA": (20, ("/IOR", "/IOW", "/MEMR", "/MEMW"), 100_000, 500_000, 30_000, 120_000),
        "XMEM": (16, ("/RD", "/WR"), 125_000, 52_500, 47_500, 62_500),
        "SRAM": (24, ("/OE", "/WE"), 10_000, 100_000, 10_000, 10_000),
        "MUX": (24, ("/RD", "/WR"), 125_000, 200_000, 50_000, 50_000),
    }


def test_a_connector_made_in_python_has_the_usual_times_and_ports_side_by_side() -> None:
    made = Board("b").add_chip(CardBus, "slot", "ISA", CLOCK, {"base": 0x300})
    assert isinstance(made, CardBus)
    assert [made.where(port) for port in (0, 1, 2)] == [0x300, 0x301, 0x302]
    assert (made.setup_ps, made.low_ps, made.hold_ps) == (100_000, 500_000, 30_000)
    assert (made.read_strobe, made.settings["size"]) == ("/IOR", 16)


def test_a_window_of_a_processors_memory_may_lie_anywhere_and_an_isa_card_may_not() -> None:
    slot = Slot(RANGES.replace("base = 0x20000", "base = 0x5002_0000"))
    assert [slot.inb(0x50020000 + 4 * port) for port in (0, 6)] == [0x84, 0xFF]
    with pytest.raises(ConfigError, match="addresses of this bus end at FFFFFH"):
        load_board_text(
            RANGES.replace("base = 0x20000", "base = 0x5002_0000").replace('"SRAM"', '"ISA"')
            .replace("/OE", "/MEMR").replace("/WE", "/MEMW")
        )  # fmt: skip


def test_the_map_says_nothing_of_inputs_that_are_tied() -> None:
    shown, _ = mapped((FOLDER / "avr_xmem.toml").read_text())
    levels = "bus.A4 0, bus.A5 1, bus.A6 0, bus.A7 0, LOWER 0"
    assert (
        f"bus 8020H-80EFH: no chip; at 8020H x./CS is high by u1 ({levels}); y./CS is high by u1"
        f" ({levels})"
    ) in shown
