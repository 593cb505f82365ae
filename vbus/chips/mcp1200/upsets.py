"""MCP-1200: what can be upset inside the chip."""

from vbus.faults.upsets import Upsets
from vbus.signals import Plant


class Mcp1200Upsets(Upsets):
    """Its encoder's plant and its clock."""

    def exchange(self, axis: int, old: Plant, new: Plant) -> None:
        """Put ``new`` behind the encoder."""
        self.chip.advance()
        self.inside.works.encoder.plant = new

    def disturb(self) -> None:
        """Tell the chip that something behind it is different now."""
        inside = self.inside
        inside.works.rest.disturb()
        inside.side.look(inside.cycle_now())
        inside.changed()

    def filter_ps(self, axis: int) -> int:
        """Return how long the inputs' filter dwells (ps)."""
        return self.chip.clock.span_up(self.inside.encoder_pins.decoder._a.dwell)

    def set_frequency(self, hz: float, plants: list[Plant]) -> None:
        """Tell mechanics how long a sample is, from the next one on."""
        self.restore_frequency(hz)
        self.inside.works.encoder._prepared = 0

    def restore_frequency(self, hz: float) -> None:
        """Take the frequency of a saved state."""
        self.inside.works.encoder.clk_hz = hz
