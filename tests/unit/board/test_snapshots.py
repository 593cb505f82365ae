"""Snapshots: what follows one is what would have followed anyway, also through a file."""

import hashlib
import io
import subprocess
import sys
from dataclasses import replace

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vbus.board import snapshot as snapshots
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.chips.base import Chip
from vbus.core.errors import SnapshotError
from vbus.core.kernel import MS, US
from vbus.core.signals import Observer
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.framed import FramedProtocol
from vbus.protocols.text import TextProtocol
from vbus.record.journal import Journal

BENCH = """\
[board]
name = "bench"
time = "lockstep"
seed = 5
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "motor"
busy_jitter_clk = 40
[chips.y]
part = "MCP-1200"
clock = "2 MHz"
plant = "second"
[chips.z]
part = "MC1241A"
clock = "25 MHz"
plants = ["stepper", "third"]
[plants.motor]
model = "dc_motor"
[plants.second]
model = "dc_motor"
static_friction = "0.01 N*m"
[plants.stepper]
model = "stepper"
[plants.third]
model = "stepper"
[nets.home]
pins = ["x.HI", "y./STOP"]
"""


def drive(board: Board, port, work: list[tuple[int, ...]]) -> list[int]:
    """Do what a careless host does; return what it read."""
    got = []
    for kind, chip, address, data in work:
        port.select(1 << chip)
        if kind == 0:
            got.append(port.read(address))
        elif kind == 1:
            port.write(address, data)
        elif kind == 2:
            port.delay(data * 10 * US)
        else:
            port.pin(address % len(port.info().pins), data % 3)
    got.append(board.now)
    return got


work = st.lists(
    st.one_of(
        st.tuples(st.just(0), st.just(0), st.integers(0, 1), st.just(0)),
        st.tuples(st.just(1), st.just(0), st.integers(0, 1), st.integers(0, 0x1F)),
        st.tuples(st.integers(0, 1), st.just(1), st.integers(0, 0x3F), st.integers(0, 255)),
        st.tuples(st.integers(0, 1), st.just(2), st.integers(0, 1), st.integers(0, 255)),
        st.tuples(st.just(2), st.integers(0, 2), st.just(0), st.integers(0, 300)),
        st.tuples(st.just(3), st.integers(0, 2), st.integers(0, 40), st.integers(0, 2)),
    ),
    max_size=25,
)


def rest_of_run(board: Board, port, more: list[tuple[int, ...]]) -> tuple[object, ...]:
    got = drive(board, port, more)
    return got, board.state_hash(), dict(board.counters)


@given(work, work)
@settings(max_examples=60)
def test_a_run_goes_on_from_a_snapshot_as_it_would_have_gone_on(
    first: list[tuple[int, ...]], more: list[tuple[int, ...]]
) -> None:
    board = load_board_text(BENCH)
    port = board.open_port("h")
    drive(board, port, first)
    data = snapshots.write(snapshots.take(board))
    twin = snapshots.fork(board)
    expected = rest_of_run(board, port, more)

    assert rest_of_run(twin, twin.ports[0], more) == expected
    snapshot = snapshots.read(data)
    later = snapshots.rebuild(snapshot)
    again = later.open_port("h")
    snapshots.restore(later, snapshot)
    assert later.state_hash() == snapshot.digest
    assert rest_of_run(later, again, more) == expected
    # And back again, on the board that has run on.
    snapshots.restore(board, snapshot)
    assert rest_of_run(board, port, more) == expected


class Edges(Observer):
    def __init__(self) -> None:
        self.seen: list[tuple[int, str, int]] = []

    def edge(self, when: int, net: str, level: int) -> None:
        self.seen.append((when, net, level))


def test_edges_follow_on_a_board_whose_nets_somebody_watches_only_now() -> None:
    board = load_board_text(BENCH)
    port = board.open_port("h")
    drive(board, port, [(1, 0, 0, 0x1E), (2, 0, 0, 50)])
    snapshot = snapshots.take(board)
    seen = []
    for loaded in (False, True):
        twin = snapshots.rebuild(snapshot)
        edges = Edges()
        twin.watch("x.MAG", edges)
        twin_port = twin.open_port("h")
        if loaded:
            snapshots.restore(twin, snapshot)
        else:
            drive(twin, twin_port, [(1, 0, 0, 0x1E), (2, 0, 0, 50)])
            edges.seen.clear()
        twin.run_for(2 * MS)
        seen.append(edges.seen)
    assert seen[0] == seen[1]


def test_a_fork_and_its_origin_go_their_own_ways() -> None:
    board = load_board_text(BENCH)
    port = board.open_port("h")
    twin = snapshots.fork(board)
    port.write(0, 0x02)
    assert board.now == US
    assert twin.now == 0
    assert [p.label for p in twin.ports] == ["h"]
    assert twin.state_hash() != board.state_hash()


@pytest.mark.parametrize("kind", [ByteProtocol, TextProtocol, FramedProtocol])
@given(data=st.data())
def test_half_a_request_is_kept_whatever_the_wire_format(kind, data) -> None:
    if kind is TextProtocol:
        whole = b"select z\nr 1\nw 0 5\nr 0\n"
    else:
        whole = bytes([0x01, 1, 0x03, 0, 4, 0x11, 0x20, 5, 0x32, 1, 3, 0x10])
    if kind is FramedProtocol:
        from vbus.protocols.frames import frames

        whole = b"".join(frames(n, whole) for n in (0, 1))
    cut = data.draw(st.integers(0, len(whole)))
    answers = []
    for way in range(2):
        board = load_board_text(BENCH)
        port = board.open_port("h")
        wire = kind(port)
        wire.receive(whole[:cut])
        out = wire.take()
        if way:
            snapshot = snapshots.read(snapshots.write(snapshots.take(board, {0: wire})))
            board = snapshots.rebuild(snapshot)
            wire = kind(board.open_port("h"))
            snapshots.restore(board, snapshot, {0: wire})
        wire.receive(whole[cut:])
        answers.append((out + wire.take(), board.now))
    assert answers[0] == answers[1]


def test_a_session_that_is_not_there_any_more_has_let_go() -> None:
    board = load_board_text(BENCH)
    port = board.open_port("gone")
    reset = port.pin_number("x./RST")
    port.pin(reset, 0)
    assert port.claim()
    snapshot = snapshots.take(board)
    port.close()
    other = board.open_port("here")
    snapshots.restore(board, snapshot)
    assert board.find_pin("x./RST").net.value == 1
    assert board.hosts.claims == {}
    assert [p.label for p in board.ports] == ["here"]
    assert other.read(0) in range(256)


def test_a_session_that_came_later_stays_and_holds_nothing() -> None:
    board = load_board_text(BENCH)
    snapshot = snapshots.take(board)
    port = board.open_port("late")
    port.pin(port.pin_number("x./RST"), 0)
    port.claim()
    port.delay(MS)
    snapshots.restore(board, snapshot)
    assert board.now == 0
    assert board.find_pin("x./RST").net.value == 1
    assert board.hosts.claims == {}
    port.write(0, 0x02)
    assert board.now == US


def test_its_size_does_not_grow_with_the_time_that_has_passed() -> None:
    board = load_board_text(BENCH)
    board.open_port("h")
    sizes = []
    for pause in (MS, 3600 * 1000 * MS):
        board.run_for(pause)
        sizes.append(len(snapshots.write(snapshots.take(board))))
    assert sizes[1] < 1.2 * sizes[0]  # longer numbers, no more of them


def test_another_process_goes_on_in_the_same_way() -> None:
    board = load_board_text(BENCH)
    port = board.open_port("h")
    drive(board, port, [(1, 0, 0, 0x02), (2, 0, 0, 7), (1, 1, 5, 3)])
    data = snapshots.write(snapshots.take(board))
    board.run_for(5 * MS)
    program = (
        "import sys\nfrom vbus.board import snapshot as s\n"
        "found = s.read(sys.stdin.buffer.read())\nboard = s.rebuild(found)\n"
        "board.open_port('h')\ns.restore(board, found)\nboard.run_for(5 * 10**9)\n"
        "print(board.state_hash())\n"
    )
    done = subprocess.run([sys.executable, "-c", program], input=data, capture_output=True)
    assert done.stdout.decode().strip() == board.state_hash(), done.stderr.decode()


# -- what is refused ------------------------------------------------------------------------------


def taken() -> bytes:
    return snapshots.write(snapshots.take(load_board_text(BENCH)))


def test_a_file_whose_content_is_empty_is_refused() -> None:
    body = msgpack.packb([])
    data = snapshots.MAGIC + hashlib.sha256(body).digest() + body
    with pytest.raises(SnapshotError, match=r"^f\.snap: its content makes no sense: "):
        snapshots.read(data, "f.snap")


@given(st.data())
@settings(max_examples=30)
def test_a_damaged_file_is_refused(data) -> None:
    content = bytearray(taken())
    place = data.draw(st.integers(0, len(content) - 1))
    content[place] ^= 1 << data.draw(st.integers(0, 7))
    with pytest.raises(SnapshotError, match=r"^f\.snap"):
        snapshots.read(bytes(content), "f.snap")
    with pytest.raises(SnapshotError, match=r"^f\.snap"):
        snapshots.read(taken()[:place], "f.snap")


def test_a_later_format_is_refused_by_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(snapshots, "VERSION", 3)
    later = taken()
    monkeypatch.undo()
    with pytest.raises(SnapshotError, match="format 3; this vbus reads format 1"):
        snapshots.read(later)


def test_another_board_is_refused_and_stays_as_it_was() -> None:
    snapshot = snapshots.read(taken())
    board = load_board_text(BENCH.replace("LM629N-8", "LM628N-8").replace('"x.HI", ', ""))
    before = board.state_hash()
    with pytest.raises(SnapshotError, match=r"x = LM629N-8, y = MCP-1200.*x = LM628N-8"):
        snapshots.restore(board, snapshot)
    board = load_board_text(BENCH.replace("seed = 5", "seed = 6"))
    with pytest.raises(SnapshotError, match="another version of the board file"):
        snapshots.restore(board, snapshot)
    assert load_board_text(BENCH.replace("LM629N-8", "LM628N-8")
                           .replace('"x.HI", ', "")).state_hash() == before  # fmt: skip


def test_a_board_made_in_python_cannot_be_forked_and_says_what_to_do() -> None:
    board = Board("hand")
    with pytest.raises(SnapshotError, match="put together in Python"):
        snapshots.fork(board)


@pytest.mark.core("interpreted")  # an object of a compiled class keeps its class
def test_a_chip_whose_state_cannot_be_kept_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    board = load_board_text(BENCH)

    class Odd(type(board.chips[0])):  # type: ignore[misc]
        STATE = (*type(board.chips[0]).STATE, "thing")
        thing = object()

    board.chips[0].__class__ = Odd
    with pytest.raises(SnapshotError, match=r"chip x \(Odd\) or a plant of it has a field that"):
        snapshots.take(board)


def test_a_snapshot_of_another_version_of_vbus_is_loaded() -> None:
    snapshot = replace(snapshots.read(taken()), vbus="0.0.1")
    board = snapshots.rebuild(snapshot)
    snapshots.restore(board, snapshot)
    assert board.now == snapshot.when


def test_a_state_that_lacks_the_level_of_a_pin_is_refused() -> None:
    board = load_board_text(BENCH)
    before = board.save()
    with pytest.raises(SnapshotError):
        board.load({**before, "levels": before["levels"][:-1]})


def test_a_state_that_lacks_a_chip_is_refused() -> None:
    board = load_board_text(BENCH)
    before = board.save()
    with pytest.raises(SnapshotError):
        board.load({**before, "chips": before["chips"][:-1]})
    assert board.save() == before


def test_journal_and_snapshot_do_not_disturb_each_other() -> None:
    board = load_board_text(BENCH)
    Journal(board, io.BytesIO(), BENCH)
    assert isinstance(board.chips[0], Chip)
    board.open_port("h").write(0, 2)
    assert snapshots.fork(board).state_hash() == board.state_hash()
