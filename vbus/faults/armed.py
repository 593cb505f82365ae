"""A fault that is armed, and the evidence of what it did."""

from typing import ClassVar, Final

from msgspec import Struct

from vbus.core.options import Value
from vbus.core.state import Names
from vbus.faults.row import COUNTED, ONCE, Fault
from vbus.faults.trigger import RATE, Until, When
from vbus.faults.watch import ConditionWatch, Writes

WAITING: Final = "waiting"
ACTING: Final = "acting"
OVER: Final = "over"

BEGUN: Final = "begun"
ENDED: Final = "ended"
FAILED: Final = "failed"


class Evidence(Struct, frozen=True, rename={"when": "when_ps"}):
    """What a fault did, and when.

    Attributes:
        when: instant (ps).
        number: of the fault, as :class:`Armed` has it.
        name: the fault.
        target: on what.
        what: ``"begun"``, ``"ended"`` or ``"failed"``.
        text: what it changed, or why it could not.
    """

    when: int
    number: int
    name: str
    target: str
    what: str
    text: str

    def __str__(self) -> str:
        change = f"{self.what}; {self.text}" if self.text else self.what
        return f"{self.when / 1e9:.6f} ms #{self.number} {self.name} {self.target}: {change}"


class Armed(Struct):
    """One fault on one target.

    Attributes:
        number: what it is cleared by; counts up from 1.
        fault: its row.
        target: chip, axis or link.
        when: its trigger.
        until: its end.
        values: its parameters.
        state: ``"waiting"``, ``"acting"`` or ``"over"``.
        fired: how often it has begun.
        seen: bus cycles seen by its trigger.
        draws: state of its stream of instants.
        cleared: whether an order has cleared it.
        writes: the writes its trigger waits for.
        side: on which side of its trigger's position it was armed.
        here: the encoder's count when it began, of a fault behind an axis.
        watcher: what its trigger watches with.
    """

    DERIVED: ClassVar[Names] = ("*",)
    """Saved as a whole, as one record."""

    number: int
    fault: Fault
    target: str
    when: When
    until: Until
    values: dict[str, Value]
    state: str = WAITING
    fired: int = 0
    seen: int = 0
    draws: int = 0
    cleared: bool = False
    writes: Writes = ()
    side: int = 0
    here: int = 0
    watcher: ConditionWatch | None = None

    @property
    def name(self) -> str:
        """Name of the fault."""
        return self.fault.name

    @property
    def single(self) -> bool:
        """Whether it concerns one bus cycle, answer or message each time it begins."""
        rated = self.when.kind == RATE and self.fault.acts == COUNTED
        return rated or self.until.kind == ONCE

    def __str__(self) -> str:
        given = "".join(f" {key}={value}" for key, value in self.values.items())
        return (
            f"#{self.number} {self.name} {self.target}{given}, when {self.when.text}, until"
            f" {self.until.text}: {self.state}, fired {self.fired} times"
        )
