"""The ``vbus`` command as a process, with the invented parts of the unit tests plugged in."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import vbus as package

ROOT = Path(__file__).parents[2]

BOARD = """\
[board]
name = "bench"

[chips.x]
part = "ACME-1"
clock = "8 MHz"
plant = "m"

[plants.m]
model = "motor"
supply = "24 V"

[[hosts]]
transport = "pty:$VBUS_RUNTIME/x"

[[hosts]]
transport = "unix:$VBUS_RUNTIME/x.sock"
protocol = "text"
"""


def plug_in(folder: Path) -> None:
    """Register the invented parts the way an installed package of somebody else does."""
    info = folder / "acme-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[vbus.chips]\nACME = tests.unit.board.parts:Acme\nHOLE = no_such_module:Chip\n"
        "[vbus.transports]\nhole = no_such_module:Transport\n"
        "[vbus.plants]\nmotor = tests.unit.board.parts:Motor\n"
    )
    home = Path(next(iter(package.__path__))).parent
    os.environ["PYTHONPATH"] = f"{folder}:{home}:{ROOT}"


def start(*arguments: str | Path) -> subprocess.Popen[str]:
    """Start ``vbus``."""
    command = [sys.executable, "-m", "vbus", *map(str, arguments)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, stdin=subprocess.DEVNULL, text=True)


def vbus(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run ``vbus`` to its end; no mistake of a user may give a traceback."""
    process = start(*arguments)
    out, err = process.communicate(timeout=60)
    assert "Traceback" not in err
    return subprocess.CompletedProcess(arguments, process.returncode, out, err)


@contextmanager
def running(*arguments: str | Path) -> Iterator[tuple[subprocess.Popen[str], list[str]]]:
    """Run ``vbus run`` while the block runs; gives the process and what it printed when ready."""
    process = start("run", *arguments)
    assert process.stdout is not None
    lines = []
    for line in process.stdout:
        lines.append(line.rstrip("\n"))
        if line.startswith(("ready", "{")):
            break
    try:
        yield process, lines
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
