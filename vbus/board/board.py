"""Board: a circuit, and the hosts that hold on to it."""

import hashlib
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import msgpack

from vbus.board.cards import Card
from vbus.board.circuit import Circuit
from vbus.board.host_bus import HostBus, Hosts
from vbus.board.pin_maps import PinMap
from vbus.chips.base import Chip
from vbus.errors import SnapshotError
from vbus.signals import Net, Policy, TraceHash

if TYPE_CHECKING:
    from vbus.faults.faults import Faults


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
        self.port_type: Callable[[Circuit, Hosts, str, list[Chip], int, Card | None], HostBus] = (
            HostBus
        )
        """What makes a port; a journal puts a recording one in its place."""
        self._trace: TraceHash | None = None
        self._faults: Faults | None = None

    @property
    def faults(self) -> "Faults":
        """What is broken on this board, or will be."""
        if self._faults is None:
            from vbus.faults.faults import Faults

            self._faults = Faults(self)
        return self._faults

    # -- hosts --------------------------------------------------------------------------------

    def open_port(
        self,
        label: str,
        chips: Iterable[str] | None = None,
        cycle_ps: int = 0,
        card: Card | None = None,
        pin_map: PinMap | None = None,
    ) -> HostBus:
        """Open a host's hold on some chips (default: all).

        Args:
            label: the host's name in traces.
            chips: names, in the order of SELECT's bits.
            cycle_ps: what a whole bus cycle costs; 0 is the default of the time policy.
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
        """Somebody is about to touch the board: what was promised to hosts comes true first."""
        for port in self.ports:
            port.end_lease()

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

    def _all_nets(self) -> list[Net]:
        nets: dict[int, Net] = {}
        for chip in self.chips:
            for pin in chip.pins.values():
                nets.setdefault(id(pin.net), pin.net)
        return list(nets.values())

    def save(self) -> tuple[object, ...]:
        """Return the whole state: time, chips with their plants, nets, pins, hosts' pins.

        Load it into a board built from the same file.
        """
        self.catch_up()
        return (
            tuple((chip.name, chip.part) for chip in self.chips),
            (
                self.kernel.save(),
                self.player.save([port._pins for port in self.ports]),
                tuple(port.strobes.save() for port in self.ports),
            ),
            tuple(chip.save() for chip in self.chips),
            tuple(net.save() for net in self._all_nets()),
            tuple(pin.level for chip in self.chips for pin in chip.pins.values()),
            tuple(port.save() for port in self.ports),
            *(() if self._faults is None or not self._faults.all() else (self._faults.save(),)),
        )

    def load(self, state: tuple[object, ...]) -> None:
        """Take back what :meth:`save` gave, on a board with the same chips and open ports.

        Raises:
            SnapshotError: the state was made by another board.
        """
        chips, times, chip_states, nets, levels, ports = state[:6]
        time: Any = times
        mine = tuple((chip.name, chip.part) for chip in self.chips)
        if tuple(tuple(pair) for pair in chips) != mine:  # type: ignore[attr-defined]
            raise SnapshotError(f"the state belongs to a board with {chips}, this one has {mine}")
        if len(ports) != len(self.ports):  # type: ignore[arg-type]
            raise SnapshotError("the state was saved with another number of open ports")
        self.player.flush()
        if self._faults is not None or len(state) > 6:
            self.faults.load(state[6:])
        # Whoever is to be told of something is told now: it belongs to what is left behind.
        self.kernel.settle()
        pins = [pin for chip in self.chips for pin in chip.pins.values()]
        for pin, level in zip(pins, levels, strict=True):  # type: ignore[call-overload]
            pin.level = level
        for net, saved in zip(self._all_nets(), nets, strict=True):  # type: ignore[call-overload]
            net.load(saved)
        for port, port_state in zip(self.ports, ports, strict=True):  # type: ignore[call-overload]
            port.load(port_state)
        for port, seen in zip(self.ports, time[2], strict=True):
            port.strobes.load(seen)
        self.player.load(time[1], [port._pins for port in self.ports])
        for net in self._all_nets():
            net.recall_clash()
        self.kernel.load(time[0])
        for chip, chip_state in zip(self.chips, chip_states, strict=True):  # type: ignore[call-overload]
            chip.load(chip_state)
        if self._faults is not None:
            self._faults.go_on()
        for net, saved in zip(self._all_nets(), nets, strict=True):  # type: ignore[call-overload]
            net.recall_history(saved)
        # Who listens now may not be who listened then.
        for chip in self.chips:
            chip.heard_changed()
            chip.rearm()

    def state_hash(self) -> str:
        """Return the SHA-256 (hex) over :meth:`save`."""
        return hashlib.sha256(msgpack.packb(self.save())).hexdigest()
