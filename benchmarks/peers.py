"""vbus beside programs that do something like it, in one run: round trips and bus cycles.

    python benchmarks/peers.py [--one-cpu]

Each peer that is not installed is left out, and said so: QEMU's qtest (Debian: qemu-system-x86),
sinstruments, lewis and cocotb (PyPI), Icarus Verilog (Debian: iverilog). simavr stands in
benchmarks/pins.py.

* A **round trip** is one question and its answer over a socket, asked by the same Python client, of
  the peer and of vbus by turns: QEMU's ``inb`` and vbus' ``inb`` over a Unix socket; a device of
  sinstruments, a lewis device's position, and vbus' ``r 0`` over TCP. Both servers run all the
  time, and are asked in short bursts by turns. With ``--one-cpu`` client and servers share one
  processor; else the client is on each processor by turns, both bursts of a round on the same one,
  and the system places the servers.
* A **bus cycle** is a read at the pins: cocotb moves the strobes of a register in Icarus Verilog,
  which knows nothing but that register; vbus moves the strobes of an LM629 with its motor.
"""

import argparse
import importlib.util
import os
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from vbus.board.build import load_board_text
from vbus.compiled import core

ROUNDS = 30
BURST = 100
CYCLES = 4000
LM629 = """\
[board]
name = "peers"
time = "lockstep"
power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "m"
[plants.m]
model = "dc_motor"
[cards.isa]
base = 0x340
[[cards.isa.ports]]
offset = 0
chip = "x"
address = 0
"""
DEVICE = """\
from sinstruments.simulator import BaseDevice

class Device(BaseDevice):
    def handle_message(self, message):
        return b"84\\n"
"""
SINSTRUMENTS = """\
import sys
sys.path.insert(0, {folder!r})
from sinstruments.simulator import create_server_from_config
device = {{
    "name": "peer", "package": "peer_device", "class": "Device",
    "transports": [{{"type": "tcp", "url": ["127.0.0.1", {port}]}}],
}}
create_server_from_config({{"devices": [device]}}).serve_forever()
"""
VERILOG = """\
`timescale 1ns/1ns
module register(input cs_n, rd_n, wr_n, inout [7:0] d);
  reg [7:0] q = 8'h84;
  assign d = (!cs_n && !rd_n) ? q : 8'hzz;
  always @(posedge wr_n) if (!cs_n) q <= d;
endmodule
"""
COCOTB = """\
import os, time
import cocotb
from cocotb.triggers import Timer

@cocotb.test()
async def reads(dut):
    dut.cs_n.value = 1
    dut.wr_n.value = 1
    dut.rd_n.value = 1
    await Timer(100, "ns")
    dut.cs_n.value = 0
    await Timer(100, "ns")
    start = time.perf_counter()
    for _ in range({cycles}):
        dut.rd_n.value = 0
        await Timer(180, "ns")
        value = int(dut.d.value)
        dut.rd_n.value = 1
        await Timer(180, "ns")
    took = time.perf_counter() - start
    assert value == 0x84
    open(os.environ["PEERS_OUT"], "w").write(repr(took))
"""


def trips(
    theirs: tuple[socket.socket, bytes], ours: tuple[socket.socket, bytes], burst: int = BURST
) -> list[tuple[float, float]]:
    """Return microseconds per question of two servers, round by round."""
    allowed = os.sched_getaffinity(0)
    rounds = []
    for number in range(ROUNDS):
        os.sched_setaffinity(0, {sorted(allowed)[number % len(allowed)]})
        rounds.append((asked(*theirs, burst), asked(*ours, burst)))
    os.sched_setaffinity(0, allowed)
    return rounds


def asked(link: socket.socket, question: bytes, count: int) -> float:
    """Ask so many times; return the microseconds each took."""
    start = time.perf_counter()
    for _ in range(count):
        link.sendall(question)
        answer = b""
        while not answer.endswith(b"\n"):
            answer += link.recv(4096)
    return (time.perf_counter() - start) / count * 1e6


def connected(make: Callable[[], socket.socket]) -> socket.socket:
    """Return a socket as soon as somebody listens there."""
    deadline = time.monotonic() + 20
    while True:
        try:
            link = make()
            link.settimeout(20)
            return link
        except OSError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.05)


def unix(path: Path) -> socket.socket:
    link = socket.socket(socket.AF_UNIX)
    link.connect(str(path))
    return link


def free_port() -> int:
    with socket.socket() as link:
        link.bind(("127.0.0.1", 0))
        return int(link.getsockname()[1])


@contextmanager
def process(*command: str, **environment: str) -> Iterator[None]:
    quiet = subprocess.DEVNULL
    running = subprocess.Popen(
        command, stdin=quiet, stdout=quiet, stderr=quiet, env={**os.environ, **environment}
    )
    try:
        yield
    finally:
        running.terminate()
        running.wait()


@contextmanager
def served(folder: Path, host: str) -> Iterator[None]:
    board = folder / "board.toml"
    board.write_text(LM629 + host)
    command = (sys.executable, "-m", "vbus", "run", str(board))
    with process(*command, VBUS_RUNTIME=str(folder)):
        yield


def qtest(folder: Path) -> list[tuple[float, float]]:
    """Round trips of ``inb``: QEMU, vbus."""
    path = folder / "qtest"
    command = (
        "qemu-system-x86_64", "-nodefaults", "-display", "none", "-machine", "isapc", "-accel",
        "tcg", "-qtest", f"unix:{path},server=on,wait=off", "-S",
    )  # fmt: skip
    host = f'[[hosts]]\ntransport = "unix:{folder}/x"\nprotocol = "text"\ncard = "isa"\n'
    with (
        process(*command), connected(lambda: unix(path)) as theirs,
        served(folder, host), connected(lambda: unix(folder / "x")) as ours,
    ):  # fmt: skip
        return trips((theirs, b"inb 0x70\n"), (ours, b"inb 0x340\n"))


def lewis(folder: Path) -> list[tuple[float, float]]:
    """Round trips over TCP: a lewis device, vbus."""
    port = free_port()
    device = f"stream: {{bind_address: localhost, port: {port}}}"
    command = (
        sys.executable, "-m", "lewis", "-o", "none", "-k", "lewis.examples", "example_motor",
        "-p", device,
    )  # fmt: skip
    with process(*command):
        return over_tcp(folder, port, b"P?\r\n", 7)


def sinstruments(folder: Path) -> list[tuple[float, float]]:
    """Round trips over TCP: a device of sinstruments that answers a position, vbus."""
    port = free_port()
    (folder / "peer_device.py").write_text(DEVICE)
    code = SINSTRUMENTS.format(folder=str(folder), port=port)
    with process(sys.executable, "-c", code):
        return over_tcp(folder, port, b"P?\n")


def over_tcp(
    folder: Path, port: int, question: bytes, burst: int = BURST
) -> list[tuple[float, float]]:
    """Return round trips of a question to the peer at a port, and of ``r 0`` to vbus."""
    mine = free_port()
    host = f'[[hosts]]\ntransport = "tcp:{mine}"\nprotocol = "text"\n'
    with (
        connected(lambda: socket.create_connection(("127.0.0.1", port))) as theirs,
        served(folder, host),
        connected(lambda: socket.create_connection(("127.0.0.1", mine))) as ours,
    ):
        for link in (theirs, ours):
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return trips((theirs, question), (ours, b"r 0\n"), burst)


def strobes(folder: Path) -> list[tuple[float, float]]:
    """Reads at the pins, in microseconds each: cocotb with Icarus Verilog, vbus."""
    from cocotb_tools.runner import get_runner

    (folder / "register.v").write_text(VERILOG)
    (folder / "reads.py").write_text(COCOTB.format(cycles=CYCLES))
    out = folder / "took"
    os.environ["PEERS_OUT"] = str(out)
    os.environ["PYTHONPATH"] = f"{folder}:{os.environ.get('PYTHONPATH', '')}"
    runner = get_runner("icarus")
    build = folder / "build"
    runner.build(
        sources=[folder / "register.v"], hdl_toplevel="register", build_dir=build,
        log_file=folder / "build.log",
    )  # fmt: skip
    runner.test(
        hdl_toplevel="register", test_module="reads", build_dir=build, test_dir=folder,
        log_file=folder / "test.log",
    )  # fmt: skip
    theirs = float(out.read_text()) / CYCLES * 1e6

    port = load_board_text(LM629).open_port("pins")
    names = port.info().lines
    cs, ps, rd = (1 << names.index(f"x.{name}") for name in ("/CS", "/PS", "/RD"))
    port.lines(cs | ps, 0)
    start = time.perf_counter()
    for _ in range(CYCLES):
        port.lines(rd, 0)
        port.delay(180_000)
        value, _ = port.sample()
        port.lines(rd, rd)
        port.delay(180_000)
    assert value == 0x84
    return [(theirs, (time.perf_counter() - start) / CYCLES * 1e6)]


def show(work: str, peer: str, rounds: list[tuple[float, float]]) -> None:
    """Print medians of the rounds, and between what half of the rounds were."""
    theirs, ours = zip(*rounds, strict=True)
    ratio = statistics.median(his / mine for his, mine in rounds)
    faster = f"{ratio:.1f} times ahead" if ratio >= 1 else f"{1 / ratio:.2f} x it"
    print(f"{work}: {peer} {spread(theirs)}, vbus {spread(ours)}: {faster}", flush=True)


def spread(times: tuple[float, ...]) -> str:
    if len(times) < 2:
        return f"{times[0]:.1f} us"
    low, middle, high = statistics.quantiles(times, n=4)
    return f"{middle:.1f} us ({low:.1f} to {high:.1f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--one-cpu", action="store_true", help="client and servers share one")
    if parser.parse_args().one_cpu:
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    cpus, load = len(os.sched_getaffinity(0)), os.getloadavg()[0]
    print(f"{core()} core, {cpus} processors for client and servers, load {load:.1f} before")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if shutil.which("qemu-system-x86_64"):
            show("inb over a Unix socket", "QEMU qtest", qtest(folder))
        else:
            print("QEMU: not installed (Debian: qemu-system-x86)")
        if importlib.util.find_spec("sinstruments"):
            show("a query over TCP", "sinstruments", sinstruments(folder))
        else:
            print("sinstruments: not installed (pip install sinstruments)")
        if importlib.util.find_spec("lewis"):
            show("a query over TCP", "lewis", lewis(folder))
        else:
            print("lewis: not installed (pip install lewis)")
        if shutil.which("iverilog") and importlib.util.find_spec("cocotb"):
            show("a read at the pins", "cocotb, Icarus Verilog", strobes(folder))
        else:
            print("cocotb, Icarus Verilog: not installed (pip install cocotb; Debian: iverilog)")


if __name__ == "__main__":
    main()
