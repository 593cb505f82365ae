"""Host programs of a test: compiled if need be, and run on the test's board."""

import hashlib
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final

from vbus.boardfile.sections import BoardFile
from vbus.campaign.world import REFERENCE
from vbus.core.errors import VbusError, value_errors
from vbus.core.kernel import SECOND
from vbus.testing.bench import Bench
from vbus.testing.limits import UNBOUNDED, Limits
from vbus.testing.programs import ProgramOutcome, run_program

_SOURCES: Final = (".c", ".cpp", ".cc", ".cxx")

_MADE: Final[dict[str, tuple[Path, dict[str, tuple[int, int]]]]] = {}
"""By compiler and options: the program, and the state of each file that it was made of.

Worlds of a campaign look here: preprocessing alone is a third of a short run.
"""
_MARKER: Final = re.compile(r'^# \d+ "([^"<]+)"', re.MULTILINE)
"""What a preprocessor writes where a file begins."""


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
        elif avr or cpu:
            command = self._firmware(tested.file, program, avr, cpu)
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
        tested.slow = tested.slow or (outcome.stuck if outcome.slow else "")
        if tested.watch.ended:  # what it has said until then belongs to the report
            sys.stdout.write(outcome.output)
            sys.stderr.write(outcome.errors)
        tested.watch.check()
        return outcome

    def _firmware(self, file: BoardFile, program: str | Path, avr: str, cpu: str) -> list[str]:
        """Return the words that run firmware on the board of a file."""
        from vbus.cli.run.firmware import check_slaved, cpu_command, parse, settings_of, simulator

        with value_errors(VbusError, f"avr={avr!r}: " if avr else f"cpu={cpu!r}: "):
            options, settings = parse(avr), None if avr else settings_of(cpu)
        check_slaved(file, "AVR" if settings is None else settings.processor)
        if settings is None:
            return [simulator(), "--link", "{link}", *options, str(self._bench.find_file(program))]
        return cpu_command(settings, str(self._bench.find_file(program)), file)("{link}")

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

        asked = shlex.join([compiler, *options])
        made = _MADE.get(asked)
        if made and self._bench.variant.world != REFERENCE and made[0].exists():
            if made[1] == _states(made[1]):
                return made[0]

        def run(*words: str) -> str:
            command = [*shlex.split(compiler), *words, *options]
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode:
                names = ", ".join(map(str, sources))
                raise VbusError(f"{names}: the compiler refuses it:\n{done.stderr.strip()}")
            return done.stdout

        # All that decides the program: a matrix and a specimen run the same one in a sixth of
        # the time of a compilation.
        text = run("-E")
        whole = " ".join([compiler, *options, text])
        digest = hashlib.sha256(whole.encode()).hexdigest()[:16]
        output = self._bench.folder() / f"{files[0].stem}-{digest}"
        if not output.exists():
            mine = output.with_name(f"{output.name}.{os.getpid()}")
            run("-o", str(mine))
            mine.replace(output)  # at once: other workers of the run may be about to start it
        _MADE[asked] = output, _states([*map(str, files), *_MARKER.findall(text)])
        return output


def _states(paths: Iterable[str]) -> dict[str, tuple[int, int]]:
    """Return when each file was written (ns), and its size; (0, 0): it is not there."""
    found = {}
    for path in paths:
        try:
            state = os.stat(path)
            found[path] = state.st_mtime_ns, state.st_size
        except OSError:
            found[path] = 0, 0
    return found


def cflags(shim: str = "") -> list[str]:
    """Return what ``vbus cflags`` prints.

    Raises:
        VbusError: there is no such shim.
    """
    from vbus.cli.run.cflags import PLAIN, SHIMS

    if shim and shim not in SHIMS:
        raise VbusError(f"there is no shim {shim!r}; there are {', '.join(SHIMS)}")
    return (SHIMS[shim] if shim else PLAIN).flags()
