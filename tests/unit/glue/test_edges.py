"""Cycles at chips that want every edge: what is worked out beforehand is what strobes make."""

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.probe import probe
from tests.unit.glue.test_cards import Slot
from tests.unit.glue.test_paths import path_of, run, terms
from vbus.chips.mc1241a.datasheet import NOT_READY
from vbus.kernel import NS, US
from vbus.signals import HIGH, Observer

HEAD = """
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
MCP = {"part": "MCP-1200", "clock": "2 MHz", "data": "DB0-DB7"}
MC = {"part": "MC1241A", "clock": "25 MHz", "data": "D0-D7"}

DIRECT = """"D0-D7" = "main.{data}"
"""
BRIDGED = """
[glue.buffer]
part = "74HC245"

[glue.buffer.pins]
DIR = "slot./IOR"
"/OE" = "OFF"
"A0-A7" = "slot.D0-D7"
"B0-B7" = "main.{data}"

[glue.enable]
part = "PLD"

[glue.enable.equations]
"OFF" = "OFF_AT"
"""
LINES = {
    "MCP-1200": ("x./CS", "y./CS", "main./ALE", "main./OE", "main.R/W"),
    "MC1241A": ("x.~HostSlct", "y.~HostSlct", "main.~HostRead", "main.~HostWrite", "main.HostCmd"),
}
SIDE = {"MCP-1200": ["x.PROF"], "MC1241A": ["x.HostRdy"]}
LATCHED = """
[glue.latch]
part = "74HC74"
high = ["1/PRE", "1/CLR"]

[glue.latch.pins]
1CLK = "GATE"
1D = "slot.D1"
1Q = "PAGE"
"""


@st.composite
def boards(draw: st.DrawFn) -> str:
    kind = draw(st.sampled_from([MCP, MC]))
    part = kind["part"]
    latched = draw(st.booleans())
    names = ["slot.A0", "slot.A1", "slot.A2", "slot.A3", "slot.AEN", "HALT2"]
    names += ["PAGE"] if latched else []
    names += draw(st.sampled_from([[], SIDE[part], ["slot./IOR"], ["slot./IOW"], ["slot.D0"]]))
    gates = ["", " | slot./IOR", " | slot./IOW", " | (slot./IOR & slot./IOW)"]
    rows = []
    for line in LINES[part]:
        used = ("" if rows else " & HALT2") + (" ^ PAGE" if latched and not rows else "")
        gate = draw(st.sampled_from(gates))
        if draw(st.booleans()):
            usual = {"/ALE": 2, "/CS": 3, "/OE": 1, "~HostSlct": 3, "~HostRead": 1,
                     "~HostWrite": 2}.get(line.partition(".")[2], 0)  # fmt: skip
            gate = gates[usual]
        rows.append(f'"{line}" = "({draw(terms(names))}{used}){gate}"')
    wires = draw(st.sampled_from([
        DIRECT, BRIDGED.replace("OFF_AT", "slot./IOR & slot./IOW"),
        BRIDGED.replace("OFF_AT", "slot.A3"),
    ]))  # fmt: skip
    wires = wires.replace("{data}", kind["data"])
    head = HEAD.format(
        hold=draw(st.sampled_from([10, 30, 130])), strobe=draw(st.sampled_from([40, 500])), **kind
    )
    delay = draw(st.sampled_from(["", "", "", 'delay = "15 ns"\n']))
    pal = f'\n[glue.pal]\npart = "PLD"\n{delay}hosts = ["HALT2"]\n\n[glue.pal.equations]\n'
    if latched:
        rows.append('"GATE" = "!(slot.A2 & slot.A3) | slot./IOW"')
    return "".join((head, wires, pal, "\n".join(rows), "\n", LATCHED if latched else ""))


STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("in"), st.integers(0, 15)),
        st.tuples(st.just("in"), st.integers(0, 3)),
        st.tuples(st.just("out"), st.integers(0, 15), st.sampled_from([0, 2, 3, 0x2F, 0x1E, 0x37])),
        st.tuples(st.just("pin"), st.sampled_from(["pal.HALT2", "slot.AEN"]), st.integers(0, 2)),
        st.tuples(st.just("delay"), st.sampled_from([20 * NS, US, 30 * US])),
        st.tuples(st.just("look")),
    ),
    min_size=1, max_size=25,
)  # fmt: skip


@given(boards(), STEPS)
@settings(max_examples=40, deadline=None)
def test_cycles_worked_out_beforehand_are_those_of_the_strobes(
    text: str, steps: list[tuple[object, ...]]
) -> None:
    beforehand, played = Slot(text), Slot(text)
    played.board.chip("slot").pins["/IOR"].net.observe(Observer())
    assert run(beforehand, steps) == run(played, steps)
    assert path_of(played).played == sum(name in ("in", "out") for name, *_ in steps)


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


def test_on_a_card_of_gates_no_cycle_at_an_mcp_1200_is_played() -> None:
    slot = Slot(INDEXED)
    assert [register(slot, 0x22, data) for data in (0x12, 0x34, None)] == [0x12, 0x34, 0x34]
    assert path_of(slot).played == 0
    slot.port.delay(US)
    assert path_of(slot).why(1, write=True) == ""
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
    net = slot.board.find_pin("x./OE").net
    net.bend(lambda level: HIGH)
    net.resolve()
    assert register(slot, 0x22) == 0xFF
    played = path_of(slot).played
    assert played > 0
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
        slot.outb(0x301, 0x6C)  # GET_VRSN
        slot.port.delay(100 * US)
        found = [slot.inb(0x300), slot.inb(0x300)]
        assert found == [0x4A, 0x10]
        assert NOT_READY.name not in [v.rule for v in slot.board.violations]
        assert path_of(slot).played == (3 if watched else 0)


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
