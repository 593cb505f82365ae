"""Those who see everything and change nothing."""

from collections.abc import Callable
from typing import ClassVar

from mypy_extensions import mypyc_attr

from vbus.core.signals.violation import Violation
from vbus.core.state import Names


@mypyc_attr(allow_interpreted_subclasses=True)
class Observer:
    """Base of journals, waveforms, hashes and live views: override what you want to see.

    Methods are called in the order things happen, at the instant they happen, from inside the
    board. They must not touch it.
    """

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """One whole bus cycle of ``host`` on ``chip`` with its latching edge at ``when`` (ps)."""

    def edge(self, when: int, net: str, level: int) -> None:
        """A watched net took a new level at ``when`` (ps)."""

    def violation(self, violation: Violation) -> None:
        """A rule was broken."""

    def fault(self, when: int, name: str, target: str, what: str, text: str) -> None:
        """A fault that was armed has ``"begun"``, ``"ended"`` or could not (``"failed"``)."""

    def outside(self, order: str, values: list[object]) -> None:
        """Something has reached the board that is no call of a host.

        A fault was armed (``"arm"``) or cleared (``"clear"``) while time runs; of a node, edges of
        other nodes (``"arrive"``), or orders for an instant (``"orders"``, ``"order"``) and the
        bus cycles that have come of them (``"made"``).
        """

    def settled(self, now: int) -> None:
        """Everything up to ``now`` (ps) has been reported; nothing earlier will come."""


class EdgeTaker(Observer):
    """Hands each edge to a function: its instant (ps), the name of its net, and the new level."""

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, take: Callable[[int, str, int], object]) -> None:
        self._take: Callable[[int, str, int], object] = take

    def edge(self, when: int, net: str, level: int) -> None:
        """Hand it on."""
        self._take(when, net, level)
