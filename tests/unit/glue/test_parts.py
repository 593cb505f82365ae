"""Parts of glue: what each does, pin by pin, as its data book has it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.chips.tables import PinRow
from vbus.core.kernel import NS, Kernel
from vbus.core.signals import Net, Pin, Z
from vbus.glue.logic import enabled
from vbus.glue.part import Glue, GluePart, bundled
from vbus.glue.table import PARTS, ROWS


class Bench:
    """One part by itself: inputs are driven by name, outputs are read as one word."""

    def __init__(self, part: str, delay: int = 0, **levels: int) -> None:
        row = PARTS[part]
        self.kernel: Kernel = Kernel()
        rows = tuple(
            PinRow(name, "in" if name not in row.outputs else row.blocks[0].kind)
            for name in row.pins
        )
        self.swung: list[str] = []
        self.glue: Glue = Glue(self.kernel, self.swung.append)
        self.part: GluePart = GluePart(self.kernel, "u1", rows, row.blocks, delay, {})
        self.outputs: tuple[str, ...] = row.outputs
        self.hands: dict[str, Pin] = {
            name: self.part.pins[name].net.solder("hand") for name in row.inputs
        }
        self.glue.add(self.part)
        for name in row.inputs:
            if name not in row.outputs:
                self.hands[name].drive(levels.get(name, 0))
        self.kernel.settle()
        self.glue.start()
        self.kernel.settle()

    def set(self, **levels: int) -> "Bench":
        """Move inputs together; ``nX`` stands for ``/X``, ``_1A`` for ``1A``."""
        for name, level in levels.items():
            name = f"/{name[1:]}" if name[:1] == "n" else name.removeprefix("_")
            self.hands[name].drive(level)
        self.kernel.settle()
        return self

    def pulse(self, name: str, times: int = 1) -> "Bench":
        for _ in range(times):
            self.hands[name].drive(1 - self.hands[name].level)
            self.kernel.settle()
            self.hands[name].drive(1 - self.hands[name].level)
            self.kernel.settle()
        return self

    def word(self, *names: str) -> int:
        """Return levels of outputs, all by default, the first lowest."""
        return sum(
            self.part.pins[name].net.value << place
            for place, name in enumerate(names or self.outputs)
        )


TRUTHS = {
    "74HC00": 0b0111, "74HC02": 0b0001, "74HC03": 0b0111, "74HC08": 0b1000, "74HC32": 0b1110,
    "74HC86": 0b0110, "74HC266": 0b1001,
}  # fmt: skip


@pytest.mark.parametrize(("part", "truth"), TRUTHS.items())
def test_a_gate_of_two_inputs_has_its_truth_table(part: str, truth: int) -> None:
    bench = Bench(part)
    for b in (0, 1):
        for a in (0, 1):
            for gate in "1234":
                bench.set(**{f"_{gate}A": a, f"_{gate}B": b})
                assert bench.word(f"{gate}Y") == truth >> (a + 2 * b) & 1


@pytest.mark.parametrize(
    ("part", "inverted"), [("74HC04", 1), ("74HC05", 1), ("74HC07", 0), ("74HC14", 1)]
)
def test_an_inverter_inverts_and_open_drain_lets_go(part: str, inverted: int) -> None:
    bench = Bench(part)
    for level in (0, 1):
        bench.set(_6A=level)
        assert bench.word("6Y") == level ^ inverted
    if PARTS[part].blocks[0].kind == "od":
        bench.set(_6A=1 - inverted)
        assert bench.part.pins["6Y"].level == Z


@pytest.mark.parametrize(("part", "width"), [("74HC10", 3), ("74HC20", 4), ("74HC30", 8)])
def test_a_wide_nand_is_low_only_with_all_inputs_high(part: str, width: int) -> None:
    bench = Bench(part)
    names = PARTS[part].blocks[0].inputs
    for number in range(1 << width):
        bench.set(**{f"_{name}": number >> bit & 1 for bit, name in enumerate(names)})
        assert bench.word("1Y") == (number != (1 << width) - 1)


def test_and_of_three_and_nor_of_three() -> None:
    for part, on in (("74HC11", 7), ("74HC27", 0)):
        bench = Bench(part)
        for number in range(8):
            bench.set(_1A=number & 1, _1B=number >> 1 & 1, _1C=number >> 2)
            assert bench.word("1Y") == (number == on)


def test_a_74hc138_has_one_output_low_while_all_three_enables_agree() -> None:
    bench = Bench("74HC138", G1=1)
    for number in range(8):
        bench.set(A=number & 1, B=number >> 1 & 1, C=number >> 2)
        assert bench.word() == 0xFF & ~(1 << number)
    for off in ({"G1": 0}, {"G1": 1, "nG2A": 1}, {"nG2A": 0, "nG2B": 1}):
        assert bench.set(**off).word() == 0xFF


def test_74hc139_and_74hc154() -> None:
    bench = Bench("74HC139").set(_2A=1, _2B=1)
    assert bench.word() == 0b0111_1110
    assert bench.set(**{"_1/G": 1}).word() == 0b0111_1111
    bench = Bench("74HC154")
    for number in range(16):
        bench.set(A=number & 1, B=number >> 1 & 1, C=number >> 2 & 1, D=number >> 3)
        assert bench.word() == 0xFFFF & ~(1 << number)
    assert bench.set(nG2=1).word() == 0xFFFF


def test_multiplexers_pass_the_source_that_is_selected() -> None:
    bench = Bench("74HC153")
    bench.set(_1C2=1, _2C2=1, _2C1=1, A=0, B=1)
    assert bench.word() == 0b11
    assert bench.set(A=1, B=0).word() == 0b10
    assert bench.set(**{"_2/G": 1}).word() == 0
    bench = Bench("74HC157").set(_1A=1, _2B=1, _3A=1, _3B=1)
    assert bench.word() == 0b0101
    assert bench.set(**{"_A/B": 1}).word() == 0b0110
    bench = Bench("74HC151").set(D5=1, A=1, C=1)
    assert bench.word() == 0b01
    assert bench.set(nG=1).word() == 0b10


def test_three_state_buffers_let_go() -> None:
    for part, on in (("74HC125", 0), ("74HC126", 1)):
        name = PARTS[part].blocks[0].inputs[0]
        bench = Bench(part)
        bench.hands[name].drive(on)
        bench.set(_1A=0)
        assert bench.part.pins["1Y"].level == 0
        bench.hands[name].drive(1 - on)
        bench.kernel.settle()
        assert bench.part.pins["1Y"].level == Z
    bench = Bench("74HC244").set(_1A2=1)
    assert bench.word("1Y1", "1Y2") == 0b10
    bench.set(**{"_1/G": 1})
    assert [bench.part.pins[pin].level for pin in ("1Y1", "2Y1")] == [Z, 0]
    bench = Bench("74HC541").set(A7=1)
    assert bench.word() == 0x80


def test_a_transceiver_drives_one_side_at_a_time() -> None:
    bench = Bench("74HC245", DIR=1)
    bench.set(**{f"A{n}": 0xA5 >> n & 1 for n in range(8)})
    assert bench.word(*bundled("B0-B7")) == 0xA5
    assert bench.part.pins["A0"].level == Z
    for n in range(8):
        bench.hands[f"A{n}"].release()
    bench.set(DIR=0, **{f"B{n}": 0x3C >> n & 1 for n in range(8)})
    assert bench.word(*bundled("A0-A7")) == 0x3C
    bench.set(nOE=1)
    assert {bench.part.pins[pin].level for pin in bench.outputs} == {Z}


def byte(value: int) -> dict[str, int]:
    return {f"D{n}": value >> n & 1 for n in range(8)}


def test_registers_take_what_was_there_before_the_clock() -> None:
    bench = Bench("74HC374").set(**byte(0x5A))
    assert bench.set(CLK=1, **byte(0xFF)).word() == 0x5A  # data and clock move together
    bench.set(nOE=1)
    assert bench.part.pins["Q0"].level == Z
    bench = Bench("74HC273", **{"/CLR": 1}).set(**byte(0x5A)).set(CLK=1)
    assert bench.word() == 0x5A
    assert bench.set(nCLR=0).word() == 0
    bench = Bench("74HC373").set(LE=1, **byte(0x12))
    assert bench.word() == 0x12
    assert bench.set(**byte(0x34)).word() == 0x34
    assert bench.set(LE=0).set(**byte(0x56)).word() == 0x34
    assert bench.set(LE=1).set(LE=0, **byte(0x78)).word() == 0x56
    bench.set(nOE=1)
    assert {bench.part.pins[name].level for name in bench.outputs} == {Z}


def test_a_flip_flop_takes_data_at_the_clock_and_is_cleared_without() -> None:
    bench = Bench("74HC74", **{"1/CLR": 1, "1/PRE": 1})
    assert bench.word("1Q", "1/Q") == 0b10
    assert bench.set(_1D=1).set(_1CLK=1).word("1Q", "1/Q") == 0b01
    assert bench.set(**{"_1/CLR": 0}).word("1Q", "1/Q") == 0b10
    assert bench.set(**{"_1/PRE": 0}).word("1Q", "1/Q") == 0b11


def test_shift_registers_shift_the_way_their_data_books_say() -> None:
    bench = Bench("74HC164", **{"/CLR": 1}).set(A=1, B=1).pulse("CLK").set(B=0).pulse("CLK", 2)
    assert bench.word() == 0b100
    assert bench.set(nCLR=0).word() == 0
    bench = Bench("74HC165", H=1, F=1, SER=1)
    seen = [bench.word("QH", "/QH")]
    bench.set(nLOAD=1)
    for _ in range(8):
        seen.append(bench.pulse("CLK").word("QH", "/QH"))
    assert seen == [1, 2, 1, 2, 2, 2, 2, 2, 1]
    assert bench.set(INH=1).pulse("CLK", 3).set(INH=0).word("QH") == 1
    bench = Bench("74HC595", **{"/SRCLR": 1})
    for bit in (1, 0, 1, 1, 0, 0, 1, 0):
        bench.set(SER=bit).pulse("SRCLK")
    assert bench.word() == 0x100  # QH' only: nothing is stored yet
    assert bench.pulse("RCLK").word() & 0xFF == 0b10110010
    bench.set(nOE=1)
    assert [bench.part.pins[pin].level for pin in ("QA", "QH'")] == [Z, 1]


def test_counters_count_on_their_edge() -> None:
    bench = Bench("74HC4040").pulse("/CLK", 0x123)
    assert bench.word() == 0x123
    assert bench.set(CLR=1).word() == 0
    bench = Bench("74HC393").pulse("2CLK", 18)
    assert bench.word() == 0x20
    for part, after in (("74HC161", 0), ("74HC163", 14)):
        bench = Bench(part, **{"/CLR": 1, "/LOAD": 0, "ENP": 1, "ENT": 1, "B": 1, "C": 1, "D": 1})
        bench.pulse("CLK")
        assert bench.word() == 14
        assert bench.set(nLOAD=1).pulse("CLK").word() == 31  # 15, and the carry
        assert bench.set(ENT=0).word() == 15
        assert bench.set(ENT=1).pulse("CLK").word() == 0
        bench.set(nLOAD=0).pulse("CLK")
        assert bench.set(nCLR=0).word() == after
        assert bench.pulse("CLK").word() == 0


def test_outputs_follow_after_the_delay_and_every_pulse_gets_through() -> None:
    bench = Bench("74HC04", delay=7 * NS)
    pin = bench.part.pins["1Y"]
    bench.set(_1A=1)
    bench.kernel.run_until(2 * NS)
    bench.set(_1A=0)
    for when, level in ((7 * NS - 1, 1), (7 * NS, 0), (9 * NS - 1, 0), (9 * NS, 1)):
        bench.kernel.run_until(when)
        assert pin.net.value == level


def test_a_supervisor_holds_reset_after_power_on_and_after_each_manual_reset() -> None:
    bench = Bench("RESET", delay=100 * NS, **{"/MR": 1})
    for when, level in ((0, 0), (100 * NS - 1, 0), (100 * NS, 1)):
        bench.kernel.run_until(when)
        assert bench.word("/RESET", "RESET") == (1 if level else 2)
    bench.set(nMR=0)
    assert bench.word("/RESET", "RESET") == 2
    bench.kernel.run_until(150 * NS)
    bench.set(nMR=1)
    bench.kernel.run_until(200 * NS)
    bench.set(nMR=0).set(nMR=1)
    bench.kernel.run_until(300 * NS - 1)
    assert bench.word("/RESET") == 0
    bench.kernel.run_until(300 * NS)
    assert bench.word("/RESET") == 1


def test_a_jumper_pulls_low() -> None:
    assert Bench("JUMPER").part.pins["Y"].net.value == 0


@given(
    st.lists(
        st.tuples(st.sampled_from(sorted(TRUTHS)), st.integers(0, 99), st.integers(0, 99)),
        min_size=1, max_size=8,
    ),
    st.lists(st.integers(0, 15), min_size=1, max_size=6),
    st.lists(st.integers(0, 20), min_size=8, max_size=8),
)  # fmt: skip
def test_random_gates_settle_at_what_their_truth_tables_give(
    gates: list[tuple[str, int, int]], words: list[int], delays: list[int]
) -> None:
    kernel = Kernel()
    nets = [Net(kernel, f"in{n}") for n in range(4)]
    hands = [net.solder("hand") for net in nets]
    glue = Glue(kernel, print)
    # From the last gate to the first: the order of parts is not the one they follow one another in.
    made = []
    for place, (part, a, b) in enumerate(gates):
        block = PARTS[part].blocks[0]
        out = Net(kernel, f"g{place}")
        sources = {
            "1A": (nets[a % len(nets)].solder("a"), 0), "1B": (nets[b % len(nets)].solder("b"), 0)
        }  # fmt: skip
        gate = GluePart(
            kernel, f"g{place}", (PinRow("1Y", block.kind),), (block,), delays[place] * NS, sources
        )
        gate.pins["1Y"].move(out)
        nets.append(out)
        made.append(gate)
    for gate in reversed(made):
        glue.add(gate)
    glue.order = [(gate.name, 0) for gate in made]
    glue.start()
    seen: list[int] = []
    for word in words:
        for bit, hand in enumerate(hands):
            hand.drive(word >> bit & 1)
        kernel.settle()
        kernel.run_for(200 * NS)
        levels = [word >> bit & 1 for bit in range(4)]
        for part, a, b in gates:
            here = levels[a % len(levels)] + 2 * levels[b % len(levels)]
            levels.append(TRUTHS[part] >> here & 1)
        assert [net.value for net in nets] == levels
        seen.append(levels[-1])


def test_every_row_has_pins_of_its_own_and_is_found_by_its_number() -> None:
    assert [PARTS[row.part] for row in ROWS] == list(ROWS)
    for row in ROWS:
        assert len(set(row.outputs)) == len(row.outputs)
        for block in row.blocks:
            assert set(block.follows) <= set(block.inputs)


def test_each_of_eight_bits_is_enabled_by_its_own() -> None:
    for bit in range(8):
        levels = tuple(int(place == bit) for place in range(8))
        for enable in range(8):
            enables = tuple(int(place == enable) for place in range(8))
            assert enabled((*levels, *enables), (), 0)[1] == (bit == enable)
