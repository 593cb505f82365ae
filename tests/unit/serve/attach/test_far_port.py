"""A wire format carried out far from its board gives what it gives beside it."""

import pytest

from tests.unit.fake_port import FakePort
from vbus.protocols import codes
from vbus.protocols.base import Protocol
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.framed import FramedProtocol
from vbus.protocols.frames import FrameReader, frame
from vbus.protocols.port import PortError
from vbus.protocols.requests import REQUESTS
from vbus.protocols.text import TextProtocol
from vbus.serve.attach.far_port import FarPort
from vbus.serve.attach.meter import Meter, Trips
from vbus.serve.attach.upstream import Upstream


class Way(Upstream):
    """The way to a board in this process: bytes stay on it until :meth:`carry`."""

    def __init__(self, board: FakePort) -> None:
        self.meter = Meter(Trips())
        self.board = ByteProtocol(board)
        self.port: FarPort | None = None
        self.sent = bytearray()
        self.finished: list[bool] = []
        self.left = 0

    @property
    def full(self) -> bool:
        return False

    def send(self, data: bytes) -> None:
        self.sent += data

    def finish(self, waits: bool) -> None:
        self.finished.append(waits)

    def leave(self) -> None:
        self.left += 1

    def carry(self, step: int = 1000) -> None:
        """Carry everything there and back, so many bytes at a time, until nothing moves."""
        assert self.port is not None
        self.board.report_events()
        while self.sent or self.board.out:
            data = bytes(self.sent)
            self.sent.clear()
            self.board.receive(data)
            answer = self.board.take()
            for start in range(0, len(answer), step):
                self.port.take(answer[start : start + step])


class Host:
    """A host on a protocol here, whose board is elsewhere."""

    def __init__(self, kind: type[Protocol], step: int = 1000) -> None:
        self.board = FakePort()
        self.way = Way(self.board)
        self.port = self.way.port = FarPort(self.way)
        self.protocol = kind(self.port)
        self.port.on_answer = self._resume
        self.port.on_edges = self.protocol.report_events
        self.step = step

    def _resume(self) -> None:
        if self.port.go_on():
            self.protocol.resume()

    def ask(self, data: bytes) -> bytes:
        self.protocol.receive(data)
        self.way.carry(self.step)
        assert not self.port.held
        return self.protocol.take()

    @property
    def calls(self) -> list[tuple[object, ...]]:
        return [call for call in self.board.calls if call != ("sync",)]


TEXT = (
    b"r 0\nr 1 5\nw 0 1 2 3\nr ee\nw ee 1\nselect y\nr 2\nselect x y\nclaim\nunclaim\nselect z\n"
    b"wait 20us\nstep 5us\nnow\nstep 1ms\nnow\nnow\nclock_step 500\npin x./RST 1\npin y.HI\n"
    b"lines x./CS=0 /RD=1\ndrive 7f\nrelease\nsample\nchips\nnames\nhelp r\nr 3\n"
)


@pytest.mark.parametrize("step", [1, 1000])
def test_text_says_the_same(step: int) -> None:
    board = FakePort()
    local = TextProtocol(board)
    local.receive(TEXT)
    wanted = local.take().splitlines()
    far = Host(TextProtocol, step)
    found = far.ask(TEXT).splitlines()
    refused = b"error: refused by the board: no such line, pin, chip or address"
    assert [one for one in found if one == refused] == [refused] * 2  # r ee and w ee
    assert [one for one in found if one != refused] == [
        one for one in wanted if b"nobody is there" not in one
    ]
    assert far.calls == [call for call in board.calls if call != ("sync",)]


def request(name: str, *values: int | bytes) -> bytes:
    return REQUESTS[name].pack(*values)


FRAMES = (
    b"",
    b"\x10\x11\x21\x05" + request("ECHO", 7),
    request("READS", 1, 4) + request("WRITES", 2, b"\x01\x02"),
    request("EVENTS", 1) + b"\x20\x01" + b"\x20\x02" + b"\x10",
    request("DELAY", 5_000_000) + request("NOW") + request("SYNC"),
    request("AT", 100_000_000) + request("NOW"),
    request("AT", 1) + request("ECHO", 1),
    request("WAIT", 30_000_000) + request("PASS", 12_000_000),
    request("SELECT", 9) + request("ECHO", 2),
    request("SELECT", 2) + request("CLAIM") + b"\x10" + request("UNCLAIM"),
    request("READ", 0xEE) + request("WRITE", 0xEE, 1) + request("ECHO", 3),
    request("PIN", 3, 1) + request("PIN", 200, 1) + request("GETPIN", 3) + request("GETPIN", 9),
    request("LINES", 3, 1) + request("DRIVE", 5) + request("SAMPLE") + request("RELEASE"),
    b"\xff\x10",
    request("ECHO", 4),
    request("HELLO", 1),
)


@pytest.mark.parametrize("step", [1, 1000])
def test_framed_says_the_same(step: int) -> None:
    board = FakePort()
    local = FramedProtocol(board)
    far = Host(FramedProtocol, step)
    far.way.carry()
    for number, payload in enumerate(FRAMES):
        sent = frame(number, payload)
        local.receive(sent)
        assert far.ask(sent) == local.take(), payload.hex()
        assert far.ask(sent) == (local.receive(sent), local.take())[1]  # type: ignore[func-returns-value]


def test_time_and_lines_are_asked_for_each_time() -> None:
    far = Host(TextProtocol)
    assert far.ask(b"step 5us\nnow\n") == b"5us\n5us\n"
    far.board.time += 1_000_000
    assert far.ask(b"now\n") == b"6us\n"
    framed = Host(FramedProtocol)
    framed.ask(frame(0, b""))
    assert framed.ask(frame(1, request("SYNC")))[4:8] == b"\0\0\0\0"
    framed.board.edge(3)
    assert framed.ask(frame(2, request("SYNC")))[4:8] == b"\0\0\0\3"


def test_an_edge_between_requests_is_reported() -> None:
    far = Host(FramedProtocol)
    far.ask(frame(0, b"") + frame(1, request("EVENTS", 1)))
    far.board.edge(3)
    far.way.carry()
    reader = FrameReader()
    reader.feed(far.protocol.take())
    sequence, payload = reader.next() or (0, b"")
    assert sequence & 0x80
    assert payload[:5] == b"I\x00\x00\x00\x03"


def test_what_was_promised_for_nothing_is_refused() -> None:
    far = Host(FramedProtocol)
    reader = FrameReader()
    reader.feed(far.ask(frame(0, b"") + frame(1, request("LEASES", 1) + b"\x10")))
    assert [payload[:1] for _, payload in iter(reader.next, None)] == [b"", b"D"]
    assert far.ask(frame(2, request("POLLED", 0, 3)))[3:5] == bytes((ord("X"), codes.NO_SUCH))


def test_what_a_host_sent_before_it_went_is_carried_out() -> None:
    far = Host(TextProtocol)
    far.protocol.receive(b"w 1 5\nstep 1ms\nw 1 6\nw 1 7")
    assert far.port.held
    far.port.depart(far.protocol)
    assert (far.way.left, far.way.finished) == (1, [])
    far.way.carry()
    assert [call for call in far.calls if call[0] == "write"] == [("write", 1, 5), ("write", 1, 6)]
    assert far.way.finished == [False]


def test_a_cards_addresses_are_refused_in_words() -> None:
    assert b"FAIL a card's addresses are decoded by the board's own links" in Host(
        TextProtocol
    ).ask(b"inb 0x340\n")


def test_a_pin_without_its_chip_is_that_of_the_selected_one() -> None:
    far = Host(TextProtocol)
    far.ask(b"names\nselect y\n")
    assert far.port.pin_number("/RST") == far.port.pin_number("y./RST")
    far.ask(b"select x y\n")
    with pytest.raises(PortError, match=r"'/RST' is a pin of several chips; there are x\./RST, x"):
        far.port.pin_number("/RST")
    with pytest.raises(PortError, match=r"no pin '/RESET'; there are x\./RST"):
        far.port.pin_number("/RESET")
