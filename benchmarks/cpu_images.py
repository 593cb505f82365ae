"""How fast firmware images run in the emulator: instructions, and operations on port bits.

Prints, for STM32 firmware, million instructions per second of processor time without traffic, and
operations on port bits (five to a read cycle) while a status is polled, without and with the chip's
interrupt wired to a pin; and how many times real time of 72 MHz that is. The board's share is in
it; what an image costs that does nothing is left out. Needs gcc-arm-none-eabi and unicorn.
"""

import os
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
PROGRAMS = ROOT / "tests" / "cpu" / "programs"
PINS = {f"PB{bit + 8}": f"D{bit}" for bit in range(8)} | {
    "PA0": "/CS", "PA1": "/PS", "PA2": "/RD", "PA3": "/WR",
}  # fmt: skip
BOARD = """[board]
name = "bench"
time = "slaved"
power_on = "done"
[cpu]
clock = "72 MHz"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "motor"
[plants.motor]
model = "ideal"
[[hosts]]
transport = "unix:$VBUS_RUNTIME/bench.sock"
pinmap = "bench"
[pinmaps.bench.pins]
"""
MAIN = """#include "arm.h"
static volatile uint32_t x;
int main(void) {{ uint32_t n = {}; CLOCKS |= 0xC; R(GPIOA + 0x10) = 0xF; R(GPIOA) = 0x44443333;
    while (n--) {{ {} }} return 0; }}
__attribute__((section(".vectors"), used)) static const void *const vectors[] = {{
    (void *)0x20005000, (void *)reset }};
"""
POLL = """R(GPIOA + 0x14) = 3; R(GPIOA + 0x14) = 4; x = R(GPIOB + 8);
    R(GPIOA + 0x10) = 4; R(GPIOA + 0x10) = 1;"""
HOSTS = {
    "nothing": (0, "", 0, False),
    "no traffic": (40_000_000, "x = x * 3 + n;", 0, False),
    "polling": (4_000_000, POLL, 5, False),
    "polling, interrupt wired": (4_000_000, POLL, 5, True),
}
ARM = "arm-none-eabi-gcc -mcpu=cortex-m3 -mthumb -O2 -ffreestanding -nostdlib"


def spent() -> float:
    """Return the processor time of programs that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    idle = 0.0
    with tempfile.TemporaryDirectory() as folder:
        source, image, board = (f"{folder}/{name}" for name in ("main.c", "x.elf", "board.toml"))
        for name, (count, body, operations, interrupt) in HOSTS.items():
            Path(source).write_text(MAIN.format(count, body))
            pins = PINS | ({"PA5": "HI"} if interrupt else {})
            Path(board).write_text(BOARD + "".join(f'{a} = "{b}"\n' for a, b in pins.items()))
            flags = [f"-I{PROGRAMS}", "-T", str(PROGRAMS / "arm.ld"), "-o", image]
            subprocess.run([*ARM.split(), *flags, source, "-lgcc"], check=True)
            command = [sys.executable, "-m", "vbus", "exec", "--board", board, "--cpu"]
            began = spent()
            done = subprocess.run(
                [*command, "cortex-m3,stats", image], capture_output=True, text=True,
                env={**os.environ, "VBUS_RUNTIME": folder},
            )  # fmt: skip
            seconds = spent() - began
            found = re.search(r"(\d+) clock cycles", done.stderr)
            if done.returncode or not found:
                sys.exit(done.stderr)
            if not count:
                idle = seconds
                continue
            cycles, seconds = int(found[1]), seconds - idle
            print(
                f"{name}: {cycles / seconds / 1e6:.1f} M instructions/s,"
                f" {count * operations / seconds / 1e6:.2f} M operations on port bits/s,"
                f" {cycles / seconds / 72e6:.2f} x real time"
            )


main()
