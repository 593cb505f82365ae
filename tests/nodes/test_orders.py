"""Cycles ordered for an instant are the cycles a host would make at it, seen by anybody or not."""

import pytest

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.circuit.orders import PIN, READ, WRITE, Order, Orders
from vbus.core import state
from vbus.core.kernel import US
from vbus.core.signals import Observer
from vbus.core.state import save

BOARD = """\
[board]
time = "slaved"
power_on = "done"

[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "x"

[chips.m]
part = "MCP-1200"
clock = "8 MHz"
plant = "none"

[plants.x]
model = "ideal"
"""

# Writes and polls 100 ns apart around the end of busy, 15 us after each byte: a read strobe that
# begins before that instant and ends after it tells when the byte was taken.
SCRIPT: list[tuple[int, str, int, int, int]] = [
    (100 * US, "x", WRITE, 0, 0x1F),
    *((110 * US + 200_000 + n * 350_000, "x", READ, 0, 0) for n in range(30)),
    (130 * US, "x", WRITE, 1, 0x00),
    (132 * US, "x", WRITE, 1, 0xA8),
    (140 * US, "m", WRITE, 0x20, 0x5A),
    *((142 * US + n * 333_333, "x", READ, 0, 0) for n in range(30)),
    (160 * US, "m", READ, 0x20, 0),
    (161 * US, "x", WRITE, 0, 0x0A),
    *((200 * US + n * US, "x", READ, 1, 0) for n in range(4)),
    (240 * US, "x", READ, 0, 0),
    (260 * US, "m", READ, 0x14, 0),
]


SPACED = [row for n, row in enumerate(SCRIPT) if n % 4 == 0 or row[2] == WRITE]
"""Without cycles that begin before the hold times of the last one are over."""


class Seen(Observer):
    def __init__(self) -> None:
        self.cycles: list[tuple[int, str, bool, int, int]] = []
        self.edges: list[tuple[int, str, int]] = []

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        self.cycles.append((when, chip, write, address, data))

    def edge(self, when: int, net: str, level: int) -> None:
        self.edges.append((when, net, level))


def made(strobes: bool) -> tuple[Board, Seen]:
    board = load_board_text(BOARD)
    seen = Seen()
    board.observe(seen)
    if strobes:
        for chip in board.chips:
            for pin in chip.bus_pins:
                pin.net.observe(seen)
    return board, seen


def by_host(strobes: bool) -> tuple[Board, Seen]:
    board, seen = made(strobes)
    port = board.open_port("host")  # one host, as orders have one
    for when, chip, kind, address, data in SPACED if strobes else SCRIPT:
        board.run_until(max(board.now, when - 400_000))
        port.select(1 << "xm".index(chip))
        port.at(when)
        if kind == WRITE:
            port.write(address, data)
        else:
            port.read(address)
    board.run_until(300 * US)
    return board, seen


def by_order(strobes: bool, step: int) -> tuple[Board, Seen]:
    board, seen = made(strobes)
    orders = Orders(board, "host")
    for when, chip, kind, address, data in SPACED if strobes else SCRIPT:
        orders.give(Order(when, (chip,), kind, address, data))
    while board.now < 300 * US:
        board.run_until(min(board.now + step, 300 * US))
    return board, seen


def counted(board: Board) -> list[tuple[int, int]]:
    return [(chip.reads, chip.writes) for chip in board.chips]


@pytest.mark.parametrize("strobes", [False, True])
def test_an_order_is_the_cycle_a_host_would_make_at_that_instant(strobes: bool) -> None:
    host, seen = by_host(strobes)
    assert len({data for _, chip, write, address, data in seen.cycles if chip == "x"}) > 3
    for step in (300 * US, 777_777):
        ordered, found = by_order(strobes, step)
        assert found.cycles == seen.cycles
        assert sorted(found.edges) == sorted(seen.edges)
        assert [save(chip) for chip in ordered.chips] == [save(chip) for chip in host.chips]
        assert counted(ordered) == counted(host)


def test_a_cycle_that_begins_within_the_hold_time_of_the_last_one_is_whole() -> None:
    """Its strobes end the last one's: both reach the chip, seen or not."""
    cycles = []
    for strobes in (False, True):
        board, seen = made(strobes)
        # A host that places its own strobes has been here before.
        board.chip("x").timing_checked = True
        orders = Orders(board, "host")
        for n in range(60):
            orders.give(Order(100 * US + n * 140_000, ("x",), READ, 0))
        board.run_until(120 * US)
        assert not board.violations
        cycles.append(seen.cycles)
    assert len(cycles[0]) == 60
    assert cycles[0] == cycles[1]


def test_the_select_of_each_cycle_falls_however_soon_it_follows_the_last_one() -> None:
    board, seen = made(True)
    board.chip("x").timing_checked = True
    orders = Orders(board, "host")
    for n in range(20):
        orders.give(Order(100 * US + n * 110_000, ("x",), WRITE, 0, n))
    board.run_until(120 * US)
    assert [data for *_, data in seen.cycles] == list(range(20))
    assert [net for _, net, level in seen.edges if level == 0].count("x./CS") == 20


def test_a_pin_is_driven_at_its_instant_and_let_go() -> None:
    board = load_board_text(BOARD)
    orders = Orders(board, "host")
    net = board.find_pin("m./STOP").net
    orders.give(Order(7 * US, ("m",), PIN, 0, 0, "/STOP"))
    orders.give(Order(9 * US, ("m",), PIN, 0, 2, "/STOP"))
    board.run_until(7 * US - 1)
    assert net.value == 1
    board.run_until(7 * US)
    assert net.value == 0
    board.run_until(9 * US)
    assert net.value == 1
    orders.give(Order(9 * US, ("m",), PIN, 0, 0, "/STOP"))
    board.run_until(10 * US)
    assert net.value == 0
    orders.close()
    assert net.value == 1


def test_orders_that_wait_are_part_of_the_state() -> None:
    _, seen = by_order(False, 300 * US)
    first = load_board_text(BOARD)
    orders = Orders(first, "host")
    for when, chip, kind, address, data in SCRIPT:
        orders.give(Order(when, (chip,), kind, address, data))
    first.run_until(131 * US)
    second = load_board_text(BOARD)
    restored = Orders(second, "host")
    second.load(first.save())
    state.load(restored, state.save(orders))
    found = Seen()
    second.observe(found)
    second.run_until(300 * US)
    assert found.cycles == [cycle for cycle in seen.cycles if cycle[0] > 131 * US]


def test_an_order_given_last_may_come_first() -> None:
    board, seen = made(False)
    orders = Orders(board, "h")
    for when in (300 * US, 100 * US):
        orders.give(Order(when, ("m",), WRITE, 0x20, when // (100 * US)))
    board.run_until(400 * US)
    assert [(when, data) for when, _, _, _, data in seen.cycles] == [
        (100 * US, 1),
        (300 * US, 3),
    ]


def test_an_order_for_the_past_is_carried_out_at_once_and_counted() -> None:
    board, seen = made(False)
    board.run_until(50 * US)
    orders = Orders(board, "host")
    orders.give(Order(40 * US, ("x",), READ, 0))
    board.run_until(50 * US)
    assert orders.late == 1
    assert [cycle[0] for cycle in seen.cycles] == [50 * US]


@pytest.mark.parametrize("strobes", [False, True])
@pytest.mark.parametrize("joined", [False, True])
def test_a_read_of_several_chips_is_the_fight_a_host_would_cause(
    strobes: bool, joined: bool
) -> None:
    """Of x, which waits in reset state 84h, and of y, whose flags were cleared to 80h."""
    both = BOARD + BOARD[BOARD.index("[chips.x]") : BOARD.index("[chips.m]")].replace("x", "y")
    both += '[plants.y]\nmodel = "ideal"\n'
    both += '[buses.d]\nchips = ["x", "y"]\n' if joined else ""
    results = []
    for ordered in (False, True):
        board = load_board_text(both)
        seen = Seen()
        board.observe(seen)
        if strobes:
            board.chip("x").bus_net.observe(seen)
        orders, port = Orders(board, "h"), board.open_port("h", ["x", "y"])
        for when, chips, kind, address, data in (
            (20, "y", WRITE, 0, 0x1D),
            (50, "y", WRITE, 1, 0),
            (80, "y", WRITE, 1, 0),
            (200, "xy", READ, 0, 0),
        ):
            if ordered:
                orders.give(Order(when * US, tuple(chips), kind, address, data))
                continue
            port.select(3 if chips == "xy" else 2)
            port.at(when * US)
            if kind == WRITE:
                port.write(address, data)
            else:
                assert port.read(address) == 0x84 & 0x80
        board.run_until(300 * US)
        found = [(v.when, v.rule, v.chip) for v in board.violations]
        results.append((seen.cycles, found, [save(chip) for chip in board.chips]))
    assert results[0] == results[1]
    cycles, found, _ = results[0]
    assert cycles[-1] == (200 * US, "x+y", False, 0, 0x80)
    where = "d.D0-D7" if joined else "h.D0-D7"
    assert [(rule, chip) for _, rule, chip in found] == [("board.contention", where)]


def test_a_host_that_only_makes_cycles_uses_time_too() -> None:
    board, _ = made(False)
    board.granted = True
    port = board.open_port("h", ["m"])
    assert not port.clock.used
    board.limit = 100 * US
    port.write(0x20, 1)
    assert port.clock.used
    port.write(0x20, 2)
    assert port.read(0x20) == 2
