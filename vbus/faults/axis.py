"""Faults of mechanics, encoder and switches: what they do to a plant and its chip."""

from collections.abc import Callable
from typing import ClassVar, Final

from vbus import plugins
from vbus.chips.base import Chip
from vbus.core.options import Value
from vbus.core.signals import HIGH, Pin, Plant, Switch, Z
from vbus.core.state import Names
from vbus.faults.armed import Armed
from vbus.faults.plant import PLAY, SHARE, STUCK_A, STUCK_B, WHOLE, FaultyPlant
from vbus.faults.upsets import ChipFaults, upsets_of
from vbus.plant.shaft import Mechanics, Shaft

NOWHERE: Final = 1 << 62

SHAFT: Final = frozenset({"load_step", "friction", "end_stop", "supply_sag", "overheated"})
"""Faults that change the numbers of a shaft; the others stand between it and the chip."""
FIXED: Final[dict[str, dict[str, int | bool]]] = {
    "jam": {"frozen": True}, "coupling_break": {"share": 0}, "amplifier_off": {"powered": False},
    "backlash": {"mode": PLAY}, "index_missing": {"index": False},
    "a_stuck": {"mode": STUCK_A}, "a_open": {"mode": STUCK_A},
    "b_stuck": {"mode": STUCK_B}, "b_open": {"mode": STUCK_B},
}  # fmt: skip
"""What a fault sets of the plant between."""
GIVEN: Final[dict[str, dict[str, str]]] = {
    "backlash": {"gap": "gap"}, "lost_steps": {"lose_every": "every"},
    "index_double": {"second_index": "distance"},
    "a_stuck": {"level": "level"}, "a_open": {"level": "level"},
    "b_stuck": {"level": "level"}, "b_open": {"level": "level"},
}  # fmt: skip
"""What it sets to a parameter; a wire that is off is pulled high."""
ADDED: Final[dict[str, dict[str, str]]] = {
    "load_step": {"load": "torque"},
    "friction": {"coulomb": "coulomb", "static": "coulomb", "viscous": "viscous"},
}  # fmt: skip
"""Parameters that it adds to numbers of a shaft."""


class AxisFaults:
    """What is broken behind one axis.

    Everything is worked out anew from the faults that act, so that they may end in any order and
    leave nothing behind but where the encoder stands.

    Args:
        chip: the chip.
        axis: its axis, 0-based.
        plant: the plant behind it.
    """

    DERIVED: ClassVar[Names] = ("*",)
    """It is worked out anew from the faults that act, which the board saves."""

    def __init__(
        self, chip: Chip, axis: int, plant: Plant, acting: Callable[[], list[Armed]]
    ) -> None:
        self.chip: Chip = chip
        self.upsets: ChipFaults = upsets_of(chip)
        self.axis: int = axis
        self.plant: Plant = plant
        self.acting: Callable[[], list[Armed]] = acting
        self.wrapper: FaultyPlant | None = None
        self._nominal: Mechanics | None = None
        self._pins: dict[str, Pin] = {}
        self._open: dict[str, tuple[int, int]] = {}

    @property
    def count(self) -> int:
        """What the encoder shows at the end of the period under way."""
        plant = self.wrapper if self.wrapper is not None else self.plant
        return int(plant.count)

    # -- beginning and ending -----------------------------------------------------------------

    def begin(self, armed: Armed) -> str:
        """Let a fault act; return what it changes."""
        # What was before this instant was without the fault.
        self.chip.advance()
        armed.here = int(self.plant.count)
        text = self._describe(armed.name, armed.values)
        if armed.name == "offset_jump":
            self._wrap().jump(int(armed.values["counts"]))
        self._apply(armed.name)
        return text

    def end(self, armed: Armed) -> str:
        """It acts no more, or the switch that it lets bounce moves; there is nothing to say."""
        self.chip.advance()
        self._apply(armed.name)
        return ""

    def _apply(self, name: str) -> None:
        if name in SHAFT:
            self._refit()
        elif name in ("limit_stuck", "limit_bouncing", "home_never"):
            self._switches()
        else:
            self._between()
        self.upsets.invalidate()

    def _describe(self, name: str, values: dict[str, Value]) -> str:
        if name == "offset_jump":
            counts = int(values["counts"])
            return f"count {self.count} became {self.count + counts}"
        if name == "glitch":
            width, least = int(values["width"]), self.upsets.filter_ps(self.axis)
            if width < least:
                return f"a pulse of {width} ps on A: the filter wants {least} ps and drops it"
            return f"a pulse of {width} ps on A is counted until it ends"
        if name == "end_stop":
            return f"a stop at count {self.count + int(values['ahead'])}"
        given = ", ".join(f"{key} {value}" for key, value in values.items())
        return f"from count {self.count} on" + (f": {given}" if given else "")

    # -- between chip and plant ---------------------------------------------------------------

    def _wrap(self) -> FaultyPlant:
        if self.wrapper is None:
            self.put(FaultyPlant(self.plant))
        assert self.wrapper is not None
        return self.wrapper

    def put(self, wrapper: FaultyPlant | None) -> None:
        """Put this between chip and plant, or nothing."""
        if wrapper is not self.wrapper:
            self.wrapper = wrapper
            self.upsets.exchange(self.axis, wrapper or self.plant)

    def wrap_as(self, wrapped: bool) -> None:
        """Let there be something between chip and plant, or nothing."""
        if wrapped != (self.wrapper is not None):
            self.put(FaultyPlant(self.plant) if wrapped else None)

    def _between(self) -> None:
        """Work out what stands between chip and plant; nothing, if it would do nothing."""
        wrapper = self._wrap()
        wrapper.take_hold()
        self.set_up(wrapper)
        # Without the wrapper a sample costs what it does on a board without faults.
        if wrapper.plain:
            self.put(None)

    def set_up(self, wrapper: FaultyPlant) -> None:
        """Say what is broken; where the encoder stands is left alone."""
        wrapper.frozen, wrapper.powered, wrapper.index = False, True, True
        wrapper.drive_sign, wrapper.mode, wrapper.share = 1, SHARE, WHOLE
        wrapper.lose_every = wrapper.second_index = 0
        for armed in self.acting():
            name, values = armed.name, armed.values
            for attribute, value in FIXED.get(name, {}).items():
                setattr(wrapper, attribute, value)
            for attribute, key in GIVEN.get(name, {}).items():
                setattr(wrapper, attribute, int(values.get(key, HIGH)))
            if name == "jam" and isinstance(self.plant, Shaft):
                self.plant.jam()
            # Shares multiply, so that two slips lose more than either.
            elif name == "slip":
                wrapper.share = int(wrapper.share * (1.0 - float(values["share"])))
            elif name == "motor_reversed":
                wrapper.drive_sign = -wrapper.drive_sign
            elif name == "ab_swapped":
                wrapper.share = -wrapper.share
        self._pulse(wrapper)

    def _pulse(self, wrapper: FaultyPlant) -> None:
        """A pulse on A that is longer than the filter moves the count by one, and back."""
        least = self.upsets.filter_ps(self.axis)
        long = sum(
            armed.name == "glitch" and int(armed.values["width"]) >= least
            for armed in self.acting()
        )
        if long != wrapper.pulsed:
            wrapper.jump(long - wrapper.pulsed)
            wrapper.pulsed = long

    # -- the numbers of a shaft ---------------------------------------------------------------

    def _refit(self) -> None:
        """Give the shaft its own numbers, then those of the faults that act, oldest first."""
        shaft = self.plant
        assert isinstance(shaft, Shaft)
        if self._nominal is None:
            self._nominal = shaft.mechanics()
        # Always from the nominal ones: faults may end in any order.
        numbers = self._nominal
        for armed in self.acting():
            name, values = armed.name, armed.values
            for attribute, key in ADDED.get(name, {}).items():
                more = getattr(numbers, attribute) + float(values[key])
                numbers = numbers._replace(**{attribute: more})
            if name == "supply_sag":
                numbers = numbers._replace(supply=min(numbers.supply, float(values["supply"])))
            elif name == "overheated":
                numbers = numbers._replace(torque=numbers.torque * float(values["torque"]))
            elif name == "end_stop":
                numbers = _stopped(numbers, armed.here, int(values["ahead"]))
        shaft.refit(numbers)

    # -- switches -----------------------------------------------------------------------------

    def _switches(self) -> None:
        """Closed: the input is driven. Open: the switch on the axis' way closes nowhere."""
        closed: dict[str, int] = {}
        opened: set[str] = set()
        for armed in self.acting():
            if armed.name == "home_never":
                opened.add("home")
            elif armed.name in ("limit_stuck", "limit_bouncing"):
                which = str(armed.values["switch"])
                # A switch that bounces is open at each second look.
                if armed.values.get("state") == "closed" or (
                    armed.name == "limit_bouncing" and not armed.seen
                ):
                    switch = self.plant.switches.get(which)
                    # Where no switch is wired, the family says which level means closed.
                    closed[which] = self.upsets.LIMIT_CLOSED if switch is None else switch.active
                else:
                    opened.add(which)
        for which in ("limit+", "limit-"):
            self._drive(which, closed.get(which, Z))
        for which, switch in self.plant.switches.items():
            self._break(which, switch, which in opened and which not in closed)

    def _drive(self, which: str, level: int) -> None:
        pin = self._pins.get(which)
        if pin is None:
            if level == Z:
                return
            name = plugins.family(self.chip.FAMILY).limits[which].format(self.axis + 1)
            pin = self._pins[which] = self.chip.pins[name].net.solder(f"fault:{which}")
        pin.drive(level)
        self.chip.kernel.settle()
        if level == Z:
            pin.net.unsolder(self._pins.pop(which))

    def _break(self, which: str, switch: Switch, broken: bool) -> None:
        if broken and which not in self._open:
            self._open[which] = (switch.low, switch.high)
            switch.low = switch.high = NOWHERE
        elif not broken and which in self._open:
            switch.low, switch.high = self._open.pop(which)

    # -- state --------------------------------------------------------------------------------

    def restore(self, wrapped: bool, pulsed: int) -> None:
        """Let faults act, as a saved state has it; the plant's own state comes after."""
        if self._nominal is not None or any(armed.name in SHAFT for armed in self.acting()):
            self._refit()
        self._switches()
        self.wrap_as(wrapped)
        if self.wrapper is not None:
            self.wrapper.pulsed = pulsed
            self.set_up(self.wrapper)


def _stopped(numbers: Mechanics, here: int, ahead: int) -> Mechanics:
    """Return a shaft's numbers with an end stop ``ahead`` of the count at which its fault began."""
    # A stop in front of another one is the one that is met.
    low, high = (numbers.low, numbers.high) if numbers.stopped else (-NOWHERE, NOWHERE)
    if ahead >= 0:
        high = min(high, here + ahead)
    else:
        low = max(low, here + ahead)
    return numbers._replace(low=low, high=high, stopped=True)
