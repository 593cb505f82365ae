"""``vbus exec --cpu``: a firmware image in an emulator of its processor, as a host of a board."""

import sys
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Final

import msgspec

from vbus.board.config import read_board_file
from vbus.boardfile.sections import CpuSection
from vbus.cli.cpu.processors import PROCESSORS, foreign, with_defaults
from vbus.cli.cpu.settings import CpuSettings
from vbus.cli.hosted.program import run_on_board
from vbus.cli.run.exec_avr import built, host_of_firmware, parse
from vbus.core.errors import ConfigError, VbusError
from vbus.core.values.settings import among, listed
from vbus.native import include_dir
from vbus.serve.serving import recorded

KEYS: Final = {"cycles": "cycles", "until": "until"}
FLAGS: Final = {"stats": "stats"}


def settings_of(spec: str) -> CpuSettings:
    """Return what ``cortex-m3,until=done,stats`` asks for.

    Raises:
        ValueError: the processor or a key is unknown, or has or lacks a value.
    """
    name, _, rest = spec.partition(",")
    if name not in PROCESSORS:
        raise ValueError(f'unknown processor "{name}"; {among(name, PROCESSORS, "there are")}')
    told = parse(rest, KEYS, FLAGS)
    values = dict(pairwise(told))
    cycles = values.get("cycles", "0")
    if not cycles.isdecimal():
        raise ValueError(f'cycles={cycles}: write a number of clock cycles, such as "cycles=1000"')
    return CpuSettings(name, CpuSection(), int(cycles), values.get("until", ""), "stats" in told)


def run_cpu(
    spec: str,
    image: str,
    board: str,
    pinmap: str | None = None,
    transcript: str | None = None,
    summary: bool = True,
    record: Mapping[str, object] | None = None,
    metrics: str = "",
    runner: Callable[..., int] = run_on_board,
) -> int:
    """Run an image on a board of its own; return its exit code.

    Args:
        spec: processor and keys; see :func:`settings_of`.
        image: the firmware.
        board: board file; it is served as long as the firmware runs.
        pinmap: which pin map of the board file; else its only one.
        transcript: file that takes the bus cycles.
        summary: whether the rules that were broken are listed.
        record: replaces keys of the file's ``[record]``.
        metrics: replaces ``listen`` of its ``[metrics]``.
        runner: takes the arguments of ``run_on_board``, and runs the program.

    Raises:
        ValueError: the specification is wrong.
        ConfigError: the board file is wrong, not slaved, or says nothing of the processor.
        ProgramError: the image is none, or for another processor.
        VbusError: there is no emulator.
    """
    settings = settings_of(spec)
    kind = PROCESSORS[settings.processor]
    file, source = read_board_file(board)
    file = recorded(file, record or {}, metrics)
    host = host_of_firmware(file, pinmap, f"the {settings.processor}")
    if not file.cpu.clock:
        raise ConfigError(
            f"{file.path}: how fast is the {settings.processor}? Write a [cpu] section with"
            ' clock = "72 MHz"'
        )
    kind.read(image)
    if keys := foreign(kind, file.cpu):
        raise ConfigError(
            f"{file.path}: {listed(keys)} of [cpu] means nothing to the {settings.processor}; leave"
            " it out"
        )
    settings.cpu = with_defaults(kind, file.cpu)
    if find_spec("unicorn") is None:
        raise VbusError(
            "the emulator is not installed; pip install 'vbus[cpu]' gets unicorn, which is under"
            " the GPL, version 2"
        )
    options = ["-std=c99", "-shared", "-fPIC"]
    library = built(
        "libvbus-cpu.so", Path(include_dir()) / "cpu_link.c", options, "see its message"
    )
    told = msgspec.json.encode(settings).decode()
    command = [sys.executable, "-m", "vbus.cli.cpu", str(library)]
    return runner(
        file, source, host, lambda link: [*command, link, told, image], transcript, summary
    )
