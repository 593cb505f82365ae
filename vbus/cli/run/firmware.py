"""Firmware as the program of ``vbus exec``: of an AVR in simavr, or an image in an emulator."""

import os
import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Final

import msgspec

from vbus.boardfile.sections import BoardFile, CpuSection, HostSection
from vbus.boardfile.source import absent
from vbus.cli.hosted.compiler import built
from vbus.core.errors import ConfigError, ProgramError, VbusError
from vbus.core.file_kinds import HEAD, is_none, unreadable
from vbus.core.values.settings import among, listed
from vbus.cpu.processors import PROCESSORS, CpuSettings, foreign, with_defaults
from vbus.native import include_dir

AVR_KEYS: Final = {
    "mmcu": "--mmcu", "f": "--frequency", "cycles": "--cycles", "until": "--until",
    "pin": "--until-pin", "uart": "--uart", "pty": "--pty", "gdb": "--gdb",
}  # fmt: skip
"""Keys of the specification, and the options of vbus-avr they become."""
AVR_FLAGS: Final = {"pace": "--pace", "stats": "--stats"}
_CPU_KEYS: Final = {"cycles": "cycles", "until": "until"}
_CPU_FLAGS: Final = {"stats": "stats"}

_AVR: Final = b"\x53\x00"
"""The machine of an ELF file, at byte 18."""
PACKAGES: Final = "libsimavr-dev libelf-dev"


def parse(
    spec: str, keys: Mapping[str, str] = AVR_KEYS, flags: Mapping[str, str] = AVR_FLAGS
) -> list[str]:
    r"""Return the options of vbus-avr that ``mmcu=atmega328p,f=16000000,until=done`` asks for.

    A comma inside a value is written as ``\,``.

    Args:
        spec: the specification.
        keys: its keys that have a value, and the options they become.
        flags: its keys that have none.

    Raises:
        ValueError: a key is unknown, or has or lacks a value.
    """
    options = []
    # A NUL stands for a comma of a value: no command line can hold one.
    for part in filter(None, spec.replace("\\,", "\0").split(",")):
        key, equals, value = part.replace("\0", ",").partition("=")
        if key in flags and not equals:
            options.append(flags[key])
        elif key in keys and value:
            options += [keys[key], value]
        elif key in keys:
            raise ValueError(f'"{key}" needs a value: {key}=...')
        elif key in flags:
            raise ValueError(f'"{key}" has no value')
        else:
            known = among(key, [*keys, *flags], "allowed are")
            raise ValueError(f'unknown key "{key}"; {known}')
    return options


def simulator() -> str:
    """Return the path of vbus-avr: ``$VBUS_AVR``, on the PATH, or built from the source tree.

    Raises:
        VbusError: there is none and none can be built.
    """
    found = os.environ.get("VBUS_AVR") or shutil.which("vbus-avr")
    if found:
        return found
    source = Path(include_dir()).parents[1] / "contrib" / "simavr" / "vbus-avr.c"
    if not source.exists():
        raise VbusError(
            "vbus-avr is not installed. It is a program of its own, in contrib/simavr of the source"
            f" tree: install {PACKAGES}, run make there, and put vbus-avr on the PATH or in"
            " $VBUS_AVR"
        )
    hint = f"install {PACKAGES}"
    return str(built("vbus-avr", source, ["-std=gnu99", "-lsimavr", "-lelf"], hint))


def avr_command(options: Sequence[str], elf: str) -> Callable[[str], list[str]]:
    """Return what gives the words that run AVR firmware at a link.

    Args:
        options: of the simulator; see :func:`parse`.
        elf: the firmware.

    Raises:
        ProgramError: the firmware is none.
        VbusError: there is no simulator.
    """
    _check_firmware(elf)
    program = simulator()
    return lambda link: [program, "--link", link, *options, elf]


def settings_of(spec: str) -> CpuSettings:
    """Return what ``cortex-m3,until=done,stats`` asks for.

    Raises:
        ValueError: the processor or a key is unknown, or has or lacks a value.
    """
    name, _, rest = spec.partition(",")
    if name not in PROCESSORS:
        raise ValueError(f'unknown processor "{name}"; {among(name, PROCESSORS, "there are")}')
    options = parse(rest, _CPU_KEYS, _CPU_FLAGS)
    values = dict(pairwise(options))
    cycles = values.get("cycles", "0")
    # int() would take signs, blanks and underscores.
    if not cycles.isdecimal():
        raise ValueError(f'cycles={cycles}: write a number of clock cycles, such as "cycles=1000"')
    return CpuSettings(name, CpuSection(), int(cycles), values.get("until", ""), "stats" in options)


def cpu_command(settings: CpuSettings, image: str, file: BoardFile) -> Callable[[str], list[str]]:
    """Return what gives the words that run a firmware image at a link.

    Args:
        settings: the processor, and when the run ends.
        image: the firmware.
        file: the board file; its ``[cpu]`` says what the image runs on.

    Raises:
        ConfigError: the board file says nothing of the processor, or what it does not have.
        ProgramError: the image is none, or for another processor.
        VbusError: there is no emulator.
    """
    kind, name = PROCESSORS[settings.processor], settings.processor
    if not file.cpu.clock:
        raise ConfigError(
            f'{file.path}: how fast is the {name}? Write a [cpu] section with clock = "72 MHz"'
        )
    kind.read(image)
    if keys := foreign(kind, file.cpu):
        raise ConfigError(
            f"{file.path}: {listed(keys)} of [cpu] means nothing to the {name}; leave it out"
        )
    settings.cpu = with_defaults(kind, file.cpu)
    # A process of its own loads the emulator, which is under another licence.
    if find_spec("unicorn") is None:
        raise VbusError(
            "the emulator is not installed; pip install 'vbus[cpu]' gets unicorn, which is under"
            " the GPL, version 2"
        )
    options = ["-std=c99", "-shared", "-fPIC"]
    library = built(
        "libvbus-cpu.so", Path(include_dir()) / "cpu_link.c", options, "see its message"
    )
    words = [sys.executable, "-m", "vbus.cpu", str(library)]
    given = msgspec.json.encode(settings).decode()
    return lambda link: [*words, link, given, image]


def _check_firmware(elf: str) -> None:
    """Refuse what is no firmware of an AVR."""
    path = Path(elf)
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError as error:
        missing = isinstance(error, FileNotFoundError)
        raise ProgramError(f"{elf}: {unreadable(path, error)}", missing) from None
    if not head.startswith(b"\x7fELF"):
        made = "avr-gcc links one (a .hex file lacks what the simulator needs)"
        raise ProgramError(is_none(elf, head, "AVR firmware (ELF)", made), False)
    if head[18:20] != _AVR:
        raise ProgramError(f"{elf}: an ELF file of another machine; link it by avr-gcc", False)


def check_slaved(file: BoardFile, what: str) -> None:
    """Refuse a board whose time does not follow the clock of firmware.

    Args:
        file: the board.
        what: that firmware runs on.

    Raises:
        ConfigError: two masters of time would drift apart.
    """
    if file.board.time != "slaved":
        raise ConfigError(
            f"{file.path}: chip time must follow the {what}, and this board is {file.board.time};"
            ' write time = "slaved" in [board]'
        )


def host_of_firmware(file: BoardFile, name: str | None, what: str) -> HostSection:
    """Return the host that firmware is: the file's own with the pin map, or one made up.

    Args:
        file: the board file.
        name: the pin map; None: its only one.
        what: the processor, for messages.

    Raises:
        ConfigError: the board is not slaved, or has no such pin map.
    """
    check_slaved(file, what)
    names = [section.name for section in file.pinmaps]
    if not names:
        raise ConfigError(
            f'{file.path}: no pin of the {what} is wired; write PB0 = "/RD" and so on in'
            " [pinmaps.NAME.pins], or an empty [pinmaps.NAME] if a card has all, and pinmap ="
            ' "NAME" in [[hosts]]'
        )
    if name is None and len(names) > 1:
        raise ConfigError(f"{file.path}: choose one of its pin maps: {listed(names)}")
    if name is not None and name not in names:
        raise ConfigError(f"{file.path}: {absent('pinmaps', name, names)}")
    chosen = name or names[0]
    # A host of the file has chips and a cycle time for its pin map already.
    for host in file.hosts:
        if host.pinmap == chosen:
            return host
    return HostSection(transport="", pinmap=chosen)
