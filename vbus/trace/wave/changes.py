"""What a waveform has not written yet: nothing else happens as often as edges of nets."""

from operator import itemgetter
from typing import Any, ClassVar

from mypy_extensions import i64

from vbus.kernel import Kernel
from vbus.signals import Observer
from vbus.state import Names


class Changes(Observer):
    """Takes down edges of nets as they come, and whatever else it is told.

    Args:
        kernel: the board's time.
        signals: what is taken down, by name of the net.

    Attributes:
        pending: instant (ps), signal and value of each change.
        drained: what happened before this instant is in the file, or has been left out (ps).
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, kernel: Kernel, signals: dict[str, Any]) -> None:
        self.pending: list[Any] = []
        self.drained: i64 = 0
        self._kernel: Kernel = kernel
        self._signals: dict[str, Any] = signals
        self._in_order: bool = True
        """Whether what is pending is in order of time."""

    def edge(self, when: int, net: str, level: int) -> None:
        """Take down an edge of one of the nets."""
        self.pending.append((when, self._signals[net], level))

    def note(self, when: i64, signal: Any, value: Any) -> None:
        """Take down a change.

        A hold time is known to be broken only some time later; a file has no way back.
        """
        instant = max(when, self.drained)
        pending = self.pending
        # Edges of nets come at the present instant, after all that is pending by then.
        if instant > self._kernel.now or (pending and pending[-1][0] > instant):
            self._in_order = False
        pending.append((instant, signal, value))

    def drain(self, now: i64) -> None:
        """All that happened before ``now`` is known: put it in order of time."""
        self.drained = max(self.drained, now)
        if not self._in_order:
            self.pending.sort(key=itemgetter(0))
            self._in_order = True
