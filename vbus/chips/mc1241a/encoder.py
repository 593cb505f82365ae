"""One axis's inputs: encoder counts, index, home, position capture, limit switches."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mc1241a import datasheet as ds
from vbus.chips.mc1241a.chipset import ChipSet
from vbus.chips.motion.quadrature import (
    ALL_LOW,
    COUNTED,
    INDEX_FELL,
    SKIPPED,
    InputFilter,
    Quadrature,
    judge_inputs,
)
from vbus.core.bits import wrap, wrap_word
from vbus.core.kernel import NEVER
from vbus.core.signals import HIGH, LOW, Pin, Plant, Switch, Watcher
from vbus.core.state import Names

_HALF: Final = 1 << ds.POSITION_BITS - 1


def falls_between(switch: Switch, start: int, end: int) -> tuple[bool, int]:
    """Tell whether a switch's level falls on the way from ``start`` to ``end``, and where.

    Returns:
        ``(True, first count at which it is low)`` or ``(False, 0)``.
    """
    found, at = switch.change_between(start, end)
    # It changes twice at most: the first time it may rise.
    if found and switch.level(at) != LOW:
        found, at = switch.change_between(at, end)
    return found, at


class AxisInputs:
    """Position counter, capture register, home and limit inputs of one axis.

    Counts come from the plant, or from the A and B pins once one of them is driven
    (PMD-ENC-1). Home and limit levels come from the pins while they are driven, else from the
    plant's switches ``home``, ``limit+`` and ``limit-``, else they rest.

    Args:
        chip: the chip set whose pins they are.
        number: axis, 0-based.
        source: axis whose plant turns this encoder.
    """

    STATE: ClassVar[Names] = (
        "_wired: bool", "_home_wired: bool", "_levels: list[i64]", "_seen", "_mechanics_seen",
        "count", "_zero", "_read", "counted", "actual", "wrapped: bool", "_turn", "_capture_source",
        "_armed: bool", "_captured", "_fresh: bool", "_decoder: part", "_home_filter: part",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_mechanics", "_plant")
    DERIVED: ClassVar[Names] = ("_unsettled",)

    def __init__(self, chip: ChipSet, number: int, source: int) -> None:
        n = number + 1
        self._chip: Final[ChipSet] = chip
        self._number: int = number
        self._source: int = source
        self._plant: Plant | None = None
        self._mechanics: Plant | None = None
        pins = chip.pins
        self._quadrature = (pins[f"QuadA{n}"], pins[f"QuadB{n}"], pins[f"~Index{n}"])
        self._home: Pin = pins[f"~Home{n}"]
        self._limits = (pins[f"PosLimit{n}"], pins[f"NegLimit{n}"])
        # PMD-ENC-1: three periods of 160 ns; a channel that moves back before is not believed.
        dwell = chip.clock.span_up(ds.FILTER_CLK)
        # PMD-ENC-2, PMD-AMB-21: accepted after 480 ns; what lasts less than the 800 ns of T2 is
        # counted and reported.
        self._decoder: Final[Quadrature] = Quadrature(
            dwell, dwell, dwell_limit=ds.AC["T2"].min_ps, pulse_limit=ds.AC["T1"].min_ps
        )
        self._home_filter: Final[InputFilter] = InputFilter(dwell)
        self._wired: bool = False
        self._home_wired: bool = False
        self._levels: list[int] = [-1, -1]
        # Something at the pins may wait to be believed.
        self._unsettled: bool = True
        # Counts up to which two plants have been looked at: the one that turns this encoder, and
        # that of this axis, which has its switches. They are two if encoder_N names another axis.
        self._seen: i64 = 0
        self._mechanics_seen: i64 = 0
        self.count: i64 = 0
        """The hardware counter since the board was made; plain, never wraps."""
        # The counter at position 0, and as the cycle before has read it.
        self._zero: i64 = 0
        self._read: i64 = 0
        self.reset()
        for pin in self._quadrature:
            pin.net.watch(Watcher(chip.kernel, self._encoder_moved))
        self._home.net.watch(Watcher(chip.kernel, self._home_moved))
        limits = Watcher(chip.kernel, self.limit_moved)
        for pin in self._limits:
            pin.net.watch(limits)

    def reset(self) -> None:
        """Position 0, no capture, source index, ready to capture (PMD-RST-2)."""
        self._zero = self.count
        self._read = self.count
        self.counted: int = 0
        """Actual position as of the last cycle, as if it did not wrap."""
        self.actual: int = 0
        """Actual position as of the last cycle (counts)."""
        self.wrapped: bool = False
        """Whether the actual position has wrapped in the last cycle."""
        self._turn: int = 0
        self._capture_source: int = ds.CAPTURE_INDEX
        self._armed: bool = True
        self._captured: int = 0
        self._fresh: bool = False

    def attach(self, axis: int, plant: Plant) -> None:
        """Axis ``axis`` has got its mechanics."""
        if axis == self._source:
            self._plant = plant
            self._seen = plant.count
        if axis == self._number:
            self._mechanics = plant
            self._mechanics_seen = plant.count

    # -- counting -----------------------------------------------------------------------------

    def follow(self, instant: i64, fraction: float) -> None:
        """Count up to ``instant``, which is ``fraction`` of the present slot away from its start.

        Everything that happens by then is seen with the capture set-up as it is.
        """
        if self._mechanics is not None and not self._home_wired:
            # The end of a slot is known as a number; within it the plant is asked for its course.
            count: i64 = self._mechanics.count
            if fraction < 1.0:
                count = self._mechanics.count_at(fraction)
            if count != self._mechanics_seen:
                self._follow_home(self._mechanics, count)
        if self._plant is not None and not self._wired:
            count = self._plant.count
            if fraction < 1.0:
                count = self._plant.count_at(fraction)
            if count != self._seen:
                self._follow_plant(self._plant, count)
        if self._unsettled:
            self._settle(instant)

    def exchange(self, old: Plant | None, new: Plant) -> None:
        """Hear ``new`` in place of ``old``."""
        if self._plant is old:
            self._plant = new
        if self._mechanics is old:
            self._mechanics = new

    @property
    def filter_dwell(self) -> int:
        """For how long (ps) a channel must stand for its filter to believe it."""
        return self._decoder.filter_dwell

    def _follow_plant(self, plant: Plant, count: i64) -> None:
        # PMD-CAP-1: the first index on the way counts, at its own place in it.
        if self._armed and self._capture_source == ds.CAPTURE_INDEX:
            found, at = plant.index_between(self._seen, count)
            if found:
                self._capture(self.count + at - self._seen)
        self.count += count - self._seen
        self._seen = count

    def _follow_home(self, plant: Plant, count: i64) -> None:
        if self._armed and self._capture_source == ds.CAPTURE_HOME:
            switch = plant.switches.get("home")
            if switch is not None:
                # PMD-CAP-1: the falling edge of ~Home, whatever A and B are.
                found, at = falls_between(switch, self._mechanics_seen, count)
                if found:
                    self._capture(self._count_when(plant, at))
        self._mechanics_seen = count

    def _count_when(self, mechanics: Plant, at: int) -> int:
        """Return the counter's value when the mechanics of this axis come to count ``at``."""
        if self._plant is mechanics and not self._wired:
            return self.count + at - self._seen
        if self._plant is None or self._wired:
            return self.count
        return self.count + self._plant.count_at(mechanics.fraction_at(at)) - self._seen

    def _settle(self, instant: i64) -> None:
        """Take what the driven pins have done by ``instant``, in its order."""
        decoder, home = self._decoder, self._home_filter
        while True:
            quadrature, switch = decoder.due(), home.due()
            if quadrature > instant and switch > instant:
                self._unsettled = quadrature != NEVER or switch != NEVER
                return
            # In the order of instants: a capture stores the count of its own instant.
            if switch < quadrature:
                home.take()
                # PMD-CAP-1: by home the falling edge, not the level.
                if home.level == LOW and self._armed and self._capture_source == ds.CAPTURE_HOME:
                    self._capture(self.count)
                continue
            found = decoder.settle(instant)
            if found & COUNTED:
                self.count += decoder.direction
            if found & SKIPPED:
                # PMD-ENC-1: both channels at once count nothing: either direction may be meant.
                self._chip.report(ds.TWO_CHANNELS, when=decoder.at)
            # The index must have fallen before the later of A and B (PMD-CAP-1).
            if found & (ALL_LOW | INDEX_FELL) == ALL_LOW:
                if self._armed and self._capture_source == ds.CAPTURE_INDEX:
                    self._capture(self.count)

    def read(self) -> int:
        """Take the counter over at the start of a cycle; return the counts since the last."""
        # An encoder that stands cannot wrap: most cycles of most axes end here.
        if self.count == self._read:
            self.wrapped = False
            return 0
        moved = self.count - self._read
        self._read = self.count
        self.counted = self.count - self._zero
        turn = self.counted + (1 << ds.POSITION_BITS - 1) >> ds.POSITION_BITS
        self.wrapped = turn != self._turn
        self._turn = turn
        # PMD-ENC-1: the host reads 31 bits.
        self.actual = wrap_word(self.counted, _HALF)
        return moved

    def renumber(self, value: int) -> None:
        """Make the present place ``value`` (PMD-CMD-69)."""
        self._zero = self.count - value
        self.counted = self.actual = value
        self._turn = 0

    def resting(self) -> bool:
        """Whether nothing that has happened at the inputs is still to be taken over."""
        return (
            self._read == self.count
            and not self._fresh
            and self._decoder.due() == NEVER
            and self._home_filter.due() == NEVER
        )

    # -- capture ------------------------------------------------------------------------------

    def _capture(self, count: int) -> None:
        self._captured = wrap(count - self._zero, ds.POSITION_BITS)
        # PMD-CAP-1: no other capture until GET_CAPT has read this one.
        self._armed = False
        self._fresh = True

    def take_capture(self) -> bool:
        """Tell once, in the cycle after it, that a capture has happened."""
        fresh, self._fresh = self._fresh, False
        return fresh

    def set_source(self, source: int) -> None:
        """Capture by index or home from now on; armed, the stored value stays (PMD-CAP-2)."""
        self._capture_source = source
        # PMD-CAP-2: what was captured stays to be read.
        self._armed = True

    def collect(self) -> int:
        """Return the captured position and arm the register again (PMD-CAP-1)."""
        self._armed = True
        return self._captured

    # -- levels -------------------------------------------------------------------------------

    def home_level(self) -> int:
        """Return the level of the home input."""
        if self._home_wired:
            return self._home_filter.level
        return self._switch("home", HIGH)

    def limit_levels(self) -> tuple[int, int]:
        """Return the levels of the positive and the negative limit input."""
        positive, negative = self._levels[0], self._levels[1]
        return (
            self._switch("limit+", LOW) if positive < 0 else positive,
            self._switch("limit-", LOW) if negative < 0 else negative,
        )

    def _switch(self, name: str, rest: int) -> int:
        if self._mechanics is None or not self._mechanics.switches:
            return rest
        switch = self._mechanics.switches.get(name)
        return rest if switch is None else switch.level(self._mechanics_seen)

    # -- edges at the pins --------------------------------------------------------------------

    def _encoder_moved(self) -> None:
        """A, B or index has moved."""
        chip = self._chip
        chip.advance()
        now = chip.kernel.now
        self._settle(now)
        a, b, index = self._quadrature
        # A pin that is driven takes the encoder over from the plant, for good.
        if not self._wired and (a.net.driven or b.net.driven):
            chip.follow_encoders()
            self._wired = True
        self._unsettled = True
        found = self._decoder.edge(now, a.value, b.value, index.value)
        if found and chip.timing_checked:
            judge_inputs(chip.ac, self._decoder, found)
        chip.input_changed()

    def _home_moved(self) -> None:
        """~Home has moved."""
        chip = self._chip
        chip.advance()
        chip.follow_encoders()
        self._home_wired = self._home.net.driven
        self._unsettled = True
        self._home_filter.edge(chip.kernel.now, self._home.value)
        chip.input_changed()

    def limit_moved(self) -> None:
        """A limit switch pin has moved."""
        self._chip.advance()
        for place, pin in enumerate(self._limits):
            # An input that is let go follows the plant's switch again.
            self._levels[place] = pin.value if pin.net.driven else -1
        self._chip.input_changed()

    def after_load(self) -> None:
        """Look at the pins."""
        self._unsettled = True
