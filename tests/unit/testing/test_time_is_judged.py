"""Time that passes while a host holds a line is judged, whatever lets it pass."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.unit.testing.test_machine import TWO, made
from vbus.board.board import Board
from vbus.board.build import build
from vbus.board.config import read_board_text
from vbus.client import Bus
from vbus.core.errors import VbusError
from vbus.core.kernel import MS, NS
from vbus.nodes.machine import Machine
from vbus.nodes.plan import pins_of
from vbus.nodes.scenario import read_scenario
from vbus.serve.in_process import connect_in_process
from vbus.serve.time.pacer import WallClockPacer
from vbus.testing.bench import Bench
from vbus.testing.boards import for_test, of_part
from vbus.testing.clock import BoardClock
from vbus.testing.triggers import Triggers

SHORT = 100 * NS
"""A reset pulse, and a write strobe of 8 MHz parts that is long enough."""


class Held:
    """A test's board, a host that holds lines there, and a second host."""

    def __init__(self) -> None:
        bench = Bench("test", {}, [Path.cwd()], Path.cwd, scope=False)
        self.tested = bench.main("LM629N-8")
        self.board: Board = self.tested.board
        self.clock: BoardClock = self.tested.clock
        self.clock.advance("5 ms")
        self.bus: Bus = connect_in_process(self.board)
        self.other: Bus = connect_in_process(self.board)
        self.pacer = WallClockPacer(self.board)

    def findings(self) -> list[tuple[str, int, int]]:
        return [(one.rule, one.measured, one.limit) for one in self.board.violations]


def by_trigger(held: Held) -> None:
    async def wait() -> None:
        await Triggers(held.tested).at(held.board.now + SHORT)

    asyncio.run(wait())


def by_cycle(held: Held) -> None:
    held.board.ports[1].cost(SHORT)
    held.other.select(0)  # time passes, and no strobe moves
    held.other.read(0)


def in_vain(held: Held) -> None:
    with pytest.raises(VbusError, match="has not come to hold"):
        held.clock.wait_until("x.real > 400", within=SHORT)


def in_slices(held: Held) -> None:
    """As a server does it for a host that is held, or a page that steps."""
    held.pacer._slices.run(held.board.now + SHORT)
    held.pacer._slices.catch_up()


WAYS: dict[str, Callable[[Held], object]] = {
    "DELAY": lambda held: held.bus.delay(SHORT),
    "the DELAY of another host": lambda held: held.other.delay(SHORT),
    "the cycle of another host": by_cycle,
    "BoardClock.advance": lambda held: held.clock.advance(SHORT),
    "BoardClock.run_until": lambda held: held.clock.run_until(held.clock.now + SHORT),
    "BoardClock.wait_until": in_vain,
    "Board.run_for": lambda held: held.board.run_for(SHORT),
    "Board.run_until": lambda held: held.board.run_until(held.board.now + SHORT),
    "a trigger": by_trigger,
    "the kernel": lambda held: held.board.kernel.run_for(SHORT),
    "slices": in_slices,
}


def pulse(held: Held, way: Callable[[Held], object]) -> None:
    held.bus.pin("/RST", 0)
    way(held)
    held.bus.pin("/RST", 1)


def write_by_strobes(held: Held, way: Callable[[Held], object]) -> None:
    """Two writes: time passes within the first, and so the second is judged from its begin."""
    for _ in range(2):
        held.bus.drive(0x1E)
        held.bus.lines({"/CS": 0, "/PS": 0, "/WR": 0})
        way(held)
        held.bus.lines({"/CS": 1, "/PS": 1, "/WR": 1})
        held.bus.release()


@pytest.mark.parametrize("work", [pulse, write_by_strobes])
@pytest.mark.parametrize("way", WAYS)
def test_every_hand_that_passes_time_gives_the_same_findings(
    way: str, work: Callable[[Held, Callable[[Held], object]], None]
) -> None:
    held, known = Held(), Held()
    work(held, WAYS[way])
    work(known, WAYS["DELAY"])
    assert held.findings() == known.findings() != []
    if work is pulse:
        assert held.findings() == [("lm628.T6", SHORT, 1000 * NS)]


def test_lines_that_move_at_one_instant_are_not_judged_though_time_passes_between_them() -> None:
    held = Held()
    for way in WAYS.values():
        if way is not WAYS["DELAY"]:
            pulse(held, lambda held: None)
            write_by_strobes(held, lambda held: None)
            way(held)
            held.clock.advance("2 ms")
    assert {rule for rule, *_ in held.findings()} <= {"lm628.busy-write", "lm628.reset-write"}


def test_a_pulse_at_a_node_is_judged_whoever_moves_the_machine() -> None:
    for way in (
        lambda machine, x, y: machine.advance(SHORT),
        lambda machine, x, y: x.bus.delay(SHORT),
        lambda machine, x, y: y.bus.delay(SHORT),
    ):
        machine = made(TWO)
        x, y = machine.chip("x"), machine.chip("y")
        x.bus.pin("/RST", 0)
        way(machine, x, y)
        x.bus.pin("/RST", 1)
        assert [one.rule for one in x.board.violations] == ["lm628.T6"]


def test_a_pulse_of_a_scenario_is_judged() -> None:
    file, source = read_board_text(TWO)
    text = "3ms x pin /RST 0\n3000.1us x pin /RST 1\nend 6ms\n"
    scenario = read_scenario(text, "f", pins_of(file), MS)
    machine = Machine(file, source, scenario)
    machine.run()
    found = machine.nodes[0].board.violations
    assert [(one.rule, one.measured) for one in found] == [("lm628.T6", SHORT)]


def test_in_real_time_the_same_pulse_is_judged() -> None:
    board = build(*for_test(of_part("LM629N-8"), "board.toml", rate=1.0))
    now = [0]
    pacer = WallClockPacer(board, clock=lambda: now[0])
    port = board.open_port("host")
    now[0] = 5_000_000
    pacer.catch_up()
    number = port.pin_number("/RST")
    port.pin(number, 0)
    now[0] += 100
    pacer.catch_up()
    port.pin(number, 1)
    assert [(one.rule, one.measured) for one in board.violations] == [("lm628.T6", SHORT)]
