"""Which channel of a capture is which pin of a chip."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from vbus.chips.tables import PinRow
from vbus.errors import CaptureError
from vbus.trace.bus_watch import BusWatch
from vbus.trace.names import bit_names, plain

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

    def byte(self, levels: int) -> int:
        """Return the data bus where the channels stand at ``levels``."""
        value = 0
        for place, bit in enumerate(self.data):
            value |= (levels >> bit & 1) << place
        return value


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
    return _Search(channels, chip, rows, watch, wanted).run()


class _Search:
    def __init__(
        self, channels: Sequence[str], chip: str, rows: Sequence[PinRow], watch: BusWatch,
        wanted: Mapping[str, str],
    ) -> None:  # fmt: skip
        self._channels: list[str] = list(channels)
        mine = [plain(name) for name in channels]
        self._spellings: list[list[str]] = [
            list(channels),
            [name.removeprefix(f"{chip}_") if name.startswith(f"{chip}_") else "" for name in mine],
            [name.rpartition(".")[2] for name in channels],
            [name.rpartition("_")[2] for name in mine],
        ]
        """Names as they are, of this chip, without their scope, and the end of them."""
        self._rows: list[PinRow] = [row for row in rows if row.width == 1]
        self._watch: BusWatch = watch
        width = next(row.width for row in rows if row.name == watch.DATA)
        self._data: list[str] = bit_names(watch.DATA, width)
        self._wanted: dict[str, str] = {}
        pins = {_key(row.name): row.name for row in self._rows}
        for bit, name in enumerate(self._data):
            pins[_key(name)] = pins[f"d{bit}"] = name
        self._pins: dict[str, str] = pins
        for name, channel in wanted.items():
            pin = pins.get(_key(name))
            if pin is None:
                known = ", ".join([*self._data, *(row.name for row in self._rows)])
                raise CaptureError(f'map: the chip has no pin "{name}"; it has {known}')
            self._wanted[pin] = channel

    def run(self) -> Wiring:
        wiring = Wiring()
        missing = []
        for name in self._data:
            bit = self._find(name)
            if bit is None:
                missing.append(name)
            else:
                wiring.data.append(bit)
        for row in self._rows:
            tied = self._wanted.get(row.name, "").lower()
            if tied in LEVELS and tied not in (name.lower() for name in self._channels):
                wiring.tied[row.name] = LEVELS[tied]
                continue
            bit = self._find(row.name)
            if bit is not None:
                wiring.bits[row.name] = bit
            elif row.name in self._watch.PINS:
                missing.append(row.name)
        if missing:
            raise CaptureError(
                f"the capture has no channel for {', '.join(missing)}; it has"
                f" {', '.join(self._channels)}. Say which is which with --map PIN=CHANNEL"
            )
        return wiring

    def _find(self, pin: str) -> int | None:
        """Return the channel of a pin, or None."""
        channel = self._wanted.get(pin)
        if channel is not None:
            if channel not in self._channels:
                raise CaptureError(
                    f'map: there is no channel "{channel}"; there are {", ".join(self._channels)}'
                )
            return self._channels.index(channel)
        for names in self._spellings:
            found = [
                bit
                for bit, name in enumerate(names)
                if self._pins.get(_key(name)) == pin and self._free(bit)
            ]
            if len(found) > 1:
                both = ", ".join(self._channels[bit] for bit in found)
                raise CaptureError(
                    f"several channels may be {pin}: {both}; choose with --map {pin}=CHANNEL"
                )
            if found:
                return found[0]
        return None

    def _free(self, bit: int) -> bool:
        return self._channels[bit] not in self._wanted.values()


def _key(name: str) -> str:
    return plain(name).replace("_", "").lower()
