"""What a stretch of bus cycles says in the manual's words, and the base of those who read it.

The sigrok decoders use copies of this file and of the chips' decoders beside it, so nothing here
may need more than the standard library and the tables.
"""

from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple, Protocol

from vbus.chips.tables import Command, CommandTable, Register, RegisterMap

WRITE: Final = "w"
READ: Final = "r"

PATIENCE: Final = 1000
"""Bus cycles after which the other bytes of a register are not waited for any more."""

WHOLE: Final = "packet"
STATUS: Final = "status"
CUT: Final = "cut"
UNKNOWN: Final = "unknown"
UNEXPECTED: Final = "unexpected"
IGNORED: Final = "ignored"


class NamedBit(Protocol):
    """A row of a bit table."""

    @property
    def number(self) -> int:
        """Its place; 0 is the least significant."""

    @property
    def name(self) -> str:
        """Its name."""


class Cycle(NamedTuple):
    """One bus cycle.

    Attributes:
        when: instant of its latching edge (ps).
        write: whether the host wrote.
        address: 0 up.
        data: the byte.
    """

    when: int
    write: bool
    address: int
    data: int

    def __str__(self) -> str:
        return f"{WRITE if self.write else READ} {self.address:X} {self.data:02X}"


def calls(name: str) -> tuple[str, str]:
    """Return what people call a packet: by its name, or by the last word, ``write FLAG``."""
    return name, name.rpartition(" ")[2]


def cited(clause: str) -> str:
    """Return how a line ends that follows from a clause; "" if it names none."""
    return f"  [{clause}]" if clause else ""


class Packet(NamedTuple):
    """Bus cycles that belong together.

    Attributes:
        kind: ``"packet"``, ``"status"`` (read at any time, belongs to no packet), ``"cut"``,
            ``"unknown"``, ``"unexpected"`` or ``"ignored"`` (the chip did not take it).
        name: mnemonic or register.
        values: what came with it, scaled, flags by name; may be empty.
        clause: clause of the chip's specification, or "".
        cycles: its bus cycles.
    """

    kind: str
    name: str
    values: str
    clause: str
    cycles: tuple[Cycle, ...]

    @property
    def text(self) -> str:
        """Name and values in one line."""
        return f"{self.name} {self.values}" if self.values else self.name

    @property
    def cited(self) -> str:
        """Name, values and clause in one line."""
        return self.text + cited(self.clause)

    @property
    def begin(self) -> int:
        """Instant of its first cycle (ps)."""
        return self.cycles[0].when

    @property
    def end(self) -> int:
        """Instant of its last cycle (ps)."""
        return self.cycles[-1].when


class Decoder:
    """Base of the decoders: bus cycles of one chip in, packets out.

    It knows the bus, not the chip: what the host said, not what came of it.
    """

    FAMILY: str = ""
    WORDS: dict[str, int] = {}
    """Values that can be explained by themselves: name and width in bits."""
    SETTINGS: tuple[str, ...] = ()
    """Settings of the chip that decide how its bus is read; :meth:`configure` takes them."""
    NAMES: tuple[str, ...] = ()
    """Names of packets that are in no table of commands or registers."""
    LOST: frozenset[str] = frozenset()
    """Rules whose breach means that the chip did not take the cycle."""
    APART: frozenset[str] = frozenset()
    """Kinds of packets of one cycle, which nothing around them decides and which decide nothing:
    equal cycles are equal packets."""

    def configure(self, settings: Mapping[str, object]) -> None:
        """Take those of the chip's settings that :attr:`SETTINGS` names."""

    def feed(self, cycle: Cycle, lost: str = "") -> list[Packet]:
        """Take the next bus cycle; return what is complete now.

        Args:
            cycle: the cycle.
            lost: the rule for whose sake the chip has not taken it, if it has not.
        """
        if lost:
            way = "write" if cycle.write else "read"
            what = f"{way} of {cycle.data:02X}H at address {cycle.address:X}H not taken: {lost}"
            return [Packet(IGNORED, what, "", "", (cycle,))]
        return self.take(cycle)

    def take(self, cycle: Cycle) -> list[Packet]:
        """Take a cycle that reached the chip."""
        raise NotImplementedError

    def finish(self) -> list[Packet]:
        """Return what is still open: it was cut short."""
        raise NotImplementedError

    def unfinished(self) -> int | None:
        """Return the instant of the last cycle of the oldest packet still open (ps), if any is.

        No packet that comes later ends before it.
        """
        raise NotImplementedError

    def word(self, name: str, value: int) -> str:
        """Explain one of :attr:`WORDS`.

        Raises:
            ValueError: there is no such word, or the value does not fit into it.
        """
        bits = self.WORDS.get(name)
        if bits is None:
            known = ", ".join(self.WORDS) or "none"
            raise ValueError(f"{self.FAMILY} has no {name!r}; it has {known}")
        # Typed by people: a word that is too long is a slip, and no word to be cut.
        if not 0 <= value < 1 << bits:
            raise ValueError(f"{value:X}H does not fit into the {bits} bits of {name}")
        return self.show_word(name, value)

    def show_word(self, name: str, value: int) -> str:
        """Explain one of :attr:`WORDS` that is known to fit."""
        raise NotImplementedError

    def typed(self, data: list[int]) -> list[Cycle]:
        """Return bytes as people list them as the bus cycles they stand for.

        Raises:
            ValueError: they cannot stand for cycles of this chip.
        """
        raise NotImplementedError


class CommandPackets(Decoder):
    """Command bytes and the words behind them, high byte first.

    A packet is given once all its words have moved; a command before that cuts it short.
    """

    COMMANDS: CommandTable
    COMMAND_PORT: int
    DATA_PORT: int
    CUT_SHORT: str = ""
    """Clause about packets that are cut short."""
    DROPPED: str = ""
    """The text for half a word that was cut off."""
    UNWANTED: str = ""
    """Clause about data that belongs to no packet."""

    def __init__(self) -> None:
        self.row: Command | None = None
        """The command whose packet is open."""
        self.last: str = ""
        """What came before, where no packet is open."""
        self.words: list[int] = []
        self._need: int = 0
        self._half: int = -1
        self._cycles: list[Cycle] = []

    def begin(self, row: Command, cycle: Cycle) -> list[Packet]:
        """Take a command byte; what was open has been finished."""
        self.row = row
        self.words = []
        self._need = row.write + row.read
        self._half = -1
        self._cycles = [cycle]
        return self._complete(row)

    def data(self, cycle: Cycle) -> list[Packet]:
        """Take a cycle at the data port."""
        row = self.row
        # What the chip calls data in the wrong direction: it belongs to no packet.
        if row is None or cycle.write != bool(row.write):
            after = f"inside {row.name}" if row else f"after {self.last or 'no command'}"
            way = "write" if cycle.write else "read"
            what = f"data {way} of {cycle.data:02X}H {after}"
            return [Packet(UNEXPECTED, what, "", self.UNWANTED, (cycle,))]
        self._cycles.append(cycle)
        if self._half < 0:
            self._half = cycle.data
            return []
        self.words.append(self._half << 8 | cycle.data)
        self._half = -1
        # The control word says how many words follow it.
        if row.up_to and len(self.words) == 1:
            self._need = self.words_of(row, self.words[0])
        return self._complete(row)

    def words_of(self, row: Command, control: int) -> int:
        """Return how many words a packet has whose first one is ``control``."""
        raise NotImplementedError

    def _complete(self, row: Command) -> list[Packet]:
        if len(self.words) < self._need:
            return []
        values = self.values(row, self.words) if self.words else ""
        self.row = None
        self.done(row)
        return [Packet(WHOLE, row.name, values, row.clause, tuple(self._cycles))]

    def done(self, row: Command) -> None:
        """A packet is whole."""
        self.last = f"the end of {row.name}"

    def finish(self) -> list[Packet]:
        """Return the packet that is still open: it was cut short."""
        row, self.row = self.row, None
        if row is None:
            return []
        have = f"cut after {len(self.words)} of {self._need} words"
        dropped = self.DROPPED.format(self._half) if self._half >= 0 else ""
        self.last = f"{row.name}, cut short"
        return [Packet(CUT, row.name, have + dropped, self.CUT_SHORT, tuple(self._cycles))]

    def unfinished(self) -> int | None:
        """Return the instant of the last cycle of the packet that is open, if one is."""
        return self._cycles[-1].when if self.row else None

    def values(self, row: Command, words: list[int]) -> str:
        """Return the words of a packet as people read them: one number."""
        value = 0
        for word in words:
            value = value << 16 | word
        if row.signed:
            value = signed(value, 16 * len(words))
        return f"{number(value, row.fraction, row.signed)} {row.unit}".rstrip()

    def typed(self, data: list[int]) -> list[Cycle]:
        """Read a command byte, then as many data bytes as it takes, and so on."""
        cycles: list[Cycle] = []
        # A decoder of their own knows at each byte which command it belongs to, if to any.
        of = type(self)()
        for byte in data:
            if of.row is None:
                cycles.append(Cycle(0, True, self.COMMAND_PORT, byte))
            else:
                cycles.append(Cycle(0, bool(of.row.write), self.DATA_PORT, byte))
            of.take(cycles[-1])
        return cycles


class RegisterPackets(Decoder):
    """Bytes of registers; a register of several bytes is a packet once all of them have moved.

    One of which only some have moved is given a thousand bus cycles later, or at the end.
    """

    ROWS: RegisterMap
    NO_REGISTER: str = ""
    """Clause about addresses at which there is no register."""

    def __init__(self) -> None:
        self._open: dict[tuple[str, bool], tuple[int, dict[int, Cycle]]] = {}
        """Registers of which some bytes have moved: number of the last of their cycles, and all
        of them by address; the one whose last byte is oldest first."""
        self._count: int = 0

    def take(self, cycle: Cycle) -> list[Packet]:
        """Take a cycle that reached the chip."""
        self._count += 1
        return [*self._given_up(), *self._taken(cycle)]

    def _given_up(self) -> list[Packet]:
        for key, (moved, seen) in self._open.items():
            # The oldest stands first: behind it none has waited longer.
            if self._count - moved < PATIENCE:
                break
            del self._open[key]
            return [_partial(self.ROWS[key[0]], seen)]
        return []

    def _taken(self, cycle: Cycle) -> list[Packet]:
        address = self.address(cycle)
        row = self.ROWS.at(address)
        way = "write" if cycle.write else "read"
        if row is None:
            what = f"{way} {address:02X}H, which is no register"
            return [Packet(UNKNOWN, what, f"{cycle.data:02X}H", self.NO_REGISTER, (cycle,))]
        # A byte is a packet at once.
        if len(row.addresses) == 1:
            kind = STATUS if row.name == "STATUS" and not cycle.write else WHOLE
            name = f"{way} {row.name}"
            text = self.value(row, cycle.data, cycle.write)
            return [Packet(kind, name, text, row.clause, (cycle,))]
        key = (row.name, cycle.write)
        _, seen = self._open.pop(key, (0, {}))
        packets = []
        # The same byte again: what came before was only part of the register.
        if address in seen:
            packets.append(_partial(row, seen))
            seen = {}
        seen[address] = cycle
        if len(seen) < len(row.addresses):
            self._open[key] = self._count, seen
        else:
            value = 0
            for place in row.addresses:
                value = value << 8 | seen[place].data
            cycles = tuple(seen.values())
            text = self.value(row, value, cycle.write)
            packets.append(Packet(WHOLE, f"{way} {row.name}", text, row.clause, cycles))
        return packets

    def finish(self) -> list[Packet]:
        """Return the registers of which only some bytes have moved."""
        packets = [_partial(self.ROWS[name], seen) for (name, _), (_, seen) in self._open.items()]
        self._open = {}
        return packets

    def unfinished(self) -> int | None:
        """Return the instant of the oldest last byte of a register that is open, if one is."""
        for _, seen in self._open.values():
            return next(reversed(seen.values())).when
        return None

    def typed(self, data: list[int]) -> list[Cycle]:
        """Read pairs of address and byte written."""
        if len(data) % 2:
            raise ValueError(
                "write pairs of address and data byte; the last address has no data byte"
            )
        pairs = zip(data[::2], data[1::2], strict=True)
        return [Cycle(0, True, address % self.ROWS.size, byte) for address, byte in pairs]

    def address(self, cycle: Cycle) -> int:
        """Return the address a cycle goes to."""
        return cycle.address

    def value(self, row: Register, value: int, write: bool) -> str:
        """Return a register's value as people read it."""
        if row.fields:
            return f"{value:02X}H {flags(value, row.fields)}"
        if row.signed:
            return number(signed(value, row.bits), row.fraction, True)
        if row.fraction or row.bits > 8:
            return number(value, row.fraction)
        return f"{value:02X}H ({value})"


def packets_of(family: str, rows: RegisterMap) -> type[RegisterPackets]:
    """Return a decoder that knows the register map of a family, and no more."""
    return type("Packets", (RegisterPackets,), {"FAMILY": family, "ROWS": rows})


def _partial(row: Register, seen: dict[int, Cycle]) -> Packet:
    cycles = tuple(seen.values())
    way = "write" if cycles[0].write else "read"
    values = " ".join(f"{address:02X}H={cycle.data:02X}H" for address, cycle in seen.items())
    missing = len(row.addresses) - len(seen)
    text = f"{values}, {missing} of {len(row.addresses)} bytes not touched"
    return Packet(CUT, f"{way} {row.name}", text, row.clause, cycles)


# -- values as people read them -----------------------------------------------------------------


def signed(value: int, bits: int) -> int:
    """Return an unsigned number as two's complement of ``bits`` bits."""
    # As in core/bits: a sigrok decoder takes this file along, and not that one.
    return value - (1 << bits) if value >> (bits - 1) & 1 else value


def number(value: int, fraction: int, sign: bool = False) -> str:
    """Return a number with ``fraction`` fraction bits in decimal.

    A fixed-point number keeps four decimals, and at least four digits that tell.
    """
    plus = "+" if sign else ""
    if not fraction:
        return f"{value:{plus}d}"
    scaled = value / (1 << fraction)
    # Four decimals would leave one digit of an acceleration of 15/65536.
    if value and abs(scaled) < 0.1:
        return f"{scaled:{plus}.4g}"
    return f"{scaled:{plus}.4f}"


def flags(value: int, bits: Iterable[NamedBit]) -> str:
    """Return the names of the bits that are set, highest first; ``"-"`` if none is."""
    rows = sorted(bits, key=_place, reverse=True)
    return " ".join(row.name.replace(" ", "_") for row in rows if value >> row.number & 1) or "-"


def _place(row: NamedBit) -> int:
    return row.number
