"""Coroutines of a test wait for edges, packets and instants of their board."""

import asyncio
import time
from pathlib import Path

import pytest

from vbus.client.lm628 import Lm628
from vbus.core.errors import VbusError
from vbus.core.kernel import MS, US
from vbus.testing import triggers
from vbus.testing.bench import Bench
from vbus.testing.checks.around_chip import ChipBench
from vbus.testing.judge import Judge
from vbus.testing.limits import Limits
from vbus.testing.triggers import Triggers

pytestmark = pytest.mark.asyncio


@pytest.fixture
def bench() -> Bench:
    return Bench("test", {}, [Path.cwd()], Path.cwd)


@pytest.fixture
def impatient(bench: Bench) -> None:
    bench.judge = Judge(budget=Limits(polling=0.3))


@pytest.fixture
def x(bench: Bench) -> ChipBench:
    return bench.chip("LM629")


@pytest.fixture
def board(bench: Bench) -> Triggers:
    return Triggers(bench.main("LM629N-8"))


async def test_time_passes_to_an_instant_and_no_further(board: Triggers, x: ChipBench) -> None:
    assert await board.at("2 ms") == 2 * MS
    assert x.board.now == 2 * MS
    seen = []

    async def look(when: int) -> None:
        await asyncio.wait_for(asyncio.gather(board.at(when)), 60)
        seen.append((when, x.board.now))

    await asyncio.gather(look(7 * MS), look(5 * MS), look(5 * MS + 1), look(60 * MS))
    assert seen == [(when, when) for when in (5 * MS, 5 * MS + 1, 7 * MS, 60 * MS)]
    with pytest.raises(VbusError, match="at 3000us: it is 60000us already"):
        board.at("3 ms")


async def test_an_edge_is_met_at_its_very_instant(board: Triggers, x: ChipBench) -> None:
    axis = Lm628(x.bus)
    axis.check_reset()
    x.bus.write(0, 0x1D)
    x.bus.wait("1 ms")
    x.bus.writes(1, b"\0\0")
    x.bus.wait("1 ms")
    assert not x.bus.sync().outputs & 1
    begun = x.board.now
    with pytest.raises(VbusError, match=r"an edge of x\.HI to 1 has not come within 3 ms of chip"):
        await board.edge("x.HI", 1, within="3 ms")
    assert x.board.now == begun + 3 * MS
    axis.load_filter(kp=300, kd=2000)
    falls = board.edge("x.HI", 0, within="9 s")
    rises = board.edge("x.HI", within="9 s")
    axis.load_trajectory(acc=400, vel=4 << 16, pos=50, start=True)
    edge = await rises
    assert edge == x.board.now
    assert not falls.done()
    falls.cancel()
    net = x.board.find_pin("x.HI").net
    await asyncio.sleep(0)
    assert net.observers == ()
    x.board.run_until(edge)
    assert net.value == 1


@pytest.mark.usefixtures("impatient")
async def test_packets_come_from_hosts_and_do_not_move_time(board: Triggers, x: ChipBench) -> None:
    started = board.packet("STT", "x")
    before = x.board.now
    x.bus.writes(0, b"\x00")
    await asyncio.sleep(0)
    assert not started.done()
    x.bus.wait("9 ms")
    x.bus.write(0, 0x01)
    assert (await started).name == "STT"
    assert x.board.now > before
    with pytest.raises(VbusError, match=r"nothing has happened on the board for 0\.3 s of wall"):
        await board.packet("STT")
    with pytest.raises(VbusError, match="no chip called 'y'"):
        board.edge("y.HI")


@pytest.mark.usefixtures("impatient")
async def test_a_machine_that_stood_still_is_no_host_that_does_nothing(
    board: Triggers, x: ChipBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(triggers, "sleep", lambda _: time.sleep(0.4))
    started = board.packet("STT", "x")
    await asyncio.to_thread(time.sleep, 1.0)  # two looks, and more than its patience
    x.bus.wait("9 ms")
    x.bus.write(0, 0x01)
    assert (await started).name == "STT"


async def test_a_packet_that_cannot_come_is_refused(board: Triggers, bench: Bench) -> None:
    for name in ("STTT", "stt"):
        with pytest.raises(VbusError, match=f'no packet "{name}"; did you mean "STT"[?] there are'):
            board.packet(name)
    with pytest.raises(VbusError, match="no chip called 'y'; this board has: x"):
        board.packet("STT", "y")
    other = Triggers(bench.make("MC1241A"))
    with pytest.raises(VbusError, match='no packet "cheksum"; did you mean "checksum"'):
        other.packet("cheksum")
    for name in ("GET_POS", "adapter status", "status", "checksum"):
        other.packet(name).cancel()
    third = Triggers(bench.make("MCP-1200"))
    with pytest.raises(VbusError, match='no packet "write STATSU"; did you mean "STATUS"'):
        third.packet("write STATSU")
    for name in ("STATUS", "write FLAG"):
        third.packet(name).cancel()


async def test_a_condition_is_met_at_its_very_instant(board: Triggers, x: ChipBench) -> None:
    axis = Lm628(x.bus)
    axis.check_reset()
    axis.load_filter(kp=300, kd=2000)
    edge = board.edge("x.HI", within="9 s")
    flag = board.until("x.status.TRAJECTORY_COMPLETE and not x.status.BUSY")
    beyond = board.until("x.real > 30 and x.command != 0")
    never = board.until("x.real > 100", within="900 ms")
    started = board.until("x.command == STT", by_hosts=True)
    begun = x.board.now
    axis.mski(0x04)
    axis.rsti(0x00)
    axis.load_trajectory(acc=400, vel=4 << 16, pos=50, start=True)
    assert begun < await started <= x.board.now
    first = await beyond
    assert first == x.board.now
    assert x.chip.telemetry()["real"] > 30
    await edge
    assert first < await flag == edge.result()
    with pytest.raises(VbusError, match=r'"x\.real > 100" has not come to hold within 900000us of'):
        await never
    assert x.board.now == begun + 900 * MS
    with pytest.raises(VbusError, match=r'did you mean "x\.real"'):
        board.until("x.reel > 100")
    await asyncio.sleep(0)
    assert x.board.kernel.observed == 0


async def test_time_can_be_left_to_a_host_in_another_task(board: Triggers, x: ChipBench) -> None:
    async def host() -> None:
        for _ in range(50):
            x.bus.read(0)
            await asyncio.sleep(0)

    before = x.board.now
    when = before + 20 * US
    _, seen = await asyncio.gather(host(), board.at(when, by_hosts=True))
    assert seen == when
    assert x.board.now == before + 50 * US


async def test_a_board_on_a_terminal_is_waited_for_as_well(bench: Bench, board: Triggers) -> None:
    from vbus.client.aio import connect

    terminal = bench.terminal()
    try:
        await board.at("5 ms")
        async with await connect(f"pty:{terminal}") as bus:
            resets = board.packet("RESET")
            await bus.write(0, 0)
            assert (await resets).name == "RESET"
            assert (await bus.now()) == 5 * MS + US
    finally:
        bench.close()
