"""The library that ``vbus exec`` loads into programs: building it, and its settings."""

import os
import re
import shutil
from fcntl import LOCK_EX, flock
from pathlib import Path
from typing import Final

from vbus.cli.hosted.compiler import cached, compiled, placed
from vbus.cli.output import complain
from vbus.core.errors import ConfigError, VbusError
from vbus.native import include_dir
from vbus.protocols.port import PortInfo

NAME: Final = "libvbus-exec.so"
_SOURCES: Final = (
    "x86.c", "x86_two.c", "x86_wide.c", "x86_follow.c", "client.c", "card.c", "trap.c", "follow.c",
    "files.c", "descriptors.c", "programs.c", "turns.c", "signals.c", "spin.c", "clock.c",
    "threads.c", "queues.c", "timers.c", "listen.c", "calls.c", "time64.c",
)  # fmt: skip
_FLAGS: Final = (
    "-shared", "-fPIC", "-std=gnu11", "-O2", "-flto", "-msse2", "-mno-red-zone",
    "-fvisibility=hidden", "-U_FORTIFY_SOURCE", "-w",
)  # fmt: skip

# What the dynamic loader puts in place of $LIB differs between distributions.
_FOLDERS: Final = {
    64: ("lib/x86_64-linux-gnu", "lib64", "lib"),
    32: ("lib/i386-linux-gnu", "lib32"),
}

SSE_ONLY: Final = "glibc.cpu.hwcaps=-AVX,-AVX2,-AVX512F,-AVX512VL,-AVX_Fast_Unaligned_Load"
"""Keeps the C library's string functions to moves that a trapped window understands."""


def library() -> str:
    """Return the path for LD_PRELOAD, with the loader's ``$LIB``; built on first use.

    Raises:
        VbusError: there is no gcc, or it cannot build the library.
    """
    folder = _folder()
    if not (folder / "built").exists():
        folder.mkdir(parents=True, exist_ok=True)
        # One process compiles, with all of a processor; those that need the same wait for it.
        with (folder / "lock").open("w") as lock:
            flock(lock, LOCK_EX)
            if not (folder / "built").exists():
                _build(folder)
    return str(folder / "$LIB" / NAME)


def has_32_bits() -> bool:
    """Return whether the library that has been built serves 32-bit programs too."""
    return (_folder() / _FOLDERS[32][0] / NAME).exists()


def warn_of(program: str, policy: str) -> None:
    """Say on stderr what cannot be bent in ``program``; call after :func:`environment`.

    Args:
        program: as on the command line.
        policy: who is the board's master of time.
    """
    from vbus.cli.hosted.reach import warnings_for

    for text in warnings_for(program, has_32_bits(), policy != "realtime"):
        complain(text, "vbus exec: warning: ")


def _folder() -> Path:
    native = Path(include_dir())
    return cached(
        "exec", [*sorted((native / "exec").glob("*.[ch]")), native / "vbus.c", native / "vbus.h"]
    )


def _build(folder: Path) -> None:
    compiler = shutil.which("gcc")
    if compiler is None:
        raise VbusError(
            "the library that attaches programs must be built first, and there is no gcc; install"
            " gcc (and gcc-multilib for 32-bit programs)"
        )
    sources = [str(Path(include_dir()) / "exec" / source) for source in _SOURCES]
    for bits, places in _FOLDERS.items():
        made = folder / f"{bits}.{os.getpid()}"
        words = [compiler, f"-m{bits}", *_FLAGS, *sources, "-ldl", "-lpthread"]
        wrong = compiled(words, made)
        # Most machines lack what 32-bit programs need: the message comes when one is run.
        if wrong and bits == 64:
            raise VbusError(f"the library that attaches programs cannot be built ({wrong})")
        for place in places if not wrong else ():
            placed(made, folder / place / NAME)
        made.unlink(missing_ok=True)
    (folder / "built").touch()


def environment(
    info: PortInfo, where: str, note: Path | None = None, limit: int = 0, order: int = 0
) -> dict[str, str]:
    """Return the variables with which a program finds the card behind link ``where``.

    The library makes the file ``note`` when the program ends by a fault of its own, and tells the
    board when ``limit`` ps have passed, if that is not 0. Threads have their turns in the order in
    which they were created, or as the seed ``order`` draws them, if that is not 0.

    Raises:
        ConfigError: the link has no card.
        VbusError: the library cannot be built.
    """
    if not info.card:
        raise ConfigError(f"{where}: this link has no card; name one as card of its host")
    cycles = ",".join(str(chip.cycle_ps) for chip in info.chips)
    settings = f"policy={info.policy};cycles={cycles};{info.program};limit={limit};"
    settings += f"order={order};" if order else ""
    settings += f"note={note or ''};card={_sorted(info.card)}"
    # In front of what the user loads: accesses must be trapped whatever else wraps the calls.
    loaded = [library(), *filter(None, [os.environ.get("LD_PRELOAD")])]
    variables = {"VBUS_LINK": where, "VBUS_EXEC": settings, "LD_PRELOAD": ":".join(loaded)}
    if "memory=1" in info.program and "GLIBC_TUNABLES" not in os.environ:
        variables["GLIBC_TUNABLES"] = SSE_ONLY
    return variables


def _sorted(card: str) -> str:
    """Return the card's table by direction and address, as the library looks things up."""
    return " ".join(
        sorted(card.split(), key=lambda row: (row[0], int(re.split("[=!]", row[1:])[0], 16)))
    )
