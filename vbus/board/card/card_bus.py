"""A card's bus connector: whole cycles at addresses of the card become strobes on its lines.

What such a cycle has come to, and how the wires stand between two cycles.
"""

from collections.abc import Callable
from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.base import CONNECTOR_FAMILY, Chip
from vbus.circuit.glue_cycles import CycleTeller
from vbus.circuit.host_pins import HostPins
from vbus.core.kernel import NEVER, Clock, Kernel
from vbus.core.options import Option, Settings
from vbus.core.signals import HIGH, LOW, Guard, Net, Pin, Policy, Violation, Z
from vbus.core.state import Names
from vbus.glue.card_buses import BUSES, DATA, LATCH, BusRow
from vbus.glue.part import GlueBlock

CLOCK: Final = 8_333_333
MOST: Final = 256
"""Addresses of one card: requests carry eight bits."""


class CyclePath(Guard):
    """What brings whole cycles from a connector to the chips behind it."""

    def read(self, pins: HostPins, teller: CycleTeller, address: int, when: i64) -> int:
        """Run a read cycle with its latching edge at ``when`` (ps); return the byte.

        Args:
            pins: the host's pins.
            teller: takes the cycles it makes at chips.
            address: counted in strides from the card's base.
            when: its latching edge.
        """
        raise NotImplementedError

    def write(
        self, pins: HostPins, teller: CycleTeller, address: int, data: int, when: i64
    ) -> None:
        """Run a write cycle with its latching edge at ``when`` (ps)."""
        raise NotImplementedError

    def steady(self, address: int) -> tuple[Chip | None, int] | None:
        """Return which chip is read again if what was just read is, and the address there.

        Chip None: what stands on the wires is read. None: not known, or the wires would move.
        """
        raise NotImplementedError

    def forget(self) -> None:
        """Another state has been loaded."""
        raise NotImplementedError


class CardBus(Chip):
    """What a card has of the computer's bus, such as A0 to A19, D0-D7, /IOR and /IOW of ISA.

    It answers nothing by itself: address ``n`` of a cycle is the card's base and n strides on the
    address lines, and the byte read is what stands on D0-D7 as the strobe rises. Address and data
    are there before the strobe falls and after it rises. Cycles are strobes on wires that glue and
    chips listen to; where what comes of them is known beforehand, they are made at the chips: see
    :class:`~vbus.board.card.card_path.CardPath`.

    Attributes:
        row: which bus it is.
        read_strobe: the strobe of its reads.
        write_strobe: that of its writes.
        moving: the lines that its cycles may move.
    """

    FAMILY = CONNECTOR_FAMILY
    CONNECTOR = True
    ADDRESS_BITS = 8
    AXES = 0
    PARTS = tuple(BUSES)
    PINS_OF = {part: row.pins for part, row in BUSES.items()}
    OPTIONS = (
        Option("base", "count", 0, "address of the card's first port", low=0),
        Option("stride", "count", 1, "distance between ports that are neighbours", low=1),
        Option("size", "count", 16, "how many ports it has", low=1, high=MOST),
        Option("memory", "flag", False, "whether its addresses are memory"),
        Option("setup", "s", 0, "how long address and data stand before it; 0: as usual", low=0),
        Option("strobe", "s", 0, "how long a strobe is low; 0: as usual", low=0),
        Option("wait_states", "count", 0, "bus clocks by which strobes are longer", low=0),
        Option("hold", "s", 0, "how long written data stays; 0: as usual", low=0),
    )
    STATE: ClassVar[Names] = ("free_at: i64",)
    WIRING: ClassVar[Names] = (
        "address_pins", "chips", "hold_ps", "low_ps", "moving", "path", "read_strobe", "row",
        "setup_ps", "write_strobe",
    )  # fmt: skip

    def __init__(
        self,
        name: str,
        part: str,
        kernel: Kernel,
        clock: Clock,
        settings: Settings | None = None,
        policy: Policy | None = None,
        file: Callable[[Violation], None] | None = None,
    ) -> None:
        self.row: BusRow = BUSES[part]
        super().__init__(name, part, kernel, clock, settings, policy, file)
        row, given = self.row, self.settings
        strobes = row.strobes_of(bool(given["memory"]))
        self.read_strobe, self.write_strobe = strobes
        self.address_pins: list[Pin] = [self.pins[line] for line in row.address]
        self.moving: dict[str, Pin] = {
            line: pin for line, pin in self.pins.items()
            if line not in row.steady and (line not in row.strobes or line in strobes)
        }  # fmt: skip
        self.standing = tuple(name for name in self.moving if name != DATA)
        self.low_ps: int = (int(given["strobe"]) or row.strobe) + int(
            given["wait_states"]
        ) * row.wait
        """How long a strobe is low (ps)."""
        self.setup_ps: int = int(given["setup"]) or row.setup
        """How long address and data stand before it (ps)."""
        self.hold_ps: int = int(given["hold"]) or row.hold
        """How long written data stays after it (ps)."""

    def where(self, address: int) -> int:
        """Return what the address lines carry in a cycle at ``address``."""
        base, stride = int(self.settings["base"]), int(self.settings["stride"])
        return self.row.on_lines(base + address * stride)

    @property
    def latches(self) -> bool:
        """Whether anything is wired to the address latch enable: D0-D7 carry the address then."""
        return self.row.latched and len(self.pins[LATCH].net.pins) > 1

    chips: tuple[Chip, ...] = ()
    """The chips of the board, which drive their pins when :meth:`advance` asks."""
    path: CyclePath | None = None
    """What brings cycles to them."""
    free_at: int = 0
    """Instant from which the next cycle may begin, so that it is one the bus could make (ps)."""

    def power_on(self, done: bool) -> None:
        """There is nothing to reset."""

    def advance(self) -> None:
        """Let the chips show what they drive by now."""
        for chip in self.chips:
            chip.advance()

    def due(self, kind: int) -> i64:
        """Nothing happens of itself."""
        return NEVER

    def after_load(self) -> None:
        """Forget levels that are not set yet: the wires have been loaded."""
        if self.path is not None:
            self.path.forget()

    def strobes(self, write: bool, address: int, data: int) -> list[tuple[int, str, int]]:
        """Return the edges of a whole cycle."""
        low, setup, where, row = self.low_ps, self.setup_ps, self.where(address), self.row
        begin = -low - setup
        strobe = self.write_strobe if write else self.read_strobe
        # Lines that move alone: a bus keeps its address between cycles.
        edges = [
            (begin, line, where >> n & 1) for n, line in enumerate(row.address)
            if self.address_pins[n].level != where >> n & 1
        ]  # fmt: skip
        edges += [(begin, name, HIGH) for name in (self.read_strobe, self.write_strobe)]
        stands = begin
        if self.latches:
            # The latch falls half-way through the set-up time, and data comes in its last quarter.
            stands = -low - setup // 4
            edges += [
                (begin, DATA, where & 0xFF), (begin, LATCH, HIGH),
                (-low - setup // 2, LATCH, LOW),
            ]  # fmt: skip
            if not write:
                edges.append((stands, DATA, Z))
        if write:
            edges.append((stands, DATA, data))
        edges += [(-low, strobe, LOW), (0, strobe, HIGH)]
        if write:
            edges.append((self.hold_ps, DATA, Z))
        return edges


# -- what is remembered of cycles ------------------------------------------------------------------

BYTE: Final = -2
"""The level of what carries the byte of a write, or of a data bus that keeps what was there."""

Levels = list[tuple[Pin, int]]


class WireState:
    """How all stands that a cycle moves.

    Attributes:
        nets: the level of each wire.
        pins: what is driven onto them.
        blocks: what the glue holds.
        cycles: what is remembered of cycles from here, by address and way; None: nothing yet.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(
        self, nets: list[tuple[Net, int]], pins: Levels, blocks: list[tuple[GlueBlock, int]]
    ) -> None:
        self.nets: list[tuple[Net, int]] = nets
        self.pins: Levels = pins
        self.blocks: list[tuple[GlueBlock, int]] = blocks
        self.cycles: list[CardCycle | None] = [None] * (2 * MOST)

    def come_true(self, data: int) -> None:
        """Set all nets, pins and blocks, without edges or events.

        Args:
            data: the byte that is written; -1: a data bus keeps what was there.
        """
        for net, level in self.nets:
            if level == BYTE:
                level = data if data >= 0 else net.value
            net.put(level)
        for pin, level in self.pins:
            pin.level = data if level == BYTE else level
        for block, state in self.blocks:
            block.stand(state)


class CardCycle:
    """What a cycle comes to, as it was seen while it was played.

    Args:
        chips: those that are read or written, in the order of the reports.
        places: the address at each of them.
        fall: how long before its end a read begins at the chip (ps).

    Attributes:
        answer: what is read if no chip answers.
        floating: data buses that float afterwards, and what is left on each; BYTE: that of the
            cycle.
        steps: for chips that want every edge, what moves the wires to them: when, counted from the
            latching edge, and to which levels.
        source: the data bus of the chip that answers such a read; None: there is none.
        after: how the wires stand afterwards; with steps, before written data has let go. None:
            cycles like this are played.
        by_byte: what is written decides: the cycle for each byte.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(
        self, chips: list[Chip] | None = None, places: list[int] | None = None, fall: int = 0
    ) -> None:
        self.chips: list[Chip] = chips or []
        self.places: list[int] = places or []
        self.chip: Chip | None = chips[0] if chips else None
        self.place: int = places[0] if places else 0
        self.fall: i64 = fall
        self.answer: int = 0xFF
        self.floating: list[tuple[Net, int]] = []
        self.steps: list[tuple[int, Levels]] | None = None
        self.source: Net | None = None
        self.after: WireState | None = None
        self.by_byte: dict[int, CardCycle] | None = None
