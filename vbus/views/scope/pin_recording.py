"""The pins of one chip, edge by edge, while its board runs: what a logic analyser would see."""

from collections.abc import Callable, Sequence
from typing import Any

from vbus.board.board import Board
from vbus.core.errors import VbusError
from vbus.core.signals import Net, Observer
from vbus.views.scope.frames import ALL, NOW, SAMPLES, Column, frame
from vbus.views.scope.lane import Lane
from vbus.views.scope.lanes import LINE, NUMBER


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
        for net, lane in self._nets:
            if self._lanes[net.name][0] is lane:
                net.observe(self)
        self._note_all()

    def stop(self) -> None:
        """Record no more."""
        for net, lane in self._nets:
            if self._lanes[net.name][0] is lane:
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
        frames = []
        for _, lane in self._nets:
            times, values = lane.take_values()
            if times:
                columns = column([when - times[0] for when in times]), column(values)
                frames.append(frame(SAMPLES, lane.number, len(times), times[0], *columns))
        return [*frames, frame(NOW, ALL, 0, self._board.now)]

    def leave_out(self) -> None:
        """Forget what is new, and take down every level once more: there is no room for it."""
        for _, lane in self._nets:
            lane.forget()
        self._note_all()
