"""Cycles at chips that want every edge are remembered edge by edge."""

from functools import partial

from tests.probe import probe
from tests.unit.glue.test_cards import Slot
from tests.unit.glue.test_paths import TWO_CHIPS, path_of, steady
from vbus.chips.mc1241a.datasheet import NOT_READY
from vbus.core.kernel import US
from vbus.core.signals import HIGH, Observer

HEAD = (
    TWO_CHIPS
    + """
[cards.slot]
bus = "ISA"
base = 0x300
hold = "{hold} ns"
strobe = "{strobe} ns"

[[hosts]]
transport = "unix:$VBUS_RUNTIME/edges.sock"
card = "slot"

[cards.slot.pins]
"""
)
MCP = {"part": "MCP-1200", "clock": "2 MHz", "data": "DB0-DB7"}
MC = {"part": "MC1241A", "clock": "25 MHz", "data": "D0-D7"}

INDEXED = """
[chips.x]
part = "MCP-1200"
clock = "2 MHz"
plant = "none"

[board]
power_on = "done"

[cards.slot]
bus = "ISA"
base = 0x300
hold = "130 ns"

[[hosts]]
transport = "unix:$VBUS_RUNTIME/edges.sock"
card = "slot"

[cards.slot.pins]
"D0-D7" = "x.DB0-DB7"

[glue.pal]
part = "PLD"

[glue.pal.equations]
"x./ALE" = "slot.A0 | slot./IOW"
"x./CS" = "!slot.A0 | (slot./IOR & slot./IOW)"
"x./OE" = "!slot.A1 | slot./IOR"
"x.R/W" = "slot.A2"
"""
ALE, PUT, GET, TAKE = 0x300, 0x301, 0x305, 0x302


def register(slot: Slot, number: int, data: int | None = None) -> int:
    """Read a register of x, or write it first, as a driver of such a card does."""
    if data is not None:
        slot.outb(ALE, number)
        slot.outb(PUT, data)
        slot.port.delay(10 * US)
    slot.outb(ALE, number)
    slot.inb(GET)
    slot.port.delay(10 * US)
    return slot.inb(TAKE)


def test_on_a_card_of_gates_cycles_at_an_mcp_1200_are_remembered() -> None:
    slot = Slot(INDEXED)
    found: list[int] = []

    def work() -> None:
        found.extend(register(slot, 0x22, data) for data in (0x12, 0x34, None))

    assert steady(slot, work)
    assert found == [0x12, 0x34, 0x34] * 3
    assert list(slot.board.violations) == []


def test_a_look_while_data_is_held_leaves_the_rest_of_the_cycle_to_the_player() -> None:
    slots = [Slot(INDEXED), Slot(INDEXED)]
    for looks, slot in enumerate(slots):
        register(slot, 0x22, 0x12)
        slot.outb(ALE, 0x2A)
        if looks:
            slot.board.catch_up()
            assert slot.board.find_pin("slot.D0-D7").net.value == 0x2A
        slot.port.delay(US)
        assert slot.board.find_pin("slot.D0-D7").net.value == 0xFF
        slot.outb(PUT, 0x55)
        slot.port.delay(10 * US)
        slot.board.catch_up()
    first, second = (probe(slot.board.chip("x")).final_position for slot in slots)
    assert first == second == 0x5500
    assert [list(slot.board.violations) for slot in slots] == [[], []]


def test_a_stuck_wire_is_seen_and_then_cycles_are_made_at_the_chip_again() -> None:
    slot = Slot(INDEXED)
    assert register(slot, 0x22, 0x12) == 0x12
    assert steady(slot, partial(register, slot, 0x22))
    net = slot.board.find_pin("x./OE").net
    net.bend(lambda level: HIGH)
    net.resolve()
    known = path_of(slot).played
    assert register(slot, 0x22) == 0xFF
    played = path_of(slot).played
    assert played > known
    net.bends = ()
    net.resolve()
    assert register(slot, 0x22) == 0x12
    assert path_of(slot).played == played


def test_a_select_that_follows_its_strobe_ends_a_write_to_an_mc1241a_once() -> None:
    """The strobe comes straight from the bus, the select through a gate in the same instant."""
    text = (
        HEAD.format(hold=130, strobe=500, **MC)
        + """"D0-D7" = "main.D0-D7"
"/IOW" = "main.~HostWrite"
"/IOR" = "main.~HostRead"
A0 = "main.HostCmd"

[glue.pal]
part = "PLD"

[glue.pal.equations]
"x.~HostSlct" = "slot.A1 | (slot./IOR & slot./IOW)"
"y.~HostSlct" = "!slot.A1 | (slot./IOR & slot./IOW)"
"""
    )
    for watched in (False, True):
        slot = Slot(text)
        if watched:
            slot.board.chip("slot").pins["/IOW"].net.observe(Observer())

        def version(slot: Slot = slot) -> None:
            slot.outb(0x301, 0x6C)  # GET_VRSN
            slot.port.delay(100 * US)
            assert [slot.inb(0x300), slot.inb(0x300)] == [0x4A, 0x10]
            slot.port.delay(100 * US)

        assert steady(slot, version) != watched
        assert NOT_READY.name not in [v.rule for v in slot.board.violations]


def test_the_address_stands_after_a_cycle_that_has_moved_what_decides() -> None:
    """HostRdy falls as the strobe of the write rises, and a gate follows it."""
    text = (
        HEAD.format(hold=130, strobe=500, **MC)
        + """"D0-D7" = "main.D0-D7"
"/IOW" = "main.~HostWrite"
"/IOR" = "main.~HostRead"
A0 = "main.HostCmd"

[glue.pal]
part = "PLD"

[glue.pal.equations]
"x.~HostSlct" = "slot.A1 | (slot./IOR & slot./IOW)"
"y.~HostSlct" = "!slot.A1 | (slot./IOR & slot./IOW) | (slot.A3 & x.HostRdy)"
"""
    )
    for watched in (False, True):
        slot = Slot(text)
        if watched:
            slot.board.chip("slot").pins["/IOW"].net.observe(Observer())
        for offset in (1, 5, 9):
            slot.outb(0x300 + offset, 0x6C)
            assert slot.board.find_pin("x.HostRdy").net.value == 0
            stands = [slot.board.find_pin(f"slot.A{n}").net.value for n in range(4)]
            assert stands == [offset >> n & 1 for n in range(4)], (watched, offset)
            assert slot.board.find_pin("slot./IOW").net.value == 1
            slot.port.delay(100 * US)
            slot.board.run_for(US)
