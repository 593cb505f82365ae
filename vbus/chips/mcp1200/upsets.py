"""MCP-1200: what can be upset inside the chip."""

from vbus.chips.mcp1200.chip import MCP1200
from vbus.core.signals import Plant
from vbus.faults.upsets import ChipFaults


class Mcp1200Upsets(ChipFaults):
    """Its encoder's plant and its clock."""

    chip: MCP1200

    def invalidate(self) -> None:
        """Tell the chip that something behind it is different now."""
        self.chip.invalidate()

    def filter_ps(self, axis: int) -> int:
        """Return how long the inputs' filter dwells (ps)."""
        return self.chip.clock.span_up(self.chip.axis.channels.decoder.filter_dwell)

    def set_frequency(self, hz: float, plants: list[Plant]) -> None:
        """Tell mechanics how long a sample is, from the next one on."""
        self.chip.axis.encoder.set_clock(hz)

    def restore_frequency(self, hz: float) -> None:
        """Take the frequency of a saved state."""
        self.chip.axis.encoder.clk_hz = hz
