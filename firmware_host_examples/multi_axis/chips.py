"""Packets of the three chip families as bus cycles of a score.

A driver on hardware reads the busy bit before each byte pair. A host that works by the clock knows
how long a chip is busy at most, and leaves that time between them.
"""

from collections.abc import Iterable
from typing import NamedTuple

from multi_axis.score import US, Score


class Cycle(NamedTuple):
    """A bus cycle that has taken place; the instant is that of the board (ps)."""

    when: int
    write: bool
    address: int
    data: int


class Reading(NamedTuple):
    """A position, and when the chip was asked for it (ps)."""

    when: int
    counts: int


class Lm629:
    """One LM629: commands and words, busy for 15 us after each at 8 MHz."""

    LFIL, LTRJ, STT, UDF, RSTI, MSKI, RDRP = 0x1E, 0x1F, 0x01, 0x04, 0x1D, 0x1C, 0x0A
    STEP = 18 * US

    def __init__(self, score: Score, chip: str) -> None:
        self.score, self.chip = score, chip

    def command(self, at: int, code: int, *words: int, read: int = 0) -> int:
        """Send a command with its words, read words; return when the chip is ready again."""
        self.score.write(at, self.chip, 0, code)
        for word in words:
            at += self.STEP
            self.score.write(at, self.chip, 1, word >> 8, word)
        for _ in range(read):
            at += self.STEP
            self.score.read(at, self.chip, 1, 2)
        return at + self.STEP

    @classmethod
    def positions(cls, cycles: Iterable[Cycle]) -> list[Reading]:
        """Return what RDRP gave."""
        return _answers(cycles, command_at=0, data_at=1, code=cls.RDRP)


class Mcp1200:
    """One MCP-1200: registers by address, most significant byte first."""

    FLAG, FEATURE, CONFIG, CAPTURE_CONTROL, EXCEPTION, MODE, STATUS = 0, 1, 2, 3, 4, 5, 7
    TIMER, PRESCALER, INTERPOLATOR = (0x0F,), (0x10, 0x11), (0x18,)
    ACTUAL, FINAL, CAPTURE = (0x12, 0x13, 0x14), (0x2B, 0x2A, 0x29), (0x30, 0x2F, 0x2E)
    BREAKPOINT = (0x3F, 0x3E, 0x3D)
    KP, KI, KD, KA, KV = 0x61, 0x62, 0x63, 0x69, 0x6A

    def __init__(self, score: Score, chip: str) -> None:
        self.score, self.chip = score, chip

    def write(self, at: int, registers: int | tuple[int, ...], value: int) -> int:
        """Write a register; return when the next cycle may follow."""
        places = (registers,) if isinstance(registers, int) else registers
        for place, address in enumerate(places):
            self.score.write(at, self.chip, address, value >> 8 * (len(places) - 1 - place))
            at += US
        return at

    def read(self, at: int, registers: tuple[int, ...]) -> int:
        """Read a register, least significant byte first."""
        for address in reversed(registers):
            self.score.read(at, self.chip, address)
            at += US
        return at

    @classmethod
    def values(cls, cycles: Iterable[Cycle], registers: tuple[int, ...]) -> list[Reading]:
        """Return what was read of a signed register."""
        found: list[Reading] = []
        taken: list[Cycle] = []
        for cycle in cycles:
            if cycle.write or cycle.address not in registers:
                continue
            taken.append(cycle)
            if len(taken) == len(registers):
                data = bytes(c.data for c in taken)
                found.append(Reading(taken[0].when, int.from_bytes(data, "little", signed=True)))
                taken = []
        return found


class Mc1241a:
    """One MC1241A: packets without their checksum, busy for 67.5 us after each word."""

    SET_1, SET_2, SET_PRFL_VEL, SET_PRFL_S_CRV, SET_PRFL_GEAR = 0x01, 0x02, 0x0A, 0x0B, 0x0C
    SET_POS, SET_VEL, SET_ACC, SET_MAX_ACC, SET_JERK, SET_RATIO = 0x10, 0x11, 0x12, 0x15, 0x13, 0x14
    UPDATE = 0x1A
    SET_PHASE_2, SET_STEP_RATIO, SET_BUF_MTR_CMD, MULTI_UPDATE = 0x74, 0x68, 0x77, 0x5B
    SET_POS_BRK, SET_BRK_PNT, SET_INTRPT_MASK = 0x18, 0x16, 0x2F
    SET_AUTO_UPDATE_OFF, LMTS_OFF, SET_CAPT_HOME = 0x5D, 0x71, 0x65
    GET_ACTL_POS, GET_CAPT = 0x37, 0x36
    COMMAND, DATA = 1, 0
    STEP = 72 * US

    def __init__(self, score: Score, chip: str) -> None:
        self.score, self.chip = score, chip

    def packet(self, at: int, code: int, *words: int, read: int = 0) -> int:
        """Send a command and 16-bit words, read words; return when the chip is ready again."""
        self.score.write(at, self.chip, self.COMMAND, code)
        for word in words:
            at += self.STEP
            self.score.write(at, self.chip, self.DATA, word >> 8, word)
        for _ in range(read):
            at += self.STEP
            self.score.read(at, self.chip, self.DATA, 2)
        return at + self.STEP

    def long(self, at: int, code: int, value: int) -> int:
        """Send a command with a value of 32 bits."""
        return self.packet(at, code, value >> 16 & 0xFFFF, value & 0xFFFF)

    @classmethod
    def positions(cls, cycles: Iterable[Cycle], axis: int) -> list[Reading]:
        """Return what GET_ACTL_POS gave of an axis, the current one when it was asked."""
        current = 1
        kept: list[Cycle] = []
        for cycle in cycles:
            if cycle.write and cycle.address == cls.COMMAND and cycle.data in (1, 2):
                current = cycle.data
            if current == axis:
                kept.append(cycle)
        return _answers(kept, cls.COMMAND, cls.DATA, cls.GET_ACTL_POS)

    @classmethod
    def capture(cls, cycles: Iterable[Cycle]) -> list[Reading]:
        """Return what GET_CAPT gave."""
        return _answers(cycles, cls.COMMAND, cls.DATA, cls.GET_CAPT)


def _answers(cycles: Iterable[Cycle], command_at: int, data_at: int, code: int) -> list[Reading]:
    """Return the 32-bit answers to a command."""
    found: list[Reading] = []
    asked = -1
    taken = bytearray()
    for cycle in cycles:
        if cycle.write:
            asked = cycle.when if (cycle.address, cycle.data) == (command_at, code) else -1
            taken.clear()
        elif asked >= 0 and cycle.address == data_at:
            taken.append(cycle.data)
            if len(taken) == 4:
                found.append(Reading(asked, int.from_bytes(taken, "big", signed=True)))
                asked = -1
    return found
