"""Evidence in journals and reports, and runs with faults played again."""

import io

from tests.unit.faults.bench import DC, LM, Lm, settle
from vbus.board.build import load_board_text
from vbus.cli.journal_lines import line
from vbus.core.kernel import MS
from vbus.core.options import Value
from vbus.faults.row import LinkActs
from vbus.record.format import Entry, JournalReader
from vbus.record.journal import Journal
from vbus.record.replay import Replay
from vbus.record.view import Sessions, shown
from vbus.views.findings.formats import text
from vbus.views.findings.report import Report

BOARD = (
    f'[board]\nname = "bench"\ntime = "lockstep"\npower_on = "done"\n{LM}{DC}'
    '[[faults]]\nfault = "load_step"\nwhen = "at 2 ms"\nuntil = "for 1 ms"\n'
)


def recorded() -> tuple[str, list[Entry]]:
    board = load_board_text(BOARD)
    board.start_trace()
    file = io.BytesIO()
    journal = Journal(board, file, BOARD)
    host = Lm(board)
    host.spin()
    settle(board, 10)
    jam = board.faults.arm("jam", when="position 40")
    board.faults.arm("answer_lost", when="at 15 ms")
    board.faults.arm("byte_flipped", when="cycle 2", mask=0x10)
    host.status()
    host.status()
    settle(board, 20)
    board.faults.clear(jam)
    settle(board, 5)
    host.status()
    host.port.close()
    journal.close()
    return board.trace_hash(), list(JournalReader(io.BytesIO(file.getvalue())))


def test_a_run_with_faults_is_played_again_bit_for_bit() -> None:
    told, entries = recorded()
    board = load_board_text(BOARD)
    board.start_trace()
    outcome = Replay(board, entries, {"x": "lm628"}).run()
    assert outcome.divergence is None
    assert outcome.ended
    assert [e.name for e in board.faults.log if e.what == "begun"] == [
        "load_step", "byte_flipped", "answer_lost", "jam",
    ]  # fmt: skip
    assert told


def test_a_run_whose_clock_failed_is_played_again_bit_for_bit() -> None:
    """Off by the board file, stopped by hand, both at instants of no particular phase."""
    file = BOARD + (
        '[[faults]]\nfault = "clock_off"\nppm = 4321\nwhen = "at 3.1 ms"\nuntil = "for 7.3 ms"\n'
    )
    board = load_board_text(file)
    written = io.BytesIO()
    journal = Journal(board, written, file)
    host = Lm(board)
    host.spin()
    settle(board, 10)
    board.faults.arm("clock_stopped", when=board.now + 123_457, until="for 2 ms")
    host.port.write(0, 0x0A)
    settle(board, 1)
    assert host.status() & 1
    settle(board, 20)
    here = host.position()
    host.port.close()
    journal.close()
    entries = list(JournalReader(io.BytesIO(written.getvalue())))
    again = load_board_text(file)
    outcome = Replay(again, entries, {"x": "lm628"}).run()
    assert outcome.divergence is None
    assert outcome.ended
    assert here > 0
    assert [str(one) for one in again.faults.log] == [str(one) for one in board.faults.log]
    assert again.chip("x").clock.courses == board.chip("x").clock.courses


def test_a_journal_says_what_was_armed_and_what_came_of_it() -> None:
    _, entries = recorded()
    lines = [line(entry, Sessions()) for entry in entries if entry.op in ("arm", "clear", "fault")]
    assert [one.split(" ", 2)[2].split(";")[0] for one in lines] == [
        "fault load_step x.1: begun",
        "fault load_step x.1: ended",
        "arm jam x.1, when position 40, until cleared",
        "arm answer_lost host0, when at 15 ms, until once",
        "arm byte_flipped x mask=16 cycles=both, when cycle 2, until once",
        "fault byte_flipped x: begun",
        "fault byte_flipped x: ended",
        "fault answer_lost host0: failed",
        "fault jam x.1: begun",
        "clear fault #2",
        "fault jam x.1: ended",
    ]


def test_a_report_shows_the_evidence() -> None:
    _, entries = recorded()
    report = Report("bench", {"x": "lm628"}, [])
    assert len(list(shown(entries, report))) == len(entries)
    assert [row[1:4] for row in report.faults][:2] == [
        ("load_step", "x.1", "begun"),
        ("load_step", "x.1", "ended"),
    ]
    assert report.faults[0][0] == 2 * MS
    assert "fault: load_step x.1 at " in text(report)


class Links(LinkActs):
    """Two links of messages."""

    def check(self, name: str, target: str) -> None:
        assert target in ("host0", "host1")

    def begin(
        self, number: int, name: str, target: str, once: bool, values: dict[str, Value]
    ) -> str:
        return "so many sessions"

    def end(self, number: int) -> None:
        pass


def test_a_run_with_faults_of_messages_is_played_again_with_the_same_hash() -> None:
    """Of the board file, at once and later, and by hand; for one message and for many."""
    file = BOARD + (
        '[[faults]]\nfault = "messages_late"\nuntil = "for 4 ms"\n'
        '[[faults]]\nfault = "message_doubled"\nwhen = "rate 2 kHz"\nuntil = "for 9 ms"\n'
        '[[faults]]\nfault = "link_cut"\ntarget = "host1"\nwhen = "at 6 ms"\nuntil = "for 1 ms"\n'
    )
    board = load_board_text(file)
    board.start_trace()
    written = io.BytesIO()
    journal = Journal(board, written, file)
    board.serve_links(Links())
    host = Lm(board)
    host.spin()
    settle(board, 8)
    lost = board.faults.arm("message_lost", when="cycle 3", until="cleared", every=3, way="reply")
    board.faults.arm("messages_reordered", "host1")
    for _ in range(3):
        host.status()
    settle(board, 10)
    board.faults.clear(lost)
    host.port.close()
    journal.close()
    entries = list(JournalReader(io.BytesIO(written.getvalue())))
    again = load_board_text(file)
    again.start_trace()
    outcome = Replay(again, entries, {"x": "lm628"}).run()
    assert outcome.divergence is None
    assert outcome.ended
    told = [(one.name, one.what, one.text) for one in board.faults.log if one.what != "failed"]
    assert ("message_lost", "begun", "one of 3 replies") in told
    assert ("messages_late", "ended", "") in told
    assert ("link_cut", "ended", "") in told
    assert sum(name == "message_doubled" for name, *_ in told) > 5
    assert [str(one) for one in again.faults.log] == [str(one) for one in board.faults.log]
    assert again.trace_hash() == board.trace_hash()
