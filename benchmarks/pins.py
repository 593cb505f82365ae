"""How fast port bits become bus cycles: AVR firmware in simavr, and a shim on the PC.

Prints how many times faster than its 16 MHz firmware ran, and the bus cycles per second of the
same source through the shim, for firmware that does nothing, that polls a status for ever
(without and with an interrupt line of the chip at one of its pins), that writes with pauses, that
polls busy after each write, and whose every write comes too early and is filed as a violation.
Needs gcc-avr, avr-libc, libsimavr-dev, libelf-dev and g++.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "firmware_host_examples"
BUS = EXAMPLES / "lm629_avr_bitbang"
WAIT = "while (lm629_bus_read_status() & LM629_BUSY) ;"
INTERRUPT = ('PC4 = "/RST"', 'PC4 = "/RST"\nPB2 = "HI"')
HOSTS = {
    "no traffic": "_delay_ms(3000);",
    "endless polling": "uint16_t i; for (i = 0; i < 20000; i++) lm629_bus_read_status();",
    "polling, interrupt wired": """uint16_t i; for (i = 0; i < 20000; i++)
        lm629_bus_read_status();""",
    "writes and pauses": """uint16_t i; for (i = 0; i < 5000; i++) {
        lm629_bus_write_command(0x1D); _delay_us(30);
        lm629_bus_write_data(0); lm629_bus_write_data(0); _delay_us(30); }""",
    "commands and polls": f"""uint16_t i; for (i = 0; i < 5000; i++) {{
        lm629_bus_write_command(0x1D); {WAIT}
        lm629_bus_write_data(0); lm629_bus_write_data(0); {WAIT} }}""",
    "writes that break the rules": """uint16_t i; for (i = 0; i < 5000; i++) {
        lm629_bus_write_command(0x1D); _delay_us(20);
        lm629_bus_write_data(0); lm629_bus_write_data(0); _delay_us(20); }""",
}
MAIN = """#include "lm629_bus.h"
#include "lm629_driver.h"
#include <avr/io.h>
#include <util/delay.h>
int main(void) {{ lm629_bus_init(); {} return 0; }}
"""


def vbus(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "vbus", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)
    return done


def simulator(folder: str) -> str:
    """Build vbus-avr; the package that runs may be one without the source tree around it."""
    source = ROOT / "contrib" / "simavr"
    make = ["make", "-s", "-C", folder, "-f", source / "Makefile", f"VPATH={source}"]
    subprocess.run([*make, f"NATIVE={ROOT / 'vbus' / 'native'}"], check=True)
    return f"{folder}/vbus-avr"


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        os.environ["VBUS_AVR"] = simulator(folder)
        for name, body in HOSTS.items():
            source = Path(folder) / "main.c"
            source.write_text(MAIN.format(body))
            common = [
                "-O2", "-DF_CPU=16000000UL", f"-I{BUS}", f"-I{EXAMPLES / 'lm629_c'}", "-o",
                f"{folder}/main", str(source), str(BUS / "lm629_bus.c"),
            ]  # fmt: skip
            text = (BUS / "board.toml").read_text()
            board = Path(folder) / "board.toml"
            board.write_text(text.replace(*INTERRUPT) if "interrupt" in name else text)
            subprocess.run(["avr-gcc", "-mmcu=atmega328p", *common], check=True)
            spec = "mmcu=atmega328p,f=16000000,stats"
            told = vbus("exec", "--board", board, "--avr", spec, f"{folder}/main").stderr
            found = re.search(r"(\d+) bus cycles, ([\d.]+) s, ([\d.]+) x", told)
            assert found, told
            cycles, seconds, speed = int(found[1]), float(found[2]), found[3]
            print(
                f"{name}: simavr {speed} x real time, {cycles / seconds:.0f} bus cycles/s", end=""
            )
            flags = vbus("cflags", "--shim", "avr").stdout.split()
            subprocess.run(["g++", *flags, "-DVBUS_INT_IS_32_BITS", *common], check=True)
            began = time.perf_counter()
            vbus("exec", "--board", board, "--", f"{folder}/main")
            print(f"; shim {time.perf_counter() - began:.2f} s, start-up included")


main()
