"""The pins of one host: its numbered control lines, side pins and output lines."""

from collections.abc import Callable
from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.base import Chip
from vbus.chips.tables import PinRow
from vbus.core.kernel import Kernel
from vbus.core.signals import EdgeTaker, Net, Observer, Pin, Z
from vbus.core.state import Names
from vbus.glue.part import GluePart
from vbus.protocols import codes
from vbus.protocols.port import PortError

WORD: int = 32
"""Output lines that fit the word of SAMPLE, SYNC and event reports."""
MOST_CYCLES: Final = 4096
"""Most different bus cycles that are remembered as edges."""


class CycleEdge:
    """One edge of a whole bus cycle.

    Args:
        offset: when, counted from the latching edge (ps).
        pin: which the host drives.
        level: to which; :data:`~vbus.core.signals.Z` lets go.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, offset: i64, pin: Pin, level: int) -> None:
        self.offset: i64 = offset
        self.pin: Pin = pin
        self.level: int = level


class HostPins:
    """What one host has soldered to the nets of its chips.

    Control lines, side pins and outputs are numbered chip by chip in the order of the pin tables;
    pins joined by a net count once.

    Args:
        kernel: the board's time.
        label: the host's name, for the names of its pins.
        chips: the session's chips.
        glue: what is in front of those chips and behind them.
        on_edge: called when an output line moved whose events were asked for.
    """

    STATE: ClassVar[Names] = ("watched", "levels: list[(str, i64), ...]")
    WIRING: ClassVar[Names] = (
        "_by_name", "_chips", "_connector", "_let_go", "_soldered", "_word", "lines", "outputs",
        "sides",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = ("_cycles", "_edges", "_watched", "_watches")

    def __init__(
        self,
        kernel: Kernel,
        label: str,
        chips: list[Chip],
        glue: list[GluePart],
        on_edge: Callable[[], None],
    ) -> None:
        self._kernel: Kernel = kernel
        self._label: str = label
        self._chips: list[Chip] = chips
        self._on_edge: Callable[[], None] = on_edge
        self._soldered: dict[int, Pin] = {}
        self._cycles: dict[tuple[str, bool, int, int], list[CycleEdge]] = {}
        self._connector: dict[int, Pin] = {
            id(pin.net): pin for chip in chips if chip.CONNECTOR for pin in chip.pins.values()
        }
        standing = [chip.pins[name] for chip in chips for name in chip.standing]
        self._let_go: list[Pin] = [
            pin for pin in self._connector.values() if all(pin is not one for one in standing)
        ]  # fmt: skip
        """What of a connector a host lets go of: the bus itself stands when a program has gone."""
        self._watches: list[tuple[Net, Observer]] = []
        self._watched: int = 0
        self._edges: list[tuple[int, int]] = []
        self.lines: list[Pin] = []
        self.sides: list[Pin] = []
        self.outputs: list[Pin] = []
        owners: list[tuple[str, dict[str, Pin], tuple[PinRow, ...]]] = [
            *((chip.name, chip.pins, chip.pin_rows) for chip in chips),
            *((part.name, part.pins, part.pin_rows) for part in glue),
        ]
        self._by_name: dict[str, Pin] = {
            f"{owner}.{name}": pin for owner, pins, _ in owners for name, pin in pins.items()
        }
        seen: set[int] = set()
        for _, pins, rows in owners:
            for row in rows:
                pin = pins[row.name]
                # A host moves nets: pins that one joins are one line.
                if id(pin.net) in seen or row.width > 1:
                    continue
                seen.add(id(pin.net))
                if row.strobe:
                    self.lines.append(pin)
                    continue
                self.sides.append(pin)
                if row.direction != "in" and not row.wave:
                    self.outputs.append(pin)
        self._word: list[Pin] = self.outputs[:WORD]

    def line_names(self) -> list[str]:
        """Return the names of the control lines: ``"chip.pin"``, or ``"bus.pin"`` where shared."""
        return [pin.net.name for pin in self.lines]

    def side_names(self) -> list[str]:
        """Return the names of the side pins, ``"chip.pin"``."""
        return [self._full_name(pin) for pin in self.sides]

    def output_names(self) -> list[str]:
        """Return the names of the output lines, ``"chip.pin"``."""
        return [self._full_name(pin) for pin in self.outputs]

    def output_of(self, pin: Pin) -> int:
        """Return the number of the output line that a pin is on; -1: none of this host's."""
        nets = [output.net for output in self.outputs]
        return next((place for place, net in enumerate(nets) if net is pin.net), -1)

    def _full_name(self, pin: Pin) -> str:
        return next(name for name, other in self._by_name.items() if other is pin)

    def of(self, chip_pin: Pin) -> Pin:
        """Return this host's own pin on the net of ``chip_pin``, soldered on first use.

        On the lines of a connector all hosts move the connector's own pin: it is one computer.
        """
        net = chip_pin.net
        if self._connector:
            shared = self._connector.get(id(net))
            if shared is not None:
                return shared
        pin = self._soldered.get(id(net))
        if pin is None:
            pin = net.solder(f"{self._label}:{chip_pin.name}")
            self._soldered[id(net)] = pin
        return pin

    def strobes(self, chip: Chip, write: bool, address: int, data: int) -> list[CycleEdge]:
        """Return the edges of a whole cycle at ``chip``, in order; not to be changed.

        Those at a connector depend on how its lines stand, those at any other chip do not.
        """
        key = (chip.name, write, address, data)
        strobes = self._cycles.get(key)
        if strobes is None:
            strobes = [
                CycleEdge(offset, self.of(chip.pins[name]), level)
                for offset, name, level in chip.strobes(write, address, data)
            ]
            # What a computer's bus moves at one instant is in order.
            if not chip.CONNECTOR:
                strobes.sort(key=offset_of)
                if len(self._cycles) == MOST_CYCLES:
                    self._cycles.clear()
                self._cycles[key] = strobes
        return strobes

    def held(self, chip_pin: Pin) -> bool:
        """Tell whether this host has held the net of ``chip_pin`` off its rest since before now."""
        net = chip_pin.net
        own = self._soldered.get(id(net))
        return (
            own is not None
            and own.level != Z
            and own.level != net.rest
            and net.changed_at < self._kernel.now
        )

    def held_lines(self, mask: int) -> bool:
        """Tell the same of any of the control lines in ``mask``."""
        for line in self.lines:
            if mask & 1 and self.held(line):
                return True
            mask >>= 1
        return False

    def set_lines(self, mask: int, levels: int) -> None:
        """Put the control lines in ``mask`` to ``levels``, all in one batch."""
        if mask >> len(self.lines):
            raise PortError(
                codes.NO_SUCH, f"lines {mask:X}: this session has {len(self.lines)} lines"
            )
        for line in self.lines:
            if mask & 1:
                self.of(line).drive(levels & 1)
            mask >>= 1
            levels >>= 1
            if mask == 0:
                break
        self._kernel.settle()

    def at(self, chip: Chip) -> list[Pin]:
        """Return this host's own pins on the bus of a chip."""
        known = [self._soldered.get(id(pin.net)) for pin in chip.bus_pins]
        return [pin for pin in known if pin is not None]

    def driven(self) -> list[Pin]:
        """Return the host's own pins that drive something; those of a connector are no host's."""
        return [pin for pin in self._soldered.values() if pin.level != Z]

    def side(self, number: int) -> Pin:
        """Return the chip's pin behind side pin ``number``."""
        if not 0 <= number < len(self.sides):
            raise PortError(codes.NO_SUCH, f"pin {number}: this session has {len(self.sides)}")
        return self.sides[number]

    def set_side(self, number: int, level: int) -> None:
        """Drive side pin ``number`` to 0 or 1; 2 lets go."""
        side = self.side(number)
        if level not in (0, 1, 2):
            raise PortError(codes.NO_SUCH, f"pin level {level}: allowed are 0, 1 and 2 (let go)")
        self.of(side).drive(Z if level == 2 else level)
        self._kernel.settle()

    def number(self, pins: list[Pin], names: list[str], name: str, selected: list[Chip]) -> int:
        """Return the number of the pin called ``name``, with or without its chip's name.

        Raises:
            PortError: there is none; the message lists what there is.
        """
        if name in names:
            return names.index(name)
        for chip in selected:
            wanted = chip.pins.get(name)
            for number, pin in enumerate(pins):
                if wanted is not None and pin.net is wanted.net:
                    return number
        raise PortError(codes.NO_SUCH, f"no {name!r}; this session has {', '.join(names)}")

    # -- output lines -------------------------------------------------------------------------

    def output_word(self) -> int:
        """Return the levels of all output lines; bit n is ``outputs[n]``."""
        # Chips are lazy: what they drive by now shows only after that.
        for chip in self._chips:
            chip.advance()
        self._kernel.settle()
        return self._levels()

    def _levels(self) -> int:
        word = 0
        for number, pin in enumerate(self._word):
            word |= pin.net.value << number
        return word

    def watch(self, mask: int) -> None:
        """From now on note each edge of the output lines in ``mask``; 0 ends it."""
        if mask >> len(self.outputs):
            raise PortError(
                codes.NO_SUCH, f"events {mask:X}: this session has {len(self.outputs)} outputs"
            )
        for net, observer in self._watches:
            net.unobserve(observer)
        self._watches = []
        self._watched = mask
        if not mask:
            return
        # All outputs are listened to, so that the word reported with an edge is right.
        for number, pin in enumerate(self.outputs[:WORD]):
            observer = EdgeTaker(self._note_edge) if mask >> number & 1 else Observer()
            self._watches.append((pin.net, observer))
            pin.net.observe(observer)

    def _note_edge(self, when: int, net: str, level: int) -> None:
        """A watched line has moved."""
        self._edges.append((self._levels(), when))
        self._on_edge()

    def take_edges(self) -> list[tuple[int, int]]:
        """Return and forget the edges noted: ``(output lines, instant)``."""
        edges, self._edges = self._edges, []
        return edges

    # -- end and state ------------------------------------------------------------------------

    def unsolder(self) -> None:
        """Let go of everything and leave the nets."""
        self.watch(0)
        for pin in self._soldered.values():
            pin.release()
            pin.net.unsolder(pin)
        for pin in self._let_go:
            pin.release()
        self._soldered = {}
        self._cycles = {}
        self._kernel.settle()

    def name_of(self, own: Pin) -> str:
        """Return the name of the chip's pin that the host's ``own`` one is soldered to, or ""."""
        if own in (self._soldered.get(id(own.net)), self._connector.get(id(own.net))):
            for name, pin in self._by_name.items():
                if pin.net is own.net:
                    return name
        return ""

    def named(self, full_name: str) -> Pin:
        """Return this host's pin at the chip's pin ``full_name``."""
        return self.of(self._by_name[full_name])

    @property
    def watched(self) -> int:
        """Output lines whose edges are noted."""
        return self._watched

    @watched.setter
    def watched(self, mask: int) -> None:
        self.watch(mask)

    @property
    def levels(self) -> list[tuple[str, int]]:
        """What each pin of the host drives, by name of the chip's pin."""
        levels: dict[str, int] = {}
        for name, other in self._by_name.items():
            pin = self._soldered.get(id(other.net))
            if pin is not None and pin.level != Z:
                levels[name] = pin.level
        return list(levels.items())

    @levels.setter
    def levels(self, levels: list[tuple[str, int]]) -> None:
        # Not driven: the nets are loaded by themselves, and no edge may come of that.
        for pin in self._soldered.values():
            pin.level = Z
        for full_name, level in levels:
            self.named(full_name).level = level


def offset_of(strobe: CycleEdge) -> int:
    """Return when an edge is, counted from the latching edge (ps)."""
    return strobe.offset
