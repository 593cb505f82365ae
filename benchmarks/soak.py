"""Long runs: the same to the last bit each time, and in memory that does not grow.

    python benchmarks/soak.py                     24 virtual hours, twice, in two processes
    python benchmarks/soak.py --hours 2 --moving 0.5
    python benchmarks/soak.py --wall 3600         a server of its own, and hosts that come and go
    python benchmarks/soak.py --operations 1e9    so many bus operations on each chip (--chip)

Three chips with their motors work side by side; in each virtual hour their axes move for a part of
it (``--moving``, a twentieth unless said otherwise) and rest for the others. ``--seconds`` ends
each run of ``--operations`` early, and says how long all would take. The exit code is 1 if hashes
differ, memory or descriptors grow, or a host is not answered.
"""

import argparse
import contextlib
import gc
import hashlib
import json
import os
import random
import select
import socket
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from in_process import CHIPS, board, command, resident, start_lm629
from snapshots import TEXT

from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.compiled import core
from vbus.core.kernel import MS, SECOND
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.requests import REQUESTS

HOUR = 3600 * SECOND
MOST = 1000
"""Operations a host asks for at a time."""
PATIENCE = 30
"""Seconds in which a host is answered."""
GROWTH_KB = 1024
"""What memory may grow after the first tenth of a run."""


# -- virtual hours --------------------------------------------------------------------------------


def mcp_velocity(port: HostBus, velocity: int) -> None:
    """Let an MCP-1200 turn in integral velocity mode."""
    for register, value in ((0x01, 0x08), (0x26, 0x10), (0x3C, velocity), (0x05, 3), (0x00, 0x0D)):
        port.write(register, value)
        port.delay(MS)


def mcp_idle(port: HostBus) -> None:
    """Let it rest: the reset ends whatever mode it was in."""
    port.write(0x05, 0)
    port.delay(MS)


def mc_command(port: HostBus, code: int, *words: int) -> None:
    port.wait(10_000 * MS)
    port.write(1, code)
    for word in words:
        port.wait(10_000 * MS)
        port.write(0, word >> 8)
        port.write(0, word & 0xFF)


def start_all(ports: list[HostBus], turn: int) -> None:
    """Let every axis move, a little differently in each hour."""
    start_lm629(ports[0], kp=60, kd=600, acc=2000, vel=1 + turn % 4)
    mcp_velocity(ports[1], 1 + turn % 3)
    for code, *words in ((0x74,), (0x77, 24000), (0x0A,), (0x11, 1 + turn % 5, 0),
                         (0x12, 0, 1000), (0x1A,)):  # fmt: skip
        mc_command(ports[2], code, *words)


def stop_all(ports: list[HostBus]) -> None:
    """Let every axis rest: with its motor off, so that nothing has to be held."""
    command(ports[0], 0x1F, 0x0100)  # LTRJ: motor off
    command(ports[0], 0x01)  # STT
    mcp_idle(ports[1])
    for code, *words in ((0x11, 0, 0), (0x1A,)):
        mc_command(ports[2], code, *words)


def virtual(hours: float, moving: float) -> dict[str, object]:
    """Let virtual hours pass; return their hash, and memory after each."""
    made = load_board_text(TEXT)
    ports = [made.open_port(name, [name]) for name in ("x", "y", "z")]
    digest = hashlib.sha256()
    memory, began = [], time.monotonic()
    turn = 0
    while made.now < hours * HOUR:
        end = min((turn + 1) * HOUR, int(hours * HOUR))
        start_all(ports, turn)
        made.run_until(max(made.now, min(turn * HOUR + int(moving * HOUR), end)))
        digest.update(bytes(port.read(0) for port in ports))
        stop_all(ports)
        made.run_until(max(made.now, end))
        digest.update(made.state_hash().encode())
        made.violations.clear()
        turn += 1
        gc.collect()
        memory.append(resident())
        told = f"\r{turn} h, {time.monotonic() - began:.0f} s, {memory[-1]} KB "
        print(told, end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return {
        "hours": turn, "hash": digest.hexdigest(), "seconds": time.monotonic() - began,
        "memory": memory, "positions": [made.chip(name).telemetry() for name in ("x", "y", "z")],
    }  # fmt: skip


def twice(hours: float, moving: float) -> bool:
    """Run in two processes of their own; tell whether both are the same and memory is flat."""
    runs = []
    for _ in range(2):
        asked = [sys.executable, __file__, "--once", "--hours", str(hours), "--moving", str(moving)]
        runs.append(json.loads(subprocess.run(asked, stdout=subprocess.PIPE, check=True).stdout))
    first, second = runs
    print(f"{core()} core, {first['hours']} virtual hours, {100 * moving:g} % of them moving")
    good = first["hash"] == second["hash"]
    for run in runs:
        memory = run["memory"]
        settled = memory[min(len(memory) - 1, 1 + len(memory) // 10) :]
        grown = max(settled) - settled[0]
        good = good and grown <= GROWTH_KB
        print(f"  {run['hash']}  {run['seconds']:.0f} s; {settled[0]} KB, grown by {grown} KB")
    return good


# -- bus operations -------------------------------------------------------------------------------


def requests(choose: random.Random, addresses: int, status: int) -> list[tuple[int, bytes]]:
    """Return requests, each with its operations: of random bytes, and status polls in runs."""
    made = []
    for _ in range(1 << 14):
        address, number = choose.randrange(addresses), choose.randint(2, 64)
        name = choose.choices(("READ", "WRITE", "READS", "WRITES", "poll"), (12, 12, 1, 1, 8))[0]
        if name == "poll":
            address, number, name = status, choose.randint(2, 255), "READS"
        match name:
            case "READ":
                made.append((1, REQUESTS[name].pack(address)))
            case "WRITE":
                made.append((1, REQUESTS[name].pack(address, choose.randrange(256))))
            case "READS":
                made.append((number, REQUESTS[name].pack(address, number)))
            case "WRITES":
                made.append((number, REQUESTS[name].pack(address, choose.randbytes(number))))
    return made


def operations(chip: str, number: int, seconds: float) -> bool:
    """Carry out reads and writes of random bytes; tell whether a second board answers the same."""
    began, done = time.monotonic(), 0
    boards = [board(chip) for _ in range(2)]
    wires = [ByteProtocol(made.open_port("soak")) for made in boards]
    choose = random.Random(chip)
    pool = requests(choose, 0x80 if chip == "MCP-1200" else 2, CHIPS[chip][2])
    memory, asked, marks = [], 0, 0
    while done < number and time.monotonic() - began < seconds:
        chosen = [
            pool[one & 0x3FFF] for one in struct.unpack(f"<{MOST}H", choose.randbytes(2 * MOST))
        ]
        message = b"".join([request for _, request in chosen])
        for wire in wires:
            wire.receive(message)
        if wires[0].take() != wires[1].take():
            print(f"{chip}: two boards answer differently after {done} operations")
            return False
        for made in boards:
            made.violations.clear()
        done += sum([cycles for cycles, _ in chosen])
        asked += MOST
        if done * 20 >= number * marks:
            marks += 1
            memory.append(resident())
            told = f"\r{chip}: {done:.2e} in {time.monotonic() - began:.0f} s, {memory[-1]} KB "
            print(told, end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    same = boards[0].state_hash() == boards[1].state_hash()
    took = time.monotonic() - began
    grown = max(memory[2:], default=memory[0]) - memory[min(2, len(memory) - 1)]
    print(f"{chip}: {done:.4g} operations in {asked:.3g} requests on two boards, {core()} core,")
    print(f"  {took:.0f} s, both the same: {same}; memory grown by {grown} KB;")
    print(f"  {done / took:.0f} a second; {number:.0e} take {took / done * number / 3600:.2f} h")
    return same and grown <= GROWTH_KB


# -- wall time ------------------------------------------------------------------------------------

SERVED = """
[board]
name = "soak"
time = "realtime"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "m"
[plants.m]
model = "dc_motor"
[[hosts]]
transport = "pty:$VBUS_RUNTIME/terminal"
[[hosts]]
transport = "unix:$VBUS_RUNTIME/socket"
"""


def visit(folder: str, choose: random.Random) -> int:
    """Come, ask, and go: in order, in the midst of it, or without a word; return the answers."""
    asked = b"".join(bytes((0x10,)) for _ in range(choose.randrange(1, 200))) + b"\x02\x07"
    if choose.random() < 0.5:
        fd = os.open(f"{folder}/terminal", os.O_RDWR | os.O_NOCTTY)
    else:
        link = socket.socket(socket.AF_UNIX)
        link.connect(f"{folder}/socket")
        fd = link.detach()
    try:
        os.write(fd, asked)
        if choose.random() < 0.2:
            return 0  # dies
        heard = b""
        while not heard.endswith(b"E\x07"):
            if not select.select([fd], [], [], PATIENCE)[0]:
                raise SystemExit(f"a host is not answered within {PATIENCE} s")
            data = os.read(fd, 4096)
            if not data:
                raise SystemExit("a host is not answered")
            heard += data
        return len(heard) // 2
    finally:
        os.close(fd)


def wall(seconds: float) -> bool:
    """Serve a board for so long; tell whether it stands at the end as at the beginning."""
    choose = random.Random(1)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "soak.toml"
        file.write_text(SERVED)
        server = subprocess.Popen(
            [sys.executable, "-m", "vbus", "run", "--json", file],
            stdout=subprocess.PIPE,
            env={**os.environ, "VBUS_RUNTIME": folder},
        )
        try:
            assert server.stdout is not None
            server.stdout.readline()
            visit(folder, random.Random(3))
            descriptors = Path(f"/proc/{server.pid}/fd")
            end = time.monotonic() + seconds
            start = time.monotonic() + seconds / 10
            fds, memory = len(list(descriptors.iterdir())), 0
            visits = answers = 0
            while time.monotonic() < end:
                heard = visit(folder, choose)
                answers += heard
                visits += 1
                if not memory and time.monotonic() > start:
                    memory = resident(server.pid)
                # A terminal's next client may lose what it asks before the server has noticed that
                # the one before has died.
                time.sleep(choose.choice((0.0, 0.01, 0.1)) if heard else 0.5)
            time.sleep(0.5)  # the last one is noticed
            grown = resident(server.pid) - memory
            more = len(list(descriptors.iterdir())) - fds
        finally:
            server.terminate()
            code = server.wait()
            with contextlib.suppress(AttributeError):
                server.stdout.close()
    print(f"{seconds:.0f} s, {visits} hosts, {answers} answers; memory grown by {grown} KB,")
    print(f"  descriptors by {more}; the server ended with {code}")
    return grown <= GROWTH_KB and not more and not code


def main() -> bool:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--hours", type=float, default=24)
    parser.add_argument("--moving", type=float, default=0.05)
    parser.add_argument("--once", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--wall", type=float, metavar="SECONDS")
    parser.add_argument("--operations", type=float, metavar="NUMBER")
    parser.add_argument("--chip", choices=CHIPS, help="only this chip, with --operations")
    parser.add_argument("--seconds", type=float, default=float("inf"))
    asked = parser.parse_args()
    if asked.once:
        print(json.dumps(virtual(asked.hours, asked.moving)))
        return True
    if asked.wall:
        return wall(asked.wall)
    if asked.operations:
        chips = [asked.chip] if asked.chip else CHIPS
        good = [operations(chip, int(asked.operations), asked.seconds) for chip in chips]
        return all(good)
    return twice(asked.hours, asked.moving)


if __name__ == "__main__":
    sys.exit(not main())
