"""What each fast way of the core gains: beside the plain way to the same, in turns, in one run.

    python benchmarks/fast_ways.py          the table
    python benchmarks/fast_ways.py --check  exit code 1 if one is below 1.3 times

A fast way is code that does nothing but save time: without it, a longer way leads to the same
bytes. The file says why it is there; the test named beside it holds the two equal. Wants the
compiled core.
"""

import argparse
import io
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))

import core
from in_process import board, moving_lm629

from benchmarks import journal
from tests.unit.views.plain_recorder import recorded
from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.cli import journal_lines
from vbus.compiled import is_compiled
from vbus.core.kernel import SECOND, US
from vbus.core.signals import Observer
from vbus.plant.dc_motor import DcMotor
from vbus.record.format import JournalReader
from vbus.record.journal import Journal
from vbus.record.recorded_bus import RecordedBus
from vbus.record.replay import Replay
from vbus.record.view import Sessions, show

LEAST = 1.3
SPREAD_S = 2.0
"""Seconds over which turns are spread; a shorter disturbance does not decide."""

Work = Callable[[], object]


@dataclass
class Way:
    """One fast way.

    Attributes:
        file: where it is, in ``vbus``.
        work: what it does.
        test: what holds it equal, in ``tests``.
        make: makes the fast and the plain way of a work.
    """

    file: str
    work: str
    test: str
    make: Callable[[], tuple[Work, Work]]


def through_glue() -> tuple[Work, Work]:
    """A read through a decoder: worked out once; as strobes."""
    ways = []
    for played in (False, True):
        made = core.load_board_text(core.DECODED + core.WIRED_CARD)
        port = made.open_port("host")
        port.select(1 << len(made.chips) - 1)
        if played:
            made.watch("x./CS", Observer())
        port.read(0)
        ways.append(partial(port.read, 0))
    return ways[0], ways[1]


def polled(every: bool) -> Work:
    """Polls of a lease, counted; run one by one."""
    made = board("LM629")
    port = made.open_port("bench")
    port.polls.every_cycle = every
    return partial(port.polls.run, 0, 200)


def recorded_by(port: type[HostBus], work: Callable[[HostBus], object]) -> Work:
    """A host's calls under a journal."""
    made = board("LM629")
    Journal(made, io.BytesIO(), port=port)
    return partial(work, made.open_port("bench"))


def reads(port: HostBus) -> None:
    """A driver that polls."""
    for _ in range(256):
        port.read(0)


def file_of(work: Callable[[HostBus, int], None]) -> bytes:
    """Return a journal of a driver at work."""
    made, file = board("LM629"), io.BytesIO()
    written = Journal(made, file)
    work(made.open_port("bench"), 0)
    written.close()
    return file.getvalue()


def replayed(work: Callable[[HostBus, int], None]) -> tuple[Work, Work]:
    """A journal played again: by stretches; entry by entry."""
    data = file_of(work)

    def play(alone: bool) -> None:
        reader = JournalReader(io.BytesIO(data))
        entries = iter(reader) if alone else reader
        assert Replay(board("LM629"), entries, reader.header.families).run().divergence is None

    return partial(play, False), partial(play, True)


def explained() -> tuple[Work, Work]:
    """A driver's journal explained: by stretches; entry by entry."""
    data = file_of(journal.moves)

    def fast() -> None:
        for _ in journal_lines._explained(JournalReader(io.BytesIO(data))):
            pass

    def plain() -> None:
        reader = JournalReader(io.BytesIO(data))
        lines, sessions = journal_lines._Lines(reader.header), Sessions()
        for entry in reader:
            show(entry, sessions, lines.stream)
            lines.drain()
            lines.ready.clear()

    return fast, plain


def lengths(count: int) -> Work:
    """Periods of some lengths by turns: two are known; of more, none."""
    motor = DcMotor()
    periods = [256e-6 + number * 1e-6 for number in range(count)] * (12 // count)

    def work() -> None:
        for period in periods:
            motor.prepare(period)
            motor.drive(0.5, 0)

    return work


def at_rest() -> tuple[Work, Work]:
    """A chip at rest is left alone: for a second; for samples one by one, as one that moves."""
    rest, moves = board("LM629"), moving_lm629()
    for made in (rest, moves):
        made.run_for(SECOND)
        made.catch_up()

    def run(made: Board) -> None:
        made.run_for(256 * US * 1000)
        made.catch_up()

    return partial(run, rest), partial(run, moves)


def both(make: Callable[[type[HostBus]], Work]) -> tuple[Work, Work]:
    """The compiled port under a journal; the decorator."""
    return make(RecordedBus), make(recorded(HostBus))


_RECORDER = "unit/views/test_recorder.py"
_REPLAY = "unit/views/test_replay.py, frozen"
WAYS = (
    Way("chips/base.py", "a chip at rest, left alone for 1000 samples", "differential, frozen",
        at_rest),
    Way("board/card/card_path.py", "a read through a 74HC138", "properties/test_cards.py",
        through_glue),
    Way("board/host_polls.py", "polls of a lease", "unit/board/test_leases.py",
        lambda: (polled(False), polled(True))),
    Way("plant/dc_motor.py", "two lengths of a period by turns", "unit/plant/test_solved_motor.py",
        lambda: (lengths(2), lengths(3))),
    Way("record/recorded_bus.py", "polls under a journal", _RECORDER,
        lambda: both(lambda port: recorded_by(port, reads))),
    Way("record/again.py", "polls played again", _REPLAY, lambda: replayed(journal.polls)),
    Way("record/again.py", "a driver played again", _REPLAY,
        lambda: replayed(journal.moves)),
    Way("cli/journal_lines.py", "a driver's journal explained",
        "unit/cli/test_journal_lines.py", explained),
)  # fmt: skip


def once(work: Work) -> float:
    """Return seconds of a call, of as many as take 2 ms at the least."""
    count = 1
    while True:
        begun = time.perf_counter()
        for _ in range(count):
            work()
        took = time.perf_counter() - begun
        if took > 0.002:
            return took / count
        count *= 2


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--check", action="store_true", help="fail if one gains too little")
    options = parser.parse_args()
    if not is_compiled():
        parser.error("the core is interpreted; fast ways are those of the compiled one")
    print("| file | work | plain way | fast way | gain | held equal by |")
    print("|---|---|---|---|---|---|")
    small = 0
    for way in WAYS:
        fast, plain = way.make()
        times = [(once(fast), once(plain)) for _ in core.spread(SPREAD_S)]
        quick, slow = min(took for took, _ in times), min(took for _, took in times)
        gain = slow / quick
        small += gain < LEAST
        print(
            f"| `{way.file}` | {way.work} | {slow * 1e6:,.2f} us | {quick * 1e6:,.2f} us"
            f" | {gain:,.1f} | `tests/{way.test}` |",
            flush=True,
        )
    return 1 if options.check and small else 0


if __name__ == "__main__":
    sys.exit(main())
