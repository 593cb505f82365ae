"""Lines as samples: what a logic analyser hands over, at the rate it was asked for."""

from collections.abc import Iterator
from typing import Any, Final

from vbus.core.kernel import SECOND
from vbus.views.scope.rows import LaneTold, Rows

MOST_BYTES: Final = 1 << 16
"""Of samples that are given together."""


class Sampler:
    """Makes samples of the frames of a :class:`~vbus.views.scope.pin_recording.PinRecorder`.

    A sample has the levels there are at its instant; bit 0 is the first pin's first wire.

    Args:
        description: what the recorder says.
        rate: samples each second of chip time.
        width: bytes of a sample, low byte first; pins that do not fit are left out.
    """

    def __init__(self, description: dict[str, Any], rate: int, width: int) -> None:
        self._rows: Rows = Rows(description)
        self._rate: int = rate
        self._width: int = width
        self._begin: int = int(description["now"])
        self._made: int = 0
        self._levels: int = 0
        self._places: dict[LaneTold, tuple[int, int]] = {}
        """By lane: place of its first bit, and the mask of its bits there."""
        place = 0
        for lane, one in zip(self._rows.lanes, description["lanes"], strict=True):
            mask = (1 << one["width"]) - 1 << place
            self._places[lane] = place, mask & (1 << 8 * width) - 1
            place += one["width"]

    def take(self, frames: bytes) -> Iterator[bytes]:
        """Give the samples up to where the frames end."""
        for when, lane, value in self._rows.take(frames):
            yield from self._until(when)
            place, mask = self._places[lane]
            self._levels = self._levels & ~mask | int(value) << place & mask
        yield from self._until(self._rows.now)

    def _until(self, when: int) -> Iterator[bytes]:
        """Give the samples whose instants lie before ``when``."""
        due = -(-(when - self._begin) * self._rate // SECOND)
        left = due - self._made
        if left > 0:
            self._made = due
            sample = self._levels.to_bytes(self._width, "little")
            most = MOST_BYTES // self._width
            while left > 0:
                yield sample * min(left, most)
                left -= most
