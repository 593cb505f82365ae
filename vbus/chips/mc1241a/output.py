"""Motor output pins: PWM frames and DAC words, made only while they are observed."""

from collections.abc import Callable
from heapq import heappop, heappush
from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mc1241a import datasheet as ds
from vbus.chips.mc1241a.chipset import ChipSet
from vbus.chips.mc1241a.cycle import SampleCycles
from vbus.chips.mc1241a.microstep import dac_word, pwm_magnitude
from vbus.core.kernel import NEVER
from vbus.core.signals import HIGH, LOW, Pin
from vbus.core.state import Names

_NEVER: Final[i64] = int(NEVER)
"""As a machine word: a compiled core keeps a literal this large as an object."""

PHASES: Final = ("1A", "1B", "2A", "2B")

CLOCK_OUT_CLK: Final = 4
"""ClkOut period; each DAC word takes one."""
DAC_PINS: Final = ("I/OAddr0-3", "DAC16Addr0-1", "Data0-11", "DACLow0-3", "~I/OWrite", "DACSlct")
ADDRESS_PS: Final = 25_000
"""ClkOut low to address (T22: 10..40 ns)."""
WRITE_PS: Final = 80_000
"""ClkOut low to ~I/OWrite low and data valid (T23: 75..92 ns, T24: at most 92 ns)."""
SELECT_PS: Final = 88_000
"""ClkOut low to DACSlct (T26: 66 ns after the address, T27: 44.5 ns after ~I/OWrite)."""
WRITTEN_PS: Final = 155_000
"""ClkOut low to ~I/OWrite high (T20: 56..95 ns low)."""
DAC_ADDRESS: Final = 15


class Output:
    """Edges on the PWM and DAC pins (PMD-USTP-5, PMD-USTP-6).

    New PWM values are taken at the start of a frame; DAC words are written one after another at
    each microstep look-up.

    Args:
        chip: the chip set whose pins they are.
        cycles: when its axes look up what.
        axes: how many there are.
    """

    STATE: ClassVar[Names] = ("_frame", "_sequence", "_queue: heap[(i64, i64, i64, i64)]")

    def __init__(self, chip: ChipSet, cycles: SampleCycles, axes: int) -> None:
        self._chip: ChipSet = chip
        self._cycles: SampleCycles = cycles
        self._axes: int = axes
        self._positive_sign: int = HIGH if chip.settings["pwm_sign"] == "high" else LOW
        names = [f"PWM{kind}{phase}" for phase in PHASES for kind in ("Mag", "Sign")]
        self._pins: tuple[Pin, ...] = tuple(chip.pins[name] for name in (*names, *DAC_PINS))
        self._queue: list[tuple[int, int, int, int]] = []
        self._sequence: int = 0
        self._frame: int = 0

    def listen(self, next_clk: int) -> None:
        """The pins have their first observer, or none any more.

        Args:
            next_clk: clocks since the count began, to find the next frame from.
        """
        heard = any(pin.net.heard for pin in self._pins)
        if heard != self._cycles.heard:
            self._cycles.heard = heard
            self._find_frame(next_clk)
        if not heard:
            self._queue = []

    def _find_frame(self, next_clk: int) -> None:
        # PMD-USTP-6: frames are counted from the reset, observed or not: whole ones are seen.
        counts = self._cycles.heard and self._cycles.shared.output_mode == ds.OUTPUT_PWM
        self._frame = max(0, -(-next_clk // ds.FRAME_CLK)) if counts else 0

    def change_mode(self, next_clk: int) -> None:
        """Another output mode is in force: all pins rest, and frames begin or end (PMD-USTP-7)."""
        self._find_frame(next_clk)
        self.rest()

    def reset(self) -> None:
        """All outputs rest; frames are counted anew."""
        self._frame = 0
        self.rest()

    def rest(self) -> None:
        """Let every pin take its resting level."""
        self._queue = []
        for pin in self._pins:
            self._chip.put(pin, pin.net.rest)

    def move_instants(self, shift: Callable[[int, int], int], now: int) -> None:
        """Move what is to be put out: the clock stands, or runs again."""
        self._queue = [(shift(one[0], now), *one[1:]) for one in self._queue]

    def due(self) -> i64:
        """Return the instant of the next edge or frame (ps), NEVER without an observer."""
        if not self._cycles.heard or self._chip.held:
            return _NEVER
        due: i64 = self._queue[0][0] if self._queue else NEVER
        # PMD-USTP-6: a frame has 256 clocks, 97.66 kHz at 25 MHz.
        if self._cycles.shared.output_mode == ds.OUTPUT_PWM:
            frame = self._cycles.ps_of(self._frame * ds.FRAME_CLK)
            return frame if frame < due else due
        return due

    def run(self, when: int) -> None:
        """Do what is due at ``when``."""
        while self._queue and self._queue[0][0] == when:
            _, _, number, level = heappop(self._queue)
            self._chip.put(self._pins[number], level)
        if (
            self._cycles.shared.output_mode == ds.OUTPUT_PWM
            and self._cycles.ps_of(self._frame * ds.FRAME_CLK) == when
        ):
            self._begin_frame()

    def _begin_frame(self) -> None:
        chip = self._chip
        start = self._frame * ds.FRAME_CLK
        self._frame += 1
        for axis in range(self._axes):
            for phase, output in enumerate(self._cycles.phase_outputs(axis)):
                number = 2 * (2 * axis + phase)
                positive = output >= 0
                # PMD-USTP-6, PMD-AMB-23: low is positive unless the board file says "high".
                sign = self._positive_sign if positive else 1 - self._positive_sign
                chip.put(self._pins[number + 1], sign)
                high = pwm_magnitude(output)
                chip.put(self._pins[number], HIGH if high else LOW)
                # PMD-USTP-6, PMD-AMB-22: 0 and 256 of 256 have no edge inside the frame.
                if 0 < high < ds.FRAME_CLK:
                    self._push(self._cycles.ps_of(start + high), number, LOW)

    def begin_slot(self) -> None:
        """A microstep look-up has begun: write the DAC words (PMD-USTP-5)."""
        if self._cycles.shared.output_mode != ds.OUTPUT_DAC16:
            return
        clk = self._cycles.slot_clk
        address, select, data, low, write, strobe = range(8, 14)
        for axis in range(self._axes):
            for phase, output in enumerate(self._cycles.phase_outputs(axis)):
                number = 2 * axis + phase
                # PMD-USTP-5: one phase after the other, a period of ClkOut each.
                start = self._cycles.ps_of(clk + number * CLOCK_OUT_CLK)
                word = dac_word(output)
                self._push(start + ADDRESS_PS, address, DAC_ADDRESS)
                self._push(start + ADDRESS_PS, select, number)
                self._push(start + WRITE_PS, data, word >> 4)
                self._push(start + WRITE_PS, low, word & 15)
                self._push(start + WRITE_PS, write, LOW)
                self._push(start + SELECT_PS, strobe, HIGH)
                self._push(start + WRITTEN_PS, strobe, LOW)
                self._push(start + WRITTEN_PS, write, HIGH)
        end = self._cycles.ps_of(clk + 2 * self._axes * CLOCK_OUT_CLK)
        self._push(end + ADDRESS_PS, address, 0)

    def _push(self, when: int, number: int, level: int) -> None:
        self._sequence += 1
        heappush(self._queue, (when, self._sequence, number, level))
