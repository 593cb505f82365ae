"""Polls that tell nothing new: what a host that waits in vain does for ever."""

from typing import Final

from vbus.chips.packets import Packet
from vbus.circuit.stream import LatestLines
from vbus.core.wall_clock import monotonic, process_time
from vbus.protocols.quantities import format_instant

KINDS: Final = 16
"""Packets that a loop of polls may consist of: fewer would miss loops over several axes, and each
more is compared with every packet."""
COMMANDS: Final = 8
"""Packets before the polls that a message shows: what the host waits for is among them."""


class Polls:
    """Counts packets that a host has read, all of which it knew from the polls before them.

    A packet with other values is news, and so is whatever the host writes.

    Args:
        every: how many it takes to have a look at them, and then how many more.

    Attributes:
        count: how many there are since the last news.
        commands: the latest of what the host has written.
    """

    def __init__(self, every: int) -> None:
        self.count: int = 0
        self.commands: LatestLines = LatestLines(maxlen=COMMANDS)
        self._every: int = every
        self._look_at: int = every
        self._known: set[str] = set()
        self._seen: dict[str, Packet] = {}
        self._since: int = 0
        self._begun: float = 0.0
        self._worked: float = 0.0
        self._before: float = 0.0
        self._seconds: float = 0.0
        """What :meth:`seconds` has returned; of polls before the last news, ``_before``."""

    def take(self, packet: Packet, text: str) -> bool:
        """Take a packet and what it says; tell whether to have a look."""
        if text in self._known:
            self.count += 1
            self._seen[text] = packet
            if self.count < self._look_at:
                return False
            self._look_at += self._every
            return True
        before = self._seconds
        self.reset()
        if packet.cycles[-1].write:
            self.commands.add(packet.end, text)
            self._known.clear()
        else:
            self._seconds = before
            if len(self._known) == KINDS:
                self._known.clear()
            self._known.add(text)
        self._since = packet.end
        return False

    @property
    def left(self) -> int:
        """How many more it takes at least until the next look."""
        return self._look_at - self.count

    def reset(self) -> None:
        """Count anew."""
        self.count = 0
        self._look_at = self._every
        self._seen.clear()
        self._begun = self._seconds = 0.0

    def seconds(self) -> float:
        """Return the wall time of polls in which this was asked about them, since the last write.

        It is at most twice the time that the processor had for them: on a busy machine no host
        hangs sooner.
        """
        if not self._begun:
            self._begun, self._worked = monotonic(), process_time()
            self._before = self._seconds
        else:
            took = min(monotonic() - self._begun, 2 * (process_time() - self._worked))
            self._seconds = self._before + took
        return self._seconds

    def loop(self) -> list[tuple[str, Packet]]:
        """Return the packets of which the polls consist, each with the name of its chip."""
        return [(text.partition(" ")[0], packet) for text, packet in self._seen.items()]

    def __str__(self) -> str:
        return f"{' and '.join(sorted(self._seen))} since {format_instant(self._since)}"
