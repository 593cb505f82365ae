"""Keywords for Robot Framework: ``Library    vbus.testing.robot``."""

import tempfile
from pathlib import Path
from typing import Any, ClassVar

from vbus.client.bus import Bus
from vbus.core.errors import VbusError
from vbus.protocols.quantities import format_instant
from vbus.serve.in_process import connect_in_process
from vbus.testing.bench import Bench
from vbus.testing.clock import WITHIN
from vbus.testing.execute import Execute
from vbus.testing.judge import FAIL, Judge, accepted
from vbus.testing.tested_board import TestedBoard
from vbus.views.findings.suppress import Suppression


class robot:
    """Virtual boards in Robot Framework tests; each test has boards of its own.

    The class is called like its module, so that Robot Framework finds it.

    Numbers may be written as in C (``0x84``), durations with a unit (``10ms``).
    """

    ROBOT_LIBRARY_SCOPE: ClassVar[str] = "TEST"
    ROBOT_LISTENER_API_VERSION: ClassVar[int] = 3

    def __init__(self) -> None:
        self.ROBOT_LIBRARY_LISTENER = self
        self._bench: Bench | None = None
        self._accepted: list[Suppression] = []
        self._bus: Bus | None = None

    def open_board(
        self,
        board: str,
        seed: int | None = None,
        strict: bool = False,
        plant: str = "",
        violations: str = FAIL,
    ) -> None:
        """Build the test's board from a board file, or from a part number.

        A breach of a datasheet fails the test, unless ``violations=report``.
        """
        if self._bench is not None:
            raise VbusError("Open Board: this test has a board already")
        keywords = {
            "board": board, "seed": seed, "strict": strict, "plant": plant,
            "violations": violations,
        }  # fmt: skip
        judge = Judge(accepted=self._accepted)
        bench = Bench("robot test", keywords, [Path.cwd()], _folder, judge=judge)
        bench.main()
        self._bench = bench

    def accept_violation(self, rule: str, reason: str) -> None:
        """Let the test's host break a rule; it fails if that never happens."""
        self._accepted += accepted("Accept Violation", {rule: reason})

    def advance_time(self, duration: str) -> None:
        """Let chip time pass."""
        self._tested().clock.advance(duration)

    def run_time_until(self, instant: str) -> None:
        """Let chip time pass to an instant since power-on."""
        self._tested().clock.run_until(instant)

    def wait_until(self, condition: str, within: str = WITHIN) -> int:
        """Let chip time pass until a condition holds; return that instant (ps)."""
        return self._tested().clock.wait_until(condition, within)

    def read_bus(self, address: int) -> int:
        """Make one read cycle; return the byte."""
        return self._host().read(address)

    def write_bus(self, address: int, data: int) -> None:
        """Make one write cycle."""
        self._host().write(address, data)

    def bus_should_read(self, address: int, expected: int) -> None:
        """Make one read cycle, and fail unless it gives a byte."""
        found = self.read_bus(address)
        if found != expected:
            raise AssertionError(f"a read at {address:X}H gave {found:02X}h, not {expected:02X}h")

    def position_should_be(self, axis: str, expected: int, within: int = 0) -> None:
        """Fail unless the encoder of an axis (``x.1``) is within some counts of a position."""
        tested = self._tested()
        plant = tested.board.axes.get(axis)
        if plant is None:
            raise VbusError(f"there is no axis {axis!r}; there are {', '.join(tested.board.axes)}")
        if abs(int(plant.count) - expected) > within:
            raise AssertionError(f"axis {axis} is at {plant.count}, not at {expected} +- {within}")

    def arm_fault(self, name: str, target: str = "", when: str = "now", **parameters: Any) -> None:
        """Arm a fault; see ``vbus fault list``."""
        self._tested().board.faults.arm(name, target, when, **parameters)

    def run_host(self, program: str, *arguments: str) -> str:
        """Run a host program on the board; fail unless its exit code is 0; return its output."""
        self._tested()
        assert self._bench is not None
        done = Execute(self._bench)(program, *arguments)
        if not done.ok:
            reason = done.stuck or f"exit code {done.code}"
            raise AssertionError(f"{program}: {reason}\n{done.errors}")
        return done.output

    def _tested(self) -> TestedBoard:
        if self._bench is None:
            raise VbusError("there is no board yet: begin with Open Board")
        return self._bench.main()

    def _host(self) -> Bus:
        tested = self._tested()
        if self._bus is None:
            self._bus = connect_in_process(tested.board)
        return self._bus

    def _end_test(self, data: Any, result: Any) -> None:
        """Fail a test whose host broke a datasheet or whose fault never fired, and say why."""
        bench = self._bench
        if bench is None:
            return
        if self._bus is not None:
            self._bus.close()
        complaints = bench.complaints() if result.passed else []
        bench.relent()
        if result.passed and not complaints:
            complaints = bench.late_complaints(True)
        if result.passed and not complaints:
            complaints = [
                f"{one.rule} is accepted ({one.reason}), and never happened; take it out"
                for one in self._accepted
                if not one.used
            ]
        if complaints:
            result.status, result.message = "FAIL", "\n".join(complaints)
        if not result.passed:
            lines = bench.failure_report().lines[:-1]
            tested = bench.main()
            instant = format_instant(tested.board.now)
            result.message += "\n" + "\n".join([f"at {instant} of chip time:", *lines])
        bench.close()
        self._bench = self._bus = None


def _folder() -> Path:
    return Path(tempfile.mkdtemp(prefix="vbus-robot-"))
