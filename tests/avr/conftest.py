"""Firmware compiled with avr-gcc and run by simavr, its port bits wired to a board."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from vbus.cli.run.firmware import simulator
from vbus.core.errors import VbusError

EXAMPLES = Path(__file__).parents[2] / "firmware_host_examples"


@pytest.fixture(scope="session", autouse=True)
def tools() -> None:
    """Skip without avr-gcc and libsimavr."""
    reason = "" if shutil.which("avr-gcc") else "needs gcc-avr and avr-libc"
    try:
        simulator()
    except VbusError as error:
        reason = reason or str(error)
    if reason:
        pytest.skip(reason)


def compile_avr(
    output: Path, *sources: Path, mmcu: str = "atmega328p", frequency: int = 16_000_000
) -> Path:
    """Compile firmware with every warning an error."""
    command = ["avr-gcc", f"-mmcu={mmcu}", f"-DF_CPU={frequency}UL", "-Os", "-std=gnu99", "-Wall"]
    folders = {source.parent for source in sources} | {EXAMPLES / "lm629_c"}
    done = subprocess.run(
        [*command, "-Wextra", "-Werror", *(f"-I{folder}" for folder in sorted(folders)),
         f"-I{EXAMPLES / 'lm629_avr_bitbang'}", f"-I{Path(__file__).parent}",
         "-o", str(output), *map(str, sources)],
        capture_output=True,
        text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return output


Compile = Callable[..., Path]


@pytest.fixture
def firmware(tmp_path: Path) -> Compile:
    """Compile the body of a main with the bus of the bit-bang example."""

    def make(body: str, mmcu: str = "atmega328p") -> Path:
        source = tmp_path / "main.c"
        source.write_text(f'#include "firmware.h"\n{body}\n')
        driver = [
            EXAMPLES / "lm629_avr_bitbang" / "lm629_bus.c",
            EXAMPLES / "lm629_c" / "lm629_driver.c",
        ]
        used = driver if mmcu == "atmega328p" else []
        return compile_avr(tmp_path / "main.elf", source, *used, mmcu=mmcu)

    return make


LOOK = "    data = (uint8_t)((PINB & LOW_BITS) | (PIND & HIGH_BITS));\n"
STROBE = "    cbi(PORTC, RD);\n"


def early_bus(output: Path) -> Path:
    """Write the bus of the bit-bang example, which takes each byte before its read strobe."""
    text = (EXAMPLES / "lm629_avr_bitbang" / "lm629_bus.c").read_text()
    assert text.count(LOOK) == 1
    assert text.count(STROBE) == 1
    output.write_text(text.replace(LOOK, "").replace(STROBE, LOOK + STROBE))
    return output
