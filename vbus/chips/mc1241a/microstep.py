"""Microstep waveforms: from the angle and the motor command to two phase outputs."""

from math import pi, sin
from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mc1241a.datasheet import FULL_SCALE, SLOTS, TWO_PHASE
from vbus.core.state import Names

STEPS: Final = 256
"""Microsteps in an electrical cycle: four full steps of 64 (PMD-USTP-1)."""
_CYCLE: Final = (STEPS << 32) - 1
_WAY: Final = 8 * (STEPS << 32) - 1
"""Eighths of a way: what lies beyond makes whole electrical cycles."""


def _wave(lead: float) -> tuple[int, ...]:
    """Return one electrical cycle of a sine that leads phase A by ``lead`` cycles."""
    table = []
    for i in range(STEPS):
        exact = FULL_SCALE * sin(2 * pi * (i / STEPS + lead))
        # The nudge decides sin 30 degrees, which is half way, in the same way on every machine.
        size = int(abs(exact) + 0.5 + 1e-6)
        table.append(size if exact > 0 else -size)
    return tuple(table)


PHASE_A: Final = _wave(0)
PHASE_B: Final[dict[tuple[bool, bool], tuple[int, ...]]] = {
    # (two phases, B leads A): a quarter or a third of a cycle apart (PMD-USTP-3).
    (True, True): _wave(1 / 4),
    (True, False): _wave(-1 / 4),
    (False, True): _wave(1 / 3),
    (False, False): _wave(-1 / 3),
}


def scaled(command: i64, wave: i64) -> i64:
    """Return ``command * wave / 32767`` rounded, halves away from zero (PMD-USTP-4)."""
    product = command * wave
    if product < 0:
        return -((2 * -product + FULL_SCALE) // (2 * FULL_SCALE))
    return (2 * product + FULL_SCALE) // (2 * FULL_SCALE)


def dac_word(output: int) -> int:
    """Return the DAC16 word of a phase output: offset binary (PMD-USTP-5)."""
    return 32_768 + output


def pwm_magnitude(output: int) -> int:
    """Return how many of a frame's 256 clocks the magnitude pin is high (PMD-USTP-6)."""
    # PMD-AMB-3, PMD-AMB-22: 8 bits: 256 clocks at 25 MHz are the 97.6 kHz that are printed.
    return abs(output) + 64 >> 7


class PhasePlace:
    """What both phases put out at one place in the electrical cycle, of full scale."""

    def __init__(self, a: i64, b: i64) -> None:
        self.a: i64 = a
        self.b: i64 = b


def _places(two_phase: bool, b_leads: bool) -> list[PhasePlace]:
    """Return one electrical cycle of both phases, in the machine words of a compiled core."""
    return [PhasePlace(a, b) for a, b in zip(PHASE_A, PHASE_B[two_phase, b_leads], strict=True)]


class Microstepper:
    """The look-ups of one axis: eight angles a cycle, two outputs each (PMD-USTP-2).

    Args:
        b_leads: phase B leads phase A.
    """

    STATE: ClassVar[Names] = (
        "two_phase: bool", "_shift", "_from: int", "_moved: int", "_held_slot", "_held_a",
        "_held_b",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_three", "_two")
    DERIVED: ClassVar[Names] = ("_start", "_way")

    def __init__(self, b_leads: bool) -> None:
        self._two: list[PhasePlace] = _places(True, b_leads)
        self._three: list[PhasePlace] = _places(False, b_leads)
        self.two_phase: bool = False
        self._shift: int = 0
        self._from: int = 0
        self._moved: int = 0
        self._start: i64 = 0
        self._way: i64 = 0
        self._held_slot: i64 = -1
        self._held_a: i64 = 0
        self._held_b: i64 = 0

    def reset(self) -> None:
        """Angle 0, three phases."""
        self.two_phase = False
        self._shift = 0
        self._held_slot = -1
        self.begin_cycle(0, 0)

    def begin_cycle(self, start: int, moved: int) -> None:
        """Spread a cycle's motion over its eight slots.

        Args:
            start: target position at the cycle's start (2^-32 usteps).
            moved: what the profile generator adds to it in this cycle.
        """
        self._from = start + self._shift
        self._moved = moved
        self._reduce()

    def _reduce(self) -> None:
        """Leave whole electrical cycles out: what makes a difference to the angle fits words."""
        self._start = self._from & _CYCLE
        self._start *= 8
        self._way = self._moved & _WAY

    def renumber(self, before: int, after: int) -> None:
        """The target becomes ``after`` instead of ``before`` (2^-32 usteps) and the angle stays.

        SET_ACTL_POS and SYNCH_PRFL give a position another name; no step is made, nor a part of
        one (PMD-USTP-1).
        """
        # PMD-USTP-1: the angle counts generated motion alone.
        self._shift = self._shift + before - after & _CYCLE

    def angle(self, slot: i64) -> i64:
        """Return the place in the electrical cycle (0..255) of slot 1 to 8 of this cycle."""
        # PMD-USTP-2: whole usteps of P + v*j/8, modulo 256.
        return (self._start + self._way * slot >> 35) & (STEPS - 1)

    def hold(self, slot: i64, command: i64) -> None:
        """Remember the present outputs until the next look-up: the command is about to change.

        Args:
            slot: number of the present slot since reset.
            command: motor command of that look-up.
        """
        if self._held_slot != slot:
            self._held_a, self._held_b = self._look_up(slot, command)
            self._held_slot = slot

    def outputs(self, slot: i64, command: i64) -> tuple[i64, i64]:
        """Return both phase outputs (-32767 to 32767) as looked up in a slot since reset."""
        if slot == self._held_slot:
            return self._held_a, self._held_b
        return self._look_up(slot, command)

    def _look_up(self, slot: i64, command: i64) -> tuple[i64, i64]:
        angle = self.angle((slot & SLOTS - 1) + 1)
        place = self._two[angle] if self.two_phase else self._three[angle]
        return scaled(command, place.a), scaled(command, place.b)

    @property
    def phase_info(self) -> int:
        """GET_PHASE_INFO: bit 3, two phases (PMD-CMD-80)."""
        # PMD-AMB-27: bit 3 alone has a name.
        return TWO_PHASE if self.two_phase else 0

    def still(self) -> bool:
        """Whether every slot of this cycle has the same angle."""
        return self._moved == 0

    def after_load(self) -> None:
        """Find what makes a difference to the angle."""
        self._reduce()
