"""Edges of a chip's pins as frames, and as the samples that a logic analyser hands over."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

from vbus.board.board import Board
from vbus.core.errors import VbusError
from vbus.core.kernel import SECOND
from vbus.core.signals import Net, Observer
from vbus.views.scope.frames import ALL, NOW, Column, frame
from vbus.views.scope.lane import Lane
from vbus.views.scope.lanes import LINE, NUMBER
from vbus.views.scope.recording import Ticks, sample_frames
from vbus.views.scope.rows import Rows


class PinRecorder(Observer):
    """Records pins of a chip from :meth:`start` to :meth:`stop`.

    A bus that is recorded is played strobe by strobe.

    Args:
        board: the board.
        chip: name of the chip; "" where there is only one.
        pins: names of pins; none: the host bus first, then the others.

    Raises:
        VbusError: there is no such chip or pin; says what there is.
    """

    def __init__(self, board: Board, chip: str = "", pins: Sequence[str] = ()) -> None:
        chips = {one.name: one for one in board.chips}
        if not chip and len(chips) == 1:
            (chip,) = chips
        if chip not in chips:
            raise VbusError(f'no chip is called "{chip}"; there are {", ".join(chips)}')
        known = chips[chip].pins
        for name in pins:
            if name not in known:
                raise VbusError(f"{chip} has no pin {name}; there are {', '.join(known)}")
        bus = [pin.name for pin in chips[chip].bus_pins]
        chosen = dict.fromkeys(pins or (*bus, *known))
        self._board: Board = board
        self._chip: str = chip
        self._nets: list[tuple[Net, Lane]] = [
            (net, Lane(number, None, name, name, LINE if net.width == 1 else NUMBER))
            for number, (name, net) in enumerate((name, known[name].net) for name in chosen)
        ]
        self._lanes: dict[str, list[Lane]] = {}
        for net, lane in self._nets:
            self._lanes.setdefault(net.name, []).append(lane)

    def described(self) -> dict[str, Any]:
        """Return what there is: a row for each pin, and how many wires it has."""
        return {
            "board": self._board.name, "chip": self._chip, "axes": [],
            "now": str(self._board.now),
            "lanes": [{**lane.described(), "width": net.width} for net, lane in self._nets],
        }  # fmt: skip

    def start(self) -> None:
        """Begin to record."""
        for net in dict(self._nets):
            net.observe(self)
        self._note_all()

    def stop(self) -> None:
        """Record no more."""
        for net in dict(self._nets):
            net.unobserve(self)

    def edge(self, when: int, net: str, level: int) -> None:
        """Take down an edge."""
        for lane in self._lanes[net]:
            lane.note(when, level)

    def _note_all(self) -> None:
        for net, lane in self._nets:
            lane.note(self._board.now, net.value)

    def take(self, column: Callable[[Sequence[float]], Column]) -> list[bytes]:
        """Return what is new as frames, and how far time has come last.

        Args:
            column: how numbers are written.
        """
        ticks = Ticks(column)
        lanes = [lane for _, lane in self._nets if lane.times]
        frames = [one for lane in lanes for one in sample_frames(lane, column, ticks)]
        return [*frames, frame(NOW, ALL, 0, self._board.now)]

    def leave_out(self) -> None:
        """Forget what is new, and take down every level once more: there is no room for it."""
        for _, lane in self._nets:
            lane.forget()
        self._note_all()


# A pause of seconds is megabytes of equal samples: they are handed over in parts.
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
        self._places: dict[Lane, tuple[int, int]] = {}
        """By lane: place of its first bit, and the mask of its bits there."""
        place = 0
        for lane, one in zip(self._rows.lanes, description["lanes"], strict=True):
            # Pins beyond the width of a sample get an empty mask, and are left out.
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
        # Rounded up, from the beginning each time: no sample is lost to rounding.
        due = -(-(when - self._begin) * self._rate // SECOND)
        left = due - self._made
        if left > 0:
            self._made = due
            sample = self._levels.to_bytes(self._width, "little")
            most = MOST_BYTES // self._width
            while left > 0:
                yield sample * min(left, most)
                left -= most
