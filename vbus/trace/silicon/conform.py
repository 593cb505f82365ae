"""Silicon against model: a capture of a bus is driven into a board, and its answers compared."""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final

from vbus.board import plugins
from vbus.board.board import Board
from vbus.chips.base import Chip
from vbus.errors import CaptureError
from vbus.protocols.quantities import format_instant
from vbus.signals import Observer, Pin, Violation
from vbus.trace.bus_watch import BusWatch
from vbus.trace.decode import decoder_of
from vbus.trace.packets import Cycle, Decoder, Packet
from vbus.trace.silicon.capture import Sample
from vbus.trace.silicon.channel_map import Wiring
from vbus.trace.silicon.outputs import OutputWatch
from vbus.trace.silicon.start import Start, watch_of

AROUND: Final = 20
"""Bus cycles shown on either side of a difference."""
KEPT: Final = 1000
"""Violations kept; more are counted."""


@dataclass(frozen=True, slots=True)
class Tolerance:
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
class _Doubt:
    """A read that differs, until its packet is whole."""

    silicon: Cycle
    model: Cycle
    cycles: int
    reads: int
    before: list[str]
    after: list[str]
    mismatch: Mismatch | None = None
    ignored: bool = False


class _Findings(Observer):
    """Violations of the model, and the one for which a cycle was lost."""

    def __init__(self, verdict: Verdict) -> None:
        self._verdict: Verdict = verdict
        self.rules: dict[int, list[str]] = {}

    def violation(self, violation: Violation) -> None:
        """Keep it."""
        self._verdict.broken += 1
        if len(self._verdict.violations) < KEPT:
            self._verdict.violations.append(violation)
        self.rules = {violation.when: [*self.rules.get(violation.when, []), violation.rule]}


class _Bus(Observer):
    """The values a data bus has had lately."""

    def __init__(self, value: int) -> None:
        self._values: list[tuple[int, int]] = [(-1, value)]

    def edge(self, when: int, net: str, level: int) -> None:
        """Note a value."""
        self._values.append((when, level))

    def since(self, when: int) -> list[int]:
        """Return the value at ``when`` and all that came later; forget what was before."""
        values = self._values
        place = len(values) - 1
        while place and values[place][0] > when:
            place -= 1
        del values[:place]
        return [value for _, value in values]


class Conform:
    """Drives a capture into a chip of a board, edge by edge at its instants.

    Args:
        board: a board at instant 0, with no ports open.
        chip: which of its chips the capture shows.
        wiring: channels of the capture.
        tolerance: what is not counted.
        judged: whether AC limits are judged too.
        progress: called now and then.
    """

    def __init__(
        self,
        board: Board,
        chip: Chip,
        wiring: Wiring,
        tolerance: Tolerance,
        judged: bool = False,
        progress: Callable[[], None] | None = None,
    ) -> None:
        self.verdict: Verdict = Verdict()
        self._board: Board = board
        self._chip: Chip = chip
        self._wiring: Wiring = wiring
        self._tolerance: Tolerance = tolerance
        self._judged: bool = judged
        self._progress: Callable[[], None] | None = progress
        self._watch: BusWatch = watch_of(chip)
        self._silicon: Decoder = decoder_of(chip.FAMILY, chip.settings)
        self._model: Decoder = decoder_of(chip.FAMILY, chip.settings)
        self._recent: deque[Packet] = deque(maxlen=AROUND)
        self._doubts: deque[_Doubt] = deque()
        self._open: list[list[str]] = []
        self._ring: deque[str] = deque(maxlen=AROUND)
        self._polls: deque[tuple[int, int, int]] = deque()
        self._findings: _Findings = _Findings(self.verdict)
        board.listen(self._findings)
        self._strobes: list[tuple[str, Pin]] = []
        self._sides: list[tuple[str, Pin]] = []
        self._outputs: list[OutputWatch] = []
        self._solder()
        self._data: Pin = Pin("capture", chip.bus_net)
        self._bus: _Bus = _Bus(chip.bus_net.value)
        chip.bus_net.observe(self._bus)
        self._reading: int = 0
        """Since when the chip has been driving the data bus."""
        self._levels: tuple[int, ...] = ()
        self._byte: int = 0

    def _solder(self) -> None:
        chip, wiring = self._chip, self._wiring
        outputs = plugins.family(chip.FAMILY).outputs
        mapped = [row for row in chip.pin_rows if row.name in {**wiring.bits, **wiring.tied}]
        for row in mapped:
            if row.direction == "in":
                pin = Pin("capture", chip.pins[row.name].net)
                kind = self._strobes if row.name in self._watch.PINS else self._sides
                kind.append((row.name, pin))
            elif row.name in outputs:
                if row.name not in self._tolerance.names:
                    net = chip.pins[row.name].net
                    self._outputs.append(OutputWatch(row.name, net, self._tolerance.slack))
        self.verdict.outputs = [output.name for output in self._outputs]

    # -- from sample to sample ----------------------------------------------------------------

    def run(self, samples: Iterable[Sample], start: Start) -> Verdict:
        """Compare from ``start`` to the end, or to some cycles after the first difference.

        Raises:
            CaptureError: the capture ends before the start.
        """
        first: Sample | None = None
        when = 0
        for number, sample in enumerate(samples):
            if number < start.sample:
                if number == start.sample - 1:
                    first = sample
                continue
            when = sample[0]
            if number == start.sample:
                self._begin(first or sample, start)
            self._take(*sample)
            if self._progress is not None and not number & 0xFFF:
                self._progress()
            if self._done():
                break
        if not self._levels:
            raise CaptureError("the capture ends before anything can be compared")
        self.verdict.end = when
        self._finish(when)
        return self.verdict

    def _begin(self, sample: Sample, start: Start) -> None:
        when, value = sample
        self._board.run_until(when)
        self.verdict.begin = when
        self._levels = tuple([self._wiring.level(name, value) for name in self._watch.PINS])
        self._byte = self._wiring.byte(value)
        for name, pin in (*self._strobes, *self._sides):
            pin.drive(self._wiring.level(name, value))
        if not self._watch.reading(self._levels):
            self._data.drive(self._byte)
        self._board.kernel.settle()
        self._chip.advance()
        self._board.kernel.settle()
        self._watch.change(when, self._levels, self._byte)
        for output in self._outputs:
            output.begin(when, self._wiring.level(output.name, value), start.reset)
        self._chip.judged = self._judged

    def _take(self, when: int, value: int) -> None:
        """Drive the inputs of one instant, and compare what has come of it."""
        board, watch, wiring = self._board, self._watch, self._wiring
        before, old = self._levels, self._byte
        levels = tuple([wiring.level(name, value) for name in watch.PINS])
        byte = wiring.byte(value)
        board.run_until(when)
        self._chip.advance()
        board.kernel.settle()
        # Neither the edge's instant nor the model's is exact: all of these may have been read.
        shown = self._bus.since(max(self._reading, when - self._tolerance.slack))
        if watch.reading(levels):
            self._data.release()
            if not watch.reading(before):
                self._reading = when
        for name, pin in self._strobes:
            pin.drive(wiring.level(name, value))
        for name, pin in self._sides:
            pin.drive(wiring.level(name, value))
        board.kernel.settle()
        if not watch.reading(levels):
            self._data.drive(byte)
            board.kernel.settle()
        if levels != before:
            for cycle in watch.edges(when, before, levels, old, byte):
                self._cycle(cycle, shown, old, byte)
        self._levels, self._byte = levels, byte
        for output in self._outputs:
            found = output.compare(when, wiring.level(output.name, value))
            if found is not None:
                self._edge(output, *found)

    # -- bus cycles ---------------------------------------------------------------------------

    def _cycle(self, cycle: Cycle, shown: list[int], old: int, byte: int) -> None:
        """Compare a cycle. Of a read both the byte before its end and the one at it may count."""
        silicon = model = cycle
        if not cycle.write:
            taken = next((value for value in (byte, old) if value in shown), old)
            silicon = Cycle(cycle.when, False, cycle.address, taken)
            answer = taken if self._agrees(silicon, shown) else shown[-1]
            self._remember(cycle, shown[-1])
            model = Cycle(cycle.when, False, cycle.address, answer)
        text = f"{format_instant(cycle.when)} {self._chip.name} {silicon}"
        if silicon.data != model.data:
            text += f"  <- the model gives {model.data:02X}"
            self._doubts.append(
                _Doubt(silicon, model, self.verdict.cycles, self.verdict.reads,
                       list(self._ring), [])
            )  # fmt: skip
            self._open.append(self._doubts[-1].after)
        elif self.verdict.mismatch is None:
            self.verdict.reads += not cycle.write
        if self.verdict.mismatch is None:
            self.verdict.cycles += 1
        rules = self._findings.rules.get(cycle.when, [])
        lost = next((rule for rule in rules if rule in self._silicon.LOST), "")
        packets = self._silicon.feed(silicon, lost)
        self._recent.extend(self._model.feed(model, lost))
        text += "".join(f"\n    {packet.text}" for packet in packets)
        self._ring.append(text)
        for after in self._open:
            after.append(text)
        self._open = [after for after in self._open if len(after) <= AROUND]
        for packet in packets:
            self._judge(packet)
        self._decide()

    def _agrees(self, cycle: Cycle, shown: list[int]) -> bool:
        """Tell whether the model gives, or so long ago gave, what the silicon has given."""
        if cycle.data in shown:
            return True
        mask = self._tolerance.masks.get(cycle.address, 0)
        if not (cycle.data ^ shown[-1]) & ~mask & 0xFF:
            self.verdict.ignored += 1
            return True
        if cycle.address not in self._chip.FREE_READS:
            return False
        since = cycle.when - self._tolerance.slack
        return any(
            when >= since and (address, value) == (cycle.address, cycle.data)
            for when, address, value in self._polls
        )

    def _remember(self, cycle: Cycle, value: int) -> None:
        """Note what the model shows, for as long as it may still count."""
        polls = self._polls
        polls.append((cycle.when, cycle.address, value))
        while polls and polls[0][0] < cycle.when - self._tolerance.slack:
            polls.popleft()

    def _judge(self, packet: Packet) -> None:
        """A packet is whole: settle the doubts about its bytes."""
        for doubt in self._doubts:
            if doubt.mismatch is None and not doubt.ignored and doubt.silicon in packet.cycles:
                words = {packet.name, *packet.name.split()}
                if words & self._tolerance.names:
                    doubt.ignored = True
                    self.verdict.ignored += 1
                else:
                    doubt.mismatch = self._told(doubt, packet)

    def _told(self, doubt: _Doubt, packet: Packet | None) -> Mismatch:
        other = next((p for p in reversed(self._recent) if doubt.model in p.cycles), None)
        silicon, model = f"{doubt.silicon.data:02X}H", f"{doubt.model.data:02X}H"
        return Mismatch(
            doubt.silicon.when,
            f"read at address {doubt.silicon.address:X}H",
            f"{silicon} in {packet.text}" if packet else silicon,
            f"{model} in {other.text}" if other else model,
            packet.clause if packet else "",
            doubt.before,
            doubt.after,
        )

    def _decide(self) -> None:
        """Take the first doubt that has become certain, if none before it is open."""
        while self._doubts and self.verdict.mismatch is None:
            doubt = self._doubts[0]
            if doubt.mismatch is None and not doubt.ignored and len(doubt.after) <= AROUND:
                return
            self._doubts.popleft()
            if not doubt.ignored:
                self._certain(doubt)

    def _certain(self, doubt: _Doubt) -> None:
        found = doubt.mismatch or self._told(doubt, None)
        self.verdict.mismatch = found
        self.verdict.cycles, self.verdict.reads = doubt.cycles, doubt.reads

    # -- outputs, and the end -----------------------------------------------------------------

    def _edge(self, output: OutputWatch, when: int, silicon: str, model: str) -> None:
        """An output differs, unless an earlier byte has, or turns out to have."""
        if self.verdict.mismatch is not None:
            return
        mismatch = Mismatch(when, output.name, silicon, model, "", list(self._ring), [])
        doubt = _Doubt(Cycle(when, False, -1, 0), Cycle(when, False, -1, 0), self.verdict.cycles,
                       self.verdict.reads, mismatch.before, mismatch.after, mismatch)  # fmt: skip
        self._open.append(mismatch.after)
        self._doubts.append(doubt)
        self._decide()

    def _done(self) -> bool:
        found = self.verdict.mismatch
        return found is not None and len(found.after) > AROUND

    def _finish(self, when: int) -> None:
        for output in self._outputs:
            found = output.finish(when)
            if found is not None:
                self._edge(output, *found)
        packets = self._silicon.finish()
        self._recent.extend(self._model.finish())
        for packet in packets:
            self._judge(packet)
        for doubt in self._doubts:
            if doubt.mismatch is None and not doubt.ignored:
                doubt.mismatch = self._told(doubt, None)
        self._decide()
