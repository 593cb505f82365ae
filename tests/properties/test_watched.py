"""A bus that is watched is the bus it would have been: hosts get the same bytes, and break the same
rules, whether or not a waveform has its lines, a monitor its cycles or a journal its calls, whether
or not they go on from snapshots, and whether or not somebody looks at the board while they pause.

``VBUS_WATCHED=500`` runs so many hosts of each chip in each way instead of the usual few.
"""

import io
import os
from collections.abc import Callable
from random import Random

import pytest

from tests.frozen.generate import record
from tests.frozen.hosts import ALL
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.board.snapshot import fork
from vbus.circuit.stream import PacketReader
from vbus.core.kernel import MS, NS
from vbus.core.signals import Observer, Z
from vbus.nodes.machine import board_of
from vbus.protocols.port import PortError
from vbus.record.format import JournalReader
from vbus.record.journal import Journal
from vbus.record.replay import Replay

PARTS = {"LM629N-8": "8 MHz", "MCP-1200": "8 MHz", "MC1241A": "25 MHz"}
SEEDS = int(os.environ.get("VBUS_WATCHED", "25"))
OPERATIONS = 60


def board(part: str) -> Board:
    return load_board_text(
        f'[board]\nname = "b"\ntime = "lockstep"\npower_on = "done"\n[chips.x]\npart = "{part}"\n'
        f'clock = "{PARTS[part]}"\nplant = "m"\n[plants.m]\nmodel = "ideal"\n'.replace(
            'plant = "m"', 'plants = ["m", "none"]' if part == "MC1241A" else 'plant = "m"'
        )
    )


def operation(port: HostBus, random: Random, strobes: bool, look: Callable[[], None]) -> object:
    """Let a host do one thing that concerns the bus; ``look`` comes in the midst of a pause."""
    address = random.randrange(1 << port.info().chips[0].address_bits)
    data = random.randrange(256)
    kind = random.randrange(11 if strobes else 7)
    if kind < 2:
        return port.read(address)
    if kind < 4:
        return port.write(address, data)
    if kind == 4:
        half = random.choice((0, 10 * NS, 100 * NS, MS // 2))
        port.delay(half)
        look()
        return port.delay(half)
    if kind == 5:
        return port.wait(MS)
    if kind == 6:
        return polls(port, address, random.randrange(4))
    if kind == 7:
        return held(port, random)
    return by_hand(port, random, address, data)


def polls(port: HostBus, address: int, count: int) -> object:
    """Read again and again: from a lease, if there is one for so long."""
    data, lease = port.read(address), port.lease(address)
    if not count or lease is None or lease[2] <= lease[1] + count * port.selection.cycle:
        return [data, *(port.read(address) for _ in range(count))]
    port.polled(address, count)
    return [data] * (1 + count)


def by_hand(port: HostBus, random: Random, address: int, data: int) -> object:
    """Move the lines of a cycle, perhaps but for the address, and perhaps too fast."""
    table = port.chips[0].BUS
    assert table is not None
    seen: list[object] = []
    hasty = random.choice((1, 1, 4))
    placed = random.random() < 0.6
    at = None
    for offset, pin, level in sorted(table.edges(random.random() < 0.5, address, data)):
        if at is not None and offset > at:
            port.delay((offset - at) // hasty)
        if offset == 0 and at != 0:
            seen.append(port.sample())
        at = offset
        if pin == table.data:
            port.release() if level == Z else port.drive(level)
        elif placed or pin != table.address:
            number = port.line_number(pin)
            port.lines(1 << number, (level & 1) << number)
    return seen


def held(port: HostBus, random: Random) -> object:
    """Leave lines, and perhaps a byte, as no cycle leaves them: what follows finds them held."""
    lines = len(port.pins.lines)
    port.lines(random.randrange(1 << lines), random.randrange(1 << lines))
    if random.random() < 0.3:
        port.drive(random.randrange(256))
    elif random.random() < 0.3:
        port.release()
    return port.sample()


class Monitor(PacketReader):
    """Reads packets and forgets them."""


def watch(made: Board, watched: str) -> None:
    """Let somebody look."""
    nets = {"wave": made.pin_nets, "bus": [pin.net for pin in made.chips[0].bus_pins]}
    for net in nets.get(watched.partition(" ")[0], []):
        net.observe(Observer())
    if "monitor" in watched:
        made.observe(Monitor())


def run(part: str, seed: int, watched: str) -> tuple[object, ...]:
    """Return what hosts and the board have come to, and the hash of its state."""
    random, other = Random(seed), Random(~seed)
    made, file = board(part), io.BytesIO()
    if watched == "journal":
        Journal(made, file, made.text)
    ports = [made.open_port(f"h{number}") for number in range(1 + seed % 3)]
    answers: list[object] = []

    def look() -> None:
        if "looked" in watched and other.random() < 0.7:
            made.catch_up()
            made.state_hash()

    for number in range(OPERATIONS):
        if number == seed % 7:
            watch(made, watched)
        if "snapshots" in watched and other.random() < 0.2:
            made = fork(made)
            ports = list(made.ports)
            watch(made, watched if other.random() < 0.5 else "")
        port = random.choice(ports)
        try:
            answers.append(operation(port, random, port is ports[0] and seed % 2 == 1, look))
        except PortError as error:
            answers.append(error.code)
        if random.random() < 0.02 and len(ports) > 1:
            ports.pop().close()
    made.catch_up()  # a chip at which nobody looks finds out later what a host has done
    made.player.give_back()
    for net in made.pin_nets if "bus" in watched else ():
        for one in net.observers:
            net.unobserve(one)
    found = sorted(made.violations, key=lambda found: (found.when, found.rule, found.detail))
    if watched == "journal":
        for again in ("", "bus"):
            reader = JournalReader(io.BytesIO(file.getvalue()))
            twin = board(part)
            watch(twin, again)
            assert Replay(twin, reader, reader.header.families).run().divergence is None, seed
    # An output that is listened to has a history, and a timer: the rest of the state is the same.
    return answers, found, made.state_hash() if watched != "wave" else ""


@pytest.mark.parametrize(
    "watched",
    ["wave", "bus", "monitor", "journal", "snapshots", "bus snapshots", "looked", "bus looked"],
)
@pytest.mark.parametrize("part", PARTS)
def test_hosts_of_cycles_and_of_strobes_get_the_same_bytes_watched(part: str, watched: str) -> None:
    for seed in range(SEEDS):
        seen, unseen = run(part, seed, watched), run(part, seed, "")
        assert seen[: 2 + bool(seen[2])] == unseen[: 2 + bool(seen[2])], seed


@pytest.mark.parametrize("watched", ["", "bus"])
def test_lines_held_through_a_whole_cycle_are_held_after_a_snapshot(watched: str) -> None:
    made = board("LM629N-8")
    port = made.open_port("h")
    held_low = {name: 1 << port.line_number(name) for name in ("/CS", "/RD", "/WR")}
    port.lines(sum(held_low.values()), held_low["/WR"])
    watch(made, watched)
    port.read(0)
    twin = fork(made)
    seen = []
    for one in (made, twin):
        host = one.ports[0]
        host.delay(MS)
        host.lines(held_low["/RD"], held_low["/RD"])
        levels = [(pin.name, pin.level) for pin in host.pins.driven()]
        seen.append((levels, host.sample(), host.read(0), one.now))
    assert seen[0] == seen[1]
    assert seen[0][0] == [("h:/CS", 0), ("h:/RD", 1), ("h:/WR", 1)]


@pytest.mark.parametrize("name", ["board-two-hosts-claim-realtime", "board-wired-lines"])
def test_a_journal_of_several_hosts_is_played_to_its_end_under_a_waveform(name: str) -> None:
    (run,) = (run for run in ALL if run.name == name)
    reader = JournalReader(io.BytesIO(record(run)))
    made = board_of(reader.header, name)
    for net in made.pin_nets:
        net.observe(Observer())
    assert Replay(made, reader, reader.header.families).run().divergence is None
