"""What a bus cycle, a sample and a start cost, without any link between host and board.

Times are of this machine in this run; the ratios to the empty call beside them travel better.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.core.kernel import SECOND
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.requests import REQUESTS

ROUNDS = 7

CHIPS = {
    "LM629": ('part = "LM629N-8"\nclock = "8 MHz"\nplant = "m"', 'model = "dc_motor"', 0),
    "MCP-1200": ('part = "MCP-1200"\nclock = "8 MHz"\nplant = "m"', 'model = "dc_motor"', 0x07),
    "MC1241A": ('part = "MC1241A"\nclock = "25 MHz"\nplants = ["m"]', 'model = "stepper"', 1),
}


def board(chip: str, violations: str = "warn") -> Board:
    rows, plant, _ = CHIPS[chip]
    return load_board_text(
        f'[board]\nname = "bench"\ntime = "lockstep"\npower_on = "done"\n'
        f'[violations]\ndefault = "{violations}"\n'
        f"[chips.x]\n{rows}\n[plants.m]\n{plant}\n"
    )


def per_call(function: Callable[[], object], count: int) -> float:
    """Return nanoseconds per call, the median of several rounds."""
    times = []
    for _ in range(ROUNDS):
        start = time.perf_counter_ns()
        for _ in range(count):
            function()
        times.append((time.perf_counter_ns() - start) / count)
    return statistics.median(times)


def empty() -> None:
    """What calling a function at all costs."""


def command(port: object, code: int, *words: int) -> None:
    """Give a LM629 one command."""
    while port.read(0) & 1:  # type: ignore[attr-defined]
        pass
    port.write(0, code)  # type: ignore[attr-defined]
    for word in words:
        while port.read(0) & 1:  # type: ignore[attr-defined]
            pass
        port.write(1, word >> 8)  # type: ignore[attr-defined]
        port.write(1, word & 0xFF)  # type: ignore[attr-defined]


def strobed_reads(port: HostBus, count: int) -> tuple[ByteProtocol, bytes]:
    """Return an LM629's protocol, and a message of status reads by strobes.

    As a host sends it: LINES, DELAY and SAMPLE of the byte protocol, each with its own instant.
    """
    names = port.info().lines
    select, strobe = (1 << names.index(f"x.{name}") for name in ("/CS", "/RD"))
    every = (1 << len(names)) - 1
    port.lines(every, every & ~(1 << names.index("x./PS")))

    def delay(ps: int) -> bytes:
        return REQUESTS["DELAY"].pack(ps)

    def lines(mask: int, levels: int) -> bytes:
        return REQUESTS["LINES"].pack(mask, levels)

    return ByteProtocol(port), count * (
        delay(500_000) + lines(select, 0) + delay(100_000) + lines(strobe, 0) + delay(200_000)
        + REQUESTS["SAMPLE"].pack() + lines(strobe, strobe) + delay(100_000) + lines(select, select)
    )  # fmt: skip


def start_lm629(port: object, kp: int, kd: int, acc: int, vel: int) -> None:
    """Let an LM629 turn in velocity mode at ``vel`` counts a sample."""
    command(port, 0x1E, 0x000A, kp, kd)
    command(port, 0x04)
    command(port, 0x1F, 0x1828, 0, acc, vel, 0)
    command(port, 0x01)


def moving_lm629() -> Board:
    """An LM629 in velocity mode, one count a sample."""
    made = board("LM629")
    start_lm629(made.open_port("bench"), kp=300, kd=2000, acc=1000, vel=1)
    return made


def moving_mcp1200() -> Board:
    """An MCP-1200 with its PID in integral velocity mode, two counts a sample."""
    made = board("MCP-1200")
    port = made.open_port("bench")
    for register, value in ((0x01, 0x08), (0x26, 0x10), (0x3C, 2), (0x05, 3), (0x00, 0x0D)):
        port.write(register, value)
        port.delay(1_000_000_000)
    return made


def moving_mc1241a() -> Board:
    """An MC1241A with one axis in velocity mode, five microsteps a cycle."""
    made = board("MC1241A")
    port = made.open_port("bench")
    packets = ((0x74,), (0x77, 24000), (0x0A,), (0x11, 5, 0), (0x12, 0, 1000), (0x1A,))
    for code, *words in packets:
        port.wait(10_000_000_000)
        port.write(1, code)
        for word in words:
            port.wait(10_000_000_000)
            port.write(0, word >> 8)
            port.write(0, word & 0xFF)
    return made


def samples(made: Board, period_ps: int, count: int) -> float:
    """Return nanoseconds per sample of everything on the board."""
    times = []
    for _ in range(ROUNDS):
        start = time.perf_counter_ns()
        for _ in range(10):
            made.run_for(period_ps * count // 10)
            made.catch_up()
        times.append((time.perf_counter_ns() - start) / count)
    return statistics.median(times)


def resident(pid: int | str = "self") -> int:
    """Return the memory of a process (KB)."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") // 1024


def first_answer() -> float:
    """Return seconds from starting ``vbus run`` to the first status byte over its PTY."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "board.toml"
        file.write_text(
            '[board]\nname = "start"\ntime = "realtime"\n[chips.x]\npart = "LM629N-8"\n'
            'clock = "8 MHz"\nplant = "m"\n[plants.m]\nmodel = "dc_motor"\n'
            '[[hosts]]\ntransport = "pty:$VBUS_RUNTIME/x"\nchips = ["x"]\n'
        )
        environment = {**os.environ, "VBUS_RUNTIME": folder}
        start = time.perf_counter()
        server = subprocess.Popen(
            [sys.executable, "-m", "vbus", "run", "--json", file],
            stdout=subprocess.PIPE,
            env=environment,
        )
        try:
            assert server.stdout is not None
            server.stdout.readline()
            link = os.open(f"{folder}/x", os.O_RDWR | os.O_NOCTTY)
            os.write(link, b"\x10")
            os.read(link, 2)
            took = time.perf_counter() - start
            os.close(link)
        finally:
            server.terminate()
            server.wait()
            server.stdout.close()
    return took


def from_start(arguments: list[str]) -> float:
    """Return seconds a Python process takes from its start to its end."""
    begin = time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begin


def main() -> None:
    call = per_call(empty, 200_000)
    print(f"an empty Python call                       {call:8.0f} ns")
    for chip, (_, _, status) in CHIPS.items():
        port = board(chip).open_port("bench")
        cost = per_call(partial(port.read, status), 20_000)
        print(
            f"{chip:9} status read in process          {cost:8.0f} ns   {cost / call:6.1f} x the"
            f" call, {1e9 / cost / 1000:5.0f} k/s"
        )
        wire = ByteProtocol(port)

        def batch(wire: ByteProtocol = wire, request: bytes = bytes((0x30, status)) * 64) -> None:
            wire.receive(request)
            wire.take()

        cost = per_call(batch, 400) / 64
        print(f"{chip:9} through the byte protocol, 64 up {cost:8.0f} ns   {cost / call:6.1f} x")
    for name, made, period in (
        ("LM629", moving_lm629(), 256_000_000),
        ("MCP-1200", moving_mcp1200(), 520_000_000),
        ("MC1241A", moving_mc1241a(), 542_720_000),
    ):
        cost = samples(made, period, 1000)
        assert made.plants[0].count != 0, f"the motor of the {name} has not moved"
        print(
            f"{name:9} sample, moving, with its motor {cost:8.0f} ns   {period / cost / 1000:6.0f}"
            " axes in real time on one core"
        )
    rest = board("LM629")
    rest.run_for(SECOND // 10)
    cost = samples(rest, 256_000_000, 400_000)
    print(f"LM629     sample, motor off                {cost:8.1f} ns")
    start = statistics.median(first_answer() for _ in range(5))
    print(f"vbus run to the first status byte          {start * 1000:8.0f} ms   goal <= 120")
    for what, command_line, goal in (
        ("vbus --version", ["-m", "vbus", "--version"], "   goal <= 50"),
        ("vbus ls", ["-m", "vbus", "ls"], ""),
        ("Python alone", ["-c", "pass"], ""),
    ):
        took = statistics.median(from_start(command_line) for _ in range(7))
        print(f"{what:43}{took * 1000:8.0f} ms{goal}")


if __name__ == "__main__":
    main()
