"""A host program on a board of its own, with bounds, and what came of it."""

import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace

from vbus.board.board import Board
from vbus.board.build import build
from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import Source
from vbus.cli.hosted.program import Ended, HostedProgram, host_of
from vbus.core.runtime import private_runtime
from vbus.core.signals import Violation
from vbus.serve.serving import links_of
from vbus.testing.limits import UNBOUNDED, HostWatch, Limits
from vbus.testing.serving import ServedBoard


@dataclass(slots=True)
class ProgramOutcome:
    """What a host program did.

    Attributes:
        stuck: which bound it passed, as a sentence; "" if it came to an end by itself.
        slow: whether that says nothing of it, because the machine was too slow.
        details: what chips and threads were doing then, and what was commanded before.
        code: its exit code; 128 + N if it died of signal N.
        output: what it wrote to standard output.
        errors: what it wrote to standard error.
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
    slow: bool = False

    @property
    def ok(self) -> bool:
        """Whether it ended by itself, with exit code 0."""
        return not self.stuck and self.code == 0


_runtime = threading.Lock()


def run_program(
    file: BoardFile,
    source: Source,
    command: Sequence[str],
    limits: Limits | None = None,
    environment: Mapping[str, str] | None = None,
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
    host = host_of(file)
    words = [sys.executable if command[0] == "python" else command[0], *command[1:]]
    program = HostedProgram(
        file, source, host, lambda link: [word.replace("{link}", link) for word in words]
    )
    with _runtime, private_runtime() as own, ExitStack() as board_ends:
        mine = HostWatch(board, bounds)
        watches = [mine] if watch is None else [mine, watch]
        left = max(min(one.left for one in watches), 1)
        run, link = program.beside(board, own, left, UNBOUNDED)
        run.watches, run.wall, run.taken = watches, bounds.wall, True
        run.environment = {**run.environment, **(environment or {})}
        served = zip(file.hosts, links_of(file), strict=True)
        others = [spec for section, spec in served if section is not host or not section.card]
        at_work = ServedBoard(board, [link, *others], file.board.stall)

        async def play() -> Ended:
            try:
                return await run.beside(at_work.server)
            finally:
                # What time passes until the board is served no more is not the program's.
                mine.close()
                if watch is not None:
                    board_ends.enter_context(watch.excused())

        with at_work:
            ended = at_work.run(play())
            missed = run.missed()
    if at_work.error is not None:
        raise at_work.error
    return ProgramOutcome(
        **ended._asdict(), missed=missed, stuck=mine.stuck, slow=mine.slow, details=mine.details,
        cycles=mine.cycles, violations=mine.violations, transcript=mine.lines, now=board.now,
    )  # fmt: skip
