"""What long journals cost in memory, measured in a process where nothing else has run.

    python -m tests.unit.views.memory WORK SHORT LONG

prints, for the short journal and the long one, the most memory (bytes) and the number of steps.
Journals of the work ``record`` are written here and given as numbers of bus cycles.
"""

import gc
import json
import sys
import tempfile
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from tests.unit.views.conftest import LM629, lm629_command
from vbus.board.build import load_board_text
from vbus.board.check.checks import all_rules
from vbus.board.host_bus import HostBus
from vbus.cli.journal_lines import decoded
from vbus.cli.sources import opened
from vbus.record.journal import Journal
from vbus.record.replay import Replay
from vbus.record.view import play
from vbus.views.findings.report import Report


def asking(port: HostBus, cycles: int) -> None:
    """Ask for positions without end; a careless one that sometimes does not wait."""
    board = port.board
    while board.reads + board.writes < cycles:
        lm629_command(port, 0x0A)
        for _ in range(2):
            while port.read(0) & 1:
                pass
            port.read(1)
            port.read(1)
        port.write(0, 0x02)
        port.write(0, 0x02)


def recorded(path: Path, cycles: int) -> Path:
    board = load_board_text(LM629)
    with path.open("wb", buffering=0) as file:
        journal = Journal(board, file, LM629)
        port = board.open_port("h")
        asking(port, cycles)
        port.close()
        journal.close()
    return path


def lines(path: str) -> Iterator[object]:
    yield from decoded(Path(path), 0, None)


def report(path: str) -> Iterator[object]:
    with opened(Path(path)) as reader:
        found = Report("bench", reader.header.families, all_rules())
        play(reader.header, reader, found)
        yield found
        assert found.cycles > 11_000
        assert found.left_out() > 100


def replay(path: str) -> Iterator[object]:
    with opened(Path(path)) as reader:
        outcome = Replay(load_board_text(LM629), reader, reader.header.families).run()
        assert outcome.divergence is None
        yield outcome


def record(cycles: str) -> Iterator[object]:
    with tempfile.TemporaryDirectory() as folder:
        yield recorded(Path(folder, "r.vbj"), int(cycles))


WORKS: Final[dict[str, Callable[[str], Iterator[object]]]] = {
    work.__name__: work for work in (lines, report, replay, record)
}


def peak(run: Iterator[object]) -> tuple[int, int]:
    """Return the most memory (bytes) that running to the end takes, and the number of steps."""
    # What is there already must not delay the collector: it waits for a share of all objects.
    gc.collect()
    gc.freeze()
    gc.collect()
    tracemalloc.start()
    try:
        steps = sum(1 for _ in run)
        return tracemalloc.get_traced_memory()[1], steps
    finally:
        tracemalloc.stop()


def main(name: str, *amounts: str) -> None:
    work = WORKS[name]
    for _ in work(amounts[0]):  # imports and caches are no part of it
        pass
    print(json.dumps([peak(work(amount)) for amount in amounts]))


if __name__ == "__main__":
    main(*sys.argv[1:])
