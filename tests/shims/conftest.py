"""Drivers compiled with a shim for the PC, and run against a board served for real."""

import io
import os
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from typing import Final

import pytest

from tests.e2e.serving import served
from tests.left_out import require
from vbus.board.build import build
from vbus.board.config import read_board_text
from vbus.cli.transcript import Transcript
from vbus.serve.serving import links_of

EXAMPLES = Path(__file__).parents[2] / "firmware_host_examples"


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Boards of one name may run in several tests at a time."""
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))


@cache
def _printed(shim: str) -> tuple[str, ...]:
    command = [sys.executable, "-m", "vbus", "cflags", "--shim", shim]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return tuple(done.stdout.split())


def flags(shim: str) -> list[str]:
    """Return what ``vbus cflags`` prints; each shim is asked for once."""
    return list(_printed(shim))


WARNED: Final = ("-Wall", "-Wextra", "-Werror")


@cache
def _objects() -> TemporaryDirectory[str]:
    return TemporaryDirectory(prefix="vbus-objects-")


@cache
def _object_of(source: str, compiler: str, options: tuple[str, ...]) -> str:
    """Compile one of the shim's own sources, once with the same options."""
    made = Path(mkdtemp(dir=_objects().name), Path(source).stem).with_suffix(".o")
    _call(compiler, *WARNED, *options, "-c", "-o", str(made), source)
    return str(made)


def _call(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def compile_for(shim: str, output: Path, *more: str | Path, compiler: str = "g++") -> Path:
    """Compile sources as the page says; every warning is an error.

    What the page does with one command for all sources is done here source by source for those of
    the shim, with the same options: drivers that are compiled alike share them.
    """
    found = require(compiler)
    printed = flags(shim)
    words = [*printed, *map(str, more)]
    options = [
        word
        for before, word in pairwise(("", *words))
        if before in ("-include", "-wrapper") or (word.startswith("-") and word != "-x")
    ]
    built = {
        word: _object_of(word, found, tuple(options))
        for before, word in pairwise(("", *printed))
        if word.startswith("/") and before != "-wrapper"
    }
    _call(found, *WARNED, "-o", str(output), *(built.get(word, word) for word in words))
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
