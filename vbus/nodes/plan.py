"""What a board file says about nodes: who has which chips, and which wires go between them."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import msgspec

from vbus import plugins
from vbus.board.build import rest_of
from vbus.board.check.fault_checks import homes_of
from vbus.boardfile.sections import BoardFile, ChipSection, FaultSection
from vbus.chips.base import Chip
from vbus.core.errors import ConfigError
from vbus.core.kernel import SECOND, Clock, Kernel
from vbus.version import __version__

LONGEST_QUANTUM: Final = SECOND
"""Quantum of a board whose nodes have no wires between them (ps)."""


@dataclass(frozen=True, slots=True)
class Wire:
    """A net whose pins are on several nodes.

    Attributes:
        name: as the board file has it.
        delay: how long an edge takes to the other nodes (ps).
        rest: level while no node drives it.
        width: number of wires, 1 or 8.
        ends: pins by the rank of their node.
    """

    name: str
    delay: int
    rest: int
    width: int
    ends: dict[int, tuple[str, ...]]


@dataclass(frozen=True, slots=True)
class Plan:
    """A board with nodes.

    Attributes:
        board: name of the board.
        nodes: names of the nodes; a node's rank is its place here.
        deadlines: how long each may be silent (ps of wall time).
        wires: the nets whose pins are on several nodes; a wire's rank is its place here.
        digest: equal for two processes that were given the same board.
        policy: who is master of time.
        hub: rank of the node to which the others connect; -1 if none is named.
    """

    board: str
    nodes: tuple[str, ...]
    deadlines: tuple[int, ...]
    wires: tuple[Wire, ...]
    digest: str
    policy: str
    hub: int = -1

    @property
    def lookahead(self) -> int:
        """The shortest delay between nodes (ps): what one does is not felt earlier elsewhere."""
        return min((wire.delay for wire in self.wires), default=LONGEST_QUANTUM)

    def rank(self, node: str) -> int:
        """Return the rank of the node called ``node``.

        Raises:
            ConfigError: there is none.
        """
        if node not in self.nodes:
            raise ConfigError(f'no node called "{node}"; this board has {", ".join(self.nodes)}')
        return self.nodes.index(node)


def plan_of(file: BoardFile) -> Plan:
    """Return the plan of a checked board file that has nodes."""
    nodes = tuple(node.name for node in file.nodes)
    homes = {chip.name: nodes.index(chip.node) for chip in file.chips}
    wires = []
    for net in file.nets:
        if net.delay:
            ends: dict[int, list[str]] = {}
            for pin in net.pins:
                ends.setdefault(homes[pin.partition(".")[0]], []).append(pin)
            frozen = {rank: tuple(ends[rank]) for rank in sorted(ends)}
            name, _, row = net.pins[0].partition(".")
            first = next(_alone(chip) for chip in file.chips if chip.name == name).pins[row].net
            rest = rest_of(net)
            wires.append(
                Wire(net.name, net.delay, first.rest if rest is None else rest, first.width, frozen)
            )
    return Plan(
        file.board.name,
        nodes,
        tuple(node.deadline for node in file.nodes),
        tuple(wires),
        _digest(file),
        file.board.time,
        next((rank for rank, node in enumerate(file.nodes) if node.listen), -1),
    )


def _alone(chip: ChipSection) -> Chip:
    """Return a chip on no board, for its pins."""
    cls = plugins.chip_class(chip.part)
    return cls(chip.name, chip.part, Kernel(), Clock(chip.clock), chip.settings)


def _digest(file: BoardFile) -> str:
    """Return a hash over all that decides what happens: not who is connected how."""
    # In virtual time the rate has no effect; in real time all are to run at the same one.
    rate = file.board.rate if file.board.time == "realtime" else 1.0
    board = msgspec.structs.replace(file.board, rate=rate, stall="catch_up")
    nodes = tuple(
        msgspec.structs.replace(node, deadline=3_000_000_000_000, listen="", process="")
        for node in file.nodes
    )
    core = msgspec.structs.replace(
        file, path="", board=board, nodes=nodes, hosts=(), pinmaps=(), waves=(),
        cards=tuple(card for card in file.cards if card.has_circuit),
        record=type(file.record)(), zenoh=type(file.zenoh)(), metrics=type(file.metrics)(),
    )  # fmt: skip
    text = __version__.encode() + msgspec.json.encode(core)
    return hashlib.sha256(text).hexdigest()[:16]


def pins_of(file: BoardFile) -> dict[str, set[str]]:
    """Return the pins of every chip of a checked board file, for reading a scenario."""
    return {chip.name: set(_alone(chip).pins) for chip in file.chips}


def part_of(file: BoardFile, node: str) -> BoardFile:
    """Return the part of a board file that belongs to one node: a board file of its own."""
    chips = tuple(chip for chip in file.chips if chip.node == node)
    names = {chip.name for chip in chips}
    plants = {plant for chip in chips for plant in chip.axes}

    def mine(reached: tuple[str, ...]) -> bool:
        return set(reached) <= names if reached else len(names) == len(file.chips)

    return msgspec.structs.replace(
        file,
        board=msgspec.structs.replace(file.board, name=f"{file.board.name}.{node}"),
        chips=chips,
        plants=tuple(plant for plant in file.plants if plant.name in plants),
        nets=tuple(
            net
            for net in file.nets
            if not net.delay and all(pin.partition(".")[0] in names for pin in net.pins)
        ),
        buses=tuple(bus for bus in file.buses if mine(bus.chips)),
        cards=tuple(card for card in file.cards if mine(card.decoded)),
        pinmaps=tuple(pin_map for pin_map in file.pinmaps if mine(pin_map.chips)),
        hosts=tuple(host for host in file.hosts if mine(host.chips)),
        faults=tuple(_faults(file, node)),
    )


def _faults(file: BoardFile, node: str) -> Iterator[FaultSection]:
    """Give the faults of one node, with their targets as the node has them."""
    for fault in file.faults:
        target = homes_of(file, fault).get(node)
        if target is not None:
            yield msgspec.structs.replace(fault, target=target)
