"""An output of silicon beside that of a model: the same edges at about the same instants."""

from collections import deque
from typing import Final

from vbus.core.kernel import MS
from vbus.core.signals import Net, Observer
from vbus.protocols.quantities import format_instant

# Longer than the reset of any family takes.
RESET_OVER: Final = 20 * MS
"""How long after a reset both may take to come to the same level."""

UNKNOWN: Final = 2
"""The level of an output that nothing drives (x or z in the capture)."""
_NAMES: Final = ("falls", "rises", "is driven no more (x or z)")
_LEVELS: Final = ("0", "1", "unknown (x or z)")

Difference = tuple[int, str, str]
"""Instant (ps), what the silicon did, what the model did."""


class OutputWatch(Observer):
    """Edges of one output on both sides, those without a partner found.

    Args:
        name: the pin.
        net: the model's net.
        slack: how far apart two edges may be (ps).
    """

    def __init__(self, name: str, net: Net, slack: int) -> None:
        self.name: str = name
        self._net: Net = net
        self._slack: int = slack
        self._silicon: deque[tuple[int, int]] = deque()
        self._model: deque[tuple[int, int]] = deque()
        self._level: int = 0
        self._begun: int = 0
        self._aligned: bool = False
        self._ended: bool = False

    def begin(self, when: int, level: int, reset: bool) -> None:
        """Compare from now on; ``reset``: once a reset has brought both to the same level.

        A level that is unknown is not yet one; the first one known must be the model's.
        """
        self._net.observe(self)
        self._level = level
        self._begun = when
        self._aligned = not reset and level != UNKNOWN
        if self._aligned and level != self._net.value:
            # The silicon's edge to its present level is one the model has not made.
            self._silicon.append((when, level))

    def edge(self, when: int, net: str, level: int) -> None:
        """The model's output has moved."""
        if self._aligned:
            self._model.append((when, level))

    def compare(self, now: int, level: int) -> Difference | None:
        """Take the silicon's level from ``now`` on; return the first edge without a partner."""
        moved, self._level = level != self._level, level
        if not self._aligned:
            # From here on both have had the same edges.
            if level == self._net.value:
                self._aligned = True
            elif now - self._begun > RESET_OVER:
                return self._misaligned(now, level)
            return None
        if moved:
            self._silicon.append((now, level))
        return self._match(now - self._slack)

    def _misaligned(self, now: int, level: int) -> Difference:
        self._aligned = self._ended = True
        return (now, f"is {_LEVELS[level]} after the reset", f"is {self._net.value}")

    def _match(self, before: int) -> Difference | None:
        """Pair the edges; those older than ``before`` must have found theirs."""
        silicon, model = self._silicon, self._model
        while silicon and model and not self._ended:
            (at, level), (when, value) = silicon[0], model[0]
            # Both made the same edge, as near as sampling and the model's clock can tell.
            if level == value and abs(at - when) <= self._slack:
                silicon.popleft()
                model.popleft()
            elif not self._drop_pulse(silicon) and not self._drop_pulse(model):
                break
        if self._ended:
            return None
        first = silicon[0][0] if silicon else before
        other = model[0][0] if model else before
        if min(first, other) >= before:
            return None
        if not self._drop_pulse(silicon) and not self._drop_pulse(model):
            self._ended = True
            return min(first, other), self._text(silicon), self._text(model)
        return None

    def _drop_pulse(self, edges: deque[tuple[int, int]]) -> bool:
        """Forget a pulse so short that sampling, or the slack, may pass over it."""
        if len(edges) > 1 and edges[1][0] - edges[0][0] <= self._slack:
            edges.popleft()
            edges.popleft()
            return True
        return False

    @staticmethod
    def _text(edges: deque[tuple[int, int]]) -> str:
        if not edges:
            return "stays as it is"
        when, level = edges[0]
        return f"{_NAMES[level]} at {format_instant(when)}"

    def finish(self, now: int) -> Difference | None:
        """The capture has ended: what is older than the slack must have found its partner."""
        if not self._aligned:
            if now - self._begun > RESET_OVER or self._level == UNKNOWN:
                return self._misaligned(now, self._level)
            return None
        return self._match(now - self._slack)
