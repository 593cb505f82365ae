"""The parts of glue there are: a row each, with the pins as the data books name them."""

import re
from collections.abc import Callable
from functools import reduce
from operator import and_, or_, xor
from typing import Final

from msgspec import Struct

from vbus.glue import logic, peripherals
from vbus.glue.logic import Function

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


_RUN: Final = re.compile(r"(.*?)(\d+|[A-Z])-\1(\d+|[A-Z])")


def pins(text: str) -> tuple[str, ...]:
    """Return names of pins in a text: ``"/OE D0-D7"`` are /OE and D0 to D7; so are ``"QA-QC"``."""
    names: list[str] = []
    for word in text.split():
        match = _RUN.fullmatch(word)
        if match is None:
            names.append(word)
        elif match[2].isdecimal():
            names += [f"{match[1]}{n}" for n in range(int(match[2]), int(match[3]) + 1)]
        else:
            names += [f"{match[1]}{chr(n)}" for n in range(ord(match[2]), ord(match[3]) + 1)]
    return tuple(names)


def _row(
    part: str, title: str, units: int, inputs: str, outputs: str, function: Function,
    kind: str = OUT, through: str | None = None, holds: bool = False,
) -> GlueRow:  # fmt: skip
    """Return a part of equal units; ``#`` in the name of a pin is the number of its unit."""
    blocks = [
        Block(
            pins(inputs.replace("#", str(unit))), pins(outputs.replace("#", str(unit))),
            function, kind, None if through is None else pins(through), holds,
        )
        for unit in range(1, units + 1)
    ]  # fmt: skip
    return GlueRow(part, title, tuple(blocks))


def _inverted(operate: Callable[[int, int], int]) -> Function:
    return logic.gate(lambda levels: ~reduce(operate, levels))


def _plain(operate: Callable[[int, int], int]) -> Function:
    return logic.gate(lambda levels: reduce(operate, levels))


_AND, _OR, _XOR = _plain(and_), _plain(or_), _plain(xor)
_NAND, _NOR, _XNOR = _inverted(and_), _inverted(or_), _inverted(xor)
_PORTS: Final = "PA0-PA7 PB0-PB7 PC0-PC7"
_LOADED: Final = "/CLR /LOAD CLK ENP ENT A B C D"
_EXPANDERS: Final = (
    ("PCF8574", 0x20), ("PCF8574A", 0x38), ("PCA9554", 0x20), ("PCA9554A", 0x38),
)  # fmt: skip

ROWS: Final = (
    _row("74HC00", "four NAND gates", 4, "#A #B", "#Y", _NAND),
    _row("74HC02", "four NOR gates", 4, "#A #B", "#Y", _NOR),
    _row("74HC03", "four NAND gates, open drain", 4, "#A #B", "#Y", _NAND, OPEN),
    _row("74HC04", "six inverters", 6, "#A", "#Y", _NAND),
    _row("74HC05", "six inverters, open drain", 6, "#A", "#Y", _NAND, OPEN),
    _row("74HC07", "six buffers, open drain", 6, "#A", "#Y", _AND, OPEN),
    _row("74HC08", "four AND gates", 4, "#A #B", "#Y", _AND),
    _row("74HC10", "three NAND gates", 3, "#A #B #C", "#Y", _NAND),
    _row("74HC11", "three AND gates", 3, "#A #B #C", "#Y", _AND),
    _row("74HC14", "six inverters", 6, "#A", "#Y", _NAND),
    _row("74HC20", "two NAND gates", 2, "#A #B #C #D", "#Y", _NAND),
    _row("74HC27", "three NOR gates", 3, "#A #B #C", "#Y", _NOR),
    _row("74HC30", "a NAND gate", 1, "#A-#H", "#Y", _NAND),
    _row("74HC32", "four OR gates", 4, "#A #B", "#Y", _OR),
    _row("74HC86", "four XOR gates", 4, "#A #B", "#Y", _XOR),
    _row("74HC266", "four XNOR gates, open drain", 4, "#A #B", "#Y", _XNOR, OPEN),
    _row("74HC74", "two D flip-flops", 2, "#/CLR #/PRE #CLK #D", "#Q #/Q", logic.flip_flop,
         through=""),
    _row("74HC125", "four three-state buffers", 4, "#/OE #A", "#Y", logic.driver(0, 1),
         THREE_STATE),
    _row("74HC126", "four three-state buffers", 4, "#OE #A", "#Y", logic.driver(1, 1),
         THREE_STATE),
    _row("74HC138", "3-to-8 decoder", 1, "A B C G1 /G2A /G2B", "Y0-Y7",
         logic.decoder(3, (1, 0, 0))),
    _row("74HC139", "two 2-to-4 decoders", 2, "#A #B #/G", "#Y0-#Y3", logic.decoder(2, (0,))),
    _row("74HC151", "8-to-1 multiplexer", 1, "A B C /G D0-D7", "Y W",
         logic.multiplexer(3, True)),
    _row("74HC153", "two 4-to-1 multiplexers", 2, "A B #/G #C0-#C3", "#Y",
         logic.multiplexer(2, False)),
    _row("74HC154", "4-to-16 decoder", 1, "A B C D /G1 /G2", "Y0-Y15", logic.decoder(4, (0, 0))),
    _row("74HC157", "four 2-to-1 multiplexers", 4, "A/B /G #A #B", "#Y",
         logic.multiplexer(1, False)),
    _row("74HC161", "4-bit counter, cleared at once", 1, _LOADED, "QA-QD RCO",
         logic.loaded_counter(False), through="ENT"),
    _row("74HC163", "4-bit counter, cleared by the clock", 1, _LOADED, "QA-QD RCO",
         logic.loaded_counter(True), through="ENT"),
    _row("74HC164", "shift register, serial in", 1, "/CLR CLK A B", "QA-QH",
         logic.clocked(logic.shifted_in), through=""),
    _row("74HC165", "shift register, parallel in", 1, "/LOAD CLK INH SER A-H", "QH /QH",
         logic.parallel_in, through="/LOAD H"),
    _row("74HC244", "eight three-state buffers", 2, "#/G #A1-#A4", "#Y1-#Y4", logic.driver(0, 4),
         THREE_STATE),
    _row("74HC541", "eight three-state buffers", 1, "/G A0-A7", "Y0-Y7", logic.driver(0, 8),
         THREE_STATE),
    _row("74HC245", "eight-bit transceiver", 1, "DIR /OE A0-A7 B0-B7", "A0-A7 B0-B7",
         logic.transceiver, THREE_STATE, through=""),
    _row("74HC273", "eight D flip-flops with clear", 1, "/CLR CLK D0-D7", "Q0-Q7",
         logic.clocked(logic.taken), through=""),
    _row("74HC373", "eight transparent latches, three-state", 1, "/OE LE D0-D7", "Q0-Q7",
         logic.transparent, THREE_STATE),
    _row("74HC374", "eight D flip-flops, three-state", 1, "/OE CLK D0-D7", "Q0-Q7",
         logic.clocked(logic.taken, enables=True), THREE_STATE, through="/OE"),
    _row("74HC393", "two 4-bit counters", 2, "#CLR #CLK", "#QA-#QD", logic.counter(4),
         through=""),
    _row("74HC595", "shift register with storage, three-state", 1, "/OE /SRCLR SRCLK RCLK SER",
         "QA-QH QH'", logic.shift_and_store, THREE_STATE, through="/OE"),
    _row("74HC4040", "12-bit counter", 1, "CLR /CLK", "Q1-Q12", logic.counter(12),
         through=""),
    _row("82C55", "three 8-bit ports, mode 0", 1, f"RESET /CS /RD /WR A0 A1 D0-D7 {_PORTS}",
         f"D0-D7 {_PORTS}", peripherals.port_chip, THREE_STATE, through="RESET /CS /RD A0 A1"),
    _row("HCTL-2016", "16-bit quadrature counter on an 8-bit bus; its clock is not wired", 1,
         "SEL /OE /RST CHA CHB", "D0-D7", peripherals.quadrature_counter, THREE_STATE,
         through="SEL /OE"),
    *(_row(part, f"8-bit port expander on I2C, at {base:02X}H and up", 1,
           "SCL SDA A0 A1 A2 P0-P7", "SDA /INT P0-P7",
           peripherals.expander(base, part.startswith("PCA")), THREE_STATE, through="")
      for part, base in _EXPANDERS),
    _row("RESET", "supervisor or RC: reset for the delay after power-on and after /MR", 1, "/MR",
         "/RESET RESET", logic.supervisor, holds=True),
    _row("JUMPER", "a jumper or switch to ground that is closed", 1, "", "Y", logic.jumper, OPEN),
)  # fmt: skip

PARTS: Final = {row.part: row for row in ROWS}
PLD: Final = "PLD"
"""The part whose function is written as equations."""
