"""A chip whose samples are a clock long is computed in portions, whatever a host asks for."""

import asyncio
import io
from collections.abc import Callable

import pytest

from tests.unit.faults.bench import DC, MCP, build
from vbus.board.board import Board
from vbus.circuit.circuit import MOST_STEPS
from vbus.core.kernel import END, MS, US
from vbus.record.format import JournalReader
from vbus.record.journal import Journal
from vbus.record.replay import Replay
from vbus.serve.time.pacer import WallClockPacer

CLOCK = 50_000
ASKED = 600 * US


def racing() -> Board:
    """Return a board with a motor that turns, in idle mode, with samples of one clock each."""
    board = build(MCP, DC)
    port = board.open_port("host0")
    for register, value in ((0x05, 1), (0x09, 0x20), (0x0F, 0)):
        port.write(register, value)
    for register in (0x10, 0x11):
        port.write(register, 0)
    port.delay(300 * US)
    board.catch_up()
    return board


def paced(board: Board, host: Callable[[], bool]) -> list[int]:
    """Let a host have its way as a server does; return how long each portion of time was."""
    portions: list[int] = []
    catch_up = board.catch_up

    async def main() -> None:
        loop = asyncio.get_running_loop()
        done = asyncio.Event()
        pacer = WallClockPacer(board)
        pacer.start(loop)
        [port] = board.ports
        last = board.now

        def serve() -> None:
            pacer.catch_up()
            if host():
                done.set()
            else:
                pacer.wake_at(port.hold_until, serve)

        run = pacer._slices.run

        def noted(target: int) -> bool:
            nonlocal last
            there = run(target)
            portions.append(board.now - last)
            last = board.now
            return there

        pacer._slices.run = noted  # type: ignore[method-assign]
        serve()
        await asyncio.wait_for(done.wait(), 60)
        pacer.stop()

    asyncio.run(main())
    board.limit = END
    catch_up()
    return portions


@pytest.mark.spec("MCP-SMP-1")
def test_a_delay_over_samples_of_a_clock_comes_in_portions_and_ends_at_the_picosecond() -> None:
    board, alone = racing(), racing()
    assert board.chips[0].step_ps() == CLOCK
    begun = board.now
    [port], [other] = board.ports, alone.ports
    portions = paced(board, lambda: port.delay(ASKED))
    assert board.now == begun + ASKED
    assert sum(portions) == ASKED
    assert max(portions) <= MOST_STEPS * CLOCK
    other.delay(ASKED)
    assert board.state_hash() == alone.state_hash()


def test_delays_that_add_up_are_portioned_too() -> None:
    board = racing()
    [port] = board.ports
    left = 12

    def host() -> bool:
        nonlocal left
        while left:
            if not port.delay(ASKED // 12):
                return False
            left -= 1
        return True

    assert max(paced(board, host)) <= 2 * MOST_STEPS * CLOCK


def test_samples_of_a_usual_length_are_not_portioned() -> None:
    board = build(MCP, DC)
    port = board.open_port("host0")
    port.write(0x05, 1)
    assert port.delay(MS)
    assert paced(board, lambda: port.delay(10 * MS)) == []


def test_a_journal_of_it_replays() -> None:
    file = io.BytesIO()
    board = build(MCP, DC)
    journal = Journal(board, file, board.text, "b.toml")
    port = board.open_port("host0")
    for register, value in ((0x05, 1), (0x09, 0x20), (0x0F, 0), (0x10, 0), (0x11, 0)):
        port.write(register, value)
    assert paced(board, lambda: port.delay(ASKED)) != []
    port.read(0x07)
    port.close()
    journal.close()
    reader = JournalReader(io.BytesIO(file.getvalue()))
    assert Replay(build(MCP, DC), reader, reader.header.families).run().divergence is None
