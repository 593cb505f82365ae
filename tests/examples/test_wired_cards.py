"""Cards and boards of parts under drivers written as for the real ones."""

import subprocess
from itertools import groupby
from pathlib import Path

import pytest

from tests.examples.boards import EXAMPLES, expected, vbus
from tests.examples.test_exec import compiled
from tests.left_out import require

TWO_AXES = EXAMPLES / "lm629_two_axes"
SELECTS = """
[cards.slot]
bus = "ISA"
base = 0x340
hold = "130 ns"
[cards.slot.pins]
"D0-D7" = "x.D0-D7"
"/IOR" = "x./RD"
"/IOW" = "x./WR"
A0 = "x./PS"

[cards.slot.selects]
"x./CS" = "0-1"

[[hosts]]
transport = "unix:$VBUS_RUNTIME/slot.sock"
card = "slot"
"""
"""The card of a host example, decoded by its own select."""


def run(board: Path, program: Path, transcript: Path) -> tuple[int, str, str]:
    done = subprocess.run(
        vbus("exec", "--board", str(board), "--transcript", str(transcript), "--no-summary", "--",
             str(program)),
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("card", ["wired_card", "indexed_card", "ppi_card"])
def test_a_driver_moves_two_axes_on_a_card_of_parts(card: str, tmp_path: Path) -> None:
    program, transcript = tmp_path / "move", tmp_path / "bus.txt"
    done = subprocess.run(
        [require("cc"), "-std=gnu99", "-O2", "-Wall", "-Wextra", "-Werror", "-I../lm629_c", "-o",
         str(program), "main.c", f"{card}.c", "../lm629_c/lm629_driver.c"],
        cwd=TWO_AXES, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert run(TWO_AXES / f"{card}.toml", program, transcript) == (
        0,
        expected("lm629_two_axes"),
        "",
    )
    lines = transcript.read_text().splitlines()
    assert not [line for line in lines if line.startswith("!")]
    for chip in "xy":
        writes = [line for line in lines if line.startswith(f"{chip} w 0")]
        codes = [line.split()[3] for line in writes]
        assert codes == ["1D", "1E", "04", "1F", "01", "0A", "08"]


WIDE = """
[board]
time = "lockstep"

[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"

[cards.window]
bus = "SRAM"
memory = true
base = 0x50000000
size = 8
{more}

[cards.window.pins]
A23 = "x./CS"

[cards.window.registers.low]
at = 0

[cards.window.registers.high]
at = 1

[[hosts]]
transport = "unix:$VBUS_RUNTIME/wide.sock"
card = "window"
"""
PROGRAM = """
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/mman.h>

int main(void)
{
    int memory = open("/dev/mem", O_RDWR | O_SYNC);
    int both = PROT_READ | PROT_WRITE;
    volatile uint8_t *page = mmap(NULL, 4096, both, MAP_SHARED, memory, 0x50000000);
    volatile uint16_t *word = (volatile uint16_t *)page;

    *word = 0x1234;
    printf("%02X %02X %04X\\n", page[0], page[STRIDE], *word);
    return 0;
}
"""


@pytest.mark.parametrize(
    ("more", "stride", "read"),
    [
        ("", 1, "34 12 1234"),
        ("big_endian = true", 1, "12 34 1234"),
        ("stride = 2", 2, "34 00 FF34"),
    ],
)
def test_a_wide_access_is_so_many_cycles_in_the_order_of_the_card(
    more: str, stride: int, read: str, tmp_path: Path
) -> None:
    """With a stride the bytes between belong to nobody."""
    (tmp_path / "board.toml").write_text(WIDE.format(more=more))
    (tmp_path / "main.c").write_text(PROGRAM)
    program = tmp_path / "program"
    subprocess.run(
        [require("cc"), f"-DSTRIDE={stride}", "-o", str(program), str(tmp_path / "main.c")],
        check=True,
    )
    code, said, _ = run(tmp_path / "board.toml", program, tmp_path / "bus.txt")
    assert (code, said) == (0, read + "\n")


def cycles(transcript: Path) -> list[str]:
    """Return the cycles at chips, equal ones in a row once: how often is a matter of the line."""
    lines = [line.partition(" x")[0] for line in transcript.read_text().splitlines()]
    kept = [line for line in lines if not line.startswith(("slot ", "isa "))]
    return [line for line, _ in groupby(kept)]


def packets(transcript: Path) -> list[str]:
    """Return the cycles of commands and data, each as often as it was made."""
    found = []
    for line in transcript.read_text().splitlines():
        cycle, _, times = line.partition(" x")
        found += [cycle] * int(times or 1)
    return [cycle for cycle in found if cycle[:6] in ("mc w 0", "mc w 1", "mc r 0")]


def test_a_host_example_runs_on_its_card_built_of_selects(tmp_path: Path) -> None:
    board, plain = tmp_path / "board.toml", EXAMPLES / "lm629_portio" / "board.toml"
    board.write_text(plain.read_text().partition("[cards.slot]")[0] + SELECTS)
    program = compiled("lm629_portio", tmp_path / "program")
    found = []
    for file in (board, plain):
        transcript = tmp_path / f"{len(found)}.txt"
        assert run(file, program, transcript) == (0, expected("lm629_portio"), "")
        found.append(cycles(transcript))
    assert found[0] == found[1]
    assert len(found[0]) > 50


def test_the_manuals_isa_card_of_parts_serves_the_host_example_with_interrupts(
    tmp_path: Path,
) -> None:
    program, transcript = compiled("mc1241a_isa_interrupt", tmp_path / "program"), tmp_path / "bus"
    board = EXAMPLES / "mc1241a_isa_interrupt" / "stepper_card.toml"
    assert run(board, program, transcript) == (0, expected("mc1241a_isa_interrupt"), "")
    assert not [line for line in transcript.read_text().splitlines() if line.startswith("!")]
    plain = tmp_path / "plain"
    run(EXAMPLES / "mc1241a_isa_interrupt" / "board.toml", program, plain)
    # Reset and HostRdy are the card's own here, and further addresses of the chip there.
    data = [packets(file) for file in (transcript, plain)]
    assert data[0] == data[1]
    assert len(data[0]) > 100


def test_a_program_that_polls_a_card_in_vain_is_ended_and_told_by_the_chips_own_words(
    tmp_path: Path,
) -> None:
    (tmp_path / "main.c").write_text(
        "#include <sys/io.h>\n"
        "int main(void) { ioperm(0x340, 2, 1); while (!(inb(0x340) & 0x08)); return 0; }\n"
    )
    program, board = tmp_path / "program", tmp_path / "board.toml"
    subprocess.run([require("cc"), "-o", str(program), str(tmp_path / "main.c")], check=True)
    plain = (EXAMPLES / "lm629_portio" / "board.toml").read_text().partition("[cards.slot]")[0]
    board.write_text(plain.replace('"dc_motor"\nencoder_lines = 500', '"ideal"') + SELECTS)
    done = subprocess.run(
        vbus("exec", "--board", str(board), "--limit", "10 s", "--", str(program)),
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode != 0
    said = done.stderr.splitlines()
    assert said[0] == (
        "vbus: the program hangs: it polled 10000 times and read nothing new, and nothing on"
        " the board can change any more: x RDSTAT 84H MOTOR_OFF TRAJECTORY_COMPLETE since 1us"
    )
    assert not [line for line in said if line.startswith("vbus: slot has")]
