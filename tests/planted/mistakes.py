"""The planted mistakes: a driver, a line or two of it changed, and what comes of it.

``red`` is what the driver's own tests must do; a rule's name is what must name the cause where they
pass: as a violation that fails the test, or as a note in the summary.
"""

from typing import NamedTuple

RED = "red"
SILENT = "silent"


class Mistake(NamedTuple):
    """One planted mistake.

    Attributes:
        what: the mistake in a few words.
        driver: the file in ``drivers``.
        before: the line or lines of the right driver.
        after: what stands there instead.
        comes_to: :data:`RED`, the name of the rule that names the cause, or :data:`SILENT`.
    """

    what: str
    driver: str
    before: str
    after: str
    comes_to: str = RED


def _of(driver: str, *rows: tuple[str, ...]) -> list[Mistake]:
    return [Mistake(row[0], driver, *row[1:]) for row in rows]


LM629_AXIS = _of(
    "lm629_axis",
    (
        "words of a long swapped",
        "        self.put(value >> 16 & 0xFFFF)\n        self.put(value & 0xFFFF)",
        "        self.put(value & 0xFFFF)\n        self.put(value >> 16 & 0xFFFF)",
    ),
    (
        "bytes of a word swapped",
        "        self.bus.write(1, word >> 8 & 0xFF)\n        self.bus.write(1, word & 0xFF)",
        "        self.bus.write(1, word & 0xFF)\n        self.bus.write(1, word >> 8 & 0xFF)",
    ),
    (
        "bytes of a reply swapped",
        "return high << 8 | self.bus.read(1)",
        "return self.bus.read(1) << 8 | high",
    ),
    (
        "words of a reply swapped",
        "value = high << 16 | self.get()",
        "value = self.get() << 16 | high",
    ),
    (
        "a reply is not signed",
        "        return value - (1 << 32) if value & 0x80000000 else value",
        "        return value",
    ),
    (
        "the sign bit of 16",
        "value - (1 << 32) if value & 0x80000000",
        "value - (1 << 32) if value & 0x8000",
    ),
    (
        "busy not awaited before a command",
        "        self.ready()\n        self.bus.write(0, code)",
        "        self.bus.write(0, code)",
    ),
    (
        "busy not awaited before data",
        "        self.ready()\n        self.bus.write(1, word >> 8 & 0xFF)",
        "        self.bus.write(1, word >> 8 & 0xFF)",
    ),
    (
        "busy not awaited before a reply",
        "        self.ready()\n        high = self.bus.read(1)",
        "        high = self.bus.read(1)",
    ),
    (
        "the wrong bit for busy",
        "BUSY, COMPLETE, ERROR, BREAKPOINT = 0x01",
        "BUSY, COMPLETE, ERROR, BREAKPOINT = 0x80",
    ),
    ("UDF forgotten", "        self.put(il)\n        self.command(UDF)", "        self.put(il)"),
    (
        "UDF before the last word",
        "        self.put(il)\n        self.command(UDF)",
        "        self.command(UDF)\n        self.put(il)",
    ),
    (
        "STT forgotten in a move",
        "        self.put_long(pos)\n        self.command(STT)",
        "        self.put_long(pos)",
    ),
    ("commands and data exchanged", "self.bus.write(0, code)", "self.bus.write(1, code)"),
    (
        "the flag of the move before is not cleared",
        "        self.clear(COMPLETE)\n        self.start(acc, vel, pos)",
        "        self.start(acc, vel, pos)",
    ),
    ("RSTI with the mask not inverted", "self.put(~flags & 0xFFFF)", "self.put(flags)"),
    ("RSTI of all flags", "self.put(~flags & 0xFFFF)", "self.put(0)", SILENT),
    ("the load bits of another order", "self.put(0x002A)", "self.put(0x0015)"),
    ("position as a relative one", "self.put(0x002A)", "self.put(0x002B)"),
    (
        "velocity without its high word",
        "        self.put_long(vel)\n        self.put_long(pos)",
        "        self.put_long(vel & 0xFFFF)\n        self.put_long(pos)",
    ),
    (
        "velocity not scaled by 65536",
        "        self.put_long(vel)\n        self.put_long(pos)",
        "        self.put_long(vel >> 16)\n        self.put_long(pos)",
    ),
    (
        "acceleration and velocity exchanged",
        "        self.put_long(acc)\n        self.put_long(vel)\n        self.put_long(pos)",
        "        self.put_long(vel)\n        self.put_long(acc)\n        self.put_long(pos)",
    ),
    (
        "position off by one bit",
        "self.put_long(pos)\n        self.command(STT)",
        "self.put_long(pos << 1)\n        self.command(STT)",
    ),
    (
        "position cut to 16 bits",
        "self.put_long(pos)\n        self.command(STT)",
        "self.put_long(pos & 0xFFFF)\n        self.command(STT)",
    ),
    (
        "position without its sign",
        "self.put_long(pos)\n        self.command(STT)",
        "self.put_long(abs(pos))\n        self.command(STT)",
    ),
    (
        "a load fewer than the control word says",
        "        self.put_long(acc)\n        self.put_long(vel)\n        self.put_long(pos)",
        "        self.put_long(acc)\n        self.put_long(pos)",
    ),
    ("kp forgotten", "        self.put(kp)\n", ""),
    (
        "kp and ki exchanged",
        "        self.put(kp)\n        self.put(ki)",
        "        self.put(ki)\n        self.put(kp)",
    ),
    ("kd is 0", "self.put(kd)", "self.put(0)"),
    ("kp is 0", "self.put(kp)", "self.put(0)"),
    ("il is 0", "self.put(il)", "self.put(0)"),
    ("derivative interval in the low byte", "self.put(ds << 8 | 0x0F)", "self.put(ds | 0x0E)"),
    ("gains all of the high byte", "self.put(kp)", "self.put(kp << 8)"),
    (
        "LPES forgotten its data",
        "        self.command(LPES)\n        self.put(counts)",
        "        self.command(LPES)",
    ),
    (
        "LPEI for LPES",
        "LPES, SBPA = 0x1E, 0x1F, 0x1D, 0x1C, 0x1B",
        "LPES, SBPA = 0x1E, 0x1F, 0x1D, 0x1C, 0x1A",
        SILENT,
    ),
    ("a limit of the error that is too small", "self.put(counts)", "self.put(counts >> 8)"),
    (
        "the breakpoint relative",
        "SBPA = 0x1E, 0x1F, 0x1D, 0x1C, 0x1B, 0x20",
        "SBPA = 0x1E, 0x1F, 0x1D, 0x1C, 0x1B, 0x21",
    ),
    ("the wrong flag awaited", "axis.wait(BREAKPOINT)", "axis.wait(COMPLETE)"),
    ("velocity mode forgotten", "self.put(0x1828)", "self.put(0x0028)"),
    ("velocity mode backward", "self.put(0x1828)", "self.put(0x0828)"),
    ("motor off in place of a smooth stop", "self.put(0x0400)", "self.put(0x0100)"),
    (
        "STT after a stop forgotten",
        "        self.put(0x0400)\n        self.command(STT)",
        "        self.put(0x0400)",
    ),
    ("two stop bits", "self.put(0x0400)", "self.put(0x0600)"),
    ("home is not defined", "        self.command(DFH)", "        pass"),
    (
        "desired position for the real one",
        "        self.command(RDRP)",
        "        self.command(RDDP)",
        SILENT,
    ),
    (
        "a wrong command code",
        "STT, UDF, RDRP, RDDP = 0x01, 0x04, 0x0A",
        "STT, UDF, RDRP, RDDP = 0x01, 0x04, 0x0B",
    ),
)

MISTAKES: list[Mistake] = [*LM629_AXIS]
