"""What a card has beside chips, as parts of glue: selects by address, and registers of its own."""

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Final

from msgspec import Struct

from vbus.board.card.cards import active_low
from vbus.board.glue_order import Fail, Planned
from vbus.boardfile.cards import CardRegisterSection, CardSection
from vbus.boardfile.lines import Path
from vbus.chips.tables import PinRow
from vbus.core.signals import HIGH, LOW
from vbus.core.values.settings import among
from vbus.glue import logic
from vbus.glue.card_buses import BUSES, DATA, BusRow
from vbus.glue.part import bundled
from vbus.glue.table import THREE_STATE, Block, pins

_READ, _WRITE, _RESET = ".read", ".write", "RESET"
"""Inside a register: the strobes where it is selected, and its reset."""
_BITS: Final = bundled(DATA)
_INPUTS: Final = pins("I0-I7")
_OUTPUTS: Final = pins("Q0-Q7")
_ENABLES: Final = pins("E0-E7")
INT: Final = "INT"

_PINS: Final[dict[str, tuple[tuple[str, ...], tuple[str, ...]]]] = {
    "latch": ((), _OUTPUTS),
    "status": (_INPUTS, ()),
    "fixed": ((), ()),
    "pending": ((*_INPUTS, *_ENABLES), (INT,)),
}
"""Inputs and outputs of each kind of register."""


class CardPart(Struct, frozen=True):
    """A part of a card.

    Attributes:
        part: as it will stand on the board; lines of the connector are taps.
        wires: what its pins are wired to.
        path: where the file says so.
    """

    part: Planned
    wires: Mapping[str, tuple[str, ...]]
    path: Path


class CardPartError(ValueError):
    """A part of a card cannot be made; ``path`` is where, below the card's table."""

    def __init__(self, path: Path, text: str) -> None:
        super().__init__(text)
        self.path: Path = path


def names_of(card: CardSection) -> Iterator[tuple[Path, str]]:
    """Give the names of a card's parts, each with its place in the file."""
    path: Path = ("cards", card.name)
    if card.selects:
        yield (*path, "selects"), f"{card.name}-selects"
    for row in card.registers:
        yield (*path, "registers", row.name), row.name


def parts_of(card: CardSection, fail: Fail) -> Iterator[CardPart]:
    """Give the parts of a card; ``fail`` takes each that cannot be made."""
    makers = [partial(_register, card, row) for row in card.registers]
    for make in ([partial(_selects, card)] if card.selects else []) + makers:
        try:
            yield make()
        except CardPartError as error:
            fail(("cards", card.name, *error.path), str(error))


def _selects(card: CardSection) -> CardPart:
    """Return what selects by address."""
    bus = BUSES[card.bus]
    inputs = (*bus.address, *_idle(bus))
    blocks, wires = [], {}
    for name, ranges in card.selects.items():
        output = name.removeprefix("!").strip()
        if output in wires:
            raise CardPartError(("selects", name), f'"{output}" stands here twice; join its ranges')
        where = _addresses(card, name, ranges)
        low = name.startswith("!") or active_low(output.rpartition(".")[2])
        function = logic.selected(where, bus.lines, LOW if low else HIGH)
        blocks.append(Block(inputs, (output,), function))
        wires[output] = (output,)
    rows = tuple(PinRow(output, "out") for output in wires)
    part = Planned(f"{card.name}-selects", 0, rows, tuple(blocks), _lines(card, inputs), {})
    return CardPart(part, wires, ("cards", card.name, "selects"))


def _idle(bus: BusRow) -> tuple[str, ...]:
    """Return the lines that must be low for an address to be one of the processor's."""
    return tuple(line for line in bus.steady if line != _RESET)


def _lines(card: CardSection, names: tuple[str, ...]) -> dict[str, tuple[str, int]]:
    return {name: (f"{card.name}.{name}", 0) for name in names}


def _addresses(card: CardSection, name: str, ranges: tuple[str, ...]) -> frozenset[int]:
    bus, found = BUSES[card.bus], set[int]()
    for text in ranges:
        first, dash, last = (part.strip() for part in text.partition("-"))
        try:
            begin = int(first, 0)
            end = int(last, 0) if dash else begin
        except ValueError:
            raise CardPartError(
                ("selects", name),
                f'found "{text}"; write distances from the base, in strides: "0-1", or "0x0C"',
            ) from None
        if not 0 <= begin <= end < card.size:
            raise CardPartError(
                ("selects", name),
                f'found "{text}"; this card has ports 0 to {card.size - 1} (size = {card.size})',
            )
        found |= {bus.on_lines(card.address(port)) for port in range(begin, end + 1)}
    if not found:
        raise CardPartError(("selects", name), 'it has no addresses; write some, such as "0-1"')
    return frozenset(found)


def _register(card: CardSection, row: CardRegisterSection) -> CardPart:
    """Return one register of a card."""
    path: Path = ("registers", row.name)
    bus = BUSES[card.bus]
    inputs, outputs = _PINS[row.kind]
    _check(row, path, card.size, (*inputs, *outputs))
    strobes = bus.strobes_of(card.memory)
    where = (*bus.address, *_idle(bus))
    values = bytes.fromhex(row.values) or b"\0"
    places = [bus.on_lines(card.address(row.at + n)) for n in range(len(values))]
    select = Block((*strobes, *where), (_READ, _WRITE), logic.strobed(frozenset(places), bus.lines))
    written = (_RESET, _WRITE, *_BITS)
    kept = Block(written, _OUTPUTS, logic.card_latch(row.reset), through=(_RESET,))
    blocks, shown = [select], _OUTPUTS
    if row.kind == "latch":
        blocks.append(kept)
    elif row.kind == "pending":
        level = row.sense == "level"
        through = (_RESET, *_INPUTS) if level else (_RESET,)
        blocks += [
            Block((*written, *_INPUTS), _OUTPUTS, logic.pending(level), through=through),
            Block((*_OUTPUTS, *_ENABLES), (INT,), logic.enabled),
        ]
    elif row.kind == "status":
        shown = _INPUTS
    if row.kind == "fixed":
        known = dict(zip(places, values, strict=True))
        blocks.append(Block((_READ, *bus.address), _BITS, logic.stored(known), THREE_STATE))
    elif row.kind != "latch" or row.read_back:
        blocks.append(Block((_READ, *shown), _BITS, logic.driver(LOW, 8), THREE_STATE))
    wires = {**row.pins, **dict.fromkeys(row.hosts, ())}
    made = {name for block in blocks for name in block.outputs}
    tied = dict.fromkeys((pin for pin in _INPUTS if pin in inputs), LOW)
    tied |= dict.fromkeys((pin for pin in _ENABLES if pin in inputs), HIGH)
    tied |= dict.fromkeys(row.low, LOW) | dict.fromkeys(row.high, HIGH)
    tied |= {} if _RESET in bus.steady else {_RESET: LOW}
    taps = _lines(card, (*strobes, *where, *([_RESET] if _RESET in bus.steady else [])))
    taps |= {bit: (f"{card.name}.{DATA}", n) for n, bit in enumerate(_BITS)}
    shows = bool(made & {*_BITS})
    rows = [PinRow(pin, "out" if pin in outputs else "in") for pin in wires]
    rows += [PinRow(DATA, "io", width=8)] if shows else []
    hidden = [pin for pin in sorted(made) if pin not in wires and pin not in _BITS]
    inner = [PinRow(pin, "out") for pin in hidden]
    part = Planned(
        row.name, 0, tuple(rows), tuple(blocks), taps,
        {pin: level for pin, level in tied.items() if pin not in wires}, tuple(inner),
    )  # fmt: skip
    if shows:
        wires[DATA] = (f"{card.name}.{DATA}",)
    return CardPart(part, wires, ("cards", card.name, *path, "pins"))


def _check(row: CardRegisterSection, path: Path, size: int, known: tuple[str, ...]) -> None:
    inputs, _ = _PINS[row.kind]
    length = 1
    if row.kind == "fixed":
        try:
            length = len(bytes.fromhex(row.values))
        except ValueError:
            length = 0
        if not length:
            raise CardPartError(
                (*path, "values"), f'found "{row.values}"; write hexadecimal bytes, such as "5A 01"'
            )
    if row.at + length > size:
        raise CardPartError((*path, "at"), f"found {row.at}; this card has ports 0 to {size - 1}")
    for key, names in (
        ("pins", row.pins), ("hosts", row.hosts), ("low", row.low), ("high", row.high),
    ):  # fmt: skip
        for name in names:
            fits = inputs if key in ("low", "high") else known
            if name not in fits:
                raise CardPartError(
                    (*path, key),
                    f'a register of kind "{row.kind}" has no pin "{name}" here;'
                    f" {among(name, fits, 'it has')}",
                )
            if key != "pins" and (name in row.pins or (key != "hosts" and name in row.hosts)):
                raise CardPartError((*path, key), f'"{name}" is wired already')
