"""What can be upset inside a chip: the base, which does what any chip allows."""

from typing import ClassVar

from vbus import plugins
from vbus.chips.base import Chip
from vbus.core.options import Value
from vbus.core.signals import LOW, Plant
from vbus.faults.row import Fault


class ChipFaults:
    """How faults get at what is inside a chip.

    A chip's :meth:`~vbus.chips.base.Chip.exchange_plant` may be all there is to upset; else its
    family names a subclass of this.

    Args:
        chip: the chip.
    """

    FAULTS: ClassVar[tuple[Fault, ...]] = ()
    """Faults of this family's chips alone."""
    LIMIT_CLOSED: ClassVar[int] = LOW
    """Level of a limit input whose switch is closed, where no switch is wired to it."""

    def __init__(self, chip: Chip) -> None:
        self.chip: Chip = chip

    # -- behind an axis -----------------------------------------------------------------------

    def exchange(self, axis: int, plant: Plant) -> None:
        """Put ``plant`` behind an axis (0-based): between two periods.

        Raises:
            ValueError: the chip has no way to do so.
        """
        self.chip.advance()
        self.chip.exchange_plant(axis, plant)

    def invalidate(self) -> None:
        """Tell the chip that something behind it is different now: rest is over."""
        self.chip.input_changed()

    def filter_ps(self, axis: int) -> int:
        """Return the shortest level at an encoder input the chip believes (ps); 0 if unknown."""
        return 0

    # -- faults of the chip -------------------------------------------------------------------

    def begin(self, name: str, values: dict[str, Value]) -> str:
        """Let a fault act; return what it changes."""
        self.chip.advance()
        text = self.start(name, values)
        self.chip.input_changed()
        self.chip.kernel.settle()
        return text

    def end(self, name: str, values: dict[str, Value]) -> None:
        """Let it act no more."""
        self.chip.advance()
        self.stop(name, values)
        self.chip.input_changed()
        self.chip.advance()
        self.chip.kernel.settle()

    def start(self, name: str, values: dict[str, Value]) -> str:
        """Change what a fault changes; say what that is."""
        if name == "supply_dip":
            self.chip.power_on(False)
        return "the power-on reset runs"

    def stop(self, name: str, values: dict[str, Value]) -> None:
        """Change it back."""

    def restore(self, name: str, acts: bool) -> None:
        """Throw a switch that is no part of the chip's own state, as a saved state has it."""

    # -- its clock ----------------------------------------------------------------------------

    def set_frequency(self, hz: float, plants: list[Plant]) -> None:
        """Tell mechanics, which live in seconds, how long a period is now."""
        for plant in plants if self.chip.PERIOD_CLK else ():
            plant.prepare(self.chip.PERIOD_CLK / hz)

    def restore_frequency(self, hz: float) -> None:
        """Take the frequency of a saved state, before the chip's own state comes."""


def upsets_of(chip: Chip) -> ChipFaults:
    """Return what can be upset inside a chip."""
    return (plugins.family(chip.FAMILY).load("upsets", ChipFaults) or ChipFaults)(chip)
