"""The byte protocol, board's end."""

import pytest
from msgspec.structs import replace

from tests.unit.fake_port import LINES, OUTPUTS, PINS, FakePort
from vbus.core.kernel import END, US
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.codes import NO_SUCH
from vbus.protocols.info import decode_hello
from vbus.protocols.port import ChipInfo, PortError, PortInfo


@pytest.fixture
def wire(port: FakePort) -> ByteProtocol:
    return ByteProtocol(port)


def say(wire: ByteProtocol, text: str) -> str:
    """Send hexadecimal bytes; return the reply in the same form."""
    wire.receive(bytes.fromhex(text))
    return wire.take().hex()


# -- what each request does ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("request_bytes", "reply", "calls"),
    [
        ("10", "44 01", [("read", 0)]),
        ("1f", "44 00", [("read", 15)]),
        ("20 1e", "", [("write", 0, 0x1E)]),
        ("2f 1e", "", [("write", 15, 0x1E)]),
        ("30 80", "44 81", [("read", 0x80)]),
        ("31 80 55", "", [("write", 0x80, 0x55)]),
        ("32 01 03", "42 03 12 13 14", [("read", 1)] * 3),
        ("33 01 02 aa bb", "", [("write", 1, 0xAA), ("write", 1, 0xBB)]),
        ("02 5a", "45 5a", []),
        ("03 00 02", "", [("select", 2)]),
        ("04", "43 01", [("claim",)]),
        ("05", "", [("unclaim",)]),
        ("40 00 0f 01 0c", "", [("lines", 15, 0x10C)]),
        ("41 55", "", [("drive", 0x55)]),
        ("42", "", [("release",)]),
        ("43", "50 84 00000000", [("sample",)]),
        ("44 02 00", "", [("pin", 2, 0)]),
        ("45 01", "44 01", [("getpin", 1)]),
        ("34 00000000000f4240", "52 01 0000000000000000", [("wait", US)]),
        ("50 00000000000f4240", "", [("delay", US)]),
        ("51 00000000000f4240 52", "54 00000000000f4240", [("at", US)]),
        ("53", "53 00000000 00000000004c4b40", [("sync",)]),
        (
            "56 00000000004c4b40",
            "57 00000000 00000000004c4b40",
            [("sync",), ("at", 5 * US), ("sync",)],
        ),
        ("56 0000000000000000", "57 00000000 0000000000000000", [("sync",)]),
        ("60 00000001", "", [("events", 1)]),
    ],
)
def test_a_request_becomes_a_call_and_its_result_a_reply(
    wire: ByteProtocol,
    port: FakePort,
    request_bytes: str,
    reply: str,
    calls: list[tuple[object, ...]],
) -> None:
    assert say(wire, request_bytes) == reply.replace(" ", "")
    assert port.calls == calls


def test_replies_stand_in_the_order_of_their_requests(wire: ByteProtocol) -> None:
    assert say(wire, "10 02 07 20 aa 10 52") == "44014507440254" + (3 * US).to_bytes(8, "big").hex()


def test_hello_tells_version_and_everything_attached(wire: ByteProtocol) -> None:
    wire.receive(b"\x01\x01")
    reply = wire.take()
    assert reply[:1] == b"V"
    assert int.from_bytes(reply[1:3], "big") == len(reply) - 3
    assert decode_hello(reply[3:]) == (
        1,
        PortInfo(
            "bench",
            "slaved",
            0.0,
            [ChipInfo("x", "LM629N-8", "lm628", 1, US), ChipInfo("y", "LM629N-8", "lm628", 1, US)],
            list(LINES),
            list(OUTPUTS),
            list(PINS),
            ["events"],
        ),
    )


def test_a_newer_host_is_told_the_version_spoken_here(wire: ByteProtocol) -> None:
    wire.receive(b"\x01\x09")
    assert decode_hello(wire.take()[3:])[0] == 1


def test_a_host_that_has_said_hello_reads_of_a_pause_once_and_no_other_does(
    wire: ByteProtocol,
) -> None:
    wire.tell_pause(True)
    assert wire.take() == b"", "nobody knows yet what it reads"
    wire.receive(b"\x01\x01")
    assert decode_hello(wire.take()[3:])[0] == 1
    for paused in (True, True, False, False):
        wire.tell_pause(paused)
    assert wire.take() == b"H\x01H\x00"
    wire.reset()
    wire.tell_pause(True)
    assert wire.take() == b"", "the next host has not asked"


def test_a_host_whose_hello_waits_is_told_why(wire: ByteProtocol, port: FakePort) -> None:
    port.held = True
    wire.receive(b"\x01")
    wire.tell_pause(True)
    assert wire.take() == b""
    wire.receive(b"\x01")
    wire.tell_pause(True)
    assert wire.take() == b"H\x01"
    port.held = False
    wire.resume()
    assert decode_hello(wire.take()[3:])[0] == 1
    wire.tell_pause(False)
    assert wire.take() == b"H\x00"


def test_a_session_too_big_to_describe_is_refused(
    wire: ByteProtocol, port: FakePort, monkeypatch: pytest.MonkeyPatch
) -> None:
    info = PortInfo("b", "lockstep", 0.0, pins=["x" * 1000] * 66)
    monkeypatch.setattr(port, "info", lambda: info)
    assert say(wire, "01 01") == "58040000"


@pytest.mark.parametrize(
    "data",
    [
        b"", b"\x80", b"\xc1", b"\x81\xa1\xab\x01", b"\x81\xa7version\x01", b"\x93\x01\x02\x03",
        pytest.param(b"\x81\xa1x" + b"\x91" * 65_000 + b"\xc0", id="nested too deeply"),
    ],
)  # fmt: skip
def test_bytes_that_are_no_hello_give_a_clear_error(data: bytes) -> None:
    with pytest.raises(ValueError, match=r"^HELLO's answer cannot be read: "):
        decode_hello(data)


def test_wait_tells_when_the_chip_is_still_busy(wire: ByteProtocol) -> None:
    assert say(wire, "20 1e 34 00000000000f4240") == "5200" + (2 * US).to_bytes(8, "big").hex()
    assert say(wire, "34 ffffffffffffffff") == "5201" + (16 * US).to_bytes(8, "big").hex()


def test_pass_ends_at_an_edge_of_a_watched_line(wire: ByteProtocol, port: FakePort) -> None:
    assert say(wire, "60 00000001") == ""
    port.edge(1)
    port.edge(0)
    assert say(wire, "56 00000000004c4b40") == (
        "49000000010000000000000000" + "49000000000000000000000000" + "5700000000" + "00" * 8
    )
    assert say(wire, "56 00000000000f4240") == "5700000000" + "00000000000f4240"


def test_pass_ends_at_the_latest_when_time_does(wire: ByteProtocol, port: FakePort) -> None:
    port.time = END - 9 * US
    assert say(wire, "56 ffffffffffffffff") == "5700000000" + (9 * US).to_bytes(8, "big").hex()


def test_pass_waits_on_a_board_that_does_not_follow_the_host(
    wire: ByteProtocol, port: FakePort, monkeypatch: pytest.MonkeyPatch
) -> None:
    info = replace(port.info(), policy="lockstep")
    monkeypatch.setattr(port, "info", lambda: info)
    assert say(wire, "56 00000000004c4b40") == "5700000000" + "00000000004c4b40"
    assert port.calls == [("sync",), ("delay", 5 * US), ("sync",)]
    assert port.time == 5 * US


def test_sync_says_all_ones_when_no_edge_is_in_sight(wire: ByteProtocol, port: FakePort) -> None:
    port.outputs = 2
    assert say(wire, "53") == "5300000002ffffffffffffffff"


# -- refusals --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "request_bytes",
    ["30 ee", "31 ee 00", "32 ee 05", "33 ee 02 aa bb", "03 00 04", "40 00 10 00 00", "44 04 00",
     "45 04", "60 00000004"],
)  # fmt: skip
def test_something_that_is_not_there_is_refused_and_the_session_goes_on(
    wire: ByteProtocol, port: FakePort, request_bytes: str
) -> None:
    assert say(wire, "02 01" + request_bytes + "02 02") == "4501580200014502"
    assert port.calls == []


def test_an_at_before_the_last_at_is_refused_and_the_session_goes_on(wire: ByteProtocol) -> None:
    assert say(wire, "51 0000000000000005 51 0000000000000004 02 01") == "580300014501"


@pytest.mark.parametrize(
    ("request_bytes", "code"),
    [("00", 1), ("06", 1), ("57", 1), ("62", 1), ("ff", 1), ("32 00 00", 4), ("33 00 00", 4),
     ("01 00", 5), ("55 00 0000000000000000 03 000000", 4)],
)  # fmt: skip
def test_after_a_request_of_unknown_length_every_byte_is_refused_alike(
    wire: ByteProtocol, port: FakePort, request_bytes: str, code: int
) -> None:
    refusal = f"58{code:02x}0001"
    assert say(wire, "10" + request_bytes + "10 10") == "4401" + refusal * 3
    assert say(wire, "0207") == refusal * 2
    assert port.calls == [("read", 0)]


def test_a_new_session_starts_clean_after_a_refusal(wire: ByteProtocol) -> None:
    say(wire, "10 ff")
    wire.reset()
    assert say(wire, "02 07") == "4507"
    assert say(wire, "ff") == "58010001"


def test_half_a_request_is_forgotten_when_a_session_ends(wire: ByteProtocol) -> None:
    assert say(wire, "33 00 05 01 02") == ""
    wire.reset()
    assert say(wire, "02 07") == "4507"


@pytest.mark.parametrize(
    ("name", "begun", "reply"),
    [("read", "32 01 03", "42021415"), ("write", "33 01 03 aabbcc", "42021213")],
)
def test_a_run_of_cycles_refused_midway_leaves_nothing_to_the_next_one(
    wire: ByteProtocol,
    port: FakePort,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    begun: str,
    reply: str,
) -> None:
    cycle = getattr(port, name)

    def refused(*values: int) -> int | None:
        if port.time == 2 * US:
            port.time += US
            raise PortError(NO_SUCH, "gone")
        result: int | None = cycle(*values)
        return result

    monkeypatch.setattr(port, name, refused)
    assert say(wire, begun) == "58020000"
    assert len(port.calls) == 2
    port.calls.clear()
    assert say(wire, "33 01 02 dd ee 32 01 02") == reply
    assert port.calls == [("write", 1, 0xDD), ("write", 1, 0xEE), ("read", 1), ("read", 1)]


@pytest.mark.parametrize("half", ["20", "32 01", "33 01 05 aa bb"])
def test_half_a_request_at_the_end_of_a_message_is_refused_and_counted(
    wire: ByteProtocol, port: FakePort, half: str
) -> None:
    assert say(wire, "02 07" + half) == "4507"
    assert wire.finish()
    assert wire.take().hex() == "58040001"
    assert say(wire, "02 09 30 ee") == "4509" + "58020003"
    assert port.calls == []


def test_requests_without_a_reply_are_counted_and_the_count_wraps(wire: ByteProtocol) -> None:
    wire.receive(b"\x20\x00" * 0x10001)
    assert say(wire, "30 ee") == "58020001"


# -- requests that have to wait --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("request_bytes", "reply"),
    [("50 00000000000f4240", ""), ("20 00 34 00000000000f4240", "520000000000001e8480")],
)
def test_a_request_that_has_to_wait_keeps_everything_behind_it(
    wire: ByteProtocol, port: FakePort, request_bytes: str, reply: str
) -> None:
    port.limit = 0
    assert say(wire, request_bytes) == ""
    assert say(wire, "02 01") == ""
    assert port.held
    port.limit = 10 * US
    assert say(wire, "02 02") == ""
    assert port.go_on()
    wire.resume()
    assert wire.take().hex() == reply + "45014502"


def test_claim_waits_its_turn(wire: ByteProtocol, port: FakePort) -> None:
    port.claimable = False
    assert say(wire, "04 10") == ""
    port.held = False
    wire.resume()
    assert wire.take() == b""
    port.held = False
    port.claimable = True
    wire.resume()
    assert wire.take().hex() == "43014401"


def test_nothing_is_asked_of_a_port_that_is_held(wire: ByteProtocol, port: FakePort) -> None:
    port.held = True
    assert say(wire, "10") == ""
    assert port.calls == []
    port.held = False
    wire.resume()
    assert wire.take().hex() == "4401"


# -- events ----------------------------------------------------------------------------------------


def event(outputs: int, when: int) -> str:
    return f"49{outputs:08x}{when:016x}"


def test_an_event_stands_before_the_reply_of_the_request_it_happened_in(
    wire: ByteProtocol,
) -> None:
    assert say(wire, "60 00000001 02 01 20 aa 02 02 20 bb 10") == (
        "4501" + event(1, US) + "4502" + event(0, 2 * US) + "4401"
    )


def test_events_between_requests_are_reported_when_the_session_asks(
    wire: ByteProtocol, port: FakePort
) -> None:
    say(wire, "60 00000003")
    port.edge(2)
    wire.report_events()
    assert wire.take().hex() == event(2, 0)


def test_events_are_reported_while_a_request_waits(wire: ByteProtocol, port: FakePort) -> None:
    port.limit = 0
    say(wire, "60 00000003 50 0000000000000001")
    port.edge(2)
    wire.report_events()
    assert wire.take().hex() == event(2, 0)


def test_nobody_is_told_of_events_who_did_not_ask(wire: ByteProtocol, port: FakePort) -> None:
    port.edge(2)
    wire.report_events()
    assert wire.take() == b""
    assert say(wire, "20 aa 60 00000001 60 00000000 20 aa") == ""


def test_edges_seen_before_events_are_turned_off_are_still_reported(
    wire: ByteProtocol, port: FakePort
) -> None:
    say(wire, "60 00000001")
    port.edge(1)
    assert say(wire, "60 00000000") == event(1, 0)


def test_a_refused_events_request_loses_no_event(wire: ByteProtocol, port: FakePort) -> None:
    say(wire, "60 00000001")
    port.edge(1)
    assert say(wire, "60 80000000") == event(1, 0) + "58020001"


# -- leases ----------------------------------------------------------------------------------------


def leased(data: int, outputs: int, when: int, until: int) -> str:
    return f"4c{data:02x}{outputs:08x}{when:016x}{until:016x}"


def test_a_read_is_answered_with_a_lease_where_the_board_can_tell_and_the_host_asked(
    wire: ByteProtocol,
) -> None:
    assert say(wire, "10 11") == "44014413"
    assert say(wire, "61 01 10 11 30 00") == (
        leased(3, 0, 3 * US, 8 * US) + "4415" + leased(5, 0, 5 * US, 10 * US)
    )
    assert say(wire, "61 00 10") == "4406"


def test_a_lease_without_end_is_all_ones(wire: ByteProtocol) -> None:
    assert say(wire, "61 01 12") == leased(0x23, 0, US, (1 << 64) - 1)


def test_a_lease_has_all_32_output_lines(wire: ByteProtocol, port: FakePort) -> None:
    port.outputs = 0xFFFF_FFFF
    assert say(wire, "61 01 10") == leased(1, 0xFFFF_FFFF, US, 6 * US)


def test_leases_are_on_or_off_and_end_with_the_session(wire: ByteProtocol) -> None:
    assert say(wire, "61 03") == "58020000"
    assert say(wire, "61 01") == ""
    wire.reset()
    assert say(wire, "10") == "4401"


def test_a_host_that_asks_for_it_is_told_what_comes_after_a_lease(wire: ByteProtocol) -> None:
    first = leased(1, 0, US, 6 * US)
    assert say(wire, "61 01 10") == first
    assert say(wire, "61 02 10") == "4d" + leased(2, 0, 2 * US, 7 * US)[2:] + f"02{9 * US:016x}"
    assert say(wire, "12") == leased(0x25, 0, 3 * US, (1 << 64) - 1), "where nothing is foreseen"
    assert say(wire, "61 01 10") == leased(4, 0, 4 * US, 9 * US)


def test_polled_tells_how_often_the_host_has_looked(wire: ByteProtocol, port: FakePort) -> None:
    assert say(wire, "54 00 0102 54 02 0000 54 ee 0001 52") == (
        "58020002" + "54" + (0x102 * US).to_bytes(8, "big").hex()
    )
    assert port.calls == [("polled", 0, 0x102), ("polled", 2, 0)]


def test_polled_at_tells_when_the_host_has_looked(wire: ByteProtocol, port: FakePort) -> None:
    assert say(wire, "55 00 0000000000000007 08 00000002 ffffffff") == ""
    assert say(wire, "55 01 000000000000000a 00 02 01") == "4501"
    assert port.calls == [("polled_at", 0, 7, (2, 0xFFFFFFFF)), ("polled_at", 1, 10, ())]


def test_polls_that_time_does_not_allow_keep_everything_behind_them(
    wire: ByteProtocol, port: FakePort
) -> None:
    port.limit = 2 * US
    assert say(wire, "54 00 0003 02 01") == ""
    port.limit = 3 * US
    port.go_on()
    wire.resume()
    assert wire.take().hex() == "4501"
