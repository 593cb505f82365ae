"""The C client, compiled with every warning an error."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.left_out import require
from tests.unit.client.served import Served
from tests.waiting import PATIENCE
from vbus.native import include_dir

WARNINGS = ["-Wall", "-Wextra", "-Werror", "-pedantic", "-Wconversion", "-Wshadow"]
PATIENT = f"-DDEFAULT_TIMEOUT_MS={PATIENCE * 1000:.0f}"
"""The board is a thread of a run of tests, on a machine that may be busy."""


CLIENT = Path(include_dir(), "vbus.c")


def compile_c(compiler: list[str], source: Path, output: Path, client: Path = CLIENT) -> None:
    """Compile a C host together with the C client."""
    command = [require(compiler[0]), *compiler[1:], *WARNINGS, PATIENT, f"-I{include_dir()}"]
    done = subprocess.run(
        [*command, "-o", str(output), str(source), str(client)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="session")
def exercise(tmp_path_factory: pytest.TempPathFactory) -> Path:
    program = tmp_path_factory.mktemp("native") / "exercise"
    compile_c(["gcc", "-std=c99", "-g"], Path(__file__).parent / "exercise.c", program)
    return program


@pytest.fixture(params=["pty", "unix", "tcp"])
def served(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Served]:
    with Served(request.param, tmp_path) as board:
        yield board


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Served]:
    with Served("unix", tmp_path) as board:
        yield board
