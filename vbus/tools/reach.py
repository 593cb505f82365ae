"""Whether the library of ``vbus exec`` can enter a program: what its ELF header and mode tell."""

import os
import shutil
import stat
import struct
from typing import Final

_PT_INTERP: Final = 3
_I386: Final = 3
_X86_64: Final = 62
_REMEDY: Final = "its port and memory accesses do not reach the card"


def warning_for(program: str, has_32_bits: bool) -> str | None:
    """Return why a program cannot be served, in one sentence, or None.

    Scripts and what cannot be read are passed over: the programs they start may well be served.

    Args:
        program: as given on the command line; looked up in PATH without a slash.
        has_32_bits: whether the library exists for 32-bit programs.
    """
    path = shutil.which(program)
    if path is None:
        return None
    try:
        mode = os.stat(path).st_mode
        with open(path, "rb") as file:
            head = file.read(64)
            if head[:4] != b"\x7fELF" or len(head) < 52 or head[5] != 1:
                return None
            kinds = _segment_kinds(head, file.read(4096 - 64))
    except OSError:
        return None
    machine = int.from_bytes(head[18:20], "little")
    if machine not in (_I386, _X86_64):
        return f"{program} is not an x86 program; {_REMEDY}"
    if mode & (stat.S_ISUID | stat.S_ISGID):
        return (
            f"{program} is set-user-ID or set-group-ID, so the system loads no library into it;"
            f" {_REMEDY}; run a copy without that bit"
        )
    # The dynamic loader, run as a program, loads libraries without being asked for itself.
    if _PT_INTERP not in kinds and not os.path.basename(path).startswith("ld"):
        return (
            f"{program} is linked statically, so no library can be loaded into it; {_REMEDY};"
            " link it without -static, or compile its source with the headers of"
            " vbus cflags --shim linux-io or mmio"
        )
    if machine == _I386 and not has_32_bits:
        return (
            f"{program} has 32 bits and the library could be built for 64 bits only; {_REMEDY};"
            " install gcc-multilib, remove ~/.cache/vbus and run it again"
        )
    return None


def _segment_kinds(head: bytes, rest: bytes) -> set[int]:
    """Return the types of the program headers, as far as they stand in the first 4096 bytes."""
    if head[4] == 2:
        (start,) = struct.unpack_from("<Q", head, 32)
        size, count = struct.unpack_from("<HH", head, 54)
    else:
        (start,) = struct.unpack_from("<I", head, 28)
        size, count = struct.unpack_from("<HH", head, 42)
    data = head + rest
    places = (start + turn * size for turn in range(count))
    return {struct.unpack_from("<I", data, at)[0] for at in places if at + 4 <= len(data)}
