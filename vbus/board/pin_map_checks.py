"""What can be wrong with a pin map: port bits, pins, and pins a bus cannot do without."""

from collections.abc import Mapping

from vbus.board.pin_maps import PORT_BIT, PinMap, below, missing, targets, wires
from vbus.board.sections import HostSection, PinMapSection
from vbus.board.settings import listed, quoted, suggestion
from vbus.board.source import Source
from vbus.board.toml_lines import Path
from vbus.chips.base import Chip


class PinMapChecks:
    """Checks pin maps against the chips of the board.

    Args:
        chips: a specimen of each chip that could be read.
        known: the name of every chip, those included that could not be read.
        source: takes the mistakes.
    """

    def __init__(self, chips: Mapping[str, Chip], known: list[str], source: Source) -> None:
        self._chips: Mapping[str, Chip] = chips
        self._known: list[str] = known
        self._source: Source = source

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
        if not section.pins:
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
        for wire in wires(pin_map, self._chips):
            mine = wired.setdefault(wire.chip, {})
            other = mine.setdefault(wire.pin, wire.source)
            if other != wire.source:
                self._fail(
                    (*path, *wire.path),
                    f'"{wire.chip}.{wire.pin}" is wired to {_bit_name(other)} already; a pin'
                    " has one source",
                )
        for chip, mine in wired.items():
            lacking = missing(self._chips[chip], mine)
            if lacking:
                self._fail(
                    path,
                    f'"{chip}" cannot be reached: {listed(lacking)} not wired; wire each to a port'
                    ' bit, or tie it with "low" or "high"',
                )

    def host(
        self, path: Path, host: HostSection, section: PinMapSection, reached: list[str]
    ) -> None:
        """Check that a host reaches the chips its pin map is wired to."""
        if host.card:
            self._fail(path, 'a host has either a "card" or a "pinmap": addresses or port bits')
        meant = section.chips or tuple(self._known)
        pin_map = PinMap(section.name, section.pins, section.low, section.high, meant)
        for chip in dict.fromkeys(wire.chip for wire in wires(pin_map, self._chips)):
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
