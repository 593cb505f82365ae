"""Cards whose addresses are decoded by glue: the cycles chips see, latches, broadcast, floating."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.views.conftest import record
from tests.unit.views.test_replay import played
from vbus.board.board import Board
from vbus.board.build import build, card_of, load_board_text
from vbus.board.card.card_map import address_map, lines, remarks
from vbus.board.config import read_board_text
from vbus.board.host_bus import HostBus
from vbus.board.snapshot import fork, restore, take
from vbus.core.errors import ConfigError
from vbus.core.kernel import MS, NS, US
from vbus.core.signals import Observer
from vbus.glue.card_buses import BUSES
from vbus.protocols.port import CardAccess

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "firmware_host_examples" / "lm629_two_axes"
WIRED = (FOLDER / "wired_card.toml").read_text()
PLAIN = (
    WIRED.partition("[buses.main]")[0]
    + """
[cards.slot]
base = 0x300
decode = "direct"
chips = ["x", "y"]

[[hosts]]
transport = "unix:$VBUS_RUNTIME/plain.sock"
card = "slot"
"""
)
FIRST = """\
[cards.first]
base = 0x200
decode = "direct"
chips = ["x", "y"]

"""
STATUS, DATA, BOTH, LATCH = 0x300, 0x301, 0x304, 0x30C


class Slot:
    """A driver's view of the card: port I/O at addresses."""

    def __init__(self, text: str) -> None:
        file, source = read_board_text(text)
        self.board: Board = build(file, source)
        (host,) = file.hosts
        chips = host.chips or None
        self.port: HostBus = self.board.open_port("host", chips, card=card_of(file, host))

    def access(self, address: int, write: bool) -> CardAccess:
        found = self.port.card(address, write)
        assert found is not None
        self.port.select(1 << found.chip)
        return found

    def inb(self, address: int) -> int:
        return self.port.read(self.access(address, False).address)

    def outb(self, address: int, data: int) -> None:
        self.port.write(self.access(address, True).address, data)

    def ready(self, base: int) -> None:
        """Poll until the chip is not busy, as a driver does."""
        for _ in range(2000):
            if not self.inb(base) & 1:
                return
        raise AssertionError("busy for ever")

    def command(self, base: int, code: int, *data: int) -> None:
        self.ready(base)
        self.outb(base, code)
        for start in range(0, len(data), 2):
            self.ready(base)
            for byte in data[start : start + 2]:
                self.outb(base + 1, byte)

    def position(self, base: int) -> int:
        """RDRP: the real position."""
        self.command(base, 0x0A)
        value = 0
        for _ in range(2):
            self.ready(base)
            value = value << 16 | self.inb(base + 1) << 8 | self.inb(base + 1)
        return value - (1 << 32) if value >> 31 else value


def word(value: int) -> tuple[int, ...]:
    return tuple(value.to_bytes(4, "big", signed=True))


def move(slot: Slot, base: int, to: int) -> None:
    """Load a filter and a trajectory, and start."""
    slot.command(base, 0x1E, 0x00, 0x0C, 0x00, 0x40, 0x00, 0x00)  # LFIL: kp, ki
    slot.command(base, 0x04)  # UDF
    slot.command(base, 0x1F, 0x00, 0x2A, *word(0x8000), *word(0x100000), *word(to))  # LTRJ
    slot.command(base, 0x01)  # STT


def test_a_driver_moves_both_axes_through_the_decoder_after_their_reset() -> None:
    slot = Slot(WIRED)
    slot.port.delay(2 * MS)
    assert slot.board.find_pin("x./RST").net.value == 0  # zeros at power-on
    assert slot.inb(LATCH) == 0x00
    slot.outb(LATCH, 0x01)
    assert slot.inb(LATCH) == 0x01
    slot.port.delay(4 * MS)
    move(slot, 0x300, 50)
    move(slot, 0x302, -30)
    slot.port.delay(60 * MS)
    assert (slot.position(0x300), slot.position(0x302)) == (50, -30)
    slot.outb(LATCH, 0x00)
    slot.port.delay(MS)
    slot.outb(LATCH, 0x01)
    slot.port.delay(4 * MS)
    assert slot.position(0x300) == 0
    assert [v.rule for v in slot.board.violations] == []


def test_one_write_reaches_both_chips_at_the_broadcast_address() -> None:
    slot = Slot(WIRED)
    slot.outb(LATCH, 0x01)
    slot.port.delay(4 * MS)
    slot.ready(0x300)
    slot.ready(0x302)
    slot.outb(BOTH, 0x02)  # DFH
    assert [slot.inb(base) & 1 for base in (0x300, 0x302)] == [1, 1]


def test_nobody_answers_where_the_decoder_selects_nobody() -> None:
    slot = Slot(WIRED)
    assert [slot.inb(0x300 + n) for n in (8, 10, 14)] == [0xFF] * 3
    assert slot.port.card(0x310) is None


def test_lines_that_a_bus_moves_together_are_never_seen_half_moved() -> None:
    slot = Slot(
        WIRED + '[glue.odd]\npart = "74HC86"\n[glue.odd.pins]\n'
        '1A = "slot.A0"\n1B = "slot.A1"\n1Y = "x./IN"\n'
    )
    slot.inb(0x301)
    levels: list[int] = []

    class Edges(Observer):
        def edge(self, when: int, net: str, level: int) -> None:
            levels.append(level)

    slot.board.find_pin("x./IN").net.observe(Edges())
    slot.inb(0x302)
    slot.inb(0x301)
    assert levels == []
    slot.inb(0x300)
    assert levels == [0]


def test_interrupts_of_both_chips_pull_one_line() -> None:
    board = Slot(WIRED).board
    line = board.nets["IRQ5"]
    assert line.value == 1
    hands = [board.find_pin(f"{chip}.HI").net.solder("hand") for chip in "xy"]
    seen = []
    for chip in (0, 1):
        board.find_pin(f"{'xy'[chip]}.HI").level = -1
        hands[chip].drive(1)
        board.run_for(US)
        seen.append(line.value)
        hands[chip].drive(0)
        board.run_for(US)
        seen.append(line.value)
    assert seen == [0, 1, 0, 1]


@given(
    st.lists(
        st.tuples(
            st.integers(0, 3), st.booleans(), st.sampled_from([0x00, 0x02, 0x0A, 0x1E, 0x55])
        ),
        min_size=1, max_size=24,
    )
)  # fmt: skip
@settings(max_examples=6, deadline=None)
def test_cycles_through_glue_are_those_of_a_card_without_at_the_same_instants(
    accesses: list[tuple[int, bool, int]],
) -> None:
    through = Slot(WIRED.replace("base = 0x300", 'base = 0x300\nstrobe = "180 ns"'))
    plain = Slot(PLAIN)
    assert plain.board.chips[0].read_low_ps == 180 * NS
    through.outb(LATCH, 0x01)
    through.port.delay(4 * MS)
    plain.port.delay(through.board.now - 1 * US)
    for chip in "xy":
        plain.board.chip(chip).advance()
    told: list[list[object]] = []
    for slot in (through, plain):
        slot.port.delay(10 * MS - slot.board.now)
        slot.board.run_until(10 * MS)
        rows: list[object] = []
        for offset, write, data in accesses:
            if write:
                slot.outb(0x300 + offset, data)
                rows.append(slot.board.now)
            else:
                rows.append((slot.board.now, slot.inb(0x300 + offset)))
        rows += [slot.board.chip(chip).telemetry() for chip in "xy"]
        rows += [(v.when, v.rule, v.chip) for v in slot.board.violations]
        told.append(rows)
    assert told[0] == told[1]


def test_cycles_are_the_same_whoever_looks_on_and_after_a_snapshot() -> None:
    slots = [Slot(WIRED), Slot(WIRED)]
    slots[1].board.start_trace()
    slots[1].board.watch("x./CS", Observer())
    for slot in slots:
        slot.outb(LATCH, 0x01)
        slot.port.delay(4 * MS)
    kept = take(slots[0].board)
    twin = fork(slots[0].board)
    first = [[slot.inb(STATUS), slot.inb(0x302), slot.inb(LATCH)] for slot in slots]
    assert first[0] == first[1]
    assert twin.find_pin("u2.Q0").net.value == 1
    slots[0].outb(LATCH, 0x00)
    restore(slots[0].board, kept)
    assert [slots[0].inb(STATUS), slots[0].inb(0x302), slots[0].inb(LATCH)] == first[0]


def test_a_slow_decoder_is_late_at_the_chip_by_its_delay() -> None:
    text = WIRED.replace(
        '[glue.u1]\npart = "74HC138"', '[glue.u1]\npart = "74HC138"\ndelay = "90 ns"'
    )
    seen: list[tuple[int, str, int]] = []

    class Edges(Observer):
        def edge(self, when: int, net: str, level: int) -> None:
            seen.append((when, net, level))

    slot = Slot(text)
    slot.inb(0x308)
    slot.board.watch("x./CS", Edges())
    begin = slot.board.now
    slot.inb(STATUS)
    assert slot.board.now == begin + US
    slot.port.delay(US)
    slot.inb(0x308)
    # The address stands 100 ns before the strobe of 500 ns; both ends come 90 ns later.
    fell = begin + US - 600 * NS + 90 * NS
    assert [(when, level) for when, _, level in seen][:1] == [(fell, 0)]


@pytest.mark.parametrize("enable", ["!Y1 & slot.D0", "Y1 | slot.D0"])
@pytest.mark.parametrize("ready", [0, 4 * MS])
def test_data_that_decide_who_drives_them_are_a_finding_and_no_hang(
    enable: str, ready: int
) -> None:
    slot = Slot(WIRED.replace('"!y./CS" = "!Y1 | !Y2"', f'"!y./CS" = "{enable}"'))
    slot.board.run_for(ready)
    for address in (0x302, 0x303):
        slot.inb(address)
        slot.port.delay(US)
    found, *_ = [v for v in slot.board.violations if v.rule == "board.oscillation"]
    assert found.detail == (
        "net y./CS: it moves what moves it, without end; give the glue a delay, or take the data"
        " bus out of what selects"
    )
    assert slot.inb(STATUS) == (0x84 if ready else 0)  # the other chip is none the worse


def mapped(text: str) -> tuple[list[str], list[str]]:
    file, source = read_board_text(text)
    board = build(file, source)
    found = address_map(file, board)
    return list(lines(found)), list(remarks(file, board, found))


def test_the_map_tells_who_answers_at_each_address() -> None:
    told, wrong = mapped(WIRED)
    assert told == [
        "slot 300H: read x.0, write x.0",
        "slot 301H: read x.1, write x.1",
        "slot 302H: read y.0, write y.0",
        "slot 303H: read y.1, write y.1",
        "slot 304H: read x.0+y.0, write x.0+y.0",
        "slot 305H: read x.1+y.1, write x.1+y.1",
        "slot 306H-30BH: no chip; at 306H x./CS is high by match (Y0 1, Y2 1); y./CS is high by"
        " match (Y1 1, Y2 1)",
        "slot 30CH: read u3, write u2",
        "slot 30DH: read u3, write u2",
        "slot 30EH-30FH: no chip; at 30EH x./CS is high by match (Y0 1, Y2 1); y./CS is high by"
        " match (Y1 1, Y2 1)",
    ]
    assert wrong == [
        f"[cards.slot]: x.{n} and y.{n} both answer a read at {0x304 + n:X}H and fight; select one"
        " of them only"
        for n in (0, 1)
    ]


def test_the_map_names_a_chip_that_is_never_selected() -> None:
    _, wrong = mapped(WIRED.replace('"!y./CS" = "!Y1 | !Y2"', '"!y./CS" = "!Y1 & !Y2"'))
    assert wrong == [
        '[cards.slot]: chip "y" is never selected at 300H to 30FH; look at what drives its select'
    ]


def test_a_card_without_a_bus_leaves_the_next_one_its_remarks() -> None:
    wired = WIRED.replace('"!y./CS" = "!Y1 | !Y2"', '"!y./CS" = "!Y1 & !Y2"')
    _, wrong = mapped(wired.replace("[cards.slot]", f"{FIRST}[cards.slot]"))
    assert [one for one in wrong if 'chip "y" is never selected' in one]


def test_the_map_of_a_card_without_a_bus_is_its_table() -> None:
    assert mapped(PLAIN) == (
        [f"slot {0x300 + n:X}H: read {'xy'[n // 2]}.{n % 2}, write {'xy'[n // 2]}.{n % 2}"
         for n in range(4)],
        [],
    )  # fmt: skip


def test_a_journal_of_cycles_through_glue_is_replayed_to_the_bit() -> None:
    def work(port: HostBus) -> None:
        port.select(4)
        port.write(0x0C, 0x01)
        port.delay(4 * MS)
        for offset in (0, 2, 0x0C, 8):
            port.read(offset)

    outcome = played(record(WIRED, work))
    assert outcome.divergence is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('bus = "ISA"', 'bus = "VME"', 'found "VME"; allowed are "ISA"'),
        ('bus = "ISA"', 'bus = "ISA"\nblock = 2', '"block" needs "decode" (a decode circuit'),
        ('bus = "ISA"', 'bus = "SRAM"', 'a bus "SRAM" has memory alone; write memory = true'),
        ("base = 0x300", "base = 0xFFF8", "the card ends at 10007H; I/O ports end at FFFFH"),
        ("base = 0x300", "base = 0xFFFF8\nmemory = true", "addresses of this bus end at FFFFFH"),
        ('A0 = "main./PS"', 'A20 = "main./PS"', 'there is no pin "A20"; did you mean "A2"?'),
        ('A0 = "main./PS"', 'A0 = "main./XS"', 'there is no pin "main./XS"; did you mean "main.'),
    ],
)  # fmt: skip
def test_a_mistake_in_a_card_with_a_bus_is_named(old: str, new: str, message: str) -> None:
    with pytest.raises(ConfigError) as told:
        load_board_text(WIRED.replace(old, new))
    assert message in str(told.value)
    assert "cards.slot" in str(told.value)


def test_the_map_names_lines_of_a_chip_that_nothing_moves() -> None:
    _, wrong = mapped(WIRED.replace('A0 = "main./PS"\n', "").replace('"/IOR" = "main./RD"\n', ""))
    for chip in "xy":
        text = f'[cards.slot]: /PS, /RD of chip "{chip}" are wired to nothing; no cycle moves them'
        assert text in wrong


@pytest.mark.parametrize("watched", [False, True])
def test_the_bus_stands_when_its_host_has_gone_right_after_a_cycle(watched: bool) -> None:
    slot = Slot(WIRED)
    slot.outb(LATCH, 0x01)
    slot.port.delay(4 * MS)
    if watched:
        slot.board.watch("x./PS", Observer())
    slot.command(0x302, 0x1D, 0x00, 0x00)
    slot.port.pin(slot.port.pin_number("slot.AEN"), 1)
    slot.port.close()
    slot.board.run_for(US)
    assert list(slot.board.violations) == []
    pins = [slot.board.find_pin(f"slot.{name}").net.value for name in ("A0", "A1", "A9", "AEN")]
    assert pins == [1, 1, 1, 0]


def test_the_strobes_of_a_bus_are_those_of_its_ports_or_of_its_memory() -> None:
    isa = BUSES["ISA"]
    assert isa.strobes_of(memory=False) == ("/IOR", "/IOW")
    assert isa.strobes_of(memory=True) == ("/MEMR", "/MEMW")
    avr = BUSES["XMEM"]
    assert not avr.ports
    assert avr.strobes_of(memory=False) == avr.strobes_of(memory=True) == avr.memory
