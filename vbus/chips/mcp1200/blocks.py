"""The blocks inside, put together."""

from collections.abc import Callable
from typing import Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.control_loop import ControlLoop
from vbus.chips.mcp1200.counter import Breakpoint, PositionCounter
from vbus.chips.mcp1200.drive import PlantDrive
from vbus.chips.mcp1200.encoder import EncoderCourse
from vbus.chips.mcp1200.motor_command import Pwm
from vbus.chips.mcp1200.registers import RegisterFile
from vbus.chips.mcp1200.rest import SteadyState
from vbus.chips.mcp1200.stepper import Stepper
from vbus.chips.mcp1200.timer import FAR, SampleTimer
from vbus.chips.mcp1200.writes import Writes
from vbus.kernel import Clock
from vbus.options import Value
from vbus.signals import Rule

Report = Callable[[Rule, int, int, str, int], bool]

HELD: Final = 0
"""/RESET is low, or the supply has just come."""
RESETTING: Final = 1
STANDING: Final = 2
"""Idle mode."""
CONTROL: Final = 3

NO_REQUEST: Final = -1
"""The host has written nothing to R05 since the last sample."""
NOT_RELEASED: Final = -1
"""/RESET has not risen just now."""


class Blocks:
    """The blocks of the manual's block diagram, put together, and what state they are in.

    Args:
        clock: the CLK input.
        settings: the chip's board file keys.
        report: files a violation.

    Attributes:
        state: :data:`HELD`, :data:`RESETTING`, :data:`STANDING` or :data:`CONTROL`.
        released: cycle in which Pulse is high after a hard reset, else
            :data:`NOT_RELEASED`.
        writes: what the host has written, before it is visible.
    """

    def __init__(self, clock: Clock, settings: dict[str, Value], report: Report) -> None:
        self._clock: Final[Clock] = clock
        self._report: Report = report
        registers = RegisterFile()
        self.registers: Final[RegisterFile] = registers
        self.loop: Final[ControlLoop] = ControlLoop(registers, settings["unipolar"] == "clip")
        self.timer: Final[SampleTimer] = SampleTimer(registers)
        self.encoder: Final[EncoderCourse] = EncoderCourse(clock.hz)
        self.stepper: Final[Stepper] = Stepper(registers)
        self.breakpoint: Final[Breakpoint] = Breakpoint(registers)
        self.counter: Final[PositionCounter] = PositionCounter(
            registers,
            self.encoder,
            self.stepper,
            self.breakpoint,
            self.loop.faults,
            settings["index"] == "high",
        )
        self.pwm: Final[Pwm] = Pwm(registers)
        self.drive: Final[PlantDrive] = PlantDrive(
            registers, self.encoder, self.stepper, self.loop.following, settings
        )
        self.rest: Final[SteadyState] = SteadyState(self.loop, self.drive, self.encoder)
        self.state: i64 = HELD
        self.released: i64 = NOT_RELEASED
        self.writes: Final[Writes] = Writes()
        self._request: i64 = NO_REQUEST
        self._aiming: bool = False
        """The loop has closed: followers may follow its aim."""
        self._at_reset: i64 = FAR
        self._at_sample: i64 = FAR
        self._at_results: i64 = FAR
        self._at_routine: i64 = FAR

    def report(self, rule: Rule, cycle: int, measured: int = 0, detail: str = "") -> None:
        """File a violation of clock cycle ``cycle``."""
        self._report(rule, measured, 0, detail, self._clock.ps(cycle))

    # -- modes and the sample timer -----------------------------------------------------------

    def controlling(self) -> bool:
        """Whether mode flags take effect: control mode, not halted."""
        return self.state == CONTROL and not self.loop.halted

    def request(self, mode: int, cycle: int) -> None:
        """R05 has been written (MCP-MOD-1)."""
        self._request = mode
        if self.state == STANDING and mode != ds.CONTROL_CODE:
            self._request = NO_REQUEST
            if mode == ds.SOFT_RESET_CODE:
                self._begin_reset(cycle)
            elif mode == ds.IDLE_CODE:
                self.loop.enter_idle()
        elif self.state < STANDING:
            self._request = NO_REQUEST

    def _begin_reset(self, cycle: int) -> None:
        self.state = RESETTING
        self._stop()
        self.registers.flag = 0
        self.registers.mode = 0
        self.registers.status &= ~ds.BUSY
        self.stepper.stop(cycle)
        self._at_reset = cycle + ds.RESET_CLK

    def _stop(self) -> None:
        self._request = NO_REQUEST
        self.hold_timer()
        self._at_results = FAR
        self._aiming = False

    def hold_timer(self) -> None:
        """The sample timer stands."""
        self.timer.running = False
        self._at_sample = FAR
        self._at_routine = FAR

    def start_timer(self, cycle: i64) -> None:
        """The sample timer begins a period."""
        self._at_sample = self.timer.reload(cycle)
