"""Whether the library of ``vbus exec`` can enter a program, and what it cannot bend there.

That is what the program's file tells: its ELF header, its mode, and what it is made of.
"""

import os
import re
import shutil
import stat
from contextlib import suppress
from pathlib import Path
from typing import Final

from vbus.core.elf import MAGIC, Elf

_PT_INTERP: Final = 3
_I386: Final = 3
_X86_64: Final = 62
_REMEDY: Final = "its port and memory accesses do not reach the card"
_REAL: Final = "which stays real time while the card's time is virtual"

_GO: Final = b"\x04\0\0\0Go\0\0"
"""Type and name of the note in which Go's linker leaves the build's number."""

_UNBENT: Final = (
    (
        re.compile(rb"\0liburing\.so"),
        "waits by io_uring (liburing), past the C library: by a clock",
    ),
    (re.compile(rb"\0libaio\.so"), "waits by libaio, past the C library: by a clock"),
    (
        # rdtsc or rdtscp, some moves, and a shift left by 32: its halves are put together
        re.compile(
            rb"\x0f(?:\x31|\x01\xf9)(?:\x89.|\x48\x89.|\x0f\xae\xe8){0,3}\x48\xc1[\xe0-\xe7]\x20",
            re.DOTALL,
        ),
        "reads the processor's counter (rdtsc),",
    ),
)
"""What a program may be made of that keeps a time of its own."""


def warnings_for(program: str, has_32_bits: bool, virtual: bool) -> list[str]:
    """Return why a program cannot be served, or what of it cannot be bent: a sentence each.

    Of a script its interpreter is looked at. What cannot be read is passed over.

    Args:
        program: as given on the command line; looked up in PATH without a slash.
        has_32_bits: whether the library exists for 32-bit programs.
        virtual: whether the program's time shall follow the chips'.
    """
    path = shutil.which(program)
    try:
        image = b"" if path is None else Path(path).read_bytes()
    except OSError:
        return []
    if path is not None and image[:2] == b"#!":
        interpreter = image[2:256].split()[:1]
        return (
            warnings_for(os.fsdecode(interpreter[0]), has_32_bits, virtual) if interpreter else []
        )
    if path is None or image[:4] != MAGIC or len(image) < 64 or image[5] != 1:
        return []
    refused = _refusal(program, path, image, has_32_bits)
    if refused is not None:
        return [refused]
    if not virtual:
        return []
    return [f"{program} {what} {_REAL}" for pattern, what in _UNBENT if pattern.search(image)]


def _refusal(program: str, path: str, image: bytes, has_32_bits: bool) -> str | None:
    """Return why the library cannot enter a program, or cannot stay; or None."""
    mode = os.stat(path).st_mode
    kinds, machine = set[int](), int.from_bytes(image[18:20], "little")
    with suppress(ValueError):  # what is cut off the system refuses itself
        kinds.update(one.kind for one in Elf(image).segments())
    if machine not in (_I386, _X86_64):
        return f"{program} is not an x86 program; {_REMEDY}"
    if mode & (stat.S_ISUID | stat.S_ISGID):
        return (
            f"{program} is set-user-ID or set-group-ID, so the system loads no library into it;"
            f" {_REMEDY}; run a copy without that bit"
        )
    # The notes of a linker stand within the first pages of a file.
    if _GO in image[:8192]:
        return (
            f"{program} is written in Go, which calls the system and handles signals without the C"
            f" library; {_REMEDY}; use the C client (vbus cflags), or another language"
        )
    # The dynamic loader, run as a program, loads libraries without being asked for itself.
    if _PT_INTERP not in kinds and not os.path.basename(path).startswith("ld"):
        return (
            f"{program} is linked statically, so no library can be loaded into it; {_REMEDY};"
            " link it without -static, or compile its source with the headers of"
            " vbus cflags --shim linux-io or mmio"
        )
    if machine == _X86_64 and image[4] == 1:
        return f"{program} is of the x32 kind, for which there is no library; {_REMEDY}"
    # The loader's name is in the interpreter segment, near the beginning.
    if b"/ld-musl-" in image[:8192]:
        return f"{program} uses musl in place of glibc, for which the library is made; {_REMEDY}"
    if machine == _I386 and not has_32_bits:
        return (
            f"{program} has 32 bits and the library could be built for 64 bits only; {_REMEDY};"
            " install gcc-multilib, remove ~/.cache/vbus and run it again"
        )
    return None
