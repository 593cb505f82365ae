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
    chip = Ports()
    assert chip.read(3) == 0x9B
    assert not any(chip.driven("A") + chip.driven("B") + chip.driven("C"))
    chip.set(PB3=0, PB4=0)
    assert chip.read(1) == 0xE7
    chip.write(3, 0x83)  # A and the upper half of C are outputs
    chip.write(0, 0xA5)
    chip.write(2, 0x5F)
    assert (chip.port("A"), chip.read(0)) == (0xA5, 0xA5)
    assert chip.driven("C") == [False] * 4 + [True] * 4
    assert chip.port("C") >> 4 == 0x5
    chip.set(PC0=0)
    assert (chip.read(2), chip.read(1), chip.read(3)) == (0x5E, 0xE7, 0x83)


def test_an_82c55_sets_single_bits_of_port_c_and_a_new_mode_clears_its_latches() -> None:
    chip = Ports()
    chip.write(3, 0x80)
    chip.write(0, 0xFF)
    for bit, level in ((0, 1), (7, 1), (3, 1), (3, 0)):
        chip.write(3, bit << 1 | level)
    assert chip.port("C") == 0x81
    chip.write(3, 0x80)
    assert (chip.port("A"), chip.port("C")) == (0, 0)
    chip.write(2, 0x33)
    chip.set(RESET=1)
    chip.set(RESET=0)
    assert (chip.read(3), any(chip.driven("C"))) == (0x9B, False)


def test_an_82c55_takes_nothing_without_its_select() -> None:
    chip = Ports()
    chip.set(A0=1, A1=1, **{d: 0x80 >> n & 1 for n, d in enumerate(DATA)})
    chip.pulse("/WR")
    chip.set(**dict.fromkeys(DATA, Z))
    assert chip.read(3) == 0x9B


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
    chip = Counter()
    chip.turn(300)
    assert chip.read() == 300
    chip.turn(-301)
    assert chip.read() == 0xFFFF
    chip.set(CHA=1 - chip.hands["CHA"].level, CHB=1 - chip.hands["CHB"].level)  # no such step
    assert chip.read() == 0xFFFF
    chip.set(nRST=0)
    chip.set(nRST=1)
    assert chip.read() == 0


def test_a_quadrature_counter_holds_both_bytes_from_the_high_one_on() -> None:
    chip = Counter()
    chip.turn(255)
    assert chip.byte(0) == 0x00
    chip.set(nOE=1)
    chip.turn(2)
    assert chip.byte(1) == 0xFF
    chip.set(nOE=1)
    assert chip.read() == 257


def test_a_quadrature_counter_lets_go_of_the_bus() -> None:
    chip = Counter()
    assert [chip.part.pins[name].level for name in DATA] == [Z] * 8


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
    chip = Expander(part, address)
    assert chip.write() == [True]
    for other in (address ^ 1, address ^ 0x18):
        assert Expander(part, other).write() == [False]
    assert chip.part.pins["SDA"].net.value == 1


def test_a_pcf8574_pulls_low_where_a_zero_is_written_and_reads_its_pins() -> None:
    chip = Expander("PCF8574")
    assert chip.port == 0xFF
    assert chip.write(0xF0, 0xA5) == [True, True, True]
    assert chip.port == 0xA5
    chip.set(P7=0)
    assert chip.read(2) == [0x25, 0x25]
    assert [chip.part.pins[f"P{bit}"].level for bit in (0, 1)] == [Z, 0]


def test_a_pcf8574_interrupts_until_its_pins_are_read_or_are_as_before() -> None:
    chip = Expander("PCF8574")
    chip.set(P2=0)
    assert chip.interrupts
    chip.set(P2=Z)
    assert not chip.interrupts
    chip.set(P2=0)
    assert chip.read() == [0xFB]
    assert not chip.interrupts
    chip.set(P2=1)
    assert chip.interrupts
    chip.write(0xFF)
    assert not chip.interrupts


def test_a_pca9554_has_four_registers_behind_its_command_byte() -> None:
    chip = Expander("PCA9554")
    assert [chip.read(command=number) for number in range(4)] == [[0xFF], [0xFF], [0x00], [0xFF]]
    chip.write(1, 0x5A)
    assert chip.port == 0xFF  # all are inputs
    chip.write(3, 0x0F)
    assert chip.port == 0x5F
    chip.set(P0=0)
    chip.write(2, 0x03)
    assert chip.read(2, command=0) == [0x5D, 0x5D]
    assert chip.read() == [0x5D]
    assert [chip.part.pins[f"P{bit}"].level for bit in (3, 4, 5)] == [Z, 1, 0]
    assert chip.read(command=1) == [0x5A]


def test_a_pca9554_interrupts_until_its_input_register_is_read() -> None:
    chip = Expander("PCA9554")
    chip.write(3, 0xF0)
    assert not chip.interrupts
    chip.set(P7=0)
    assert chip.interrupts
    chip.read(command=1)
    assert chip.interrupts
    chip.read(command=0)
    assert not chip.interrupts
    chip.write(1, 0x00)  # outputs do not interrupt
    assert not chip.interrupts
