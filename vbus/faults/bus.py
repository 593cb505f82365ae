"""Faults of a host bus: what they do to data lines and strobes."""

from collections.abc import Callable
from typing import Final

from vbus.chips.base import Chip
from vbus.core.options import Value
from vbus.core.signals import HIGH, LOW, Net, Observer, Pin

Later = Callable[[int, Callable[[], None]], None]
"""Calls back at an instant (ps)."""
_HELD: Final = ("byte_flipped", "bit_stuck")
"""Faults whose levels stay on data lines after a strobe until a driver moves."""


class BusFault(Observer):
    """One fault of one chip's bus while it acts.

    As long as it does, whole bus cycles are played as strobes on the nets, where it bends them.

    Args:
        chip: the chip.
        name: the fault.
        values: its parameters.
        later: sets a timer.
    """

    def __init__(self, chip: Chip, name: str, values: dict[str, Value], later: Later) -> None:
        self._chip: Chip = chip
        self._name: str = name
        self._values: dict[str, Value] = values
        self._later: Later = later
        self._pin: Pin | None = None
        self._bent: list[tuple[Net, Callable[[int], int]]] = []
        self._inside: bool = False
        self._gap: bool = False
        self._before: int = 0
        """Level of the data lines at the last read's beginning."""
        self._rest: int = chip.bus_net.rest
        way = "read" if name == "answer_late" else str(values.get("cycles", "both"))
        ways = {"read": (False,), "write": (True,), "both": (False, True)}[way]
        self._way: str = way
        self.strobes: list[Net] = []
        assert chip.BUS is not None  # the target was checked
        for write in ways:
            net = chip.pins[chip.BUS.strobe(write)[1]].net
            if net not in self.strobes:
                self.strobes.append(net)

    def begin(self, again: bool = False) -> str:
        """Bend the nets; return what is changed.

        Args:
            again: a saved state has it, with the levels of the nets as they are.
        """
        chip, values = self._chip, self._values
        chip.bus_net.observe(self)
        for net in self.strobes:
            net.observe(self)
        text = f"{chip.bus_net.name}"
        if self._name == "bit_stuck":
            text = f"D{values['bit']} at {values['level']}"
            self._bend(chip.bus_net, self._stuck)
        elif self._name == "byte_flipped":
            text = f"bits {int(values['mask']):02X}H of {self._way} cycles inverted"
            self._bend(chip.bus_net, self._flip)
        elif self._name == "answer_late":
            text = f"{chip.bus_net.name} has the answer after the host has taken it"
            self._bend(chip.bus_net, self._late)
        elif self._name == "bus_pulled":
            text += f" shows {values['level']} where nothing drives it"
            # Pulled up or down, and no keeper: a floating line shows the resistor.
            chip.bus_net.rest = 0xFF * int(values["level"])
        elif self._name == "contention":
            text = f"D0-D7 driven with {int(values['data']):02X}H"
            self._pin = chip.bus_net.solder("fault")
            self._pin.level = int(values["data"])
        else:
            lost = self._name == "strobe_lost"
            text = f"{', '.join(net.name for net in self.strobes)}"
            text += " stays high" if lost else " is broken in two"
            for net in self.strobes:
                self._bend(net, self._high if lost else self._broken)
        if not again:
            self._work_out()
        return text

    def end(self) -> None:
        """Let the nets be as they are driven."""
        self._loosen()
        # A byte holds after its strobe for as long as its driver does: a level that went with the
        # strobe would break the chip's hold time.
        held = self._name in _HELD and not self._inside and self._chip.bus_net.driven
        self._work_out(lines=not held)
        self._look_away()

    def leave(self) -> None:
        """Bend nothing any more, and leave the levels as they are."""
        self._loosen()
        self._look_away()

    def _loosen(self) -> None:
        self._chip.bus_net.rest = self._rest
        for net, bend in self._bent:
            net.unbend(bend)
        self._bent.clear()
        if self._pin is not None:
            self._pin.release()
            self._chip.bus_net.unsolder(self._pin)
            self._pin = None

    def _bend(self, net: Net, bend: Callable[[int], int]) -> None:
        net.bend(bend)
        self._bent.append((net, bend))

    def _look_away(self) -> None:
        self._chip.bus_net.unobserve(self)
        for net in self.strobes:
            net.unobserve(self)

    def concerns(self, write: bool) -> bool:
        """Whether it acts on this kind of bus cycle."""
        return self._way == "both" or (self._way == "write") == write

    def _work_out(self, lines: bool = True) -> None:
        if lines:
            self._chip.bus_net.resolve()
        for net in self.strobes:
            net.resolve()
        self._chip.kernel.settle()

    # -- what nets show -----------------------------------------------------------------------

    def _stuck(self, level: int) -> int:
        bit = 1 << int(self._values["bit"])
        return level | bit if self._values["level"] else level & ~bit

    def _flip(self, level: int) -> int:
        return level ^ int(self._values["mask"]) & 0xFF if self._inside else level

    def _late(self, level: int) -> int:
        return self._before if self._inside else level

    def _high(self, level: int) -> int:
        return HIGH

    def _broken(self, level: int) -> int:
        return HIGH if self._gap else level

    # -- strobes ------------------------------------------------------------------------------

    def edge(self, when: int, net: str, level: int) -> None:
        """A strobe falls or rises."""
        # The host takes what stood there before the strobe: the answer comes after its end.
        if self._name == "answer_late" and level == LOW and not self._inside:
            self._before = self._chip.bus_net.value
        if self._name in ("byte_flipped", "answer_late") and net != self._chip.bus_net.name:
            self._inside = level == LOW
            if self._inside or self._name not in _HELD:
                self._chip.bus_net.resolve()
        elif self._name == "strobe_doubled" and level == LOW and not self._gap:
            if net in [strobe.name for strobe in self.strobes] and not self._inside:
                self._inside = True
                # The gap lies within the strobe, so the chip sees two of them.
                begin = when + int(self._values["at"])
                self._later(begin, self._open)
                self._later(begin + int(self._values["gap"]), self._close)

    def _open(self) -> None:
        self._gap = True
        self._work_out()

    def _close(self) -> None:
        self._gap = False
        self._work_out()
        self._inside = False
