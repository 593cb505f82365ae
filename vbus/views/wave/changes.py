"""What a waveform has not written yet: nothing happens as often as edges of nets and polls.

A poll is decoded once; ``tests/unit/views/test_wave.py`` holds this fast way equal to decoding all.
"""

# Compiled (LM629, a poll in a waveform): 3.1 us and 4.9 us decoded each time, 1.5 times; a driver
# 1.4 times.

from operator import itemgetter
from typing import Any, ClassVar

from mypy_extensions import i64

from vbus.circuit.stream import PacketStream
from vbus.core.kernel import Kernel
from vbus.core.signals import Observer, Violation
from vbus.core.state import Names


def _cycle(write: bool, address: int, data: int) -> int:
    """Return one number for what a bus cycle is."""
    return address << 9 | write << 8 | data


class Changes(Observer):
    """Records edges of nets as they come, polls, and the changes that callers give.

    Args:
        kernel: the board's time.
        signals: what is taken down, by name of the net.
        decoding: gets the board's events, but for bus cycles like those of :meth:`say`.

    Attributes:
        pending: instant (ps), signal and value of each change.
        drained: what happened before this instant is in the file, or has been left out (ps).
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, kernel: Kernel, signals: dict[str, Any], decoding: PacketStream) -> None:
        self.pending: list[Any] = []
        self.drained: i64 = 0
        self._kernel: Kernel = kernel
        self._signals: dict[str, Any] = signals
        self._decoding: PacketStream = decoding
        self._lost: dict[str, tuple[int, str]] = decoding.lost
        self._said: dict[str, dict[int, tuple[Any, str]]] = {}
        """Signal and text, by name of the chip and what the cycle is."""
        self._in_order: bool = True
        """Whether what is pending is in order of time."""

    def edge(self, when: int, net: str, level: int) -> None:
        """Take down an edge of one of the nets."""
        self.pending.append((when, self._signals[net], level))

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Take down what a cycle says, if that is known; have it decoded if not."""
        said = self._said.get(chip)
        known = said.get(_cycle(write, address, data)) if said is not None else None
        # A cycle that a chip is about to lose says something else.
        if known is None or self._lost:
            self._decoding.bus_cycle(when, host, chip, write, address, data)
        else:
            self.note(when, known[0], known[1])

    def say(self, chip: str, write: bool, address: int, data: int, signal: Any, text: str) -> None:
        """Every such cycle says the same from now on, whatever is around it."""
        self._said.setdefault(chip, {})[_cycle(write, address, data)] = (signal, text)

    def violation(self, violation: Violation) -> None:
        """Pass it on."""
        self._decoding.violation(violation)

    def settled(self, now: int) -> None:
        """Pass it on."""
        self._decoding.settled(now)

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
