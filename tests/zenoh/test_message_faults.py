"""Messages that are late, lost, doubled or out of order: each is carried out once, and in order."""

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.serving import served
from tests.waiting import PATIENCE, until
from tests.zenoh.processes import CHIPS, session_at
from tests.zenoh.test_bus import Cycles, board
from tests.zenoh.test_faults import BUS, endpoint_of
from tests.zenoh.test_posts import trip
from vbus.board.build import build
from vbus.board.config import read_board_text
from vbus.client import connect
from vbus.client.blocking import core_of
from vbus.client.bus import Bus
from vbus.client.zenoh_link import open_zenoh
from vbus.core.errors import TransportError, VbusError
from vbus.network import envelope, keys
from vbus.network.session import Network, close_session
from vbus.serve.registry import order
from vbus.serve.server import LinkSpec, Server
from vbus.transports.zenoh_host import ZenohLink

WAYS = ("request", "reply", "both")
WRITES = 12
"""Writes of a host in one go; before and after them it asks and waits."""


@contextmanager
def bench(time: str = "lockstep", **network: Any) -> Iterator[tuple[Server, Cycles]]:
    made, cycles = board(time), Cycles()
    made.observe(cycles)
    spec = LinkSpec("zenoh:", network=Network(**network) if network else None)
    with served(made, spec) as server:
        yield server, cycles


def arm(name: str, until: str | None = "cleared", when: str | None = None, **values: Any) -> None:
    order("bench", "fault.arm", name=name, until=until, when=when, parameters=values)


def clear() -> None:
    order("bench", "fault.clear")


def work(bus: Bus) -> None:
    """Do what :func:`done` expects: alone and waited for, and many at once."""
    for number in range(3):
        bus.write(1, number)
        assert bus.echo(number) == number
    for number in range(WRITES):
        bus.write(1, 0x80 + number)
    assert bus.echo(0x55) == 0x55


def done(cycles: Cycles) -> bool:
    expected = [*range(3), *range(0x80, 0x80 + WRITES)]
    return [data for *_, write, _, data in cycles.seen if write] == expected


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("message_lost", {"every": 2}),
        ("message_lost", {"every": 3}),
        ("message_doubled", {}),
        ("message_doubled", {"every": 2}),
        ("messages_reordered", {}),
    ],
)
def test_an_unmodified_client_gets_its_cycles_once_and_in_order(
    name: str, values: dict[str, int], way: str
) -> None:
    with bench() as (_, cycles):
        arm(name, way=way, **values)
        with connect("zenoh:bench/x?patience=30", timeout=PATIENCE) as bus:
            work(bus)
            assert bus.now() == len(cycles.seen) * 10**6
        assert done(cycles)


@pytest.mark.parametrize("way", WAYS)
def test_late_messages_come_when_the_fault_ends(way: str) -> None:
    with bench() as (_, cycles), connect("zenoh:bench/x", timeout=PATIENCE) as bus:
        arm("messages_late", way=way)
        host = threading.Thread(target=work, args=(bus,))
        host.start()
        until(lambda: len(cycles.seen) == (way == "reply"), "the first cycle")
        host.join(0.7)
        assert host.is_alive()
        assert len(cycles.seen) == (way == "reply")
        clear()
        host.join(PATIENCE)
        assert not host.is_alive()
        assert done(cycles)


@pytest.mark.parametrize("name", ["message_lost", "message_doubled", "messages_reordered"])
def test_one_message_and_no_more(name: str) -> None:
    with bench() as (server, cycles), connect("zenoh:bench/x") as bus:
        for way in ("request", "reply"):
            arm(name, None, way=way)
        assert "until once: over, fired 1 times" in order("bench", "fault.list")[0]["text"]
        work(bus)
        assert done(cycles)
        traffic = server.hosts[0].transport.traffic
        assert traffic is not None
        assert not traffic.faults


@pytest.mark.parametrize(("name", "way"), [("message_lost", way) for way in WAYS])
def test_messages_that_stay_lost_are_an_error_that_says_so(name: str, way: str) -> None:
    said = (
        r'zenoh:bench/x: the board "bench" is on the network of tcp/.*, but messages to it, or its'
        r" replies, are lost: one was sent \d+ times without a reply; is a fault of its link armed"
        r" \(vbus fault list bench\)"
    )
    with bench() as (_, cycles), connect("zenoh:bench/x?patience=2") as bus:
        bus.write(1, 1)
        bus.echo()
        arm(name, way=way)
        with pytest.raises(TransportError, match=said):
            bus.read(0)
        assert len(cycles.seen) == 1 + (way == "reply")
        with pytest.raises(TransportError, match=said):
            connect("zenoh:bench/x")
        with pytest.raises(TransportError, match='has no chip "q"'):
            connect("zenoh:bench/q")
        clear()
        with connect("zenoh:bench/x") as again:
            assert again.echo(3) == 3


@pytest.mark.parametrize("name", ["message_lost", "messages_reordered"])
def test_the_last_write_before_the_end_is_not_lost(name: str) -> None:
    with bench() as (_, cycles):
        with connect("zenoh:bench/x") as bus:
            arm(name, None, way="request")
            bus.write(1, 7)
        until(lambda: cycles.seen == [("host0", "x", True, 1, 7)], "the last write")


def test_whoever_closes_is_told_if_the_last_write_may_be_lost() -> None:
    said = r"closed, and whether the last messages \(1 without a reply\) have reached the board"
    link = "zenoh:bench/x?patience=2"
    with bench() as (_, cycles):
        bus = connect(link)
        arm("message_lost", way="request")
        bus.write(1, 7)
        with pytest.raises(TransportError, match=said):
            bus.close()
        bus.close()
        clear()

        def broken() -> None:
            with connect(link) as bus:
                arm("message_lost", way="request")
                bus.write(1, 7)
                raise KeyError

        with pytest.raises(KeyError):
            broken()
        assert cycles.seen == []


def test_a_copy_that_comes_after_its_reply_was_acknowledged_ends_nothing() -> None:
    with bench() as (server, cycles):
        endpoint = endpoint_of(server.urls[0])
        host = open_zenoh(f"bench/x?connect={endpoint}")
        for number in range(4):
            trip(host, bytes([2, number]))
        other = session_at(endpoint)
        session = host._name
        refused: list[bytes] = []
        token = keys.host(BUS, envelope.public(session))
        other.declare_subscriber(
            keys.replies(token), lambda sample: refused.append(sample.attachment.to_bytes())
        )
        copy = envelope.Envelope(envelope.REQUESTS, session, 1, 1).pack()
        other.put(keys.requests(token), b"\x02\x01", attachment=copy)
        until(lambda: refused == [envelope.reply_to(1, "gone")], "the copy is refused")
        assert trip(host, b"\x02\x09") == b"E\x09"
        host.close()
        close_session(other)
        assert not cycles.seen


def test_no_message_overtakes_the_first_of_a_session() -> None:
    with bench() as (server, cycles):
        arm("messages_reordered", None, way="request")
        host = open_zenoh(f"bench/x?connect={endpoint_of(server.urls[0])}")
        assert host.write(memoryview(b"\x21\x07")) == 2
        assert host.write(memoryview(b"\x21\x08")) == 0
        until(lambda: host.read() == b"" and not host.unanswered, "the first reply")
        assert trip(host, b"\x21\x08\x02\x05"[2:]) == b"E\x05"
        host.close()
        assert [cycle[-1] for cycle in cycles.seen] == [7]


def test_a_link_that_is_cut_for_less_than_the_grace_goes_on_with_its_claim() -> None:
    link = "zenoh:bench/x?patience=60"
    with bench("realtime", grace_seconds=60.0) as (server, cycles), connect(link) as bus:
        with bus.claim():
            bus.write(1, 1)
            bus.echo()
            arm("link_cut")
            bus.write(1, 2)
            echo = threading.Thread(target=bus.echo)
            echo.start()
            echo.join(0.7)
            assert echo.is_alive()
            assert len(cycles.seen) == 1
            assert server.statistics()["links"][0]["sessions"] == 1
            clear()
            echo.join(PATIENCE)
        assert [cycle[-1] for cycle in cycles.seen] == [1, 2]


def test_hosts_that_were_cut_off_for_longer_are_gone_and_their_claims_free() -> None:
    link = "zenoh:bench/x?patience=60"
    with bench("realtime", grace_seconds=0.2) as (server, _), connect(link) as bus:
        claimed = ExitStack()
        claimed.enter_context(bus.claim())
        arm("link_cut")
        until(lambda: not server.statistics()["links"][0]["sessions"], "the host is gone")
        clear()
        with connect("zenoh:bench/x") as other, other.claim():
            other.read(0)
        with pytest.raises(TransportError, match=r"away for longer than 0.2 s; connect again"):
            bus.read(0)
        with pytest.raises(TransportError, match="connect again"):
            claimed.close()


def test_faults_of_any_link_act_on_messages() -> None:
    with bench() as (_, cycles):
        with connect("zenoh:bench/x", timeout=PATIENCE) as bus:
            arm("answer_lost", None)
            work(bus)
            assert done(cycles)
            for name, cycle_done in (("answers_late", 1), ("link_dead", 0)):
                before = len(cycles.seen)
                arm(name)
                host = threading.Thread(target=bus.read, args=(0,))
                host.start()
                until(lambda: len(cycles.seen) == before + cycle_done, "its cycle")  # noqa: B023
                host.join(0.3)
                assert host.is_alive()
                assert len(cycles.seen) == before + cycle_done
                clear()
                host.join(PATIENCE)
                assert len(cycles.seen) == before + 1
            arm("link_closed", None)
            with pytest.raises(TransportError, match=r"know the session .*: closed by a fault"):
                bus.read(0)
        with connect("zenoh:bench/x") as bus:
            bus.read(0)


def test_a_fault_that_a_link_cannot_have_is_refused_when_it_is_armed(tmp_path: Any) -> None:
    stream = LinkSpec(f"unix:{tmp_path}/host")
    with served(board(), LinkSpec("zenoh:"), stream):
        with pytest.raises(VbusError, match=r"half_answer: host0 \(zenoh:bench.* come whole"):
            arm("half_answer", "cleared")
        for name in ("message_lost", "message_doubled", "messages_reordered", "link_cut"):
            with pytest.raises(
                VbusError, match=rf"{name}: host1 \(unix:{tmp_path}/host\) is a stream of bytes"
            ):
                order("bench", "fault.arm", name=name, target="host1", when="at 100 s")
        with pytest.raises(VbusError, match=r"there is no link host2: count the \[\[hosts\]\]"):
            order("bench", "fault.arm", name="message_lost", target="host2")
        assert order("bench", "fault.list") == []


def test_a_fault_of_the_board_file_acts_from_the_beginning_and_after_a_snapshot() -> None:
    text = CHIPS.format(name="bench", time="lockstep") + (
        '[[faults]]\nfault = "message_lost"\nway = "reply"\nuntil = "cleared"\n'
    )
    link = "zenoh:bench/x"
    lost = pytest.raises(TransportError, match="messages to it, or its replies, are lost")
    with served(build(*read_board_text(text)), LinkSpec("zenoh:")):
        with lost:
            connect(link)
        saved = order("bench", "snap.save")["data"]
        clear()
        connect(link).close()
        order("bench", "snap.load", data=saved)
        with lost:
            connect(link)
        clear()
        connect(link).close()


def test_a_fault_at_a_rate_hits_one_message_each_time() -> None:
    with bench() as (server, cycles), connect("zenoh:bench/x") as bus:
        arm("message_doubled", None, "rate 1 kHz", way="request")
        bus.delay("20ms")
        work(bus)
        assert done(cycles)
        fired = order("bench", "fault.list")[0]["fired"]
        assert fired > 5
        traffic = server.hosts[0].transport.traffic
        assert traffic is not None
        assert len(traffic.faults) < fired


def toggle(bus: Bus, times: int) -> None:
    """Let x.HI rise and fall: a breakpoint at 0 that is reached, and reset."""
    for _ in range(times):
        for command, words in ((0x1C, (0x0040,)), (0x20, (0, 0)), (0x1D, (0,))):
            bus.write(0, command)
            for word in words:
                bus.wait("1ms")
                bus.writes(1, word.to_bytes(2, "big"))
            bus.wait("1ms")
            bus.delay("1ms")
        bus.echo()


def test_events_that_are_lost_are_counted_and_the_board_names_the_host(
    runtime: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A host that reads nothing loses them in Zenoh; here a cable is out for a while."""
    links = LinkSpec("zenoh:"), LinkSpec(f"unix:{runtime}/b")
    with (
        served(board(), *links) as server,
        connect(server.urls[1]) as other,
        connect("zenoh:bench/x?patience=30") as bus,
    ):
        link = core_of(bus).link
        bus.events("x.HI")
        bus.echo()
        toggle(other, 2)
        arm("link_cut")
        toggle(other, 3)
        clear()

        def told() -> bool:
            toggle(other, 1)
            while bus.next_event(0.0) is not None:
                pass
            return bool(caplog.messages)

        until(told, lambda: f"{link.lost_events} are lost; {caplog.messages}")
        host = envelope.public(link._name)
        lost = f"host {host}: {link.lost_events} messages of events were lost on the way"
        assert lost in caplog.text


def test_events_from_before_the_host_asks_for_them_come_when_it_does() -> None:
    """A host of another make may say which events it wants, and only then ask for them."""
    with (
        bench() as (server, _),
        connect("zenoh:bench/x", timeout=PATIENCE) as bus,
        connect("zenoh:bench/x", timeout=PATIENCE) as other,
    ):
        bus.echo()
        link = next(server.sessions()).link
        assert isinstance(link, ZenohLink)
        until(lambda: link._events is not None, "the host's wish for events")
        asked, link._events = link._events, None
        bus.events("x.HI")
        bus.echo()
        toggle(other, 2)
        assert bus.next_event(0.0) is None
        assert asked is not None
        server._loop.call_soon_threadsafe(link.hear, asked, 0)
        seen = [bus.next_event(PATIENCE) for _ in range(4)]
        assert len({event.instant for event in seen if event is not None}) == 4
