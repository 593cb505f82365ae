"""A motor that is computed elsewhere: by the tool in which the board is a block."""

from typing import ClassVar

from mypy_extensions import i64

from vbus.core.options import Settings
from vbus.core.state import Names
from vbus.plant.encoder import EncodedPlant, bounded


class OutsidePlant(EncodedPlant):
    """Gives its drive to the tool around the board, and goes where the tool says.

    In each period it goes, at a constant speed, to the count that was given last.
    """

    STATE: ClassVar[Names] = ("given", "command: float", *EncodedPlant.STATE)

    def __init__(self, settings: Settings | None = None) -> None:
        super().__init__(settings)
        self.given: int = 0
        """The count that it is to be at."""
        self.command: float = 0.0
        """Its drive, of full scale: -1.0 to 1.0."""

    def prepare(self, period: float) -> None:
        """Accept any period: how long it is makes no difference."""

    def drive(self, command: float, error: i64) -> i64:
        """Take the drive down and go to the count that was given."""
        self.command = command
        self.begin(1)
        self.points[1] = bounded(self.first + float(self.given - self.count))
        return self.end()
