"""LM628/LM629: what can be upset inside the chip."""

from vbus.chips.lm628.chip import LM628
from vbus.core.options import Option, Value
from vbus.faults.row import CHIP, COUNTED, LASTS, ONCE, Fault
from vbus.faults.upsets import ChipFaults


class Lm628Upsets(ChipFaults):
    """Its encoder's plant, its resets, its busy times and its clock."""

    FAULTS = (
        Fault("power_on_c4", "chip", "Resets end with status C4h: the part whose breakpoint flag is"
              " stuck.", CHIP, LASTS),
        Fault("reset_fails", "chip", "So many resets fail: the status stays 00h.", CHIP, ONCE,
              (Option("times", "count", 1, "how many", low=1, high=1000),)),
        Fault("busy_longest", "chip", "Busy lasts as long as it may.", CHIP, COUNTED),
    )  # fmt: skip

    chip: LM628

    def filter_ps(self, axis: int) -> int:
        """Return how long the inputs' filter dwells (ps)."""
        return self.chip.encoder.inputs.filter_dwell

    # -- faults of the chip -------------------------------------------------------------------

    def start(self, name: str, values: dict[str, Value]) -> str:
        """Change what a fault changes; say what that is."""
        if name == "power_on_c4":
            self.chip.axis.stuck_part = True
            return "resets end with C4h"
        if name == "reset_fails":
            times = int(values["times"])
            if self.chip.fail_resets(times):
                return f"this reset fails, and {times - 1} more"
            return f"the next {times} resets fail"
        if name == "busy_longest":
            self.chip.host.worst = True
            return "each byte keeps it busy for 100 us"
        return super().start(name, values)

    def stop(self, name: str, values: dict[str, Value]) -> None:
        """Change it back."""
        self.restore(name, False)

    def restore(self, name: str, acts: bool) -> None:
        """Throw the two switches that are no part of the chip's own state."""
        settings = self.chip.settings
        if name == "power_on_c4":
            self.chip.axis.stuck_part = acts or settings["reset_status"] == "C4"
        elif name == "busy_longest":
            self.chip.host.worst = acts or settings["busy"] == "worst"
