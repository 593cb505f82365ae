"""MCP-1200: what a driver written for the HCTL-1100 does that this chip takes differently."""

from collections.abc import Iterator
from typing import ClassVar, Final

from vbus.core.signals import Rule
from vbus.views.findings.report import Uses


def _rule(name: str, clause: str, title: str) -> Rule:
    return Rule(f"mcp1200.hctl-1100.{name}", clause, title, "warning")


PROPORTIONAL: Final = _rule(
    "proportional", "MCP-FLG-1",
    "F3 was proportional velocity control, which is gone; F3 is velocity interpolation here.",
)  # fmt: skip
VELOCITY_ORDER: Final = _rule(
    "velocity-order", "MCP-REG-24",
    "R23 was the low and R24 the high byte of the velocity; here R23 is the highest, R25 the last.",
)  # fmt: skip
COMMUTATOR: Final = _rule(
    "commutator", "MCP-REG-18",
    "R18 to R1F were the commutator, which is gone; these registers do something else here.",
)  # fmt: skip
HOLD_COMMUTATOR: Final = _rule(
    "hold-commutator", "MCP-FLG-1",
    "F4 held the commutator, which is gone; F4 is position interpolation here.",
)  # fmt: skip
PRESCALER: Final = _rule(
    "prescaler", "MCP-SMP-1",
    "A sample was 16 (R0F + 1) clocks; here 64 of them until R10, R11 are written.",
)  # fmt: skip
POSITION_ORDER: Final = _rule(
    "position-order", "MCP-REG-16",
    "The position is latched when R14 is read: R12 and R13 read before it are those of last time.",
)  # fmt: skip
ALIGN: Final = _rule(
    "align", "MCP-MOD-7", "R05 = 02 aligned the commutator; here it halts the motion."
)
UNIPOLAR: Final = _rule(
    "unipolar", "MCP-FLG-2", "F2 was the unipolar flag; here that is bit 2 of R01."
)

COMMUTATOR_REGISTERS: Final = range(0x18, 0x20)
POSITION: Final = (0x12, 0x13)
SIX_BITS: Final = 0x3F


class Hctl1100Uses(Uses):
    """Bus cycles of a driver for the HCTL-1100."""

    RULES: ClassVar[tuple[Rule, ...]] = (
        PROPORTIONAL, VELOCITY_ORDER, COMMUTATOR, HOLD_COMMUTATOR, PRESCALER, POSITION_ORDER,
        ALIGN, UNIPOLAR,
    )  # fmt: skip

    def __init__(self) -> None:
        self._latched: set[int] = set()
        """Bytes of the position that the last read of R14 has latched and that are not read yet."""
        self._prescaler: bool = False
        """Whether the host has set the prescaler."""

    def cycle(self, write: bool, address: int, data: int) -> Iterator[tuple[Rule, str]]:
        """Give what the cycle meant to an HCTL-1100."""
        address &= SIX_BITS
        yield from self._write(address, data) if write else self._read(address)

    def _read(self, address: int) -> Iterator[tuple[Rule, str]]:
        if address == 0x14:
            self._latched = {*POSITION}
        elif address in POSITION:
            if address not in self._latched:
                yield POSITION_ORDER, f"R{address:02X} is read before R14; read R14 first"
            self._latched.discard(address)

    def _write(self, address: int, data: int) -> Iterator[tuple[Rule, str]]:
        if address == 0x00:
            yield from self._flag(data)
        elif address == 0x05 and data == 0x02:
            yield ALIGN, "R05 = 02 halts the motion; leave it out"
        elif address in (0x10, 0x11):
            self._prescaler = True
        elif address == 0x0F and not self._prescaler:
            yield (
                PRESCALER,
                (
                    f"R0F = {data:02X}: a sample of {64 * (data + 1)} clocks, not of"
                    f" {16 * (data + 1)}; write R10, R11 first, or run it at four times the clock"
                ),
            )
        elif address in (0x23, 0x24):
            yield (
                VELOCITY_ORDER,
                f"R{address:02X} = {data:02X} is another byte of it here",
            )
        elif address in COMMUTATOR_REGISTERS:
            yield COMMUTATOR, f"R{address:02X} = {data:02X} sets up no commutator here"

    def _flag(self, data: int) -> Iterator[tuple[Rule, str]]:
        """Judge what is set; to clear a flag that is clear changes nothing."""
        number = data & 0x07
        if not data & 0x08:
            return
        if number == 3:
            yield PROPORTIONAL, "0Bh begins velocity interpolation; use F5, integral velocity"
        elif number == 4:
            yield HOLD_COMMUTATOR, "0Ch begins position interpolation; leave it out"
        elif number == 2:
            yield UNIPOLAR, "0Ah does nothing here; set bit 2 of R01"
