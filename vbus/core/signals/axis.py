"""The seam between a chip and the mechanics behind it."""

from typing import ClassVar, Final

from mypy_extensions import i64, mypyc_attr

from vbus.core.options import Option, Settings, Value, with_defaults
from vbus.core.signals.values import Reading, ValueTable
from vbus.core.state import UNDECLARED, Names

DRIVES: Final = {"drive": "servo commands", "pulses": "step pulses", "phases": "phase commands"}
"""What a chip may give a plant, with its name for people."""
SWITCHES: Final = ("home", "limit+", "limit-")
"""The switches an axis may have; each chip says which of its inputs they are wired to."""


class Switch:
    """A home or limit switch that closes over a range of encoder counts.

    Args:
        low: first count at which it is closed.
        high: first count beyond at which it is open again.
        active: electrical level while closed (0 or 1).
    """

    WIRING: ClassVar[Names] = ("high", "low")

    def __init__(self, low: int, high: int, active: int = 0) -> None:
        self.low: int = low
        self.high: int = high
        self.active: int = active

    def level(self, count: int) -> int:
        """Electrical level with the axis at ``count``."""
        # The upper bound is open: two switches that touch share no count.
        closed = self.low <= count < self.high
        return self.active if closed else 1 - self.active

    def change_between(self, start: int, end: int) -> tuple[bool, int]:
        """Tell whether moving from ``start`` to ``end`` changes its level, and where first.

        Returns:
            ``(True, first count with the other level)`` or ``(False, 0)``.
        """
        # Going up it changes on reaching a bound, going down on leaving it.
        for bound in (self.low, self.high):
            if start < bound <= end:
                return True, bound
        for bound in (self.high, self.low):
            if end < bound <= start:
                return True, bound - 1
        return False, 0


@mypyc_attr(allow_interpreted_subclasses=True)
class Plant:
    """Motor, load and encoder behind one axis; drives in, encoder counts out.

    A chip calls :meth:`prepare` with the length of its period, then exactly one of
    :meth:`drive`, :meth:`pulses` or :meth:`phases` per period, at the period's start, with the
    output that holds during it. The mechanics are causal, so the encoder's course through that
    period is known from then on: :meth:`count_at` and :meth:`fraction_at` place index, capture
    and breakpoint at their right instants inside it.

    Counts are plain integers since power-on; they never wrap. What a chip calls home or zero is
    the chip's business.

    A plant that cannot take one kind of drive raises ``TypeError`` when it is connected, not
    here: see :attr:`TAKES`.
    """

    TAKES: ClassVar[tuple[str, ...]] = ("drive",)
    """Kinds of drive this plant understands: ``drive``, ``pulses``, ``phases``."""
    MODEL: ClassVar[int] = 1
    """Version of the model: one more whenever it moves otherwise than before."""
    OPTIONS: ClassVar[tuple[Option, ...]] = ()
    VALUES: ClassVar[ValueTable] = ValueTable()
    STATE: ClassVar[Names] = UNDECLARED
    WIRING: ClassVar[Names] = ("settings", "switches")

    def __init__(self, settings: Settings | None = None) -> None:
        self.settings: dict[str, Value] = with_defaults(self.OPTIONS, settings)
        # In machine words: a wheel at 1 million counts a second takes 290,000 years to leave them.
        self.count: i64 = 0
        self.switches: dict[str, Switch] = {}
        """The switches on the axis' way; names are from :data:`SWITCHES`."""

    def prepare(self, period: float) -> None:
        """Set the length of a period in seconds; called again when a chip changes it.

        The period under way is over then: of its course only the end is known any more.
        """
        raise NotImplementedError

    def drive(self, command: float, error: i64) -> i64:
        """Run one period with a servo command.

        Args:
            command: fraction of full scale, -1.0 to 1.0, positive = forward torque.
            error: desired minus real position in counts, for plants that follow exactly.

        Returns:
            The encoder count at the end of the period.
        """
        raise TypeError(f"{type(self).__name__} takes {self.TAKES}, not a servo command")

    def pulses(self, steps: i64) -> i64:
        """Run one period with ``steps`` signed step pulses spread evenly over it."""
        raise TypeError(f"{type(self).__name__} takes {self.TAKES}, not step pulses")

    def phases(self, a: float, b: float, c: float) -> i64:
        """Run one period with phase commands, each -1.0 to 1.0 (``c`` is 0 with two phases)."""
        raise TypeError(f"{type(self).__name__} takes {self.TAKES}, not phase currents")

    def count_at(self, fraction: float) -> i64:
        """Return the count at ``fraction`` (0.0 to 1.0) of the last period."""
        raise NotImplementedError

    def fraction_at(self, count: i64) -> float:
        """Return when, as a fraction of the last period, the encoder first reached ``count``."""
        raise NotImplementedError

    def index_between(self, start: i64, end: i64) -> tuple[bool, i64]:
        """Tell whether moving from ``start`` to ``end`` enters an index position, and which.

        ``start`` itself does not count. Returns ``(True, count)`` or ``(False, 0)``.
        """
        return False, 0

    def telemetry(self) -> dict[str, Reading]:
        """Return the values of :attr:`VALUES` by their keys, at the end of the period."""
        return self.VALUES.telemetry(1)(self)

    def unsaved(self) -> str:
        """Return why no snapshot can hold this plant; "" if one can."""
        return ""

    def resting(self) -> bool:
        """Whether another period with the same drive would leave every bit of state as it is."""
        return False
