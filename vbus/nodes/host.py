"""A host's hold on a node whose time is granted by all nodes: nothing happens beyond the grant."""

from vbus.board.cards import Card
from vbus.board.host_bus import HostBus, Hosts
from vbus.chips.base import Chip
from vbus.circuit.circuit import Circuit
from vbus.kernel import NEVER
from vbus.nodes.orders import READ, WRITE, Order, Orders
from vbus.protocols.port import NotYet


class NodeBus(HostBus):
    """The port of a host on a board with nodes, in lockstep or slaved time.

    A cycle beyond the grant is ordered for its instant, and the host waits for the grant: so it
    happens when it would have happened, with all that reaches the node before. There are no leases:
    an edge of another node could break what they promise.

    Attributes:
        uses_time: whether the host has let time pass: from then on time waits for it.
    """

    def __init__(
        self,
        board: Circuit,
        hosts: Hosts,
        label: str,
        chips: list[Chip],
        cycle_ps: int,
        card: Card | None,
    ) -> None:
        super().__init__(board, hosts, label, chips, cycle_ps, card)
        self.uses_time: bool = False
        self._orders: Orders = Orders(board, label, saved=False)
        self._ordered: int = -1
        self._due: int = 0

    @property
    def wants_time(self) -> bool:
        """Whether the host waits for time to run."""
        return self.held and self.hold_until < NEVER

    def _cycle_at(self, kind: int, address: int, data: int) -> int:
        """Run a cycle, or order it and raise :class:`NotYet`."""
        board = self.board
        self.uses_time = True
        if self._ordered < 0:
            when = self.clock.take_stamp(self.selection.cycle)
            names = tuple(chip.name for chip in self.selection.selected)
            board.player.flush()
            self._due = when
            self._ordered = self._orders.give(Order(when, names, kind, address, data), keep=True)
        if self._due > board.limit:
            self.clock.hold(self._due)
            raise NotYet
        self.clock.run_until(self._due)
        number, self._ordered = self._ordered, -1
        return self._orders.result(number)

    def read(self, address: int) -> int:
        """Run one read cycle; return the byte (0..255)."""
        data = self._cycle_at(READ, address, 0)
        return data if self.selection.selected else self.selection.floating()

    def write(self, address: int, data: int) -> None:
        """Run one write cycle on every selected chip."""
        self._cycle_at(WRITE, address, data)

    def lease(self, address: int) -> None:
        """Promise nothing."""
        return

    def _arrive(self) -> None:
        if self.clock.stamp > self.board.limit:
            self.uses_time = True
            self.clock.hold(self.clock.stamp)
            raise NotYet
        super()._arrive()

    def wait(self, longest: int) -> tuple[bool, int] | None:
        """Let time pass until the selected chips can take a cycle, at most ``longest`` ps."""
        self.uses_time = True
        return super().wait(longest)

    def delay(self, duration: int) -> bool:
        """Let time pass for this host."""
        self.uses_time = True
        return super().delay(duration)

    def at(self, when: int) -> None:
        """Set the host's own clock (slaved boards only)."""
        self.uses_time = True
        super().at(when)

    def close(self) -> None:
        """The session has ended: let go of everything, and let time run."""
        self._orders.close()
        super().close()
