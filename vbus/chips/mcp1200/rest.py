"""Rest: samples that would repeat the one before bit for bit need not be computed."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200.control_loop import ControlLoop
from vbus.chips.mcp1200.drive import PlantDrive
from vbus.chips.mcp1200.encoder import EncoderCourse
from vbus.state import Names, save


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
