"""LM628/LM629: what can be upset inside the chip."""

from vbus.chips.lm628 import datasheet as ds
from vbus.faults.row import CHIP, LASTS, ONCE, Fault
from vbus.faults.upsets import Shift, Upsets
from vbus.kernel import NEVER
from vbus.options import Option, Value
from vbus.signals import Plant


class Lm628Upsets(Upsets):
    """Its encoder's plant, its resets, its busy times and its clock."""

    FAULTS = (
        Fault("power_on_c4", "chip", "Resets end with status C4h: the part whose breakpoint flag is"
              " stuck.", CHIP, LASTS),
        Fault("reset_fails", "chip", "So many resets fail: the status stays 00h.", CHIP, ONCE,
              (Option("times", "count", 1, "how many", low=1, high=1000),)),
        Fault("busy_longest", "chip", "Busy lasts as long as it may.", CHIP, LASTS),
    )  # fmt: skip

    def exchange(self, axis: int, old: Plant, new: Plant) -> None:
        """Put ``new`` behind the encoder."""
        self.chip.advance()
        self.inside.encoder.plant = new

    def disturb(self) -> None:
        """Tell the chip that something behind it is different now."""
        self.inside.touched()

    def filter_ps(self, axis: int) -> int:
        """Return how long the inputs' filter dwells (ps)."""
        return int(self.inside.encoder.inputs._a.dwell)

    # -- faults of the chip -------------------------------------------------------------------

    def start(self, name: str, values: dict[str, Value]) -> str:
        """Change what a fault changes; say what that is."""
        if name == "power_on_c4":
            self.inside.axis._stuck_part = True
            return "resets end with C4h"
        if name == "reset_fails":
            return self._fail_resets(int(values["times"]))
        if name == "busy_longest":
            self.inside.host._worst = True
            return "each byte keeps it busy for 100 us"
        return super().start(name, values)

    def stop(self, name: str, values: dict[str, Value]) -> None:
        """Change it back."""
        self.restore(name, False)

    def restore(self, name: str, acts: bool) -> None:
        """Throw the two switches that are no part of the chip's own state."""
        settings = self.chip.settings
        if name == "power_on_c4":
            self.inside.axis._stuck_part = acts or settings["reset_status"] == "C4"
        elif name == "busy_longest":
            self.inside.host._worst = acts or settings["busy"] == "worst"

    def _fail_resets(self, times: int) -> str:
        """A reset that runs fails too: it is the first of them."""
        inside = self.inside
        if inside._reset_end != NEVER:
            inside._reset_end = NEVER
            inside._mode = 1
            times -= 1
            inside.touched()
            inside._fails_left += times
            return f"this reset fails, and {times} more"
        inside._fails_left += times
        return f"the next {times} resets fail"

    # -- its clock ----------------------------------------------------------------------------

    def set_frequency(self, hz: float, plants: list[Plant]) -> None:
        """Tell mechanics how long a sample is now."""
        for plant in plants:
            plant.prepare(ds.SAMPLE_CLK / hz)

    def move(self, shift: Shift) -> None:
        """Hold the ends of busy and reset and the index, or give them back."""
        inside, now = self.inside, self.chip.kernel.now
        inside.host.busy_end = shift(inside.host.busy_end, now)
        inside._reset_end = shift(inside._reset_end, now)
        inside.encoder.index_at = shift(inside.encoder.index_at, now)

    def follow(self) -> None:
        """Work out anew when the next sample and the index come."""
        inside = self.inside
        inside._outputs.due = 0
        if inside.powered:
            inside._place_sample()
        if not self.chip.clock.stopped:
            inside.encoder.index_at = (
                NEVER if inside.encoder.index_at == NEVER
                else min(inside.encoder.index_at, inside._sample_at)
            )  # fmt: skip
            inside._encoder_pins.look()
