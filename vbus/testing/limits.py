"""How long a host may go on before a test says that it hangs, counted in chip time."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from vbus.board.board import Board
from vbus.faults.armed import BEGUN
from vbus.kernel import SECOND
from vbus.protocols.quantities import format_instant
from vbus.signals import Violation
from vbus.trace.decode import BoardPackets
from vbus.trace.findings.no_effect import NoEffect
from vbus.trace.latest_lines import LatestLines
from vbus.trace.packets import Packet

KEPT: Final = 40
"""Lines of a transcript that are kept."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds of a host's run. The first two count what repeats, so a verdict repeats too.

    Attributes:
        cycles: bus cycles.
        chip_time: instant at which the host must be done (ps).
        wall: seconds of wall time, for a host that does nothing at all on the bus.
    """

    cycles: int = 100_000
    chip_time: int = 60 * SECOND
    wall: float = 60.0


class Watch(BoardPackets):
    """Counts a host's bus cycles, keeps the last ones in the manual's words, and knows its limits.

    Args:
        board: the board; the watch observes it from now on.
        limits: the bounds.
        over: is called once, with a sentence, when a bound is passed.
        times: begin each line with the instant of its first packet's end.
    """

    def __init__(
        self,
        board: Board,
        limits: Limits,
        over: Callable[[str], None] | None = None,
        times: bool = False,
    ) -> None:
        super().__init__({chip.name: chip.FAMILY for chip in board.chips}, self._packet)
        self.cycles: int = 0
        self.stuck: str = ""
        """Which bound was passed, as a sentence; "" if none was."""
        self.violations: list[Violation] = []
        self.faulted: dict[str, int] = {}
        """Instant at which a fault first began, by chip; "" is a link, and so every chip."""
        self.no_effect: NoEffect = NoEffect()
        self._chips: list[str] = [chip.name for chip in board.chips]
        self._lines: LatestLines = LatestLines(maxlen=KEPT)
        self._limits: Limits = limits
        self._over: Callable[[str], None] | None = over
        self._times: bool = times
        board.observe(self)

    @property
    def lines(self) -> list[str]:
        """The latest packets and violations."""
        return [
            f"{format_instant(line.when)} {line.counted()}" if self._times else line.counted()
            for line in self._lines
        ]

    def _packet(self, chip: str, packet: Packet) -> None:
        self.no_effect.add(packet)
        self._lines.add(packet.end, f"{chip} {packet.text}")

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Count a cycle."""
        self.cycles += 1
        super().bus_cycle(when, host, chip, write, address, data)
        if self.cycles > self._limits.cycles:
            self.pass_bound(f"it made more than {self._limits.cycles} bus cycles")
        elif when > self._limits.chip_time:
            self.pass_bound(
                f"it was not done after {self._limits.chip_time / SECOND:g} s of chip time"
            )

    def violation(self, violation: Violation) -> None:
        """Keep a violation."""
        super().violation(violation)
        self.violations.append(violation)
        if self.loses(violation):  # its cycle says so
            return
        text = f"{violation.chip} ! {violation.rule}: {violation.detail}"
        self._lines.add(violation.when, text)

    def fault(self, when: int, name: str, target: str, what: str, text: str) -> None:
        """Remember on which chip a fault has begun."""
        if what == BEGUN:
            chip = target.partition(".")[0]
            self.faulted.setdefault(chip if chip in self._chips else "", when)

    def pass_bound(self, sentence: str) -> None:
        """Say that the host hangs, if nothing has said so before."""
        if not self.stuck:
            self.stuck = sentence
            if self._over is not None:
                self._over(sentence)
