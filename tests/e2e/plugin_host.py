"""A host of the DC-8 that moves the lines itself; prints what everybody has seen of it."""

import io
import json
from pathlib import Path

from vbus.board.board import Board
from vbus.board.build import load_board
from vbus.board.host_bus import HostBus
from vbus.circuit.stream import PacketReader
from vbus.record.format import JournalReader
from vbus.record.journal import Journal
from vbus.record.view import play
from vbus.views.coverage.coverage import Coverage, CoverageObserver
from vbus.views.wave.wave import Wave


class Seen(PacketReader):
    def __init__(self) -> None:
        self.cycles: list[list[int]] = []

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        self.cycles.append([write, address, data])


def strobe(port: HostBus, write: bool, address: int, data: int = 0) -> None:
    def level(name: str, value: int) -> None:
        number = port.line_number(name)
        port.lines(1 << number, value << number)

    level("A0", address)
    level("/CS", 0)
    if write:
        port.drive(data)
    port.delay(10**6)
    level("/WR" if write else "/RD", 0)
    port.delay(10**6)
    level("/WR" if write else "/RD", 1)
    if write:
        port.release()
    level("/CS", 1)


def run(data: int) -> tuple[Board, list[list[int]], list[list[int]], Coverage]:
    text = Path("counter.toml").read_text()
    board = load_board("counter.toml")
    board.start_trace()
    seen, recorded = Seen(), io.BytesIO()
    covered = CoverageObserver({"x": "dc8"}, "run")
    board.observe(seen)
    board.observe(covered)
    journal = Journal(board, recorded, text)
    with open("run.vcd", "w") as pins, open("full.vcd", "w") as full:
        waves = [Wave(board, pins, "sigrok"), Wave(board, full)]
        for wave in waves:
            wave.start()
        port = board.open_port("host")
        strobe(port, True, 0, data)
        strobe(port, False, 1)
        strobe(port, True, 0, data)
        port.delay(10**9)
        for wave in waves:
            wave.stop()
    journal.close()
    Path("run.vbj").write_bytes(recorded.getvalue())
    again = Seen()
    recorded.seek(0)
    reader = JournalReader(recorded)
    play(reader.header, reader, again)
    return board, seen.cycles, again.cycles, covered.coverage


first, seen, again, coverage = run(7)
other, *_ = run(9)
print(
    json.dumps(
        {
            "seen": seen,
            "journal": again,
            "hashes": [first.trace_hash(), other.trace_hash()],
            "rules": [found.rule for found in first.violations],
            "covered": [
                [group, name, count] for (group, name), count in coverage.counts["dc8"].items()
            ],
            "share": coverage.share("dc8"),
        }
    )
)
