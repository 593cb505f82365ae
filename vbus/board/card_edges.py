"""Cycles at chips that want every edge of their strobes: the wires to these move, no others do."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import ClassVar, Final

from vbus.board.card_bus import CardBus
from vbus.chips.base import Chip
from vbus.circuit.strobe_player import StrobePlayer
from vbus.glue.part import GlueBlock
from vbus.kernel import NEVER, Kernel
from vbus.signals import Guard, Net, Pin, Z
from vbus.state import Names

BYTE: Final = -2
"""What a pin drives that carries the byte of a write."""

Levels = list[tuple[Pin, int]]


class EdgeSteps:
    """What drives the wires to such chips in the parts of one cycle.

    Args:
        before: from when the address stands.
        under: while the strobe is low.
        after: from when it has risen.
        over: from when written data has let go.
        source: the data bus on which the byte of a read is, as the strobe rises.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(
        self, before: Levels, under: Levels, after: Levels, over: Levels, source: Net
    ) -> None:
        self.before: Levels = before
        self.under: Levels = under
        self.after: Levels = after
        self.over: Levels = over
        self.source: Net = source


class EdgeGuard(Guard):
    """Watches a data bus on which such chips drive: what they do themselves changes nothing else.

    Args:
        edges: who moves the wires.
        pins: the chips' own pins on the bus.
        touched: told when anybody else moves it.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, edges: CardEdges, pins: list[Pin], touched: Callable[[], None]) -> None:
        self._edges: CardEdges = edges
        self._pins: list[Pin] = pins
        self._levels: list[int] = [pin.level for pin in pins]
        self._touched: Callable[[], None] = touched

    def touched(self) -> None:
        """Tell of it, unless it is a step of a cycle or a chip's own doing."""
        levels = [pin.level for pin in self._pins]
        own, self._levels = levels != self._levels, levels
        if not own and not self._edges.moving:
            self._touched()

    def come_true(self) -> None:
        """The wires here are never owed anything."""

    def cut_short(self) -> None:
        """Hold edges are played."""


class CardEdges:
    """Moves the wires to chips that want every edge, at the instants of the strobes.

    Args:
        kernel: the board's time.
        player: plays the end of a cycle if somebody looks before it.
        bus: the connector.
        chips: those chips.
        nets: the wires that a cycle moves and such chips hear.

    Attributes:
        moving: whether a step is under way.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(
        self, kernel: Kernel, player: StrobePlayer, bus: CardBus, chips: list[Chip], nets: list[Net]
    ) -> None:
        self._kernel: Kernel = kernel
        self._player: StrobePlayer = player
        self._bus: CardBus = bus
        self._low: int = bus.low_ps
        self._hold: int = bus.hold_ps
        self.chips: list[Chip] = chips
        self.nets: list[Net] = nets
        self.moving: bool = False
        self._over: Levels = []
        # Who looks at the board between two cycles finds the end of a write with the player.
        self._timer = kernel.timer(self._let_go, saved=False)

    def watch(self, touched: Callable[[], None]) -> None:
        """Tell when anybody but these chips moves a wire."""
        for net in self.nets:
            pins = [chip.data_pin for chip in self.chips if chip.bus_net is net]
            net.guard = EdgeGuard(self, pins, touched)

    def judged(self) -> None:
        """The cycle has real times."""
        for chip in self.chips:
            chip.judged = True

    def begin(self, steps: EdgeSteps, data: int) -> None:
        """Let the address stand, and what is written."""
        self._move(steps.before, data)

    def run(self, steps: EdgeSteps, write: bool, data: int, when: int) -> int:
        """Let the strobe fall, and come to where it rises; return the byte that is read then."""
        kernel = self._kernel
        kernel.run_until(when - self._low)
        self._move(steps.under, data)
        kernel.run_until(when)
        for chip in self.chips:
            chip.advance()
        kernel.settle()
        taken = data if write else steps.source.value
        self._move(steps.after, data)
        if write:
            self._over = steps.over
            self._timer.at(when + self._hold)
        return taken

    def _move(self, levels: Levels, data: int) -> None:
        moved: list[Net] = []
        for pin, level in levels:
            if level == BYTE:
                level = data
            if pin.level != level:
                pin.level = level
                if pin.net not in moved:
                    moved.append(pin.net)
        if moved:
            self.moving = True
            for net in moved:
                net.resolve()
            self._kernel.settle()
            self.moving = False

    def _let_go(self) -> None:
        self._move(self._over, 0)

    def come_true(self, blocks: list[GlueBlock]) -> None:
        """Leave what is to come of a write to the player, and the wires to the glue."""
        if self._timer.due == NEVER:
            return
        when = self._timer.due
        self._timer.cancel()
        for block in blocks:
            block.look()
        self._player.leave(when, self._bus.data_pin, Z)

    def forget(self) -> None:
        """Another state has been loaded."""
        self._timer.cancel()


def steps_of(
    bus: CardBus,
    pins: list[Pin],
    levels: tuple[Mapping[int, int], Mapping[int, int]],
    carrying: tuple[set[int], set[int]],
    source: Net,
) -> EdgeSteps:
    """Return the steps of one cycle.

    Args:
        bus: the connector.
        pins: what glue and connector drive onto the wires in question.
        levels: what each pin drives, by identity, without and with the strobe.
        carrying: which of them carry the byte that is written, likewise.
        source: the data bus a read takes its byte from.
    """

    def part(number: int, written: bool = True) -> Levels:
        return [
            (pin, BYTE if written and id(pin) in carrying[number] else levels[number][id(pin)])
            for pin in pins
        ]

    return EdgeSteps(part(0), part(1), part(0), part(0, written=False), source)
