"""What the scope records: the values the board had, from the instant on at which it had them."""

import io

import pytest

from tests.unit.views.conftest import LM629, board_of, lm629_move, read
from tests.unit.views.scope.decoded import Seen
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.chips.packets import Packet
from vbus.circuit.stream import PacketTaker
from vbus.core.kernel import MS, US
from vbus.record.journal import Journal
from vbus.record.replay import Replay
from vbus.record.view import play
from vbus.views.scope.frames import numbers, small
from vbus.views.scope.lanes import Lateness
from vbus.views.scope.recording import COMMAND, STATUS_READ, VIOLATED, Recorder

SAMPLE = 256 * US


def seen(recorder: Recorder) -> Seen:
    return Seen(recorder.lanes.described(False), b"".join(recorder.take()))


def replayed(data: bytes, **options: bool) -> Seen:
    header, entries = read(data)
    recorder = Recorder(board_of(header), edges=True, **options)
    recorder.start()
    assert Replay(recorder.board, entries, header.families).run().divergence is None
    recorder.stop()
    return seen(recorder)


@pytest.fixture(scope="module")
def move(moved: bytes) -> Seen:
    return replayed(moved)


def told_at_each_sample(key: str) -> list[tuple[int, float]]:
    """What the chip tells at each sample of the same run, where it is another than before."""
    board = load_board_text(LM629)
    found: list[tuple[int, float]] = []

    def look() -> None:
        value = board.chips[0].telemetry()[key]
        assert not isinstance(value, str)
        if not found or found[-1][1] != value:
            found.append((board.now, value))
        timer.at(board.now + SAMPLE)

    timer = board.kernel.timer(look)
    look()
    lm629_move(board.open_port("h"))
    return found


@pytest.mark.parametrize(
    ("name", "key", "scale"),
    [
        ("desired", "desired", 65536), ("real", "real", 1), ("error", "error", 1),
        ("velocity", "real_velocity", 1), ("profile", "velocity", 65536),
        ("output", "output", 2048),
    ],
)  # fmt: skip
def test_numbers_are_what_the_chip_tells_at_each_sample(
    move: Seen, name: str, key: str, scale: int
) -> None:
    rows = move.rows[f"x.{name}"]
    assert [(when, value / scale) for when, value in rows] == told_at_each_sample(key)
    assert len(rows) > 10
    (lane,) = (lane for lane in move.description["lanes"] if lane["name"] == name)
    assert lane["scale"] == 1 / scale


def test_the_motor_is_told_one_period_ahead(move: Seen) -> None:
    board = load_board_text(LM629)
    plant = board.plants[0]
    found: list[tuple[int, int]] = [(0, 0)]

    def look() -> None:
        board.chips[0].advance()
        value = round(plant.telemetry()["current"] * 10_000)
        if value != found[-1][1]:
            found.append((board.now + SAMPLE, value))
        timer.at(board.now + SAMPLE)

    timer = board.kernel.timer(look)
    look()
    lm629_move(board.open_port("h"))
    assert move.rows["x.current"] == found
    assert max(value for _, value in found) > 100
    assert move.rows["x.load"] == [(0, 0)]


def test_packets_are_those_of_the_journal_in_its_words(move: Seen, moved: bytes) -> None:
    header, entries = read(moved)
    packets: list[Packet] = []
    taker = PacketTaker(lambda chip, packet: packets.append(packet))
    play(header, entries, taker)
    packets.sort(key=lambda packet: packet.begin)
    expected = [
        (p.begin, p.end - p.begin, f"{p.text}  [{p.clause}]" if p.clause else p.text)
        for p in packets
    ]
    assert [row[:3] for row in move.packets("x bus")] == expected
    found = {label.split(" ")[0]: kind for _, _, label, kind in move.packets("x bus")}
    assert found["LFIL"] == found["RDRP"] == COMMAND
    assert {kind for _, span, _, kind in move.packets("x bus") if span} == {COMMAND}
    assert {kind for _, _, _, kind in move.packets("x bus")} == {COMMAND, STATUS_READ, VIOLATED}


def test_a_violation_is_marked_with_its_rule_its_clause_and_its_packet(move: Seen) -> None:
    ((when, mark),) = move.rows["violations"]
    assert mark["rule"] == "lm628.busy-write"
    assert mark["clause"].startswith("LM-")
    assert mark["kind"] == "violation"
    (packet,) = (row for row in move.packets("x bus") if row[3] == 4)
    assert move.labels[mark["label"]] == packet[2]
    assert packet[0] <= when <= packet[0] + packet[1]
    assert [mark["text"] for _, mark in move.rows["hosts"]] == ["host0"]


def test_a_line_has_each_edge_at_its_instant() -> None:
    def host(port: HostBus) -> None:
        port.delay(1_000_003)
        port.pin(port.pin_number("/RST"), 0)
        port.delay(9 * US)
        port.pin(port.pin_number("/RST"), 1)

    board = load_board_text(LM629)
    recorder = Recorder(board, edges=True)
    recorder.start()
    host(board.open_port("h"))
    recorder.stop()
    lines = seen(recorder)
    assert lines.rows["x./RST"] == [(0, 1), (1_000_003, 0), (10_000_003, 1)]
    assert "x./WR" not in lines.names.values()


def test_strobes_are_lines_where_they_are_asked_for(moved: bytes) -> None:
    lines = replayed(moved, strobes=True)
    first = lines.rows["x./RD"][:3]
    assert [level for _, level in first] == [1, 0, 1]
    assert first[2][0] == lines.packets("x bus")[0][0]
    assert lines.rows["x.D0-D7"][1][1] == 0x84


def test_how_far_time_has_come_is_told_last(move: Seen, moved: bytes) -> None:
    _, entries = read(moved)
    assert move.now == entries[-1].after
    assert move.description["now"] == str(move.now)
    (axis,) = move.description["axes"]
    assert axis["sample"] == SAMPLE
    assert axis["counts_per_rev"] == 2000


@pytest.mark.parametrize("skew", [None, 250_000])
def test_how_late_a_board_in_real_time_is_and_how_overloaded_are_lanes(skew: int | None) -> None:
    board = load_board_text(LM629.replace('"lockstep"', '"realtime"'))
    recorder = Recorder(board, edges=False, late=lambda: Lateness(5 * 10**9, 1.5, skew))
    recorder.start()
    seen = Seen(recorder.lanes.described(True), b"".join(recorder.take(small)))
    assert [row[1] for row in seen.rows["wall lag"]] == [5 * 10**9]
    assert [row[1] for row in seen.rows["overload"]] == [150]
    named = [lane["name"] for lane in seen.description["lanes"] if lane["kind"] == "number"]
    assert ("skew" in named) is (skew is not None)
    assert [row[1] for row in seen.rows.get("skew", [])] == [250_000] * ("skew" in named)


def test_what_was_taken_is_not_told_again_and_labels_go_on() -> None:
    board = load_board_text(LM629)
    recorder = Recorder(board, edges=False)
    recorder.start()
    port = board.open_port("h")
    frames = recorder.take(numbers)
    lm629_move(port)
    frames += recorder.take(numbers)
    port.read(0)
    last = recorder.take(numbers)
    assert len(last) == 2  # one packet, and how far time has come
    live = Seen(recorder.lanes.described(True), b"".join([*frames, *last]))
    whole = load_board_text(LM629)
    other = Recorder(whole, edges=False)
    other.start()
    port = whole.open_port("h")
    lm629_move(port)
    port.read(0)
    once = Seen(other.lanes.described(True), b"".join(other.take(small)))
    assert live.labels == once.labels
    assert {**live.rows, "violations": []} == {**once.rows, "violations": []}


def test_what_there_is_no_room_for_is_left_out_and_values_are_told_anew() -> None:
    board = load_board_text(LM629)
    recorder = Recorder(board, edges=False)
    recorder.start()
    port = board.open_port("h")
    lm629_move(port)
    recorder.leave_out()
    left = board.now
    port.delay(MS)
    found = seen(recorder)
    assert not found.rows["x bus"]
    assert {when > left for when, _ in found.rows["x.real"]} == {True}
    assert len(found.rows["x.load"]) == 1
    port.read(0)
    later = Seen(recorder.lanes.described(False), b"".join(recorder.take()))
    ((_, _, label, _, _),) = later.rows["x bus"]
    assert found.labels[label].startswith("RDSTAT")


def test_where_something_is_left_out_of_a_board_that_runs_it_is_marked() -> None:
    board = load_board_text(LM629)
    recorder = Recorder(board, edges=False, late=Lateness)
    recorder.start()
    recorder.take()
    port = board.open_port("h")
    port.delay(1000 * MS)
    recorder.leave_out()
    port.delay(500 * MS)
    recorder.leave_out()
    ((when, mark),) = seen(recorder).rows["left out"]
    assert (when, mark["kind"]) == (0, "gap")
    assert mark["text"] == "1.500 s from here on are left out: the scope did not keep up"
    assert not Seen(recorder.lanes.described(False), b"".join(recorder.take())).rows["left out"]


def test_a_chip_that_rests_is_looked_at_when_somebody_touches_it() -> None:
    board = load_board_text(LM629)
    recorder = Recorder(board, edges=False)
    recorder.start()
    port = board.open_port("h")
    port.delay(10_000_000 * MS)
    lm629_move(port)
    first, *others = seen(recorder).rows["x.real"]
    assert first == (0, 0)
    assert others == moved_after(10_000_000 * MS)


def test_a_poll_that_reads_the_same_again_has_not_touched_a_chip_that_rests() -> None:
    board = load_board_text(LM629)
    recorder = Recorder(board, edges=False)
    recorder.start()
    port = board.open_port("h")
    port.delay(100 * MS)
    look = recorder._looks["x"]
    dues = []
    for touch in (port.read, port.read, lambda _: port.write(0, 0x02), port.read, port.read):
        port.delay(MS)
        before = look.due
        touch(0)
        dues.append((look.due == board.now, look.due == before))
    touched, left = (True, False), (False, True)
    assert dues == [touched, left, touched, touched, left]


def moved_after(rest: int) -> list[tuple[int, int]]:
    """Where the motor is from each sample on, if a host comes after a rest."""
    board = load_board_text(LM629)
    port = board.open_port("h")
    port.delay(rest)
    found: list[tuple[int, int]] = []

    def look() -> None:
        value = board.chips[0].telemetry()["real"]
        if value != (found[-1][1] if found else 0):
            found.append((board.now, int(value)))
        timer.at(board.now + SAMPLE)

    timer = board.kernel.timer(look)
    timer.at(-(-rest // SAMPLE) * SAMPLE)
    lm629_move(port)
    return found


def run(watched: bool) -> tuple[bytes, str, str, Board]:
    board = load_board_text(LM629)
    board.start_trace()
    file = io.BytesIO()
    journal = Journal(board, file, LM629, "board.toml")
    recorder = Recorder(board, edges=False)
    if watched:
        recorder.start()
    port = board.open_port("h")
    for _ in range(5):  # a chip that rests promises more than when it is looked at again
        port.sync()
        port.lease(0)
        port.delay(700 * US)
    lm629_move(port)
    for _ in range(20):
        port.sync()
        port.lease(0)
        port.delay(700 * US)
        recorder.take() if watched else None
    state, trace = board.state_hash(), board.trace_hash()
    journal.close()
    return file.getvalue(), state, trace, board


def test_watched_and_unwatched_runs_are_equal_to_the_last_byte() -> None:
    alone, watched = run(False), run(True)
    assert alone[:3] == watched[:3]
    assert list(alone[3].violations) == list(watched[3].violations)
