"""What breaks on a network: clear errors, nothing hangs, nothing is executed twice."""

import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from tests.e2e.serving import served
from tests.waiting import PATIENCE, until
from tests.zenoh.processes import Processes, connected_to, session_at
from tests.zenoh.test_bus import Cycles, board
from vbus.client import connect
from vbus.core.errors import TransportError
from vbus.network import envelope, keys
from vbus.network.session import Network, close_session
from vbus.serve.server import LinkSpec

BUS = keys.bus("bench", "x")


class Raw:
    """A host that speaks Zenoh by itself."""

    def __init__(self, endpoint: str) -> None:
        self.session = session_at(endpoint)
        self.name = envelope.new_session()
        token = keys.host(BUS, envelope.public(self.name))
        self.token = self.session.liveliness().declare_token(token)

    def ask(
        self, data: bytes, number: int, acknowledged: int = 0, cover: bytes | None = None
    ) -> list[bytes]:
        if cover is None:
            cover = envelope.Envelope(envelope.REQUESTS, self.name, number, acknowledged).pack()
        replies = self.session.get(BUS, payload=data, attachment=cover, timeout=PATIENCE)
        answers = []
        for reply in replies:
            found = reply.ok or reply.err
            assert found is not None
            answers.append(found.payload.to_bytes())
        return answers

    def close(self) -> None:
        close_session(self.session)


def endpoint_of(url: str) -> str:
    return url.partition("connect=")[2]


def test_a_message_that_is_repeated_gets_the_stored_reply_and_is_not_carried_out_again() -> None:
    made = board()
    cycles = Cycles()
    made.observe(cycles)
    with served(made, LinkSpec("zenoh:")) as server:
        host = Raw(endpoint_of(server.urls[0]))
        assert host.ask(b"\x21\x55\x10\x02\x01", 0) == [b"D\x86E\x01"]
        assert host.ask(b"\x21\x55\x10\x02\x01", 0) == [b"D\x86E\x01"]
        assert host.ask(b"\x02\x02", 1) == [b"E\x02"]
        assert host.ask(b"\x21\x55\x10\x02\x01", 0) == [b"D\x86E\x01"]
        assert host.ask(b"\x02\x03", 2, acknowledged=2) == [b"E\x03"]
        [refused] = host.ask(b"\x21\x55\x10\x02\x01", 0)
        assert refused.startswith(b"gone message 0 has been carried out")
        host.close()

    assert cycles.seen == [("host0", "x", True, 1, 0x55), ("host0", "x", False, 0, 0x86)]


def test_the_first_message_that_comes_again_after_the_end_begins_no_new_session() -> None:
    made = board()
    cycles = Cycles()
    made.observe(cycles)
    with served(made, LinkSpec("zenoh:")) as server:
        host = Raw(endpoint_of(server.urls[0]))
        assert host.ask(b"\x21\x55\x02\x01", 0) == [b"E\x01"]
        end = envelope.Envelope(envelope.END, host.name, 1, 1).pack()
        assert host.ask(b"", 1, cover=end) == [b""]
        [refused] = host.ask(b"\x21\x55\x02\x01", 0)
        assert refused.startswith(b"gone the board does not know the session (any more)")
        host.close()
    assert len(cycles.seen) == 1


def test_messages_that_overtake_each_other_are_carried_out_in_order() -> None:
    made = board()
    cycles = Cycles()
    made.observe(cycles)
    with served(made, LinkSpec("zenoh:")) as server:
        host = Raw(endpoint_of(server.urls[0]))
        answers: dict[int, list[bytes]] = {}
        host.ask(b"", 0)

        def ask(number: int) -> None:
            answers[number] = host.ask(bytes([0x21, number, 2, number]), number)

        threads = [threading.Thread(target=ask, args=(number,)) for number in (3, 2, 1)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(PATIENCE)
        host.close()

    assert [data for *_, data in cycles.seen] == [1, 2, 3]
    assert answers == {number: [bytes([ord("E"), number])] for number in (1, 2, 3)}


def test_malformed_and_oversized_messages_are_refused_and_the_board_goes_on() -> None:
    with served(board(), LinkSpec("zenoh:")) as server:
        endpoint = endpoint_of(server.urls[0])
        host = Raw(endpoint)
        good = envelope.Envelope(envelope.REQUESTS, host.name, 0, 0).pack()
        for cover, said in (
            (b"", b"malformed the attachment has 0 bytes, an envelope 34"),
            (b"\x02" + good[1:], b"malformed the envelope is of version 2; spoken here is 1"),
            (b"\x01\x07" + good[2:], b"malformed kind 7 is unknown"),
            (good[:-1], b"malformed the attachment has 33 bytes"),
        ):
            [refused] = host.ask(b"\x10", 0, cover=cover)
            assert refused.startswith(said)
        [refused] = host.ask(b"\x10", 5)
        assert refused.startswith(b"gone the board does not know the session")
        [refused] = host.ask(bytes(envelope.LARGEST + 1), 0)
        assert refused == (
            b"too-large the message has 65537 bytes; at most 65536 are carried out, so send several"
        )
        [refused] = host.ask(bytes(100_000_000), 0)
        assert refused.startswith(b"too-large the message has 100000000 bytes")
        assert host.ask(b"\xff\x10", 0) == [b"X\x01\x00\x00" * 2]
        [refused] = host.ask(b"\x10", 1 + envelope.WINDOW)
        assert b"too far ahead" in refused
        host.close()

        with connect("zenoh:bench/x") as bus:
            assert bus.read(0) == 0x84


def test_a_host_killed_in_a_packet_frees_its_claim(tmp_path: Path) -> None:
    script = tmp_path / "host.py"
    script.write_text(
        "import os, signal\n"
        "from vbus.client import connect\n"
        "bus = connect('zenoh:bench/x')\n"
        "with bus.claim():\n"
        "    bus.write(0, 0x1F)\n"
        "    bus.echo()\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    spec = LinkSpec("zenoh:", network=Network(grace_seconds=0.5))
    with served(board("realtime"), spec) as server:
        killed = subprocess.run([sys.executable, str(script)], timeout=PATIENCE)
        assert killed.returncode == -signal.SIGKILL
        with connect("zenoh:bench/x") as bus, bus.claim():
            assert bus.read(0) is not None
        until(
            lambda: server.statistics()["links"][0]["sessions"] == 0, "the session of the dead host"
        )


def test_a_host_without_a_liveliness_token_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vbus.transports.zenoh.TOKEN_SECONDS", 0.3)
    with served(board(), LinkSpec("zenoh:")) as server:
        host = Raw(endpoint_of(server.urls[0]))
        host.token.undeclare()
        host.name = envelope.new_session()
        assert host.ask(b"\x02\x01", 0) == [b"E\x01"]
        gone = (b"gone the session is over: its live", b"gone the board does not know")
        until(
            lambda: any(answer.startswith(gone) for answer in host.ask(b"\x02\x01", 1)),
            "the board misses the token",
        )
        host.close()


def test_a_board_killed_in_a_packet_is_named(
    processes: Processes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vbus.client.zenoh_link.RECOVERY_SECONDS", 0.5)
    _, endpoint = processes.router()
    first = processes.board("bench", connected_to(endpoint))
    link = f"zenoh:bench/x?connect={endpoint}"
    with connect(link) as bus:
        bus.write(0, 0x1F)
        bus.writes(1, b"\0")
        bus.echo()
        first.stop(signal.SIGKILL)
        bus.writes(1, b"\0")
        with pytest.raises(TransportError, match=f'no board called "bench" is on .*{endpoint}'):
            bus.echo()


def test_a_board_started_anew_does_not_go_on_with_the_packet_of_the_old_one(
    processes: Processes,
) -> None:
    _, endpoint = processes.router()
    first = processes.board("bench", connected_to(endpoint))
    link = f"zenoh:bench/x?connect={endpoint}"
    with connect(link) as bus:
        bus.write(0, 0x1F)
        bus.echo()
        first.stop(signal.SIGKILL)
        processes.board("bench", connected_to(endpoint))
        with pytest.raises(TransportError, match=r"refused by the board: .*connect again"):
            bus.echo()
        with connect(link) as again:
            assert again.read(0) == 0x84


def test_a_session_outlives_its_router(processes: Processes) -> None:
    router, endpoint = processes.router()
    # However long the next router takes to start.
    processes.board("bench", connected_to(endpoint, 'grace = "60 s"'))
    with connect(f"zenoh:bench/x?connect={endpoint}&patience=60") as bus:
        bus.write(0, 0x1F)
        bus.echo()
        number = bus.now()
        router.stop(signal.SIGKILL)
        restarted = threading.Thread(target=processes.router, args=(endpoint,))
        restarted.start()
        # One cycle more has happened since, not two: the message was repeated, not carried out
        # again.
        bus.write(1, 0)
        assert bus.now() - number == 10**6
        restarted.join(PATIENCE)


def test_a_router_that_stays_away_is_named(
    processes: Processes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vbus.client.zenoh_link.RECOVERY_SECONDS", 0.5)
    router, endpoint = processes.router()
    processes.board("bench", connected_to(endpoint))
    with connect(f"zenoh:bench/x?connect={endpoint}") as bus:
        router.stop(signal.SIGKILL)
        with pytest.raises(TransportError, match=f"the link to {endpoint} is lost"):
            bus.read(0)


def test_an_exception_in_a_callback_is_logged_and_the_host_is_told(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise RuntimeError("a fault for this test")

    with served(board(), LinkSpec("zenoh:")) as server:
        host = Raw(endpoint_of(server.urls[0]))
        with monkeypatch.context() as patched:
            patched.setattr("vbus.network.envelope.unpack", broken)
            [refused] = host.ask(b"\x10", 0)
        assert refused.startswith(b"broken internal error of the board")
        assert "a fault for this test" in caplog.text
        assert host.ask(b"\x10", 0) == [b"D\x84"]
        host.close()


def test_an_error_inside_the_board_ends_that_session_and_the_host_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def broken(*_: object) -> None:
        raise RuntimeError("a fault for this test")

    with (
        served(board(), LinkSpec("zenoh:")),
        connect("zenoh:bench/x") as bus,
        connect("zenoh:bench/y") as other,
    ):
        with monkeypatch.context() as patched:
            patched.setattr("vbus.serve.time.pacer.WallClockPacer.catch_up", broken)
            with pytest.raises(TransportError, match=r"the session is over: internal error"):
                bus.read(0)
        assert other.read(0) == 0x84


def test_two_boards_that_meet_late_are_reported() -> None:
    said: list[str] = []
    with served(board(), LinkSpec("zenoh:")) as server:
        server.hosts[0].transport.report = said.append
        other = session_at(endpoint_of(server.urls[0]))
        token = keys.owner("bench", str(other.zid()))
        kept = other.liveliness().declare_token(token)
        until(lambda: said, "a report of the other board")
        assert f"another board of this name has appeared on the network ({token})" in said[0]
        kept.undeclare()
        close_session(other)
