"""A board served by ``vbus run`` in a process of its own, as a user of an example starts it."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import Self

from tests.left_out import require
from vbus.core.exit_codes import INTERRUPTED

EXAMPLES = Path(__file__).parents[2] / "firmware_host_examples"


def vbus(*arguments: str) -> list[str]:
    """Return the command line of ``vbus`` with these arguments."""
    return [sys.executable, "-m", "vbus", *arguments]


class RunningBoard:
    """``vbus run`` on an example's board file; its links lie in a folder of their own.

    Args:
        example: the example's folder name.
        runtime: where its links go.
    """

    def __init__(self, example: str, runtime: Path) -> None:
        self.runtime = runtime
        self._process = subprocess.Popen(
            vbus("run", str(EXAMPLES / example / "board.toml")),
            env={**os.environ, "VBUS_RUNTIME": str(runtime)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def __enter__(self) -> Self:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith("ready"):
                return self
        _, errors = self._process.communicate()
        raise AssertionError(f"vbus run ended with code {self._process.returncode}: {errors}")

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._process.send_signal(signal.SIGINT)
        try:
            _, errors = self._process.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
            raise
        if error is None:
            assert errors == ""
            assert self._process.returncode in (0, INTERRUPTED)

    def link(self, name: str) -> str:
        """Return the path of a link by its name in the board file."""
        return str(self.runtime / name)


def compile_c(output: Path, *sources: str, shim: str = "") -> Path:
    """Compile an example as its README says, with every warning an error."""
    asked = vbus("cflags", "--shim", shim) if shim else vbus("cflags")
    flags = subprocess.run(asked, capture_output=True, text=True, check=True).stdout
    done = subprocess.run(
        [require("cc"), "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-o", str(output),
         *flags.split(), *(str(EXAMPLES / source) for source in sources)],
        capture_output=True,
        text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return output


def run(*command: str | Path) -> str:
    """Run a host to its end; return what it printed."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    assert done.stderr == ""
    assert done.returncode == 0, done.stdout
    return done.stdout


def expected(example: str) -> str:
    """Return the example's expected output."""
    return (EXAMPLES / example / "expected.txt").read_text()
