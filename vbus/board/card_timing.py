"""Whether cycles on a card's bus keep the times of the chips, whatever the address."""

from collections.abc import Iterator, Mapping
from itertools import product
from typing import Final

from vbus.board.card_bus import CardBus
from vbus.board.pin_maps import READ, WRITE
from vbus.chips.base import Chip
from vbus.glue import logic
from vbus.glue.part import GlueBlock
from vbus.signals import HIGH, Net, Z

MOST_UNKNOWN: Final = 8
"""Inputs of one block that may be unknown together: each combination is tried."""


def pin_of(known: Mapping[str, str], role: str) -> str:
    """Return the pin that has a role."""
    return next(pin for pin, mine in known.items() if mine == role)


def has_clock(block: GlueBlock) -> bool:
    """Whether a block follows edges of inputs, not their levels alone."""
    return block.row.through is not None and block.row.function is not logic.transceiver


def outputs(block: GlueBlock, levels: int, driven: int) -> Iterator[int]:
    """Give what each output pin drives."""
    for pin in block.outputs:
        width = pin.net.width
        mask = (1 << width) - 1
        yield levels & mask if driven & mask else Z
        levels >>= width
        driven >>= width


class CardTiming:
    """Judges the way from a connector to the chips.

    Args:
        bus: the connector.
        moving: the nets a cycle moves, by identity.
        blocks: the glue on the way, in order.
        roles: what each pin of the chips behind is in a cycle.
        behind: those chips.
    """

    WIRING = ("*",)

    def __init__(
        self,
        bus: CardBus,
        moving: Mapping[int, Net],
        blocks: list[GlueBlock],
        roles: Mapping[str, Mapping[str, str]],
        behind: list[Chip],
    ) -> None:
        self._bus: CardBus = bus
        self._moving: Mapping[int, Net] = moving
        self._blocks: list[GlueBlock] = blocks
        self._roles: Mapping[str, Mapping[str, str]] = roles
        self._behind: list[Chip] = behind

    def refusal(self) -> str:
        """Say why cycles are played, whatever address: chips of another kind, slow glue."""
        if any(block.row.holds for block in self._blocks):
            return "a reset follows the bus"
        if self._bus.latches:
            return "the address comes on D0-D7 first"
        wait = self._longest()
        edged = [chip for chip in self._behind if chip.on_levels is None]
        if edged:
            if len(edged) < len(self._behind):
                return f"{edged[0].name} wants the edges of its strobes, and others do not"
            return f"{edged[0].name} wants the edges of its strobes after delays" if wait else ""
        for chip in self._behind:
            for write in (False, True):
                edges = chip.strobes(write, 0, 0)
                strobe = pin_of(self._roles[chip.name], WRITE if write else READ)
                fall = next(offset for offset, pin, _ in edges if pin == strobe)
                if self._bus.setup_ps - wait < fall - edges[0][0]:
                    return f"the glue takes {wait} ps, so that {chip.name} has no set-up time left"
                if -fall > self._bus.low_ps:
                    return f"the strobe is shorter than {chip.name} needs it"
                data = [offset for offset, pin, _ in edges if pin == chip.data_pin.name]
                if write and data and data[-1] > self._bus.hold_ps:
                    return f"written data is not held as long as {chip.name} needs it"
        return self._glitch() if wait else ""

    def _longest(self) -> int:
        """Return how long the glue takes to follow an address (ps)."""
        after: dict[int, int] = {}
        for block in self._blocks:
            if has_clock(block):
                continue
            when = block.delay + max(after.get(id(pin.net), 0) for pin, _ in block.inputs)
            for pin in block.outputs:
                after[id(pin.net)] = max(after.get(id(pin.net), 0), when)
        return max(after.values(), default=0)

    def _glitch(self) -> str:
        """Say whether an address that changes could reach a clock or a strobe through delays."""
        known: dict[int, int | None] = dict.fromkeys(self._moving)
        for name in (self._bus.read_strobe, self._bus.write_strobe):
            known[id(self._bus.pins[name].net)] = HIGH
        for block in self._blocks:
            for pin, level in zip(block.outputs, self._ternary(block, known), strict=True):
                known[id(pin.net)] = level
        for block in filter(has_clock, self._blocks):
            for pin, _ in block.inputs:
                if pin.net.width == 1 and known.get(id(pin.net), HIGH) is None:
                    return f"the clock {pin.net.name} may glitch while addresses change"
        for chip in self._behind:
            for name in (pin_of(self._roles[chip.name], role) for role in (READ, WRITE)):
                if known.get(id(chip.pins[name].net), HIGH) is None:
                    return f"{chip.name}.{name} may glitch while addresses change"
        return ""

    @staticmethod
    def _ternary(block: GlueBlock, known: Mapping[int, int | None]) -> list[int | None]:
        levels = [
            pin.net.value >> wire & 1 if id(pin.net) not in known else
            known[id(pin.net)] if pin.net.width == 1 else None
            for pin, wire in block.inputs
        ]  # fmt: skip
        if has_clock(block) or levels.count(None) > MOST_UNKNOWN:
            steady = has_clock(block) and block.row.through == ()
            return [pin.net.value if steady else None for pin in block.outputs]
        found: set[tuple[int, ...]] = set()
        for guess in product((0, 1), repeat=levels.count(None)):
            bits = iter(guess)
            now = tuple(next(bits) if level is None else level for level in levels)
            _, found_levels, driven = block.row.function(now, now, block.state)
            found.add(tuple(outputs(block, found_levels, driven)))
        return [column[0] if len(set(column)) == 1 else None for column in zip(*found, strict=True)]
