"""What can be wrong with a pin map: port bits, pins, and pins a bus cannot do without."""

from collections.abc import Mapping

from vbus.board.card_interrupt import ACK, INT
from vbus.board.glue_checks import GlueEnds
from vbus.board.pin_maps import DATA_WIRES, PORT_BIT, PinMap, below, missing, roles, targets, wires
from vbus.boardfile.cards import CardSection
from vbus.boardfile.lines import Path
from vbus.boardfile.sections import BoardFile, HostSection, PinMapSection
from vbus.boardfile.source import Source
from vbus.chips.base import Chip
from vbus.values.settings import listed, quoted, suggestion


class PinMapChecks:
    """Checks pin maps against the chips of the board.

    Args:
        chips: a specimen of each chip that could be read.
        known: the name of every chip, those included that could not be read.
        file: the board file: its cards, and which hosts have one beside a pin map.
        ends: where its glue ends.
        source: takes the mistakes.
    """

    def __init__(
        self,
        chips: Mapping[str, Chip],
        known: list[str],
        file: BoardFile,
        ends: GlueEnds,
        source: Source,
    ) -> None:
        self._chips: Mapping[str, Chip] = chips
        self._known: list[str] = known
        self._source: Source = source
        self._driven: frozenset[str] = ends.driven
        self._cards: dict[str, CardSection] = {card.name: card for card in file.cards}
        self._others: dict[str, tuple[str, ...]] = {
            card.name: (INT.name, ACK.name) if card.acknowledge else (INT.name,)
            for card in file.cards
            if card.has_circuit
        } | dict(ends.pins)
        self._by_card: dict[str, set[str]] = {}
        """The chips that hosts with a pin map reach by a card, by the name of the map."""
        for host in file.hosts:
            if host.pinmap and host.card in self._cards:
                chips_there = self._by_card.setdefault(host.pinmap, set())
                chips_there.update(self._cards[host.card].decoded)

    def check(self, section: PinMapSection) -> None:
        """Check one map."""
        path: Path = ("pinmaps", section.name)
        self._sound: bool = True
        for place, chip in enumerate(section.chips):
            self._chip((*path, "chips", place), chip)
        meant = section.chips or tuple(self._known)
        bits: dict[str, str] = {}
        for bit, names in section.pins.items():
            self._bit((*path, "pins", bit), bit, bits)
            for where, name in below(bit, names):
                self._pin((*path, *where), name.removeprefix("!"), meant)
        for key, tied in (("low", section.low), ("high", section.high)):
            for place, name in enumerate(tied):
                self._pin((*path, key, place), name.removeprefix("!"), meant)
        if not section.pins and section.name not in self._by_card:
            self._fail(
                path, 'it wires nothing; write pins such as PB0 = "/RD" in [pinmaps.NAME.pins]'
            )
        if self._sound:
            pin_map = PinMap(section.name, section.pins, section.low, section.high, meant)
            self._wires(path, pin_map)

    def _fail(self, path: Path, message: str) -> None:
        self._sound = False
        self._source.fail(path, message)

    def _chip(self, path: Path, name: str) -> bool:
        if name in self._known:
            return True
        hint = suggestion(name, self._known)
        self._fail(path, f"there is no [chips.{name}]; {hint}this file has {listed(self._known)}")
        return False

    def _bit(self, path: Path, bit: str, bits: dict[str, str]) -> None:
        match = PORT_BIT.fullmatch(bit)
        if match is None:
            self._fail(
                path,
                f"{quoted(bit)} is no port bit; write PB3 (AVR) or RB3 (PIC), with ports A to L and"
                " bits 0 to 7",
            )
            return
        other = bits.setdefault(match[1] + match[2], bit)
        if other != bit:
            self._fail(path, f"{bit} is the same port bit as {other}; write one of them")

    def _pin(self, path: Path, name: str, meant: tuple[str, ...]) -> None:
        chip, dot, pin = name.partition(".")
        if chip in self._others and chip not in self._chips:
            there = self._others[chip]
            if pin not in there:
                hint = suggestion(pin, there)
                self._fail(path, f'"{chip}" has no pin "{pin}"; {hint}it has {listed(there)}')
            return
        if dot:
            if self._chip(path, chip) and chip in self._chips:
                self._exists(path, chip, pin)
            return
        chips = [self._chips[other] for other in meant if other in self._chips]
        if len(chips) < len(meant) or any(name in targets(chip) for chip in chips):
            return
        known = list(dict.fromkeys(pin for chip in chips for pin in targets(chip)))
        hint = suggestion(name, known)
        self._fail(path, f'no chip of this map has a pin "{name}"; {hint}there are {listed(known)}')

    def _exists(self, path: Path, chip: str, pin: str) -> None:
        part = self._chips[chip]
        known = targets(part)
        if pin in known:
            return
        row = next((row for row in part.pin_rows if row.name == pin), None)
        if row is not None and row.wave:
            self._fail(path, f'"{chip}.{pin}" is a waveform, too fast for a port bit to follow')
        else:
            self._fail(
                path, f'"{chip}" has no pin "{pin}"; {suggestion(pin, known)}it has {listed(known)}'
            )

    def _wires(self, path: Path, pin_map: PinMap) -> None:
        wired: dict[str, dict[str, str]] = {}
        for wire in wires(pin_map, self._chips, self._others):
            mine = wired.setdefault(wire.chip, {})
            other = mine.setdefault(wire.pin, wire.source)
            if other != wire.source:
                self._fail(
                    (*path, *wire.path),
                    f'"{wire.chip}.{wire.pin}" is wired to {_bit_name(other)} already; a pin'
                    " has one source",
                )
        by_card = self._by_card.get(pin_map.name, set())
        for chip, mine in wired.items():
            if chip not in self._chips:
                continue
            driven = [name for name in roles(self._chips[chip]) if self._by_glue(chip, name)]
            for name in driven:
                if name in mine and name not in DATA_WIRES:
                    self._fail(
                        path,
                        f'"{chip}.{name}" is driven by glue; wire the port bit to the glue',
                    )
            lacking = missing(self._chips[chip], [*mine, *driven])
            if chip in by_card:
                own = [name for name in roles(self._chips[chip]) if name in mine]
                if own:
                    self._fail(
                        path,
                        f'"{chip}" is on the card of a host with this map: leave out {listed(own)}',
                    )
            elif lacking:
                self._fail(
                    path,
                    f'"{chip}" cannot be reached: {listed(lacking)} not wired; wire each to a port'
                    ' bit, or tie it with "low" or "high"',
                )

    def _by_glue(self, chip: str, pin: str) -> bool:
        """Whether glue or a card's connector drives a pin, or the data bus it is a wire of."""
        whole = self._chips[chip].data_pin.name if pin in DATA_WIRES else pin
        return f"{chip}.{whole}" in self._driven

    def host(
        self, path: Path, host: HostSection, section: PinMapSection, reached: list[str]
    ) -> None:
        """Check that a host reaches the chips its pin map is wired to."""
        if host.card in self._cards and not self._cards[host.card].memory:
            self._fail(
                path,
                'a host has either a "card" or a "pinmap": addresses or port bits; both only if the'
                ' card is the memory bus of the microcontroller ("memory = true")',
            )
        meant = section.chips or tuple(self._known)
        pin_map = PinMap(section.name, section.pins, section.low, section.high, meant)
        found = wires(pin_map, self._chips, self._others)
        for chip in dict.fromkeys(wire.chip for wire in found):
            if chip not in self._chips and (
                chip not in self._cards or set(self._cards[chip].interrupting) & set(reached)
            ):
                continue
            if chip not in reached:
                self._fail(
                    path,
                    f'pin map "{section.name}" is wired to "{chip}", which is not among the chips'
                    f" of this host: {listed(reached)}",
                )


def _bit_name(source: str) -> str:
    if source.lstrip("!") in ("0", "1"):
        return "ground" if source.endswith("0") else "the supply"
    return f"P{source.lstrip('!')}"
