"""What a cycle on a card's bus comes to: the terms in which it is worked out."""

from __future__ import annotations

from dataclasses import dataclass, field

from vbus.board.card_edges import Steps
from vbus.chips.base import Chip
from vbus.glue.logic import Levels, Outcome
from vbus.glue.part import GlueBlock
from vbus.signals import Net, Pin


class NotFixed(Exception):
    """What a cycle comes to is not known beforehand; the text says why."""


@dataclass(slots=True)
class Rest:
    """How the wires stand after a cycle at one address.

    Attributes:
        nets: the level of each wire.
        pins: what is driven onto them.
        blocks: what the glue has come to: levels, which are driven, and its inputs.
        clocks: the inputs of registers and resets; while they are the same, none of them moves.
    """

    nets: list[tuple[Net, int]]
    pins: list[tuple[Pin, int]]
    blocks: list[tuple[GlueBlock, int, int, Levels]]
    clocks: tuple[int, ...]


@dataclass(slots=True)
class Cycle:
    """What a cycle comes to.

    Attributes:
        chips: those that are read or written, in the order of the board.
        places: the address at each of them.
        answer: what is read if no chip answers.
        kept: data buses behind transceivers and what is left on each; -1: the byte of the cycle.
        steps: how the wires move to chips that want every edge; None: there are none.
        rest: how the wires stand afterwards; None: the cycle is played.
        why: why it is played.
    """

    chips: list[Chip] = field(default_factory=list)
    places: list[int] = field(default_factory=list)
    answer: int = 0xFF
    kept: list[tuple[Net, int]] = field(default_factory=list)
    steps: Steps | None = None
    rest: Rest | None = None
    why: str = ""


@dataclass(slots=True)
class Phase:
    """Levels in one part of a cycle: of nets and pins, by identity, and what each block gives."""

    nets: dict[int, int]
    pins: dict[int, int]
    outcomes: list[tuple[Levels, Outcome]]
    floating: set[int]
    """Nets that nobody drives and nothing pulls: they keep what was there."""
