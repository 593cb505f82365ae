"""The pins of a chip as a logic analyser sees them: every edge, and samples at a rate."""

import pytest

from tests.unit.views.conftest import LM629, lm629_move, read, record
from tests.unit.views.scope.decoded import Seen
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.core.errors import VbusError
from vbus.core.kernel import MS, SECOND, US
from vbus.views.scope.frames import ALL, NOW, frame, numbers
from vbus.views.scope.pin_recording import MOST_BYTES, PinRecorder, Sampler
from vbus.views.scope.recording import Recorder

BUS = ["/CS", "/PS", "/RD", "/WR", "D0-D7"]


@pytest.fixture
def board() -> Board:
    return load_board_text(LM629)


def moved(board: Board, pins: PinRecorder) -> list[bytes]:
    """Move, and take what is new several times."""
    found = []
    port = board.open_port("h")
    port.delay(3 * MS)
    for _ in range(3):
        found.append(b"".join(pins.take(numbers)))
        lm629_move(port)
    return [*found, b"".join(pins.take(numbers))]


def test_every_edge_has_its_instant(board: Board) -> None:
    pins = PinRecorder(board)
    whole = Recorder(board, edges=True, strobes=True)
    whole.start()
    pins.start()
    told = pins.described()
    frames = moved(board, pins)
    pins.stop()
    whole.stop()
    expected = Seen(whole.lanes.described(True), b"".join(whole.take(numbers)))
    seen = Seen(told, b"".join(frames))
    assert list(seen.names.values())[:5] == BUS
    for name in (*BUS, "HI", "/RST"):
        assert seen.rows[name] == expected.rows[f"x.{name}"], name
    assert len(seen.rows["/RD"]) > 100
    assert seen.now == board.now
    board.open_port("other").read(0)
    assert len(pins.take(numbers)) == 1  # no edges after the end


@pytest.mark.parametrize(("rate", "width"), [(1_700_003, 2), (20_000_000, 2), (9_999_991, 1)])
def test_samples_are_the_levels_at_their_instants(board: Board, rate: int, width: int) -> None:
    board.open_port("before").delay(1_234_567)
    pins = PinRecorder(board, "x", BUS)
    pins.start()
    begin = board.now
    sampler = Sampler(pins.described(), rate, width)
    frames = moved(board, pins)
    samples = b"".join(part for one in frames for part in sampler.take(one))
    seen = Seen(pins.described(), b"".join(frames))
    places = dict(zip(BUS, (0, 1, 2, 3, 4), strict=True))
    edges = sorted((when, places[name], value) for name in BUS for when, value in seen.rows[name])
    levels = [0] * 5
    expected = bytearray()
    number = 0
    for when, place, value in [*edges, (board.now, 0, 0)]:
        word = sum(level << at for at, level in enumerate(levels)) & (1 << 8 * width) - 1
        while begin * rate + number * SECOND < when * rate:
            expected += word.to_bytes(width, "little")
            number += 1
        levels[place] = value
    assert samples == expected
    assert len(set(samples[::width])) > 5


def test_a_long_rest_comes_in_portions(board: Board) -> None:
    pins = PinRecorder(board, "x", ["/CS", "/RST"])
    pins.start()
    sampler = Sampler(pins.described(), 1_000_000, 1)
    parts = list(sampler.take(b"".join([*pins.take(numbers), frame(NOW, ALL, 0, 200_001 * US)])))
    assert max(map(len, parts)) == MOST_BYTES
    assert b"".join(parts) == b"\x03" * 200_001
    assert list(sampler.take(frame(NOW, ALL, 0, 200_001 * US + 1))) == [b"\x03"]


def test_where_there_was_no_room_the_levels_are_told_anew(board: Board) -> None:
    pins = PinRecorder(board, "x", BUS)
    pins.start()
    lm629_move(board.open_port("h"))
    pins.leave_out()
    seen = Seen(pins.described(), b"".join(pins.take(numbers)))
    nets = [pin.net for pin in board.chips[0].bus_pins]
    assert dict(seen.rows) == {
        name: [(board.now, net.value)] for name, net in zip(BUS, nets, strict=True)
    }


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("y",), 'no chip is called "y"; there are x'),
        (("x", ["/HI"]), "x has no pin /HI; there are "),
    ],
)
def test_what_there_is_not_is_refused(
    board: Board, arguments: tuple[str, list[str]], told: str
) -> None:
    with pytest.raises(VbusError, match=told):
        PinRecorder(board, *arguments)


def test_who_looks_at_pins_changes_no_reply_and_no_instant(moved: bytes) -> None:
    pins: list[PinRecorder] = []

    def watched(port: HostBus) -> None:
        pins.append(PinRecorder(port.board))
        pins[0].start()
        lm629_move(port)

    # The journal's end has the hash of a state in which strobes were played.
    assert read(record(LM629, watched))[1][:-1] == read(moved)[1][:-1]
    assert len(pins[0].take(numbers)) > 5
