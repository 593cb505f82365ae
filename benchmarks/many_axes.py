"""Machines of many axes: what moves costs, what rests does not.

    python benchmarks/many_axes.py

Each row has its goal beside it. Times are of this machine and this moment; the share of a core and
the multiples of real time are what to look at.
"""

import argparse
import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from core import Row, machine, table
from in_process import command

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.compiled import is_compiled
from vbus.core.kernel import MS, SECOND

FEW = 64


LM629 = 'part = "LM629N-8"\nclock = "8 MHz"\nplant = "{plant}"'
OTHERS = {
    "MCP-1200": ('part = "MCP-1200"\nclock = "20 MHz"\nplant = "{plant}"', "dc_motor"),
    "MC1241A": ('part = "MC1241A"\nclock = "25 MHz"\nplants = ["{plant}"]', "stepper"),
}


def text(count: int, policy: str, chip: str = LM629, model: str = "dc_motor") -> str:
    """Return a board of chips with motors, of which a host reaches those it asks for."""
    axes = "".join(
        f'[chips.x{n}]\n{chip.format(plant=f"m{n}")}\n[plants.m{n}]\nmodel = "{model}"\n'
        for n in range(count)
    )
    return f'[board]\nname = "many"\ntime = "{policy}"\npower_on = "done"\n{axes}'


def moving(count: int) -> Board:
    """Return a board on which every axis turns."""
    made = load_board_text(text(count, "lockstep"))
    for chip in made.chips:
        port = made.open_port(f"h {chip.name}", [chip.name])
        command(port, 0x1E, 0x000A, 300, 2000)
        command(port, 0x04)
        command(port, 0x1F, 0x1828, 0, 1000, 1, 0)
        command(port, 0x01)
    made.run_for(100 * MS)
    made.catch_up()
    return made


def ran(made: Board, duration: int) -> float:
    """Return seconds of computing per second of chip time."""
    begun = time.process_time()
    for _ in range(10):
        made.run_for(duration // 10)
        made.catch_up()
    return (time.process_time() - begun) * SECOND / duration


def in_process() -> list[Row]:
    """Rows without a server."""
    count = 500 if is_compiled() else 50
    begun = time.perf_counter()
    board = load_board_text(text(2000, "lockstep"))
    started = time.perf_counter() - begun
    board.run_for(SECOND)
    board.catch_up()
    rest = ran(board, 600 * SECOND)
    share = ran(moving(count), SECOND)
    one = ran(moving(1), 10 * SECOND)
    idle = load_board_text(text(1, "lockstep"))
    idle.run_for(SECOND)
    idle.catch_up()
    hour = ran(idle, 3600 * SECOND) * 3600
    return [
        Row("a board of 2000 LM629s with motors starts", f"{started:.1f} s", "seconds"),
        Row("2000 resting axes, ten minutes", f"{rest * 600 * 1000:.0f} ms", "-"),
        Row("moving LM629 axes in real time on one core", f"{count / share:.0f}", "10000"),
        Row("one moving axis against real time", f"{1 / one:.0f} x", "10000 x"),
        Row("one idle hour of an LM629", f"{hour * 1000:.2f} ms", "1 ms"),
    ]


def cpu_seconds(pid: int) -> float:
    """Return the processor time a process has had."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def resident(pid: int) -> int:
    """Return the memory of a process (KiB)."""
    text = Path(f"/proc/{pid}/status").read_text()
    return int(text.partition("VmRSS:")[2].split()[0])


def hosts(count: int) -> str:
    """Return a host entry for every 16 axes: as many as SELECT reaches."""
    return "".join(
        f'[[hosts]]\ntransport = "unix:$VBUS_RUNTIME/{first}.sock"\nprotocol = "byte"\n'
        f"chips = {[f'x{n}' for n in range(first, min(first + 16, count))]}\n"
        for first in range(0, count, 16)
    ).replace("'", '"')


def turn() -> bytes:
    """Return what makes all chips of a session turn for ever, and an ECHO behind it."""
    wait = b"\x34" + (5 * MS).to_bytes(8, "big")
    out = b"\x03\xff\xff"
    for code, *words in ((0x1E, 0x000A, 300, 2000), (4,), (0x1F, 0x1828, 0, 1000, 1, 0), (1,)):
        out += wait + bytes((0x20, code))
        for word in words:
            out += wait + bytes((0x21, word >> 8, 0x21, word & 0xFF))
    return out + b"\x02\x77"


def start_axes(folder: Path, count: int) -> None:
    """Have hosts start every axis of a served board."""
    for first in range(0, count, 16):
        with socket.socket(socket.AF_UNIX) as host:
            host.settimeout(60)
            host.connect(str(folder / f"{first}.sock"))
            host.sendall(turn())
            got = b""
            while not got.endswith(b"E\x77"):
                more = host.recv(4096)
                assert more, "the server has gone"
                got += more


def told(environment: dict[str, str]) -> dict[str, Any]:
    """Return what the board that runs tells of itself."""
    answer = subprocess.run(
        [sys.executable, "-m", "vbus", "ls", "--json"],
        env=environment, check=True, capture_output=True, text=True,
    )  # fmt: skip
    found: dict[str, Any] = json.loads(answer.stdout)[0]
    return found


def served(
    count: int, turning: bool, seconds: float, chip: str = LM629, model: str = "dc_motor",
    rate: str = "1",
) -> tuple[float, float, int]:  # fmt: skip
    """Return the share of a core ``vbus run`` takes, its worst lag (ms), and its memory (KiB).

    The share is computing for each second of chip time, also where that does not follow.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "many.toml"
        file.write_text(text(count, "realtime", chip, model) + hosts(count))
        environment = {**os.environ, "VBUS_RUNTIME": folder}
        server = subprocess.Popen(
            [sys.executable, "-m", "vbus", "run", "--json", "--rate", rate, file],
            stdout=subprocess.PIPE, env=environment,
        )  # fmt: skip
        try:
            assert server.stdout is not None
            server.stdout.readline()
            if turning:
                start_axes(Path(folder), count)
            time.sleep(0.5)
            begun, before = cpu_seconds(server.pid), told(environment)
            time.sleep(seconds)
            computed, after = cpu_seconds(server.pid) - begun, told(environment)
            share = computed * SECOND / (after["time_ps"] - before["time_ps"])
            lag = after["worst_lag_ps"] / 1e9
            memory = resident(server.pid)
        finally:
            server.terminate()
            server.wait()
            server.stdout.close()
    return share, lag, memory


def in_real_time(seconds: float) -> list[Row]:
    """Rows of ``vbus run``."""
    rows = []
    at_rest = {}
    for count, turning in ((FEW, True), (FEW, False), (2000, False)):
        share, lag, memory = served(count, turning, seconds)
        if not turning:
            at_rest[count] = memory
        rows.append(
            Row(
                f"vbus run, {count} axes {'moving' if turning else 'at rest'}, real time",
                f"{share * 100:.1f} % of a core, worst lag {lag:.1f} ms",
                "well under a core" if turning else "-",
            )
        )
    for part, (chip, model) in OTHERS.items():
        share, lag, _ = served(500, False, seconds, chip, model)
        rows.append(
            Row(
                f"vbus run, 500 {part} at rest, real time",
                f"{share * 100:.1f} % of a core, worst lag {lag:.1f} ms",
                "-",
            )
        )
    more = (at_rest[2000] - at_rest[FEW]) / (2000 - FEW)
    rows.append(Row("memory of an LM629 at rest with its motor", f"{more:.1f} KiB", "16 KiB"))
    return rows


def beside_the_core(seconds: float) -> list[Row]:
    """Rows of what a server has of what its core does alone."""
    rows = []
    for count, rate, work, limit in (
        (1, "max", "vbus run --rate max, one moving axis", "0.9; 8000 x"),
        (1500, "1", "vbus run, 1500 moving axes, as on a full core", "0.9; 7500 x"),
    ):
        board = moving(count)
        ours, alone = [], []
        for _ in range(3):
            alone.append(ran(board, SECOND if count > 1 else 20 * SECOND))
            ours.append(served(count, True, seconds, rate=rate)[0])
        best, core = min(ours), min(alone)
        rows.append(
            Row(work, f"{core / best:.2f} of the core alone, {count / best:.0f} x real time", limit)
        )
    return rows


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=2.0, help="how long to watch each server")
    options = parser.parse_args()
    print(machine())
    rows = [*in_process(), *in_real_time(options.seconds), *beside_the_core(options.seconds)]
    print(table(rows))


if __name__ == "__main__":
    main()
