"""A bus that is watched is the bus it would have been: hosts get the same bytes, and break the same
rules, whether or not a waveform has its lines."""

from pathlib import Path
from random import Random

import pytest

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.core.kernel import MS, NS
from vbus.core.signals import Observer, Z
from vbus.nodes.machine import board_of
from vbus.protocols.port import PortError
from vbus.record.format import JournalReader
from vbus.record.replay import Replay

ROOT = Path(__file__).parents[2]
PARTS = {"LM629N-8": "8 MHz", "MCP-1200": "8 MHz", "MC1241A": "25 MHz"}
SEEDS = 25
OPERATIONS = 60


def board(part: str) -> Board:
    return load_board_text(
        f'[board]\nname = "b"\ntime = "lockstep"\npower_on = "done"\n[chips.x]\npart = "{part}"\n'
        f'clock = "{PARTS[part]}"\nplant = "m"\n[plants.m]\nmodel = "ideal"\n'.replace(
            'plant = "m"', 'plants = ["m", "none"]' if part == "MC1241A" else 'plant = "m"'
        )
    )


def operation(port: HostBus, random: Random, strobes: bool) -> object:
    """Let a host do one thing of those that concern the bus."""
    address = random.randrange(1 << port.info().chips[0].address_bits)
    data = random.randrange(256)
    kind = random.randrange(9 if strobes else 6)
    if kind < 2:
        return port.read(address)
    if kind < 4:
        return port.write(address, data)
    if kind == 4:
        return port.delay(random.choice((0, 20 * NS, 200 * NS, MS)))
    if kind == 5:
        return port.wait(MS)
    return by_hand(port, random, address, data)


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


def run(part: str, seed: int, watched: bool) -> tuple[list[object], list[object]]:
    random = Random(seed)
    made = board(part)
    ports = [made.open_port(f"h{number}") for number in range(1 + seed % 3)]
    onlooker = Observer()
    answers: list[object] = []
    for number in range(OPERATIONS):
        if watched and number == seed % 7:
            for net in made.pin_nets:
                net.observe(onlooker)
        port = random.choice(ports)
        try:
            answers.append(operation(port, random, strobes=port is ports[0] and seed % 2 == 1))
        except PortError as error:
            answers.append(error.code)
        if random.random() < 0.02 and len(ports) > 1:
            ports.pop().close()
    made.catch_up()  # a chip at which nobody looks finds out later what a host has done
    return answers, sorted(
        made.violations, key=lambda found: (found.when, found.rule, found.detail)
    )


@pytest.mark.parametrize("part", PARTS)
def test_hosts_of_cycles_and_of_strobes_get_the_same_bytes_under_a_waveform(part: str) -> None:
    for seed in range(SEEDS):
        assert run(part, seed, watched=True) == run(part, seed, watched=False), seed


@pytest.mark.parametrize("name", ["board-two-hosts-claim-realtime", "board-wired-lines"])
def test_a_journal_of_several_hosts_is_played_to_its_end_under_a_waveform(name: str) -> None:
    path = ROOT / "tests" / "frozen" / "runs" / f"{name}.vbj"
    with path.open("rb") as file:
        reader = JournalReader(file)
        made = board_of(reader.header, str(path))
        for net in made.pin_nets:
            net.observe(Observer())
        assert Replay(made, reader, reader.header.families).run().divergence is None
