"""Examples: where they lie, how they are compiled and run, and what they print."""

import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from shutil import which

from tests.left_out import require
from tests.waiting import PATIENCE
from vbus.cli.hosted.preload import library
from vbus.cli.run.firmware import simulator
from vbus.core.errors import VbusError

EXAMPLES = Path(__file__).parents[2] / "firmware_host_examples"


def as_installed() -> dict[str, str]:
    """Return the environment of what users type.

    ``VBUS_INSTALLED`` names a folder whose vbus runs there in place of the sources: in CI that of
    the compiled core, which users have, and which moves axes in half of the processor's time.
    """
    known = dict(os.environ)
    if "VBUS_INSTALLED" in known:
        known["PYTHONPATH"] = known["VBUS_INSTALLED"]
        with suppress(VbusError):  # what cannot be had is left out, with the reason, by its page
            known.setdefault("VBUS_AVR", simulator())
    return known


def vbus(*arguments: str) -> list[str]:
    """Return the command line of ``vbus`` with these arguments, as users have it."""
    if arguments[:1] == ("exec",) and which("gcc"):
        library()  # it is compiled once, which is no part of what a test waits for
    path = os.environ.get("VBUS_INSTALLED", os.environ.get("PYTHONPATH", ""))
    return ["/usr/bin/env", f"PYTHONPATH={path}", sys.executable, "-P", "-m", "vbus", *arguments]


def compile_c(output: Path, *sources: str, shim: str = "") -> Path:
    """Compile an example as its README says, every warning an error; replies may take longer."""
    asked = vbus("cflags", "--shim", shim) if shim else vbus("cflags")
    flags = subprocess.run(asked, capture_output=True, text=True, check=True).stdout
    done = subprocess.run(
        [require("cc"), "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-o", str(output),
         f"-DDEFAULT_TIMEOUT_MS={PATIENCE * 1000:.0f}", *flags.split(),
         *(str(EXAMPLES / source) for source in sources)],
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
