"""What a cycle on a card's bus comes to: the terms in which it is worked out."""

from __future__ import annotations

from typing import ClassVar

from vbus.board.card_edges import EdgeSteps
from vbus.chips.base import Chip
from vbus.glue.logic import Levels
from vbus.glue.part import GlueBlock
from vbus.signals import Net, Pin
from vbus.state import Names


class NotFixed(Exception):
    """What a cycle comes to is not known beforehand; the text says why."""


class RestingWires:
    """How the wires stand after a cycle at one address.

    Attributes:
        nets: the level of each wire.
        pins: what is driven onto them.
        blocks: what the glue has come to: levels, which are driven, and its inputs.
        clocks: the inputs of registers and resets; while they are the same, none of them moves.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(
        self,
        nets: list[tuple[Net, int]],
        pins: list[tuple[Pin, int]],
        blocks: list[tuple[GlueBlock, int, int, Levels]],
        clocks: tuple[int, ...],
    ) -> None:
        self.nets: list[tuple[Net, int]] = nets
        self.pins: list[tuple[Pin, int]] = pins
        self.blocks: list[tuple[GlueBlock, int, int, Levels]] = blocks
        self.clocks: tuple[int, ...] = clocks


class CardCycle:
    """What a cycle comes to.

    Args:
        chips: those that are read or written, in the order of the board.
        places: the address at each of them.
        answer: what is read if no chip answers.
        kept: data buses behind transceivers and what is left on each; -1: the byte of the cycle.
        steps: how the wires move to chips that want every edge; None: there are none.
        rest: how the wires stand afterwards; None: the cycle is played.
        why: why it is played.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(
        self,
        chips: list[Chip] | None = None,
        places: list[int] | None = None,
        answer: int = 0xFF,
        kept: list[tuple[Net, int]] | None = None,
        steps: EdgeSteps | None = None,
        rest: RestingWires | None = None,
        why: str = "",
    ) -> None:
        self.chips: list[Chip] = chips or []
        self.places: list[int] = places or []
        self.answer: int = answer
        self.kept: list[tuple[Net, int]] = kept or []
        self.steps: EdgeSteps | None = steps
        self.rest: RestingWires | None = rest
        self.why: str = why
