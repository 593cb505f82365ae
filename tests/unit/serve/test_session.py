"""A session whose host goes in the midst of what it is answered."""

import asyncio
import socket
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.unit.faults.bench import build
from tests.waiting import until
from vbus.board.board import Board
from vbus.core.kernel import MS, SECOND, US
from vbus.core.signals import Observer
from vbus.protocols.byte import ByteProtocol
from vbus.serve.detached_waits import DetachedWaits, DisconnectPoller
from vbus.serve.fast_path import CROWDED, LATE_NS
from vbus.serve.message_session import SLICE, MessageSession
from vbus.serve.session import BURST, Services, Session, SpinTurn
from vbus.serve.time.pacer import WallClockPacer
from vbus.serve.time.statistics import ROUND_TRIP_NS, Histogram
from vbus.serve.time.steps import Steps
from vbus.transports import states
from vbus.transports.base import Link, MessageLink
from vbus.transports.sockets import SocketLink

READ = b"\x10"
CLAIM = b"\x04"
WRITES = b"\x20\x00\x20\x00"


def delay(duration: int) -> bytes:
    return b"\x50" + duration.to_bytes(8, "big")


class Served:
    """A board with one host after the other, and an event loop that is turned by hand."""

    def __init__(self, policy: str) -> None:
        self.loop = asyncio.new_event_loop()
        self.board: Board = build(policy=policy)
        self.hosts: list[socket.socket] = []
        self.sessions: list[Session] = []
        self.pacer = WallClockPacer(self.board)
        self.pacer.start(self.loop)
        self.ended: list[Session] = []
        self.detached = DetachedWaits(self.pacer)
        self.disconnects = DisconnectPoller(self.loop)
        self.disconnects.open()
        self.pacer.look_for_hosts = self.disconnects.look
        self.detached.look_for_hosts = self._look_for_hosts
        self.services = Services(
            self.loop, self.pacer, SpinTurn(), Histogram(ROUND_TRIP_NS), self.disconnects,
            self.detached, self.ended.append,
        )  # fmt: skip

    def _look_for_hosts(self) -> None:
        for session in self.sessions:
            if session not in self.ended and self.disconnects.gone_of([session.link.fd]):
                session.hung_up()

    def connect(self) -> socket.socket:
        near, far = socket.socketpair()
        near.setblocking(False)
        far.setblocking(False)
        self.hosts.append(far)
        self.detached.admit(SocketLink(near, "x"), self._begin)
        return far

    def _begin(self, link: Link) -> None:
        port = self.board.open_port("host0")
        session = Session(self.services, link, port, ByteProtocol(port))
        self.sessions.append(session)
        session.begin()

    def close(self) -> None:
        self.detached.close()
        for session in self.sessions:
            session.end("the board stops")
        for host in self.hosts:
            host.close()
        self.pacer.stop()
        self.disconnects.close()
        self.loop.close()

    def turn(self, times: int) -> None:
        for _ in range(times):
            self.loop.run_until_complete(asyncio.sleep(0))

    def rest(self) -> None:
        """Turn until nobody waits for time any more, and nobody has anything to say."""
        self.turn(20)
        while self.pacer._wakes:
            self.turn(20)
        self.turn(20)


@contextmanager
def served(policy: str = "lockstep") -> Iterator[Served]:
    with_hosts = Served(policy)
    try:
        yield with_hosts
    finally:
        with_hosts.close()


@pytest.mark.parametrize("turns", [0, 1, 2, 3, 5, 8])
def test_the_next_host_begins_where_the_delay_of_a_killed_one_ends(turns: int) -> None:
    with served() as it:
        first = it.connect()
        first.send(READ + delay(50 * SECOND) + READ + delay(300 * MS))
        it.turn(turns)
        first.close()
        it.turn(1)  # what a socket tells comes in the order in which it happened
        second = it.connect()
        second.send(READ + delay(MS) + READ)
        it.rest()
        assert len(it.ended) == 1
        assert it.board.now == 4 * US + 50 * SECOND + 301 * MS
        assert second.recv(100) == b"D\x84D\x84"


@pytest.mark.parametrize("turns", [0, 1, 2, 5])
def test_a_killed_host_has_ended_before_the_next_one_begins(turns: int) -> None:
    """However much it had sent, and whether or not it has been noticed that it was killed."""
    polls = 20_000
    with served() as it:
        first = it.connect()
        it.turn(3)
        sent = first.send(READ * polls)
        it.turn(turns)
        first.close()
        second = it.connect()
        assert len(it.ended) == 1
        began = it.board.now
        second.send(READ)
        it.rest()
        assert it.board.now == began + US
        assert second.recv(100) == b"D\x84"
    assert sent > 8192


def test_of_a_host_that_goes_in_a_pause_it_is_said(caplog: pytest.LogCaptureFixture) -> None:
    said = (
        "x: a host has gone while the board was paused; if it gave up waiting, the pause is the"
        " cause"
    )
    with served("realtime") as it:
        for paused in (False, True):
            host = it.connect()
            it.turn(3)
            if paused:
                it.pacer.halt()
                it.sessions[-1].hold()
            host.send(READ)
            it.turn(3)
            host.close()
            it.turn(10)
            assert len(it.ended) == 1 + paused
            assert caplog.messages == [said] * paused


@pytest.mark.parametrize("waits", [True, False])
def test_a_delay_of_years_is_given_up_a_whole_number_of_minutes_before_its_end_for_the_next_host(
    waits: bool, caplog: pytest.LogCaptureFixture
) -> None:
    with served() as it:
        first = it.connect()
        first.send(READ + delay(100 * SECOND) + READ)
        it.turn(1)
        first.close()
        it.turn(1)
        second = it.connect() if waits else None
        it.rest()
        assert it.board.now == (US + 40 * SECOND if waits else 2 * US + 100 * SECOND)
        assert caplog.messages == waits * [
            "x: the host has gone, and what it had sent still waits for chip time; another host"
            " waits to be let in, so the rest is discarded"
        ]
        if second is not None:
            second.send(READ)
            it.rest()
            assert it.board.now == 2 * US + 40 * SECOND
        assert it.pacer._wakes == []


def test_a_host_that_comes_and_goes_meanwhile_is_served_too() -> None:
    with served() as it:
        first, second = it.connect(), it.connect()
        first.send(delay(SECOND))
        it.turn(1)
        first.close()
        it.turn(1)
        third = it.connect()
        third.send(READ)
        third.close()
        it.rest()
        assert it.board.now == SECOND + US
        assert len(it.ended) == 2
        second.send(READ)
        it.rest()
        assert it.board.now == SECOND + 2 * US


@pytest.mark.parametrize("carried_out", [True, False])
def test_a_host_that_goes_while_it_waits_begins_if_what_it_has_sent_is_carried_out(
    carried_out: bool,
) -> None:
    with served() as it:
        first = it.connect()
        first.send(delay(SECOND))
        it.turn(1)
        first.close()
        it.turn(1)
        near, far = socket.socketpair()
        link, begun = SocketLink(near, "x"), list[Link]()
        it.detached.admit(link, begun.append)
        link.on_end(carried_out)
        it.rest()
        assert begun == [link] * carried_out
        assert (near.fileno() >= 0) == carried_out
        near.close()
        far.close()


@pytest.mark.parametrize("behind", [b"", READ])
def test_in_real_time_a_wait_outlives_its_host_for_what_stands_behind_it_alone(
    behind: bytes,
) -> None:
    with served("realtime") as it:
        first = it.connect()
        first.send(READ + delay(50 * SECOND) + behind)
        it.turn(2)
        first.close()
        it.turn(20)
        assert len(it.ended) == 1
        assert len(it.pacer._wakes) == len(it.board.ports) == len(behind)
        second = it.connect()
        second.send(READ)
        it.turn(5)
        assert second.recv(10) == b"D\x84"


@pytest.mark.parametrize("policy", ["lockstep", "realtime"])
def test_what_waits_for_a_claim_is_carried_out_when_that_ends(policy: str) -> None:
    with served(policy) as it:
        first, second = it.connect(), it.connect()
        first.send(CLAIM)
        it.turn(5)
        second.send(CLAIM + WRITES + READ)
        it.turn(5)
        second.close()
        it.turn(5)
        assert len(it.ended) == 1
        third = it.connect()  # nobody waits for another's claim to be let in
        it.turn(5)
        assert len(it.sessions) == 3
        writes = it.board.chips[0].writes
        first.send(b"\x05")
        it.rest()
        assert it.board.chips[0].writes == writes + 2
        assert len(it.board.ports) == 2
        third.close()


@pytest.mark.parametrize("policy", ["lockstep", "realtime"])
def test_a_host_that_never_reads_its_answers_is_carried_out_to_the_last_request(
    policy: str,
) -> None:
    with served(policy) as it:
        host = it.connect()
        sent = host.send(READ * 20_000 + WRITES)
        host.close()
        it.rest()
        chip = it.board.chips[0]
        assert len(it.ended) == 1
        assert (chip.reads, chip.writes) == (20_000, 2)
    assert sent == 20_000 + len(WRITES)


def test_half_a_request_at_the_end_is_discarded_and_told(caplog: pytest.LogCaptureFixture) -> None:
    with served() as it:
        host = it.connect()
        host.send(READ + WRITES[:1])
        host.close()
        it.rest()
        assert it.board.chips[0].reads == 1
    assert caplog.messages == [
        "x: the host has gone in the midst of a request; the 1 bytes of it that came are discarded"
    ]


def test_a_board_that_stops_carries_nothing_out_and_lets_nobody_in() -> None:
    with served() as it:
        first = it.connect()
        first.send(delay(50 * SECOND))
        it.turn(1)
        first.close()
        it.turn(1)
        second = it.connect()
        second.send(READ)
        it.detached.close()
        it.rest()
        assert it.board.now < 50 * SECOND
        assert it.board.ports == []
        with pytest.raises(ConnectionResetError):
            second.recv(1)


@pytest.mark.parametrize(("gap", "looked"), [(LATE_NS, BURST), (LATE_NS + 1, 1)])
def test_a_host_is_not_looked_for_where_others_have_the_processor(gap: int, looked: int) -> None:
    """It has its turn before each look; if that takes long, the session sleeps for a while."""
    wall, ways = [0], [0]
    with served() as it:
        it.pacer.clock = lambda: wall[0]
        it.services.turns.looks = 3

        def give_way() -> None:
            wall[0] += gap
            ways[0] += 1
            host.send(READ)

        it.services.turns.give_way = give_way
        host = it.connect()
        for _ in range(2):  # the session served last is looked for
            host.send(READ)
            it.turn(2)
        assert ways[0] >= looked
        before = ways[0]
        for _ in range(CROWDED):
            host.send(READ)
            it.turn(1)
        assert (ways[0] > before) == (looked > 1)


def test_an_error_of_the_program_ends_one_session_and_the_board_goes_on(
    caplog: pytest.LogCaptureFixture,
) -> None:
    class Fails(Observer):
        def bus_cycle(
            self, when: int, host: str, chip: str, write: bool, address: int, data: int
        ) -> None:
            raise RuntimeError("a mistake")

    fails = Fails()
    with served() as it:
        first = it.connect()
        first.send(READ)
        it.rest()
        assert first.recv(100) == b"D\x84"
        it.board.observe(fails)
        first.send(READ)
        it.rest()
        assert first.recv(100) == b""
        assert "internal error while serving x; its session ends, the board goes on" in caplog.text
        assert it.ended == it.sessions
        it.board.unobserve(fails)
        second = it.connect()
        second.send(READ)
        it.rest()
        assert second.recv(100) == b"D\x84"


@pytest.mark.parametrize("durable", [True, False])
def test_what_a_durable_journal_does_not_hold_is_not_answered(durable: bool) -> None:
    with served() as it:
        it.services = it.services._replace(settle=lambda: durable)
        host = it.connect()
        host.send(READ)
        it.turn(10)
        assert host.recv(100) == (b"D\x84" if durable else b"")
        assert len(it.ended) == (not durable)


def test_what_is_wrong_with_a_link_changes_what_is_sent_and_not_what_is_done() -> None:
    with served() as it:
        host = it.connect()
        session = it.sessions[0]
        session.add_filter(bytearray.reverse)
        host.send(READ)
        it.turn(10)
        session.remove_filter(bytearray.reverse)
        host.send(READ)
        it.turn(10)
        assert host.recv(100) == b"\x84D" + b"D\x84"
        assert it.board.counters["reads"] == 2


class LeftBehind(MessageLink):
    """A host that goes while messages of its own wait."""

    def __init__(self, messages: list[bytes]) -> None:
        super().__init__("x")
        self.messages: list[bytes] = messages

    def left(self) -> list[bytes]:
        return self.messages

    def close(self) -> None:
        pass


class Asking(LeftBehind):
    """A host that is there, and takes what it is answered."""

    def __init__(self) -> None:
        super().__init__([])
        self.answers: list[bytes] = []

    def answer(self, data: bytes) -> None:
        self.answers.append(data)


@pytest.mark.parametrize(("message", "answer"), [(READ, b"D\x84"), (WRITES, b"")])
@pytest.mark.parametrize("durable", [True, False])
def test_a_message_that_a_durable_journal_does_not_hold_is_not_answered(
    durable: bool, message: bytes, answer: bytes
) -> None:
    with served() as it:
        port = it.board.open_port("host0")
        link = Asking()
        services = it.services._replace(settle=lambda: durable)
        session = MessageSession(services, link, port, ByteProtocol(port))
        session.begin()
        link.on_data(message)
        it.turn(10)
        assert link.answers == [answer] * durable
        assert link.reason == (
            ""
            if durable
            else "the journal takes no more, and what it does not hold is not answered"
        )
        session.end("the board stops")
        assert link.reason.startswith("the board stops" if durable else "the journal takes no more")


@pytest.mark.parametrize("policy", ["lockstep", "realtime"])
@pytest.mark.parametrize("wait", [b"", delay(3 * MS)])
def test_the_rest_of_a_host_that_has_gone_takes_its_turns(policy: str, wait: bytes) -> None:
    with served(policy) as it:
        port = it.board.open_port("host0")
        link = LeftBehind([wait + b"\x20\x00" * SLICE, b"\x20\x00" * 2])
        session = MessageSession(it.services, link, port, ByteProtocol(port))
        session.begin()
        before = it.board.counters["writes"]
        link.on_end(False)
        assert it.board.counters["writes"] - before <= SLICE
        it.connect()
        # In lockstep the next host is let in behind the rest.
        assert len(it.sessions) == (policy == "realtime")
        it.rest()
        until(lambda: (it.turn(3), session.state == states.CLOSED)[1], "the end of the rest")
        assert it.board.counters["writes"] - before == SLICE + 2
        assert len(it.sessions) == 1


@pytest.mark.parametrize("turns", [0, 1, 3])
def test_a_pause_between_two_slices_of_what_was_left_behind_ends_with_the_pause(turns: int) -> None:
    with served() as it:
        port = it.board.open_port("host0")
        link = LeftBehind([b"\x20\x00" * SLICE, b"\x20\x00" * 2])
        session = MessageSession(it.services, link, port, ByteProtocol(port))
        steps = Steps(it.board, it.pacer, lambda: iter(()))
        session.begin()
        before = it.board.counters["writes"]
        link.on_end(False)
        steps.pause("paused")
        it.turn(turns)
        assert it.board.counters["writes"] - before == SLICE // 2
        steps.go()
        it.rest()
        assert it.board.counters["writes"] - before == SLICE + 2
        assert session.state == states.CLOSED
