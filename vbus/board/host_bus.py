"""One host's hold on a board: bus cycles, strobes, pins and time."""

from typing import ClassVar, Final

from mypy_extensions import i64, mypyc_attr

from vbus.board.cards import Card
from vbus.board.circuit import Circuit
from vbus.board.host_reach import HostReach
from vbus.board.strobe_watch import SETTLE_EVERY, StrobeWatch
from vbus.chips.base import Chip
from vbus.kernel import NEVER, US
from vbus.protocols import codes
from vbus.protocols.port import PortError
from vbus.signals import Z
from vbus.state import Names

FLOATING: Final = 0xFF
LONGEST_LEASE: Final = 100_000 * US
"""How far ahead a lease reaches at most: a host that polls for ever is heard of now and then."""


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


@mypyc_attr(allow_interpreted_subclasses=True)
class HostBus(HostReach):
    """The port a board gives to one session; see :class:`~vbus.protocols.port.HostPort`.

    **A whole cycle** has its latching edge at the host's instant: the host's own time stamp
    (slaved), or one cycle time after the cycle before. While somebody observes the bus nets the
    cycle is played as strobes on them; otherwise only its two decisive instants are computed.
    Replies, instants and violations are the same.

    Args:
        board: the board.
        hosts: those that hold on to it, this one included once it is open.
        label: the host's name in traces.
        chips: what the session may select, in order.
        cycle_ps: cost of a whole cycle; 0: 1 us, or the chip's minimum in real time.
        card: address decoding, if the host speaks card addresses.
    """

    STATE: ClassVar[Names] = (
        "mask", "_stamp", "_last_at", "_timed: bool", "_target", "_polls",
        "claimed: list[str, ...]", "_pins: part", "strobes: part",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_hosts", "every_cycle")
    DERIVED: ClassVar[Names] = ("_claimed", "_leased_until")

    def __init__(
        self,
        board: Circuit,
        hosts: "Hosts",
        label: str,
        chips: list[Chip],
        cycle_ps: int,
        card: Card | None,
    ) -> None:
        super().__init__(board, label, chips, cycle_ps, card)
        self._hosts: Hosts = hosts
        self.every_cycle: bool = False
        """Whether each poll of POLLED must be run, though nobody could tell: for a journal."""
        self._leased_until: int = 0
        self._claimed: list[str] = []
        self.strobes: StrobeWatch = StrobeWatch(board, label, chips)

    # -- choosing chips -----------------------------------------------------------------------

    def select(self, mask: int) -> None:
        """Choose the chips of following cycles."""
        if mask >> len(self.chips):
            raise PortError(
                codes.NO_SUCH, f"select {mask:X}: this session has {len(self.chips)} chips"
            )
        self._mask = mask
        self._selected = [chip for n, chip in enumerate(self.chips) if mask >> n & 1]
        self._chip = self._selected[0] if len(self._selected) == 1 else None
        if self._selected:
            self._cycle = max(c for n, c in enumerate(self._cycles) if mask >> n & 1)
        self.yield_to_claim()

    def claim(self) -> bool:
        """Hold the selected chips' bus; False while another session has one of them."""
        claims = self._hosts.claims
        if self.yield_to_claim():
            return False
        self.held = False
        for chip in self._selected:
            if claims.get(chip.name) is None:
                claims[chip.name] = self
                self._claimed.append(chip.name)
        for port in self._hosts.ports:
            port.yield_to_claim()
        return True

    def unclaim(self) -> None:
        """Let the bus go, and let those go on who wait for it."""
        for name in self._claimed:
            del self._hosts.claims[name]
        if self._claimed:
            self._claimed = []
            self._wake_others()

    def _wake_others(self) -> None:
        for port in list(self._hosts.ports):
            if port is not self and port.held and port.hold_until == NEVER:
                port.held = False
                if not port.yield_to_claim() and port.on_resume is not None:
                    port.on_resume()

    def yield_to_claim(self) -> bool:
        """Hold this session, if another one has claimed a chip it has selected."""
        claims = self._hosts.claims
        if claims and any(claims.get(chip.name, self) is not self for chip in self._selected):
            self._hold(NEVER)
            return True
        return False

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

    def _observed(self) -> bool:
        if not self._kernel.observed:
            return False
        for chip in self._selected:
            for pin in chip.bus_pins:
                if pin.net.observers:
                    return True
        return False

    def read(self, address: int) -> int:
        """Run one read cycle; return the byte (0..255)."""
        board = self.board
        when = self._begin()
        chip = self._chip
        if chip is None:
            data = self._read_together(address, when)
        elif self._observed():
            data = board.player.play([chip], self._pins, False, address, 0, when)
        else:
            fall: i64 = when - chip.read_low_ps
            if fall > self._kernel.now:
                self._run_until(fall)
            chip.begin_read(address)
            self._run_until(when)
            data = chip.end_read()
            chip.bus_net.value = data
            self._kernel.settle()
        board.reads += 1
        for chip in self._selected:
            chip.reads += 1
        if board.observers:
            self._tell(when, False, address, data)
        return data

    def lease(self, address: int) -> tuple[int, int, int] | None:
        """How long the byte just read will be read again; :class:`~vbus.protocols.port.HostPort`.

        Nothing is promised in real time, nor while another host could touch the chips.
        """
        board = self.board
        chip = self._chip
        if (
            chip is None
            or address not in chip.FREE_READS
            or board.policy == "realtime"
            or board.disturbed
            or len(self._hosts.ports) > 1
        ):
            return None
        outputs = self._pins.output_word()
        until = min(self._kernel.next_due, chip.steady_until(address))
        until = min([until, *(neighbour.next_event() for neighbour in self.chips)])
        now: int = self._kernel.now
        if until <= now + self._cycle:
            return None
        self._leased_until = min(until, now + LONGEST_LEASE)
        return outputs, now, self._leased_until

    def foresee(self, address: int) -> tuple[int, int] | None:
        """Tell what comes after the lease just given (:class:`~vbus.protocols.port.HostPort`)."""
        chip, when = self._chip, self._leased_until
        following = chip.foresee(address, when) if chip is not None else None
        if following is None:
            return None
        data, until = following
        until = min(until, self._kernel.next_due, self._kernel.now + LONGEST_LEASE)
        for neighbour in self.chips:
            if neighbour is not chip:
                until = min(until, neighbour.next_event())
        if until <= when + self._cycle:
            return None
        self._leased_until = until
        return data, until

    def end_lease(self) -> None:
        """Somebody else is about to touch the board: what was promised comes true first."""
        until, self._leased_until = self._leased_until, 0
        if until > self._kernel.now:
            self.board.run_until(until)

    def polled(self, address: int, count: int) -> bool:
        """Run the polls a host has answered from a lease; False to be resumed later."""
        if self._polls < 0:
            self._polls = count
        self.held = False
        while self._polls:
            if self.held:
                return False
            self._pass_over(address)
            try:
                self.read(address)
            except PortError:
                self._polls = -1
                raise
            self._polls -= 1
        self._polls = -1
        return True

    def _untold(self, address: int) -> bool:
        chip = self._chip
        if chip is None or not chip.TRACELESS or address not in chip.FREE_READS:
            return False
        return not (self.every_cycle or self.board.observers or self._observed())

    def _pass_over(self, address: int) -> None:
        """Leave out all polls but the last that time allows, where nothing could tell."""
        if self._stamp < 0 and self._untold(address):
            now: int = self._kernel.now
            over = min(self._polls, (self.board.limit - now) // self._cycle) - 1
            if over > 0:
                self._run_until(now + over * self._cycle)
                self._count_untold(over)

    def _count_untold(self, polls: int) -> None:
        self.board.reads += polls
        if self._chip is not None:
            self._chip.reads += polls
        self._polls -= polls

    def write(self, address: int, data: int) -> None:
        """Run one write cycle on every selected chip."""
        board = self.board
        when = self._begin()
        if self._observed():
            board.player.play(self._selected, self._pins, True, address, data, when)
        else:
            self._run_until(when)
            for chip in self._selected:
                chip.write(address, data)
                chip.bus_net.value = data
            self._kernel.settle()
        board.writes += 1
        for chip in self._selected:
            chip.writes += 1
        if board.observers:
            self._tell(when, True, address, data)

    def _tell(self, when: int, write: bool, address: int, data: int) -> None:
        board = self.board
        name = "+".join(chip.name for chip in self._selected) or "-"
        for observer in board.observers:
            observer.bus_cycle(when, self.label, name, write, address, data)
        if (board.reads + board.writes) % SETTLE_EVERY == 0:
            board.catch_up()

    def _float(self) -> int:
        """Return what a read finds with no chip selected."""
        net = self.chips[0].bus_net if self.chips else None
        return net.value if net is not None and net.rest == Z else FLOATING

    def _read_together(self, address: int, when: int) -> int:
        """Read with no chip selected, or with several that drive the data lines all at once."""
        if not self._selected:
            self._run_until(when)
            return self._float()
        data = self.board.player.play(self._selected, self._pins, False, address, 0, when)
        self.board.meet(self.label, self._selected)
        return data

    # -- strobes and pins ---------------------------------------------------------------------

    def lines(self, mask: int, levels: int) -> None:
        """Put control lines to levels, all at this instant."""
        self._arrive()
        self._judge()
        self.strobes.before()
        self._pins.set_lines(mask, levels)
        self.strobes.after()

    def _judge(self) -> None:
        for chip in self.chips:
            chip.judged = self._timed

    def _data_chip(self) -> Chip:
        if self._selected:
            return self._selected[0]
        if self.chips:
            return self.chips[0]
        raise PortError(codes.NO_SUCH, "this session has no chip")

    def drive(self, data: int) -> None:
        """Drive D0-D7 of the selected chips' bus."""
        self._arrive()
        self._judge()
        chip = self._data_chip()
        self._pins.of(chip.data_pin).drive(data & 0xFF)
        self._kernel.settle()

    def release(self) -> None:
        """Let D0-D7 float."""
        self._arrive()
        self._pins.of(self._data_chip().data_pin).release()
        self._kernel.settle()

    def sample(self) -> tuple[int, int]:
        """Return D0-D7 as they stand, and all output lines."""
        self._arrive()
        outputs = self._pins.output_word()
        return self._data_chip().bus_net.value, outputs

    def pin(self, number: int, level: int) -> None:
        """Drive side pin ``number`` to 0 or 1; 2 lets go."""
        self._arrive()
        self._judge()
        self._pins.set_side(number, level)

    def getpin(self, number: int) -> int:
        """Return the level of side pin ``number``."""
        side = self._pins.side(number)
        self._arrive()
        for chip in self.chips:
            chip.advance()
        self._kernel.settle()
        return side.net.value

    # -- time ---------------------------------------------------------------------------------

    def wait(self, longest: int) -> tuple[bool, int] | None:
        """Let time pass until the selected chips can take a cycle, at most ``longest`` ps."""
        self._arrive()
        if self._target < 0:
            begun: int = self._kernel.now
            self._target = min(begun + longest, NEVER - 1)
        deadline = self._target
        while True:
            for chip in self._selected:
                chip.advance()
            now = self._kernel.now
            ready = max((chip.ready_at() for chip in self._selected), default=now)
            if ready <= now or now >= deadline:
                self._target = -1
                self.held = False
                return ready <= now, now
            if not self._pass_to(min(ready, deadline)):
                return None

    def sync(self) -> tuple[int, int]:
        """Bring the chips up to the host's time; output lines and the next possible edge."""
        self._arrive()
        outputs, due = self._pins.output_word(), self._kernel.next_due
        return outputs, min([due, *(chip.next_event() for chip in self.chips)])

    def events(self, mask: int) -> None:
        """From now on report each edge of the output lines in ``mask``."""
        self._pins.watch(mask)

    def take_events(self) -> list[tuple[int, int]]:
        """Return and forget the edges seen since the last call."""
        return self._pins.take_edges()

    def close(self) -> None:
        """The session has ended: let go of lines, pins, claims and events."""
        try:
            self.board.player.flush()
            self.strobes.before()
            self._pins.unsolder()
            self.strobes.after()
        finally:  # whatever happens on the board: others may wait for the claim
            self.unclaim()
            if self in self._hosts.ports:
                self._hosts.ports.remove(self)

    def let_go(self) -> None:
        """Let go of lines, pins, claims, events and promises, as if the session began anew."""
        self.board.player.flush()
        self._pins.unsolder()
        self.unclaim()
        self._leased_until = 0

    def promised(self) -> int:
        """Return the instant until which a lease holds (ps); 0 if there is none."""
        return self._leased_until

    def promise(self, until: int) -> None:
        """Keep the promise of a lease given before a snapshot."""
        self._leased_until = until

    def forget_time(self) -> None:
        """Time has been set: forget stamps, and what the session waited for."""
        self._stamp, self._last_at, self._target, self._polls = -1, 0, -1, -1
        self.held = False

    @property
    def mask(self) -> int:
        """The chips of following cycles, a bit each."""
        return self._mask

    @mask.setter
    def mask(self, mask: int) -> None:
        self.select(mask)

    @property
    def claimed(self) -> list[str]:
        """The chips this session has claimed."""
        return self._claimed

    @claimed.setter
    def claimed(self, names: list[str]) -> None:
        self.unclaim()
        for name in names:
            self._hosts.claims[name] = self
            self._claimed.append(name)

    def after_load(self) -> None:
        """A session that was held makes its call again; nothing is promised to it."""
        self.held = False
        self._leased_until = 0
