"""C that is compiled when it is first needed, and is there from then on."""

import hashlib
import os
import shutil
import subprocess
from collections.abc import Iterable, Sequence
from pathlib import Path

from vbus.core.errors import VbusError
from vbus.native import include_dir

PIN_LINK = tuple(
    f"{name}{end}"
    for name in ("pin_link", "pin_decoder", "card_table", "link_text", "vbus")
    for end in (".c", ".h")
)
"""The part of the C client by which firmware reaches a pin map."""


def cached(name: str, files: Iterable[Path]) -> Path:
    """Return where what is compiled of some files belongs: another place whenever they change."""
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    digest = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:16]
    return base / "vbus" / f"{name}-{digest}"


def compiled(words: Sequence[str], made: Path) -> str:
    """Compile into a file; return the compiler's first complaint if it fails.

    Args:
        words: compiler, options, sources.
        made: the file.
    """
    made.parent.mkdir(parents=True, exist_ok=True)
    done = subprocess.run([*words, "-o", str(made)], capture_output=True, text=True)
    lines = done.stderr.strip().splitlines() or ["no reason given"]
    return next((line for line in lines if "error:" in line), lines[0]) if done.returncode else ""


def placed(made: Path, target: Path) -> None:
    """Copy a file to its place, in one step: another process may make the same."""
    target.parent.mkdir(parents=True, exist_ok=True)
    copy = target.with_suffix(f".{os.getpid()}")
    shutil.copy(made, copy)
    copy.replace(target)


def built(name: str, source: Path, options: list[str], hint: str) -> Path:
    """Return a program or library of ``source`` and the pin link; built on first use.

    Args:
        name: of the file.
        source: its C file.
        options: of the compiler, libraries included.
        hint: what to do where the compiler fails.

    Raises:
        VbusError: there is no compiler, or it cannot build this.
    """
    native = Path(include_dir())
    files = [source, *(native / part for part in PIN_LINK)]
    program = cached(name, files)
    if program.exists():
        return program
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        raise VbusError(f"{name} must be built first, and there is no C compiler; install gcc")
    # A name of its own until it is whole: another process may compile the same.
    made = program.with_suffix(f".{os.getpid()}")
    sources = [str(file) for file in files if file.suffix == ".c"]
    if wrong := compiled([compiler, "-O2", f"-I{native}", *sources, *options], made):
        raise VbusError(f"{name} cannot be built; {hint} ({wrong})")
    made.replace(program)
    return program
