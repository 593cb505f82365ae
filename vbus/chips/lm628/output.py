"""The motor output: 8-bit converter, 12-bit multiplexed converter, sign and magnitude PWM."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.lm628 import datasheet as ds
from vbus.core.kernel import NEVER, Clock
from vbus.core.signals import Pin
from vbus.core.state import Names

DAC8: Final = 0
DAC12: Final = 1
PWM: Final = 2
ZEROING: Final = 3

STEADY: Final = (1 << 62) - 1
"""Clock of the next change of the output pins where there is none."""

STROBE: Final = 0x01
SECOND: Final = 0x02
SIGN: Final = 0x02
MAGNITUDE: Final = 0x01


class ServoOutput:
    """Levels of the output pins, as a function of the clock since the last sample.

    A *word* holds the pins: bits 7..0 are DAC7..DAC0 (pins 18 to 25); on the LM629 bit 1 is the
    sign and bit 0 the magnitude.

    The 12-bit port gives, from the sample on in steps of ``MUX_CLK``: low word, strobe up, strobe
    down, high word, strobe up, strobe down (LM-PID-9). A reset gives 800h that way and then 80h
    (LM-RST-3).

    Args:
        pwm: the part is a LM629.
        frame_clk: length of a PWM frame.

    Raises:
        ValueError: the frame does not fit the sample a whole number of times.
    """

    STATE: ClassVar[Names] = ("_mode", "_code", "_sign", "_high_clk", "command: float")

    def __init__(self, pwm: bool, frame_clk: int) -> None:
        if frame_clk not in ds.PWM_FRAMES:
            allowed = ", ".join(str(frame) for frame in ds.PWM_FRAMES)
            raise ValueError(f"pwm_frame_clk = {frame_clk}: allowed are {allowed}")
        self._pwm: bool = pwm
        self._frame_clk: i64 = frame_clk
        self._mode: i64 = PWM if pwm else DAC8
        self._code: i64 = ds.ZERO_8
        self._sign: i64 = 0
        self._high_clk: i64 = 0
        self.command: float = 0.0
        """What the amplifier behind the pins gets, -1.0 to 1.0."""

    def zero(self) -> None:
        """A reset begins: zero a 12-bit converter, then an 8-bit one."""
        self.put(0, True)
        if not self._pwm:
            self._mode = ZEROING
            self._code = ds.ZERO_12

    def put(self, command: i64, port8: bool) -> float:
        """Put out the motor command of a sample (LM-PID-8, LM-PID-10); return :attr:`command`.

        Args:
            command: 16 bits signed.
            port8: signals bit 8; the LM629 does not look at it (LM-AMB-16).
        """
        if self._pwm:
            value = command >> 8
            # LM-PID-10: 7 bits and a sign: -128 goes out as -127.
            if value < -127:
                value = -127
            sign: i64 = 0
            magnitude = value
            if value < 0:
                sign = SIGN
                magnitude = -value
            self._sign = sign
            # LM-PID-10: so many of 128 parts of a frame.
            self._high_clk = magnitude * self._frame_clk >> 7
            level = float(value) / 128.0
        elif port8:
            self._mode = DAC8
            # LM-PID-8: the upper 8 bits, offset binary: 80h is zero.
            self._code = (command >> 8) + ds.ZERO_8
            level = float(command >> 8) / 128.0
        else:
            self._mode = DAC12
            # LM-PID-8: the upper 12 bits: 800h is zero.
            self._code = (command >> 4) + ds.ZERO_12
            level = float(command >> 4) / 2048.0
        self.command = level
        return level

    def code(self) -> int:
        """Return the offset-binary code, 8 or 12 bits; on the LM629 the duty in frame clocks."""
        return self._high_clk if self._pwm else self._code

    def word(self, clk: i64) -> i64:
        """Return the pins ``clk`` clock periods after the sample."""
        if self._mode == DAC8:
            return self._code
        if self._mode == PWM:
            high = clk % self._frame_clk < self._high_clk
            return self._sign | MAGNITUDE if high else self._sign
        step = clk // ds.MUX_CLK
        if step > 5:
            # LM-RST-3: behind 800h for a 12-bit converter comes 80h for an 8-bit one.
            if self._mode == ZEROING:
                return ds.ZERO_8
            step = 5
        # LM-PID-9: pin 25 rises in the middle of each word's three steps.
        strobe = STROBE if step % 3 == 1 else 0
        # LM-PID-9: the lower 6 bits first, with pin 24 low.
        if step < 3:
            return (self._code & 0x3F) << 2 | strobe
        return self._code >> 6 << 2 | SECOND | strobe

    def next_change(self, clk: i64) -> i64:
        """Return the clock, after ``clk``, of the pins' next change, or :data:`STEADY`."""
        if self._mode == DAC8:
            return STEADY
        if self._mode == PWM:
            if self._high_clk == 0:
                return STEADY
            phase = clk % self._frame_clk
            edge = self._high_clk if phase < self._high_clk else self._frame_clk
            return clk - phase + edge
        step = clk // ds.MUX_CLK + 1
        last = 6 if self._mode == ZEROING else 5
        return step * ds.MUX_CLK if step <= last else STEADY

    def emits(self) -> bool:
        """Whether every sample moves pins, even if its command is the one before."""
        # LM-PID-9: the two words go out in every sample.
        return self._mode == DAC12


class ServoOutputPins:
    """The output on its pins: brought up to date when looked at, or edge by edge when heard.

    Args:
        output: what is put out.
        clock: the chip's clock.
        pins: pin of bit 0 of the word, bit 1, and so on.

    Attributes:
        anchor: clock cycle from which the output's course counts.
        due: instant of the pins' next change (ps).
    """

    STATE: ClassVar[Names] = ("anchor",)
    DERIVED: ClassVar[Names] = ("_word", "due")

    def __init__(self, output: ServoOutput, clock: Clock, pins: tuple[Pin, ...]) -> None:
        self._output: ServoOutput = output
        self._clock: Clock = clock
        self._pins: tuple[Pin, ...] = pins
        self._word: i64 = -1
        self.anchor: i64 = 0
        self.due: i64 = 0

    def begin(self, cycle: i64) -> None:
        """The output has got something new to show, from ``cycle`` on."""
        self.anchor = cycle
        self.due = 0

    def after_load(self) -> None:
        """Show what has been loaded."""
        self.due = 0

    def show(self, now: i64) -> None:
        """Bring the pins up to ``now``."""
        if now < self.due:
            return
        clk = self._clock.cycle_at(now) - self.anchor
        if clk < 0:
            clk = 0
        word = self._output.word(clk)
        if word != self._word:
            self._word = word
            for bit, pin in enumerate(self._pins):
                pin.drive(word >> bit & 1)
        change = self._output.next_change(clk)
        self.due = self._clock.ps(self.anchor + change) if change != STEADY else NEVER

    def edge(self) -> i64:
        """Return when the next observed edge is; NEVER without a listener."""
        return self.due if self.heard() else NEVER

    def heard(self) -> bool:
        """Whether anybody would notice an edge on one of the pins."""
        return any(pin.net.heard for pin in self._pins)
