"""The text protocol for a person at a terminal."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.fake_port import FakePort
from tests.unit.protocols.grammar import cuts, pieces
from vbus.core.kernel import NEVER
from vbus.core.state import load, save
from vbus.protocols.terminal import TerminalProtocol
from vbus.protocols.text import LONGEST_LINE, VERBS

keys = st.lists(
    st.sampled_from(
        [b"r 0", b"w 0 1f", b"\r", b"\n", b"\r\n", b"\x7f", b"\b", b"\x15", b"\x03", b"\x1b[A",
         b"\x1bOP", b"x", b"help\r", b"step 1ms\r", b"\x00", b"\xff"]
    ),
    max_size=20,
).map(b"".join)  # fmt: skip


@pytest.fixture
def wire(port: FakePort) -> TerminalProtocol:
    return TerminalProtocol(port)


def typed(wire: TerminalProtocol, data: bytes) -> bytes:
    wire.receive(data)
    return wire.take()


@pytest.mark.parametrize(
    ("data", "shown"),
    [
        (b"r 1f\r", b"r 1f\r\n10\r\n> "),
        (b"r 1f\n", b"r 1f\r\n10\r\n> "),
        (b"r 1f\r\n", b"r 1f\r\n10\r\n> "),
        (b"\r", b"\r\n> "),
        (b"\n", b""),
        (b"r 2\x7f1\r", b"r 2\b \b1\r\n12\r\n> "),
        (b"r 2\b1\r", b"r 2\b \b1\r\n12\r\n> "),
        (b"\x7f\x7fnow\r", b"now\r\n0us\r\n> "),
        (b"rubbish\x15now\r", b"rubbish" + b"\b \b" * 7 + b"now\r\n0us\r\n> "),
        (b"rubbish\x03now\r", b"rubbish^C\r\n> now\r\n0us\r\n> "),
        (b"n\x1b[Ao\x1b[1;5Dw\x1bOP\r", b"now\r\n0us\r\n> "),
        (b"no\tw\x00\xe4\r", b"now\r\n0us\r\n> "),
        (b"  now  \r", b"  now  \r\n0us\r\n> "),
    ],
)
def test_what_is_typed_is_shown_and_can_be_corrected(
    wire: TerminalProtocol, data: bytes, shown: bytes
) -> None:
    assert typed(wire, data) == shown


def test_help_has_a_line_for_each_request(wire: TerminalProtocol) -> None:
    lines = typed(wire, b"help\r").decode().split("\r\n")

    assert lines[0] == "help"
    assert lines[-1] == "> "
    assert [line.split()[0] for line in lines[1:-1]] == list(VERBS)
    assert lines[1] == "r ADDRESS [COUNT]          read cycles at one address"
    assert typed(wire, b"help now\r") == b"help now\r\nnow: chip time\r\n> "


def test_a_line_cannot_grow_too_long(wire: TerminalProtocol) -> None:
    shown = typed(wire, b"x" * (LONGEST_LINE + 2))

    assert shown == b"x" * LONGEST_LINE + b"\x07\x07"


def test_keys_wait_while_a_request_does(wire: TerminalProtocol, port: FakePort) -> None:
    port.limit = 0

    assert typed(wire, b"step 1ms\rno\x7fow\r") == b"step 1ms\r\n"
    port.lift(NEVER)
    wire.resume()

    assert wire.take() == b"1000us\r\n> no\b \bow\r\n1000us\r\n> "


def test_a_person_who_had_asked_nothing_finds_no_second_prompt(
    wire: TerminalProtocol, port: FakePort
) -> None:
    port.held = True  # somebody else has claimed the chip
    assert typed(wire, b"now\r") == b""
    port.lift(NEVER)
    wire.resume()

    assert wire.take() == b"now\r\n0us\r\n> "


def test_a_new_session_begins_with_an_empty_line(wire: TerminalProtocol) -> None:
    typed(wire, b"r 0\x1b")
    wire.reset()

    assert typed(wire, b"now\r") == b"now\r\n0us\r\n> "


@given(keys, cuts)
def test_the_result_does_not_depend_on_how_keys_were_cut(data: bytes, sizes: list[int]) -> None:
    whole, cut = TerminalProtocol(FakePort()), TerminalProtocol(FakePort())
    whole.receive(data)
    for piece in pieces(data, sizes):
        cut.receive(piece)

    assert whole.take() == cut.take()
    assert save(whole) == save(cut)


def test_half_a_line_is_saved_and_loaded(wire: TerminalProtocol) -> None:
    typed(wire, b"now\r 1\x7f\x1b")
    other = TerminalProtocol(FakePort())
    load(other, save(wire))

    assert save(other) == save(wire)
