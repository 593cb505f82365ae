"""A host program on a board of its own, with bounds, and what came of it."""

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import monotonic

from vbus.board.board import Board
from vbus.board.build import build
from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import Source
from vbus.cli.hosted.at_rest import LOOK, AtRest
from vbus.cli.hosted.program import host_of, link_of_program, missed_bytes
from vbus.cli.proc import offspring, what_hangs
from vbus.core.errors import VbusError
from vbus.core.runtime import private_runtime
from vbus.core.signals import Violation
from vbus.serve.serving import links_of
from vbus.testing.limits import UNBOUNDED, HostWatch, Limits
from vbus.testing.serving import ServedBoard


@dataclass(slots=True)
class ProgramOutcome:
    """What a host did.

    Attributes:
        stuck: which bound it passed, as a sentence; "" if it came to an end by itself.
        details: what chips and threads were doing then, and what was commanded before.
        code: exit code of a program, 0 or 1 of a function; 128 + N for one that died of signal N.
        output: what it wrote to standard output, or what the function returned as text.
        errors: what it wrote to standard error, or the exception the function raised.
        cycles: bus cycles it made.
        now: instant at which it ended (ps).
        violations: what it broke.
        transcript: its last packets in the manual's words.
        missed: bytes that it read outside the strobes that gave them, as sentences.
    """

    stuck: str = ""
    code: int = 0
    output: str = ""
    errors: str = ""
    cycles: int = 0
    now: int = 0
    violations: list[Violation] = field(default_factory=list)
    transcript: list[str] = field(default_factory=list)
    details: list[str] = field(default_factory=list)
    missed: list[str] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """Whether it ended by itself, with exit code 0."""
        return not self.stuck and self.code == 0

    def take(self, watch: HostWatch) -> None:
        """Take over what was watched."""
        self.stuck = watch.stuck
        self.details = watch.details
        self.cycles = watch.cycles
        self.violations = watch.violations
        self.transcript = watch.lines


class _ProgramRun(ServedBoard):
    """The board's side of one run."""

    def __init__(
        self,
        file: BoardFile,
        board: Board,
        limits: Limits,
        folder: Path,
        start: int,
        of_test: HostWatch | None,
    ) -> None:
        board.run_for(start)
        self.link: str = f"unix:{folder / 'host.sock'}"
        self.watch = HostWatch(board, limits, self.kill)
        self._of_test = of_test
        self._wall = limits.wall
        if of_test is not None:
            of_test.over = self.kill
        host = host_of(file)
        left = min(watch.left for watch in (self.watch, of_test) if watch is not None)
        self.note: Path = folder / "fault"
        self.reached: list[str] = list(host.chips) or [chip.name for chip in board.chips]
        self.virtual: bool = host.pinmap == "" and file.board.time != "realtime"
        mine, variables = link_of_program(board, file, host, self.link, self.note, max(left, 1))
        self.environment: dict[str, str] = {**variables, "VBUS_RUNTIME": str(folder)}
        served = zip(file.hosts, links_of(file), strict=True)
        others = [spec for section, spec in served if section is not host or not section.card]
        super().__init__(board, [mine, *others], file.board.stall)
        self.process: subprocess.Popen[str] | None = None
        self.killed: bool = False

    def kill(self, sentence: str) -> None:
        """End the program, which has passed a bound."""
        self.killed = True
        if self.process is not None:
            threads = what_hangs(offspring([self.process.pid]))
            for watch in (self.watch, self._of_test):
                if watch is not None:
                    watch.add_threads(threads)
            self.process.kill()

    def over(self) -> Callable[[], bool]:
        """Return what tells that the program's last requests have passed a bound, too."""
        last = monotonic() + self._wall

        def over() -> bool:
            if monotonic() > last:
                self.watch.pass_bound(
                    f"what it sent last was not done after {self._wall:g} s of wall time: the"
                    " machine was too slow"
                )
            return self.watch.ended or (self._of_test is not None and self._of_test.ended)

        return over

    def ended(self, board_ends: ExitStack) -> None:
        """The program has ended: what time passes until the board is served no more is not its."""
        self.watch.close()
        if self._of_test is not None:
            self._of_test.over = None
            board_ends.enter_context(self._of_test.excused())


_runtime = threading.Lock()


def run_program(
    file: BoardFile,
    source: Source,
    command: Sequence[str],
    limits: Limits | None = None,
    environment: Mapping[str, str] | None = None,
    folder: Path | None = None,
    start: int = 0,
    board: Board | None = None,
    watch: HostWatch | None = None,
) -> ProgramOutcome:
    """Run a program on a board that lives as long as the program does.

    The program finds its link in ``$VBUS_LINK`` (``{link}`` in an argument stands for it), the
    links of the board file under ``$VBUS_RUNTIME``, a folder of this run alone. A board file with
    a card traps the program's port and memory accesses, as ``vbus exec`` does.

    Args:
        file: the board.
        source: the same as text.
        command: program and arguments; ``"python"`` is the interpreter that runs now.
        limits: its bounds.
        environment: variables that are added to those of this process.
        folder: where it runs; the present directory if None.
        start: instant at which it may make its first bus cycle (ps).
        board: the board of that file, if it is there already; it goes on from where it stands.
        watch: one that looks at that board, and ends the program as well.

    Raises:
        ConfigError: the board cannot be built.
        VbusError: the program cannot be started.
    """
    bounds = limits if limits is not None else Limits()
    if board is None:
        board = build(file, source)
    else:
        bounds = replace(bounds, chip_time=board.now + bounds.chip_time)
    with _runtime, private_runtime() as own, ExitStack() as board_ends:
        run = _ProgramRun(file, board, bounds, own, start, watch)
        with run:
            try:
                outcome = _communicate(run, command, bounds, environment or {}, folder)
                run.finish(run.over())
                outcome.missed = missed_bytes(run.note, run.reached, run.board)
            finally:
                run.call(lambda: run.ended(board_ends))
    if run.error is not None:
        raise run.error
    outcome.take(run.watch)
    outcome.now = run.board.now
    return outcome


def _communicate(
    run: _ProgramRun,
    command: Sequence[str],
    limits: Limits,
    environment: Mapping[str, str],
    folder: Path | None,
) -> ProgramOutcome:
    line = [part.replace("{link}", run.link) for part in command]
    if line[0] == "python":
        line[0] = sys.executable
    try:
        process = run.process = subprocess.Popen(
            line,
            cwd=folder,
            env={**os.environ, **run.environment, **environment},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
        )
    except OSError as error:
        raise VbusError(f"{line[0]}: cannot be run: {error.strerror}") from error
    if run.killed:
        process.kill()

    def late() -> None:
        run.call(
            lambda: run.watch.pass_wall(f"it was not done after {limits.wall:g} s of wall time")
        )

    rest = AtRest(lambda: offspring([process.pid]), run.watch, run.note, UNBOUNDED)
    done = threading.Event()

    def look_on() -> None:
        while not done.wait(LOOK):
            run.call(rest.look)

    # No time-out of subprocess: it would follow a clock that the test may have stopped.
    alarm = threading.Timer(min(limits.wall, threading.TIMEOUT_MAX), late)
    looker = threading.Thread(target=look_on)
    alarm.start()
    if run.virtual:
        looker.start()
    try:
        output, errors = process.communicate()
    finally:
        alarm.cancel()
        done.set()
        if run.virtual:
            looker.join()
    code = process.returncode
    return ProgramOutcome(code=code if code >= 0 else 128 - code, output=output, errors=errors)
