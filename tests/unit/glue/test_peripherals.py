"""Peripheral parts of glue, played pin by pin as their data sheets say."""

import pytest

from tests.unit.glue.test_cards import FOLDER, Slot
from tests.unit.glue.test_parts import Bench
from vbus.board.snapshot import restore, take
from vbus.core.signals import Z
from vbus.glue.part import bundled

DATA = bundled("D0-D7")


class Ports(Bench):
    """An 82C55 on a bus."""

    def __init__(self) -> None:
        super().__init__("82C55", nCS=1, nRD=1, nWR=1, **{"/CS": 1, "/RD": 1, "/WR": 1})

    def write(self, address: int, data: int) -> None:
        self.set(A0=address & 1, A1=address >> 1, **{d: data >> n & 1 for n, d in enumerate(DATA)})
        self.set(nCS=0)
        self.set(nWR=0)
        self.set(nWR=1)
        self.set(nCS=1, **dict.fromkeys(DATA, Z))

    def read(self, address: int) -> int:
        self.set(A0=address & 1, A1=address >> 1, nCS=0)
        self.set(nRD=0)
        data = self.word(*DATA)
        self.set(nRD=1, nCS=1)
        return data

    def port(self, letter: str) -> int:
        return self.word(*(f"P{letter}{bit}" for bit in range(8)))

    def driven(self, letter: str) -> list[bool]:
        return [self.part.pins[f"P{letter}{bit}"].level != Z for bit in range(8)]


def test_an_82c55_begins_with_inputs_and_its_control_word_turns_ports_round() -> None:
    bench = Ports()
    assert bench.read(3) == 0x9B
    assert not any(bench.driven("A") + bench.driven("B") + bench.driven("C"))
    bench.set(PB3=0, PB4=0)
    assert bench.read(1) == 0xE7
    bench.write(3, 0x83)  # A and the upper half of C are outputs
    bench.write(0, 0xA5)
    bench.write(2, 0x5F)
    assert (bench.port("A"), bench.read(0)) == (0xA5, 0xA5)
    assert bench.driven("C") == [False] * 4 + [True] * 4
    assert bench.port("C") >> 4 == 0x5
    bench.set(PC0=0)
    assert (bench.read(2), bench.read(1), bench.read(3)) == (0x5E, 0xE7, 0x83)


def test_an_82c55_sets_single_bits_of_port_c_and_a_new_mode_clears_its_latches() -> None:
    bench = Ports()
    bench.write(3, 0x80)
    bench.write(0, 0xFF)
    for bit, level in ((0, 1), (7, 1), (3, 1), (3, 0)):
        bench.write(3, bit << 1 | level)
    assert bench.port("C") == 0x81
    bench.write(3, 0x80)
    assert (bench.port("A"), bench.port("C")) == (0, 0)
    bench.write(2, 0x33)
    bench.set(RESET=1)
    bench.set(RESET=0)
    assert (bench.read(3), any(bench.driven("C"))) == (0x9B, False)


def test_an_82c55_takes_nothing_without_its_select() -> None:
    bench = Ports()
    bench.set(A0=1, A1=1, **{d: 0x80 >> n & 1 for n, d in enumerate(DATA)})
    bench.pulse("/WR")
    bench.set(**dict.fromkeys(DATA, Z))
    assert bench.read(3) == 0x9B


class Counter(Bench):
    """An HCTL-2016 and its encoder."""

    def __init__(self) -> None:
        super().__init__("HCTL-2016", **{"/OE": 1, "/RST": 1, "SEL": 1})
        self.phase = 0

    def turn(self, counts: int) -> None:
        for _ in range(abs(counts)):
            self.phase += 1 if counts > 0 else -1
            a, b = ((0, 0), (1, 0), (1, 1), (0, 1))[self.phase % 4]
            self.set(CHA=a, CHB=b)

    def byte(self, select: int) -> int:
        self.set(SEL=select, nOE=0)
        return self.word()

    def read(self) -> int:
        value = self.byte(0) << 8 | self.byte(1)
        self.set(nOE=1)
        return value


def test_a_quadrature_counter_counts_every_edge_both_ways() -> None:
    bench = Counter()
    bench.turn(300)
    assert bench.read() == 300
    bench.turn(-301)
    assert bench.read() == 0xFFFF
    bench.set(CHA=1 - bench.hands["CHA"].level, CHB=1 - bench.hands["CHB"].level)  # no such step
    assert bench.read() == 0xFFFF
    bench.set(nRST=0)
    bench.set(nRST=1)
    assert bench.read() == 0


def test_a_quadrature_counter_holds_both_bytes_from_the_high_one_on() -> None:
    bench = Counter()
    bench.turn(255)
    assert bench.byte(0) == 0x00
    bench.set(nOE=1)
    bench.turn(2)
    assert bench.byte(1) == 0xFF
    bench.set(nOE=1)
    assert bench.read() == 257


def test_a_quadrature_counter_lets_go_of_the_bus() -> None:
    bench = Counter()
    assert [bench.part.pins[name].level for name in DATA] == [Z] * 8


def test_a_card_with_a_port_chip_and_a_counter_has_both_at_its_addresses() -> None:
    slot = Slot((FOLDER / "ppi_card.toml").read_text())
    slot.outb(0x363, 0x82)
    assert slot.inb(0x363) == 0x82
    found = []
    for counts in (0, 5):
        for a, b in ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0), (1, 0))[: counts + 1]:
            for name, level in (("wheel.CHA", a), ("wheel.CHB", b)):
                slot.port.pin(slot.port.pin_number(name), level)
        found.append(slot.inb(0x364) << 8 | slot.inb(0x365))
    assert found[1] - found[0] == 5
    slot.outb(0x363, 0x0D)  # PC6: no reset any more
    assert slot.board.find_pin("x./RST").net.value == 1
    saved = take(slot.board)
    slot.outb(0x363, 0x0C)
    restore(slot.board, saved)
    assert slot.board.find_pin("x./RST").net.value == 1
    assert slot.inb(0x362) == 0x40


class Expander(Bench):
    """An expander and a master that moves SCL and SDA."""

    def __init__(self, part: str, address: int = 0x21) -> None:
        super().__init__(part, SCL=1, A0=1)
        self.address = address

    def bit(self, level: int) -> int:
        self.set(SDA=Z if level else 0)
        self.set(SCL=1)
        seen = self.part.pins["SDA"].net.value
        self.set(SCL=0)
        return seen

    def start(self) -> None:
        self.set(SDA=Z)
        self.set(SCL=1)
        self.set(SDA=0)
        self.set(SCL=0)

    def stop(self) -> None:
        self.set(SDA=0)
        self.set(SCL=1)
        self.set(SDA=Z)

    def byte(self, data: int) -> bool:
        """Send a byte; return whether it was acknowledged."""
        for place in range(7, -1, -1):
            self.bit(data >> place & 1)
        return not self.bit(1)

    def write(self, *data: int) -> list[bool]:
        self.start()
        acknowledged = [self.byte(one) for one in (self.address << 1, *data)]
        self.stop()
        return acknowledged

    def read(self, count: int = 1, *, command: int | None = None) -> list[int]:
        self.start()
        if command is not None:
            assert self.byte(self.address << 1)
            assert self.byte(command)
            self.start()
        assert self.byte(self.address << 1 | 1)
        found = []
        for left in range(count, 0, -1):
            found.append(sum(self.bit(1) << place for place in range(7, -1, -1)))
            self.bit(left == 1)
        self.stop()
        return found

    @property
    def port(self) -> int:
        return self.word(*(f"P{bit}" for bit in range(8)))

    @property
    def interrupts(self) -> bool:
        return not self.word("/INT")


@pytest.mark.parametrize(
    ("part", "address"),
    [("PCF8574", 0x21), ("PCF8574A", 0x39), ("PCA9554", 0x21), ("PCA9554A", 0x39)],
)
def test_an_expander_acknowledges_its_own_address_alone(part: str, address: int) -> None:
    bench = Expander(part, address)
    assert bench.write() == [True]
    for other in (address ^ 1, address ^ 0x18):
        assert Expander(part, other).write() == [False]
    assert bench.part.pins["SDA"].net.value == 1


def test_a_pcf8574_pulls_low_where_a_zero_is_written_and_reads_its_pins() -> None:
    bench = Expander("PCF8574")
    assert bench.port == 0xFF
    assert bench.write(0xF0, 0xA5) == [True, True, True]
    assert bench.port == 0xA5
    bench.set(P7=0)
    assert bench.read(2) == [0x25, 0x25]
    assert [bench.part.pins[f"P{bit}"].level for bit in (0, 1)] == [Z, 0]


def test_a_pcf8574_interrupts_until_its_pins_are_read_or_are_as_before() -> None:
    bench = Expander("PCF8574")
    bench.set(P2=0)
    assert bench.interrupts
    bench.set(P2=Z)
    assert not bench.interrupts
    bench.set(P2=0)
    assert bench.read() == [0xFB]
    assert not bench.interrupts
    bench.set(P2=1)
    assert bench.interrupts
    bench.write(0xFF)
    assert not bench.interrupts


def test_a_pca9554_has_four_registers_behind_its_command_byte() -> None:
    bench = Expander("PCA9554")
    assert [bench.read(command=number) for number in range(4)] == [[0xFF], [0xFF], [0x00], [0xFF]]
    bench.write(1, 0x5A)
    assert bench.port == 0xFF  # all are inputs
    bench.write(3, 0x0F)
    assert bench.port == 0x5F
    bench.set(P0=0)
    bench.write(2, 0x03)
    assert bench.read(2, command=0) == [0x5D, 0x5D]
    assert bench.read() == [0x5D]
    assert [bench.part.pins[f"P{bit}"].level for bit in (3, 4, 5)] == [Z, 1, 0]
    assert bench.read(command=1) == [0x5A]


def test_a_pca9554_interrupts_until_its_input_register_is_read() -> None:
    bench = Expander("PCA9554")
    bench.write(3, 0xF0)
    assert not bench.interrupts
    bench.set(P7=0)
    assert bench.interrupts
    bench.read(command=1)
    assert bench.interrupts
    bench.read(command=0)
    assert not bench.interrupts
    bench.write(1, 0x00)  # outputs do not interrupt
    assert not bench.interrupts


def test_a_write_to_an_82c55_ends_with_its_select_if_that_rises_first() -> None:
    bench = Ports()
    bench.write(3, 0x80)
    bench.set(A0=0, A1=0, nCS=0, **{d: 0x5A >> n & 1 for n, d in enumerate(DATA)})
    bench.set(nWR=0)
    bench.set(nCS=1)
    assert bench.port("A") == 0x5A
    bench.set(**dict.fromkeys(DATA, 0))
    bench.set(nWR=1)
    assert bench.port("A") == 0x5A
