"""``vbus doctor``: what is missing or broken on this machine, and what to do about it."""

import os
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import click

from vbus.cli.output import positive, show
from vbus.cli.run.doctor_realtime import FAIL, OK, WARN, Diagnosis, found
from vbus.core import exit_codes
from vbus.core.errors import PluginError, TransportError
from vbus.core.instants import SECOND

OLDEST_PYTHON: Final = (3, 11)
# An hour shows what a night job does to a machine; a slip of the unit is refused.
LONGEST_LATENCY: Final = 3600
ENOUGH_INSTANCES: Final = 128
"""The kernel's own default."""


def _latency(ctx: click.Context, param: click.Parameter, value: str | None) -> float:
    """Return a duration in seconds; 0 if none is given."""
    length = positive(ctx, param, value)
    if length is None:
        return 0.0
    if length > LONGEST_LATENCY * SECOND:
        raise click.BadParameter(f'"{value}": up to {LONGEST_LATENCY} s are measured')
    return float(length / SECOND)


@click.command("doctor")
@click.option(
    "--latency", callback=_latency, metavar="DURATION",
    help='Measure how late this machine wakes a server, for this time, such as "10s".',
)  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(as_json: bool, latency: float) -> int:
    """Look for what is missing or broken on this machine, and say what to do.

    The exit code is 1 if something will not work at all.
    """
    from vbus.cli.run import doctor_realtime

    findings = [finding for check in CHECKS for finding in check()]
    if sys.platform == "linux":
        findings += doctor_realtime.promises()
        findings += doctor_realtime.latency(latency) if latency else ()
    show(as_json, [asdict(finding) for finding in findings], map(str, findings))
    failed = any(finding.state == FAIL for finding in findings)
    return exit_codes.FAILURE if failed else exit_codes.OK


def python() -> Iterator[Diagnosis]:
    """Look at the interpreter and the system."""
    version, oldest = platform.python_version(), ".".join(map(str, OLDEST_PYTHON))
    yield found(
        sys.version_info >= OLDEST_PYTHON, "python", f"{version} ({sys.executable})", version,
        f"install Python {oldest} or later", FAIL,
    )  # fmt: skip
    yield found(
        sys.platform == "linux", "system", platform.platform(), sys.platform,
        "PTYs and timers are Linux's; use Linux", FAIL,
    )  # fmt: skip


def dependencies() -> Iterator[Diagnosis]:
    """Look for the packages vbus needs, at the versions it was tested with."""
    from importlib.metadata import PackageNotFoundError, requires, version

    try:
        needs = [text.partition(";") for text in requires("vbus") or []]
    except PackageNotFoundError:
        yield Diagnosis(FAIL, "vbus", "not installed", 'run "pip install -e ." in the source tree')
        return
    yield Diagnosis(OK, "vbus", version("vbus"))
    for text in [need.strip() for need, _, marker in needs if "extra" not in marker]:
        name, _, oldest = text.partition(">=")
        try:
            here = version(name)
        except PackageNotFoundError:
            yield Diagnosis(FAIL, name, "not installed", f"run \"pip install '{text}'\"")
            continue
        recent = _numbers(here) >= _numbers(oldest)
        yield found(recent, name, here, here, f"too old: run \"pip install -U '{text}'\"", FAIL)


def core() -> Iterator[Diagnosis]:
    """Say which core runs and, if it is the slower one, why."""
    from vbus.compiled import core, lacks_compiler, why

    text = f"{core()}: {why()}" if why() else core()
    yield found(
        not lacks_compiler(), "core", text, text,
        "it is 50 to 170 times slower in samples and some ten times on the bus: install gcc and"
        " python3-dev, then install vbus again",
    )  # fmt: skip


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int("0" + re.sub(r"\D", "", part)) for part in version.split("."))


def plugins() -> Iterator[Diagnosis]:
    """Load every chip, plant, protocol and transport that is registered."""
    from vbus import plugins as registry

    for group in (registry.CHIPS, registry.PLANTS, registry.PROTOCOLS, registry.TRANSPORTS):
        try:
            names = registry.names(group)
        except PluginError as error:
            yield Diagnosis(FAIL, group, "none", str(error))
            continue
        working = []
        for name in names:
            try:
                registry.load(group, name)
            except PluginError as error:
                yield Diagnosis(WARN, group, f"{name} is broken", str(error))
            else:
                working.append(name)
        yield Diagnosis(OK, group, ", ".join(working) or "none")


def compiler() -> Iterator[Diagnosis]:
    """Look for a C compiler and the C client it would build."""
    from vbus.native import include_dir

    path = shutil.which("gcc") or shutil.which("cc") or ""
    advice = "hosts in C need one: install gcc (package gcc, libc6-dev)"
    yield found(path, "C compiler", path, "none", advice)
    folder = Path(include_dir())
    there = any(folder.glob("*.h"))
    yield found(there, "C client", str(folder), f"missing from {folder}", "install vbus again")


def terminal() -> Iterator[Diagnosis]:
    """Open a pseudo terminal and pass a byte through it that a cooked one would eat."""
    import tty

    try:
        master, slave = os.openpty()
    except OSError as error:
        advice = "mount devpts on /dev/pts, or use unix: and tcp: links"
        yield Diagnosis(WARN, "PTY", str(error), advice)
        return
    try:
        tty.setraw(slave)
        os.write(master, b"\x03\x11\r")
        passed = os.read(slave, 3) == b"\x03\x11\r"
        name = os.ttyname(slave)
    finally:
        os.close(master)
        os.close(slave)
    # Byte 3, 11h and 0Dh are what a cooked terminal takes for Ctrl-C, XON and a line's end.
    good, wrong = f"{name} passes every byte", f"{name} changes bytes"
    yield found(passed, "PTY", good, wrong, "use unix: and tcp: links")


def runtime() -> Iterator[Diagnosis]:
    """Write to the runtime directory; look for what dead servers left in it."""
    from vbus.core.runtime import runtime_directory
    from vbus.serve.registry import boards_directory

    try:
        directory = runtime_directory()
        # Permission bits alone do not tell: the file system may be read-only or full.
        probe = directory / ".doctor"
        probe.write_bytes(b"")
        probe.unlink()
    except (TransportError, OSError) as error:
        advice = "set VBUS_RUNTIME to a directory of your own"
        yield Diagnosis(FAIL, "runtime directory", str(error), advice)
        return
    yield Diagnosis(OK, "runtime directory", str(directory))
    stale = [path for folder in (directory, boards_directory()) for path in _stale(folder)]
    listed = " ".join(str(path) for path in stale)
    yield found(
        not stale, "left-overs", "none", f"{len(stale)} of servers that were killed",
        f"the next start takes these names over; to tidy up now: rm {listed}",
    )  # fmt: skip


def _stale(folder: Path) -> list[Path]:
    """Return the locks in ``folder`` that no living process holds, and the names they guard."""
    from vbus.core.runtime import lock_of, lock_state, locked_names

    left = []
    for name in locked_names(folder):
        with suppress(OSError):
            alive, _ = lock_state(name)
            # A living server's lock is held by the system; a dead one's file is all that is left.
            if not alive:
                there = name.is_symlink() or name.exists()
                left += [lock_of(name), name] if there else [lock_of(name)]
    return left


def timers() -> Iterator[Diagnosis]:
    """Make the timer and the file watch that the server needs of the kernel."""
    from vbus.transports.linux import Inotify, TimerFd

    try:
        TimerFd().close()
        with closing(Inotify()) as watch:
            watch.add("/dev/null")
    except OSError as error:
        advice = "raise fs.inotify.max_user_instances, or the limit of open files"
        yield Diagnosis(FAIL, "timerfd, inotify", str(error), advice)
    else:
        yield Diagnosis(OK, "timerfd, inotify", "both work")


def inotify() -> Iterator[Diagnosis]:
    """Say how many boards with PTYs the kernel's limit of file watches allows."""
    place = Path("/proc/sys/fs/inotify/max_user_instances")
    try:
        most = int(place.read_text())
    except (OSError, ValueError) as error:
        yield Diagnosis(WARN, "inotify instances", str(error), "nothing, if boards start")
        return
    text = f"{most}: as many boards with links over PTYs may run at a time"
    advice = f"sysctl fs.inotify.max_user_instances={ENOUGH_INSTANCES}, or use unix: links"
    yield found(most >= ENOUGH_INSTANCES, "inotify instances", text, text, advice)


def _module(name: str) -> Callable[[], str]:
    """Return what tells where a Python package is; nothing if it is not installed."""

    def place() -> str:
        module = find_spec(name)
        return module.origin or name if module is not None else ""

    return place


def _program(name: str) -> Callable[[], str]:
    """Return what tells where a program is; nothing if there is none."""
    return lambda: shutil.which(name) or ""


def _avr_simulator() -> str:
    given = os.environ.get("VBUS_AVR") or shutil.which("vbus-avr")
    if given:
        return given
    # The library has no program of its own: only a compiler finds it where it looks itself.
    return _compiled_by(["-lsimavr", "-lelf"], "#include <simavr/sim_avr.h>\n#include <libelf.h>\n")


def _multilib() -> str:
    return _compiled_by(["-m32"], "#include <stdio.h>\n")


def _compiled_by(options: list[str], headers: str) -> str:
    """Return the compiler if it makes a program with these options, or nothing."""
    compiler = shutil.which("gcc")
    if compiler is None:
        return ""
    source = f"{headers}int main(void) {{ return 0; }}\n"
    done = subprocess.run(
        [compiler, "-x", "c", "-o", os.devnull, "-", *options], input=source.encode(),
        capture_output=True,
    )  # fmt: skip
    return f"{compiler} {' '.join(options)}" if done.returncode == 0 else ""


OPTIONAL: Final[tuple[tuple[str, Callable[[], str], str, str], ...]] = (
    ("pyvcd", _module("vcd"), "waveforms, and captures in VCD", "pip install pyvcd"),
    ("prometheus-client", _module("prometheus_client"), "numbers for Prometheus",
     "pip install prometheus-client"),
    ("aiohttp", _module("aiohttp"), "the scope of running boards", "pip install aiohttp"),
    ("matplotlib", _module("matplotlib"), "pictures (vbus plot)", "pip install matplotlib"),
    ("foxglove-sdk", _module("foxglove"), "MCAP files, and live views in Foxglove",
     "pip install foxglove-sdk protobuf"),
    ("pytest", _module("pytest"), "fixtures for tests", "pip install pytest"),
    ("robotframework", _module("robot"), "keywords for Robot Framework",
     "pip install robotframework"),
    ("simavr", _avr_simulator, "AVR firmware as it is (vbus exec --avr)",
     "apt install libsimavr-dev libelf-dev"),
    ("avr-gcc", _program("avr-gcc"), "AVR firmware from its sources",
     "apt install gcc-avr avr-libc"),
    ("multilib", _multilib, "32-bit programs (vbus exec, vbus cflags)", "apt install gcc-multilib"),
    ("sigrok-cli", _program("sigrok-cli"), "captures (.sr) and decoders of the buses",
     "apt install sigrok-cli"),
    ("chromium", _program("chromium"), "tests of the scope's page", "apt install chromium"),
)  # fmt: skip
"""What vbus does without: name, where it is, what it gives, how to get it."""


def optional() -> Iterator[Diagnosis]:
    """Look for what vbus does without, and say what each gives."""
    for name, where, gives, get in OPTIONAL:
        place = where()
        yield found(place, name, f"{gives}: {place}", f"missing; it gives {gives}", get)


CHECKS: Final[tuple[Callable[[], Iterator[Diagnosis]], ...]] = (
    python, dependencies, core, plugins, compiler, terminal, runtime, timers,
    inotify, optional,
)  # fmt: skip
"""What is looked at, in order."""
