"""A capture of real silicon beside the model, and what comes of the comparison."""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final

from vbus import plugins
from vbus.board.board import Board
from vbus.chips.base import Chip
from vbus.chips.bus_watch import BusWatch
from vbus.chips.packets import Cycle, Packet, calls
from vbus.circuit.stream import PacketStream
from vbus.core.errors import CaptureError
from vbus.core.signals import Observer, Pin, Violation
from vbus.core.state import load, save
from vbus.protocols.quantities import format_instant
from vbus.views.findings.report import CONTEXT, Surroundings
from vbus.views.silicon.capture import Sample
from vbus.views.silicon.channel_map import Wiring
from vbus.views.silicon.outputs import UNKNOWN, Difference, OutputWatch
from vbus.views.silicon.start import Start, watch_of
from vbus.views.wave.signals import bit_names


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


# A capture of a driver that breaks a rule at each poll has millions.
LONGEST_LIST: Final = 1000
"""Violations that are listed; more are counted."""


class _DataBus(Observer):
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


class Conform(Observer):
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
        tolerance: CaptureTolerance,
        judged: bool = False,
        progress: Callable[[], None] | None = None,
    ) -> None:
        self.verdict: Verdict = Verdict()
        self._board: Board = board
        self._chip: Chip = chip
        self._wiring: Wiring = wiring
        self._tolerance: CaptureTolerance = tolerance
        self._judged: bool = judged
        self._progress: Callable[[], None] | None = progress
        self._watch: BusWatch = watch_of(chip, wiring)
        self._silicon: PacketStream = PacketStream.of([chip])
        self._model: PacketStream = PacketStream.of([chip])
        self._recent: deque[Packet] = deque(maxlen=CONTEXT)
        self._candidates: deque[Candidate] = deque()
        self._around: Surroundings[str] = Surroundings()
        self._polls: deque[tuple[int, int, int]] = deque()
        board.listen(self)
        self._inputs: list[tuple[str, Pin]] = []
        """Inputs of the chip; those of the bus come first. One whose level is not known yet is not
        driven; one that becomes unknown later stays where it is."""
        self._outputs: list[OutputWatch] = []
        self._attach()
        self._data: Pin = chip.bus_net.solder("capture")
        self._bus: _DataBus = _DataBus(chip.bus_net.value)
        chip.bus_net.observe(self._bus)
        self._reading: int = 0
        """Since when the chip has been driving the data bus."""
        self._levels: tuple[int, ...] = ()
        self._byte: int = 0
        self._floating: int = 0
        """Bits of the data bus that are unknown."""

    def _attach(self) -> None:
        chip, wiring = self._chip, self._wiring
        outputs = plugins.family(chip.FAMILY).outputs
        for row in chip.pin_rows:
            if row.name not in wiring.bits and row.name not in wiring.tied:
                continue
            net = chip.pins[row.name].net
            if row.direction == "in":
                self._inputs.append((row.name, net.solder("capture")))
            elif row.name in outputs and row.name not in self._tolerance.names:
                self._outputs.append(OutputWatch(row.name, net, self._tolerance.slack))
        self._inputs.sort(key=lambda input_: input_[0] not in self._watch.PINS)
        self.verdict.outputs = [output.name for output in self._outputs]

    def violation(self, violation: Violation) -> None:
        """Keep a violation of the model's rules."""
        self.verdict.broken += 1
        if len(self.verdict.violations) < LONGEST_LIST:
            self.verdict.violations.append(violation)
        self._silicon.violation(violation)
        self._model.violation(violation)

    # -- from sample to sample ----------------------------------------------------------------

    def run(self, samples: Iterable[Sample], start: Start) -> Verdict:
        """Compare from ``start`` to the end, or to some cycles after the first difference.

        Raises:
            CaptureError: the capture ends before the start, or does not say what the host wrote.
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
                # A control line that is unknown.
                if first and any(self._wiring.unknown(name, first[1]) for name in self._watch.PINS):
                    first = None
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
        self._board.pass_until(when)
        self.verdict.begin = when
        self._levels = tuple([self._wiring.level(name, value) for name in self._watch.PINS])
        self._byte = self._wiring.byte(value)
        self._floating = self._wiring.unknown_bits(value)
        self._drive(value)
        if not self._watch.reading(self._levels):
            self._data.drive(self._byte)
        self._board.kernel.settle()
        self._chip.advance()
        self._board.kernel.settle()
        self._watch.change(when, self._levels, self._byte)
        for output in self._outputs:
            output.begin(when, self._output(output, value), start.reset)
        for chip in self._board.chips if self._chip.CONNECTOR else (self._chip,):
            chip.timing_checked = self._judged

    def _drive(self, value: int) -> None:
        """Drive the inputs whose levels are known."""
        wiring = self._wiring
        for name, pin in self._inputs:
            if not wiring.unknown(name, value):
                pin.drive(wiring.level(name, value))

    def _output(self, output: OutputWatch, value: int) -> int:
        """Return what the silicon shows at an output."""
        wiring = self._wiring
        return UNKNOWN if wiring.unknown(output.name, value) else wiring.level(output.name, value)

    def _take(self, when: int, value: int) -> None:
        """Drive the inputs of one instant, and compare what has come of it."""
        board, watch, wiring = self._board, self._watch, self._wiring
        before, old, floating = self._levels, self._byte, self._floating
        levels = tuple([wiring.level(name, value) for name in watch.PINS])
        byte = wiring.byte(value)
        board.pass_until(when)
        self._chip.advance()
        board.kernel.settle()
        driven = self._chip.bus_net.driven
        # Neither the edge's instant nor the model's is exact: all of these may have been read.
        answers = self._bus.since(max(self._reading, when - self._tolerance.slack))
        if watch.reading(levels):
            self._data.release()
            if not watch.reading(before):
                self._reading = when
        self._drive(value)
        board.kernel.settle()
        # While the chip is read the host lets go: both would drive otherwise.
        if not watch.reading(levels):
            self._data.drive(byte)
            board.kernel.settle()
        if levels != before:
            if floating and self.verdict.mismatch is None:
                self._check_taken(when, before, levels)
            if not driven:  # by the model either: nothing is wrong where nothing drives
                self._floating = 0
            for cycle in watch.edges(when, before, levels, old, byte):
                self._cycle(cycle, answers, old, byte)
        self._levels, self._byte = levels, byte
        self._floating = wiring.unknown_bits(value)
        for output in self._outputs:
            self._edge(output, output.compare(when, self._output(output, value)))

    def _check_taken(self, when: int, before: tuple[int, ...], levels: tuple[int, ...]) -> None:
        """Refuse an edge at which the chip takes a byte or an address that is not known.

        Raises:
            CaptureError: it is one.
        """
        watch = self._watch
        state = save(watch)
        taken = []
        # Unknown bits all high, and all low: the chip must take the same.
        for old in (0xFF, 0):
            load(watch, state)
            old = self._byte & ~self._floating | self._floating & old
            taken.append((watch.edges(when, before, levels, old, 0), save(watch)))
        load(watch, state)
        if taken[0] != taken[1]:
            raise CaptureError(
                f"at {format_instant(when)} the chip takes a byte of which"
                f" {self._named(self._floating)} unknown (x or z): what it took cannot be"
                " compared. Begin after that with --from"
            )

    def _named(self, bits: int) -> str:
        """Name bits of the data bus, with their verb."""
        names = bit_names(self._watch.table.data, 8)
        if bits == 0xFF:
            return f"{self._watch.table.data} are"
        chosen = [name for bit, name in enumerate(names) if bits >> bit & 1]
        return f"{', '.join(chosen)} {'is' if len(chosen) == 1 else 'are'}"

    # -- bus cycles ---------------------------------------------------------------------------

    def _cycle(self, cycle: Cycle, answers: list[int], old: int, byte: int) -> None:
        """Compare a cycle. Of a read both the byte before its end and the one at it may count."""
        silicon = model = cycle
        undriven = 0
        if not cycle.write:
            undriven = self._undriven(cycle)
            # A card's bus is pulled: its level after the edge is no chip's.
            shown = (old,) if self._chip.CONNECTOR else (byte, old)
            taken = next((value for value in shown if value in answers and not undriven), old)
            silicon = Cycle(cycle.when, False, cycle.address, taken)
            answer = taken if not undriven and self._agrees(silicon, answers) else answers[-1]
            self._remember(cycle, answers[-1])
            model = Cycle(cycle.when, False, cycle.address, answer)
        text = f"{format_instant(cycle.when)} {self._chip.name} {silicon}"
        if undriven or silicon.data != model.data:
            gave, said = f"{silicon.data:02X}H", f"the model gives {model.data:02X}"
            if undriven:
                gave = f"{self._named(undriven)} not driven (x or z)"
                said = f"{self._named(undriven)} not driven; {said}"
            text += f"  <- {said}"
            where = f"read at address {cycle.address:X}H"
            found = Mismatch(cycle.when, where, gave, f"{model.data:02X}H")
            self._suspect(found, silicon, model, undriven)
        elif self.verdict.mismatch is None:
            self.verdict.reads += not cycle.write
        # What follows a difference is context alone.
        if self.verdict.mismatch is None:
            self.verdict.cycles += 1
        packets = [packet for _, packet in self._silicon.decoded(self._chip.name, silicon)]
        self._recent.extend(packet for _, packet in self._model.decoded(self._chip.name, model))
        text += "".join(f"\n    {packet.text}" for packet in packets)
        self._around.add(text)
        for packet in packets:
            self._resolve(packet)
        self._decide()

    def _undriven(self, cycle: Cycle) -> int:
        """Return the bits of a read that nothing drove at its end, those left out aside."""
        left = self._floating & ~self._tolerance.masks.get(cycle.address, 0)
        if self._floating and not left:
            self.verdict.ignored += 1
        return left

    def _agrees(self, cycle: Cycle, answers: list[int]) -> bool:
        """Tell whether the model gives, or so long ago gave, what the silicon has given."""
        if cycle.data in answers:
            return True
        mask = self._tolerance.masks.get(cycle.address, 0)
        if not (cycle.data ^ answers[-1]) & ~mask & 0xFF:
            self.verdict.ignored += 1
            return True
        # Only a status may be late: data is taken once, and then the next is there.
        if not self._chip.CONNECTOR and cycle.address not in self._chip.FREE_READS:
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

    def _suspect(
        self, mismatch: Mismatch, silicon: Cycle | None, model: Cycle | None, undriven: int = 0
    ) -> Candidate:
        """Note a candidate: what follows is noted with it."""
        mismatch.before, mismatch.after = self._around.found()
        candidate = Candidate(mismatch, silicon, model, self.verdict.cycles, self.verdict.reads)
        candidate.undriven = undriven != 0
        self._candidates.append(candidate)
        return candidate

    def _resolve(self, packet: Packet) -> None:
        """A packet is whole: settle the candidates among its bytes."""
        for candidate in self._candidates:
            if not candidate.settled and candidate.silicon in packet.cycles:
                if self._tolerance.names.intersection(calls(packet.name)):
                    candidate.settled = candidate.ignored = True
                    self.verdict.ignored += 1
                else:
                    self._settle(candidate, packet)

    def _settle(self, candidate: Candidate, packet: Packet | None = None) -> None:
        """All is known of a candidate: tell the packet it is in, on either side."""
        found = candidate.mismatch
        other = next((p for p in reversed(self._recent) if candidate.model in p.cycles), None)
        candidate.settled = True
        found.model += f" in {other.text}" if other else ""
        if packet is not None:
            found.silicon += f" in {packet.name if candidate.undriven else packet.text}"
            found.clause = packet.clause

    def _decide(self) -> None:
        """Take the first candidate that has become certain, if none before it is open."""
        while self._candidates and self.verdict.mismatch is None:
            candidate = self._candidates[0]
            # Its packet may still turn out to be left out; after so many cycles it counts as it is.
            if not candidate.settled and len(candidate.mismatch.after) <= CONTEXT:
                return
            self._candidates.popleft()
            if not candidate.settled:
                self._settle(candidate)
            if not candidate.ignored:
                self.verdict.mismatch = candidate.mismatch
                self.verdict.cycles, self.verdict.reads = candidate.cycles, candidate.reads

    # -- outputs, and the end -----------------------------------------------------------------

    def _edge(self, output: OutputWatch, found: Difference | None) -> None:
        """An output differs, unless an earlier byte has, or turns out to have."""
        if found is not None and self.verdict.mismatch is None:
            when, silicon, model = found
            candidate = self._suspect(Mismatch(when, output.name, silicon, model), None, None)
            candidate.settled = True
            self._decide()

    def _done(self) -> bool:
        found = self.verdict.mismatch
        return found is not None and len(found.after) > CONTEXT

    def _finish(self, when: int) -> None:
        for output in self._outputs:
            self._edge(output, output.finish(when))
        packets = self._silicon.decoders[self._chip.name].finish()
        self._recent.extend(self._model.decoders[self._chip.name].finish())
        for packet in packets:
            self._resolve(packet)
        for candidate in self._candidates:
            if not candidate.settled:
                self._settle(candidate)
        self._decide()
