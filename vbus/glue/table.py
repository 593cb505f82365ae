"""The parts of glue there are: a row each, with the pins as the data books name them."""

from collections.abc import Callable
from functools import reduce
from operator import and_, or_, xor
from typing import Final

from msgspec import Struct

from vbus.glue import logic, peripherals
from vbus.glue.logic import Function, Levels

OUT: Final = "out"
OPEN: Final = "od"
THREE_STATE: Final = "io"


class Block(Struct, frozen=True):
    """One block of a part: what its outputs follow from.

    Attributes:
        inputs: names of its input pins.
        outputs: names of its output pins; an input that stands here too goes both ways.
        function: what it does.
        kind: what its outputs are: push-pull, open collector (``"od"``), three-state (``"io"``).
        through: the inputs an output follows at once, without a clock; None: all of them.
        holds: outputs are released only the part's delay after, and asserted at once: a reset.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    function: Function
    kind: str = OUT
    through: tuple[str, ...] | None = None
    holds: bool = False

    @property
    def follows(self) -> tuple[str, ...]:
        """The inputs an output follows at once."""
        return self.inputs if self.through is None else self.through


class GlueRow(Struct, frozen=True):
    """A part number, what it is, and its blocks."""

    part: str
    title: str
    blocks: tuple[Block, ...]

    @property
    def inputs(self) -> tuple[str, ...]:
        """The pins that are inputs, or go both ways."""
        return tuple(dict.fromkeys(name for block in self.blocks for name in block.inputs))

    @property
    def outputs(self) -> tuple[str, ...]:
        """The pins that are outputs, or go both ways."""
        return tuple(name for block in self.blocks for name in block.outputs)

    @property
    def pins(self) -> tuple[str, ...]:
        """All pins."""
        return tuple(dict.fromkeys((*self.inputs, *self.outputs)))


def run(letter: str, count: int, first: int = 0) -> tuple[str, ...]:
    """Return names of pins that are counted: Q0, Q1, ..."""
    return tuple(f"{letter}{number}" for number in range(first, first + count))


def _gates(
    part: str,
    count: int,
    letters: str,
    operate: Callable[[Levels], int],
    what: str,
    kind: str = OUT,
) -> GlueRow:
    blocks = tuple(
        Block(tuple(f"{n}{letter}" for letter in letters), (f"{n}Y",), logic.gate(operate), kind)
        for n in range(1, count + 1)
    )
    return GlueRow(part, what, blocks)


def _all(levels: Levels) -> int:
    return reduce(and_, levels)


def _any(levels: Levels) -> int:
    return reduce(or_, levels)


def _odd(levels: Levels) -> int:
    return reduce(xor, levels)


def _not(operate: Callable[[Levels], int]) -> Callable[[Levels], int]:
    return lambda levels: ~operate(levels)


def _one(part: str, title: str, *blocks: Block) -> GlueRow:
    return GlueRow(part, title, blocks)


_EIGHT: Final = tuple("ABCDEFGH")
_Q8: Final = tuple(f"Q{letter}" for letter in _EIGHT)
_Q4: Final = _Q8[:4]
_PORTS: Final = (*run("PA", 8), *run("PB", 8), *run("PC", 8))
_EXPANDERS: Final = (
    ("PCF8574", 0x20), ("PCF8574A", 0x38), ("PCA9554", 0x20), ("PCA9554A", 0x38),
)  # fmt: skip
_LOAD: Final = ("/CLR", "/LOAD", "CLK", "ENP", "ENT", *"ABCD")

ROWS: Final = (
    _gates("74HC00", 4, "AB", _not(_all), "four NAND gates"),
    _gates("74HC02", 4, "AB", _not(_any), "four NOR gates"),
    _gates("74HC03", 4, "AB", _not(_all), "four NAND gates, open drain", OPEN),
    _gates("74HC04", 6, "A", _not(_all), "six inverters"),
    _gates("74HC05", 6, "A", _not(_all), "six inverters, open drain", OPEN),
    _gates("74HC07", 6, "A", _all, "six buffers, open drain", OPEN),
    _gates("74HC08", 4, "AB", _all, "four AND gates"),
    _gates("74HC10", 3, "ABC", _not(_all), "three NAND gates"),
    _gates("74HC11", 3, "ABC", _all, "three AND gates"),
    _gates("74HC14", 6, "A", _not(_all), "six inverters"),
    _gates("74HC20", 2, "ABCD", _not(_all), "two NAND gates"),
    _gates("74HC27", 3, "ABC", _not(_any), "three NOR gates"),
    _gates("74HC30", 1, "ABCDEFGH", _not(_all), "a NAND gate"),
    _gates("74HC32", 4, "AB", _any, "four OR gates"),
    _gates("74HC86", 4, "AB", _odd, "four XOR gates"),
    _gates("74HC266", 4, "AB", _not(_odd), "four XNOR gates, open drain", OPEN),
    GlueRow(
        "74HC74",
        "two D flip-flops",
        tuple(
            Block(
                (f"{n}/CLR", f"{n}/PRE", f"{n}CLK", f"{n}D"),
                (f"{n}Q", f"{n}/Q"),
                logic.flip_flop,
                through=(),
            )
            for n in (1, 2)
        ),
    ),
    GlueRow(
        "74HC125",
        "four three-state buffers",
        tuple(
            Block((f"{n}/OE", f"{n}A"), (f"{n}Y",), logic.driver(0, 1), THREE_STATE)
            for n in range(1, 5)
        ),
    ),
    GlueRow(
        "74HC126",
        "four three-state buffers",
        tuple(
            Block((f"{n}OE", f"{n}A"), (f"{n}Y",), logic.driver(1, 1), THREE_STATE)
            for n in range(1, 5)
        ),
    ),
    _one(
        "74HC138",
        "3-to-8 decoder",
        Block((*"ABC", "G1", "/G2A", "/G2B"), run("Y", 8), logic.decoder(3, (1, 0, 0))),
    ),
    GlueRow(
        "74HC139",
        "two 2-to-4 decoders",
        tuple(
            Block((f"{n}A", f"{n}B", f"{n}/G"), run(f"{n}Y", 4), logic.decoder(2, (0,)))
            for n in (1, 2)
        ),
    ),
    _one(
        "74HC151",
        "8-to-1 multiplexer",
        Block((*"ABC", "/G", *run("D", 8)), ("Y", "W"), logic.multiplexer(3, 1, True)),
    ),
    GlueRow(
        "74HC153",
        "two 4-to-1 multiplexers",
        tuple(
            Block(
                ("A", "B", f"{n}/G", *run(f"{n}C", 4)), (f"{n}Y",), logic.multiplexer(2, 1, False)
            )
            for n in (1, 2)
        ),
    ),
    _one(
        "74HC154",
        "4-to-16 decoder",
        Block((*"ABCD", "/G1", "/G2"), run("Y", 16), logic.decoder(4, (0, 0))),
    ),
    GlueRow(
        "74HC157",
        "four 2-to-1 multiplexers",
        tuple(
            Block(("A/B", "/G", f"{n}A", f"{n}B"), (f"{n}Y",), logic.multiplexer(1, 1, False))
            for n in range(1, 5)
        ),
    ),
    _one(
        "74HC161",
        "4-bit counter, cleared at once",
        Block(_LOAD, (*_Q4, "RCO"), logic.loaded_counter(False), through=("ENT",)),
    ),
    _one(
        "74HC163",
        "4-bit counter, cleared by the clock",
        Block(_LOAD, (*_Q4, "RCO"), logic.loaded_counter(True), through=("ENT",)),
    ),
    _one(
        "74HC164",
        "shift register, serial in",
        Block(("/CLR", "CLK", "A", "B"), _Q8, logic.parallel_out, through=()),
    ),
    _one(
        "74HC165",
        "shift register, parallel in",
        Block(
            ("/LOAD", "CLK", "INH", "SER", *_EIGHT),
            ("QH", "/QH"),
            logic.parallel_in,
            through=("/LOAD", "H"),
        ),
    ),
    GlueRow(
        "74HC244",
        "eight three-state buffers",
        tuple(
            Block(
                (f"{n}/G", *run(f"{n}A", 4, 1)), run(f"{n}Y", 4, 1), logic.driver(0, 4), THREE_STATE
            )
            for n in (1, 2)
        ),
    ),
    _one(
        "74HC541",
        "eight three-state buffers",
        Block(("/G", *run("A", 8)), run("Y", 8), logic.driver(0, 8), THREE_STATE),
    ),
    _one(
        "74HC245",
        "eight-bit transceiver",
        Block(
            ("DIR", "/OE", *run("A", 8), *run("B", 8)),
            (*run("A", 8), *run("B", 8)),
            logic.transceiver,
            THREE_STATE,
            through=(),
        ),
    ),
    _one(
        "74HC273",
        "eight D flip-flops with clear",
        Block(("/CLR", "CLK", *run("D", 8)), run("Q", 8), logic.cleared_register, through=()),
    ),
    _one(
        "74HC373",
        "eight transparent latches, three-state",
        Block(("/OE", "LE", *run("D", 8)), run("Q", 8), logic.transparent, THREE_STATE),
    ),
    _one(
        "74HC374",
        "eight D flip-flops, three-state",
        Block(
            ("/OE", "CLK", *run("D", 8)), run("Q", 8), logic.register, THREE_STATE, through=("/OE",)
        ),
    ),
    GlueRow(
        "74HC393",
        "two 4-bit counters",
        tuple(
            Block(
                (f"{n}CLR", f"{n}CLK"),
                tuple(f"{n}{q}" for q in _Q4),
                logic.counter(4, True, True),
                through=(),
            )
            for n in (1, 2)
        ),
    ),
    _one(
        "74HC595",
        "shift register with storage, three-state",
        Block(
            ("/OE", "/SRCLR", "SRCLK", "RCLK", "SER"),
            (*_Q8, "QH'"),
            logic.shift_and_store,
            THREE_STATE,
            through=("/OE",),
        ),
    ),
    _one(
        "74HC4040",
        "12-bit counter",
        Block(("CLR", "/CLK"), run("Q", 12, 1), logic.counter(12, True, True), through=()),
    ),
    _one(
        "82C55",
        "three 8-bit ports, mode 0",
        Block(
            ("RESET", "/CS", "/RD", "/WR", "A0", "A1", *run("D", 8), *_PORTS),
            (*run("D", 8), *_PORTS),
            peripherals.port_chip,
            THREE_STATE,
            through=("RESET", "/CS", "/RD", "A0", "A1"),
        ),
    ),
    _one(
        "HCTL-2016",
        "16-bit quadrature counter on an 8-bit bus; its clock is not wired",
        Block(
            ("SEL", "/OE", "/RST", "CHA", "CHB"),
            run("D", 8),
            peripherals.quadrature_counter,
            THREE_STATE,
            through=("SEL", "/OE"),
        ),
    ),
    *(
        _one(
            part,
            f"8-bit port expander on I2C, at {base:02X}H and up",
            Block(
                ("SCL", "SDA", "A0", "A1", "A2", *run("P", 8)),
                ("SDA", "/INT", *run("P", 8)),
                peripherals.expander(base, part.startswith("PCA")),
                THREE_STATE,
                through=(),
            ),
        )
        for part, base in _EXPANDERS
    ),
    _one(
        "RESET",
        "supervisor or RC: reset for the delay after power-on and after /MR",
        Block(("/MR",), ("/RESET", "RESET"), logic.supervisor, holds=True),
    ),
    _one(
        "JUMPER",
        "a jumper or switch to ground that is closed",
        Block((), ("Y",), logic.jumper, OPEN),
    ),
)

PARTS: Final = {row.part: row for row in ROWS}
PLD: Final = "PLD"
"""The part whose function is written as equations."""
