"""The stream of what happens on a board: its bus cycles become packets here, once for all."""

import copy
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, Self

from vbus import plugins
from vbus.chips.base import CONNECTOR_FAMILY, Chip
from vbus.chips.packets import UNKNOWN, Cycle, Decoder, Packet
from vbus.core.options import Value
from vbus.core.signals import Observer, Violation

Settings = Mapping[str, Value]
NO_SETTINGS: Final[Mapping[str, Any]] = MappingProxyType({})
"""No settings of a chip, or of any chip."""


class PlainPackets(Decoder):
    """For chips without a decoder: each cycle is shown as it is."""

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


class PacketReader(Observer):
    """An observer that reads packets too.

    The packets that a bus cycle completes come before the cycle itself, and a violation for which
    the chip does not take a cycle before both.
    """

    def reads(self) -> bool:
        """Tell whether packets are wanted: else no cycle is decoded for this observer."""
        return True

    def packet(self, chip: str, packet: Packet) -> None:
        """Read what bus cycles of ``chip`` have said."""


class PacketTaker(PacketReader):
    """Hands each packet, with the name of its chip, to a function."""

    def __init__(self, take: Callable[[str, Packet], object]) -> None:
        self._take: Callable[[str, Packet], object] = take

    def packet(self, chip: str, packet: Packet) -> None:
        """Hand it on."""
        self._take(chip, packet)


class PacketStream(Observer):
    """Makes packets of the bus cycles of a board, or of a journal, and passes all events on.

    Chips written together (``"x+y"``) have a decoder each.

    Args:
        families: chip families by name of chip.
        settings: what :func:`settings_for_decoders` gave for these chips.
        readers: who reads; a board adds and removes them while it runs.
    """

    def __init__(
        self,
        families: Mapping[str, str],
        settings: Mapping[str, Settings] = NO_SETTINGS,
        readers: tuple[PacketReader, ...] = (),
    ) -> None:
        self.readers: tuple[PacketReader, ...] = readers
        self.decoders: dict[str, Decoder] = {
            name: decoder_of(family, settings.get(name, NO_SETTINGS))
            for name, family in families.items()
        }
        self.lost: dict[str, tuple[int, str]] = {}
        """Of cycles that are about to come: instant (ps) and rule, by name of chip."""
        self.latest: int = 0
        """Instant of the latest bus cycle (ps)."""

    @classmethod
    def of(cls, chips: Iterable[Chip], readers: tuple[PacketReader, ...] = ()) -> Self:
        """Return the stream of these chips, from now on."""
        chips = tuple(chips)
        families = {chip.name: chip.FAMILY for chip in chips}
        return cls(families, settings_for_decoders(chips), readers)

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Decode one more cycle, and pass it on."""
        for name, packet in self.decoded(chip, Cycle(when, write, address, data)):
            for reader in self.readers:
                reader.packet(name, packet)
        for reader in self.readers:
            reader.bus_cycle(when, host, chip, write, address, data)

    def decoded(self, chip: str, cycle: Cycle) -> Iterator[tuple[str, Packet]]:
        """Give the packets that a cycle completes, each with the name of its chip."""
        when = self.latest = cycle.when
        for name in chip.split("+") if "+" in chip else (chip,):
            decoder = self.decoders.get(name)
            if decoder is None:
                continue
            instant, rule = self.lost.pop(name, (-1, "")) if self.lost else (-1, "")
            for packet in decoder.feed(cycle, rule) if instant == when else decoder.take(cycle):
                yield name, packet

    def violation(self, violation: Violation) -> None:
        """Pass a breach on; the cycle that is lost for it, if one is, comes next."""
        if self.loses(violation):
            self.lost[violation.chip] = (violation.when, violation.rule)
        for reader in self.readers:
            reader.violation(violation)

    def loses(self, violation: Violation) -> bool:
        """Tell whether the cycle of a breach is lost, which its packet will say."""
        decoder = self.decoders.get(violation.chip)
        return decoder is not None and violation.rule in decoder.LOST

    def fault(self, when: int, name: str, target: str, what: str, text: str) -> None:
        """Pass it on."""
        for reader in self.readers:
            reader.fault(when, name, target, what, text)

    def outside(self, order: str, values: list[object]) -> None:
        """Pass it on."""
        for reader in self.readers:
            reader.outside(order, values)

    def settled(self, now: int) -> None:
        """Pass it on."""
        for reader in self.readers:
            reader.settled(now)

    def unfinished(self) -> int | None:
        """Return the instant of the last cycle of the oldest packet still open (ps), if any is."""
        ends = [decoder.unfinished() for decoder in self.decoders.values()]
        return min((end for end in ends if end is not None), default=None)

    def finish(self, leaves: PacketReader | None = None) -> None:
        """Give what is still open; for a reader that ``leaves``, it stays open for the others."""
        decoders = self.decoders if leaves is None else copy.deepcopy(self.decoders)
        for name, decoder in decoders.items():
            for packet in decoder.finish():
                for reader in self.readers if leaves is None else (leaves,):
                    reader.packet(name, packet)


@dataclass(slots=True)
class CountedLine:
    """A line, and how often it came in a row.

    Attributes:
        when: instant at which it came first (ps).
        text: the line.
        times: how often.
    """

    when: int
    text: str
    times: int = 1

    def counted(self, gap: str = " ") -> str:
        """Return the line with its count behind a gap, if it came more than once."""
        return f"{self.text}{gap}x{self.times}" if self.times > 1 else self.text


class LatestLines(deque[CountedLine]):
    """The latest lines, oldest first; ``maxlen`` says how many."""

    def add(self, when: int, text: str) -> bool:
        """Take a line; tell whether it is the one before again."""
        again = bool(self) and self[-1].text == text
        if again:
            self[-1].times += 1
        else:
            self.append(CountedLine(when, text))
        return again
