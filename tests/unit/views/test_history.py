"""A recorded run, walked through in both directions; the first place where something holds."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.views.conftest import LM629, lm629_move, read, record
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.core.errors import VbusError
from vbus.core.kernel import MS
from vbus.events.watch import ConditionTracker
from vbus.record.history import History
from vbus.record.player import Player

_, RUN = read(record(LM629, lm629_move, lm629_move))


def make() -> Board:
    return load_board_text(LM629)


def stepped(position: int) -> str:
    """The state after some entries, played from the start."""
    player = Player(make())
    for entry in RUN[:position]:
        player.play(entry)
    return player.board.state_hash()


@given(st.lists(st.integers(0, len(RUN)), min_size=1, max_size=8), st.integers(1, 60))
@settings(max_examples=30)
def test_every_way_to_a_position_ends_in_the_same_state(ways: list[int], every: int) -> None:
    history = History(make, RUN, every=every, keep=5)
    for position in ways:
        history.to(position)
        assert history.position == position
    assert history.board.state_hash() == stepped(ways[-1])


def test_a_step_back_undoes_one_call() -> None:
    history = History(make, RUN, every=16)
    history.to(100)
    before = history.board.state_hash()
    history.step()
    history.step(-1)
    assert history.board.state_hash() == before
    assert history.step(-1000).now == 0
    assert history.position == 0
    history.step(10**6)
    assert history.position == len(RUN)


def test_an_instant_is_reached_exactly_from_both_sides() -> None:
    history = History(make, RUN, every=16)
    pause = next(e for e in RUN if e.op == "delay" and e.after - e.when > MS)
    following = RUN[pause.number + 1]
    for when, stands in ((pause.after, pause.after), (pause.after - 1, pause.when)):
        states = []
        for start in (0, len(RUN)):
            history.to(start)
            board = history.to_instant(when)
            assert board.now == stands
            states.append(board.state_hash())
        assert states[0] == states[1]
    assert history.to(following.number + 1).state_hash() == stepped(following.number + 1)


def test_a_position_the_run_does_not_have_is_refused() -> None:
    with pytest.raises(ValueError, match=f"position -1: the run has 0 to {len(RUN)}"):
        History(make, RUN).to(-1)


def test_the_snapshots_of_a_long_run_stay_few() -> None:
    history = History(make, RUN, every=1, keep=8)
    history.to(len(RUN))
    assert 4 <= len(history._snapshots) <= 8, "and not fewer than they must be"


@pytest.mark.parametrize("walked", [False, True])
def test_the_first_violation_is_found_wherever_the_run_stands(walked: bool) -> None:
    """The move's careless second STT is written while busy."""
    history = History(make, RUN, every=8)
    if walked:
        history.to(len(RUN))
    holds = ConditionTracker("lm628.busy-write", history.board)
    found = history.first(holds)
    assert found is not None
    first = next(e for e in RUN if e.op == "violation" and e.args[2] == "lm628.busy-write")
    assert (found.op, found.args) == ("write", (0, 0x01))
    assert abs(found.number - first.number) == 1


def test_the_first_call_after_which_an_axis_is_beyond_a_place_is_found() -> None:
    history = History(make, RUN)
    holds = ConditionTracker("x.real>100", history.board)
    found = history.first(holds)
    assert found is not None
    assert history.board.chip("x").telemetry()["real"] > 100
    board = history.to(found.number)
    board.catch_up()
    assert board.chip("x").telemetry()["real"] <= 100


def test_what_never_holds_is_said_to() -> None:
    history = History(make, RUN)
    assert history.first(ConditionTracker("x.real > 1e9", history.board)) is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("nonsense", 'condition "nonsense": no "nonsense" at character 1; this board has x, and'),
        ("y.HI=1", 'no "y.HI" at character 1; did you mean "x.HI"? this board has x'),
        ("x.height=1", 'no "x.height" at character 1; did you mean "x.HI"? x has the values'),
        ("x.HI=high", 'no "high" at character 6; this board has x'),
    ],
)
def test_a_condition_that_makes_no_sense_is_refused(text: str, says: str) -> None:
    with pytest.raises(VbusError) as caught:
        ConditionTracker(text, make())
    assert says in str(caught.value)


def test_a_pin_is_a_condition() -> None:
    def host(port: HostBus) -> None:
        reset = port.pin_number("x./RST")
        for level in (0, 1):
            port.delay(MS)
            port.pin(reset, level)

    _, entries = read(record(LM629, host))
    history = History(make, entries)
    for level in (0, 1):
        found = history.first(ConditionTracker(f"x./RST={level}", history.board))
        if level:
            assert found is None  # it is high from the start: no call has made it so
        else:
            assert found is not None
            assert found.args[1] == 0


@pytest.mark.parametrize(
    ("text", "op"),
    [
        ("command STT", "write"),
        ("x.command == RDRP", "read"),
        ("violation lm628", "write"),
        ("rising(x.real)", "delay"),
        ("lm628.busy-write and x.real > 100", "delay"),
    ],
)
def test_what_has_happened_during_a_call_holds_after_it(text: str, op: str) -> None:
    history = History(make, RUN)
    found = history.first(ConditionTracker(text, history.board))
    assert found is not None
    assert found.op == op
    assert history.position == found.number + 1
