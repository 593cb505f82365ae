"""How fast the core is: one table, each row with its limit beside it.

    python benchmarks/core.py            the table, for the core that is installed
    python benchmarks/core.py --page     all tables of docs/performance.md: many axes, links, peers
    python benchmarks/core.py --check    exit code 1 if a ratio has gone beyond its limit and slack

Ratios are within one run: to C compiled on the spot, to the interpreted core, to real time. Times
are of this machine and this moment, and of the processor, so that what others do with it does not
count. ``--check`` looks at ratios only, and wants the compiled core.
"""

import argparse
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from in_process import CHIPS, board, moving_lm629, moving_mc1241a, moving_mcp1200, strobed_reads

from vbus.board.build import load_board_text
from vbus.chips.mcp1200.registers import SampledRegisters
from vbus.compiled import core, is_compiled
from vbus.core.bits import clamp
from vbus.core.kernel import SECOND
from vbus.core.signals import Observer
from vbus.plant.dc_motor import DcMotor
from vbus.protocols.byte import ByteProtocol

STEP = Path(__file__).with_name("lm629_step.c")
FLAGS = ("-O2", "-ffp-contract=off")
MOVING, HUNTING = "moving", "hunting"
"""What STEP is asked for: a sample, or a motor that turns round in each period."""
SAMPLE_NS = 256_000
"""An LM629's sample at 8 MHz."""
BATCH = 64
ROUNDS = 5
SPREAD_S = 8.0
"""Seconds over which rounds of a ratio are spread; a shorter disturbance does not decide."""


@dataclass
class Row:
    """One line of the table.

    Attributes:
        work: what was done.
        measured: what came out, for people.
        limit: what is wanted, for people.
        value: the number compared by ``--check``; None if it is a time.
        most: largest value that passes, slack included.
    """

    work: str
    measured: str
    limit: str
    value: float | None = None
    most: float = 0.0


def fastest(measure: Callable[[], float], rounds: int = ROUNDS) -> float:
    """Return the shortest of several times: what the machine does when it is left alone."""
    return min(measure() for _ in range(rounds))


def spread(seconds: float) -> Iterator[None]:
    """Turn at least so many seconds, and so many rounds as a ratio wants at the least."""
    end = time.monotonic() + seconds
    rounds = 0
    while rounds < ROUNDS or time.monotonic() < end:
        yield
        rounds += 1


def per_call(function: Callable[[], object], count: int) -> float:
    """Return nanoseconds per call."""
    start = time.process_time_ns()
    for _ in range(count):
        function()
    return (time.process_time_ns() - start) / count


def inside(function: Callable[..., object], *arguments: object, count: int = 50_000) -> str:
    """Say what a call takes, and how much beyond one of the same core that does next to nothing."""
    called = fastest(lambda: per_call(partial(clamp, 1, 0, 2), count))
    took = fastest(lambda: per_call(partial(function, *arguments), count))
    return f"{max(took - called, 1):.0f} ns ({took:.0f} with the call from Python)"


# -- samples ----------------------------------------------------------------------------------


def lm629_sample(samples: int) -> float:
    """Return nanoseconds per sample of a moving LM629 with its motor."""
    made = moving_lm629()
    made.run_for(SECOND)
    made.catch_up()
    start = time.process_time_ns()
    made.run_for(SAMPLE_NS * 1000 * samples)
    made.catch_up()
    return (time.process_time_ns() - start) / samples


def motor_period(commands: list[float], periods: int) -> float:
    """Return nanoseconds per period of a motor that is given commands by turns."""
    motor = DcMotor()
    motor.prepare(SAMPLE_NS * 1e-9)
    start = time.process_time_ns()
    for _ in range(periods // len(commands)):
        for command in commands:
            motor.drive(command, 0)
    return (time.process_time_ns() - start) / periods


def c_step(folder: Path) -> Path | None:
    """Compile the same step in C; None if there is no compiler."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        return None
    program = folder / "step"
    subprocess.run([compiler, *FLAGS, "-o", program, STEP], check=True)
    return program


def c_sample(program: Path, work: str) -> float:
    """Return nanoseconds per sample of the C version."""
    command = [program, "50000", work]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return float(done.stdout.split()[0])


def samples() -> Iterator[Row]:
    """The chips' own work."""
    count = 50_000 if is_compiled() else 5_000
    ours: dict[str, list[float]] = {MOVING: [], HUNTING: []}
    theirs: dict[str, list[float]] = {MOVING: [], HUNTING: []}
    steady: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        program = c_step(Path(folder))
        # One after the other, so that both meet the same machine; over seconds, so that others who
        # take it for a second do not decide: the shortest of many rounds only comes nearer to
        # what the code takes.
        for _ in spread(SPREAD_S):
            ours[MOVING].append(lm629_sample(count))
            ours[HUNTING].append(motor_period([0.5, -0.5], count // 25))
            steady.append(motor_period([0.5, 0.5], count // 25))
            if program is not None:
                for asked, times in theirs.items():
                    times.append(c_sample(program, asked))
    for asked, work, limit in (
        (MOVING, "LM629 sample, moving, with its motor", "1.2 x C; 30 ns"),
        (HUNTING, "a period in which a motor turns round, beyond one without", "1500 ns"),
    ):
        took = min(ours[asked]) - (min(steady) if asked == HUNTING else 0.0)
        if theirs[asked]:
            least = min(theirs[asked])
            text = f"{took:.0f} ns, {took / least:.2f} x C ({least:.0f} ns)"
            yield Row(work, text, limit, took / least, 3.0)
        else:
            yield Row(work, f"{took:.0f} ns, no C compiler", "-")
    sample = min(ours[MOVING])
    in_c = f" (C: {SAMPLE_NS / min(theirs[MOVING]):.0f})" if theirs[MOVING] else ""
    yield Row(
        "moving LM629 axes in real time on one core", f"{SAMPLE_NS / sample:.0f}{in_c}", "10000"
    )
    yield Row("one moving axis against real time", f"{SAMPLE_NS / sample:.0f} x", "10000 x")

    pid = moving_mcp1200().chips[0].axis.loop.pid  # type: ignore[attr-defined]
    image = bytearray(128)
    image[0x61:0x6B] = bytes(range(10, 20))
    sampled = SampledRegisters()
    sampled.image = bytes(image)
    took = inside(pid.step, sampled, 5, 512)
    yield Row("MCP-1200 PID, beyond a call", took, "30 ns")
    chip = moving_mc1241a()
    chip.run_for(SECOND)
    chip.catch_up()
    axis = chip.chips[0].axes[0]  # type: ignore[attr-defined]
    took = inside(axis.cycle)
    yield Row("MC1241A axis in a cycle, beyond a call", took, "90 ns")
    yield from whole_boards()

    rest = board("LM629")
    rest.run_for(SECOND)
    rest.catch_up()
    start = time.process_time()
    rest.run_for(3600 * SECOND)
    rest.catch_up()
    idle = (time.process_time() - start) * 1000
    yield Row("one idle hour of an LM629", f"{idle:.3f} ms", "1 ms")


def whole_boards() -> Iterator[Row]:
    """Moving axes of the other families, with everything around them."""
    for name, made, period, aim in (
        ("MCP-1200", moving_mcp1200(), 520_000_000, "aim 120 ns"),
        ("MC1241A, 8 slots", moving_mc1241a(), 542_720_000, "aim 900 ns"),
    ):
        count = 1_000 if is_compiled() else 200

        def run(made=made, period=period, count=count) -> float:  # type: ignore[no-untyped-def]
            start = time.process_time_ns()
            made.run_for(period * count)
            made.catch_up()
            return (time.process_time_ns() - start) / count

        took = min(run() for _ in spread(SPREAD_S / 4))
        yield Row(
            f"{name}: sample, moving, with its motor",
            f"{took:.0f} ns, {period / took / 1000:.0f} axes in real time", aim,
        )  # fmt: skip


# -- the bus ----------------------------------------------------------------------------------


def bus_cycle(chip: str) -> float:
    """Return nanoseconds for a status read through parser, front end and reply."""
    status = CHIPS[chip][2]
    wire = ByteProtocol(board(chip).open_port("bench"))
    request = bytes((0x10 | status,)) * BATCH

    def batch() -> None:
        wire.receive(request)
        wire.take()

    return fastest(lambda: per_call(batch, 500) / BATCH)


def interpreted_bus_cycle(chip: str) -> float:
    """Return the same for the interpreted core, measured in a process of its own."""
    code = f"import core; print(core.bus_cycle({chip!r}))"
    path = os.pathsep.join((str(Path(__file__).parent), *sys.path))
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "VBUS_PURE": "1", "PYTHONPATH": path},
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    return float(done.stdout)


def pin_read(policy: str) -> float:
    """Return nanoseconds for a status read by strobes, many in one message."""
    made = board("LM629", violations=policy)
    wire, request = strobed_reads(made.open_port("bench"), BATCH)

    def batch() -> None:
        wire.receive(request)
        wire.take()

    took = fastest(lambda: per_call(batch, 10 if is_compiled() else 8) / BATCH)
    assert made.counters["violations"] == 0
    return took


DECODED = """
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"

[board]
time = "lockstep"
power_on = "done"

[[hosts]]
transport = "unix:$VBUS_RUNTIME/bench.sock"
card = "slot"

[cards.slot]
base = 0x300
"""
DIRECT_CARD = 'decode = "direct"\nchips = ["x"]\n'
WIRED_CARD = """bus = "ISA"
hold = "130 ns"

[cards.slot.pins]
"D0-D7" = "x.D0-D7"
"/IOR" = "x./RD"
"/IOW" = "x./WR"
A0 = "x./PS"

[glue.u1]
part = "74HC138"
delay = "15 ns"
high = ["G1"]
low = ["/G2A"]

[glue.u1.pins]
A = "slot.A1"
B = "slot.A2"
C = "slot.A3"
"/G2B" = "slot.AEN"
Y0 = "x./CS"
"""


def card_read(card: str, played: bool = False) -> float:
    """Return nanoseconds of a status read at address 0 of a card; ``played``: wire by wire."""
    made = load_board_text(DECODED + card)
    port = made.open_port("host")
    port.select(1 << len(made.chips) - 1)
    if played:
        made.watch("x./CS", Observer())
    port.read(0)
    return fastest(lambda: per_call(partial(port.read, 0), 200 if played else 5000))


def card() -> Iterator[Row]:
    """A cycle through a decoder beside one without, and beside the same as strobes."""
    plain, through = card_read(DIRECT_CARD), card_read(WIRED_CARD)
    played = card_read(WIRED_CARD, played=True)
    text = f"{through / plain:.2f} times, {through:.0f} ns; as strobes {played:.0f} ns"
    ratio = through / plain if is_compiled() else None
    yield Row("status read through a 74HC138, against none", text, "1.5 times", ratio, 2.0)


def bus() -> Iterator[Row]:
    """What a host waits for, without the link."""
    for chip in ("LM629", "MC1241A"):
        took = bus_cycle(chip)
        if is_compiled():
            slow = interpreted_bus_cycle(chip)
            yield Row(
                f"{chip} status read, {BATCH} in one feed",
                f"{took:.0f} ns, {slow / took:.1f} x faster than interpreted ({slow:.0f} ns)",
                "4 x; aim 60 ns", took / slow, 1 / 3,
            )  # fmt: skip
        else:
            yield Row(f"{chip} status read, {BATCH} in one feed", f"{took:.0f} ns", "aim 60 ns")
    off, warn = [], []
    for _ in spread(SPREAD_S / 2):
        off.append(pin_read("off"))
        warn.append(pin_read("warn"))
    ratio = min(warn) / min(off)
    yield Row(
        "status read by strobes, every AC limit judged",
        f"{min(warn):.0f} ns, {ratio:.2f} x unjudged", "1.15 x", ratio, 1.4,
    )  # fmt: skip


# -- the table --------------------------------------------------------------------------------


def table(rows: list[Row]) -> str:
    """Return the rows as Markdown."""
    lines = [("work", "measured", "limit"), *((r.work, r.measured, r.limit) for r in rows)]
    widths = [max(len(line[n]) for line in lines) for n in range(3)]
    texts = [
        "| " + " | ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)) + " |"
        for line in lines
    ]
    texts.insert(1, "|" + "|".join("-" * (width + 2) for width in widths) + "|")
    return "\n".join(texts)


def machine() -> str:
    """Say what was measured, where and when."""
    name = platform.processor() or platform.machine()
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                name = line.partition(": ")[2]
                break
    except OSError:
        pass
    now = datetime.now(UTC).strftime("%Y-%m-%d")
    return f"{core()} core, Python {platform.python_version()}, {name}, {now}"


def beside(script: str) -> str:
    """Return what another benchmark prints."""
    path = os.pathsep.join(sys.path)
    done = subprocess.run(
        [sys.executable, str(STEP.with_name(script))],
        env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True,
    )  # fmt: skip
    text = done.stdout if done.returncode == 0 else (done.stderr.splitlines() or ["failed"])[-1]
    return f"```text\n{text.strip()}\n```"


def page() -> str:
    """Return all tables of the page in the documentation."""
    import many_axes

    return "\n\n".join(
        (
            machine(),
            table([*samples(), *bus(), *card()]),
            "Many axes:",
            table([*many_axes.in_process(), *many_axes.in_real_time(3.0)]),
            "A PTY beside a bare echo in C:",
            beside("pty_roundtrip.py"),
            "Others that do something like it, in the same run:",
            beside("peers.py"),
        )
    )


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--check", action="store_true", help="fail if a ratio is beyond its limit")
    parser.add_argument("--page", action="store_true", help="all tables of docs/performance.md")
    options = parser.parse_args()
    if options.page:
        print(page())
        return 0
    if options.check and not is_compiled():
        parser.error("the core is interpreted; --check wants the compiled one")
    print(machine())
    rows = [*samples(), *bus(), *card()]
    print(table(rows))
    if not options.check:
        return 0
    worse = [row for row in rows if row.value is not None and row.value > row.most]
    for row in worse:
        print(f"beyond its limit: {row.work}: {row.measured}; wanted {row.limit}")
    return 1 if worse else 0


if __name__ == "__main__":
    sys.exit(main())
