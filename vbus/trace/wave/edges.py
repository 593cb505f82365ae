"""Edges of nets as changes of a waveform: nothing else happens as often."""

from typing import Any, ClassVar

from vbus.signals import Observer
from vbus.state import Names


class Edges(Observer):
    """Takes down the edges of nets.

    Args:
        signals: by name of the net.
        changes: takes each as instant (ps), signal and level.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, signals: dict[str, Any], changes: list[Any]) -> None:
        self._signals: dict[str, Any] = signals
        self._changes: list[Any] = changes

    def edge(self, when: int, net: str, level: int) -> None:
        """Take down an edge of one of the nets."""
        self._changes.append((when, self._signals[net], level))
