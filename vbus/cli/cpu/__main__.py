"""The program that ``vbus exec --cpu`` starts: LIBRARY LINK SETTINGS IMAGE."""

import ctypes
import sys

import msgspec

from vbus.cli import exit_codes
from vbus.cli.cpu.machine import Stopped
from vbus.cli.cpu.processors import PROCESSORS, CpuSettings, machine_of
from vbus.core.errors import ProgramError


def main() -> int:
    """Run an image on a board; return its exit code."""
    library, link, told, path = sys.argv[1:]
    settings = msgspec.json.decode(told, type=CpuSettings)
    image = PROCESSORS[settings.processor].read(path)
    native = ctypes.CDLL(library)
    native.cpu_sentence.restype = ctypes.c_char_p
    error = native.cpu_open(link.encode())
    if error < 0:
        print(f"vbus cpu: {link}: {native.cpu_sentence(error).decode()}", file=sys.stderr)
        return exit_codes.NO_LINK
    try:
        machine = machine_of(settings, image, native)
        code = machine.run()
    except Stopped as end:
        print(f"vbus cpu: {end}", file=sys.stderr)
        return end.code
    if settings.stats:
        print(machine.statistics(), file=sys.stderr)
    return code


if __name__ == "__main__":
    try:
        sys.exit(main())
    except ProgramError as error:
        print(f"vbus cpu: {error}", file=sys.stderr)
        sys.exit(exit_codes.NOT_RUNNABLE)
