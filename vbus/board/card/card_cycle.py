"""What a cycle on a card's bus has come to, and how the wires stand between two cycles."""

from __future__ import annotations

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.board.card.card_bus import MOST
from vbus.chips.base import Chip
from vbus.core.signals import Net, Pin
from vbus.core.state import Names
from vbus.glue.part import GlueBlock

BYTE: Final = -2
"""The level of what carries the byte of a write, or of a data bus that keeps what was there."""

Levels = list[tuple[Pin, int]]


class WireState:
    """How all stands that a cycle moves.

    Attributes:
        nets: the level of each wire.
        pins: what is driven onto them.
        blocks: what the glue holds.
        cycles: what is remembered of cycles from here, by address and way; None: nothing yet.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(
        self, nets: list[tuple[Net, int]], pins: Levels, blocks: list[tuple[GlueBlock, int]]
    ) -> None:
        self.nets: list[tuple[Net, int]] = nets
        self.pins: Levels = pins
        self.blocks: list[tuple[GlueBlock, int]] = blocks
        self.cycles: list[CardCycle | None] = [None] * (2 * MOST)

    def come_true(self, data: int) -> None:
        """Set all nets, pins and blocks, without edges or events.

        Args:
            data: the byte that is written; -1: a data bus keeps what was there.
        """
        for net, level in self.nets:
            if level == BYTE:
                level = data if data >= 0 else net.value
            net.put(level)
        for pin, level in self.pins:
            pin.level = data if level == BYTE else level
        for block, state in self.blocks:
            block.stand(state)


class CardCycle:
    """What a cycle comes to, as it was seen while it was played.

    Args:
        chips: those that are read or written, in the order of the reports.
        places: the address at each of them.
        fall: how long before its end a read begins at the chip (ps).
        answer: what is read if no chip answers.
        kept: data buses that float afterwards and what is left on each; BYTE: that of the cycle.
        steps: for chips that want every edge, what moves the wires to them: when, counted from the
            latching edge, and to which levels.
        source: the data bus of the chip that answers such a read; None: there is none.
        after: how the wires stand afterwards; with steps, before written data has let go. None:
            cycles like this are played.
        by_byte: what is written decides: the cycle for each byte.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(
        self,
        chips: list[Chip] | None = None,
        places: list[int] | None = None,
        fall: int = 0,
        answer: int = 0xFF,
        kept: list[tuple[Net, int]] | None = None,
        steps: list[tuple[int, Levels]] | None = None,
        source: Net | None = None,
        after: WireState | None = None,
        by_byte: dict[int, CardCycle] | None = None,
    ) -> None:
        self.chips: list[Chip] = chips or []
        self.places: list[int] = places or []
        self.chip: Chip | None = chips[0] if chips else None
        self.place: int = places[0] if places else 0
        self.fall: i64 = fall
        self.answer: int = answer
        self.kept: list[tuple[Net, int]] = kept or []
        self.steps: list[tuple[int, Levels]] | None = steps
        self.source: Net | None = source
        self.after: WireState | None = after
        self.by_byte: dict[int, CardCycle] | None = by_byte
