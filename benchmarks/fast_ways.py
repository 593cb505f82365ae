"""What each fast way of the core gains: beside the plain way to the same, in turns, in one run.

    python benchmarks/fast_ways.py          the table
    python benchmarks/fast_ways.py --check  exit code 1 if one is below 1.3 times

A fast way is code that does nothing but save time: without it, a longer way leads to the same
bytes. The file says why it is there; the test named beside it holds the two equal. Wants the
compiled core.
"""

import argparse
import io
import socket
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))

import core
from in_process import board, moving_lm629, moving_mc1241a, moving_mcp1200

from benchmarks import journal
from tests.unit.views.plain_recorder import recorded
from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.cli import journal_lines
from vbus.client import wire
from vbus.client.message import Message
from vbus.compiled import is_compiled
from vbus.core.kernel import SECOND, US
from vbus.core.signals import Observer
from vbus.plant.dc_motor import DcMotor
from vbus.record.format import JournalReader
from vbus.record.journal import Journal
from vbus.record.recorded_bus import RecordedBus
from vbus.record.replay import Replay
from vbus.record.view import Sessions, show
from vbus.serve.loop import HostLoop
from vbus.views.wave.wave import Wave

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


def unobserved() -> tuple[Work, Work]:
    """A read: its two decisive instants alone; as edges, which an observer sees."""
    ways = []
    for played in (False, True):
        made = board("LM629")
        if played:
            made.watch("x./CS", Observer())
        ways.append(partial(made.open_port("bench").read, 0))
    return ways[0], ways[1]


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


def waved(every: bool) -> Work:
    """Polls in a waveform, each decoded once; every one decoded."""
    made = board("LM629")
    port, wave = made.open_port("bench"), Wave(made, io.StringIO())
    for decoder in wave._stream.decoders.values() if every else ():
        decoder.APART = frozenset()
    wave.start()
    return partial(reads, port)


def lengths(count: int) -> Work:
    """Periods of some lengths by turns: two are known; of more, none."""
    motor = DcMotor()
    periods = [256e-6 + number * 1e-6 for number in range(count)] * (12 // count)

    def work() -> None:
        for period in periods:
            motor.prepare(period)
            motor.drive(0.5, 0)

    return work


def at_rest(chip: str, moving: Callable[[], Board], period: int) -> tuple[Work, Work]:
    """A chip at rest is left alone: for a second; for samples one by one, as one that moves."""
    rest, moves = board(chip), moving()
    for made in (rest, moves):
        made.run_for(SECOND)
        made.catch_up()

    def run(made: Board) -> None:
        made.run_for(period * 1000)
        made.catch_up()

    return partial(run, rest), partial(run, moves)


def replied(code: int) -> Work:
    """Replies to reads, as the client takes them."""
    session, reply = wire.SessionWire(), b"D\x80" * 64

    def work() -> None:
        kept, wire._DATA = wire._DATA, code  # type: ignore[misc]
        message = Message()
        for _ in range(64):
            message.read(0)
        session.send(message)
        session.feed(reply)
        wire._DATA = kept  # type: ignore[misc]

    return work


def served(direct: bool) -> Work:
    """Messages of one descriptor: by direct readers; by the event loop's own."""
    loop, (one, other) = HostLoop(), socket.socketpair()
    left = 0

    def message() -> None:
        nonlocal left
        one.recv(8)
        left -= 1
        if left:
            other.send(b"\x10")
        else:
            loop.call_soon(loop.stop)

    (loop.add_direct_reader if direct else loop.add_reader)(one.fileno(), message)

    def work() -> None:
        nonlocal left
        left = 256
        other.send(b"\x10")
        loop.run_forever()

    return work


def both(make: Callable[[type[HostBus]], Work]) -> tuple[Work, Work]:
    """The compiled port under a journal; the decorator."""
    return make(RecordedBus), make(recorded(HostBus))


_REST = "properties/test_rest.py"
_RECORDER = "unit/views/test_recorder.py"
_REPLAY = "unit/views/test_replay.py, frozen"
WAYS = (
    Way("board/host_bus.py", "a read that nothing observes", "properties/test_watched.py",
        unobserved),
    Way("lm628/chip.py", "an LM629 at rest for 1000 samples", _REST,
        lambda: at_rest("LM629", moving_lm629, 256 * US)),
    Way("mcp1200/axis.py", "an MCP-1200 at rest for 1000 samples", _REST,
        lambda: at_rest("MCP-1200", moving_mcp1200, 520 * US)),
    Way("mc1241a/cycle.py", "an MC1241A at rest for 1000 cycles", _REST,
        lambda: at_rest("MC1241A", moving_mc1241a, 542_720_000)),
    Way("serve/fast_path.py", "256 messages of a descriptor", "unit/serve/test_loop.py",
        lambda: (served(True), served(False))),
    Way("client/wire.py", "64 reads asked and answered", "unit/client/test_wire.py",
        lambda: (replied(ord("D")), replied(-1))),
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
    Way("views/wave/changes.py", "polls in a waveform", "unit/views/test_wave.py",
        lambda: (waved(False), waved(True))),
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
