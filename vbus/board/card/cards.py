"""Card adapters: how addresses on a plug-in card select a chip and its ports. Their interrupt: the
outputs wired-OR, a flip-flop that an access clears, a line that cards share."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Final

from msgspec import Struct

from vbus.boardfile.cards import CardSection
from vbus.chips.base import Chip
from vbus.chips.tables import CardRow, PinRow
from vbus.circuit.circuit import Circuit
from vbus.core.signals import HIGH, LOW
from vbus.glue import logic
from vbus.glue.card_buses import BUSES
from vbus.glue.table import OPEN, Block
from vbus.protocols.port import CardAccess

Places = dict[int, CardAccess]
"""What accesses in one direction reach, by address."""

DIRECT = "direct"
"""The decode circuit every chip has: the address lines go straight to it."""

INT: Final = PinRow("/INT", "od", title="interrupt, active low, open collector")
ACK: Final = PinRow("/ACK", "in", title="clears the flip-flop while it is low")


def decodes(chip: Chip | type[Chip]) -> dict[str, tuple[CardRow, ...]]:
    """Return the decode circuits known for a chip, by name: ``direct``, and the manual's own."""
    direct = tuple(CardRow(address, address, address) for address in range(1 << chip.ADDRESS_BITS))
    return {DIRECT: direct, **chip.CARD_DECODES}


def addresses(chip: Chip | type[Chip]) -> set[int]:
    """Return every address at which a card can reach a chip, ports of its adapter included."""
    found: set[int] = set()
    for rows in decodes(chip).values():
        for row in rows:
            found |= {address for address in (row.read, row.write) if address is not None}
    return found


class Card(Struct):
    """Address decoding of a card, as data.

    Attributes:
        name: for messages.
        base: address of the card's first port.
        reads: what reads reach, before any pin is pulsed.
        writes: the same for writes: a port need not do the same in both directions.
        memory: whether programs find it among memory addresses, not I/O ports.
        fixed: where a program expects the memory page of the first port without mapping it, or 0.
        big_endian: whether the byte at the lowest address of a wide access is the most
            significant one.
        interrupt: the outputs, ``"chip.pin"``, that interrupt a program: see :func:`outputs_of`.
        signal: number of the signal an interrupt sends to a program, or 0.
        edge: whether an interrupt that stands ends once the program has had its signal.
        acknowledge: the pin, ``"card./ACK"``, that an access pulses low, or "".
        acknowledge_read: the offset at which a read does so, or -1.
        acknowledge_write: the same for a write.
    """

    name: str
    base: int
    reads: Places
    writes: Places
    memory: bool = False
    fixed: int = 0
    big_endian: bool = False
    interrupt: str = ""
    signal: int = 0
    edge: bool = False
    acknowledge: str = ""
    acknowledge_read: int = -1
    acknowledge_write: int = -1

    def places(self, sides: list[str]) -> list[Places]:
        """Return what reads and what writes reach, in a session with these side pins."""
        found = []
        for rows, at in (
            (self.reads, self.acknowledge_read), (self.writes, self.acknowledge_write),
        ):  # fmt: skip
            mine = dict(rows)
            if at >= 0 and self.acknowledge in sides:
                # An access that clears the flip-flop need not reach a chip.
                reached = rows.get(self.base + at, CardAccess(-1, 0, 0xFF, -1))
                mine[self.base + at] = reached._replace(pulsed=sides.index(self.acknowledge))
            found.append(mine)
        return found

    def text(self, sides: list[str]) -> str:
        """Return the table as HELLO tells it: ``r340=0.1`` and ``w340=0.1``, in hexadecimal.

        Direction and address at the card, number and address of the chip; ``/7F`` behind a read
        are the data bits no chip drives, ``!5`` the side pin, of ``sides``, that the access pulses
        low after it. Where no chip answers there is that alone: ``r344!5``.
        """
        entries = []
        for letter, rows in zip("rw", self.places(sides), strict=True):
            for address, (chip, place, floating, pin) in sorted(rows.items()):
                entry = f"{letter}{address:X}"
                if chip >= 0:
                    entry += f"={chip:X}.{place:X}" + (f"/{floating:02X}" if floating else "")
                entries.append(entry + (f"!{pin:X}" if pin >= 0 else ""))
        return " ".join(entries)

    def program_text(self, number: Callable[[str], int]) -> str:
        """Return what HELLO tells ``vbus exec``: how a program finds the card.

        ``lines`` has a bit for each interrupting output, ``low`` for those that do so when they are
        low.

        Args:
            number: tells which output line of the session has a pin, ``"chip.pin"``, or -1.
        """
        parts = [f"memory={int(self.memory)}", f"fixed={self.fixed}", f"big={int(self.big_endian)}"]
        lines = low = 0
        for output, is_low in outputs_of(self.interrupt):
            if (place := number(output)) >= 0:
                lines |= 1 << place
                low |= is_low << place
        if lines:
            parts += [f"lines={lines}", f"low={low}", f"signal={self.signal}"]
            parts += ["edge=1"] if self.edge else []
        return ";".join(parts)


def outputs_of(interrupt: str) -> list[tuple[str, bool]]:
    """Return the outputs, ``"chip.pin"``, of a card's interrupt, and whether each is active low.

    One is by its name (/ or ~), and the other way round with a ``!`` in front.
    """
    names = [(one.startswith("!"), one.removeprefix("!")) for one in interrupt.split()]
    return [(name, turned != active_low(name.rpartition(".")[2])) for turned, name in names]


def pins_of(card: CardSection) -> tuple[PinRow, ...]:
    """Return the pins a card has on a board: those of its interrupt, and of its connector."""
    own = (INT, ACK) if card.acknowledge else (INT,) if card.has_circuit else ()
    return (*own, *(BUSES[card.bus].pins if card.bus else ()))


def rows_of(
    card: CardSection, chips: Mapping[str, Chip | type[Chip]]
) -> Iterator[tuple[str, list[CardRow]]]:
    """Give the chips behind a card's table, each with its rows, offsets counted in strides."""
    for port in card.ports:
        yield port.chip, [CardRow(port.offset, port.address, port.address)]
    start = 0
    for name in card.chips:
        rows = decodes(chips[name])[card.decode]
        yield name, [CardRow(start + r.offset, r.read, r.write, r.bits) for r in rows]
        start += card.block or max(row.offset for row in rows) + 1


def card_of_rows(
    name: str, base: int, stride: int, blocks: Iterable[tuple[int, Iterable[CardRow]]]
) -> Card:
    """Make a card from the decode rows of its chips.

    Args:
        name: for messages.
        base: address of the card's first port.
        stride: distance between ports that are neighbours in the rows.
        blocks: number of a chip in its session, and its rows, offsets counted from ``base``.
    """
    reads: dict[int, CardAccess] = {}
    writes: dict[int, CardAccess] = {}
    for chip, rows in blocks:
        for row in rows:
            address = base + row.offset * stride
            if row.read is not None:
                reads[address] = CardAccess(chip, row.read, 0xFF & ~row.bits, -1)
            if row.write is not None:
                writes[address] = CardAccess(chip, row.write, 0, -1)
    return Card(name, base, reads, writes)


# -- its interrupt ---------------------------------------------------------------------------------


def active_low(pin: str) -> bool:
    """Tell whether a pin of this name is active when it is low, as in the manuals."""
    return pin[:1] in ("/", "~")


def add_interrupt(board: Circuit, name: str, outputs: list[str], latched: bool, edge: bool) -> None:
    """Put what stands between the outputs of a card that interrupt and its line on a board.

    The outputs are one wire, active as long as one output is. Without a flip-flop ``/INT`` is low
    while the wire is active. With one, ``/INT`` falls when the wire becomes active and rises when
    ``/ACK`` is low; with level sensing ``/INT`` stays low while the wire is active.

    Args:
        board: the board.
        name: the card's name; its pins are ``"name./INT"`` and, latched, ``"name./ACK"``.
        outputs: the outputs of chips that interrupt.
        latched: whether there is a flip-flop.
        edge: whether only an edge sets it.
    """
    pins = [board.find_pin(output) for output in outputs]
    active = tuple([LOW if active_low(pin.name) else HIGH for pin in pins])
    rows = (INT, ACK) if latched else (INT,)
    names = (*outputs, ACK.name) if latched else tuple(outputs)
    block = Block(names, (INT.name,), logic.card_interrupt(active, latched, edge), OPEN)
    borrowed = {output: (pin, 0) for output, pin in zip(outputs, pins, strict=True)}
    board.add_glue(name, rows, (block,), borrowed)
