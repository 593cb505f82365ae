"""A serial line: bytes take their time, and arrive when their frames have ended."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.unit.fake_port import FakePort
from tests.unit.protocols.grammar import cuts, pieces
from vbus.core.kernel import NEVER, US
from vbus.core.state import load, save
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.codes import BAD_AT
from vbus.protocols.port import PortError, PortInfo
from vbus.protocols.serial_line import (
    BREAK,
    DTR,
    FRAMES,
    RTS,
    ModemPins,
    SerialLine,
    frame_ps,
    mark,
    marked,
)
from vbus.protocols.terminal import TerminalProtocol

FRAME = frame_ps(9600, "8N1")
CHANGE = 1000 * US
PINS = ModemPins(((DTR, 0), (RTS, 1), (BREAK, 2)), (3,), CHANGE)

streams = st.lists(
    st.sampled_from(
        [b"\x10", b"\x20\x55", b"\x02\xff", b"\x60\x00\x00\x00\x01", b"\x34" + bytes(7) + b"\x09",
         b"\x50" + bytes(5) + b"\x01\x00\x00", b"\x52", b"\x32\x01\x05"]
    ),
    max_size=12,
).map(b"".join)  # fmt: skip


class Realtime(FakePort):
    """The same on a board in real time."""

    def info(self) -> PortInfo:
        return replace(super().info(), policy="realtime")


def line(port: FakePort, frame: int = FRAME, modem: ModemPins | None = None) -> SerialLine:
    return SerialLine(port, ByteProtocol(port), frame, modem)


@pytest.mark.parametrize(
    ("baud", "frame", "lasts"),
    [
        (9600, "8N1", 1_041_666_667),
        (9600, "8E2", 1_250_000_000),
        (115_200, "8N1", 86_805_556),
        (115_200, "8O1", 95_486_111),
        (1_000_000, "8N2", 11_000_000),
        (1, "8N1", 10_000_000_000_000),
        (16_000_000_000_000, "8N1", 1),
    ],
)
def test_a_frame_ends_where_its_last_bit_does(baud: int, frame: str, lasts: int) -> None:
    assert frame_ps(baud, frame) == lasts


def test_a_frame_has_a_start_bit_its_data_its_parity_and_its_stop_bits() -> None:
    for name, bits in FRAMES.items():
        assert bits == 1 + int(name[0]) + (name[1] != "N") + int(name[2])


def test_a_request_is_carried_out_when_its_last_frame_has_ended(port: FakePort) -> None:
    port.limit = 2 * FRAME - 1
    wire = line(port)
    wire.receive(b"\x20\x55")
    assert port.held
    assert port.hold_until == 2 * FRAME
    assert ("write", 0, 0x55) not in port.calls

    port.lift(2 * FRAME)
    wire.resume()

    assert port.calls[-1] == ("write", 0, 0x55)
    assert port.time == 2 * FRAME + US


def test_a_byte_of_the_answer_is_there_when_its_frame_has_ended(port: FakePort) -> None:
    wire = line(port)
    port.limit = answered = FRAME + US
    wire.receive(b"\x10")
    assert wire.take() == b""

    for end, byte in ((answered + FRAME, b"D"), (answered + 2 * FRAME, b"\x01")):
        assert port.hold_until == end
        port.lift(end)
        wire.resume()
        assert wire.take() == byte
    assert not port.held


def test_one_thing_happens_after_the_other_where_nobody_waits(port: FakePort) -> None:
    wire = line(port)
    wire.receive(b"\x10\x10\x10")

    assert wire.take() == b"D\x01D\x02D\x03"
    assert port.time == 3 * (3 * FRAME + US)


def test_both_directions_are_under_way_at_once_in_real_time() -> None:
    port = Realtime()
    wire = line(port)
    wire.receive(b"\x10" * 4)

    assert wire.take() == b"D\x01D\x02D\x03D\x04"
    # Of 8 bytes that answer, the first begins when the first request has been carried out.
    assert port.time == FRAME + US + 8 * FRAME


def test_an_answer_on_its_way_arrives_while_the_next_request_waits() -> None:
    port = Realtime()
    wire = line(port, 4 * US)
    # The READS of five bytes is answered by seven; a WAIT of 9 bytes ends within them.
    port.busy_until = NEVER - 1
    port.limit = 1000 * US
    wire.receive(b"\x32\x01\x14" + b"\x34" + (NEVER - 1 >> 4).to_bytes(8, "big"))

    assert port.held
    assert len(wire.take()) == 22


class Ahead(Realtime):
    """Its cycles run ahead of the wall clock; the session is held until that has come there."""

    def read(self, address: int) -> int:
        data = super().read(address)
        self.held, self.hold_until = True, self.time
        return data


def test_the_answer_of_a_cycle_ahead_of_the_wall_clock_takes_its_time() -> None:
    port = Ahead()
    wire = line(port)
    wire.receive(b"\x10")
    assert (wire.take(), port.time) == (b"", FRAME + US)

    port.held = False
    wire.resume()
    assert (wire.take(), port.time) == (b"D\x01", FRAME + US + 2 * FRAME)


@pytest.mark.parametrize("kind", [FakePort, Realtime])
def test_an_edge_is_reported_when_its_frames_have_ended(kind: type[FakePort]) -> None:
    port = kind()
    wire = line(port)
    wire.receive(b"\x60\x00\x00\x00\x01")
    begun = port.time
    wire.receive(b"\x20\x00")

    event = begun + 2 * FRAME + US
    assert wire.take() == b"I\0\0\0\x01" + event.to_bytes(8, "big")
    assert port.time == event + 13 * FRAME


def test_an_edge_between_requests_takes_its_time_too(port: FakePort) -> None:
    wire = line(port)
    wire.receive(b"\x60\x00\x00\x00\x01")
    begun = port.time
    port.write(0, 0)  # somebody else
    wire.resume()

    assert wire.take() == b"I\0\0\0\x01" + (begun + US).to_bytes(8, "big")
    assert port.time == begun + US + 13 * FRAME


@pytest.mark.parametrize("limit", [NEVER, 18 * FRAME])
def test_an_edge_during_a_frame_is_reported_when_that_has_ended(limit: int) -> None:
    class Moving(FakePort):
        """One whose line moves while the second byte of an ECHO's answer is under way."""

        def delay(self, duration: int) -> bool:
            before = self.time
            passed = super().delay(duration)
            if passed and before < 18 * FRAME <= self.time:
                self._edges.append((1, 18 * FRAME))
            return passed

    port = Moving()
    wire = line(port)
    wire.receive(b"\x60\x00\x00\x00\x01")
    port.delay(10 * FRAME)
    assert port.time == 15 * FRAME
    port.limit = limit
    wire.receive(b"\x02\x07")  # 15 to 17: the ECHO, to 19: its answer
    if limit != NEVER:
        assert port.held
        port.lift(NEVER)
        wire.resume()

    event = b"I\0\0\0\x01" + (18 * FRAME).to_bytes(8, "big")
    assert wire.take() == b"E\x07" + event
    assert port.time == (15 + 2 + 2 + 13) * FRAME


def test_a_terminal_shows_each_key_when_it_has_come_back(port: FakePort) -> None:
    wire = SerialLine(port, TerminalProtocol(port), FRAME)
    wire.receive(b"now")

    assert wire.take() == b"now"
    assert port.time == 6 * FRAME


@given(streams, cuts, st.booleans())
def test_the_result_does_not_depend_on_how_bytes_were_cut(
    data: bytes, sizes: list[int], with_lines: bool
) -> None:
    ports = FakePort(), FakePort()
    whole, cut = (line(port, modem=PINS if with_lines else None) for port in ports)
    stream = marked(data) + mark(DTR) + mark(0) if with_lines else data
    whole.receive(stream)
    for piece in pieces(stream, sizes):
        cut.receive(piece)

    assert ports[0].calls == ports[1].calls
    assert ports[0].time == ports[1].time
    assert whole.take() == cut.take()
    assert save(whole) == save(cut)


# -- the lines of a modem --------------------------------------------------------------------------


def pins(port: FakePort) -> list[tuple[object, ...]]:
    return [call[1:] for call in port.calls if call[0] == "pin"]


def test_pins_are_low_while_their_line_is_on(port: FakePort) -> None:
    wire = line(port, modem=ModemPins(((DTR, 0), (RTS, 1), (BREAK, 2)), (), CHANGE))
    for lines in (DTR, DTR | RTS, DTR | RTS | BREAK, DTR | RTS, RTS, 0):
        wire.receive(mark(lines))

    assert pins(port) == [(0, 0), (1, 0), (2, 0), (2, 1), (0, 1), (1, 1)]
    assert port.time == 6 * CHANGE


def test_a_change_of_a_line_takes_its_time_before_anything_follows(port: FakePort) -> None:
    wire = line(port, modem=PINS)
    port.limit = CHANGE - 1
    wire.receive(mark(RTS) + b"\x10")
    assert pins(port) == [(1, 0)]
    assert port.hold_until == CHANGE

    port.lift(NEVER)
    wire.resume()
    assert wire.take() == b"D\x01"
    assert port.time == CHANGE + 3 * FRAME + US


def test_dtr_pulls_reset_low_for_a_time_when_it_goes_on(port: FakePort) -> None:
    wire = line(port, modem=ModemPins((), (3,), CHANGE))
    port.limit = CHANGE - 1
    wire.receive(mark(DTR))
    assert pins(port) == [(3, 0)]

    port.lift(CHANGE)
    wire.resume()
    assert pins(port) == [(3, 0), (3, 2)]
    assert port.time == CHANGE


def test_a_line_that_no_pin_follows_takes_no_time(port: FakePort) -> None:
    wire = line(port, modem=ModemPins(((RTS, 1),), (), CHANGE))
    wire.receive(mark(DTR) + mark(DTR | BREAK))
    assert (pins(port), port.time) == ([], 0)

    wire.receive(mark(RTS))
    assert (pins(port), port.time) == ([(1, 0)], CHANGE)


def test_the_byte_ff_is_no_mark(port: FakePort) -> None:
    wire = line(port, modem=PINS)
    wire.receive(marked(b"\x02\xff\x02\x01"))

    assert wire.take() == b"E\xffE\x01"
    assert not pins(port)


def test_without_a_modem_there_are_no_marks(port: FakePort) -> None:
    wire = line(port)
    wire.receive(b"\x02\xff\x02\x01")

    assert wire.take() == b"E\xffE\x01"


# -- state ---------------------------------------------------------------------------------------


def test_what_is_on_the_line_is_saved_and_loaded() -> None:
    port, other = FakePort(), FakePort()
    wire, copy = line(port, modem=PINS), line(other, modem=PINS)
    port.limit = CHANGE + FRAME + US
    port.answers = {0: [7]}
    other.answers = {0: [7]}
    wire.receive(mark(DTR) + b"\x10\x10\xff")
    load(copy, save(wire))
    assert save(copy) == save(wire)

    other.time = port.time
    port.lift(NEVER)
    other.lift(NEVER)
    wire.resume()
    copy.resume()
    assert copy.take() == wire.take() == b"D\x07D\x07"


def test_a_new_session_finds_nothing_on_the_line(port: FakePort) -> None:
    wire = line(port, modem=PINS)
    fresh = save(wire)
    port.limit = CHANGE
    wire.receive(mark(DTR | BREAK) + b"\x10\x10\xff")
    assert save(wire) != fresh
    wire.reset()

    assert save(wire) == fresh


def test_the_end_of_time_is_told_by_the_request() -> None:
    class Ended(FakePort):
        def delay(self, duration: int) -> bool:
            raise PortError(BAD_AT, "time ends")

    ended = Ended()
    wire = line(ended)
    wire.receive(b"\x10")

    assert wire.take() == b"D\x01"
    assert ended.time == US
