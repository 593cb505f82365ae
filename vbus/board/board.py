"""Board: a circuit, and the hosts that hold on to it."""

import hashlib
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, ClassVar

import msgpack
from mypy_extensions import mypyc_attr

from vbus.board.card.cards import Card
from vbus.board.host_bus import HostBus, Hosts
from vbus.board.loading import prepare
from vbus.boardfile.sections import PinMapSection
from vbus.circuit.circuit import Circuit
from vbus.core.signals import Policy, TraceHash
from vbus.core.state import Names, Saved, save
from vbus.core.state.kinds import Load
from vbus.protocols.quantities import picoseconds

if TYPE_CHECKING:
    from vbus.faults.faults import Faults
    from vbus.faults.row import LinkActs


@mypyc_attr(allow_interpreted_subclasses=True)
class Beyond:
    """What leads from the board of a node to other boards; see :class:`~vbus.nodes.node.Node`."""

    def replay(self, what: str, values: tuple[Any, ...]) -> None:
        """Take from a journal what came from beyond the board.

        Raises:
            ValueError: it names what is not here.
        """
        raise NotImplementedError

    def save(self) -> Saved:
        """Return the state beside that of the board."""
        raise NotImplementedError

    def prepare(self, saved: Any) -> Load:
        """Check what :meth:`save` gave; return what loads it.

        Raises:
            SnapshotError: it does not fit.
        """
        raise NotImplementedError


class Board(Circuit):
    """Chips, plants and nets under one virtual time.

    A board is a pure function of how it was built and of the calls made on its ports, with
    their instants. It never reads a clock.

    Args:
        name: for people, and for finding it among running boards.
        policy: who is master of time: ``"realtime"`` (the server stamps), ``"lockstep"`` (time
            moves by bus cycles and DELAY), ``"slaved"`` (the host stamps).
        rate: chip seconds per wall second, for ``"realtime"``; ``inf`` is as fast as possible.
        violations: what to do when a host breaks a datasheet.
        seed: for every seeded stream of the board.
        clock_step: how far reading a clock moves time on a lockstep board (ps).
    """

    STATE: ClassVar[Names] = (
        "levels: list[i64, pins]", "ports: parts", "wires: list[(i64, i64, i64, i64), pin_nets]",
        "tail: list[(i64, i64, str, i64), ...]", "kernel: part", "chips: parts", "glue: part",
    )  # fmt: skip
    WIRING: ClassVar[Names] = (
        "_by_name", "_fights", "_links", "_on_clash", "_trace", "axes", "beyond", "buses",
        "clock_step", "file", "granted", "limit", "listeners", "name", "nets", "observers", "pins",
        "plants", "player", "policy", "port_type", "rate", "seed", "sliced", "stream", "text",
        "through", "violation_policy", "waits",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = (
        "_counters", "_faults", "_pin_nets", "caught", "disturbed", "hosts", "missed", "reads",
        "violations", "writes",
    )  # fmt: skip

    def __init__(
        self,
        name: str,
        policy: str = "lockstep",
        rate: float = 1.0,
        violations: Policy | None = None,
        seed: int = 0,
        clock_step: int = 1_000_000,
    ) -> None:
        super().__init__(name, policy, rate, violations, seed, clock_step)
        self.text: str = ""
        """The board file it was built from; "" if it was put together in Python."""
        self.file: str = ""
        """Name of that file."""
        self.hosts: Hosts = Hosts()
        self.ports: list[HostBus] = self.hosts.ports
        self.port_type: Callable[..., HostBus] = HostBus
        """What makes a port; a journal puts a recording one in its place."""
        self.beyond: Beyond | None = None
        """What leads to other boards, where this one is a node."""
        self.waits: Callable[[str, int | str], int] = self._wait
        """What :meth:`wait_until` does; a test that counts its hosts' time puts its own there."""
        self._trace: TraceHash | None = None
        self._faults: Faults | None = None
        self._links: LinkActs | None = None

    @property
    def faults(self) -> "Faults":
        """What is broken on this board, or will be."""
        if self._faults is None:
            from vbus.faults.faults import Faults

            self._faults = Faults(self)
            self._faults.acts.serve(self._links)
        return self._faults

    def serve_links(self, links: "LinkActs") -> None:
        """Let ``links`` do the faults of links, whenever there are any."""
        self._links = links
        if self._faults is not None:
            self._faults.acts.serve(links)

    @property
    def broken(self) -> bool:
        """Whether anybody has asked for its faults."""
        return self._faults is not None

    # -- time ---------------------------------------------------------------------------------

    def wait_until(self, condition: str, within: int | str = "10 s") -> int:
        """Let time pass to the earliest instant at which ``condition`` holds; return it (ps).

        Args:
            condition: such as ``"x.status.TRAJECTORY_COMPLETE"``.
            within: how long it may take: ps, or a text with a unit.

        Raises:
            VbusError: it makes no sense on this board, or has not come to hold in time.
        """
        return self.waits(condition, within)

    def _wait(self, condition: str, within: int | str) -> int:
        from vbus.events.watch import wait_until

        return wait_until(self, condition, picoseconds(within))

    # -- hosts --------------------------------------------------------------------------------

    def open_port(
        self,
        label: str,
        chips: Iterable[str] | None = None,
        cycle_ps: int = 0,
        card: Card | None = None,
        pin_map: PinMapSection | None = None,
    ) -> HostBus:
        """Open a host's hold on some chips (default: all).

        Args:
            label: the host's name in traces.
            chips: names, in the order of SELECT's bits.
            cycle_ps: what a whole bus cycle costs; 0: 1 us, or the chip's minimum in real time.
            card: address decoding of a plug-in card, for hosts that know card addresses.
            pin_map: wiring of a microcontroller's port bits, for hosts that know only those.
        """
        names = list(chips) if chips is not None else [chip.name for chip in self.chips]
        members = [self.chip(name) for name in names]
        self.end_leases()
        port = self.port_type(self, self.hosts, label, members, cycle_ps, card)
        port.pin_map = pin_map
        self.ports.append(port)
        return port

    def end_leases(self) -> None:
        """Carry out the cycles that leases promise, before anything else acts on the board."""
        for port in self.ports:
            port.polls.end()

    # -- trace --------------------------------------------------------------------------------

    def start_trace(self) -> None:
        """Begin the trace hash: call before the first bus cycle."""
        if self._trace is None:
            self._trace = TraceHash([chip.name for chip in self.chips])
            self.observe(self._trace)
            for net in self.nets.values():
                net.observe(self._trace)

    def trace_hash(self) -> str:
        """Return the SHA-256 (hex) over all that happened since :meth:`start_trace`.

        Covers bus writes and reads, edges on joined nets and violations, in order of instant.
        """
        if self._trace is None:
            raise ValueError("no trace is running: call start_trace() before the first bus cycle")
        self.catch_up()
        return self._trace.digest()

    # -- state --------------------------------------------------------------------------------

    @property
    def wires(self) -> list[tuple[int, ...]]:
        """The level of each net at the chips' pins, and its history."""
        return [(net.value, *net.history) for net in self.pin_nets]

    @wires.setter
    def wires(self, wires: list[tuple[int, ...]]) -> None:
        for net, row in zip(self.pin_nets, wires, strict=True):
            net.value, net.previous, net.changed_at, net.let_go_at = row

    @property
    def levels(self) -> list[int]:
        """What each pin of the chips drives."""
        return [pin.level for pin in self.pins]

    @levels.setter
    def levels(self, levels: list[int]) -> None:
        for pin, level in zip(self.pins, levels, strict=True):
            pin.level = level

    @property
    def tail(self) -> list[tuple[int, int, str, int]]:
        """The hold edges of strobes that are still to come: instant, host, pin, level."""
        return self.player.tail([port.pins for port in self.ports])

    @tail.setter
    def tail(self, tail: list[tuple[int, int, str, int]]) -> None:
        self.player.set_tail(tail, [port.pins for port in self.ports])

    @property
    def parts(self) -> list[tuple[str, str]]:
        """Name and part number of each chip."""
        return [(chip.name, chip.part) for chip in self.chips]

    def save(self) -> Saved:
        """Return the whole state: time, chips with their plants, nets, pins, hosts, faults."""
        self.catch_up()
        saved: Saved = {**save(self), "parts": tuple(self.parts)}
        if self.player.lent:
            saved["lent"] = self.player.saved()
        if self.through is not None and self.through.remembers():
            saved["through"] = save(self.through)
        if self._faults is not None and self._faults.all():
            saved["faults"] = save(self._faults)
        return saved

    def load(self, saved: Any) -> None:
        """Take back what :meth:`save` gave, on a board with the same chips and open ports.

        Raises:
            SnapshotError: the state was made by another board, or is none; the board is as it was.
        """
        prepare(self, saved)()

    def after_load(self) -> None:
        """Find out which pins disagree."""
        for net in self.pin_nets:
            net.after_load()
        if self.through is not None:
            self.through.after_load()

    def state_hash(self) -> str:
        """Return the SHA-256 (hex) over :meth:`save`."""
        return hashlib.sha256(msgpack.packb(self.save())).hexdigest()
