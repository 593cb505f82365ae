"""The hostile chip's example: behind the planted weakness, which its page finds, stands another."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.examples.boards import EXAMPLES, compile_c

FOLDER = EXAMPLES / "hostile_lm629"


def hunt(driver: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(FOLDER / "hunt.py"), str(driver)]
    return subprocess.run(command, capture_output=True, text=True)


@pytest.mark.slow
def test_with_the_reset_loop_mended_the_poll_limit_is_found(tmp_path: Path) -> None:
    half = tmp_path / "half.c"
    text = (FOLDER / "driver.c").read_text()
    half.write_text(text.replace("return first == 0x84;", "return first != 0;"))
    found = hunt(compile_c(tmp_path / "half", str(half)))
    assert found.returncode == 1
    assert found.stdout.startswith("the driver says 'at 0', and not 'at 100'")
    assert 'under: x.busy = "worst"' in found.stdout
