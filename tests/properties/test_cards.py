"""Cycles on a card that are remembered are those that strobes would have made.

``VBUS_CARDS=100000`` makes so many cycles on random cards, each board once so that all are played.
"""

import os
from collections.abc import Callable
from random import Random

import pytest

from tests.unit.glue.test_cards import Slot
from tests.unit.glue.test_paths import TWO_CHIPS, path_of
from vbus.board.snapshot import restore, take
from vbus.core.kernel import NS, US
from vbus.core.signals import Observer

CYCLES = int(os.environ.get("VBUS_CARDS", "2500"))
A_BOARD = 150
"""So many steps are made on each board."""
BATCHES = max(5, CYCLES // 1000)

HEAD = (
    TWO_CHIPS
    + """
[cards.slot]
bus = "{bus}"
base = 0x300
memory = {memory}
hold = "{hold} ns"
strobe = "{strobe} ns"

[[hosts]]
transport = "unix:$VBUS_RUNTIME/random.sock"
card = "slot"

[cards.slot.pins]
"""
)
PARTS = {
    "LM629N-8": ("8 MHz", "D0-D7", ("x./CS", "y./CS", "main./PS", "main./RD", "main./WR"), "x.HI"),
    "MCP-1200": (
        "2 MHz", "DB0-DB7", ("x./CS", "y./CS", "main./ALE", "main./OE", "main.R/W"), "x.PROF",
    ),
    "MC1241A": (
        "25 MHz", "D0-D7",
        ("x.~HostSlct", "y.~HostSlct", "main.~HostRead", "main.~HostWrite", "main.HostCmd"),
        "x.HostRdy",
    ),
}  # fmt: skip
USUAL = {
    "/CS": ("A2", 0), "/PS": ("A0", 0), "/RD": ("(A3 & !A3)", 1), "/WR": ("(A3 & !A3)", 2),
    "~HostSlct": ("A2", 3), "~HostRead": ("A0", 1), "~HostWrite": ("(A3 & !A3)", 2),
    "HostCmd": ("A0", 0), "/ALE": ("A0", 2), "/OE": ("A1", 1), "R/W": ("A1", 0),
}  # fmt: skip
"""What each line usually follows: address lines; no strobe, that of reads, of writes, or both."""
GATES = ("", " | {read}", " | {write}", " | ({read} & {write})")
STROBES = {"ISA": ("slot./IOR", "slot./IOW"), "XMEM": ("slot./RD", "slot./WR")}
BRIDGE = """
[glue.buffer]
part = "74HC245"
{delay}
[glue.buffer.pins]
DIR = "{read}"
"/OE" = "OFF"
"A0-A7" = "slot.D0-D7"
"B0-B7" = "main.{data}"

[glue.enable]
part = "PLD"

[glue.enable.equations]
"OFF" = "{off}"
"""
MORE = {
    "PAGE": """
[glue.latch]
part = "74HC74"
high = ["1/PRE", "1/CLR"]

[glue.latch.pins]
1CLK = "GATE"
1D = "slot.D1"
1Q = "PAGE"
""",
    "OPEN": """
[glue.open]
part = "74HC373"
low = ["/OE", "D1", "D2", "D3", "D4", "D5", "D6", "D7"]

[glue.open.pins]
LE = "NGATE"
D0 = "slot.D0"
Q0 = "OPEN"
""",
    "COUNT": """
[glue.count]
part = "74HC393"
low = ["1CLR"]

[glue.count.pins]
1CLK = "GATE"
1QB = "COUNT"
""",
}
"""What holds something: by the wire on which it shows."""


def term(rng: Random, names: list[str], depth: int = 2) -> str:
    if not depth or rng.random() < 0.4:
        return rng.choice(["", "!"]) + rng.choice(names)
    one, other = (term(rng, names, depth - 1) for _ in range(2))
    return f"({one} {rng.choice('&|^')} {other})"


def card(rng: Random) -> str:
    """Return a board with a random card."""
    part = rng.choice(list(PARTS))
    clock, data, lines, side = PARTS[part]
    bus = "XMEM" if rng.random() < 0.15 else "ISA"
    read, write = STROBES[bus]
    more = [name for name in MORE if rng.random() < 0.15]
    names = ["slot.A0", "slot.A1", "slot.A2", "slot.A3", "HALT2", *more]
    names += ["slot.AEN"] if bus == "ISA" else []
    names += rng.choice([[], [], [side], [read], [write], ["slot.D0"]])
    rows = []
    odd = rng.random()
    for place, line in enumerate(lines):
        name = line.partition(".")[2]
        plain, gate = USUAL[name]
        plain = plain.replace("A2", "!A2" if place else "A2").replace("A", "slot.A")
        made = plain if rng.random() > odd else term(rng, names)
        gate = GATES[gate if rng.random() > odd / 2 else rng.randrange(4)]
        if not place:
            made = " ^ ".join([f"({made} & HALT2)", *more])
        rows.append(f'"{line}" = "({made}){gate}"')
    gate = rng.choice(["slot.A2 & slot.A3", "slot.A1", "!slot.A3"])
    gate = f"!({gate}){rng.choice(GATES[1:3])}"
    if "PAGE" in more or "COUNT" in more:
        rows.append(f'"GATE" = "{gate}"')
    if "OPEN" in more:
        rows.append(f'"NGATE" = "!({gate})"')
    offs = ["({read} & {write})", "slot.A3", "({cs} & {other}) | ({read} & {write})",
            "({cs} & {other})"]  # fmt: skip
    wires = f'"D0-D7" = "main.{data}"\n'
    if rng.random() < 0.6:
        off = rng.choice(offs).format(read=read, write=write, cs=lines[0], other=lines[1])
        delay = 'delay = "15 ns"\n' if rng.random() < 0.1 else ""
        wires = BRIDGE.format(read=read, off=off, data=data, delay=delay)
    delay = rng.choice(["", "", "", 'delay = "15 ns"\n', 'delay = "90 ns"\n'])
    head = HEAD.format(
        part=part, clock=clock, bus=bus, memory="true" if bus == "XMEM" else "false",
        hold=rng.choice([40, 130, 130, 130, 130, 130]),
        strobe=rng.choice([40, 500, 500, 500, 500, 500]),
    )  # fmt: skip
    pal = f'\n[glue.pal]\npart = "PLD"\n{delay}hosts = ["HALT2"]\n\n[glue.pal.equations]\n'
    text = "\n".join(rows).format(read=read, write=write)
    return "".join((head, wires, pal, text, "\n", *(MORE[name] for name in more)))


Step = tuple[str, int, int]


def steps(rng: Random, count: int) -> list[Step]:
    """Return what a host does: some cycles again and again, and sometimes something else."""
    written = rng.sample([0, 1, 2, 3, 0x0A, 0x1E, 0x2F, 0x37, 0xFF], 2)

    def cycle() -> Step:
        where = rng.randrange(16)
        return ("out", where, rng.choice(written)) if rng.random() < 0.5 else ("in", where, 0)

    found: list[Step] = []
    loop: list[Step] = []
    while len(found) < count:
        if rng.random() < 0.1 or not loop:
            loop = [cycle() for _ in range(rng.randrange(2, 5))]
        found += loop
        if rng.random() < 0.3:
            found.append(rng.choice([
                cycle(), ("pin", rng.randrange(2), rng.randrange(3)), ("line", rng.randrange(8), 0),
                ("delay", rng.choice([20 * NS, US, 30 * US]), 0), ("look", 0, 0),
            ]))  # fmt: skip
    return found[:count]


class Told(Observer):
    """Bus cycles, as observers are told of them."""

    def __init__(self) -> None:
        self.rows: list[object] = []

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        self.rows.append((when, host, chip, write, address, data))


def levels(slot: Slot) -> list[object]:
    """Return how all wires stand, and what the glue holds."""
    slot.board.catch_up()
    made: list[object] = [(net.name, net.value) for net in slot.board.pin_nets]
    made += [(pin.name, pin.level) for pin in slot.board.pins]
    for part in slot.board.glue.parts:
        made += [(part.name, b.state, b.levels & b.driven, b.driven) for b in part.blocks]
    return made


def run(slot: Slot, steps: list[Step]) -> list[object]:
    """Return all that can be found out while a host does these steps, and after."""
    told = Told()
    slot.board.observe(told)
    rows: list[object] = []
    port = slot.port
    names = ["pal.HALT2", "slot.AEN"] if "slot.AEN" in port.pins.side_names() else ["pal.HALT2"]

    def line(number: int, _: int) -> None:
        mask = 1 << number % len(port.pins.lines)
        port.lines(mask, 0)
        port.lines(mask, mask)

    actions: dict[str, Callable[[int, int], object]] = {
        "in": lambda offset, _: slot.inb(0x300 + offset),
        "out": lambda offset, data: slot.outb(0x300 + offset, data),
        "pin": lambda name, level: port.pin(port.pin_number(names[name % len(names)]), level),
        "line": line,
        "delay": lambda time, _: port.delay(time),
        "look": lambda *_: port.sample(),
    }
    for number, (name, first, second) in enumerate(steps):
        if name in ("pin", "line"):
            port.delay(US)  # what is held after a cycle is judged if strobes are played alone
        rows.append((number, name, first, actions[name](first, second), slot.board.now))
        if name == "in":  # what leases are made of
            steady = path_of(slot).steady(first)
            rows.append(steady and (steady[0] and steady[0].name, steady[1]))
    port.delay(US)
    rows += levels(slot)
    rows += told.rows
    rows += [slot.board.chip(chip).telemetry() for chip in "xy"]
    # A chip to which nothing has come may find out later what a command of its has come to.
    rows += sorted((v.when, v.rule, v.chip, v.measured) for v in slot.board.violations)
    return rows


def remembered(seed: int) -> tuple[int, int]:
    """Run one board both ways; return how many cycles it made, and how many were remembered.

    A third board takes the state half-way and remembers nothing: it comes to the same state.
    """
    rng = Random(seed)
    text, script = card(rng), steps(rng, A_BOARD)
    ours, played, fresh = Slot(text), Slot(text), Slot(text)
    played.board.chip("slot").pins["A0"].net.observe(Observer())
    for half in (script[: A_BOARD // 2], script[A_BOARD // 2 :]):
        restore(fresh.board, take(ours.board))
        found, wanted = run(ours, half), run(played, half)
        for one, other in zip(found, wanted, strict=False):
            assert one == other, f"seed {seed}"
        assert len(found) == len(wanted), f"seed {seed}"
    own = sum(1 + (name == "in") for name, *_ in half)
    assert run(fresh, half)[:own] == found[:own], f"seed {seed}"
    assert fresh.board.state_hash() == ours.board.state_hash(), f"seed {seed}"
    cycles = sum(name in ("in", "out") for name, *_ in script)
    assert path_of(played).played == cycles
    return cycles, cycles - path_of(ours).played


@pytest.mark.parametrize("batch", range(BATCHES))
def test_cycles_that_are_remembered_are_those_of_the_strobes(batch: int) -> None:
    made = cached = 0
    seed = batch << 32
    while made * BATCHES < CYCLES:
        cycles, known = remembered(seed)
        made, cached, seed = made + cycles, cached + known, seed + 1
    assert cached
