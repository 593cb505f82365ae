"""The blocking client over real links, against the byte protocol on a fake port."""

import json
import os
import socket
import threading
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.unit.client.served import Served
from tests.waiting import until
from vbus.client import Bus, Event, Ready, Sample, connect, demo
from vbus.client.blocking import BlockingWaits
from vbus.client.link import starting
from vbus.core.errors import ProtocolError, TransportError
from vbus.core.kernel import US


def test_a_session_over_every_kind_of_link(served: Served) -> None:
    with connect(served.where) as bus:
        assert bus.info.board == "bench"
        bus.write(0, 0x1E)
        assert bus.wait("100us") == Ready(True, 16 * US)
        assert bus.read(0) == 1
        assert bus.reads(1, 3) == b"\x13\x14\x15"
        bus.writes(1, b"\x00\x0a")
        assert bus.sample() == Sample(0x84, 1)
        assert bus.echo(3) == 3
    assert served.port.calls[-3:] == [("write", 1, 0), ("write", 1, 10), ("sample",)]


def test_a_time_without_a_unit_is_refused_before_anything_is_sent(
    bus: Bus, pty_served: Served
) -> None:
    calls = len(pty_served.port.calls)
    for ask in (bus.wait, bus.delay, bus.at):
        with pytest.raises(TypeError, match=r"0\.1 is no time"):
            ask(0.1)  # type: ignore[arg-type]
    bus.read(0)
    assert pty_served.port.calls[calls:] == [("read", 0)]


def test_all_256_values_pass_a_pty_unchanged(bus: Bus, pty_served: Served) -> None:
    everything = bytes(range(256))
    bus.writes(1, everything[:255])
    bus.write(1, 255)
    pty_served.port.answers[1] = list(everything)
    assert bus.reads(1, 255) + bytes([bus.read(1)]) == everything
    assert [call[2] for call in pty_served.port.calls if call[0] == "write"] == list(everything)


def test_a_terminal_that_echoes_and_eats_bytes_is_made_raw(pty_served: Served) -> None:
    pty_served.cook()
    pty_served.port.answers[1] = [0x03, 0x04, 0x0A, 0x0D, 0x11, 0x13, 0x1A, 0x1C, 0x7F, 0xFF]
    with connect(pty_served.where) as bus:
        assert bus.reads(1, 10).hex() == "03040a0d11131a1c7fff"
        bus.writes(1, bytes.fromhex("03040a0d11131a1c7fff"))
        bus.echo()
    written = [call[2] for call in pty_served.port.calls if call[0] == "write"]
    assert bytes(written).hex() == "03040a0d11131a1c7fff"  # type: ignore[arg-type]


def test_the_path_of_a_pty_is_enough(pty_served: Served) -> None:
    with connect(pty_served.where.removeprefix("pty:")) as bus:
        assert bus.echo(9) == 9


def test_a_serial_device_is_opened_with_its_baud_rate(pty_served: Served) -> None:
    with connect(pty_served.where.replace("pty:", "serial:") + "?baud=57600") as bus:
        assert bus.echo(9) == 9


def test_an_environment_variable_stands_in_a_link(
    pty_served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BENCH", pty_served.where.removeprefix("pty:"))
    with connect("pty:$BENCH") as bus:
        assert bus.echo(9) == 9


def test_a_batch_travels_in_one_message(bus: Bus, pty_served: Served) -> None:
    pty_served.messages.clear()
    with bus.batch() as batch:
        batch.write(0, 0x0A)
        wait = batch.wait("1ms")
        words = [batch.reads(1, 2) for _ in range(2)]
        batch.pin("x./RST", 1)
    assert len(pty_served.messages) == 1
    assert wait.value.ready
    assert [word.value for word in words] == [b"\x12\x13", b"\x14\x15"]


def test_a_batch_that_fails_sends_nothing(bus: Bus, pty_served: Served) -> None:
    def fail() -> None:
        with bus.batch() as batch:
            batch.write(0, 1)
            batch.write(0, 999)

    with pytest.raises(ValueError, match=r"^d = 999: "):
        fail()
    bus.echo()
    assert pty_served.port.calls == []


def test_chips_are_selected_only_when_another_one_was(bus: Bus, pty_served: Served) -> None:
    x, y, both = bus.chip("x"), bus.chip("y"), bus.chip("x", "y")
    x.write(1, 1)
    y.write(1, 2)
    assert y.read(1) == 0x12
    both.write(1, 3)
    x.wait(0)
    assert [call for call in pty_served.port.calls if call[0] in ("select", "write")] == [
        ("write", 1, 1), ("select", 2), ("write", 1, 2), ("select", 3), ("write", 1, 3),
        ("select", 1),
    ]  # fmt: skip


def test_an_unknown_chip_is_refused_with_those_there_are(bus: Bus) -> None:
    with pytest.raises(ValueError, match=r"^no chip 'z'; this session has x, y$"):
        bus.chip("x", "z")


def test_claim_holds_the_bus_for_a_block(bus: Bus, pty_served: Served) -> None:
    with bus.claim():
        bus.write(0, 1)
    bus.echo()
    assert pty_served.port.calls == [("claim",), ("write", 0, 1), ("unclaim",)]


def test_claim_lets_go_when_the_block_fails(bus: Bus, pty_served: Served) -> None:
    with pytest.raises(RuntimeError), bus.claim():
        raise RuntimeError
    bus.echo()
    assert pty_served.port.calls == [("claim",), ("unclaim",)]


def test_strobes_pins_and_time_have_calls_of_their_own(bus: Bus, pty_served: Served) -> None:
    bus.select(2)
    bus.lines({"x./CS": 0, "/RD": 0})
    bus.drive(0x55)
    bus.release()
    bus.pin("y./RST", 0)
    assert bus.getpin("y.HI") == 1
    bus.delay("10ms")
    bus.at("20ms")
    assert bus.now() == 20_000_000_000
    assert bus.sync() == (0, 20_005_000_000)
    assert pty_served.port.calls == [
        ("select", 2), ("lines", 0b101, 0), ("drive", 0x55), ("release",), ("pin", 2, 0),
        ("getpin", 3), ("delay", 10_000_000_000), ("at", 20_000_000_000), ("sync",),
    ]  # fmt: skip


def test_events_come_between_replies_or_are_waited_for(bus: Bus, pty_served: Served) -> None:
    bus.events("x.HI")
    bus.write(0, 1)
    assert bus.next_event() == Event(1, US)
    bus.write(0, 1)
    bus.echo()
    assert bus.take_events() == [Event(0, 2 * US)]
    assert bus.take_events() == []
    assert bus.next_event(timeout=0.0) is None


def test_a_refused_write_raises_at_the_next_call_that_waits(bus: Bus) -> None:
    bus.write(0xEE, 1)
    with pytest.raises(ProtocolError, match=r"^WRITE \(request 1\) was refused: no such line"):
        bus.read(0)
    assert bus.read(0) == 2


def test_threads_may_share_a_bus(bus: Bus, pty_served: Served) -> None:
    pty_served.port.answers = {address: [address] for address in range(4)}
    wrong: list[int] = []

    def reader(address: int) -> None:
        for _ in range(200):
            if bus.read(address) != address:
                wrong.append(address)

    threads = [threading.Thread(target=reader, args=(address,)) for address in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


def test_a_message_bigger_than_the_links_buffers_gets_through(served: Served) -> None:
    with connect(served.where) as bus, bus.batch() as batch:
        reads = [batch.reads(1, 255) for _ in range(2000)]
        batch.writes(1, bytes(255))
    assert sum(len(read.value) for read in reads) == 510_000


# -- when things go wrong --------------------------------------------------------------------------


def test_no_reply_in_time_is_told_with_request_and_link(served: Served) -> None:
    with connect(served.where) as bus:
        served.mute = True
        bus.timeout = 0.01
        with pytest.raises(TransportError) as caught:
            bus.read(0)
    assert str(caught.value) == (
        f"{served.where}: no reply to READ4 within 0.01 s; is the board still running? (vbus ls)"
    )


def test_a_late_reply_is_not_taken_for_another_one(bus: Bus, pty_served: Served) -> None:
    pty_served.mute = True
    bus.timeout = 0.01
    before = len(pty_served.messages)
    with pytest.raises(TransportError, match=r"no reply to READ4 within 0\.01 s"):
        bus.read(0)
    until(lambda: len(pty_served.messages) > before, "the board takes the read")
    pty_served.mute = False
    os.write(pty_served._fd, b"D\x01")
    bus.timeout = 5.0
    assert bus.read(0) == 2


def test_time_that_a_request_lets_pass_is_waited_for(bus: Bus) -> None:
    bus.timeout = 5.0
    assert bus._patience() == 5.0
    bus.delay("3s")
    assert bus._patience() == 8.0
    bus.delay("1s")
    assert bus._patience() == 9.0
    bus.echo()
    assert bus._patience() == 5.0
    bus.delay("8000000s")
    assert bus._patience() == 86400.0


def test_slow_boards_are_given_more_time(bus: Bus) -> None:
    bus.timeout = 5.0
    bus.info.rate = 0.5
    bus.delay("1s")
    assert bus._patience() == 7.0


def test_a_board_that_goes_away_is_told_and_nothing_hangs(served: Served) -> None:
    bus = connect(served.where)
    served.stop()
    with pytest.raises(TransportError, match="closed by the other end"):
        bus.read(0)
    with pytest.raises(TransportError, match="closed by the other end"):
        bus.write(0, 0)
    bus.close()


def test_a_closed_bus_says_so(bus: Bus) -> None:
    bus.close()
    bus.close()
    with pytest.raises(TransportError, match=r"this end has closed it$"):
        bus.read(0)


def test_a_board_that_never_answers_is_not_connected_to(pty_served: Served) -> None:
    pty_served.mute = True
    before = os.listdir("/proc/self/fd")
    with pytest.raises(TransportError, match=r"no reply to HELLO within 0\.01 s; is the board"):
        connect(pty_served.where, timeout=0.01)
    assert os.listdir("/proc/self/fd") == before


@pytest.mark.parametrize(
    ("where", "reason"),
    [
        ("pty:{}/none", "no such name; is the board running? (vbus ls)"),
        ("unix:{}/none", "no such name; is the board running? (vbus ls)"),
        (
            "pty:$VBUS_TEST_UNSET/x",
            "an environment variable in it is not set; vbus ls shows the link in full",
        ),
        ("{}/plain", "not a PTY"),
        ("unix:{}/plain", "no process listens there; is the board running? (vbus ls)"),
        ("serial:{}/none", ""),
        ("tcp:127.0.0.1:{port}", "no process listens there; is the board running? (vbus ls)"),
    ],
)
def test_a_link_that_cannot_be_opened_says_why(tmp_path: Path, where: str, reason: str) -> None:
    (tmp_path / "plain").touch()
    with socket.socket() as kept:  # nobody else is given its port, and listens there
        kept.bind(("127.0.0.1", 0))
        asked = where.format(tmp_path, port=kept.getsockname()[1])
        with pytest.raises(TransportError) as caught:
            connect(asked)
    full = asked if ":" in asked else f"pty:{asked}"
    assert str(caught.value).startswith(f"{full} cannot be opened: {reason}")
    assert isinstance(caught.value, OSError)


@pytest.mark.parametrize("where", ["", "bench", "usb:1", "tcp:1234", "tcp:host:x", "pty:",
                                   "serial:/dev/null?parity=even"])  # fmt: skip
def test_what_is_no_link_is_refused_with_what_is_allowed(where: str) -> None:
    with pytest.raises(ValueError, match=r"is no link; allowed (are|is) "):
        connect(where)


def test_a_wait_for_room_is_not_the_next_wait_for_bytes() -> None:
    near, far = socket.socketpair()
    with near, far:
        waits = BlockingWaits()
        for write in (True, False, True):
            ready = waits.until_ready(near.fileno(), write, 0.0).send
            with pytest.raises(StopIteration) as ended:
                ready(None)
            assert ended.value.value is write


def test_only_a_link_that_somebody_has_begun_to_make_is_starting(tmp_path: Path) -> None:
    (tmp_path / "there").write_text("")
    for where in (f"{tmp_path}/x", f"pty:{tmp_path}/there", "tcp:127.0.0.1:1"):
        assert not starting(where)


def test_a_demonstration_says_what_it_found_and_why_it_failed(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    bus = SimpleNamespace(now=count(0, 2 * US).__next__)
    demo.Step(bus, "look").found("status", 1, 3)  # type: ignore[arg-type]
    assert demo.main("lm628", f"unix:{tmp_path}/x") == 1
    step, found, failed = map(json.loads, capfd.readouterr().out.splitlines())
    assert step == {"step": "look"}
    assert found == {"done": "look", "what": "status", "expected": 1, "found": 3, "tolerance": 0,
                     "digits": 0, "seconds": 2e-6}  # fmt: skip
    assert failed["failed"].startswith(f"unix:{tmp_path}/x cannot be opened")
