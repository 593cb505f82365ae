"""Travel limit switches: one hit at a time, until the axis has left and the host has seen it."""

from typing import ClassVar

from vbus.chips.mc1241a.datasheet import NEGATIVE_LIMIT, POSITIVE_LIMIT
from vbus.core.state import Names


class LimitDetector:
    """The over-travel detector of one axis (PMD-LIM-1, PMD-LIM-2)."""

    STATE: ClassVar[Names] = ("armed: bool", "_hit", "_positive: bool", "_negative: bool")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Arm the detector with both switches taken as open."""
        self.armed: bool = True
        self._hit: int = 0
        self.forget()

    def forget(self) -> None:
        """Take a switch that is active already as one that becomes active (PMD-LIM-4)."""
        self._positive: bool = False
        self._negative: bool = False

    def look(self, positive: bool, negative: bool, events: int, sensing: bool) -> int:
        """Look at the switches once a cycle; return the status bit of a hit, or 0.

        Args:
            positive: whether the positive switch is active, by its sense.
            negative: whether the negative switch is.
            events: status events, of which the host may have cleared the last hit.
            sensing: LMTS_ON rules.
        """
        if not self.armed:
            active = positive if self._hit == POSITIVE_LIMIT else negative
            if not active and not events & self._hit:
                self.armed = True
                self._hit = 0
                # The other switch may have become active unseen (NOTES 9).
                self.forget()
        bit = 0
        if self.armed and sensing:
            if positive and not self._positive:
                bit = POSITIVE_LIMIT
            elif negative and not self._negative:
                bit = NEGATIVE_LIMIT
            if bit:
                self.armed = False
                self._hit = bit
        self._positive = positive
        self._negative = negative
        return bit

    def steady(self, positive: bool, negative: bool, events: int, sensing: bool) -> bool:
        """Whether :meth:`look` with the same arguments would change nothing."""
        if self._positive != positive or self._negative != negative:
            return False
        if self.armed:
            return True
        active = positive if self._hit == POSITIVE_LIMIT else negative
        return active or events & self._hit != 0
