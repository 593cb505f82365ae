"""What a journal costs: time per bus cycle beside the same run without one, its bytes, its replay.

Each figure is the median of rounds in which both variants take turns, so that neighbours on the
machine hit both alike.
"""

import io
import os
import statistics
import sys
import time
from functools import partial
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import BinaryIO

from benchmarks.in_process import CHIPS, board, command, resident, start_lm629, strobed_reads
from vbus.board.host_bus import HostBus
from vbus.core.kernel import MS, US
from vbus.protocols.byte import ByteProtocol
from vbus.record.format import JournalReader
from vbus.record.journal import Journal
from vbus.record.replay import Replay
from vbus.views.wave.wave import Wave

CYCLES = 40_000
ROUNDS = 9
BATCH = 64
MINUTES = 3
"""Chip time over which memory is looked at."""
ORDER = [Random(number).randrange(0x40) for number in range(CYCLES)]


def polls(port: HostBus, status: int) -> None:
    """A driver that waits: the same status read again and again."""
    read = port.read
    for _ in range(CYCLES):
        read(status)


def moves(port: HostBus, status: int) -> None:
    """A driver at work on a LM629: positions are read while the motor turns."""
    command(port, 0x1E, 0x000A, 300, 2000)
    command(port, 0x04)
    command(port, 0x1F, 0x1828, 0, 1000, 1, 0)
    command(port, 0x01)
    for _ in range(CYCLES // 80):
        while port.read(0) & 1:
            pass
        port.write(0, 0x0A)
        for _ in range(2):
            while port.read(0) & 1:
                pass
            port.read(1)
            port.read(1)


def scatter(port: HostBus, status: int) -> None:
    """The worst of drivers, for a MCP-1200: registers in no order, so that nothing repeats."""
    read = port.read
    for register in ORDER:
        read(register)


def run(chip: str, work: object, file: BinaryIO | None) -> tuple[float, int, int]:
    """Return ns per cycle, cycles, and bytes of the journal."""
    made = board(chip)
    journal = Journal(made, file) if file is not None else None
    port = made.open_port("bench")
    start = time.perf_counter_ns()
    work(port, CHIPS[chip][2])  # type: ignore[operator]
    if journal is not None:
        journal.flush()
    took = time.perf_counter_ns() - start
    cycles = made.counters["reads"] + made.counters["writes"]
    return took / cycles, cycles, journal.bytes if journal is not None else 0


def compare(chip: str, work: object, folder: Path) -> None:
    """Print one line for one driver on one chip."""
    plain, recorded = [], []
    cycles = size = 0
    for _ in range(ROUNDS):
        plain.append(run(chip, work, None)[0])
        with io.FileIO(folder / "run.vbj", "w") as file:
            cost, cycles, size = run(chip, work, file)  # type: ignore[arg-type]
        recorded.append(cost)
    without, with_journal = statistics.median(plain), statistics.median(recorded)
    print(
        f"{chip:9} {work.__name__:7} {without:6.0f} ns without, {with_journal:6.0f} ns with a"  # type: ignore[attr-defined]
        f" journal: {(with_journal / without - 1) * 100:+4.0f} %   {size / cycles:6.3f} bytes a"
        " cycle   goal <= +50 %"
    )


def replayed(chip: str, work: object) -> None:
    """Print what playing a journal again costs, beside recording it."""
    recording, playing = [], []
    for _ in range(ROUNDS):
        file = io.BytesIO()
        made = board(chip)
        journal = Journal(made, file)
        port = made.open_port("bench")
        start = time.perf_counter_ns()
        work(port, CHIPS[chip][2])  # type: ignore[operator]
        recording.append(time.perf_counter_ns() - start)
        journal.close()
        file.seek(0)
        reader = JournalReader(file)
        replay = Replay(board(chip), reader, reader.header.families)
        start = time.perf_counter_ns()
        outcome = replay.run()
        playing.append(time.perf_counter_ns() - start)
        assert outcome.divergence is None
    record, play = statistics.median(recording), statistics.median(playing)
    print(
        f"{chip:9} {work.__name__:7} {record / outcome.cycles:6.0f} ns a cycle recorded,"  # type: ignore[attr-defined]
        f" {play / outcome.cycles:6.0f} ns replayed: {play / record:4.1f} x   goal <= 10 x"
    )


def strobed(file: BinaryIO | None) -> float:
    """Return ns for a status read by strobes, which a host sends as LINES, DELAY and SAMPLE."""
    made = board("LM629")
    journal = Journal(made, file) if file is not None else None
    wire, request = strobed_reads(made.open_port("bench"), BATCH)
    start = time.perf_counter_ns()
    for _ in range(CYCLES // 10 // BATCH):
        wire.receive(request)
        wire.take()
    if journal is not None:
        journal.flush()
    return (time.perf_counter_ns() - start) / (CYCLES // 10 // BATCH * BATCH)


def compare_strobed(folder: Path) -> None:
    """Print what a journal costs a host that moves the lines itself."""
    plain, recorded = [], []
    for _ in range(ROUNDS):
        plain.append(strobed(None))
        with io.FileIO(folder / "run.vbj", "w") as file:
            recorded.append(strobed(file))  # type: ignore[arg-type]
    without, with_journal = statistics.median(plain), statistics.median(recorded)
    print(
        f"LM629     strobes {without:6.0f} ns without, {with_journal:6.0f} ns with a journal:"
        f" {with_journal / without:4.2f} x   goal <= 1.5 x"
    )


def waved(chip: str, work: object, folder: Path) -> None:
    """Print what a waveform of a journal costs, playing it again included."""
    file = io.BytesIO()
    made = board(chip)
    journal = Journal(made, file)
    work(made.open_port("bench"), CHIPS[chip][2])  # type: ignore[operator]
    journal.close()
    costs = []
    for _ in range(ROUNDS // 3):
        file.seek(0)
        reader = JournalReader(file)
        again = board(chip)
        with (folder / "run.vcd").open("w") as text:
            wave = Wave(again, text)
            start = time.perf_counter_ns()
            wave.start()
            outcome = Replay(again, reader, reader.header.families).run()
            wave.stop()
            costs.append((time.perf_counter_ns() - start) / outcome.cycles)
    print(
        f"{chip:9} {work.__name__:7} {statistics.median(costs) / 1000:5.1f} us a cycle as a"  # type: ignore[attr-defined]
        f" waveform, {wave.changes / outcome.cycles:.1f} changes   goal <= 5 us"
    )


def messages(folder: Path, durable: str) -> float:
    """Return ns for a message of one read, with the journal settled as ``durable`` says."""
    made = board("LM629")
    with io.FileIO(folder / "run.vbj", "w") as file:
        journal = Journal(made, file) if durable else None  # type: ignore[arg-type]
        wire = ByteProtocol(made.open_port("bench"))
        count = 200 if durable == "machine" else 5_000
        start = time.perf_counter_ns()
        for _ in range(count):
            wire.receive(b"\x10")
            if journal is not None and durable != "no":
                journal.settle(partial(os.fdatasync, file) if durable == "machine" else None)
            wire.take()
        return (time.perf_counter_ns() - start) / count


def durable(folder: Path) -> None:
    """Print what a message costs in each mode."""
    for mode in ("", "no", "process", "machine"):
        cost = statistics.median(messages(folder, mode) for _ in range(ROUNDS))
        print(f"durable = {mode or 'without a journal':18} {cost / 1000:8.1f} us a message")


def memory(folder: Path) -> None:
    """Print what a journal and a waveform take of memory, written for minutes by a busy host."""
    made = board("LM629")
    with io.FileIO(folder / "run.vbj", "w") as file, (folder / "run.vcd").open("w") as text:
        journal, wave = Journal(made, file), Wave(made, text)  # type: ignore[arg-type]
        port = made.open_port("bench")
        start_lm629(port, kp=300, kd=2000, acc=1000, vel=1)
        wire, request = strobed_reads(port, BATCH)
        wave.start()
        sizes = []
        for second in range(1, 60 * MINUTES + 1):
            while made.now < second * 1000 * MS:
                wire.receive(request)
                wire.take()
                for _ in range(BATCH):
                    port.read(0)
                    port.delay(400 * US)
            sizes.append(resident())
        wave.stop()
        journal.close()
        written = file.tell() + text.tell()
    grown = max(sizes) - sizes[len(sizes) // 10]
    print(
        f"LM629     {MINUTES} min of chip time with a journal and a waveform,"
        f" {written / 1e6:.0f} MB of them: memory grown by {grown} KB of {sizes[-1]}   goal 0"
    )


def main() -> None:
    with TemporaryDirectory(dir=".") as folder:
        if "durable" in sys.argv:
            durable(Path(folder))
            return
        for chip in CHIPS:
            compare(chip, polls, Path(folder))
        compare("LM629", moves, Path(folder))
        compare("MCP-1200", scatter, Path(folder))
        compare_strobed(Path(folder))
        waved("LM629", polls, Path(folder))
        waved("LM629", moves, Path(folder))
        memory(Path(folder))
    for chip in CHIPS:
        replayed(chip, polls)
    replayed("LM629", moves)
    replayed("MCP-1200", scatter)


if __name__ == "__main__":
    main()
