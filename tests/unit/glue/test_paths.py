"""Cycles on a card are played once and remembered while what decides about them stands."""

from collections.abc import Callable
from functools import partial

import pytest

from tests.unit.glue.test_cards import LATCH, WIRED, Slot
from vbus.board.card.card_bus import CardBus
from vbus.board.card.card_path import CardPath
from vbus.board.snapshot import restore, take
from vbus.core.kernel import MS, NS, US
from vbus.core.signals import HIGH, Observer

TWO_CHIPS = """\
[chips.x]
part = "{part}"
clock = "{clock}"
plant = "none"

[chips.y]
part = "{part}"
clock = "{clock}"
plant = "none"

[board]
power_on = "done"

[buses.main]
chips = ["x", "y"]
"""
TWO = TWO_CHIPS.format(part="LM629N-8", clock="8 MHz")
CARD = (
    TWO
    + """
[cards.slot]
bus = "ISA"
base = 0x300
hold = "130 ns"

[[hosts]]
transport = "unix:$VBUS_RUNTIME/path.sock"
card = "slot"

[cards.slot.pins]
"""
)
WIRES = """"D0-D7" = "main.D0-D7"
"/IOR" = "main./RD"
"/IOW" = "main./WR"
A0 = "main./PS"
"""
BRIDGED = """A0 = "main./PS"

[glue.buffer]
part = "74HC245"

[glue.buffer.pins]
DIR = "slot./IOR"
"/OE" = "OFF"
"A0-A7" = "slot.D0-D7"
"B0-B7" = "main.D0-D7"

[glue.strobes]
part = "PLD"
hosts = ["HALT"]

[glue.strobes.equations]
"main./RD" = "slot./IOR | !HALT"
"main./WR" = "slot./IOW | slot.A3"
"OFF" = "(x./CS & y./CS)"
"""
GATED = BRIDGED.replace("y./CS)", "y./CS) | (slot./IOR & slot./IOW)")
PLD = """
[glue.pal]
part = "PLD"
delay = "{delay} ns"
hosts = ["HALT2"]

[glue.pal.equations]
"x./CS" = "({x}) & HALT2"
"y./CS" = "({y}) & (N1 | HALT2)"
"N1" = "slot.A1 {op} slot.A2"
"""
LATCHED = """
[glue.latch]
part = "74HC74"
high = ["1/PRE", "1/CLR"]

[glue.latch.pins]
1CLK = "GATE"
1D = "slot.D1"
1Q = "PAGE"

[glue.gate]
part = "PLD"

[glue.gate.equations]
"GATE" = "!(slot.A2 & slot.A3) | slot./IOW"
"""


def path_of(slot: Slot) -> CardPath:
    bus = slot.board.chip("slot")
    assert isinstance(bus, CardBus)
    assert isinstance(bus.path, CardPath)
    return bus.path


def steady(slot: Slot, *cycles: Callable[[], object]) -> bool:
    """Make some cycles until they could be known; tell whether they are played even then."""
    for _ in range(2):
        for cycle in cycles:
            cycle()
    played = path_of(slot).played
    for cycle in cycles:
        cycle()
    return path_of(slot).played == played


def test_a_cycle_is_played_once_and_then_remembered() -> None:
    slot = Slot(WIRED)
    slot.outb(LATCH, 0x01)
    slot.port.delay(4 * MS)
    cycles = [partial(slot.inb, 0x300 + offset) for offset in (0, 2, 3, 8, 0x0C)]
    cycles += [partial(slot.outb, 0x300, 0x02)]
    assert steady(slot, *cycles)
    assert not steady(slot, partial(slot.inb, 0x304)), "two chips answer"
    assert not steady(slot, *(partial(slot.outb, LATCH, byte) for byte in (0, 1))), "a reset moves"


def test_the_state_is_the_same_whether_a_cycle_was_remembered_or_not() -> None:
    knows, learns = Slot(WIRED), Slot(WIRED)
    knows.outb(LATCH, 0x01)
    knows.port.delay(4 * MS)
    cycles = [partial(knows.inb, 0x300), partial(knows.outb, 0x301, 0x12)]
    assert steady(knows, *cycles)
    restore(learns.board, take(knows.board))
    for slot in (knows, learns):
        slot.inb(0x300)
        slot.outb(0x302, 0x12)
        assert knows.board.now >= learns.board.now
    assert knows.board.state_hash() == learns.board.state_hash()
    for slot in (knows, learns):
        slot.port.delay(US)
    assert knows.board.state_hash() == learns.board.state_hash()


def test_a_look_between_cycles_leaves_no_trace_in_the_state() -> None:
    slots = [Slot(WIRED), Slot(WIRED)]
    for looks, slot in enumerate(slots):
        slot.outb(LATCH, 0x01)
        slot.port.delay(4 * MS)
        for offset in (0, 3, 1, 8, 2):
            slot.inb(0x300 + offset)
            if looks:
                slot.board.catch_up()
                assert slot.board.find_pin("slot.A1").net.value == offset >> 1 & 1
        slot.outb(0x302, 0x02)
    assert slots[0].board.state_hash() == slots[1].board.state_hash()


def test_somebody_who_begins_to_watch_a_wire_sees_the_strobes_of_the_next_cycle() -> None:
    slot = Slot(WIRED)
    slot.inb(0x308)
    edges: list[tuple[int, int]] = []

    class Edges(Observer):
        def edge(self, when: int, net: str, level: int) -> None:
            edges.append((when, level))

    slot.board.watch("x./CS", Edges())
    begun = slot.board.now
    slot.inb(0x300)
    assert edges == [(begun + US - 600 * NS, 0)]


def test_ac_limits_are_judged_behind_the_glue() -> None:
    slot = Slot(WIRED.replace("130 ns", "40 ns"))
    slot.outb(LATCH, 0x01)
    slot.port.delay(4 * MS)
    slot.outb(0x300, 0x02)
    slot.port.delay(US)
    (found,) = slot.board.violations
    assert (found.rule, found.chip, found.measured) == ("lm628.T16", "x", 40 * NS)


def test_a_strobe_too_short_for_the_chip_is_found() -> None:
    slot = Slot(WIRED.replace("base = 0x300", 'base = 0x300\nstrobe = "90 ns"'))
    slot.outb(LATCH, 0x01)
    slot.port.delay(4 * MS)
    slot.outb(0x300, 0x02)
    slot.inb(0x300)
    assert [v.rule for v in slot.board.violations] == ["lm628.T14", "lm628.T10"]


def test_a_switch_that_moves_changes_who_is_selected() -> None:
    text = CARD + WIRES + PLD.format(delay=0, x="!slot.A1", y="1", op="&")
    text = text.replace('"x./CS" = "(!slot.A1) & HALT2"', '"x./CS" = "slot.A1 ^ HALT2"')
    slot = Slot(text.replace("(N1 | HALT2)", "(N1 | !N1)"))
    answers = []

    def turn(level: int) -> None:
        slot.port.pin(slot.port.pin_number("pal.HALT2"), level)
        answers.append([slot.inb(0x300), slot.inb(0x302)])

    assert steady(slot, partial(turn, HIGH), partial(turn, 0))
    assert answers == [[0xFF, 0x84], [0x84, 0xFF]] * 3


def test_two_sessions_move_the_lines_of_one_connector() -> None:
    slot = Slot(WIRED)
    other = slot.board.open_port("other")
    slot.outb(LATCH, 0x01)
    slot.port.delay(4 * MS)
    other.select(4)
    assert [slot.inb(0x302), other.read(0), slot.inb(LATCH)] == [0x84, 0x84, 0x01]
    other.write(0x0C, 0)
    assert slot.inb(LATCH) == 0
    other.close()
    slot.outb(LATCH, 0x01)
    assert slot.inb(LATCH) == 1
    assert [v.rule for v in slot.board.violations] == []


@pytest.mark.parametrize("watched", [False, True])
def test_a_stuck_net_is_seen_by_cycles(watched: bool) -> None:
    slot = Slot(WIRED)
    slot.outb(LATCH, 0x01)
    slot.port.delay(4 * MS)
    if watched:
        slot.board.watch("x./CS", Observer())
    assert slot.inb(0x300) & 1 == 0
    net = slot.board.find_pin("x./CS").net
    net.bend(lambda level: HIGH)
    net.resolve()
    assert slot.inb(0x300) == 0xFF
    net.bends = ()
    net.resolve()
    assert slot.inb(0x300) & 1 == 0


SLOW = """
[glue.slow]
part = "PLD"
delay = "15 ns"

[glue.slow.equations]
"main./RD" = "slot./IOR"
"""

DELAYED = WIRED.replace('"/IOR" = "main./RD"\n', "") + SLOW
SLOWLY_LATCHED = LATCHED.replace('"PLD"', '"PLD"\ndelay = "15 ns"').replace(" | slot./IOW", "")


def made(wires: str, more: str = "") -> str:
    first = "slot.A1 ^ PAGE" if "PAGE" in more else "slot.A1"
    return CARD + wires + PLD.format(delay=0, x=first, y="!slot.A1", op="&") + more


@pytest.mark.parametrize(
    ("text", "write", "remembered"),
    [
        (DELAYED, False, False),  # the chip's cycle ends after the card's
        (DELAYED, True, True),
        (made(BRIDGED), True, True),
        (made(BRIDGED.replace("245\"\n", "245\"\ndelay = \"15 ns\"\n")), True, False),
        (made(WIRES, LATCHED), False, True),
        (made(WIRES, SLOWLY_LATCHED), False, True),
    ],
)  # fmt: skip
def test_which_cycles_are_remembered(text: str, write: bool, remembered: bool) -> None:
    slot = Slot(text)
    slot.board.run_for(4 * MS)
    cycle = partial(slot.outb, 0x300, 0) if write else partial(slot.inb, 0x300)
    assert steady(slot, cycle) == remembered


def test_what_is_due_elsewhere_does_not_have_a_cycle_played_that_only_hosts_can_change() -> None:
    slot = Slot(made(WIRES))
    slot.board.run_for(4 * MS)
    assert steady(slot, partial(slot.inb, 0x300))
    slot.board.kernel.timer(lambda: None).at(slot.board.now + 700 * NS)
    before = path_of(slot).played
    slot.inb(0x300)
    assert path_of(slot).played == before


def test_a_bus_that_was_driven_until_the_strobe_fell_is_read_as_it_was() -> None:
    """The transceiver turns round, nobody answers: the wires keep what it drove at first."""
    answers = []
    for watched in (False, True):
        slot = Slot(made(BRIDGED))
        slot.port.pin(slot.port.pin_number("strobes.HALT"), 0)
        slot.board.run_for(4 * MS)
        if watched:
            slot.board.watch("x./CS", Observer())
        answers.append([slot.inb(0x300) for _ in range(3)])
    assert answers[0] == answers[1] == [0xFF] * 3


@pytest.mark.parametrize(("cycle", "played"), [(2 * US, 0), (650 * NS, 2), (300 * NS, 3)])
def test_cycles_closer_than_the_bus_can_make_them_are_played(cycle: int, played: int) -> None:
    """The lead of a cycle is 600 ns, and chips rest after it."""
    slot = Slot(made(WIRES))
    slot.board.run_for(4 * MS)
    assert steady(slot, partial(slot.inb, 0x300))
    slot.port.delay(US)
    before, begun = path_of(slot).played, slot.board.now
    port = slot.board.open_port("fast", ["slot"], cycle)
    assert [port.read(0) for _ in range(3)] == [0x84, 0x84, 0x84]
    assert slot.board.now - begun == 3 * cycle
    assert path_of(slot).played - before == played


def test_the_address_stands_after_a_reset_that_has_moved_a_wire_of_the_decoder() -> None:
    """RESET lets HI fall within its own cycle, and the other chip's select follows HI."""
    text = CARD + WIRES + PLD.format(delay=0, x="slot.AEN", y="x.HI", op="|")
    for watched in (False, True):
        slot = Slot(text)
        if watched:
            slot.board.watch("slot./IOR", Observer())

        def reset(slot: Slot = slot) -> None:
            slot.outb(0x307, 0x02)
            assert slot.board.find_pin("x.HI").net.value == 1
            slot.outb(0x300, 0x00)
            assert slot.board.find_pin("x.HI").net.value == 0
            assert [slot.board.find_pin(f"slot.A{n}").net.value for n in range(3)] == [0, 0, 0]
            assert slot.board.find_pin("y./CS").net.value == 0
            slot.port.delay(4 * MS)

        assert not steady(slot, reset), "what decides moves in the cycle"


def test_a_cycle_is_played_while_a_host_drives_the_data_bus_itself() -> None:
    slot = Slot(made(WIRES))
    slot.board.run_for(4 * MS)
    read = partial(slot.inb, 0x300)
    assert steady(slot, read)
    slot.port.drive(0x12)
    assert not steady(slot, read)
    slot.port.release()
    assert steady(slot, read)
