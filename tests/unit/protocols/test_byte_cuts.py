"""The byte protocol gives the same replies however its bytes were cut, and survives anything."""

from hypothesis import given
from hypothesis import strategies as st

from tests.unit.fake_port import FakePort
from tests.unit.protocols.grammar import cuts, pieces, streams
from vbus.core.kernel import NEVER, US
from vbus.protocols.byte import ByteProtocol

Outcome = tuple[bytes, list[tuple[object, ...]], int]


def run(parts: list[bytes], step: int = NEVER) -> Outcome:
    """Feed ``parts``; time that a request waits for comes in steps, after all has been fed."""
    port = FakePort()
    if step != NEVER:
        port.limit = 0
    wire = ByteProtocol(port)
    replies = b""
    for part in parts:
        wire.receive(part)
        replies += wire.take()
    while port.held:
        port.limit = port.hold_until
        assert port.go_on()
        wire.resume()
        replies += wire.take()
    return replies, port.calls, port.time


@given(streams, cuts)
def test_replies_do_not_depend_on_how_the_bytes_were_cut(stream: bytes, sizes: list[int]) -> None:
    assert run(pieces(stream, sizes)) == run([stream])


@given(streams, cuts)
def test_replies_do_not_depend_on_waiting(stream: bytes, sizes: list[int]) -> None:
    assert run(pieces(stream, sizes), step=US) == run([stream])


@given(st.binary(max_size=600), cuts)
def test_garbage_raises_nothing_and_stays_bounded(stream: bytes, sizes: list[int]) -> None:
    replies, _, _ = run(pieces(stream, sizes))
    assert replies == run([stream])[0]
    # READS is the request that asks for most: 257 bytes for three.
    assert len(replies) <= 257 * len(stream) + 1024


@given(st.binary(max_size=50), streams)
def test_a_new_session_is_like_the_first_whatever_came_before(old: bytes, new: bytes) -> None:
    port = FakePort()
    wire = ByteProtocol(port)
    wire.receive(old)
    port.__init__()  # type: ignore[misc]
    wire.reset()
    wire.receive(new)
    assert (wire.take(), port.calls, port.time) == run([new])
