"""What can be wrong with a pin map: port bits, pins, and pins a bus cannot do without."""

from collections.abc import Mapping

from msgspec.structs import replace

from vbus.board.card.cards import pins_of
from vbus.board.check.glue_checks import GlueEnds
from vbus.board.pin_maps import (
    DATA_WIRES,
    INTERRUPTS,
    below,
    missing,
    port_bit,
    roles,
    targets,
    wires,
)
from vbus.boardfile.cards import CardSection
from vbus.boardfile.lines import Path
from vbus.boardfile.sections import BoardFile, HostSection, PinMapSection
from vbus.boardfile.source import Mistakes, absent
from vbus.chips.base import Chip
from vbus.core.values.settings import among, listed, quoted


class PinMapChecks:
    """Checks pin maps against the chips of the board.

    Args:
        chips: a specimen of each chip that could be read.
        known: the name of every chip, those included that could not be read.
        file: the board file: its cards, and which hosts have one beside a pin map.
        ends: where its glue ends.
    """

    def __init__(
        self, chips: Mapping[str, Chip], known: list[str], file: BoardFile, ends: GlueEnds
    ) -> None:
        self._chips: Mapping[str, Chip] = chips
        self._known: list[str] = known
        self._driven: frozenset[str] = ends.driven
        self._cards: dict[str, CardSection] = {card.name: card for card in file.cards}
        self._others: dict[str, tuple[str, ...]] = dict(ends.pins)
        for card in file.cards:
            if lines := [row.name for row in pins_of(card) if row.width == 1]:
                self._others[card.name] = (*lines, *(DATA_WIRES if card.bus else ()))
        self._by_card: dict[str, set[str]] = {}
        """The chips that hosts with a pin map reach by a card, by the name of the map."""
        for host in file.hosts:
            if host.pinmap and host.card in self._cards:
                chips_there = self._by_card.setdefault(host.pinmap, set())
                chips_there.update(self._cards[host.card].decoded)

    def check(self, section: PinMapSection) -> Mistakes:
        """Check one map: its names first, and its wires if all of them are known."""
        path: Path = ("pinmaps", section.name)
        wrong = [*self._names(section, path)]
        yield from wrong
        # A pin that is misspelt would be one that is missing, too.
        if not wrong and set(section.chips) <= set(self._known):
            yield from self._wires(path, self._map(section))

    def _map(self, section: PinMapSection) -> PinMapSection:
        return replace(section, chips=section.chips or tuple(self._known))

    def _names(self, section: PinMapSection, path: Path) -> Mistakes:
        meant = section.chips or tuple(self._known)
        bits: dict[str, str] = {}
        ends: list[tuple[Path, str]] = []
        for bit, names in section.pins.items():
            ends += below(bit, names)
            source = port_bit(bit)
            if not source:
                yield (
                    (*path, "pins", bit),
                    f"{quoted(bit)} is no port bit; write PB3 (AVR, STM32) or RB3 (PIC), with ports"
                    " A to L and bits 0 to 15, or IRQ5, an interrupt input of a processor",
                )
            elif bits.setdefault(source, bit) != bit:
                other = bits[source]
                message = f"{bit} is the same port bit as {other}; write one of them"
                yield (*path, "pins", bit), message
        for key, tied in (("low", section.low), ("high", section.high)):
            ends += [((key, place), name) for place, name in enumerate(tied)]
        for where, name in ends:
            if wrong := self._pin(name.removeprefix("!"), meant):
                yield (*path, *where), wrong
        if not section.pins and section.name not in self._by_card:
            yield path, 'it wires nothing; write pins such as PB0 = "/RD" in [pinmaps.NAME.pins]'

    def _pin(self, name: str, meant: tuple[str, ...]) -> str:
        """Return what is wrong with the name of a pin; empty if nothing is."""
        chip, dot, pin = name.partition(".")
        part = self._chips.get(chip)
        if part is None and chip not in self._others:
            if dot:
                return "" if chip in self._known else absent("chips", chip, self._known)
            chips = [self._chips[other] for other in meant if other in self._chips]
            known = list(dict.fromkeys(pin for chip in chips for pin in targets(chip)))
            if len(chips) < len(meant) or name in known:
                return ""
            return f'no chip of this map has a pin "{name}"; {among(name, known, "there are")}'
        known = list(self._others[chip]) if part is None else targets(part)
        if pin in known:
            return ""
        if part is not None and any(row.name == pin and row.wave for row in part.pin_rows):
            return f'"{name}" is a waveform, too fast for a port bit to follow'
        glue = part is None and chip not in self._cards
        more = f'; list a further pin of it in "hosts" of [glue.{chip}]' if glue else ""
        return f'"{chip}" has no pin "{pin}"; {among(pin, known, "it has")}{more}'

    def _wires(self, path: Path, pin_map: PinMapSection) -> Mistakes:
        wired: dict[str, dict[str, str]] = {}
        outputs: dict[str, str] = {}
        for wire in wires(pin_map, self._chips, self._others):
            rows = self._chips[wire.chip].pin_rows if wire.chip in self._chips else ()
            if any(row.name == wire.pin and row.direction == "out" for row in rows):
                mine_too = f"{wire.chip}.{wire.pin}"
                first = outputs.setdefault(wire.source.removeprefix("!"), mine_too)
                if first != mine_too:
                    yield (
                        (*path, *wire.path),
                        f'"{mine_too}" and "{first}" are outputs, which fight on one wire; join'
                        " them by a gate of [glue.NAME], and wire its output to the port bit",
                    )
            mine = wired.setdefault(wire.chip, {})
            other = mine.setdefault(wire.pin, wire.source)
            if other != wire.source:
                yield (
                    (*path, *wire.path),
                    f'"{wire.chip}.{wire.pin}" is wired to {_bit_name(other)} already; a pin'
                    " has one source",
                )
        by_card = self._by_card.get(pin_map.name, set())
        for chip, mine in wired.items():
            if chip not in self._chips:
                continue
            own = roles(self._chips[chip])
            driven = [name for name in own if self._by_glue(chip, name)]
            for name in driven:
                if name in mine and name not in DATA_WIRES:
                    message = f'"{chip}.{name}" is driven by glue; wire the port bit to the glue'
                    yield path, message
            lacking = missing(self._chips[chip], [*mine, *driven])
            both = chip in by_card and any(name in mine for name in own)
            if lacking and (both or chip not in by_card):
                also = ", or leave out all of its bus: a card reaches it, too" if both else ""
                are = "is" if len(lacking) == 1 else "are"
                yield (
                    path,
                    f'"{chip}" cannot be reached: {listed(lacking)} {are} not wired; wire each'
                    f' to a port bit, or tie it with "low" or "high"{also}',
                )

    def _by_glue(self, chip: str, pin: str) -> bool:
        """Whether glue or a card's connector drives a pin, or the data bus it is a wire of."""
        whole = self._chips[chip].data_pin.name if pin in DATA_WIRES else pin
        return f"{chip}.{whole}" in self._driven

    def host(
        self, path: Path, host: HostSection, section: PinMapSection, reached: list[str]
    ) -> Mistakes:
        """Check that a host reaches the chips its pin map is wired to."""
        has_bits = any(port_bit(bit)[:1] != INTERRUPTS for bit in section.pins)
        if has_bits and host.card in self._cards and not self._cards[host.card].memory:
            yield (
                path,
                'a host has either a "card" or a "pinmap": addresses or port bits; both only if the'
                ' card is the memory bus of the microcontroller ("memory = true"), or the map has'
                " only interrupt inputs (IRQ5)",
            )
        found = wires(self._map(section), self._chips, self._others)
        for chip in dict.fromkeys(wire.chip for wire in found):
            if chip not in self._chips and (
                chip not in self._cards or set(self._cards[chip].interrupting) & set(reached)
            ):
                continue
            if chip not in reached and chip != host.card:
                yield (
                    path,
                    f'pin map "{section.name}" is wired to "{chip}", which is not among the chips'
                    f" of this host: {listed(reached)}",
                )


def _bit_name(source: str) -> str:
    if source.lstrip("!") in ("0", "1"):
        return "ground" if source.endswith("0") else "the supply"
    bit = source.lstrip("!")
    return f"IRQ{bit[1:]}" if bit[0] == INTERRUPTS else f"P{bit}"
