"""Firmware images built with Debian's cross compilers, and run by the emulator on a board."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.left_out import require

EXAMPLES = Path(__file__).parents[2] / "firmware_host_examples"
PROGRAMS = Path(__file__).parent / "programs"


@pytest.fixture(scope="session", autouse=True)
def tools() -> None:
    """Skip without the emulator."""
    if find_spec("unicorn") is None:
        pytest.skip("needs unicorn: pip install 'vbus[cpu]'")


def build(output: Path, command: list[str], *sources: Path) -> Path:
    """Build an image; skip without its compiler."""
    require(command[0])
    done = subprocess.run(
        [*command, "-o", str(output), *map(str, sources)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return output


ARM = ["arm-none-eabi-gcc", "-mcpu=cortex-m3", "-mthumb", "-Os", "-Wall", "-Wextra", "-Werror",
       "-ffreestanding", "-nostdlib"]  # fmt: skip


def example(name: str, output: Path) -> Path:
    """Build the image of the STM32 example."""
    folder = EXAMPLES / name
    drivers = [EXAMPLES / "lm629_c", EXAMPLES / "mcp1200_c"]
    sources = [folder / "main.c", folder / "startup.c", drivers[0] / "lm629_driver.c",
               drivers[1] / "mcp1200_driver.c"]  # fmt: skip
    flags = [*(f"-I{driver}" for driver in drivers), "-T", str(folder / "stm32f103.ld")]
    return build(output, [*ARM, *flags], *sources, Path("-lgcc"))


M68K = ["m68k-linux-gnu-gcc", "-m68000", "-Os", "-Wall", "-Wextra", "-Werror", "-ffreestanding",
        "-nostdlib", "-static", "-fno-pic", "-fno-stack-protector",
        "-Wl,--build-id=none"]  # fmt: skip


def ended(processor: str, image: Path, board: Path) -> str:
    """Run an image that has no end; return what is said when the limit ends it."""
    done = subprocess.run(
        [sys.executable, "-m", "vbus", "exec", "--board", str(board), "--limit", "10 ms", "--cpu",
         processor, str(image)],
        capture_output=True, text=True, timeout=100,
    )  # fmt: skip
    assert done.returncode == 128 + 9
    assert "the program hangs: it was not done after 0.01 s of chip time" in done.stderr
    return done.stderr
