"""A board that is paused for longer than its hosts wait: who is told of it, and who is not."""

import asyncio
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.boards import AXIS
from tests.e2e.attaching import attached
from tests.e2e.command import running
from tests.unit.native.conftest import exercise as exercise
from tests.waiting import Starved
from vbus import connect
from vbus.client.aio import connect as connect_aio
from vbus.core.errors import TransportError
from vbus.protocols.requests import REQUESTS
from vbus.serve.registry import ask, order, socket_path

LINKS = """\
[[hosts]]
transport = "tcp:127.0.0.1:0"
[[hosts]]
transport = "unix:$VBUS_RUNTIME/x"
"""
SECONDS = 0.5
"""What a reply may take; the board is paused three times as long."""


@pytest.fixture
def links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, str]]:
    """The board in a process of its own; its links by kind."""
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    (tmp_path / "bench.toml").write_text(AXIS.format(time="lockstep", model="dc_motor") + LINKS)
    with running(tmp_path / "bench.toml"):
        urls = [link["url"] for link in ask(socket_path("bench"))["links"]]
        yield {url.partition(":")[0]: url for url in urls}


class Host(threading.Thread):
    """A host in a thread: what it returned or raised."""

    def __init__(self, run: Callable[[], object]) -> None:
        super().__init__()
        self.outcome: list[object] = []
        self._run_it = run
        self.start()

    def run(self) -> None:
        try:
            self.outcome.append(self._run_it())
        except TransportError as error:
            self.outcome.append(str(error))

    def waits(self) -> bool:
        """Whether it waits for longer than a reply may take."""
        self.join(3 * SECONDS)
        self._see_no_error()
        return self.is_alive()

    def end(self) -> list[object]:
        self.join(60)
        self._see_no_error()
        return self.outcome

    def error(self) -> object:
        self.join(60)
        return self.outcome[0]

    def _see_no_error(self) -> None:
        # A board that has no turn for as long as a reply may take is silent, as it is to be here.
        if self.outcome and isinstance(self.outcome[0], str):
            raise Starved(self.outcome[0])


def read_status(where: str) -> int:
    with connect(where, timeout=SECONDS) as bus:
        return bus.chip("x").read(0)


def read_status_aio(where: str) -> int:
    async def run() -> int:
        bus = await connect_aio(where, timeout=SECONDS)
        try:
            return await bus.chip("x").read(0)
        finally:
            await bus.close()

    return asyncio.run(run())


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["tcp", "unix"])
@pytest.mark.parametrize("read", [read_status, read_status_aio])
def test_a_client_that_comes_while_the_board_is_paused_waits_as_long_as_that_lasts(
    links: dict[str, str], kind: str, read: Callable[[str], int]
) -> None:
    order("bench", "pause")
    host = Host(lambda: read(links[kind]))
    assert (host.waits(), host.outcome) == (True, [])
    order("bench", "go")
    assert host.end() == [0x84]


@pytest.mark.slow
def test_a_client_over_tcp_waits_out_pauses_and_steps_and_knows_a_silent_board_again(
    links: dict[str, str],
) -> None:
    with connect(links["tcp"]) as bus:
        bus.timeout = SECONDS
        for _ in range(2):
            order("bench", "pause")
            host = Host(lambda: bus.read(0))
            assert (host.waits(), host.outcome) == (True, [])
            order("bench", "step", by="cycle")
            assert host.end() == [0x84]
            host = Host(lambda: bus.read(0))
            assert host.waits(), "paused again after the step"
            order("bench", "go")
            assert host.end() == [0x84]
        bus.timeout = 60.0
        with connect(links["unix"]) as other, other.claim():
            bus.timeout = SECONDS
            host = Host(lambda: bus.chip("x").read(0))
            assert f"no reply to READ4 within {SECONDS:g} s" in str(host.error())


@pytest.mark.slow
def test_who_says_no_hello_over_tcp_hears_nothing_of_a_pause(links: dict[str, str]) -> None:
    port = int(links["tcp"].rpartition(":")[2])
    order("bench", "pause")
    with (
        socket.create_connection(("127.0.0.1", port), timeout=60) as first,
        socket.create_connection(("127.0.0.1", port), timeout=60) as second,
    ):
        first.sendall(REQUESTS["ECHO"].pack(9))
        second.sendall(REQUESTS["HELLO"].pack(1) + REQUESTS["ECHO"].pack(9))
        assert second.recv(100) == b"H\x01"
        order("bench", "go")
        assert replies(first, 1) == [b"E\x09"]
        assert replies(second, 3) == [b"E\x09", b"H\x00", b"V"]
        order("bench", "pause")
        assert second.recv(100) == b"H\x01"
        first.setblocking(False)
        with pytest.raises(BlockingIOError):
            first.recv(100)


def replies(host: socket.socket, count: int) -> list[bytes]:
    """Return so many replies in the order of their tags, HELLO's without what it tells."""
    with host.makefile("rb", buffering=0) as stream:

        def take(size: int) -> bytes:
            data = b""
            while len(data) < size:
                data += stream.read(size - len(data)) or b""
            return data

        found = []
        for _ in range(count):
            tag = take(1)
            if tag == b"V":
                take(int.from_bytes(take(2), "big"))
                found.append(tag)
            else:
                found.append(tag + take(1))
    return sorted(found)


@pytest.mark.slow
def test_a_program_in_c_over_tcp_waits_once_it_has_said_hello(
    links: dict[str, str], exercise: Path
) -> None:
    calls = ["timeout", f"{int(1000 * SECONDS):x}", "hello", "pause", "read", "0", "read", "0"]
    with subprocess.Popen(
        [str(exercise), links["tcp"], *calls],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as host:  # fmt: skip
        assert host.stdin is not None
        assert host.stdout is not None
        lines = [host.stdout.readline() for _ in range(2)]
        assert lines[-1].startswith("hello")
        order("bench", "pause")
        host.stdin.write("\n")
        host.stdin.flush()
        with suppress(subprocess.TimeoutExpired):
            host.wait(3 * SECONDS)
            raise Starved(host.stdout.read())
        order("bench", "go")
        assert host.stdout.read().splitlines() == ["pause a", "read 84", "read 84"]


@pytest.mark.slow
def test_a_client_of_an_attachment_over_tcp_is_told_too(links: dict[str, str]) -> None:
    near = "pty:$VBUS_RUNTIME/near-x"
    with attached(links["tcp"], near), connect(near) as bus:
        bus.timeout = SECONDS
        order("bench", "pause")
        host = Host(lambda: bus.read(0))
        assert (host.waits(), host.outcome) == (True, [])
        order("bench", "go")
        assert host.end() == [0x84]
