"""Bus cycles that did not do what they were made for, counted."""

from collections import Counter

from vbus.chips.packets import CUT, IGNORED, UNEXPECTED, UNKNOWN, Packet


class NoEffect:
    """Counts cycles a chip did not take, cycles it had nothing for, and packets cut short.

    Attributes:
        counts: by kind, as :meth:`text` names it in the singular.
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()

    def add(self, packet: Packet) -> None:
        """Count a packet if it had no effect, or only part of it."""
        way = "write" if packet.cycles[-1].write else "read"
        if packet.kind == IGNORED:
            self.counts[f"{way} not taken"] += 1
        elif packet.kind == CUT:
            self.counts["packet cut short"] += 1
        elif packet.kind == UNEXPECTED or (packet.kind == UNKNOWN and packet.clause):
            # Of a chip without a decoder nothing is known, and no clause is named.
            self.counts[f"{way} of nothing"] += len(packet.cycles)

    def text(self) -> str:
        """Return the counts in a line; "" if every cycle had its effect."""
        return ", ".join(
            f"{count} {kind.replace(' ', 's ', 1) if count > 1 else kind}"
            for kind, count in sorted(self.counts.items())
        )
