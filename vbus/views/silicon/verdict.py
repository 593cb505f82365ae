"""What comes of a comparison of silicon with a model, and what is not counted in it."""

from dataclasses import dataclass, field

from vbus.chips.packets import Cycle
from vbus.core.signals import Violation


@dataclass(frozen=True, slots=True)
class CaptureTolerance:
    """What is not counted as a difference.

    Attributes:
        slack: how far apart the two may be in time (ps): a status the model has given up so long
            ago still counts, and so does an edge that comes earlier or later.
        names: packets, registers and outputs that are not compared.
        masks: bits by address that are not compared.
    """

    slack: int
    names: frozenset[str] = frozenset()
    masks: dict[int, int] = field(default_factory=dict)


@dataclass(slots=True)
class Mismatch:
    """Where silicon and model differ.

    Attributes:
        when: instant in the capture (ps).
        where: the bus cycle, or the output.
        silicon: what was captured, decoded.
        model: what the model did, decoded.
        clause: clause of the specification it falls under, or "".
        before: the bus cycles before it.
        after: its own, and those after it.
    """

    when: int
    where: str
    silicon: str
    model: str
    clause: str = ""
    before: list[str] = field(default_factory=list)
    after: list[str] = field(default_factory=list)


@dataclass(slots=True)
class Verdict:
    """What came of a comparison.

    Attributes:
        cycles: bus cycles driven in before the difference, or in all.
        reads: reads among them, whose bytes agree.
        outputs: outputs that were compared.
        ignored: differences that were not counted, as asked for.
        begin: instant of the first sample driven in (ps).
        end: instant of the last (ps).
        mismatch: the first difference, or None.
        violations: what the model's rules say of the host, and how many there were.
        broken: number of violations.
    """

    cycles: int = 0
    reads: int = 0
    outputs: list[str] = field(default_factory=list)
    ignored: int = 0
    begin: int = 0
    end: int = 0
    mismatch: Mismatch | None = None
    violations: list[Violation] = field(default_factory=list)
    broken: int = 0


@dataclass(slots=True)
class Candidate:
    """A read or an edge that differs, until it is certain what of.

    Attributes:
        mismatch: what is known of it so far.
        silicon: the cycle as it was captured; None for an edge.
        model: the cycle as the model would have it.
        cycles: bus cycles before it.
        reads: reads among them.
        undriven: whether nothing drove the bus: then no value is given.
        settled: whether all of it is known.
        ignored: whether it does not count.
    """

    mismatch: Mismatch
    silicon: Cycle | None
    model: Cycle | None
    cycles: int
    reads: int
    undriven: bool = False
    settled: bool = False
    ignored: bool = False
