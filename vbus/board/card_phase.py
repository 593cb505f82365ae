"""Levels in one part of a cycle on a card's bus, while it is worked out."""

from __future__ import annotations

from msgspec import Struct

from vbus.glue.logic import Levels, Outcome


class Phase(Struct):
    """Levels in one part of a cycle: of nets and pins, by identity, and what each block gives."""

    nets: dict[int, int]
    pins: dict[int, int]
    outcomes: list[tuple[Levels, Outcome]]
    floating: set[int]
    """Nets that nobody drives and nothing pulls: they keep what was there."""
