"""Runs compared: what the host did, the moves that came of it, and what they cost."""

import io
from collections.abc import Callable

import pytest

from tests.probe import probe
from tests.unit.views.conftest import LM629, lm629_command, lm629_move, lm629_words, record
from tests.unit.views.test_replay import MC1241A
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.core.errors import VbusError
from vbus.core.kernel import MS
from vbus.events.watch import Watch
from vbus.record.format import JournalReader
from vbus.record.journal import Journal
from vbus.views.runs.difference import Difference, Tolerance, differences
from vbus.views.runs.motion import AxisCourse, Motion, Move, moves_of
from vbus.views.runs.run import Run, other_board, recorded_run

RDSTAT, RDRP = "x RDSTAT", "x RDRP"


def mover(
    kp: int = 300, polls: int = 0, pause: int = 300 * MS, late: int = 0
) -> Callable[[HostBus], None]:
    """Return a host that moves by 500 counts."""

    def host(port: HostBus) -> None:
        port.delay(late or 1)
        lm629_command(port, 0x1E, 0x000A, kp, 2000)
        lm629_command(port, 0x04)
        lm629_command(port, 0x1F, 0x002A, 0, 400, 4, 0, 0, 500)
        lm629_command(port, 0x01)
        for _ in range(polls):
            port.read(0)
        port.delay(pause)
        lm629_words(port, 0x0A, 2)

    return host


def run_of(data: bytes) -> Run:
    reader = JournalReader(io.BytesIO(data))
    return recorded_run(reader)


def moved(**keywords: int) -> Run:
    return run_of(record(LM629, mover(**keywords)))


def course(counts: list[int], peak_error: int = 0) -> AxisCourse:
    return AxisCourse(tuple(moves_of(counts)), counts[-1], peak_error)


def told(was: Run, now: Run, tolerance: Tolerance | None = None) -> list[tuple[object, ...]]:
    found = differences(was, now, tolerance or Tolerance())
    return [(one.part, one.what, one.was, one.now) for one in found]


def test_a_run_is_packets_moves_and_what_they_cost() -> None:
    run = moved()
    assert [said.asked for said in run.host] == [
        RDSTAT,
        "x LFIL kp=300 kd=2000 ds=1 samples",
        RDSTAT,
        "x UDF",
        RDSTAT,
        "x LTRJ pos=+500 vel=4.0000 cnt/sample acc=0.006104 cnt/sample/sample",
        RDSTAT,
        "x STT",
        RDSTAT,
        RDRP,
    ]
    assert run.host[-1].text == "x RDRP +500 cnt"
    assert (run.host[-1].clause, run.host[1].when) == ("LM-CMD-11", 53_000_001)
    assert (run.cycles, run.duration) == (256, 300_256_000_001)
    (move,) = run.axes["x.1"].moves
    assert (move.begin, move.duration) == (10 * MS, 134 * MS)
    assert (move.path[0], move.path[-1], move.overshoot) == (2, 499, 0)
    assert run.axes["x.1"].final == 500
    assert run.axes["x.1"].peak_error == 5
    assert run.models == {"x.1": "dc_motor 1"}
    assert not run.violations


def test_the_same_driver_has_no_difference() -> None:
    assert told(moved(), moved()) == []


def test_the_first_other_packet_is_told_and_then_what_came_of_it() -> None:
    was, now = moved(), moved(kp=40)
    first, *rest = differences(was, now)
    assert first == Difference(
        "host", "packet 2", "x LFIL kp=300 kd=2000 ds=1 samples  [LM-CMD-19]",
        "x LFIL kp=40 kd=2000 ds=1 samples  [LM-CMD-19]", "", 53_000_001, 53_000_001,
    )  # fmt: skip
    assert first.lines("a", "b") == [
        "host: packet 2",
        "  a: 53.000001us x LFIL kp=300 kd=2000 ds=1 samples  [LM-CMD-19]",
        "  b: 53.000001us x LFIL kp=40 kd=2000 ds=1 samples  [LM-CMD-19]",
    ]
    assert {one.part for one in rest} == {"motor"}
    assert [one.what for one in rest][-1] == "x.1: peak error"


def test_polls_are_one_packet_whose_last_answer_counts() -> None:
    found = list(differences(moved(), moved(polls=7)))
    assert [(one.part, one.what) for one in found][-2:] == [
        ("cost", "bus cycles"),
        ("cost", "chip time"),
    ]
    assert {one.part for one in found} == {"instant", "cost"}
    assert (found[-2].was, found[-2].now) == (256, 263)
    assert found[-1].lines() == [
        "cost: chip time",
        "  first:  300.256 ms",
        "  second: 300.263 ms",
    ]


def test_an_answer_or_an_instant_alone_is_told_as_such() -> None:
    found = told(moved(), moved(pause=50 * MS))
    answers = [one for one in found if one[0] == "answer"]
    assert answers == [("answer", "packet 10", "x RDRP +500 cnt  [LM-CMD-11]",
                        "x RDRP +114 cnt  [LM-CMD-11]")]  # fmt: skip
    assert [one[1] for one in found if one[0] == "instant"] == ["packet 9"]
    assert not [one for one in found if one[0] == "host"]


def test_what_comes_of_the_first_other_packet_is_not_told_as_before_it() -> None:
    """The status is read between the words of a packet too, which is told at its end."""

    def host(*words: int) -> Callable[[HostBus], None]:
        def work(port: HostBus) -> None:
            port.delay(2 * MS)
            lm629_command(port, 0x1E, *words)

        return work

    was, now = (run_of(record(LM629, host(*words))) for words in ((8, 300), (0x0A, 300, 2000)))
    assert [said.asked for said in was.host] == [RDSTAT, "x LFIL kp=300 ds=1 samples"]
    assert was.host[0].when != now.host[0].when > was.host[1].begun
    first, *rest = differences(was, now)
    assert (first.part, first.what) == ("host", "packet 2")
    assert {one.part for one in rest} <= {"motor", "cost"}


def test_what_differs_before_the_first_other_packet_is_told_before_it() -> None:
    was, now = moved(), moved(kp=40, late=3 * MS)
    found = [(one.part, one.what) for one in differences(was, now)]
    assert found[:2] == [("instant", "packet 1"), ("host", "packet 2")]


def test_a_packet_too_few_is_a_difference_with_nothing_on_its_side() -> None:
    def home(port: HostBus) -> None:
        port.delay(MS)
        port.write(0, 0x02)

    run, more = moved(), run_of(record(LM629, mover(), home))
    first = next(differences(run, more))
    assert (first.what, first.was, first.now) == ("packet 11", None, "x DFH  [LM-CMD-3]")
    assert first.lines()[1] == "  first:  nothing"


def test_violations_are_counted_by_chip_and_rule() -> None:
    def careless(port: HostBus) -> None:
        mover()(port)
        port.delay(MS)
        port.write(0, 0x02)
        port.write(0, 0x02)

    found = told(moved(), run_of(record(LM629, careless)))
    assert found[-1] == ("violations", "x lm628.busy-write", 0, 1)


def test_what_is_within_the_tolerance_is_no_difference() -> None:
    was, now = moved(), moved(polls=7)
    assert told(was, now, Tolerance(0, 0.15, 0.028)) == []
    assert told(was, now, Tolerance(0, 0.15, 0.027)) == [("cost", "bus cycles", 256, 263)]
    assert told(now, was, Tolerance(0, 0.15, 0.0, limit=True)) == []
    assert told(was, now, Tolerance(0, 0.15, 0.0, limit=True)) == [("cost", "bus cycles", 256, 263)]


def test_a_position_may_be_so_far_off_and_no_further() -> None:
    def at(offset: int) -> Run:
        counts = [0, 0, 10, 20 + offset, 40, 50, *[50] * 30]
        return Run(axes={"x.1": course(counts)})

    assert told(at(0), at(1)) == [
        ("motor", "x.1, move 1: 2 ms after its beginning at", 20, 21),
    ]
    assert told(at(0), at(23), Tolerance(3)) == []  # a look later it is at 40 anyway
    assert told(at(0), at(24), Tolerance(3)) == [
        ("motor", "x.1, move 1: 2 ms after its beginning at", 20, 44),
    ]


@pytest.mark.parametrize(
    ("counts", "moves"),
    [
        ([], []),
        ([5] * 40, []),
        ([0, 1, 2, 1, 0, 2], []),
        ([0, 0, 3, 6, *[6] * 19, 9], [Move(MS, (0, 3, 6, *[6] * 19, 9))]),
        ([0, 0, 3, 6, *[6] * 20, 9], [Move(MS, (0, 3, 6)), Move(23 * MS, (6, 9))]),
        ([0, -30, -60, -50], [Move(0, (0, -30, -60, -50))]),
    ],
)
def test_a_move_is_what_lies_between_two_rests(counts: list[int], moves: list[Move]) -> None:
    assert list(moves_of(counts)) == moves


@pytest.mark.parametrize(
    ("path", "overshoot"),
    [((0, 30, 60, 50), 10), ((0, -30, -60, -50), 10), ((0, 30, 60), 0), ((9, 20, 9), 11)],
)
def test_overshoot_is_what_lies_beyond_the_end(path: tuple[int, ...], overshoot: int) -> None:
    assert Move(0, path).overshoot == overshoot


def test_another_number_of_moves_and_another_place_are_told() -> None:
    was = Run(axes={"x.1": course([0, 10, *[10] * 30, 20], 4)})
    now = Run(axes={"x.1": course([0, 10, *[10] * 33], 7)})
    assert told(was, now) == [
        ("motor", "x.1: moves", 2, 1),
        ("motor", "x.1: final position", 20, 10),
        ("motor", "x.1: peak error", 4, 7),
    ]


def test_a_journal_that_is_not_closed_cannot_be_compared() -> None:
    with pytest.raises(VbusError, match=r"it was not closed \(its end is missing\)"):
        run_of(record(LM629, lm629_move, close=False))
    with pytest.raises(VbusError, match=r"it was not closed \(cut in the block at byte \d+\)"):
        run_of(record(LM629, lm629_move)[:-5])


def test_a_board_of_python_cannot_be_built_again() -> None:
    board = Board("bench")
    file = io.BytesIO()
    Journal(board, file).close()
    with pytest.raises(VbusError, match="made in Python, which cannot be built again"):
        run_of(file.getvalue())


def test_a_run_that_something_else_has_changed_is_not_compared() -> None:
    def pushed(port: HostBus) -> None:
        mover(pause=0)(port)
        port.board.run_for(50 * MS)  # as the journal does not know
        lm629_words(port, 0x0A, 2)
        probe(port.board.chips[0]).real_position += 1

    with pytest.raises(VbusError, match="its run is another one when it is played again: entry "):
        run_of(record(LM629, pushed))


@pytest.mark.parametrize(
    ("right", "wrong", "sentence"),
    [
        ("", "", ""),
        ('name = "bench"', 'name = "bench"  # mine', ""),
        ('"8 MHz"', '"6 MHz"', "chips.x.clock = '8 MHz' in one and '6 MHz' in the other"),
        ('clock = "8 MHz"\n', 'clock = "8 MHz"\nbusy_clk = 200\n',
         "chips.x.busy_clk stands in the second alone"),
        ('power_on = "done"\n', "", "board.power_on stands in the first alone"),
        ("[plants.m]", '[[hosts]]\ntransport = "tcp:5000"\n[plants.m]', ""),
    ],
)  # fmt: skip
def test_boards_are_the_same_if_the_same_stands_on_them(
    right: str, wrong: str, sentence: str
) -> None:
    headers = [
        JournalReader(io.BytesIO(record(text))).header
        for text in (LM629, LM629.replace(right, wrong))
    ]
    assert other_board(*headers) == sentence


def test_an_axis_of_several_has_its_own_error() -> None:
    text = MC1241A.replace('["none"]', '["m"]') + '[plants.m]\nmodel = "ideal"\n'
    run = run_of(record(text, lambda port: port.delay(3 * MS)))
    assert run.axes == {"x.1": AxisCourse((), 0, 0)}
    assert run.models == {"x.1": "ideal 1"}


def test_who_looks_changes_nothing_that_hosts_are_promised() -> None:
    """SYNC tells how long no output moves: the same while the motion is looked at."""
    board = load_board_text(LM629)
    before = board.open_port("host").sync()
    Motion(board)
    assert board.open_port("other").sync() == before
    Watch("x.real > 40", board, met=lambda: None).begin()
    assert board.open_port("third").sync() == before
