"""Which channel of a capture is which pin of a chip."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from vbus.chips.bus_watch import BusWatch
from vbus.chips.tables import PinRow
from vbus.core.errors import CaptureError
from vbus.views.silicon.capture import UNKNOWN
from vbus.views.wave.signals import bit_names, plain

LEVELS: Final = {"low": 0, "high": 1}
"""What a control line that was not captured may be said to be tied to."""


@dataclass
class Wiring:
    """Channels by pin.

    Attributes:
        data: channels of D0 to D7.
        bits: channel by one-wire pin.
        tied: level by pin that was not captured.
    """

    data: list[int] = field(default_factory=list)
    bits: dict[str, int] = field(default_factory=dict)
    tied: dict[str, int] = field(default_factory=dict)

    def level(self, pin: str, levels: int) -> int:
        """Return the level of a pin where the channels stand at ``levels``."""
        bit = self.bits.get(pin)
        return self.tied[pin] if bit is None else levels >> bit & 1

    def unknown(self, pin: str, levels: int) -> bool:
        """Tell whether the level of a pin is unknown (x or z) where the channels stand so."""
        return (
            bool(levels >> UNKNOWN)
            and pin in self.bits
            and bool(levels >> UNKNOWN + self.bits[pin] & 1)
        )

    def byte(self, levels: int) -> int:
        """Return the data bus where the channels stand at ``levels``."""
        value = 0
        for place, bit in enumerate(self.data):
            value |= (levels >> bit & 1) << place
        return value

    def unknown_bits(self, levels: int) -> int:
        """Return which bits of the data bus are unknown where the channels stand at ``levels``."""
        return self.byte(levels >> UNKNOWN) if levels >> UNKNOWN else 0


def wiring_of(
    channels: Sequence[str], chip: str, rows: Sequence[PinRow], watch: BusWatch,
    wanted: Mapping[str, str],
) -> Wiring:  # fmt: skip
    """Return which channel is which pin.

    A channel belongs to the pin whose name it has, in the manual's spelling or a plain one, with
    or without something before it: ``/CS``, ``cs``, ``x_CS``, ``x./CS``. ``wanted`` goes before.

    Args:
        channels: names of the capture's channels.
        chip: name of the chip: ``x_CS`` belongs to ``x`` rather than ``y_CS``.
        rows: the chip's pins.
        watch: the family's bus: its pins are needed, others may be missing.
        wanted: channel by pin, or "low" or "high" for a control line that is tied to it.

    Raises:
        CaptureError: a pin of the bus has no channel, or several; or a name is not known.
    """
    bus = watch.table.data
    data = bit_names(bus, next(row.width for row in rows if row.name == bus))
    lines = [row.name for row in rows if row.width == 1]
    pins = {_key(name): name for name in lines}
    # d0 to d7 for every family: that is what people call them on an analyser.
    for bit, name in enumerate(data):
        pins[_key(name)] = pins[f"d{bit}"] = name
    chosen = {}
    for name, channel in wanted.items():
        if _key(name) not in pins:
            known = ", ".join([*data, *lines])
            raise CaptureError(f'map: the chip has no pin "{name}"; it has {known}')
        chosen[pins[_key(name)]] = channel
    mine = [plain(name) for name in channels]
    # Names as they are, of this chip, without their scope, and the end of them.
    spellings = [
        [*channels],
        [name.removeprefix(f"{chip}_") if name.startswith(f"{chip}_") else "" for name in mine],
        [name.rpartition(".")[2] for name in channels],
        [name.rpartition("_")[2] for name in mine],
    ]

    def channel_of(pin: str) -> int:
        """Return the channel of a pin, or -1."""
        if pin in chosen:
            if chosen[pin] not in channels:
                raise CaptureError(
                    f'map: there is no channel "{chosen[pin]}"; there are {", ".join(channels)}'
                )
            return channels.index(chosen[pin])
        for names in spellings:
            found = [
                bit
                for bit, name in enumerate(names)
                if pins.get(_key(name)) == pin and channels[bit] not in chosen.values()
            ]
            # Guessing between two would compare the wrong wire without a word.
            if len(found) > 1:
                both = ", ".join(channels[bit] for bit in found)
                raise CaptureError(
                    f"several channels may be {pin}: {both}; choose with --map {pin}=CHANNEL"
                )
            if found:
                return found[0]
        return -1

    wiring = Wiring([channel_of(name) for name in data])
    names_of_channels = {name.lower() for name in channels}
    for name in lines:
        tied = chosen.get(name, "").lower()
        if tied in LEVELS and tied not in names_of_channels:
            wiring.tied[name] = LEVELS[tied]
        elif (bit := channel_of(name)) >= 0:
            wiring.bits[name] = bit
    missing = [name for name, bit in zip(data, wiring.data, strict=True) if bit < 0]
    missing += [
        name
        for name in lines
        if name in watch.PINS and name not in wiring.bits and name not in wiring.tied
    ]
    if missing:
        raise CaptureError(
            f"the capture has no channel for {', '.join(missing)}; it has"
            f" {', '.join(channels)}. Say which is which with --map PIN=CHANNEL"
        )
    return wiring


def _key(name: str) -> str:
    return plain(name).replace("_", "").lower()
