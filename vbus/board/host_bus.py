"""One host's hold on a board: bus cycles, strobes, pins and time."""

from collections.abc import Callable
from typing import ClassVar

from mypy_extensions import i64, mypyc_attr

from vbus.board.card.cards import Card, Places
from vbus.board.host_clock import HostClock
from vbus.board.host_polls import HostPolls
from vbus.board.host_selection import Selection
from vbus.board.pin_maps import wiring
from vbus.board.strobe_watch import SETTLE_EVERY, StrobeWatch
from vbus.boardfile.sections import PinMapSection
from vbus.chips.base import OUTPUT, Chip
from vbus.circuit.circuit import Circuit
from vbus.circuit.host_pins import HostPins
from vbus.circuit.orders import READ, WRITE, Order, Orders
from vbus.core.kernel import END, NEVER, Kernel
from vbus.core.state import Names
from vbus.protocols import codes
from vbus.protocols.port import CardAccess, ChipInfo, HostPort, PortError, PortInfo
from vbus.protocols.requests import features


class Hosts:
    """The hosts of one board.

    Attributes:
        ports: what each has of the board, in the order they came.
        claims: who has claimed a chip, by its name.
    """

    WIRING: ClassVar[Names] = ("claims", "ports")

    def __init__(self) -> None:
        self.ports: list[HostBus] = []
        self.claims: dict[str, HostBus] = {}

    def deadlock(self, port: "HostBus") -> bool:
        """Tell whether those that ``port`` has to wait for wait for ``port`` themselves."""
        waiting = [port]
        for one in waiting:
            for chip in one.selection.selected:
                holder = self.claims.get(chip.name, one)
                if holder is port and one is not port:
                    return True
                if holder not in waiting and holder.held and holder.hold_until == NEVER:
                    waiting.append(holder)
        return False


@mypyc_attr(allow_interpreted_subclasses=True)
class HostBus(HostPort):
    """The port a board gives to one session; see :class:`~vbus.protocols.port.HostPort`.

    **A whole cycle** has its latching edge at the host's instant: the host's own time stamp
    (slaved), or one cycle time after the cycle before. While the bus nets are observed, the cycle
    is played as strobes on them; otherwise only its two decisive instants are computed.
    Replies, instants and violations are the same.

    **On a node** in virtual time a cycle beyond the grant is ordered for its instants, and the host
    waits for the grant: so it happens when it would have happened, with all that reaches the node
    before. There are no leases: an edge of another node could break what they promise.

    Args:
        board: the board.
        hosts: those that hold on to it, this one included once it is open.
        label: the host's name in traces.
        chips: what the session may select, in order.
        cycle_ps: cost of a whole cycle; 0: 1 us, or the chip's minimum in real time.
        card: address decoding, if the host speaks card addresses.

    Attributes:
        clock: when the host's next cycle happens.
        selection: the chips of following cycles.
        pins: what the host has soldered to the chips' nets.
        promises: whether it may be given leases; not where asking takes time, on a serial line.
        strobes: the bus cycles it makes by strobes.
        polls: its leases, and the polls it has answered from them.
    """

    STATE: ClassVar[Names] = (
        "selection: part", "clock: part", "polls: part", "claimed: list[str, ...]", "pins: part",
        "strobes: part",
    )  # fmt: skip
    WIRING: ClassVar[Names] = (
        "_card", "_due", "_hosts", "kernel", "_order", "_orders", "_places", "board", "chips",
        "cycle_ps", "held", "hold_until", "label", "on_events", "on_resume", "pin_map",
        "promises",
    )  # fmt: skip

    def __init__(
        self,
        board: Circuit,
        hosts: "Hosts",
        label: str,
        chips: list[Chip],
        cycle_ps: int,
        card: Card | None,
    ) -> None:
        self.board: Circuit = board
        self.label: str = label
        self.chips: list[Chip] = chips
        self.cycle_ps: int = cycle_ps
        self.pin_map: PinMapSection | None = None
        self.promises: bool = True
        self.held = False
        self.hold_until = 0
        self.on_resume: Callable[[], None] | None = None
        self.on_events: Callable[[], None] | None = None
        self._hosts: Hosts = hosts
        self._card: Card | None = card
        self.kernel: Kernel = board.kernel
        self.selection: Selection = Selection(board, chips, cycle_ps)
        self.clock: HostClock = HostClock(board, self)
        self.pins: HostPins = HostPins(
            board.kernel, label, chips, board.glue_of(chips), self._edge_seen
        )
        board.player.hosts.append(self.pins)
        self._places: list[Places] = card.places(self.pins.side_names()) if card else [{}, {}]
        self.strobes: StrobeWatch = StrobeWatch(board, label, chips)
        self.polls: HostPolls = HostPolls(board, self, self.selection, self.clock, self.pins)
        self._orders: Orders | None = Orders(board, label, saved=False) if board.granted else None
        self._order: int = -1
        self._due: int = 0

    def _edge_seen(self) -> None:
        if self.on_events is not None:
            self.on_events()

    # -- what the host is connected to --------------------------------------------------------

    def info(self) -> PortInfo:
        """Return what HELLO tells."""
        board, selection, pins, card = self.board, self.selection, self.pins, self._card
        sides = pins.side_names()
        program = "" if card is None and self.pin_map is None else f"step={board.clock_step};"
        if card is not None:
            program += card.program_text(lambda name: pins.output_of(board.find_pin(name)))
        return PortInfo(
            board.name,
            board.policy,
            board.rate if board.policy == "realtime" else 0.0,
            [
                ChipInfo(chip.name, chip.part, chip.FAMILY, chip.ADDRESS_BITS, cycle)
                for chip, cycle in zip(self.chips, selection.cycles, strict=True)
            ],
            pins.line_names(),
            pins.output_names(),
            sides,
            features(self.promises),
            wiring(self.pin_map, self.chips, selection.decoded, board.glue_of(self.chips), pins),
            card.text(sides) if card is not None else "",
            program,
        )

    def cost(self, *cycles: int) -> list[int]:
        """Set what a whole cycle costs (ps), for all chips or for each; return what it did."""
        return self.selection.cost(*cycles)

    def chip_number(self, name: str) -> int:
        """Return the bit number of the chip called ``name``."""
        return self.selection.number(name)

    def pin_number(self, name: str) -> int:
        """Return the number of a side pin."""
        pins = self.pins
        return pins.number(pins.sides, pins.side_names(), name, self.selection.selected)

    def line_number(self, name: str) -> int:
        """Return the number of a control line."""
        pins = self.pins
        return pins.number(pins.lines, pins.line_names(), name, self.selection.selected)

    def card(self, address: int, write: bool = False) -> CardAccess | None:
        """Decode a card address; None if no chip answers there."""
        return self._places[write].get(address)

    # -- choosing chips -----------------------------------------------------------------------

    def select(self, mask: int) -> None:
        """Choose the chips of following cycles."""
        # Drivers select the same chip before each cycle: that takes no search for a deadlock.
        if mask == self.selection.mask and not self._hosts.claims:
            return
        before, self.selection.mask = self.selection.mask, mask
        if self._hosts.deadlock(self):
            self.selection.mask = before
            raise PortError(
                codes.DEADLOCK,
                f"select {mask:X}: claimed by a session that waits for what this one has claimed;"
                " choose all chips of a packet, then claim them together",
            )
        self.yield_to_claim()

    def claim(self) -> bool:
        """Hold the selected chips' bus; False while another session has one of them."""
        if self.yield_to_claim():
            return False
        self.held = False
        for chip in self.selection.selected:
            self._hosts.claims[chip.name] = self
        for port in self._hosts.ports:
            port.yield_to_claim()
        return True

    def unclaim(self) -> None:
        """Let the bus go, and let those go on who wait for it."""
        claimed = self.claimed
        for name in claimed:
            del self._hosts.claims[name]
        if claimed:
            self._wake_others()

    def _wake_others(self) -> None:
        # A copy: a session that goes on may end at once.
        for port in list(self._hosts.ports):
            if port is not self and port.held and port.hold_until == NEVER:
                port.held = False
                if not port.yield_to_claim() and port.on_resume is not None:
                    port.on_resume()

    def yield_to_claim(self) -> bool:
        """Hold this session, if another one has claimed a chip it has selected."""
        claims = self._hosts.claims
        if claims and any(
            claims.get(chip.name, self) is not self for chip in self.selection.selected
        ):
            self.clock.hold(NEVER)
            return True
        return False

    @property
    def claimed(self) -> list[str]:
        """The chips this session has claimed."""
        return [name for name, port in self._hosts.claims.items() if port is self]

    @claimed.setter
    def claimed(self, names: list[str]) -> None:
        self.unclaim()
        for name in names:
            self._hosts.claims[name] = self

    def go_on(self) -> bool:
        """Lift the hold if what it waited for has come; tell whether the session may go on."""
        if self.held:
            if self.hold_until == NEVER:
                self.held = False
                self.yield_to_claim()
            elif self.hold_until <= self.board.limit:
                self.held = False
        return not self.held

    # -- whole bus cycles ---------------------------------------------------------------------

    def read(self, address: int) -> int:
        """Run one read cycle; return the byte (0..255)."""
        if self._orders is not None:
            data = self._ordered(self._orders, READ, address, 0)
            return data if self.selection.selected else self.selection.floating()
        board, selection, clock = self.board, self.selection, self.clock
        when = clock.begin(selection.cycle)
        chip = selection.chip
        if selection.path is not None:
            data = selection.path.read(self.pins, self.strobes, address, when)
        elif chip is None:
            data = self._read_together(address, when)
        elif self.kernel.observed and selection.observed():
            data = board.player.play([chip], self.pins, False, address, 0, when)
        else:
            if board.player.by_hand:
                board.player.lend([])
            fall: i64 = when - chip.read_low_ps
            if fall > self.kernel.now:
                self.kernel.pass_to(fall)
            chip.begin_read(address)
            self.kernel.pass_to(when)
            data = chip.end_read()
            chip.bus_net.value = data
            self.kernel.settle()
        board.reads += 1
        for chip in selection.selected:
            chip.reads += 1
        if board.observers:
            self._tell(when, False, address, data)
        return data

    def _read_together(self, address: int, when: int) -> int:
        """Read with no chip selected, or with several that drive the data lines all at once."""
        selected = self.selection.selected
        if not selected:
            self.kernel.pass_to(when)
            return self.selection.floating()
        self.strobes.passes_glue_by()
        data = self.board.player.play(selected, self.pins, False, address, 0, when)
        self.board.meet(self.label, selected)
        return data

    def write(self, address: int, data: int) -> None:
        """Run one write cycle on every selected chip."""
        if self._orders is not None:
            self._ordered(self._orders, WRITE, address, data)
            return
        board, selection, clock = self.board, self.selection, self.clock
        when = clock.begin(selection.cycle)
        if selection.path is not None:
            selection.path.write(self.pins, self.strobes, address, data, when)
        elif self.kernel.observed and selection.observed():
            board.player.play(selection.selected, self.pins, True, address, data, when)
        else:
            if board.player.by_hand:
                board.player.lend([])
            self.kernel.pass_to(when)
            for chip in selection.selected:
                chip.write(address, data)
                chip.bus_net.value = data
            self.kernel.settle()
        board.writes += 1
        for chip in selection.selected:
            chip.writes += 1
        if board.observers:
            self._tell(when, True, address, data)

    def _ordered(self, orders: Orders, kind: int, address: int, data: int) -> int:
        """Run a cycle on a board whose time is granted; return the byte.

        Raises:
            NotYet: it lies beyond the grant.
        """
        board, clock = self.board, self.clock
        if self._order < 0:
            self._due = clock.take_stamp(self.selection.cycle)
            names = tuple([chip.name for chip in self.selection.selected])
            board.player.flush()
            self._order = orders.give(Order(self._due, names, kind, address, data), keep=True)
        clock.check_granted(self._due)
        self.kernel.pass_to(self._due)
        number, self._order = self._order, -1
        return orders.result(number)

    def _tell(self, when: int, write: bool, address: int, data: int) -> None:
        board, names = self.board, self.selection.names
        board.tell_cycle(when, self.label, names, write, address, data)
        if (board.reads + board.writes) % SETTLE_EVERY == 0:
            board.catch_up()

    # -- polls answered from leases -----------------------------------------------------------

    def lease(self, address: int) -> tuple[int, int, int] | None:
        """How long the byte just read will be read again; :class:`~vbus.protocols.port.HostPort`.

        Nothing is promised while another host could touch the chips.
        """
        return self.polls.lease(address) if self.promises and len(self._hosts.ports) <= 1 else None

    def foresee(self, address: int) -> tuple[int, int] | None:
        """Tell what comes after the lease just given (:class:`~vbus.protocols.port.HostPort`)."""
        return self.polls.foresee(address)

    def polled(self, address: int, count: int) -> bool:
        """Run the polls a host has answered from a lease; False to be resumed later."""
        return self.polls.run(address, count)

    def polled_at(self, address: int, first: int, steps: tuple[int, ...]) -> bool:
        """Run polls a host has answered from a lease, each at its stamp; False: resume later."""
        return self.polls.run_at(address, first, steps)

    # -- strobes and pins ---------------------------------------------------------------------

    def lines(self, mask: int, levels: int) -> None:
        """Put control lines to levels, all at this instant."""
        self._take_back()
        self.clock.judge(self.chips, self.clock.timed or self.pins.held_lines(mask))
        self.strobes.before()
        self.pins.set_lines(mask, levels)
        self.strobes.after()

    def _take_back(self) -> None:
        """Come to the host's instant, with all lines as hosts have left them by hand."""
        self.clock.arrive()
        self.board.player.give_back()

    def _data_chip(self) -> Chip:
        known = self.selection.selected or self.chips
        if known:
            return known[0]
        raise PortError(codes.NO_SUCH, "this session has no chip")

    def drive(self, data: int) -> None:
        """Drive D0-D7 of the selected chips' bus."""
        self._take_back()
        self.clock.judge(self.chips, self.clock.timed)
        self.pins.output_word()  # what lazy chips drive may be fought
        self.pins.of(self._data_chip().data_pin).drive(data & 0xFF)
        self.kernel.settle()

    def release(self) -> None:
        """Let D0-D7 float."""
        self._take_back()
        self.pins.of(self._data_chip().data_pin).release()
        self.kernel.settle()

    def sample(self) -> tuple[int, int]:
        """Return D0-D7 as they stand, and all output lines."""
        self.clock.arrive()
        outputs = self.pins.output_word()
        net = self._data_chip().bus_net
        self.strobes.look(net)
        return net.value, outputs

    def pin(self, number: int, level: int) -> None:
        """Drive side pin ``number`` to 0 or 1; 2 lets go."""
        self.clock.arrive()
        self.clock.judge(self.chips, self.clock.timed or self.pins.held(self.pins.side(number)))
        self.strobes.goes_through_glue()
        self.pins.set_side(number, level)

    def getpin(self, number: int) -> int:
        """Return the level of side pin ``number``."""
        side = self.pins.side(number)
        self.clock.arrive()
        self.pins.output_word()  # what lazy chips drive
        return side.net.value

    # -- time ---------------------------------------------------------------------------------

    def delay(self, duration: int) -> bool:
        """Let time pass for this host."""
        return self.clock.delay(duration)

    def at(self, when: int) -> None:
        """Set the host's own clock (slaved boards only)."""
        self.clock.at(when)

    def now(self) -> int:
        """Return chip time."""
        return self.clock.now()

    def wait(self, longest: int) -> tuple[bool, int] | None:
        """Let time pass until the selected chips can take a cycle, at most ``longest`` ps."""
        self.clock.arrive()
        clock = self.clock
        clock.used = True
        if clock.target < 0:
            begun: int = self.kernel.now
            clock.target = min(begun + longest, END)
        deadline = clock.target
        while True:
            for chip in self.selection.selected:
                chip.advance()
            now = self.kernel.now
            ready = max((chip.ready_at() for chip in self.selection.selected), default=now)
            if ready <= now or now >= deadline:
                clock.target = -1
                self.held = False
                return ready <= now, now
            if not clock.pass_to(min(ready, deadline)):
                return None

    def sync(self) -> tuple[int, int]:
        """Bring the chips up to the host's time; output lines and the next possible edge."""
        self.clock.arrive()
        outputs, due = self.pins.output_word(), self.kernel.next_due
        return outputs, min([due, *(chip.due(OUTPUT) for chip in self.chips)])

    def events(self, mask: int) -> None:
        """From now on report each edge of the output lines in ``mask``."""
        self.pins.output_word()  # what a lazy chip owes has been before
        self.pins.watch(mask)

    def take_events(self) -> list[tuple[int, int]]:
        """Return and forget the edges seen since the last call."""
        return self.pins.take_edges()

    def close(self) -> None:
        """The session has ended: let go of lines, pins, claims and events."""
        try:
            if self._orders is not None:
                self._orders.close()
            self.board.player.flush()
            self.board.player.give_back()
            self.strobes.before()
            self.pins.unsolder()
            if self.pins in self.board.player.hosts:  # a session may be closed twice
                self.board.player.hosts.remove(self.pins)
            self.strobes.after()
            self.strobes.passes_glue_by()
        finally:  # whatever happens on the board: others may wait for the claim
            self.unclaim()
            if self in self._hosts.ports:
                self._hosts.ports.remove(self)

    def let_go(self) -> None:
        """Let go of lines, pins, claims, events and promises, as if the session began anew."""
        self.board.player.flush()
        self.board.player.give_back()
        self.pins.unsolder()
        self.unclaim()
        self.polls.until = 0

    def forget_time(self) -> None:
        """Time has been set: forget stamps, and what the session waited for."""
        self.clock.forget()
        self.polls.left = -1
        self.held = False

    def after_load(self) -> None:
        """A session that was held makes its call again; nothing is promised to it."""
        self.held = False
        self.polls.until = 0
