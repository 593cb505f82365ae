"""MC1241A/MC1141A: what can be upset inside the chip set."""

from typing import Final

from vbus.chips.mc1241a.datasheet import SLOT_CLK
from vbus.faults.row import CHIP, LASTS, Fault
from vbus.faults.upsets import Shift, Upsets
from vbus.kernel import NEVER
from vbus.options import Option, Value
from vbus.signals import HIGH, Plant

STUCK: Final = 10**15
"""Longer than any host waits (ps)."""


class Mc1241aUpsets(Upsets):
    """The plants of its axes, HostRdy and its clock."""

    FAULTS = (
        Fault("busy_longest", "chip", "Busy lasts as long as it may.", CHIP, LASTS,
              (Option("extra", "s", 500_000_000, "added to each busy time (MC1241A)", low=0),)),
        Fault("ready_stuck", "chip", "HostRdy stays low.", CHIP, LASTS),
    )  # fmt: skip
    LIMIT_CLOSED = HIGH

    def exchange(self, axis: int, old: Plant, new: Plant) -> None:
        """Put ``new`` behind an axis, and behind every encoder that hears it."""
        inside = self.inside
        self.chip.advance()
        inside.cycles.motors[axis] = new
        for each in inside.axes:
            if each.encoder._plant is old:
                each.encoder._plant = new
            if each.encoder._mechanics is old:
                each.encoder._mechanics = new

    def disturb(self) -> None:
        """Tell the chip set that something behind it is different now."""
        for each in self.inside.axes:
            each.encoder._limit_moved()
        super().disturb()

    def filter_ps(self, axis: int) -> int:
        """Return how long the inputs' filter dwells (ps)."""
        return int(self.inside.axes[axis].encoder._decoder._a.dwell)

    # -- faults of the chip -------------------------------------------------------------------

    def start(self, name: str, values: dict[str, Value]) -> str:
        """Change what a fault changes; say what that is."""
        inside, now = self.inside, self.chip.kernel.now
        if name == "busy_longest":
            inside.busy_stretch += int(values["extra"])
            return f"each busy time is {values['extra']} ps longer"
        if name == "ready_stuck":
            inside.busy_stretch += STUCK
            if inside.port.busy_until <= now:
                inside.port.busy_since = now
            inside.port.busy_until = now + STUCK
            inside.show_ready(False, now)
            return "HostRdy is low"
        return super().start(name, values)

    def stop(self, name: str, values: dict[str, Value]) -> None:
        """Change it back."""
        inside, now = self.inside, self.chip.kernel.now
        if name == "busy_longest":
            inside.busy_stretch -= int(values["extra"])
        elif name == "ready_stuck":
            inside.busy_stretch -= STUCK
            if inside.port.busy_until > now:
                inside.port.busy_until = now
                if inside.port.due() == NEVER:
                    inside.show_ready(True, now)

    # -- its clock ----------------------------------------------------------------------------

    def set_frequency(self, hz: float, plants: list[Plant]) -> None:
        """Tell mechanics how long an axis' share of a cycle is now."""
        for plant in plants:
            plant.prepare(SLOT_CLK / hz)

    def move(self, shift: Shift) -> None:
        """Hold the ends of busy and of the interrupt's rest, and what is put out next."""
        inside, now = self.inside, self.chip.kernel.now
        inside.port.busy_until = shift(inside.port.busy_until, now)
        inside.interrupts.quiet_until = shift(inside.interrupts.quiet_until, now)
        inside.output._queue = [(shift(one[0], now), *one[1:]) for one in inside.output._queue]
        inside.cycles.pause(self.chip.clock.stopped)

    def follow(self) -> None:
        """Work out anew when the next cycle comes."""
        if not self.inside.stopped():
            self.inside.cycles.replan(self.inside.port.busy_until)
