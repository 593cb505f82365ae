"""Decoders by chip family, and the packets of a whole board while it runs."""

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any, Final

from vbus import plugins
from vbus.chips.base import CONNECTOR_FAMILY, Chip
from vbus.chips.packets import UNKNOWN, Cycle, Decoder, Packet
from vbus.options import Value
from vbus.signals import Observer, Violation

Settings = Mapping[str, Value]
NO_SETTINGS: Final[Mapping[str, Any]] = MappingProxyType({})
"""No settings of a chip, or of any chip."""


class PlainPackets(Decoder):
    """For chips nobody has written a decoder for: each cycle is shown as it is."""

    def take(self, cycle: Cycle) -> list[Packet]:
        """Show the cycle."""
        way, where = "write" if cycle.write else "read", self.where(cycle.address)
        return [Packet(UNKNOWN, f"{way} {where:X}H", f"{cycle.data:02X}H", "", (cycle,))]

    def where(self, address: int) -> int:
        """Return the address that is shown."""
        return address

    def finish(self) -> list[Packet]:
        """Return nothing: no cycle stays open."""
        return []

    def unfinished(self) -> None:
        """Tell of nothing that is open."""


class CardPackets(PlainPackets):
    """For the connector of a card: each cycle with its address on the computer's bus."""

    SETTINGS = ("base", "stride")

    def __init__(self) -> None:
        self._base: int = 0
        self._stride: int = 1

    def configure(self, settings: Mapping[str, object]) -> None:
        """Take where the card is."""
        base, stride = settings.get("base", 0), settings.get("stride", 1)
        self._base = base if isinstance(base, int) else 0
        self._stride = stride if isinstance(stride, int) else 1

    def where(self, address: int) -> int:
        """Return the address on the computer's bus."""
        return self._base + address * self._stride


def decoder_class(family: str) -> type[Decoder] | None:
    """Return what reads the bus of chips of ``family``; None if it is not known."""
    if family == CONNECTOR_FAMILY:
        return CardPackets
    return plugins.family(family).load("packets", Decoder)


def decoder_of(family: str, settings: Settings = NO_SETTINGS) -> Decoder:
    """Return a new decoder for chips of ``family``; one without names if it is not known.

    Args:
        family: the family.
        settings: of the chip: those that its decoder asks for, and perhaps others.
    """
    decoder = (decoder_class(family) or PlainPackets)()
    decoder.configure(settings)
    return decoder


def settings_for_decoders(chips: Iterable[Chip]) -> dict[str, dict[str, Value]]:
    """Return, by name of chip, the settings that decide how its bus is read."""
    found = {}
    for chip in chips:
        names = (decoder_class(chip.FAMILY) or PlainPackets).SETTINGS
        if names:
            given = chip.settings
            found[chip.name] = {name: given[name] for name in names if name in given}
    return found


class BoardPackets(Observer):
    """Packets of every chip of a board, as they are completed.

    Chips written together (``"x+y"``) have a decoder each.

    Args:
        families: chip families by name of chip.
        take: is given the chip's name and each packet.
        settings: what :func:`settings_for_decoders` gave for these chips.
    """

    def __init__(
        self,
        families: Mapping[str, str],
        take: Callable[[str, Packet], None],
        settings: Mapping[str, Settings] = NO_SETTINGS,
    ) -> None:
        self._decoders: dict[str, Decoder] = {
            name: decoder_of(family, settings.get(name, NO_SETTINGS))
            for name, family in families.items()
        }
        self._give: Callable[[str, Packet], None] = take
        self._lost: dict[str, tuple[int, str]] = {}
        """Of cycles that are about to come: instant (ps) and rule, by name of chip."""
        self.latest: int = 0
        """Instant of the latest bus cycle (ps)."""

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Decode one more cycle."""
        self.latest = when
        cycle = Cycle(when, write, address, data)
        for name in chip.split("+") if "+" in chip else (chip,):
            decoder = self._decoders.get(name)
            if decoder is None:
                continue
            instant, rule = self._lost.pop(name, (-1, "")) if self._lost else (-1, "")
            for packet in decoder.feed(cycle, rule) if instant == when else decoder.take(cycle):
                self._give(name, packet)

    def violation(self, violation: Violation) -> None:
        """Remember a breach for which the cycle at this instant is lost: it comes right after."""
        if self.loses(violation):
            self._lost[violation.chip] = (violation.when, violation.rule)

    def loses(self, violation: Violation) -> bool:
        """Tell whether the cycle of a breach is lost, which its packet will say."""
        decoder = self._decoders.get(violation.chip)
        return decoder is not None and violation.rule in decoder.LOST

    def unfinished(self) -> int | None:
        """Return the instant of the last cycle of the oldest packet still open (ps), if any is."""
        ends = [decoder.unfinished() for decoder in self._decoders.values()]
        return min((end for end in ends if end is not None), default=None)

    def finish(self) -> None:
        """Give what is still open."""
        for name, decoder in self._decoders.items():
            for packet in decoder.finish():
                self._give(name, packet)
