"""Compilers for the tests of ``vbus exec``."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.left_out import require

PROGRAMS = Path(__file__).parent / "programs"


@pytest.fixture(scope="session")
def can_32_bits(tmp_path_factory: pytest.TempPathFactory) -> bool:
    folder = tmp_path_factory.mktemp("probe")
    (folder / "probe.c").write_text("#include <stdio.h>\nint main(void) { return 0; }\n")
    command = [require("gcc"), "-m32", "-o", str(folder / "probe"), str(folder / "probe.c")]
    return subprocess.run(command, capture_output=True).returncode == 0


@pytest.fixture(params=[64, 32], ids=["64 bits", "32 bits"])
def bits(request: pytest.FixtureRequest, can_32_bits: bool) -> int:
    if request.param == 32 and not can_32_bits:
        pytest.skip("needs a 32-bit compiler (gcc-multilib)")
    return int(request.param)


def compile_c(output: Path, *arguments: str | Path) -> Path:
    """Compile a program, every warning an error."""
    command = [require("gcc"), "-Wall", "-Wextra", "-Werror", "-o", str(output)]
    done = subprocess.run([*command, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return output


@pytest.fixture(scope="session")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, int], Path]:
    """Programs by name and width, compiled once."""
    folder = tmp_path_factory.mktemp("programs")

    def program(name: str, bits: int) -> Path:
        path = folder / f"{name}{bits}"
        if not path.exists():
            compile_c(path, f"-m{bits}", "-O2", "-D_FORTIFY_SOURCE=2", PROGRAMS / f"{name}.c")
        return path

    return program
