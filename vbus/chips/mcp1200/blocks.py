"""The blocks inside, put together."""

from collections.abc import Callable
from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.control_loop import ControlLoop
from vbus.chips.mcp1200.counter import Breakpoint, PositionCounter
from vbus.chips.mcp1200.drive import PlantDrive
from vbus.chips.mcp1200.encoder import EncoderCourse
from vbus.chips.mcp1200.motor_command import Pwm
from vbus.chips.mcp1200.registers import RegisterFile
from vbus.chips.mcp1200.stepper import Stepper
from vbus.chips.mcp1200.timer import FAR, SampleTimer
from vbus.core.kernel import Clock
from vbus.core.options import Value
from vbus.core.signals import Rule
from vbus.core.state import Names, save


class SteadyState:
    """Knows whether the next samples will be like the last one.

    In control mode a sample is a function of registers, control loop, plant and inputs. If two
    samples in a row have left all of that the same, so will every further one, until something
    from outside disturbs it. Nothing is estimated: skipping and stepping give the same state.

    Args:
        loop: what a control sample computes.
        drive: what the plant is driven with.
        encoder: the plant's periods.
    """

    WIRING: ClassVar[Names] = ("_drive", "_encoder", "_loop")
    DERIVED: ClassVar[Names] = ("_repeats", "_state")

    def __init__(self, loop: ControlLoop, drive: PlantDrive, encoder: EncoderCourse) -> None:
        self._loop: Final[ControlLoop] = loop
        self._drive: Final[PlantDrive] = drive
        self._encoder: Final[EncoderCourse] = encoder
        self._state: tuple[object, ...] = ()
        self._repeats: bool = False

    def disturb(self) -> None:
        """Something has happened that the last sample did not know of."""
        self._state = ()
        self._repeats = False

    def note(self) -> None:
        """A control sample with no change of command has shown its results: compare it."""
        if not self._drive.at_rest():
            self.disturb()
            return
        now = (self._loop.registers.image, save(self._loop))
        self._repeats = now == self._state
        self._state = now

    def possible(self, cycle: i64, control: bool) -> bool:
        """Tell whether the sample that starts at ``cycle`` would repeat the one before.

        Args:
            cycle: start of the sample that is due.
            control: the loop is closed; in idle mode only the plant must rest.
        """
        if control and not self._repeats:
            return False
        return self._encoder.plant is None or (self._encoder.end == cycle and self._drive.at_rest())

    def lasts(self, control: bool, sampling: bool) -> bool:
        """Tell whether all further samples repeat the last one, and none need be computed.

        Args:
            control: the loop is closed.
            sampling: the sample timer runs and goes on. The plant's periods are only passed over
                from sample to sample.
        """
        if control:
            return self._repeats and self._drive.at_rest()
        return self._encoder.plant is None or (sampling and self._drive.at_rest())


class Writes:
    """Written bytes on their way in, in order (MCP-BUS-5).

    Attributes:
        due: cycle at which the first of them becomes visible, :data:`FAR` if there is none.
    """

    STATE: ClassVar[Names] = ("_waiting: list[(i64, i64, i64), ...]",)
    DERIVED: ClassVar[Names] = ("due",)

    def __init__(self) -> None:
        self._waiting: list[tuple[int, int, int]] = []
        self.due: i64 = FAR

    def add(self, cycle: int, address: int, data: int) -> None:
        """A byte has been written in ``cycle``."""
        self._waiting.append((cycle + ds.WRITE_CLK, address, data))
        self.after_load()

    def take(self) -> tuple[int, int]:
        """Return address and data of the first byte, which is visible now."""
        _, address, data = self._waiting.pop(0)
        self.after_load()
        return address, data

    def waits_for(self, registers: tuple[int, ...]) -> bool:
        """Tell whether a byte is on its way to one of some registers."""
        return any(address & 0x3F in registers for _, address, _ in self._waiting)

    def lose(self) -> None:
        """Forget the byte written last, if it is not yet visible."""
        del self._waiting[-1:]
        self.after_load()

    def clear(self) -> None:
        """Forget all of them."""
        self._waiting.clear()
        self.after_load()

    def after_load(self) -> None:
        """Find out when the first of them becomes visible."""
        self.due = self._waiting[0][0] if self._waiting else FAR


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

    def entering(self) -> bool:
        """Whether R05 = 03 waits for its sample in idle mode."""
        return self.state == STANDING and self._request == ds.CONTROL_CODE

    def closed(self) -> bool:
        """Whether the loop drives the counted position to the command position."""
        return self.state == CONTROL and not self.registers.step_mode

    def request(self, mode: int, cycle: int) -> None:
        """R05 has been written (MCP-MOD-1)."""
        waiting = self._request
        if waiting != NO_REQUEST and (
            waiting < ds.HALT_CODE <= mode or (self.state == STANDING and mode == ds.HALT_CODE)
        ):
            text = f"R05 = {mode:02X} comes before the sample that obeys R05 = {waiting:02X}"
            self.report(ds.MODE_LOST, cycle, mode, text)
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
