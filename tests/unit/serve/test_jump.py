"""A live board that goes back: what it is then, what its journal says, and when it refuses."""

import io
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from tests.unit.faults.bench import build
from tests.unit.serve.test_steps import READ, RESET, Bench, delay, heard
from vbus.boardfile.sections import RecordSection
from vbus.cli.journal_lines import decoded
from vbus.core.kernel import MS
from vbus.record.format import Entry, JournalReader
from vbus.record.replay import Replay
from vbus.serve.host_entry import HostEntry, LinkSpec
from vbus.serve.local_socket import Order
from vbus.serve.orders.fault_orders import FaultOrders
from vbus.serve.orders.jump import JumpBack
from vbus.serve.recording import Recording
from vbus.serve.time.steps import PAUSED

COMMAND = RESET[:1]
"""Write at address 0."""


class Hand(Bench):
    """A board with a journal in a file, in the hands of a session of its own, which can go back."""

    WHO = "a scope"
    path: Path

    def record(self) -> None:
        self.recording = Recording(self.board, self.board.text, "b.toml", pytest.fail)
        self.recording.open(RecordSection(journal=str(self.path)))
        assert self.recording.journal is not None
        self.journal = self.recording.journal

    def begin(self) -> None:
        self.onlookers: list[Hand] = [self]
        self.jump = JumpBack(self.board, self.pacer, self.steps, lambda: self.onlookers)
        self.jump.recording = self.recording
        self.join()

    def own_orders(self) -> dict[str, Order]:
        assert self.manual is not None
        back = partial(self.jump.begin, own=self, port=self.manual.port)
        return {**super().own_orders(), "back": back}

    def step_aside(self) -> None:
        assert self.manual is not None
        self.manual.end(go_on=False)

    def step_in(self) -> None:
        assert self.manual is not None
        self.manual.attach()

    def drive(self, requests: bytes, ns: int = 5_000_000) -> bytes:
        """Let a host come, ask, and go."""
        far = self.host()
        far.send(requests)
        self.turn(ns)
        answers = heard(far)
        self.sessions[-1].end("it has finished")
        self.turn()
        return answers

    def back(self, to: int) -> str:
        """Go back to an instant; return what is told of it."""
        refused = self.order("back", to=f"{to} ps")
        if isinstance(refused, str):
            return refused
        assert refused["text"].startswith("goes back to ")
        self.turn()
        assert self.steps.state == PAUSED
        return self.steps.text

    def ended(self) -> list[Entry]:
        """End the run; return the course of its journal, which has been played again."""
        assert self.manual is not None
        for session in list(self.sessions):
            session.end("the end")
        self.manual.end()
        self.board.catch_up()
        state = self.board.state_hash()
        self.recording.close()
        reader = JournalReader(io.BytesIO(self.path.read_bytes()))
        entries = list(reader)
        assert entries[-1].args[1] == state
        board = build(policy=self.board.policy)
        outcome = Replay(board, entries, reader.header.families).run()
        assert outcome.divergence is None
        assert outcome.ended
        assert (board.now, board.state_hash()) == (self.board.now, state)
        return entries


@pytest.fixture
def hand(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Hand]:
    Hand.path = tmp_path / "run.vbj"
    made = Hand(getattr(request, "param", "lockstep"))
    made.begin()
    yield made
    made.recording.close()
    made.close()


in_every_policy = pytest.mark.parametrize("hand", ["lockstep", "slaved", "realtime"], indirect=True)


@in_every_policy
def test_the_board_is_then_as_it_was_and_goes_on_from_there(hand: Hand) -> None:
    board = hand.board
    hand.drive(RESET + delay(3 * MS) + READ * 3, 10_000_000)
    hand.order("pause")
    hand.turn()
    stood, when = board.state_hash(), board.now
    cycles = board.reads, board.writes
    hand.order("go")
    hand.drive(RESET + delay(2 * MS) + READ * 7, 10_000_000)
    hand.order("pause")
    hand.turn()
    assert (board.reads, board.now > when) == (cycles[0] + 7, True)
    assert hand.back(when).startswith("went back to ")
    assert board.now == when
    assert board.state_hash() == stood
    assert (board.reads, board.writes) == cycles
    hand.turn(1_000_000_000)
    assert board.now == when, "it stands still there"
    answer = hand.order("cycle", chip="x", address=0)
    assert answer["when_ps"] == str(board.now)
    hand.order("go")
    assert len(hand.drive(READ * 4)) == 8
    entries = hand.ended()
    assert [entry.number for entry in entries] == list(range(len(entries)))
    hosts = [entry.args[0] for entry in entries if entry.op == "open"]
    assert hosts == ["scope", "host0", "host0", "scope", "host0"], "the second came at that instant"


def test_what_was_undone_stays_in_the_file(hand: Hand) -> None:
    hand.drive(READ * 5)
    when = hand.board.now
    hand.drive(READ + RESET)
    hand.order("pause")
    before = hand.path.read_bytes()
    left = hand.board.now
    hand.back(when)
    after = hand.path.read_bytes()
    assert after.startswith(before)
    lines = list(decoded(hand.path, 0, None, quiet=True))
    assert not any("RESET" in line for line in lines)
    assert lines[-1].endswith(
        f"at {left // 10**6}us the board went back to {when // 10**6}us; 4 entries are undone, and"
        " not shown"
    )
    # Killed here, the journal is whole, and not closed.
    reader = JournalReader(io.BytesIO(after))
    entries = list(reader)
    assert (reader.damage, [entry.op for entry in entries].count("read")) == ("", 5)
    outcome = Replay(build(), entries, reader.header.families).run()
    assert (outcome.divergence, outcome.ended) == (None, False)
    # Killed while the jump was written, it has what was before.
    (jump,) = reader.jumps
    for size in range(jump.begin + 1, jump.end):
        cut = JournalReader(io.BytesIO(after[:size]))
        ops = [entry.op for entry in cut]
        assert (ops.count("read"), ops.count("write")) == (6, 1)
        assert cut.damage == f"cut in the block at byte {jump.begin}"
    hand.ended()


def test_it_goes_back_again_and_again(hand: Hand) -> None:
    instants = []
    for number in range(4):
        hand.drive(READ * (number + 1))
        instants.append(hand.board.now)
    hand.order("pause")
    for place, fresh in ((2, 10), (0, 2), (1, 5), (0, 30)):
        assert hand.back(instants[place]) == f"went back to {instants[place] // 10**6}us"
        hand.order("go")
        hand.drive(READ * fresh)
        hand.order("pause")
    entries = hand.ended()
    assert [entry.op for entry in entries].count("read") == 1 + 30


@in_every_policy
def test_a_session_that_was_open_then_has_ended(hand: Hand) -> None:
    """What it drove is let go, and what it had asked for does not come again."""
    hand.turn(1_000_000)
    far = hand.host()
    far.send(READ + delay(50 * MS) + READ * 2)
    hand.turn(10_000_000)
    hand.order("pause")
    hand.turn()
    when = hand.board.now
    hand.sessions[0].end("it goes")
    hand.order("go")
    while len(hand.board.ports) > 1:
        hand.turn(1_000_000)
    hand.order("pause")
    assert hand.back(when).startswith("went back to ")
    assert [port.label for port in hand.board.ports] == ["scope"]
    closed = [entry for entry in hand.ended() if entry.op == "close" and entry.when == when]
    assert len(closed) == 3, "both sessions of then, and in the end the scope's"


def test_a_finding_of_before_stays_one_and_is_told_once(hand: Hand) -> None:
    hand.drive(RESET + delay(3 * MS) + COMMAND + b"\x1f" + COMMAND + b"\x1f" + READ)
    when = hand.board.now
    found = list(hand.board.violations)
    assert [one.rule for one in found] == ["lm628.busy-write"]
    hand.drive(RESET + delay(3 * MS) + COMMAND + b"\x1f" + COMMAND + b"\x1f")
    assert len(hand.board.violations) > 1
    hand.order("pause")
    hand.back(when)
    assert list(hand.board.violations) == found
    assert hand.board.counters["lm628.busy-write"] == hand.board.counters["violations"] == 1
    entries = hand.ended()
    assert [entry.args[2] for entry in entries if entry.op == "violation"] == ["lm628.busy-write"]


def test_faults_are_those_of_then(hand: Hand) -> None:
    faults = hand.board.faults
    hand.drive(READ * 3)
    first = faults.arm("jam", "x")
    hand.drive(READ * 3 + delay(MS))
    when = hand.board.now
    hand.drive(delay(MS))
    faults.clear(first)
    faults.arm("jam", "x")
    hand.drive(READ * 3 + delay(MS))
    hand.order("pause")
    assert [one.state for one in faults.all()] == ["over", "acting"]
    hand.back(when)
    assert [(one.name, one.state) for one in faults.all()] == [("jam", "acting")]
    hand.order("go")
    hand.drive(delay(3 * MS) + READ)
    assert [entry.op for entry in hand.ended() if entry.op in ("arm", "clear")] == ["arm"]


def test_what_was_found_within_a_call_that_is_undone_is_found_again(hand: Hand) -> None:
    hand.board.faults.arm("jam", "x", "at 1 ms", "for 1 ms")
    hand.drive(delay(4 * MS) + READ)
    hand.order("pause")
    for when, told in ((3 * MS, ["begun", "ended"]), (3 * MS // 2, ["begun"])):
        hand.back(when)
        entries = list(JournalReader(io.BytesIO(hand.path.read_bytes())))
        assert [entry.args[3] for entry in entries if entry.op == "fault"] == told
        assert [one.what for one in hand.board.faults.log] == told
    hand.order("go")
    hand.drive(delay(2 * MS) + READ)
    told = [entry.args[3] for entry in hand.ended() if entry.op == "fault"]
    assert told == ["begun", "ended"]


def test_refused_it_is_as_it_was_and_says_who_is_there(
    hand: Hand, monkeypatch: pytest.MonkeyPatch
) -> None:
    hand.drive(READ * 5)
    only = "the live board goes back only"

    def refused(to: str = "1 us") -> str:
        answer = hand.order("back", to=to)
        assert isinstance(answer, str)
        return answer

    state = hand.board.state_hash(), hand.path.read_bytes()
    assert refused() == f"{only} when it is paused"
    hand.order("pause")
    assert refused("soon") == "'soon' is no duration; write a number with ps, ns, us, ms or s"
    assert refused("1 s") == "it is 5us: 1 s is still to come"
    hand.onlookers.append(hand.__class__.__new__(Hand))
    assert refused() == f"{only} when nothing else is recorded or watches; here is a scope"
    hand.onlookers.pop()
    hand.recording.others.append("the report in r.json")
    assert refused().endswith("or watches; here is the report in r.json")
    hand.recording.others.clear()
    assert (hand.board.state_hash(), hand.path.read_bytes()) == state
    hand.host()
    assert refused() == f"{only} when no other host is attached; here is host0"
    hand.order("go")
    hand.sessions[0].end("it goes")
    hand.turn()
    hand.order("pause")
    # One that comes while the journal is played.
    monkeypatch.setattr("vbus.serve.orders.jump.SLICE_NS", -1)
    assert hand.order("back", to="1 us")["text"] == "goes back to 1us"
    assert refused() == "it is going back already"
    hand.host()
    hand.turn()
    assert hand.steps.text == (
        f"not gone back: {only} when no other host is attached; here is host0"
    )
    assert (hand.board.now, hand.board.reads) == (5 * 10**6, 5)
    hand.jump.recording = None
    assert refused().startswith("this board keeps no journal")
    hand.jump.recording = hand.recording
    hand.ended()


def test_while_a_link_is_broken_there_is_no_way_back(hand: Hand) -> None:
    hand.drive(READ * 5)
    hand.board.serve_links(FaultOrders(hand.board, [HostEntry(LinkSpec("tcp:0"), "host0")]))
    hand.board.faults.arm("link_dead", "host0")
    hand.order("pause")
    assert hand.back(10**6).startswith("now a fault acts on a link, which cannot go back: #1")
    hand.board.faults.clear()
    assert hand.back(10**6) == "went back to 1us"
