"""The bus of each chip over Zenoh: same calls, same bytes, many hosts."""

import asyncio
import gc
import threading
import weakref
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.e2e.serving import served
from tests.waiting import PATIENCE, until
from tests.zenoh.processes import CHIPS, Processes, connected_to
from vbus.board.board import Board
from vbus.board.build import build
from vbus.board.config import read_board_text
from vbus.client import connect
from vbus.client.aio import connect as connect_aio
from vbus.client.bus import Bus
from vbus.client.lm628 import Lm628
from vbus.core.errors import ProtocolError, TransportError
from vbus.core.signals import Observer
from vbus.network import keys
from vbus.serve.registry import order
from vbus.serve.server import LinkSpec
from vbus.transports.zenoh_inbox import Inbox


def board(time: str = "lockstep") -> Board:
    return build(*read_board_text(CHIPS.format(name="bench", time=time)))


class Cycles(Observer):
    def __init__(self) -> None:
        self.seen: list[tuple[str, str, bool, int, int]] = []

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        self.seen.append((host, chip, write, address, data))


def test_a_chip_on_the_network_answers_like_one_on_a_terminal(runtime: Path) -> None:
    heard = []
    for entry, link in (("zenoh:", "zenoh:bench"), (f"pty:{runtime}/p", f"pty:{runtime}/p")):
        made = board()
        cycles = Cycles()
        made.observe(cycles)
        with served(made, LinkSpec(entry)), connect(link) as bus:
            axis = Lm628(bus, "y")
            axis.check_reset()
            axis.load_filter(kp=100, ki=20, kd=900, il=1000)
            axis.move(3000, acc=2000, vel=100000)
            values = [bus.now(), axis.rddp(), axis.rdsigs(), bus.chip("x", "y").reads(0, 5)]
            with bus.batch() as batch:
                late = [batch.read(0), batch.getpin("y.HI"), batch.sample()]
            values += [later.value for later in late]
            values += [bus.info.board, bus.info.pins, bus.info.outputs, bus.info.features]
            bus.pin(200, 1)
            with pytest.raises(ProtocolError, match=r"no such line, pin, chip or address"):
                bus.echo(1)
            values.append(bus.now())
            heard.append((values, cycles.seen))

    assert heard[0] == heard[1]
    assert len(heard[0][1]) > 100


@pytest.mark.parametrize("link", ["zenoh:bench", "zenoh:bench/y"])
def test_a_client_waits_as_long_as_somebody_has_paused_the_board(link: str) -> None:
    told: list[int] = []

    def ask(bus: Bus) -> None:
        told.append(bus.chip("y").read(0))

    with served(board(), LinkSpec("zenoh:")) as server, connect(link) as bus:
        order("bench", "pause")
        until(bus.link.paused, "word of the pause")
        bus.timeout = 1.0
        host = threading.Thread(target=ask, args=(bus,))
        host.start()
        # Who comes while it is paused is told as well.
        with ThreadPoolExecutor() as pool:
            late = pool.submit(connect, link)
            host.join(2.5)
            assert (host.is_alive(), told, late.done()) == (True, [], False)
            bus.timeout = PATIENCE
            order("bench", "go")
            host.join(60)
            late.result(60).close()
        assert len(told) == 1
        until(lambda: not bus.link.paused(), "word that it goes on")
        assert server.board.reads == 1


def test_a_link_to_one_chip_reaches_that_chip_alone() -> None:
    with served(board(), LinkSpec("zenoh:")), connect("zenoh:bench/y") as bus:
        assert [chip.name for chip in bus.info.chips] == ["y"]
        assert all(name.startswith("y.") for name in bus.info.pins)
        with pytest.raises(ValueError, match="no chip 'x'"):
            bus.chip("x")


def test_the_asyncio_client_takes_the_same_link() -> None:
    async def host() -> list[int]:
        async with await connect_aio("zenoh:bench/x") as bus:
            reads = await asyncio.gather(*(bus.read(0) for _ in range(10)))
            async with bus.batch() as batch:
                low = batch.reads(0, 200)
            return [*reads, *low.value]

    with served(board(), LinkSpec("zenoh:")):
        assert len(set(asyncio.run(host()))) == 1


def test_events_come_by_themselves_and_before_later_replies() -> None:
    made = board("realtime")
    with (
        served(made, LinkSpec("zenoh:")),
        connect("zenoh:bench/x") as bus,
        connect("zenoh:bench/x") as other,
    ):
        bus.events("x.HI")
        bus.echo()
        assert bus.next_event(0.0) is None
        other.write(0, 0x1C)  # MSKI
        other.wait("1ms")
        other.writes(1, b"\0\x40")
        other.wait("1ms")
        other.write(0, 0x20)  # SBPA: a breakpoint at 0
        other.wait("1ms")
        other.writes(1, b"\0\0")
        other.writes(1, b"\0\0")
        other.echo()
        event = bus.next_event(PATIENCE)
        assert event is not None
        assert event.instant <= other.now()


def test_many_posted_writes_and_a_huge_batch_go_through_whole_and_in_order() -> None:
    made = board()
    cycles = Cycles()
    made.observe(cycles)
    with served(made, LinkSpec("zenoh:")), connect("zenoh:bench/x") as bus:
        for number in range(2000):
            bus.write(1, number & 0xFF)
        with bus.batch() as batch:
            for number in range(300):
                batch.writes(1, bytes([number & 0xFF]) * 250)
            end = batch.echo(7)
        assert end.value == 7

    written = [data for _, _, _, _, data in cycles.seen]
    expected = [number & 0xFF for number in range(2000)]
    expected += [number & 0xFF for number in range(300) for _ in range(250)]
    assert written == expected


def test_a_claimed_packet_of_one_host_is_never_interleaved_with_another() -> None:
    made = board("realtime")
    cycles = Cycles()
    made.observe(cycles)

    def host(byte: int) -> None:
        with connect("zenoh:bench/x") as bus:
            for _ in range(10):
                with bus.claim():
                    for _ in range(4):
                        bus.write(1, byte)
                        bus.read(0)

    with served(made, LinkSpec("zenoh:")):
        threads = [threading.Thread(target=host, args=(byte,)) for byte in (1, 2, 3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(PATIENCE)
            assert not thread.is_alive()

    written = [data for _, _, write, _, data in cycles.seen if write]
    packets = [written[start : start + 4] for start in range(0, len(written), 4)]
    assert len(packets) == 30
    assert all(packet == packet[:1] * 4 for packet in packets)


def test_a_delay_longer_than_the_hosts_patience_is_waited_for() -> None:
    link = "zenoh:bench/x?patience=0.5"
    with served(board("realtime"), LinkSpec("zenoh:")), connect(link) as bus:
        before = bus.now()
        bus.delay("2500ms")
        assert bus.now() - before >= 2500 * 10**9


def test_a_message_the_board_works_on_may_be_repeated_as_often_as_it_takes() -> None:
    # Each repetition takes the place of the one before, which ends unanswered: no silence.
    link = "zenoh:bench/x?patience=0.5"
    with served(board("realtime"), LinkSpec("zenoh:")), connect(link) as bus:
        with bus.batch() as batch:
            before = batch.now()
            batch.delay("2s")
            after = batch.now()
        assert after.value - before.value >= 2 * 10**12


@pytest.mark.parametrize(
    ("link", "said"),
    [
        ("zenoh:bench/q", 'the board "bench" has no chip "q"'),
        ("zenoh:bunch/x", 'no board called "bunch" and no router runs on this computer'),
        ("zenoh:bunch/x?connect={}", 'no board called "bunch" is on the network of tcp/127'),
        ("zenoh:bench/x?connect=nowhere", '"nowhere" is no endpoint'),
        ("zenoh:bench/x?connect=tls/127.0.0.1:1", "needs certificates"),
        ("zenoh:bench/x?connect=tls/a:1&key=k", "certificate and authority missing"),
    ],
)
def test_whoever_is_not_there_is_named_and_what_to_do(link: str, said: str) -> None:
    with served(board(), LinkSpec("zenoh:")) as server:
        endpoint = server.urls[0].partition("connect=")[2]
        with pytest.raises(TransportError, match=said):
            connect(link.format(endpoint))


@pytest.mark.parametrize("link", ["zenoh:a/b/c", "zenoh:a/*", "zenoh:/x", "zenoh:a?conect=b"])
def test_what_is_no_link_is_a_value_error(link: str) -> None:
    with pytest.raises(ValueError, match="zenoh:"):
        connect(link)


def test_a_second_board_of_the_same_name_is_refused_by_the_token(processes: Processes) -> None:
    _, endpoint = processes.router()
    first = processes.board("bench", connected_to(endpoint))
    elsewhere = processes.folder / "elsewhere"
    second = processes.start_elsewhere("bench", connected_to(endpoint), elsewhere)
    assert not second.ready
    assert second.stop() == 4
    assert f'a board called "bench" is on the network of {endpoint} already' in second.said
    assert keys.owner("bench", "") in second.said

    first.stop()
    again = processes.start_elsewhere("bench", connected_to(endpoint), elsewhere)
    assert again.ready, again.said


class Owner:
    """Refers to its inbox and its callbacks, as a transport does; they and the loop refer back."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.inbox = Inbox()
        self.inbox.open(loop)
        loop.set_exception_handler(lambda loop, context: self.end())
        self.entries = self.inbox.entry(self.take), self.inbox.entry(self.take, self.end)

    def take(self, item: object) -> None:
        """Take what comes."""

    def end(self) -> None:
        """Nothing more comes."""


def test_who_has_closed_its_inbox_leaves_memory() -> None:
    """A callback of Zenoh is no link that Python's collector sees."""
    loop = asyncio.new_event_loop()
    owner = Owner(loop)
    left = weakref.ref(owner)
    owner.inbox.close()
    loop.close()
    del owner, loop
    gc.collect()
    assert left() is None
