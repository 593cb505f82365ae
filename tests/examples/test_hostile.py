"""The hostile chip's example: behind the planted weakness, which its page finds, stands another."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.examples.boards import EXAMPLES


@pytest.mark.slow
def test_with_the_reset_loop_mended_the_poll_limit_is_found(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES / "hostile_lm629", tmp_path, dirs_exist_ok=True)
    driver = tmp_path / "driver.c"
    text = driver.read_text()
    mended = text.replace("return first == 0x84;", "return first != 0;")
    assert mended != text
    driver.write_text(mended)
    command = [sys.executable, "-m", "pytest", "-q", "test_driver.py"]
    found = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert found.returncode == 1
    assert "AssertionError: assert 'at 0\\n' == 'at 100\\n'" in found.stdout
    assert 'under:   x.busy = "worst"' in found.stdout
