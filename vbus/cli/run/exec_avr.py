"""``vbus exec --avr``: AVR firmware in simavr, its port bits wired to the chips of a board."""

import asyncio
import hashlib
import os
import shutil
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from vbus.board.config import read_board_file
from vbus.boardfile.sections import BoardFile, HostSection
from vbus.boardfile.source import absent
from vbus.cli.hosted.program import run_on_board, run_program
from vbus.core.errors import ConfigError, ProgramError, VbusError
from vbus.core.file_kinds import HEAD, is_none, unreadable
from vbus.core.values.settings import among, listed
from vbus.native import include_dir
from vbus.serve.serving import recorded

KEYS: Final = {
    "mmcu": "--mmcu",
    "f": "--frequency",
    "cycles": "--cycles",
    "until": "--until",
    "pin": "--until-pin",
    "uart": "--uart",
    "pty": "--pty",
    "gdb": "--gdb",
}
"""Keys of the specification, and the options of vbus-avr they become."""

FLAGS: Final = {"pace": "--pace", "stats": "--stats"}

_AVR: Final = b"\x53\x00"
"""The machine of an ELF file, at byte 18."""
PACKAGES: Final = "libsimavr-dev libelf-dev"
_SOURCES: Final = ("pin_link.c", "pin_decoder.c", "card_table.c", "link_text.c", "vbus.c")
_HEADERS: Final = ("pin_link.h", "pin_decoder.h", "card_table.h", "link_text.h", "vbus.h")


def parse(spec: str, keys: Mapping[str, str] = KEYS, flags: Mapping[str, str] = FLAGS) -> list[str]:
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
    files = [source, *(native / part for part in (*_SOURCES, *_HEADERS))]
    digest = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:16]
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    program = base / "vbus" / f"{name}-{digest}"
    if program.exists():
        return program
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        raise VbusError(f"{name} must be built first, and there is no C compiler; install gcc")
    program.parent.mkdir(parents=True, exist_ok=True)
    made = program.with_suffix(f".{os.getpid()}")
    done = subprocess.run(
        [compiler, "-O2", f"-I{native}", "-o", str(made), str(source),
         *(str(native / part) for part in _SOURCES), *options],
        capture_output=True,
        text=True,
    )  # fmt: skip
    if done.returncode:
        first = next(iter(done.stderr.strip().splitlines()), "")
        raise VbusError(f"{name} cannot be built; {hint} ({first})")
    made.replace(program)  # in one step: another process may build it too
    return program


def run_avr(
    spec: str,
    elf: str,
    board: str | None = None,
    link: str | None = None,
    pinmap: str | None = None,
    transcript: str | None = None,
    summary: bool = True,
    record: Mapping[str, object] | None = None,
    metrics: str = "",
    runner: Callable[..., int] = run_on_board,
) -> int:
    """Run firmware on a board of its own, or on one that runs already; return its exit code.

    Args:
        spec: settings of the simulator; see :func:`parse`.
        elf: the firmware.
        board: board file; it is served as long as the firmware runs.
        link: in place of ``board``: address of a link that has a pin map.
        pinmap: which pin map of the board file; else its only one.
        transcript: file that takes the bus cycles (with ``board`` only).
        summary: whether the rules that were broken are listed (with ``board`` only).
        record: replaces keys of the file's ``[record]`` (with ``board`` only).
        metrics: replaces ``listen`` of its ``[metrics]`` (with ``board`` only).
        runner: takes the arguments of ``run_on_board``, and runs the program.

    Raises:
        ValueError: the specification is wrong, or neither or both of board and link are given.
        ConfigError: the board file is wrong, not slaved, or has no such pin map.
        VbusError: there is no simulator, or a link cannot be opened.
    """
    options = parse(spec)
    if (board is None) == (link is None):
        raise ValueError("name either a board file or a link")
    if link is not None:
        _check_firmware(elf)
        command = [simulator(), "--link", link, *options, elf]
        return asyncio.run(run_program(command, {}, Path()))
    assert board is not None
    file, source = read_board_file(board)
    file = recorded(file, record or {}, metrics)
    host = host_of_firmware(file, pinmap, "the AVR")
    _check_firmware(elf)
    program = simulator()
    return runner(
        file,
        source,
        host,
        lambda address: [program, "--link", address, *options, elf],
        transcript,
        summary,
    )


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


def host_of_firmware(file: BoardFile, name: str | None, what: str) -> HostSection:
    """Return the host that firmware is: the file's own with the pin map, or one made up.

    Args:
        file: the board file.
        name: the pin map; None: its only one.
        what: the processor, for messages.

    Raises:
        ConfigError: the board is not slaved, or has no such pin map.
    """
    if file.board.time != "slaved":
        raise ConfigError(
            f"{file.path}: chip time must follow {what}, and this board is {file.board.time};"
            ' write time = "slaved" in [board]'
        )
    names = [section.name for section in file.pinmaps]
    if not names:
        raise ConfigError(f"{file.path}: there is no [pinmaps.NAME]: what is wired to {what}?")
    if name is None and len(names) > 1:
        raise ConfigError(f"{file.path}: choose one of its pin maps: {listed(names)}")
    if name is not None and name not in names:
        raise ConfigError(f"{file.path}: {absent('pinmaps', name, names)}")
    chosen = name or names[0]
    for host in file.hosts:
        if host.pinmap == chosen:
            return host
    return HostSection(transport="", pinmap=chosen)
