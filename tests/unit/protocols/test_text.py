"""The text protocol, board's end."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.fake_port import FakePort
from tests.unit.protocols.grammar import cuts, ends, lines, pieces
from vbus.core.kernel import MS, NEVER, US
from vbus.protocols.port import NotYet, PortInfo
from vbus.protocols.text import VERBS, TextProtocol


@pytest.fixture
def wire(port: FakePort) -> TextProtocol:
    return TextProtocol(port)


def say(wire: TextProtocol, text: str) -> str:
    """Send lines; return what comes back."""
    wire.receive(text.encode() + b"\n")
    answer = wire.take().decode()
    assert answer == "" or answer.endswith("\n")
    return answer[:-1]


@pytest.mark.parametrize(
    ("line", "answer", "calls"),
    [
        ("r 1f", "10", [("read", 0x1F)]),
        ("r 1 3", "12 13 14", [("read", 1)] * 3),
        ("w 0 1f", "ok", [("write", 0, 0x1F)]),
        ("w 1 0a 0x0B 0ch", "ok", [("write", 1, 10), ("write", 1, 11), ("write", 1, 12)]),
        ("select y", "ok", [("select", 2)]),
        ("select x y", "ok", [("select", 3)]),
        ("select all", "ok", [("select", 3)]),
        ("select none", "ok", [("select", 0)]),
        ("claim", "ok", [("claim",)]),
        ("unclaim", "ok", [("unclaim",)]),
        ("wait 100us", "ready 0us", [("wait", 100 * US)]),
        ("pin x./RST 0", "ok", [("pin", 0, 0)]),
        ("pin x./RST z", "ok", [("pin", 0, 2)]),
        ("pin x.HI", "1", [("getpin", 1)]),
        ("lines x./CS=0 /RD=0 /WR=1", "ok", [("lines", 0b1101, 0b1000)]),
        ("drive 55", "ok", [("drive", 0x55)]),
        ("release", "ok", [("release",)]),
        ("sample", "84 0", [("sample",)]),
        ("step 10ms", "10000us", [("delay", 10 * MS)]),
        ("step 1.5 us", "1.5us", [("delay", 1_500_000)]),
        ("now", "0us", []),
        ("chips", "x LM629N-8 selected, y LM629N-8", []),
        (
            "names",
            "pins x./RST x.HI y./RST y.HI; lines x./CS y./CS /RD /WR; outputs x.HI y.HI",
            [],
        ),
        ("help now", "now: chip time", []),
    ],
)
def test_a_line_becomes_a_call_and_its_result_a_line(
    wire: TextProtocol, port: FakePort, line: str, answer: str, calls: list[tuple[object, ...]]
) -> None:
    assert say(wire, line) == answer
    assert port.calls == calls


def test_wait_says_busy_when_the_time_was_too_short(wire: TextProtocol) -> None:
    assert say(wire, "w 0 1\nwait 10us\nwait 10us") == "ok\nbusy 11us\nready 16us"


def test_chips_follows_select(wire: TextProtocol) -> None:
    assert say(wire, "select y\nchips") == "ok\nx LM629N-8, y LM629N-8 selected"


def test_a_refused_select_changes_nothing(wire: TextProtocol) -> None:
    assert say(wire, "select q").startswith("error: no chip 'q'")
    assert say(wire, "chips") == "x LM629N-8 selected, y LM629N-8"


def test_help_lists_every_verb_on_one_line(wire: TextProtocol) -> None:
    answer = say(wire, "help")
    assert "\n" not in answer
    assert answer.split("; ") == [verb.usage for verb in VERBS.values()]


def test_a_session_without_chips_says_so(
    wire: TextProtocol, port: FakePort, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(port, "info", lambda: PortInfo("b", "lockstep", 0.0))
    assert say(wire, "chips\nnames") == "none\npins none; lines none; outputs none"


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("r", "error: r with 0 arguments; usage: r ADDRESS [COUNT]"),
        ("r w", "error: address 'w' is no hexadecimal number; allowed are 0 to FF"),
        ("r 1_0", "error: address '1_0' is no hexadecimal number; allowed are 0 to FF"),
        ("r 0x", "error: address '0x' is no hexadecimal number; allowed are 0 to FF"),
        ("r 0x0x1", "error: address '0x0x1' is no hexadecimal number; allowed are 0 to FF"),
        ("r 100", "error: address 100; allowed are 0 to FF"),
        ("r 0 0", "error: count 0; allowed are 1 to FF"),
        ("r -1", "error: address '-1' is no hexadecimal number; allowed are 0 to FF"),
        ("r ee", "error: address EE: nobody is there"),
        ("w 0 0 1ff", "error: data 1ff; allowed are 0 to FF"),
        ("w 0", "error: w with 1 arguments; usage: w ADDRESS DATA ..."),
        ("select q", "error: no chip 'q'; this session has x, y"),
        ("pin q 0", "error: no pin 'q'; this session has x./RST, x.HI, y./RST, y.HI"),
        ("pin x./RST 7", "error: level '7'; allowed are 0, 1, and z to let go"),
        ("lines /RD", "error: '/RD'; allowed is NAME=0 or NAME=1"),
        ("lines /RD=2", "error: '/RD=2'; allowed is NAME=0 or NAME=1"),
        ("lines /RD=0 /RD=1", "error: /RD stands there twice; name each line once"),
        ("step 10", "error: '10' is no duration; write a number with ps, ns, us, ms or s"),
        ("step 0.1ps", "error: '0.1ps' is finer than a picosecond; that is as fine as time gets"),
        ("wait 9999999999s", "error: '9999999999s' is too long; at most 9151314 s are possible"),
        ("help q", f"error: no help on 'q'; allowed are {', '.join(VERBS)}"),
        ("frob", f"error: unknown request 'frob'; allowed are {', '.join(VERBS)}"),
        ("R 1f", f"error: unknown request 'R'; allowed are {', '.join(VERBS)}"),
    ],
)
def test_a_mistake_is_answered_with_what_is_allowed(
    wire: TextProtocol, line: str, answer: str
) -> None:
    assert say(wire, line) == answer


def test_a_wrong_byte_in_a_write_writes_nothing(wire: TextProtocol, port: FakePort) -> None:
    say(wire, "w 0 1 2 zz")
    assert port.calls == []


# -- lines -----------------------------------------------------------------------------------------


def test_an_answer_ends_as_its_line_did(wire: TextProtocol) -> None:
    wire.receive(b"now\nnow\rnow\r\n\n\r  \nnow\n")
    assert wire.take() == b"0us\n0us\r\n0us\r\n0us\n"


def test_bytes_that_are_not_ascii_come_back_escaped(wire: TextProtocol) -> None:
    wire.receive(b"\xff\x00\n")
    assert wire.take().startswith(b"error: unknown request '\\ufffd\\x00'; allowed are ")


def test_a_line_may_have_512_characters_and_no_more(wire: TextProtocol) -> None:
    assert say(wire, "now" + " " * 509) == "0us"
    refusal = "error: the line is too long; at most 512 characters"
    assert say(wire, "now" + " " * 510) == refusal
    assert say(wire, "now\n" + "x" * 100_000 + "\nnow") == f"0us\n{refusal}\n0us"


@given(st.integers(500, 530), cuts)
def test_a_line_is_too_long_or_not_however_it_was_cut(length: int, sizes: list[int]) -> None:
    stream = b"now" + b" " * (length - 3) + b"\nnow\n"
    first = b"0us" if length <= 512 else b"error: the line is too long; at most 512 characters"
    assert run(pieces(stream, sizes))[0] == first + b"\n0us\n"


def test_an_endless_line_is_not_kept(wire: TextProtocol) -> None:
    for _ in range(100):
        wire.receive(b"x" * 4096)
    assert len(wire._kept) <= 512


def test_half_a_line_and_the_selection_are_forgotten_when_a_session_ends(
    wire: TextProtocol,
) -> None:
    wire.receive(b"select y\n" + b"x" * 1000)
    wire.reset()
    assert say(wire, "chips") == "x LM629N-8 selected, y LM629N-8"


@pytest.mark.parametrize("line", ["step 5us", "wait 5us", "clock_step 5000"])
def test_a_line_that_has_to_wait_keeps_what_is_behind_it(
    wire: TextProtocol, port: FakePort, line: str
) -> None:
    port.busy_until = 10 * US
    port.limit = 0
    assert say(wire, f"{line}\nnow") == ""
    assert say(wire, "now") == ""
    port.limit = 5 * US
    assert port.go_on()
    wire.resume()
    first = {"s": "5us", "w": "busy 5us", "c": "OK 5000"}[line[0]]
    assert wire.take().decode() == f"{first}\n5us\n5us\n"


@pytest.mark.parametrize(
    ("lines", "left"),
    [("", False), ("wait 5us\n", False), ("wait 5us\nnow\n", True), ("w 0 1\n", True)],
)
def test_a_wait_alone_is_nothing_that_a_host_leaves_behind(
    wire: TextProtocol, port: FakePort, lines: str, left: bool
) -> None:
    port.held = True
    wire.receive(lines.encode())
    assert wire.awaited() == left


def test_a_request_of_which_a_port_says_not_yet_is_made_again(
    wire: TextProtocol, port: FakePort, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read(address: int) -> int:
        port.held = True
        raise NotYet

    with monkeypatch.context() as patch:
        patch.setattr(port, "read", read)
        wire.receive(b"r 1\n")
    assert wire.out == b""
    port.held = False
    wire.receive(b"")
    assert wire.out == b"12\n"


def test_nothing_is_asked_of_a_port_that_is_held(wire: TextProtocol, port: FakePort) -> None:
    port.held = True
    assert say(wire, "r 0") == ""
    assert port.calls == []
    port.held = False
    wire.resume()
    assert wire.take() == b"01\n"


def test_claim_waits_its_turn(wire: TextProtocol, port: FakePort) -> None:
    port.claimable = False
    assert say(wire, "claim") == ""
    port.claimable = True
    port.held = False
    wire.resume()
    assert wire.take() == b"ok\n"


# -- qtest -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "answer", "calls"),
    [
        ("inb 0x340", "OK 0x0001", [("select", 1), ("read", 0), ("select", 1)]),
        ("inb 0x341", "OK 0x0012", [("select", 1), ("read", 1), ("select", 1)]),
        ("inb 832", "OK 0x0001", [("select", 1), ("read", 0), ("select", 1)]),
        ("readb 0x348", "OK 0x0000000000000001", [("select", 2), ("read", 0), ("select", 1)]),
        (
            "inb 0x345",
            "OK 0x0012",
            [("select", 1), ("read", 1), ("select", 1), ("pin", 3, 0), ("pin", 3, 2)],
        ),
        ("inb 0x34c", "OK 0x00ff", [("pin", 3, 0), ("pin", 3, 2)]),
        ("outb 0x34c 1", "OK", [("pin", 3, 0), ("pin", 3, 2)]),
        ("inb 0x344", "OK 0x007f", [("select", 2), ("read", 0), ("select", 1)]),
        ("inb 0x300", "OK 0x00ff", []),
        ("outb 0x341 0x1f", "OK", [("select", 1), ("write", 1, 0x1F), ("select", 1)]),
        ("outb 0x341 0x11f", "OK", [("select", 1), ("write", 1, 0x1F), ("select", 1)]),
        ("writeb 0x348 31", "OK", [("select", 2), ("write", 0, 0x1F), ("select", 1)]),
        ("outb 0x300 0x1f", "OK", []),
        ("inb 0x342", "OK 0x00ff", []),
        ("outb 0x342 0x1f", "OK", [("select", 1), ("write", 1, 0x1F), ("select", 1)]),
        ("clock_step 1000000", "OK 1000000", [("delay", MS)]),
        ("clock_step", "OK 5000", [("sync",), ("delay", 5 * US)]),
    ],
)
def test_qtest_verbs_answer_as_qtest_does(
    wire: TextProtocol, port: FakePort, line: str, answer: str, calls: list[tuple[object, ...]]
) -> None:
    assert say(wire, line) == answer
    assert port.calls == calls


def test_a_card_access_leaves_the_selection_alone(wire: TextProtocol, port: FakePort) -> None:
    assert say(wire, "select y\ninb 0x340") == "ok\nOK 0x0001"
    assert port.calls == [("select", 2), ("select", 1), ("read", 0), ("select", 2)]


def test_clock_step_stands_still_when_nothing_is_in_sight(
    wire: TextProtocol, port: FakePort
) -> None:
    port.outputs = 1
    assert say(wire, "clock_step") == "OK 0"


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("inb", "FAIL inb with 0 arguments; usage: inb ADDRESS"),
        ("inb 34f", "FAIL address '34f' is no number; allowed are 0x1f or 31"),
        ("inb 0x", "FAIL address '0x' is no number; allowed are 0x1f or 31"),
        (
            "inb 0x8000000000000000",
            "FAIL address 0x8000000000000000; allowed are numbers below 2^63",
        ),
        (f"clock_step {NEVER}", f"FAIL ns {NEVER}; at most 9151314442816847"),
    ],
)
def test_qtest_verbs_fail_as_qtest_does(wire: TextProtocol, line: str, answer: str) -> None:
    assert say(wire, line) == answer


# -- anything --------------------------------------------------------------------------------------


def run(parts: list[bytes]) -> tuple[bytes, list[tuple[object, ...]], int]:
    port = FakePort()
    wire = TextProtocol(port)
    for part in parts:
        wire.receive(part)
    return wire.take(), port.calls, port.time


@given(st.lists(st.tuples(lines, ends), max_size=8), cuts)
def test_every_line_gets_one_line_however_the_bytes_were_cut(
    said: list[tuple[bytes, bytes]], sizes: list[int]
) -> None:
    stream = b"".join(text + end for text, end in said)
    outcome = run(pieces(stream, sizes))
    assert outcome == run([stream])
    answers = outcome[0].splitlines(keepends=True)
    assert len(answers) == sum(bool(text.decode("ascii", "replace").split()) for text, _ in said)
    assert all(answer.endswith(b"\n") for answer in answers)


@given(st.binary(max_size=2000), cuts)
def test_garbage_raises_nothing(stream: bytes, sizes: list[int]) -> None:
    assert run(pieces(stream, sizes)) == run([stream])
