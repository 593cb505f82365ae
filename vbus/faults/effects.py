"""What the faults that act do, by what they act on."""

from collections.abc import Callable, Collection
from contextlib import suppress
from functools import partial
from typing import ClassVar, Final

from vbus.circuit.circuit import Circuit
from vbus.core.kernel.clock import Course
from vbus.core.signals.wire import WireEnd
from vbus.core.state import Names
from vbus.faults.armed import ACTING, Armed
from vbus.faults.axis import AxisFaults
from vbus.faults.bus import BusFault, Later
from vbus.faults.clock import CLOCKS, ClockFaults
from vbus.faults.glue import Placed, glue_fault
from vbus.faults.row import AXIS, LINK, MESSAGES, ONCE, WIRE, LinkActs, concerned
from vbus.faults.upsets import upsets_of
from vbus.faults.wire import WireFault

AxisRow = tuple[str, bool, int, list[tuple[int, int]]]
"""An axis; whether its plant is wrapped, the counts its pulses hold the encoder off by, and at
which count each fault has begun."""


_PLACED: Final = ("bus", "wire", "glue")
"""Families of faults that are about one bus, one wire or one part."""


class FaultEffects:
    """Begins and ends faults on axes, chips, buses, wires and links.

    Args:
        board: the board.
        later: sets a timer.
        armed: every fault that was ever armed, by number.

    Attributes:
        placed: what is wrong with buses, wires and parts of glue now, by number of fault.
        links: does the faults of links; None on a board without a server.
    """

    STATE: ClassVar[Names] = (
        "courses: list[(str, list[(i64, i64, int, int), ...]), ...]",
        "axes: list[(str, bool, i64, list[(i64, i64), ...]), ...]",
    )
    WIRING: ClassVar[Names] = ("_armed", "links")
    DERIVED: ClassVar[Names] = ("_axes", "_clocks", "placed")

    def __init__(self, board: Circuit, later: Later, armed: dict[int, Armed]) -> None:
        self._board: Circuit = board
        self._later: Later = later
        self._armed: dict[int, Armed] = armed
        self._axes: dict[str, AxisFaults] = {}
        self._clocks: dict[str, ClockFaults] = {}
        self.placed: dict[int, Placed] = {}
        self.links: LinkActs | None = None

    def axis(self, place: str) -> AxisFaults:
        """Return what can be broken behind an axis, ``"x.1"``."""
        found = self._axes.get(place)
        if found is None:
            chip, _, number = place.partition(".")
            found = self._axes[place] = AxisFaults(
                self._board.chip(chip), int(number) - 1, self._board.axes[place],
                partial(self._acting_on, place),
            )  # fmt: skip
        return found

    def clock(self, name: str) -> ClockFaults:
        """Return what can be wrong with the clock of the chip ``name``."""
        found = self._clocks.get(name)
        if found is None:
            chip = self._board.chip(name)
            places = [f"{name}.{axis + 1}" for axis in range(chip.axis_count)]
            plants = [self._board.axes[place] for place in places if place in self._board.axes]
            found = self._clocks[name] = ClockFaults(chip, plants, partial(self._acting_on, name))
        return found

    def begin(self, armed: Armed) -> str:
        """Let a fault act; return what it changes.

        Raises:
            ValueError: it cannot; says why.
        """
        fault, group = armed.fault, self._group(armed)
        if group is not None:
            return group.begin(armed)
        if fault.target == LINK:
            if self.links is None:
                raise ValueError("no link is served: this board has no server, or none yet")
            text = self.links.begin(
                armed.number, armed.name, armed.target, armed.single, armed.values
            )
            return concerned(armed.values) if fault.family == MESSAGES else text
        if fault.family in _PLACED:
            placed = self.placed[armed.number] = self._place(armed)
            return placed.begin()
        return upsets_of(self._board.chip(armed.target)).begin(armed.name, armed.values)

    def end(self, armed: Armed) -> str:
        """Let a fault act no more; return what there is to say about it."""
        fault, group = armed.fault, self._group(armed)
        if group is not None:
            return group.end(armed)
        if fault.target == LINK:
            if self.links is not None:
                self.links.end(armed.number)
        elif fault.family in _PLACED:
            placed = self.placed.pop(armed.number, None)
            if placed is not None:
                placed.end()
        elif fault.acts != ONCE:
            upsets_of(self._board.chip(armed.target)).end(armed.name, armed.values)
        return ""

    def _group(self, armed: Armed) -> AxisFaults | ClockFaults | None:
        """Return what is worked out from all faults of one axis or clock, if it is one of them."""
        if armed.fault.target == AXIS:
            return self.axis(armed.target)
        return self.clock(armed.target) if armed.name in CLOCKS else None

    def serve(self, links: LinkActs | None) -> None:
        """Let ``links`` do the faults of links from now on, those that act already among them."""
        self.links = links
        for armed in self._armed.values() if links is not None else ():
            if armed.fault.target == LINK and armed.state == ACTING:
                with suppress(ValueError):  # the link has no host now
                    self.begin(armed)
                    armed.fired = max(1, armed.fired)

    def _place(self, armed: Armed) -> Placed:
        if armed.fault.family == "bus":
            chip = self._board.chip(armed.target)
            return BusFault(chip, armed.name, armed.values, self._later)
        if armed.fault.target != WIRE:
            return glue_fault(self._board, armed.name, armed.target, armed.values)
        end = self._board.nets[armed.target]
        assert isinstance(end, WireEnd)
        return WireFault(end, self._board.kernel, armed.name, armed.values)

    # -- state --------------------------------------------------------------------------------

    @property
    def axes(self) -> list[AxisRow]:
        """Of each axis, what is no part of the plant's state."""
        return [
            (
                place, axis.wrapper is not None,
                0 if axis.wrapper is None else axis.wrapper.pulsed,
                [(one.number, one.here) for one in axis.acting()],
            )
            for place, axis in sorted(self._axes.items())
            if axis.acting() or axis.wrapper is not None
        ]  # fmt: skip

    @axes.setter
    def axes(self, axes: list[AxisRow]) -> None:
        wrapped = {place: (is_wrapped, pulsed) for place, is_wrapped, pulsed, _ in axes}
        begun = {number: here for _, _, _, heres in axes for number, here in heres}
        for armed in self._armed.values():
            armed.here = begun.get(armed.number, 0)
        for place in sorted({*wrapped, *self._axes}):
            self.axis(place).restore(*wrapped.get(place, (False, 0)))

    @property
    def courses(self) -> list[tuple[str, list[Course]]]:
        """The courses that clocks have taken."""
        clocks = [(name, one.chip.clock.courses) for name, one in sorted(self._clocks.items())]
        return [(name, courses) for name, courses in clocks if courses]

    @courses.setter
    def courses(self, clocks: list[tuple[str, list[Course]]]) -> None:
        courses = dict(clocks)
        for name in sorted({*courses, *self._clocks}):
            self.clock(name).restore(courses.get(name, []))

    def leave(self) -> None:
        """Another state is being loaded: nothing is wrong with a bus, a link or a part any more."""
        for placed in self.placed.values():
            placed.leave()
        self.placed.clear()
        for armed in self._armed.values():
            if armed.fault.target == LINK and self.links is not None:
                self.links.end(armed.number)

    def _acting_on(self, target: str) -> list[Armed]:
        return [one for one in self._armed.values() if one.target == target and one.state == ACTING]

    def wrap(self, places: Collection[str]) -> Callable[[], None]:
        """Wrap the plants of these axes and no others, so that saved states of them fit.

        Returns:
            What wraps them as they were.
        """
        before = {place: axis.wrapper for place, axis in self._axes.items()}
        for place in sorted({*places, *self._axes}):
            self.axis(place).wrap_as(place in places)

        def back() -> None:
            for place, axis in self._axes.items():
                axis.put(before.get(place))

        return back

    def go_on(self, acting: list[Armed]) -> None:
        """Everything is loaded: let what acts on chips, buses and links act again."""
        for chip in self._board.chips:
            upsets = upsets_of(chip)
            for row in upsets.FAULTS:
                on = any(one.name == row.name and one.target == chip.name for one in acting)
                upsets.restore(row.name, on)
        for one in acting:
            if one.fault.family in _PLACED:
                placed = self.placed[one.number] = self._place(one)
                placed.begin(again=True)
        self.serve(self.links)
