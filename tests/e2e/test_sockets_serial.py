"""Unix sockets, TCP and serial devices, for real."""

import errno
import os
import select
import socket
import stat
import termios
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

import vbus.transports.serial
from tests.e2e.serving import served
from tests.e2e.test_pty import read_exactly, start, toy_board, wait_for_sessions
from tests.waiting import PATIENCE
from vbus.core.errors import TransportError
from vbus.protocols.frames import frame
from vbus.serve.registry import ask, running, socket_path
from vbus.serve.server import LinkSpec, Server
from vbus.transports.base import split_url
from vbus.transports.runtime import socket_address
from vbus.transports.sockets import UnixTransport


def ask_socket(link: socket.socket, request: bytes, count: int) -> bytes:
    link.settimeout(PATIENCE)
    link.sendall(request)
    data = b""
    while len(data) < count:
        data += link.recv(count - len(data))
    return data


def test_a_unix_socket_belongs_to_its_owner_alone(runtime: Path) -> None:
    with served(toy_board(), LinkSpec("unix:$VBUS_RUNTIME/x", "byte")):
        assert stat.S_IMODE((runtime / "x").stat().st_mode) == 0o600
        with socket.socket(socket.AF_UNIX) as link:
            link.connect(str(runtime / "x"))
            assert ask_socket(link, b"\x21\x31\x11", 2) == b"D1"
    assert not (runtime / "x").exists()


def test_a_path_longer_than_a_socket_address_does_not_matter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    deep = tmp_path / ("d" * 100) / ("e" * 100)
    monkeypatch.setenv("VBUS_RUNTIME", str(deep))
    with served(toy_board(), LinkSpec("unix:$VBUS_RUNTIME/x", "byte")):
        assert [board["board"] for board in running()] == ["bench"]
        with socket.socket(socket.AF_UNIX) as link, socket_address(deep / "x") as address:
            link.connect(address)
            assert ask_socket(link, b"\x02\x01", 2) == b"E\x01"
    assert not (deep / "x").exists()


def test_a_unix_socket_has_its_name_when_it_listens(
    runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []
    listen = UnixTransport._listen

    def listening(self: UnixTransport, *args: Any) -> None:
        seen.append((runtime / "x").exists())
        listen(self, *args)

    monkeypatch.setattr(UnixTransport, "_listen", listening)
    with served(toy_board(), LinkSpec("unix:$VBUS_RUNTIME/x", "byte")):
        assert seen
        assert not any(seen)
        assert (runtime / "x").is_socket()
    assert [path.name for path in runtime.iterdir() if path.name.startswith(".x")] == []


def test_tcp_listens_on_loopback_unless_told_otherwise() -> None:
    with served(toy_board(), LinkSpec("tcp:0", "byte")) as server:
        scheme, host, port = server.urls[0].split(":")
        assert (scheme, host) == ("tcp", "127.0.0.1")
        with socket.create_connection((host, int(port))) as link:
            assert ask_socket(link, b"\x02\x41", 2) == b"EA"


def test_several_clients_of_one_socket_have_each_a_session_of_their_own() -> None:
    with served(toy_board(), LinkSpec("tcp:0", "byte")) as server:
        port = int(server.urls[0].rpartition(":")[2])
        with (
            socket.create_connection(("127.0.0.1", port)) as one,
            socket.create_connection(("127.0.0.1", port)) as two,
        ):
            assert ask_socket(one, b"\xfe", 4) == b"X\x01\x00\x00"
            assert ask_socket(two, b"\x02\x01", 2) == b"E\x01"
            assert ask_socket(one, b"\x02", 4) == b"X\x01\x00\x00"


def test_a_claim_makes_the_other_session_wait_for_its_turn() -> None:
    with served(toy_board(), LinkSpec("tcp:0", "byte")) as server:
        port = int(server.urls[0].rpartition(":")[2])
        with (
            socket.create_connection(("127.0.0.1", port)) as one,
            socket.create_connection(("127.0.0.1", port)) as two,
        ):
            assert ask_socket(one, b"\x04\x21\x05", 2) == b"C\x01"
            two.sendall(b"\x11\x02\x22")
            assert ask_socket(one, b"\x02\x11", 2) == b"E\x11"
            assert select.select([two], [], [], 0.05)[0] == []

            assert ask_socket(one, b"\x21\x07\x05\x02\x12", 2) == b"E\x12"
            assert ask_socket(two, b"", 4) == b"D\x07E\x22"


def test_a_host_that_lets_a_century_pass_does_not_keep_another_one_waiting() -> None:
    with served(toy_board(), LinkSpec("tcp:0", "byte")) as server:
        port = int(server.urls[0].rpartition(":")[2])
        with (
            socket.create_connection(("127.0.0.1", port)) as one,
            socket.create_connection(("127.0.0.1", port)) as two,
        ):
            one.sendall(b"\x50" + (10**18).to_bytes(8, "big") + b"\x02\x01")
            assert ask_socket(two, b"\x02\x22", 2) == b"E\x22"


def test_a_port_in_use_is_a_clear_error() -> None:
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        port = holder.getsockname()[1]
        refused = rf"^tcp:{port}: Address already in use; stop the program that has it, or choose"
        with pytest.raises(TransportError, match=refused):
            start(Server(toy_board(), [LinkSpec(f"tcp:{port}", "byte")]))


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("tcp:", r'^"tcp:": write "tcp:PORT" or "tcp:HOST:PORT" with a port of 0 to 65535$'),
        ("tcp:x:99999", r'^"tcp:x:99999": write "tcp:PORT"'),
        ("unix:", r'^"unix:" needs a path'),
        ("pty:", r'^"pty:" needs a path'),
        ("nothing", r'^"nothing" is no link: write SCHEME:ADDRESS'),
        ("pty:$NO_SUCH_VARIABLE/x", r"an environment variable in it is not set"),
        ("serial:/dev/no-such-device", r"^serial:/dev/no-such-device\?baud=115200: .*No such file"),
        ("serial:/dev/null?speed=9600", r"unknown option 'speed'; known: baud$"),
        ("serial:/dev/null?baud=fast", r"baud='fast' is not a speed, e\.g\. baud=115200$"),
    ],
)
def test_a_wrong_address_says_what_is_wrong(url: str, message: str) -> None:
    with pytest.raises(TransportError, match=message):
        start(Server(toy_board(), [LinkSpec(url, "byte")]))


@pytest.mark.parametrize("scheme", ["tcp", "rfc2217"])
def test_other_computers_are_let_in_only_where_that_is_meant(
    scheme: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WHERE", "0.0.0.0")
    link = LinkSpec(f"{scheme}:$WHERE:0", "byte")
    with pytest.raises(TransportError, match=rf'^"{scheme}:0\.0\.0\.0:0" lets other computers in'):
        start(Server(toy_board(), [link]))
    with served(toy_board(), replace(link, remote=True)) as server:
        assert server.urls[0].startswith(f"{scheme}:0.0.0.0:")


def test_options_stand_behind_a_question_mark() -> None:
    assert split_url("serial:/dev/ttyUSB0?baud=9600") == (
        "serial",
        "/dev/ttyUSB0",
        {"baud": "9600"},
    )


def test_a_board_tells_what_it_is_and_what_was_done_on_it() -> None:
    with served(toy_board(), LinkSpec("tcp:0", "byte")) as server:
        port = int(server.urls[0].rpartition(":")[2])
        with socket.create_connection(("127.0.0.1", port)) as link:
            ask_socket(link, b"\x21\x05\x11", 2)
            status = ask(socket_path("bench"))
        assert status["pid"] == os.getpid()
        assert status["policy"] == "lockstep"
        assert status["time_ps"] == 2_000_000
        assert status["chips"] == [
            {
                "name": "t",
                "part": "TOY",
                "family": "toy",
                "bus_settings": {},
                "clock_hz": 8_000_000,
                "reads": 1,
                "writes": 1,
            }
        ]
        assert status["counters"] == {"reads": 1, "writes": 1, "violations": 0}
        assert status["links"][0]["received"] == 3
        assert [board["board"] for board in running()] == ["bench"]
    assert list(running()) == []


class Cable:
    """A serial cable to a device name that can be pulled out and plugged in."""

    def __init__(self, name: Path) -> None:
        self.name = name
        self.plug()

    def plug(self) -> None:
        self.host, device = os.openpty()
        os.set_blocking(self.host, True)
        self.name.symlink_to(os.ttyname(device))
        self._device = device

    def unplug(self) -> None:
        self.name.unlink()
        os.close(self._device)
        os.close(self.host)


def test_a_real_serial_device_is_a_host_and_may_be_unplugged_and_plugged_in_again(
    tmp_path: Path,
) -> None:
    cable = Cable(tmp_path / "ttyUSB0")
    link = LinkSpec(f"serial:{tmp_path}/ttyUSB0?baud=115200")
    answer = frame(0, b"E\x42")
    with served(toy_board(), link) as server:
        said: list[str] = []
        server.hosts[0].transport.report = said.append
        os.write(cable.host, frame(0, b"\x02\x42"))
        assert read_exactly(cable.host, len(answer)) == answer

        cable.unplug()
        wait_for_sessions(server, 0)
        assert ask(socket_path("bench"))["links"][0]["state"] == "unplugged"

        cable.plug()
        wait_for_sessions(server, 1)
        os.write(cable.host, frame(0, b"\x02\x42"))
        assert read_exactly(cable.host, len(answer)) == answer
        assert [sentence.partition("ttyUSB0 ")[2] for sentence in said] == [
            "was unplugged; waiting for it",
            "is back",
        ]
    cable.unplug()


def test_a_device_that_is_pulled_out_while_it_is_opened_is_looked_for_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cable = Cable(tmp_path / "ttyUSB0")
    monkeypatch.setattr("vbus.transports.serial.RETRY_SECONDS", 0.01)
    prepare = vbus.transports.serial._prepare
    tries: list[int] = []

    def interrupted(fd: int) -> None:
        tries.append(fd)
        if len(tries) in (2, 3):
            raise termios.error(errno.EIO, "Input/output error")
        prepare(fd)

    monkeypatch.setattr("vbus.transports.serial._prepare", interrupted)
    with served(toy_board(), LinkSpec(f"serial:{tmp_path}/ttyUSB0")) as server:
        cable.unplug()
        wait_for_sessions(server, 0)
        cable.plug()
        wait_for_sessions(server, 1)
        answer = frame(0, b"E\x42")
        os.write(cable.host, frame(0, b"\x02\x42"))
        assert read_exactly(cable.host, len(answer)) == answer
    assert len(tries) == 4
    cable.unplug()
