"""Pin maps: how the port bits of a microcontroller are wired to the pins of chips."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Final

from msgspec import Struct

from vbus.boardfile.sections import PinMapSection
from vbus.chips.base import Chip
from vbus.glue.part import GluePart

if TYPE_CHECKING:
    from vbus.circuit.host_pins import HostPins

_PORT_BIT: Final = re.compile(r"(?:[PR]([A-L])|IRQ)(1[0-5]|[0-9])")
INTERRUPTS: Final = "M"
"""The port that the interrupt inputs of a processor without ports are to a pin decoder."""

DATA_WIRES: Final = tuple(f"D{number}" for number in range(8))
"""Names of the single wires of D0-D7."""

SELECT, READ, WRITE, LATCH, ADDRESS, DATA, SIDE, OUTPUT = "srwladpo"
LINE, BUS = "cb"
"""A control line, and a wire of a data bus, of a chip whose strobes go through glue."""


def port_bit(name: str) -> str:
    """Return a port bit as the wiring text has it, such as ``B3``; empty if ``name`` is none.

    An AVR or STM32 calls it ``PB3``, a PIC ``RB3``; ``IRQ5`` is an interrupt input of a processor.
    """
    match = _PORT_BIT.fullmatch(name)
    return "" if match is None else (match[1] or INTERRUPTS) + match[2]


class MappedPin(Struct, frozen=True):
    """One end of a pin map: a chip's pin and what drives it.

    Attributes:
        source: ``"B3"`` for a port bit, ``"0"`` or ``"1"`` for a tied pin, with ``!`` in front
            where it is inverted.
        chip: the chip's name, or that of a card whose interrupt it is.
        pin: the pin's name; the wires of D0-D7 are D0 to D7.
        path: where the board file says so, below the pin map's table.
    """

    source: str
    chip: str
    pin: str
    path: tuple[str | int, ...]


def targets(chip: Chip) -> list[str]:
    """Return the pins of ``chip`` that a port bit can be wired to."""
    names = [row.name for row in chip.pin_rows if row.width == 1 and not row.wave]
    return [*DATA_WIRES, *names]


def below(bit: str, names: tuple[str, ...]) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Give what a port bit is wired to, each with its path: one name needs no list."""
    for place, name in enumerate(names):
        yield ("pins", bit) if len(names) == 1 else ("pins", bit, place), name


def wires(
    pin_map: PinMapSection, chips: Mapping[str, Chip], interrupts: Mapping[str, Iterable[str]]
) -> Iterator[MappedPin]:
    """Give every wire of the map; pins that do not exist are left out.

    Args:
        pin_map: the map.
        chips: the chips by name.
        interrupts: the pins of cards' interrupts, by the name of the card.
    """

    def ends(source: str, name: str, path: tuple[str | int, ...]) -> Iterator[MappedPin]:
        inverted = name.startswith("!")
        owner, dot, pin = name.removeprefix("!").partition(".")
        if pin in interrupts.get(owner, ()):
            yield MappedPin("!" * inverted + source, owner, pin, path)
            return
        for chip in [owner] if dot else pin_map.chips:
            if chip in chips and (pin if dot else owner) in targets(chips[chip]):
                yield MappedPin("!" * inverted + source, chip, pin if dot else owner, path)

    for bit, names in pin_map.pins.items():
        source = port_bit(bit)
        for path, name in below(bit, names):
            if source:
                yield from ends(source, name, path)
    for key, level, tied in (("low", "0", pin_map.low), ("high", "1", pin_map.high)):
        for place, name in enumerate(tied):
            yield from ends(level, name, (key, place))


def roles(chip: Chip) -> dict[str, str]:
    """Return what each pin is in a bus cycle, by the chip's bus table.

    The roles are those of the wiring text: ``s`` select, ``r`` and ``w`` strobes, ``l`` a strobe
    that latches the address from D0-D7, ``a0`` the address line, ``d0`` ... the data bus.
    """
    found = {name: f"{DATA}{number}" for number, name in enumerate(DATA_WIRES)}
    bus = chip.BUS
    if bus is None:
        return found
    latches = {line for row in bus.strobes if row.action == "open" for line in row.lines}
    for row in chip.pin_rows:
        if row.select:
            found[row.name] = SELECT
        elif row.name in latches:
            found[row.name] = LATCH
        elif row.name == bus.address:
            found[row.name] = f"{ADDRESS}0"
        elif row.name in bus.lines:
            found[row.name] = WRITE if row.name in bus.low(True) else READ
    return found


def missing(chip: Chip, wired: Iterable[str]) -> list[str]:
    """Return the pins of the host bus that none of ``wired`` is, in the order of the manual."""
    have = set(wired)
    return [name for name in roles(chip) if name not in have]


def wiring(
    pin_map: PinMapSection | None,
    chips: list[Chip],
    decoded: list[Chip],
    glue: list[GluePart],
    pins: HostPins,
) -> str:
    """Return the wiring text of a session, for its host's pin decoder.

    It is a list of ``ROLE=SOURCE`` separated by spaces. The role is a letter of :func:`roles`
    with the number of the chip in the session in front of it, such as ``0r`` or ``1a0``; ``p3`` is
    side pin 3 (PIN), ``o2`` output line 2; a pin that goes both ways is both. See
    :class:`MappedPin` for the source.

    Cycles of a chip with glue before its strobes or select are not worked out by the host: it moves
    control lines, ``c3`` (LINES), and the data bus of that chip, ``0b0`` to ``0b7`` (DRIVE and
    RELEASE, SAMPLE). The same holds for the lines of a card's connector.

    Args:
        pin_map: the map; None: there is none.
        chips: the session's chips.
        decoded: those of them with glue before a strobe or the select.
        glue: what is in front of the chips and behind them.
        pins: what the host has of their nets.
    """
    if pin_map is None:
        return ""
    by_name = {chip.name: chip for chip in chips}
    others = {part.name: part for part in glue}
    buses: dict[int, int] = {}
    for number, chip in enumerate(chips):
        # Chips on one bus have one data bus, called by the first of them.
        buses.setdefault(id(chip.bus_net), number)
    entries: dict[str, None] = {}
    roles_of = {chip.name: roles(chip) for chip in chips}
    for wire in wires(pin_map, by_name, {name: one.pins for name, one in others.items()}):
        role = roles_of.get(wire.chip, {}).get(wire.pin)
        owner = by_name.get(wire.chip)
        behind = owner is not None and (owner in decoded or owner.CONNECTOR)
        if role is not None and not behind:
            entries[f"{chips.index(by_name[wire.chip])}{role}={wire.source}"] = None
            continue
        if role is not None and role[0] == DATA:
            entries[f"{buses[id(by_name[wire.chip].bus_net)]}{BUS}{role[1:]}={wire.source}"] = None
            continue
        if wire.chip in others and wire.pin in others[wire.chip].pins:
            pin, rows = others[wire.chip].pins[wire.pin], others[wire.chip].pin_rows
        else:
            pin, rows = by_name[wire.chip].pins[wire.pin], by_name[wire.chip].pin_rows
        row = next(row for row in rows if row.name == wire.pin)
        both = row.direction == "io"
        kinds = [(SIDE, pins.sides)] if both or row.direction == "in" else []
        kinds += [(OUTPUT, pins.outputs)] if row.direction != "in" else []
        for kind, known in [(LINE, pins.lines)] if row.strobe else kinds:
            for number, other in enumerate(known):
                if other.net is pin.net:
                    entries[f"{kind}{number}={wire.source}"] = None
    return " ".join(entries)
