"""What every chip is to a board: pins, bus cycles, time, state."""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Final

from mypy_extensions import i64, mypyc_attr

from vbus.chips.ac_table import AcTable
from vbus.chips.bus_watch import BusTable
from vbus.chips.tables import CardRow, PinRow
from vbus.core.kernel import NEVER, Clock, Kernel, Timer
from vbus.core.options import Option, Settings, Value, with_defaults
from vbus.core.signals import (
    OFF,
    STRICT,
    Net,
    Pin,
    Plant,
    Policy,
    Reading,
    Rule,
    ValueTable,
    Violation,
)
from vbus.core.signals.axis import DRIVES
from vbus.core.state import UNDECLARED, Names

OUTPUT: Final = 0
"""The next change of an output, for :meth:`Chip.due`."""
EDGE: Final = 1
"""The same, but a later bound is worth looking for: other nodes wait for each edge of a line, and a
line that cannot move until a host has used the chip is none to wait for."""
CHANGE: Final = 2
"""The next change of what telemetry tells."""
POLL: Final = 3
"""The next change of the byte read at one of :attr:`Chip.FREE_READS`."""
SAMPLE: Final = 4
"""The next sample that is made or shows, to the picosecond; never of a chip that rests."""

CONNECTOR_FAMILY: Final = "card"
"""``FAMILY`` of the connector of a card, which is no chip."""


@mypyc_attr(allow_interpreted_subclasses=True)
class Chip:
    """Base of all chips.

    A chip is lazy: it computes its state when it is asked (:meth:`advance`), or, while
    one of its outputs is joined to another part or observed, at each instant an output may
    change (:meth:`due`).

    **Order within an instant.** Whatever the chip does of itself at instant t comes before any
    outside event (bus cycle, input edge) at t.

    Both ways in end in the same three calls, :meth:`begin_read`, :meth:`end_read` and
    :meth:`write`: a whole bus cycle makes them at its strobe's edges, the pin front-end when it
    sees those edges on the nets.

    Args:
        name: the chip's name on the board.
        part: part number as ordered.
        kernel: the board's time.
        clock: the CLK input.
        settings: values for :attr:`OPTIONS`; absent ones take their defaults.
        policy: what to do on violations.
        file: takes each violation filed.
    """

    FAMILY: ClassVar[str] = ""
    ADDRESS_BITS: ClassVar[int] = 0
    AXES: ClassVar[int] = 1
    PARTS: ClassVar[tuple[str, ...]] = ()
    PINS: ClassVar[tuple[PinRow, ...]] = ()
    PINS_OF: ClassVar[Mapping[str, tuple[PinRow, ...]]] = {}
    """The pins of parts that have others."""
    BUS: ClassVar[BusTable | None] = None
    """The protocol of its host bus; None: its cycles can neither be played nor seen as edges."""
    RULES: ClassVar[tuple[Rule, ...]] = ()
    VALUES: ClassVar[ValueTable] = ValueTable()
    FREE_READS: ClassVar[tuple[int, ...]] = ()
    """Addresses at which reading has no effect a host could see; see :data:`POLL`."""
    TRACELESS: ClassVar[bool] = False
    """Whether reads at these addresses leave no trace in the chip's state either, so that of many
    in a row only the last need be run."""
    CONNECTOR: ClassVar[bool] = False
    """Whether it is the connector of a card: no chip, but where a computer's bus comes in."""
    PERIOD_CLK: ClassVar[int] = 0
    """Clock periods for which the mechanics behind an axis run at a time; 0: the chip says so."""
    OPTIONS: ClassVar[tuple[Option, ...]] = ()
    CARD_DECODES: ClassVar[dict[str, tuple[CardRow, ...]]] = {}
    """Address decodes of known cards, by name; an address may lie beyond :attr:`ADDRESS_BITS`
    where the card, not the chip, answers."""
    STATE: ClassVar[Names] = UNDECLARED
    WIRING: ClassVar[Names] = (
        "name", "clock", "settings", "cycle_ps", "front", "on_levels", "pins", "_tell",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = ("reads", "writes", "on_node", "heard")

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
        self.name: str = name
        self.part: str = part
        self.kernel: Kernel = kernel
        self.clock: Clock = clock
        # Checked with their units where they come from a board file; here for parts made in Python.
        self.settings: dict[str, Value] = with_defaults(self.OPTIONS, settings)
        self.pin_rows: tuple[PinRow, ...] = self.PINS_OF.get(part, self.PINS)
        """The pins of this part; the class' :attr:`PINS` are those of its family's first."""
        self.axis_count: int = self.AXES
        self.policy: Policy = policy if policy is not None else Policy()
        self.timing_checked: bool = False
        """Whether strobes carry real times now, so that AC limits are judged."""
        bus = self.BUS
        # Both follow from the bus table; a chip whose supply changes its limits sets them anew.
        self.read_low_ps: int = -bus.strobe(False)[0] if bus is not None else 0
        """How long the read strobe of a whole bus cycle is low (ps)."""
        self.cycle_ps: int = bus.cycle_ps if bus is not None else 0
        """Shortest whole bus cycle the datasheet allows (ps)."""
        self.reads: int = 0
        """Whole read cycles that hosts have made; no part of the saved state."""
        self.writes: int = 0
        """Whole write cycles that hosts have made."""
        self.front: Any = None
        """Its :class:`~vbus.chips.front_end.BusFrontEnd`, if it has one."""
        self.on_levels: Callable[[], None] | None = None
        """Takes the control lines as they stand, put there between two cycles without edges; None:
        the chip wants the edges of every cycle that comes through glue."""
        self.standing: tuple[str, ...] = ()
        """Lines of a connector that stay as they are when a host has gone."""
        self.pins: dict[str, Pin] = {}
        self._file: Callable[[Violation], None] | None = file
        self._tell: Callable[[Chip], dict[str, Reading]] | None = None
        self.timer: Timer = kernel.timer(self._due)
        self.on_node: bool = False
        """Whether other nodes wait for its outputs: an :data:`EDGE` sets its timer then."""
        self.heard: bool = False
        """Whether anybody notices an edge of its outputs: :attr:`timer` is set to the next one."""
        heard = self.heard_changed
        for row in self.pin_rows:
            net = Net(kernel, f"{name}.{row.name}", rest=row.rest, width=row.width)
            pin = net.solder(row.name, open_drain=row.direction == "od")
            # An input has no level of its own to bring up to date: its listeners do not wake the
            # chip.
            if row.direction != "in":
                pin.on_heard = heard
            self.pins[row.name] = pin
        self.bus_pins: tuple[Pin, ...] = tuple(
            self.pins[row.name]
            for row in self.pin_rows
            if row.strobe or (row.direction == "io" and row.width == 8)
        )
        """The host bus: its strobes and the data pins."""
        self.data_pin: Pin = next(
            self.pins[row.name] for row in self.pin_rows if row.direction == "io" and row.width == 8
        )
        """The pins of the 8-bit data bus."""

    @property
    def bus_net(self) -> Net:
        """The net of the data bus."""
        return self.data_pin.net

    # -- what a family answers -----------------------------------------------------------------

    def begin_read(self, address: int) -> None:
        """The read strobe of a cycle at ``address`` falls now."""
        raise NotImplementedError

    def end_read(self) -> int:
        """The read strobe rises now; return the byte the host has taken (0..255)."""
        raise NotImplementedError

    def read_byte(self) -> int:
        """Return what the data bus shows in the read under way.

        Override it where :meth:`end_read` does more than give that.
        """
        return self.end_read()

    def write(self, address: int, data: int) -> None:
        """A written byte is latched now."""
        raise NotImplementedError

    def advance(self) -> None:
        """Bring the chip's state up to ``kernel.now``, inclusive of what is due at it."""
        raise NotImplementedError

    def due(self, kind: int) -> i64:
        """Return when the next thing of a kind is due, as long as nothing touches the chip (ps).

        It lies after now, where the chip has been brought up to now, and is :data:`NEVER` if
        nothing will come. But for a :data:`SAMPLE` it may be early, never late: who asks asks
        again then.

        Args:
            kind: :data:`OUTPUT`, :data:`EDGE`, :data:`CHANGE`, :data:`POLL` or :data:`SAMPLE`.
        """
        raise NotImplementedError

    def power_on(self, done: bool) -> None:
        """Supply is up and the reset pin is released now: the datasheet's reset runs.

        Args:
            done: start after that reset instead, as if it had just ended.
        """
        raise NotImplementedError

    def ready_at(self) -> int:
        """Return the instant from which the host may make its next bus cycle (ps).

        It is now or earlier if the chip is ready, as one is that is never busy, and :data:`NEVER`
        if it will not be.
        """
        return self.kernel.now

    def connect(self, axis: int, plant: Plant) -> None:
        """Attach the mechanics of axis ``axis`` (0-based) before time starts.

        Raises:
            ValueError: the plant does not take the kind of drive this chip gives.
        """
        raise NotImplementedError

    # -- what few families answer otherwise --------------------------------------------------

    def undriven(self, axis: int) -> str:
        """Return why the chip cannot move an axis as it is set up now; "" if it can.

        Args:
            axis: its number, from 0.

        Returns:
            a clause for people, which names the command that is missing.
        """
        return ""

    def left_over(self) -> list[tuple[Rule, str]]:
        """Return what a driver has begun and not ended, or never done, when its run ends.

        Nothing is filed, and nothing changes: it is asked once, at the end of a run.

        Returns:
            a rule, and a sentence for people, for each: a note, or what no right driver leaves.
        """
        return []

    def hint(self, rule: str, when: int) -> str:
        """Return what a host should know of a rule it has broken at an instant (ps); "" if nothing.

        Returns:
            a sentence for people, which names the setting or command that helps.
        """
        return ""

    def step_ps(self) -> i64:
        """Return how far apart the samples are that are computed one by one now (ps).

        NEVER of a chip that rests, and of one whose samples cannot be set so short that a server
        would be long at them.
        """
        return NEVER

    def foresee(self, address: int, when: int) -> tuple[int, int] | None:
        """Return what reads at ``address`` give from ``when`` on, and until when at least (ps).

        Asked with the instant at which a :data:`POLL` is due, or an earlier one. No output changes
        before the end either, unless something from outside touches the chip. None: not known.
        """
        return None

    def exchange_plant(self, axis: int, plant: Plant) -> None:
        """Put other mechanics behind an axis (0-based) between two periods, while time runs.

        Raises:
            ValueError: this chip does not let its plant be exchanged.
        """
        raise ValueError(f"{self.part}: this chip does not let its plant be exchanged")

    def clock_changed(self, shift: Callable[[int, int], int] | None) -> None:
        """The clock stands, runs again, or has another course: so is when the next things come.

        Args:
            shift: gives where an instant that the chip waits for lies now, from where it was and
                from now (ps); None: the clock runs on.
        """

    def strobes(self, write: bool, address: int, data: int) -> list[tuple[int, str, int]]:
        """Return the edges of a whole bus cycle, for observed buses.

        The same cycle has the same edges, whatever the chip's state: a host asks once. Only a
        :attr:`CONNECTOR` is asked each time.

        Returns:
            ``(offset, pin name, level)`` in order of time; the offset in ps is counted from the
            latching edge (negative before it). The data bus with level -1 is let go.
        """
        assert self.BUS is not None
        return self.BUS.edges(write, address, data)

    def before_save(self) -> None:
        """Come to now."""
        self.advance()

    def overdue(self) -> bool:
        """Tell whether more is due inside than could have been left: no chip that ran is so.

        Asked of a chip whose state comes from elsewhere, before it works that off.
        """
        return False

    # -- what every chip has ------------------------------------------------------------------

    def resting(self) -> bool:
        """Whether nothing comes of leaving the chip alone, until something outside touches it.

        Such a chip makes no samples, files nothing and drives nothing anew, and to bring it up to
        date later takes no longer than now: a server need not do it.
        """
        return self.due(SAMPLE) == NEVER

    def telemetry(self) -> dict[str, Reading]:
        """Return the values of :attr:`VALUES` that have a key, by their keys, as they are now."""
        self.advance()
        # Compiled at the first question: most chips of a rack are never asked.
        if self._tell is None:
            self._tell = self.VALUES.telemetry(self.axis_count)
        return self._tell(self)

    def report(
        self, rule: Rule, measured: int = 0, limit: int = 0, detail: str = "", when: int = -1
    ) -> bool:
        """File a violation of ``rule``; tell whether the cycle is to be lost (strict).

        ``when`` is the instant it happened (ps) if that is not now: a lazy chip may find out
        later what happened in one of its samples.
        """
        level = self.policy.of(rule.name)
        # Before anything is put into words: a rule that is off costs a look-up.
        if level == OFF:
            return False
        if self._file is not None:
            self._file(
                Violation(
                    self.kernel.now if when < 0 else when,
                    self.name,
                    rule.name,
                    rule.clause,
                    rule.severity,
                    measured,
                    limit,
                    detail or rule.title,
                )
            )
        # A warning or a note never loses a cycle, whatever the policy says.
        return level == STRICT and rule.severity == "error"

    def heard_changed(self) -> None:
        """An output has its first listener, or none any more: be eager or lazy from now on."""
        # Of inputs nothing depends on who listens.
        heard = any(pin.net.heard for pin in self.pins.values() if pin.on_heard is not None)
        if heard:
            # Maybe to another output than before.
            self.heard = True
            self.advance()
            self.rearm()
        # Lazy again: the next question brings the chip up to date. A state that was saved while
        # a chip had a listener has set the timer.
        elif self.heard or self.timer.due != NEVER:
            self.heard = False
            self.timer.cancel()

    def input_changed(self) -> None:
        """Something from outside has changed the chip: what follows from its state follows.

        Call it at the end of whatever does so: bus cycles, edges at inputs, faults.
        """
        self.rearm()

    def rearm(self) -> None:
        """Set the timer to the next event, if anybody listens."""
        if self.heard:
            due = self.due(EDGE if self.on_node else OUTPUT)
            # The timer's old instant was worked out from another state.
            if due == NEVER:
                self.timer.cancel()
            else:
                self.timer.at(due)

    def _due(self) -> None:
        self.advance()
        self.rearm()


def check_drive(chip: "Chip", axis: int, plant: Plant, *drives: str) -> None:
    """Refuse a plant for an axis (0-based) that is not there, or that takes no such drive.

    Args:
        chip: the chip that is to drive it.
        axis: its number.
        plant: the mechanics.
        drives: the kinds of drive that chip gives, of which the plant must take one.

    Raises:
        ValueError: says which axes there are, or what the plant takes.
    """
    if not 0 <= axis < chip.axis_count:
        raise ValueError(f"the {chip.part} has no axis {axis + 1}; it has {chip.axis_count}")
    # Said when the board is built: in a sample it would be an exception.
    if not any(drive in plant.TAKES for drive in drives):
        given, taken = ([DRIVES[kind] for kind in kinds] for kinds in (drives, plant.TAKES))
        right = " or ".join(given)
        raise ValueError(
            f"the {chip.part} gives {right}; this plant takes {', '.join(taken)}: choose a model"
            f" that takes {right}"
        )


class AcLimits:
    """The AC limits of one chip, and the check of measured intervals against them.

    Args:
        chip: whose limits they are; its clock decides those that count clock periods.
        table: the table of its supply.

    Attributes:
        table: the table.
        least: what an interval must last at least (ps), by symbol.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, chip: Chip, table: AcTable) -> None:
        self._chip: Final[Chip] = chip
        self.table: Final[AcTable] = table
        self.least: Final[dict[str, int]] = table.limits(chip.clock)

    def short(self, symbol: str, measured: int, detail: str = "", when: int = -1) -> bool:
        """File an interval below its limit; tell whether what it belongs to is lost (strict).

        Args:
            symbol: the row.
            measured: the interval (ps).
            detail: a sentence for people, if the row's title does not say enough.
            when: instant at which the interval ended (ps), if that is not now.
        """
        limit = self.least[symbol]
        # The comparison first: nearly every interval is long enough.
        return measured < limit and self._chip.report(
            self.table.rules[symbol], measured, limit, detail, when
        )

    def outside(self, symbol: str, shortest: int, longest: int) -> None:
        """File a duration below the row's minimum or above its maximum.

        Args:
            symbol: the row.
            shortest: the duration, rounded down (ps); it is what is filed.
            longest: the same, rounded up.
        """
        row = self.table[symbol]
        # The duration may be no whole number of ps: what is exactly at a limit keeps it.
        if shortest < row.min_ps or longest > row.max_ps:
            limit = row.min_ps if shortest < row.min_ps else row.max_ps
            self._chip.report(self.table.rules[symbol], shortest, limit)
