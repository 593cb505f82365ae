"""Drivers compiled with a shim for the PC, and run against a board served for real."""

import io
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.serving import served
from vbus.board.build import build
from vbus.board.config import read_board_text
from vbus.server.serving import links_of
from vbus.tools.transcript import Transcript

EXAMPLES = Path(__file__).parents[2] / "firmware_host_examples"


def require(program: str) -> str:
    """Return the program's path; skip the test without it, unless everything is required."""
    found = shutil.which(program)
    if found is None and os.environ.get("VBUS_REQUIRE_ALL") != "1":
        pytest.skip(f"needs {program}")
    assert found is not None, f"{program} is required"
    return found


def flags(shim: str) -> list[str]:
    command = [sys.executable, "-m", "vbus", "cflags", "--shim", shim]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()


def compile_for(shim: str, output: Path, *more: str | Path, compiler: str = "g++") -> Path:
    """Compile sources as the page says; every warning is an error."""
    done = subprocess.run(
        [require(compiler), "-Wall", "-Wextra", "-Werror", *flags(shim), "-o", str(output),
         *map(str, more)],
        capture_output=True,
        text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return output


class Ran:
    """What a driver has said and done."""

    def __init__(self, code: int, said: str, errors: str, bus: list[str], when: int) -> None:
        self.code = code
        self.said = said
        self.errors = errors
        self.bus = bus
        self.when = when


Run = Callable[..., Ran]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Run a program against a board of its own; its link is the file's only one."""

    def run(program: Path, board: str, *arguments: str, code: int = 0, **environment: str) -> Ran:
        file, source = read_board_text(board.replace("$VBUS_RUNTIME", str(tmp_path / "run")))
        built = build(file, source)
        written = io.StringIO()
        transcript = Transcript(written)
        built.observe(transcript)
        (tmp_path / "run").mkdir(exist_ok=True)
        with served(built, *links_of(file)):
            done = subprocess.run(
                [program, *arguments],
                env={**os.environ, "VBUS_LINK": file.hosts[0].transport, **environment},
                capture_output=True,
                text=True,
                timeout=100,
                stdin=subprocess.DEVNULL,
            )
        transcript.flush()
        assert done.returncode == code, done.stdout + done.stderr
        bus = written.getvalue().splitlines()
        return Ran(done.returncode, done.stdout, done.stderr, bus, built.now)

    return run


@pytest.fixture
def driver(tmp_path: Path) -> Callable[..., Path]:
    """Compile one source text with a shim."""

    def make(shim: str, text: str, *more: str | Path, compiler: str = "g++") -> Path:
        source = tmp_path / "driver.c"
        source.write_text(text)
        return compile_for(shim, tmp_path / "driver", *more, source, compiler=compiler)

    return make
