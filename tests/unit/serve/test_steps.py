"""A board that is paused and stepped: what hosts ask for is kept, and steps go exactly so far."""

import asyncio
import io
import json
import socket
from collections.abc import Iterator
from typing import Any

import pytest

from tests.unit.faults.bench import SAMPLE, build
from vbus.board.board import Board
from vbus.chips import base
from vbus.core.kernel import MS, SECOND, US
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.requests import REQUESTS
from vbus.record.format import JournalReader
from vbus.record.journal import Journal
from vbus.record.replay import Replay
from vbus.serve.detached_waits import DetachedWaits, DisconnectPoller
from vbus.serve.local_socket import Control, Order
from vbus.serve.manual_host import ManualHost
from vbus.serve.session import Services, Session, SpinTurn
from vbus.serve.time.pacer import WallClockPacer
from vbus.serve.time.statistics import ROUND_TRIP_NS, Histogram
from vbus.serve.time.steps import PAUSED, RUNNING, STEPPING, Steps
from vbus.transports.sockets import SocketLink

READ = bytes([REQUESTS["READ4"].code])
"""Read at address 0, the status byte; a cycle of 1 us in lockstep."""
RESET = bytes([REQUESTS["WRITE4"].code, 0])
CLAIM = bytes([REQUESTS["CLAIM"].code])


def delay(duration: int) -> bytes:
    return bytes([REQUESTS["DELAY"].code]) + duration.to_bytes(8, "big")


class Bench:
    """A served board on a wall clock of the test, and hosts with sockets."""

    def __init__(self, policy: str) -> None:
        self.ns = 0
        self.loop = asyncio.new_event_loop()
        self.board: Board = build(policy=policy)
        self.record()
        self.pacer = WallClockPacer(self.board, clock=lambda: self.ns)
        self.sessions: list[Session] = []
        self.steps = Steps(self.board, self.pacer, lambda: iter(self.sessions))
        self.control = Control(self.pacer.catch_up)
        self.control.orders |= self.steps.orders()
        self.disconnects = DisconnectPoller(self.loop)
        self.disconnects.open()
        self.pacer.start(self.loop)
        self.manual: ManualHost | None = None
        self.far: list[socket.socket] = []

    def record(self) -> None:
        self.file = io.BytesIO()
        self.journal = Journal(self.board, self.file)

    def host(self) -> socket.socket:
        near, far = socket.socketpair()
        near.setblocking(False)
        far.setblocking(False)
        self.far.append(far)
        port = self.board.open_port(f"host{len(self.sessions)}")
        services = Services(
            self.loop, self.pacer, SpinTurn(), Histogram(ROUND_TRIP_NS), self.disconnects,
            DetachedWaits(self.pacer), self.sessions.remove,
        )  # fmt: skip
        session = Session(services, SocketLink(near, "x"), port, ByteProtocol(port))
        port.on_resume = session.resume_soon
        self.sessions.append(session)
        session.begin()
        if self.pacer.halted:
            session.hold()
        return far

    def turn(self, ns: int = 0) -> None:
        """Let the event loop do what there is, and then what is due after some wall time."""
        for more in (0, ns):
            self.ns += more
            self.pacer.catch_up()
            for _ in range(50):
                self.loop.run_until_complete(asyncio.sleep(0))

    def order(self, do: str, **values: Any) -> Any:
        own = self.own_orders()

        async def ordered() -> dict[str, Any]:
            return self.control.carry_out(json.loads(json.dumps({"do": do, **values})), own)

        answer = self.loop.run_until_complete(ordered())
        return answer.get("done", answer.get("error"))

    def own_orders(self) -> dict[str, Order]:
        return self.manual.orders() if self.manual is not None else {}

    def join(self) -> None:
        self.manual = ManualHost(self.board, self.steps)

    def replay(self) -> object:
        """Play the journal of all that was done again; return the first difference."""
        for session in list(self.sessions):
            session.end("the end")
        if self.manual is not None:
            self.manual.end()
        self.journal.close()
        reader = JournalReader(io.BytesIO(self.file.getvalue()))
        entries = list(reader)
        assert entries[-1].op == "end"
        return Replay(build(policy=self.board.policy), entries, reader.header.families).run()

    def close(self) -> None:
        for session in list(self.sessions):
            session.end("the end")
        self.pacer.stop()
        self.disconnects.close()
        for far in self.far:
            far.close()
        self.loop.close()


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    made = Bench(getattr(request, "param", "lockstep"))
    yield made
    made.close()


def heard(far: socket.socket) -> bytes:
    try:
        return far.recv(4096)
    except BlockingIOError:
        return b""


every_policy = pytest.mark.parametrize("bench", ["lockstep", "slaved", "realtime"], indirect=True)
realtime = pytest.mark.parametrize("bench", ["realtime"], indirect=True)


@every_policy
def test_what_is_asked_while_time_stands_still_is_done_when_it_goes_on(bench: Bench) -> None:
    far = bench.host()
    far.send(READ)
    bench.turn(5_000_000)
    assert len(heard(far)) == 2
    assert bench.order("pause")["state"] == PAUSED
    stood, reads = bench.board.now, bench.board.reads
    late = bench.host()
    far.send(READ)
    late.send(READ + READ)
    bench.turn(60_000_000_000)
    assert (bench.board.now, bench.board.reads) == (stood, reads)
    assert heard(far) == heard(late) == b""
    assert bench.order("go")["state"] == RUNNING
    bench.turn(5_000_000)
    assert (len(heard(far)), len(heard(late))) == (2, 4)
    assert bench.board.reads == reads + 3
    # Time that has passed for people has not for the board.
    assert bench.board.now < stood + 20 * MS
    assert bench.replay().divergence is None


@every_policy
def test_a_step_of_a_bus_cycle_makes_one_of_many(bench: Bench) -> None:
    bench.order("pause")
    far = bench.host()
    far.send(READ * 5)
    bench.turn(5_000_000)
    for made in range(1, 4):
        bench.order("step", by="cycle")
        bench.turn(5_000_000)
        assert bench.steps.state == PAUSED
        assert bench.board.reads == made
        assert len(heard(far)) == 2
    bench.order("step", by="cycle", count=2)
    bench.turn(5_000_000)
    assert bench.board.reads == 5
    assert bench.replay().divergence is None


@every_policy
def test_a_host_that_waits_goes_on_with_the_step_and_no_further(bench: Bench) -> None:
    bench.order("pause")
    begun = bench.board.now
    far = bench.host()
    far.send(delay(10 * MS) + READ)
    bench.order("step", **{"by": "time", "for": "4 ms"})
    bench.turn(8_000_000)
    assert bench.steps.state == PAUSED
    assert bench.board.now == begun + 4 * MS
    assert heard(far) == b""
    bench.order("step", **{"by": "time", "for": "6 ms"})
    bench.turn(12_000_000)
    assert bench.board.now == begun + 10 * MS
    assert heard(far) == b"", "the read after it has to wait"
    bench.order("go")
    bench.turn(5_000_000)
    assert len(heard(far)) == 2
    assert bench.replay().divergence is None


def test_a_host_that_is_master_of_time_moves_it_in_a_step(bench: Bench) -> None:
    far = bench.host()
    bench.order("step", **{"by": "time", "for": "1 ms"})
    bench.turn(10_000_000)
    assert (bench.steps.state, bench.board.now) == (STEPPING, 0)
    far.send(READ * 2000)
    bench.turn()
    assert bench.steps.state == PAUSED
    assert bench.board.now == MS
    assert bench.board.reads == 1000


@every_policy
def test_a_step_to_the_next_sample(bench: Bench) -> None:
    bench.join()
    bench.order("pause")
    before = bench.board.now
    due = bench.board.chips[0].due(base.SAMPLE)
    answer = bench.order("step", by="sample", chip="x")
    bench.turn(1_000_000)
    assert bench.steps.state == PAUSED, answer
    assert bench.board.now == due
    bench.order("step", by="sample", chip="x")
    bench.turn(1_000_000)
    assert bench.board.now == due + SAMPLE
    assert before < due <= before + SAMPLE
    assert bench.replay().divergence is None


@every_policy
def test_a_step_to_a_condition_stops_at_its_instant(bench: Bench) -> None:
    bench.join()
    bench.order("pause")
    begun = bench.board.now
    bench.order("step", by="condition", until=f"time >= {begun // US + 1234} us")
    bench.turn(2_000_000)
    assert bench.steps.state == PAUSED
    assert bench.board.now == (begun // US + 1234) * US
    answer = bench.order("step", by="condition", until="time > 1 ms")
    assert answer["text"] == "time > 1 ms: holds already"
    assert bench.replay().divergence is None


def test_a_condition_is_looked_at_after_each_bus_cycle(bench: Bench) -> None:
    bench.order("pause")
    far = bench.host()
    far.send(READ * 3 + RESET + READ * 3)
    bench.order("step", by="condition", until="x.status.BUSY")
    bench.turn()
    assert bench.steps.state == PAUSED
    assert (bench.board.reads, bench.board.writes) == (3, 1)
    assert bench.replay().divergence is None


@pytest.mark.parametrize("bench", ["lockstep", "slaved"], indirect=True)
def test_without_a_host_the_own_session_lets_time_pass(bench: Bench) -> None:
    answer = bench.order("step", **{"by": "time", "for": "5 ms"})
    assert answer == (
        f"the hosts of a board in {bench.board.policy} move its time, and none is attached"
    )
    bench.join()
    bench.order("step", **{"by": "time", "for": "50 ms"})
    bench.turn()
    assert (bench.steps.state, bench.board.now) == (PAUSED, 50 * MS)
    # And if asked to, also beside a host, which waits meanwhile.
    far = bench.host()
    far.send(READ)
    bench.order("step", **{"by": "time", "for": "5 ms", "alone": True})
    bench.turn()
    assert (bench.board.now, bench.board.reads) == (55 * MS, 0)
    assert bench.replay().divergence is None


@realtime
def test_the_rate_is_another_from_now_on(bench: Bench) -> None:
    bench.turn(10_000_000)
    begun = bench.board.now
    assert bench.order("rate", rate=0.1)["rate"] == 0.1
    bench.turn(10_000_000)
    assert bench.board.now == begun + MS
    assert bench.order("rate", rate="max")["rate"] == "max"
    bench.turn()
    assert bench.board.now > begun + SECOND
    assert bench.order("rate", rate=1)["rate"] == 1
    begun = bench.board.now
    bench.turn(3_000_000)
    assert bench.board.now == begun + 3 * MS
    assert bench.order("rate", rate=0) == '0 is no rate; write a number from 0.001 up, or "max"'
    assert bench.order("rate", rate="nan") == (
        'nan is no rate; write a number from 0.001 up, or "max"'
    )


def test_a_rate_is_for_boards_in_real_time(bench: Bench) -> None:
    assert bench.order("rate", rate=2) == (
        "a rate makes sense in real time; this board is lockstep"
    )


@every_policy
def test_a_cycle_by_hand_is_journalled_and_time_stands_still_after_it(bench: Bench) -> None:
    bench.join()
    bench.order("pause")
    begun = bench.board.now
    answer = bench.order("cycle", chip="x", address=0)
    assert answer["data"] == 0x80 | bench.order("cycle", chip="x", address=0)["data"]
    cost = (bench.board.now - begun) // 2
    assert cost == (US if bench.board.policy != "realtime" else bench.board.chips[0].cycle_ps)
    bench.turn(1_000_000_000)
    assert bench.board.now == begun + 2 * cost
    bench.order("cycle", chip="x", address=0, data=0)
    assert (bench.board.reads, bench.board.writes) == (2, 1)
    assert bench.replay().divergence is None


def test_a_cycle_by_hand_waits_for_no_claim(bench: Bench) -> None:
    far = bench.host()
    bench.join()
    far.send(CLAIM)
    bench.turn()
    bench.order("pause")
    answer = bench.order("cycle", chip="x", address=0)
    assert answer == "another session has claimed x; try again"
    assert bench.board.reads == 0
    assert bench.order("cycle", chip="x", address=2) == "x has addresses 0 to 1"
    assert bench.order("cycle", chip="x", address=0, data=256) == (
        "256 is no byte; allowed are 0 to 255"
    )
    assert bench.replay().divergence is None


def test_who_waits_for_a_claim_does_not_go_on_while_time_stands_still(bench: Bench) -> None:
    bench.join()
    first, second = bench.host(), bench.host()
    first.send(CLAIM)
    bench.turn()
    second.send(READ)
    bench.turn()
    bench.order("pause")
    bench.sessions[0].end("it goes")
    bench.turn()
    assert bench.board.reads == 0
    bench.order("go")
    bench.turn()
    assert len(heard(second)) == 2


@every_policy
def test_a_pin_stays_as_it_was_put_until_the_session_ends(bench: Bench) -> None:
    bench.join()
    assert bench.manual is not None
    assert bench.order("pin", pin="x./RST", level="0") == {"pin": "x./RST", "level": "0"}
    net = bench.board.chips[0].pins["/RST"].net
    assert net.value == 0
    assert bench.order("pin", pin="x./RST", level="x") == (
        '"x" is no level; write 0, 1 or z, which lets go'
    )
    assert bench.order("pin", pin="x.HI", level="5").startswith('"5" is no level')
    assert "this session has" in bench.order("pin", pin="y", level="1")
    bench.manual.end()
    assert net.value == 1
    bench.manual = None
    assert bench.replay().divergence is None


def test_a_board_goes_on_when_who_has_it_in_hand_leaves(bench: Bench) -> None:
    bench.join()
    far = bench.host()
    bench.order("pause")
    far.send(READ)
    bench.turn()
    assert heard(far) == b""
    assert bench.manual is not None
    bench.manual.end()
    bench.manual = None
    bench.turn()
    assert bench.steps.state == RUNNING
    assert len(heard(far)) == 2


def test_what_makes_no_sense_is_refused_in_words(bench: Bench) -> None:
    for values, refusal in (
        ({"by": "day"},
         'there is no step by "day"; there are cycle, time, sample, edge, condition'),
        ({"by": "cycle", "count": 0}, "0 bus cycles: allowed are 1 and more"),
        ({"by": "cycle"}, "no host is attached that could make a bus cycle; make one yourself"),
        ({"by": "time", "for": "soon"},
         "'soon' is no duration; write a number with ps, ns, us, ms or s"),
        ({}, "'by' is missing"),
    ):  # fmt: skip
        assert bench.order("step", **values) == refusal
        assert bench.steps.state == RUNNING


@pytest.mark.parametrize("bench", ["lockstep", "slaved"], indirect=True)
def test_who_steps_through_a_run_changes_nothing_of_it(bench: Bench) -> None:
    """The same requests in one go and in steps: the same replies at the same instants."""
    work = READ * 40 + delay(3 * MS) + READ * 40 + RESET + READ * 20
    far = bench.host()
    far.send(work)
    bench.turn()
    whole = heard(far), bench.board.now
    other = Bench(bench.board.policy)
    far = other.host()
    other.order("pause")
    far.send(work)
    found = b""
    for n in range(400):
        other.order("step", **({"by": "cycle"} if n % 3 else {"by": "time", "for": "70 us"}))
        other.turn()
        found += heard(far)
        if len(found) == len(whole[0]):
            break
    assert (found, other.board.now) == whole
    other.close()
