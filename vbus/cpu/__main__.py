"""The program that ``vbus exec --cpu`` starts: LIBRARY LINK SETTINGS IMAGE."""

import ctypes
import sys
from importlib import import_module

import msgspec

from vbus.core import exit_codes
from vbus.core.errors import ProgramError
from vbus.cpu.image import Image
from vbus.cpu.machine import CpuMachine, Stopped
from vbus.cpu.processors import PROCESSORS, CpuSettings


def main() -> int:
    """Run an image on a board; return its exit code."""
    library, link, given, path = sys.argv[1:]
    settings = msgspec.json.decode(given, type=CpuSettings)
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


def machine_of(settings: CpuSettings, image: Image, native: ctypes.CDLL) -> CpuMachine:
    """Return a machine with its processor, memory, peripherals and image."""
    import unicorn

    kind = PROCESSORS[settings.processor]
    names = import_module(f"unicorn.{kind.arch.lower()}_const")
    mode = sum(getattr(unicorn, f"UC_MODE_{name}") for name in kind.modes)
    model = getattr(names, f"UC_{kind.model}") if kind.model else None
    arch = getattr(unicorn, f"UC_ARCH_{kind.arch}")
    machine = CpuMachine(native, settings.cpu, arch, mode, model, settings.cycles, settings.until)
    machine.image = image
    import_module(f"vbus.cpu.{kind.built}").build(machine)
    return machine


if __name__ == "__main__":
    try:
        sys.exit(main())
    except ProgramError as error:
        print(f"vbus cpu: {error}", file=sys.stderr)
        sys.exit(exit_codes.NOT_RUNNABLE)
