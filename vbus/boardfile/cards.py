"""``[cards.NAME]``: what a computer's bus reaches by addresses, and the card's own registers."""

from typing import Annotated, Final

from vbus.boardfile.key import NAMES, Section
from vbus.boardfile.key import key as _key
from vbus.glue.card_buses import BUSES

SENSES: Final = ("level", "edge")
ACCESSES: Final = ("read", "write", "either")
SIGNALS: Final = {"SIGHUP": 1, "SIGUSR1": 10, "SIGUSR2": 12, "SIGALRM": 14, "SIGIO": 29}
"""Signals that may stand for an interrupt, with their numbers on Linux for x86."""
REGISTER_KINDS: Final = ("latch", "status", "fixed", "pending")


class CardPortSection(Section, frozen=True, kw_only=True):
    """One row of a card's ``ports``: what answers at an offset."""

    offset: Annotated[int, _key("count", "distance from the base, in strides", low=0)]
    chip: Annotated[str, _key("text", "the chip that answers")]
    address: Annotated[int, _key("count", "address at that chip", low=0)]


NO_PORT: Final = CardPortSection(offset=0, chip="", address=0)
"""Stands for a row that could not be read, so that the others keep their places."""


class CardRegisterSection(Section, frozen=True, kw_only=True):
    """``[cards.NAME.registers.REGISTER]``: a register of the card itself."""

    name: str
    at: Annotated[
        int, _key("count", "distance of its address from the base, in strides", low=0, high=255)
    ]
    kind: Annotated[
        str,
        _key(
            "choice",
            "latch: holds the byte written last, on Q0 to Q7; status: a read gives I0 to I7; fixed:"
            " a read gives values; pending: edges at I0 to I7 set bits, which a written 1 clears",
            REGISTER_KINDS,
        ),
    ] = "latch"
    reset: Annotated[
        int, _key("count", "what a latch holds after power-on and RESET", low=0, high=0xFF)
    ] = 0
    read_back: Annotated[bool, _key("flag", "a latch can be read, too")] = True
    values: Annotated[
        str, _key("text", 'bytes that a fixed register gives from this address on, such as "5A 01"')
    ] = ""
    sense: Annotated[
        str, _key("choice", "what sets a pending bit: its input being high, or going high", SENSES)
    ] = "edge"
    low: Annotated[tuple[str, ...], _key(NAMES, "its inputs that are tied to ground")] = ()
    high: Annotated[tuple[str, ...], _key(NAMES, "its inputs that are tied to the supply")] = ()
    hosts: Annotated[
        tuple[str, ...], _key(NAMES, 'its pins that hosts drive or see, as "REGISTER.pin"')
    ] = ()
    pins: dict[str, tuple[str, ...]] = {}


class CardSection(Section, frozen=True, kw_only=True):
    """``[cards.NAME]``: which card address reaches which address of which chip."""

    name: str
    base: Annotated[int, _key("count", "address of the card's first port", low=0)] = 0
    stride: Annotated[int, _key("count", "distance between neighbouring ports", low=1)] = 1
    decode: Annotated[str, _key("text", "a decode circuit known by name, in place of ports")] = ""
    chips: Annotated[
        tuple[str, ...], _key(NAMES, "the chips behind the decode circuit, one block each")
    ] = ()
    block: Annotated[
        int, _key("count", "ports from one chip's block to the next; 0: the circuit's own", low=0)
    ] = 0
    memory: Annotated[
        bool, _key("flag", "its addresses are memory, not I/O ports (for programs: vbus exec)")
    ] = False
    fixed: Annotated[
        int,
        _key(
            "count",
            "where a program expects the memory page of its first port without mapping it; 0:"
            " nowhere",
            low=0,
        ),
    ] = 0
    big_endian: Annotated[
        bool,
        _key("flag", "in wide accesses the byte at the lowest address is the most significant"),
    ] = False
    interrupt: Annotated[
        str,
        _key(
            "text",
            'output that interrupts the program, as "chip.pin"; several with spaces: wired-OR',
        ),
    ] = ""
    signal: Annotated[
        str, _key("choice", "signal an interrupt sends to the program", tuple(SIGNALS))
    ] = ""
    sense: Annotated[
        str,
        _key(
            "choice",
            "whether the interrupt follows the level of its line, or comes at an edge",
            SENSES,
        ),
    ] = "level"
    acknowledge: Annotated[
        str,
        _key(
            "choice",
            "access that clears the interrupt's flip-flop; without one the card has no flip-flop",
            ACCESSES,
        ),
    ] = ""
    acknowledge_at: Annotated[
        int, _key("count", "distance of its address from the base, in strides", low=0)
    ] = 0
    line: Annotated[
        str, _key("text", "name of an interrupt line that cards share; they pull it low together")
    ] = ""
    bus: Annotated[
        str,
        _key("choice", "its connector, wired by pins, in place of ports and decode", tuple(BUSES)),
    ] = ""
    size: Annotated[int, _key("count", "ports of a card with a bus", low=1, high=256)] = 16
    setup: Annotated[
        int,
        _key("s", "how long address and data stand before the strobe; 0 s: as usual", low=0),
    ] = 0
    strobe: Annotated[
        int, _key("s", "how long the strobe of a cycle on its bus is low; 0 s: as usual", low=0)
    ] = 0
    wait_states: Annotated[
        int,
        _key("count", "by how many cycles of the bus clock strobes are longer", low=0, high=1000),
    ] = 0
    hold: Annotated[
        int, _key("s", "how long written data stays after the strobe; 0 s: as usual", low=0)
    ] = 0
    ports: tuple[CardPortSection, ...] = ()
    pins: dict[str, tuple[str, ...]] = {}
    selects: dict[str, tuple[str, ...]] = {}
    registers: tuple[CardRegisterSection, ...] = ()

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
        """The chips that interrupt."""
        return tuple(output.partition(".")[0] for output in self.interrupt.split())
