"""The violations of a run, each with the bus cycles around it, and what else a driver does in vain.

Notes of what a driver for another part does that this one takes differently are violations too.
"""

from collections import Counter, deque
from collections.abc import Iterator, Mapping
from typing import ClassVar, Final, Generic, TypeVar

from msgspec import Struct, field

from vbus.chips.family import Family
from vbus.chips.packets import CUT, IGNORED, UNEXPECTED, UNKNOWN, Cycle, Packet
from vbus.circuit.stream import PacketReader
from vbus.core.errors import OptionError
from vbus.core.signals import Rule, Violation
from vbus.views.findings.suppress import Suppression

Line = TypeVar("Line")

# A command with its words and the polls before it, of any family.
CONTEXT: Final = 20
"""Bus cycles shown on either side of a finding."""
# A driver that polls too early breaks one rule thousands of times, each time alike.
DETAILED: Final = 100
"""Violations of one rule by one chip that are listed; more are counted."""


class Surroundings(Generic[Line]):
    """The lines on either side of what is found among them, :data:`CONTEXT` of each."""

    def __init__(self) -> None:
        self._latest: deque[Line] = deque(maxlen=CONTEXT)
        self._open: list[list[Line]] = []

    def add(self, line: Line) -> None:
        """Take a line."""
        self._latest.append(line)
        for after in self._open:
            after.append(line)
        # The oldest is full first: most lines find nothing to close.
        if self._open and len(self._open[0]) > CONTEXT:
            self._open = [after for after in self._open if len(after) <= CONTEXT]

    def found(self) -> tuple[list[Line], list[Line]]:
        """Return the lines before what is found now, and what takes the next, and those after."""
        after: list[Line] = []
        self._open.append(after)
        return list(self._latest), after


class CycleLine(Struct, rename={"when": "when_ps", "text": "cycle"}):
    """One bus cycle of a transcript.

    Attributes:
        when: instant of its latching edge (ps).
        text: host, chip, and the cycle: ``"host0 x w 0 1F"``.
        packets: what ended in it.
    """

    when: int
    text: str
    packets: list[str] = field(default_factory=list)


class Finding(Struct):
    """One violation in its surroundings.

    Attributes:
        violation: what was broken.
        before: the cycles before it, oldest first.
        after: the cycle it was found in, and those after it.
        reason: why it is accepted, or "".
    """

    violation: Violation
    before: list[CycleLine]
    after: list[CycleLine]
    reason: str = ""


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


class Report(PacketReader):
    """Collects violations; let it see a board while it runs, or a journal afterwards.

    Args:
        board: name of the board.
        families: chip families by name of chip.
        rules: every rule that could be broken.
        suppressions: what is accepted.
        file: name of the board file, for formats that want a place.
    """

    def __init__(
        self,
        board: str,
        families: dict[str, str],
        rules: list[Rule],
        suppressions: list[Suppression] | None = None,
        file: str = "",
    ) -> None:
        self.board: str = board
        self.file: str = file
        self.families: dict[str, str] = families
        self.rules: list[Rule] = rules
        self.suppressions: list[Suppression] = suppressions or []
        self.findings: list[Finding] = []
        self.counts: dict[tuple[str, str], int] = {}
        """Violations by chip and rule, also of those not listed."""
        self.cycles: int = 0
        self.no_effect: NoEffect = NoEffect()
        self.faults: list[tuple[int, str, str, str, str]] = []
        """Evidence of faults: instant, name, target, what happened, what it changed."""
        self._around: Surroundings[CycleLine] = Surroundings()
        self._ended: list[str] = []

    def packet(self, chip: str, packet: Packet) -> None:
        """Take down what a cycle has said, which comes next."""
        self.no_effect.add(packet)
        self._ended.append(f"{chip} {packet.cited}")

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Take down a bus cycle."""
        self.cycles += 1
        line = CycleLine(when, f"{host} {chip} {Cycle(when, write, address, data)}")
        if self._ended:
            line.packets = self._ended
            self._ended = []
        self._around.add(line)

    def violation(self, violation: Violation) -> None:
        """Take down a violation, with what came before it."""
        key = (violation.chip, violation.rule)
        self.counts[key] = self.counts.get(key, 0) + 1
        reason = ""
        for suppression in self.suppressions:
            if suppression.covers(violation):
                # All that cover it have been of use; the reason is that of the first.
                suppression.used += 1
                reason = reason or suppression.reason
        # With 40 cycles around each, all of them would fill the memory of a long run.
        if self.counts[key] <= DETAILED:
            self.findings.append(Finding(violation, *self._around.found(), reason))

    def fault(self, when: int, name: str, target: str, what: str, text: str) -> None:
        """Take down the evidence of a fault."""
        self.faults.append((when, name, target, what, text))

    def left_out(self) -> int:
        """Return how many violations are counted only."""
        return sum(self.counts.values()) - len(self.findings)

    def unaccepted(self, severity: str = "error") -> int:
        """Return how many violations of a severity are listed and not accepted."""
        return sum(1 for f in self.findings if not f.reason and f.violation.severity == severity)

    def unused(self) -> list[Suppression]:
        """Return the suppressions that covered nothing."""
        return [suppression for suppression in self.suppressions if not suppression.used]


class Uses:
    """The bus cycles of one chip, seen with the eyes of a driver for another part."""

    RULES: ClassVar[tuple[Rule, ...]] = ()
    """What it may find, each with the clause of the part that is there."""

    def cycle(self, write: bool, address: int, data: int) -> Iterator[tuple[Rule, str]]:
        """Give what the cycle means on the other part: rule, and a sentence."""
        raise NotImplementedError


class Compatibility(PacketReader):
    """Files a note for each use of a chip that another part takes differently.

    Args:
        other: the other part, such as ``"hctl-1100"``.
        families: the families of the chips, by name of chip.
        report: takes the notes; it reads each bus cycle before.

    Raises:
        OptionError: no chip is compatible with such a part; says with what they are.
    """

    def __init__(self, other: str, families: Mapping[str, Family], report: Report) -> None:
        self._report: Report = report
        self._uses: dict[str, Uses] = {}
        for chip, family in families.items():
            if other in family.compatibility:
                self._uses[chip] = family.compatible_with(other, Uses)()
        if not self._uses:
            parts = {name for family in families.values() for name in family.compatibility}
            known = f"they stand in for {', '.join(sorted(parts))}" if parts else "nor for another"
            raise OptionError(f'no chip of this run stands in for the part "{other}"; {known}')
        # Chips of one family have the same rules: each once.
        for uses in {type(uses): uses for uses in self._uses.values()}.values():
            report.rules = [*report.rules, *uses.RULES]

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Look at a bus cycle."""
        uses = self._uses.get(chip)
        if uses is None:
            return
        for rule, detail in uses.cycle(write, address, data):
            self._report.violation(
                Violation(when, chip, rule.name, rule.clause, rule.severity, 0, 0, detail)
            )
