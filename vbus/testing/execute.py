"""Host programs of a test: compiled if need be, and run on the test's board."""

import hashlib
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from vbus.core.errors import VbusError
from vbus.core.kernel import SECOND
from vbus.testing.bench import Bench
from vbus.testing.limits import UNBOUNDED, Limits
from vbus.testing.programs import ProgramOutcome, run_program
from vbus.testing.tested_board import TestedBoard

if TYPE_CHECKING:
    from vbus.cpu.processors import CpuSettings

_SOURCES: Final = (".c", ".cpp", ".cc", ".cxx")


class Execute:
    """Runs host programs on the board of a test.

    Args:
        bench: the test's boards.
    """

    def __init__(self, bench: Bench) -> None:
        self._bench: Final = bench

    def __call__(
        self,
        program: str | Path,
        *arguments: str | Path,
        sources: Sequence[str | Path] = (),
        shim: str = "",
        flags: str = "",
        avr: str = "",
        cpu: str = "",
        timeout: float = 60.0,
        longest: int | None = None,
        environment: Mapping[str, str] | None = None,
    ) -> ProgramOutcome:
        """Run a program on the test's board and wait for its end.

        Paths are looked for beside the test first. ``{link}`` in an argument, and ``$VBUS_LINK``,
        is the address of the board.

        Args:
            program: a C or C++ file (compiled first), a Python file, firmware (with ``avr`` or
                ``cpu``) or any other program.
            arguments: what it is given.
            sources: further files to compile.
            shim: headers for sources of other machines; see ``vbus cflags``.
            flags: further options of the compiler.
            avr: what ``vbus exec --avr`` takes, such as ``"mmcu=atmega328p,f=16000000"``.
            cpu: what ``vbus exec --cpu`` takes, such as ``"cortex-m3"``.
            timeout: seconds of wall time after which it is ended.
            longest: chip time (ps) after which it counts as hanging; None: a minute.
            environment: variables to add.

        Raises:
            VbusError: it cannot be compiled or started.
            HostStuck: it has passed the budget of the test.
        """
        __tracebackhide__ = True
        tested = self._bench.main()
        if tested.served is not None:
            raise VbusError(
                f"vbus_exec: the board is served on {tested.address} already, by vbus_pty; give"
                " the program that path with subprocess, or leave vbus_pty out of this test"
            )
        path = self._bench.find(program)
        if path.suffix in _SOURCES:
            command = [str(self.compile(program, *sources, shim=shim, flags=flags))]
        elif avr:
            command = [*_avr_command(tested, avr), str(self._bench.find_file(program))]
        elif cpu:
            from vbus.cli.run.firmware import cpu_command

            settings = _cpu_settings(tested, cpu)
            image = str(self._bench.find_file(program))
            command = cpu_command(settings, image, tested.file)("{link}")
        elif path.suffix == ".py":
            command = ["python", str(self._bench.find_file(program))]
        else:
            command = [str(path)]
        most = 60 * SECOND if longest is None else longest
        limits = Limits(UNBOUNDED, most, wall=timeout)
        tested.watch.check()
        outcome = run_program(
            tested.file,
            tested.source,
            [*command, *map(str, arguments)],
            limits,
            environment,
            board=tested.board,
            watch=tested.watch,
        )
        tested.missed += outcome.missed
        if tested.watch.ended:  # what it has said until then belongs to the report
            sys.stdout.write(outcome.output)
            sys.stderr.write(outcome.errors)
        tested.watch.check()
        return outcome

    def compile(self, *sources: str | Path, shim: str = "", flags: str = "") -> Path:
        """Compile C or C++ sources against the C client; return the program.

        Raises:
            VbusError: a source is not there; there is no compiler, or it complains, with its
                words in the message.
        """
        from vbus.cli.run.cflags import MICROCONTROLLERS

        files = [self._bench.find_file(source) for source in sources]
        plus = shim in MICROCONTROLLERS or any(file.suffix != ".c" for file in files)
        compiler = os.environ.get("CXX" if plus else "CC") or ("g++" if plus else "cc")
        if shutil.which(shlex.split(compiler)[0]) is None:
            raise VbusError(f"{compiler}: there is no such compiler; install gcc, or set CC or CXX")
        words = shlex.split(flags)
        # The linker takes from a library what the files before it ask for.
        libraries = [word for word in words if word.startswith("-l")]
        others = [word for word in words if not word.startswith("-l")]
        options = [*others, *cflags(shim), *map(str, files), *libraries]

        def run(*words: str) -> str:
            command = [*shlex.split(compiler), *words, *options]
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode:
                names = ", ".join(map(str, sources))
                raise VbusError(f"{names}: the compiler refuses it:\n{done.stderr.strip()}")
            return done.stdout

        # All that decides the program: a matrix and a specimen run the same one in a sixth of
        # the time of a compilation.
        asked = " ".join([compiler, *options, run("-E")])
        digest = hashlib.sha256(asked.encode()).hexdigest()[:16]
        output = self._bench.folder() / f"{files[0].stem}-{digest}"
        if not output.exists():
            made = output.with_name(f"{output.name}.{os.getpid()}")
            run("-o", str(made))
            made.replace(output)  # at once: other workers of the run may be about to start it
        return output


def cflags(shim: str = "") -> list[str]:
    """Return what ``vbus cflags`` prints.

    Raises:
        VbusError: there is no such shim.
    """
    from vbus.cli.run.cflags import PLAIN, SHIMS

    if shim and shim not in SHIMS:
        raise VbusError(f"there is no shim {shim!r}; there are {', '.join(SHIMS)}")
    return (SHIMS[shim] if shim else PLAIN).flags()


def _needs_slaved(tested: TestedBoard, processor: str) -> None:
    if tested.board.policy != "slaved":
        raise VbusError(
            f"{tested.file.path}: chip time must follow the {processor}, and this board is"
            f' {tested.board.policy}; write time = "slaved" in [board]'
        )


def _avr_command(tested: TestedBoard, avr: str) -> list[str]:
    from vbus.cli.run.firmware import parse, simulator

    _needs_slaved(tested, "AVR")
    try:
        options = parse(avr)
    except ValueError as error:
        raise VbusError(f"avr={avr!r}: {error}") from None
    return [simulator(), "--link", "{link}", *options]


def _cpu_settings(tested: TestedBoard, cpu: str) -> "CpuSettings":
    from vbus.cli.run.firmware import settings_of

    try:
        settings = settings_of(cpu)
    except ValueError as error:
        raise VbusError(f"cpu={cpu!r}: {error}") from None
    _needs_slaved(tested, settings.processor)
    return settings
