"""The plain binaries under ``vbus exec``, run as their READMEs say."""

import subprocess
from pathlib import Path

import pytest

from tests.examples.boards import EXAMPLES, expected, require, vbus

SOURCES = {
    "lm629_portio": ["main.c", "lm629_card.c"],
    "mcp1200_mmio": ["main.c", "../mcp1200_c/mcp1200_driver.c", "-I../mcp1200_c"],
    "mc1241a_isa_interrupt": [
        "main.c",
        "../mc1241a_isa_c/mc1241a_driver.c",
        "-I../mc1241a_isa_c",
    ],
}


def compiled(example: str, program: Path) -> Path:
    """Compile an example for the real computer: no header and no library of vbus."""
    done = subprocess.run(
        [require("cc"), "-std=gnu99", "-O2", "-Wall", "-Wextra", "-Werror", "-o", str(program),
         *SOURCES[example]],
        cwd=EXAMPLES / example, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return program


@pytest.mark.parametrize("example", SOURCES)
def test_a_plain_binary_does_the_same_on_every_run(example: str, tmp_path: Path) -> None:
    program = compiled(example, tmp_path / "program")
    assert b"vbus" not in program.read_bytes()
    board = EXAMPLES / example / "board.toml"
    transcripts = []
    for turn in ("first", "second"):
        transcript = tmp_path / f"{turn}.txt"
        done = subprocess.run(
            vbus("exec", "--board", str(board), "--transcript", str(transcript), "--",
                 str(program)),
            capture_output=True, text=True, timeout=60,
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, "")  # no violation either
        assert done.stdout == expected(example)
        transcripts.append(transcript.read_text())
    assert transcripts[0] == transcripts[1]
    assert len(transcripts[0].splitlines()) > 50
