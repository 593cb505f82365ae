"""The blocks inside, and what they ask of the whole."""

from collections.abc import Callable

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.capture import Breakpoint
from vbus.chips.mcp1200.core import Core
from vbus.chips.mcp1200.counter import PositionCounter
from vbus.chips.mcp1200.drive import PlantDrive
from vbus.chips.mcp1200.encoder import Encoder
from vbus.chips.mcp1200.output import Pwm
from vbus.chips.mcp1200.picture import Live
from vbus.chips.mcp1200.rest import Rest
from vbus.chips.mcp1200.sheet import Sheet
from vbus.chips.mcp1200.states import HELD
from vbus.chips.mcp1200.stepper import Stepper
from vbus.chips.mcp1200.timer import SampleTimer
from vbus.chips.mcp1200.writes import Writes
from vbus.chips.registers import RegisterFile
from vbus.kernel import Clock
from vbus.options import Value
from vbus.signals import Rule

Report = Callable[[Rule, int, int, str, int], bool]


class Blocks:
    """The blocks of the manual's block diagram, put together.

    Args:
        clock: the CLK input.
        settings: the chip's board file keys.
        report: files a violation.

    Attributes:
        state: ``HELD``, ``RESETTING``, ``STANDING`` or ``CONTROL`` of ``states.py``.
        released: cycle in which Pulse is high after a hard reset, else -1.
        writes: what the host has written, before it is visible.
    """

    __slots__ = (
        "_clock", "_report", "breakpoint", "core", "counter", "drive", "encoder", "file", "live",
        "pwm", "released", "rest", "sheet", "state", "stepper", "timer", "writes",
    )  # fmt: skip

    def __init__(self, clock: Clock, settings: dict[str, Value], report: Report) -> None:
        self._clock: Clock = clock
        self._report: Report = report
        self.file: RegisterFile = RegisterFile(ds.REGISTERS)
        data = self.file.bytes
        self.sheet: Sheet = Sheet(self.file)
        self.live: Live = self.sheet.live
        self.core: Core = Core(self.sheet, settings["unipolar"] == "clip")
        self.timer: SampleTimer = SampleTimer(self.live)
        self.encoder: Encoder = Encoder(clock.hz)
        self.stepper: Stepper = Stepper(data)
        self.breakpoint: Breakpoint = Breakpoint(self.live)
        self.counter: PositionCounter = PositionCounter(
            self.core,
            self.live,
            self.encoder,
            self.stepper,
            self.breakpoint,
            settings["index"] == "high",
        )
        self.pwm: Pwm = Pwm(self.live)
        self.drive: PlantDrive = PlantDrive(self.live, self.encoder, self.stepper, settings)
        self.rest: Rest = Rest(self.core, self.drive, self.encoder)
        self.state: int = HELD
        self.released: i64 = -1
        self.writes: Writes = Writes()

    def report(self, rule: Rule, cycle: int = -1, measured: int = 0, detail: str = "") -> None:
        """File a violation of clock cycle ``cycle``, or of just now."""
        self._report(rule, measured, 0, detail, -1 if cycle < 0 else self._clock.ps(cycle))

    def request(self, mode: int, cycle: int) -> None:
        """R05 has been written (MCP-MOD-1)."""
        raise NotImplementedError

    def controlling(self) -> bool:
        """Whether mode flags take effect: control mode, not halted."""
        raise NotImplementedError

    def hold_timer(self) -> None:
        """The sample timer stands."""
        raise NotImplementedError

    def start_timer(self, cycle: i64) -> None:
        """The sample timer begins a period."""
        raise NotImplementedError
