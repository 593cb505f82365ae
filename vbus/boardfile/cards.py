"""``[cards.NAME]``: what a computer's bus reaches by addresses, and the card's own registers."""

from typing import Annotated, Final

from vbus.boardfile.key import Names, Section, Wires, row
from vbus.glue.card_buses import BUSES

SENSES: Final = ("level", "edge")
ACCESSES: Final = ("read", "write", "either")
SIGNALS: Final = {"SIGHUP": 1, "SIGUSR1": 10, "SIGUSR2": 12, "SIGALRM": 14, "SIGIO": 29}
"""Signals that may stand for an interrupt, with their numbers on Linux for x86."""
REGISTER_KINDS: Final = ("latch", "status", "fixed", "pending")


class CardPortSection(Section, frozen=True, kw_only=True):
    """One row of a card's ``ports``: what answers at an offset."""

    offset: Annotated[int, row("distance from the base, in strides", low=0)]
    chip: Annotated[str, row("the chip that answers", ref="chips")]
    address: Annotated[int, row("address at that chip", low=0)]


class CardRegisterSection(Section, frozen=True, kw_only=True):
    """``[cards.NAME.registers.REGISTER]``: a register of the card itself."""

    name: str
    at: Annotated[int, row("distance of its address from the base, in strides", low=0, high=255)]
    kind: Annotated[str, row(
        "latch: holds the byte written last, on Q0 to Q7; status: a read gives I0 to I7; fixed: a "
        "read gives values; pending: edges at I0 to I7 set bits, which a written 1 clears",
        choices=REGISTER_KINDS)] = "latch"  # fmt: skip
    reset: Annotated[int, row(
        "what a latch holds after power-on and RESET",
        low=0, high=0xFF, needs="kind=latch")] = 0  # fmt: skip
    read_back: Annotated[bool, row("a latch can be read, too", needs="kind=latch")] = True
    values: Annotated[str, row(
        'bytes that a fixed register gives from this address on, such as "5A 01"',
        needs="kind=fixed")] = ""  # fmt: skip
    sense: Annotated[str, row(
        "what sets a pending bit: its input being high, or going high",
        choices=SENSES, needs="kind=pending")] = "edge"  # fmt: skip
    low: Annotated[Names, row("its inputs that are tied to ground")] = ()
    high: Annotated[Names, row("its inputs that are tied to the supply")] = ()
    hosts: Annotated[Names, row('its pins that hosts drive or see, as "REGISTER.pin"')] = ()
    pins: Wires = {}


class CardSection(Section, frozen=True, kw_only=True):
    """``[cards.NAME]``: which card address reaches which address of which chip."""

    name: str
    base: Annotated[int, row("address of the card's first port", low=0)] = 0
    stride: Annotated[int, row("distance between neighbouring ports", low=1)] = 1
    decode: Annotated[
        str, row("a decode circuit known by name, in place of ports", needs="chips")
    ] = ""
    chips: Annotated[Names, row(
        "the chips behind the decode circuit, one block each",
        ref="chips", needs="decode")] = ()  # fmt: skip
    block: Annotated[int, row(
        "ports from one chip's block to the next; 0: the circuit's own",
        low=0, needs="decode")] = 0  # fmt: skip
    memory: Annotated[
        bool, row("its addresses are memory, not I/O ports (for programs: vbus exec)")
    ] = False
    fixed: Annotated[int, row(
        "where a program expects the memory page of its first port without mapping it; 0: nowhere",
        low=0, needs="memory")] = 0  # fmt: skip
    big_endian: Annotated[
        bool, row("in wide accesses the byte at the lowest address is the most significant")
    ] = False
    interrupt: Annotated[str, row(
        'output that interrupts the program, as "chip.pin", of glue too; "!" in front: when it is '
        'low; several with spaces: wired-OR')] = ""  # fmt: skip
    signal: Annotated[str, row(
        "signal an interrupt sends to the program",
        choices=tuple(SIGNALS), needs="interrupt")] = ""  # fmt: skip
    sense: Annotated[str, row(
        "whether the interrupt follows the level of its line, or comes at an edge",
        choices=SENSES, needs="interrupt")] = "level"  # fmt: skip
    acknowledge: Annotated[str, row(
        "access that clears the interrupt's flip-flop; without one the card has no flip-flop",
        choices=ACCESSES, needs="interrupt")] = ""  # fmt: skip
    acknowledge_at: Annotated[
        int, row("distance of its address from the base, in strides", low=0, needs="acknowledge")
    ] = 0
    line: Annotated[str, row(
        "name of an interrupt line that cards share; they pull it low together",
        needs="interrupt")] = ""  # fmt: skip
    bus: Annotated[str, row(
        "its connector, wired by pins, in place of ports and decode",
        choices=tuple(BUSES))] = ""  # fmt: skip
    size: Annotated[int, row("ports of a card with a bus", low=1, high=256, needs="bus")] = 16
    setup: Annotated[int, row(
        "how long address and data stand before the strobe; 0 s: as usual",
        "s", low=0, needs="bus")] = 0  # fmt: skip
    strobe: Annotated[int, row(
        "how long the strobe of a cycle on its bus is low; 0 s: as usual",
        "s", low=0, needs="bus")] = 0  # fmt: skip
    wait_states: Annotated[int, row(
        "by how many cycles of the bus clock strobes are longer",
        low=0, high=1000, needs="bus")] = 0  # fmt: skip
    hold: Annotated[int, row(
        "how long written data stays after the strobe; 0 s: as usual",
        "s", low=0, needs="bus")] = 0  # fmt: skip
    ports: tuple[CardPortSection, ...] = ()
    pins: Annotated[Wires, row("", needs="bus")] = {}
    selects: Annotated[Wires, row("", needs="bus")] = {}
    registers: Annotated[tuple[CardRegisterSection, ...], row("", needs="bus")] = ()

    def address(self, port: int) -> int:
        """Return the address of a port, counted from the base in strides."""
        return self.base + port * self.stride

    @property
    def last(self) -> int:
        """The address of its last port, if it has a bus."""
        return self.address(self.size - 1)

    @property
    def has_circuit(self) -> bool:
        """Whether its interrupt is more than the outputs themselves."""
        return bool(self.acknowledge or self.line)

    @property
    def decoded(self) -> tuple[str, ...]:
        """The chips behind its addresses."""
        return (*self.chips, *(port.chip for port in self.ports))

    @property
    def interrupting(self) -> tuple[str, ...]:
        """The chips, or parts of glue, that interrupt."""
        outputs = self.interrupt.split()
        return tuple(output.removeprefix("!").partition(".")[0] for output in outputs)
