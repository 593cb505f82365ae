"""What a trapped instruction costs beyond its bus cycle, and what posting and leases save.

The same C program runs the same operations by the C client and by ``inb``, ``outb`` and
/dev/port under ``vbus exec``, in turn, on one board: with 64 bits, and with 32 where they can be
built. Beside them stand the limits of this machine: an echo over a socket, and a fault with an
empty handler. A home search and a move that is waited for are told in wall time for each second of
chip time. Then port bits moved through the AVR shim.
All processes share one CPU, where a round trip always takes the same switches; only differences and
ratios count. ``benchmarks/pins.py`` has simavr, and the shim with bus traffic.
"""

import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
DRIVER = HERE.parent / "tests" / "exec" / "programs"
ROUNDS = 5
MOTOR_ROUNDS = 3
PINS = 2_000_000

BOARD = """
[board]
name = "trapped-access"
time = "{time}"
power_on = "done"
[chips.x]
part = "{part}"
clock = "8 MHz"
plant = "{plant}"
{more}
[[hosts]]
transport = "unix:$VBUS_RUNTIME/x.sock"
{way}
"""
CARD = '[cards.slot]\nbase = 0x340\ndecode = "direct"\nchips = ["x"]'
LINE = 'interrupt = "x.HI"'
MOTOR = """
[plants.m]
model = "dc_motor"
supply = "24 V"
resistance = "2 ohm"
torque_constant = "0.05 N*m/A"
inertia = "1e-5 kg*m^2"
encoder_lines = 3000
"""
PIN_MAP = "\n".join(
    [
        "[pinmaps.avr.pins]",
        *(f'PB{bit} = "D{bit}"' for bit in range(8)),
        *(f'PC{bit} = "{pin}"' for bit, pin in enumerate(("/RD", "/WR", "/PS", "/CS"))),
    ]
)
TOGGLE = f"""
#include <avr/io.h>
#include <stdio.h>
#include <time.h>
int main(void)
{{
    struct timespec began, ended;
    long turn;
    PORTC = 0x0F;
    DDRC = 0x0F;
    clock_gettime(CLOCK_MONOTONIC, &began);
    for (turn = 0; turn < {PINS // 2}; turn++) {{
        PORTC &= (unsigned char)~_BV(2);
        PORTC |= _BV(2);
    }}
    clock_gettime(CLOCK_MONOTONIC, &ended);
    printf("%.1f\\n", ((ended.tv_sec - began.tv_sec) * 1e9 + (ended.tv_nsec - began.tv_nsec))
           / {PINS}.0);
    return 0;
}}
"""


def vbus(*arguments: str | Path) -> str:
    command = [sys.executable, "-m", "vbus", *map(str, arguments)]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def on_board(folder: Path, text: str, program: Path, *arguments: str) -> str:
    board = folder / "board.toml"
    board.write_text(text)
    return vbus("exec", "--board", board, "--", program, *arguments)


def medians(program: Path, folder: Path) -> dict[str, float]:
    """Return nanoseconds per operation."""
    told = subprocess.run(
        [program, "limits", str(ROUNDS)], check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    for what, part, plant, more in (
        ("cycles", "MCP-1200", "none", CARD),
        ("polls", "LM629N-8", "none", f"{CARD}\n{LINE}"),
        ("motor", "LM629N-8", "m", f"{CARD}\n{LINE}{MOTOR}"),
    ):
        board = BOARD.format(
            time="lockstep", part=part, plant=plant, more=more, way='card = "slot"'
        )
        rounds = MOTOR_ROUNDS if what == "motor" else ROUNDS
        told += on_board(folder, board, program, what, str(rounds))
    times: dict[str, list[float]] = {}
    for line in told.splitlines():
        name, value = line.split("\t")
        times.setdefault(name, []).append(float(value))
    for name, more, less in (
        ("beyond", "trapped plain", "client plain"),
        ("least", "fault and echo", "echo"),
    ):
        times[name] = [a - b for a, b in zip(times[more], times[less], strict=True)]
    return {name: statistics.median(values) for name, values in times.items()}


def build(folder: Path, bits: int) -> Path | None:
    """Return the program, or None where there is no compiler for so many bits."""
    program = folder / f"trapped_access{bits}"
    command = ["gcc", f"-m{bits}", "-O2", "-pthread", f"-I{DRIVER}", "-o", program]
    command += [HERE / "trapped_access.c", *vbus("cflags").split()]
    done = subprocess.run(command, check=bits == 64, stderr=subprocess.DEVNULL)
    return program if done.returncode == 0 else None


def print_polls(bits: int, ns: dict[str, float]) -> None:
    """Print what traps cost a program of so many bits."""

    def row(text: str, value: float, goal: str = "") -> None:
        print(f"  {text:39}{value:8.2f} {goal}".rstrip())

    def times(value: float) -> str:
        return f"us   {value / ns['fault']:6.2f} x the fault"

    print(f"Programs of {bits} bits")
    row("a bare fault (the limit of an access)", ns["fault"] / 1000, "us")
    for text, name in (
        ("leased poll by inb, each a fault", "trapped leased"),
        ("  with a second thread", "leased with a thread"),
        ("leased poll in a loop of the program's", "polled"),
        ("  with a second thread", "polled with a thread"),
        ("leased poll by pread of /dev/port", "device leased"),
        ("read that is asked for, by inb", "trapped plain"),
    ):
        row(text, ns[name] / 1000, times(ns[name]))
    row("leased, beyond the bare fault", (ns["trapped leased"] - ns["fault"]) / 1000,
        "us   goal <= 2")  # fmt: skip
    row("home search, polled", ns["home"], "of its chip time   goal <= 1.5")
    row("a move, its interrupt waited for", ns["interrupt"], "of its chip time")


def pin_time(folder: Path) -> float:
    source, program = folder / "toggle.c", folder / "toggle"
    source.write_text(TOGGLE)
    flags = vbus("cflags", "--shim", "avr").split()
    subprocess.run(["g++", "-O2", *flags, "-DF_CPU=16000000UL", "-o", program, source], check=True)
    board = BOARD.format(
        time="slaved", part="LM629N-8", plant="none", more=PIN_MAP, way='pinmap = "avr"'
    )
    return statistics.median(float(on_board(folder, board, program)) for _ in range(3))


def main() -> None:
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        programs = {bits: build(folder, bits) for bits in (64, 32)}
        every = {bits: medians(program, folder) for bits, program in programs.items() if program}
        pin = pin_time(folder)
    ns = every[64]
    per_second = {name: 1e9 / value for name, value in ns.items()}
    polls = per_second["client leased"] / per_second["client polls"]
    print(f"Bus operations of programs, lockstep, one CPU, median of {ROUNDS} interleaved rounds")
    print(f"  echo over a socket (the limit)         {ns['echo'] / 1000:8.2f} us")
    print(f"  read by the C client                   {ns['client plain'] / 1000:8.2f} us")
    print(f"  the same by inb                        {ns['trapped plain'] / 1000:8.2f} us")
    print(f"  beyond the client, round by round      {ns['beyond'] / 1000:8.2f} us    goal <= 2.5")
    print(f"    of which a bare fault (the limit)    {ns['least'] / 1000:8.2f} us")
    print(f"    and the library                      {(ns['beyond'] - ns['least']) / 1000:8.2f} us")
    print(f"  posted write by outb                   {ns['trapped posted'] / 1000:8.2f} us")
    print(f"  C client: plain polls                  {per_second['client polls']:8.0f} a second")
    print(f"            posted writes                {per_second['client posted']:8.0f} a second")
    print(f"            leased polls                 {per_second['client leased']:8.0f} a second")
    print(f"  leased to plain                        {polls:8.1f}       goal >= 8")
    for bits, values in every.items():
        print_polls(bits, values)
    print(f"  port bits moved through the AVR shim   {1e9 / pin:8.0f} a second, {pin:.1f} ns each")


if __name__ == "__main__":
    main()
