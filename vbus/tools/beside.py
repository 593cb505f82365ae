"""Running a program beside a board that lives as long as the program does."""

import asyncio
import os
import signal
from collections.abc import Callable
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final, TextIO

from vbus.board.board import Board
from vbus.board.build import build, card_of, pin_map_of
from vbus.board.sections import BoardFile, HostSection, ScopeSection
from vbus.board.source import Source
from vbus.errors import VbusError
from vbus.runtime import private_runtime
from vbus.server.host_limits import IN_VAIN, POLLING, UNBOUNDED, Limits, Watch
from vbus.server.loop import HostLoop
from vbus.server.recording import Recording
from vbus.server.server import LinkSpec, Server
from vbus.server.serving import links_of, metrics_of, recorded
from vbus.signals import Observer, Violation
from vbus.tools import ending, preload
from vbus.tools.outcome import Outcome
from vbus.tools.output import complain
from vbus.tools.scope import place_of
from vbus.tools.scope_process import show_board
from vbus.tools.transcript import Transcript

NO_SCOPE: Final = ScopeSection()
LIMIT: Final = "VBUS_LIMIT_PS"
"""Variable that tells firmware's simulator after how much chip time the board must know of it."""


class Findings(Observer):
    """Remembers the first violation of each rule by each chip, and counts the others."""

    def __init__(self) -> None:
        self.first: dict[tuple[str, str], Violation] = {}
        self.count: dict[tuple[str, str], int] = {}

    def violation(self, violation: Violation) -> None:
        """Note one."""
        key = (violation.chip, violation.rule)
        self.first.setdefault(key, violation)
        self.count[key] = self.count.get(key, 0) + 1

    def lines(self) -> list[str]:
        """Return a sentence for each rule that was broken, in the order of the first breach."""
        lines = []
        for key, violation in self.first.items():
            others = self.count[key] - 1
            more = f" (and {others} more)" if others else ""
            when = f"{violation.when // 1_000_000}.{violation.when % 1_000_000 // 1000:03} us"
            lines.append(
                f"{violation.severity}: {violation.chip}: {violation.rule} ({violation.clause})"
                f" at {when}: {violation.detail}{more}"
            )
        return lines


def host_of(file: BoardFile, pinmap: str | None = None) -> HostSection:
    """Return the host of a board file that a program takes the place of.

    Args:
        file: the board file.
        pinmap: the pin map it must have; None: the first host with a card or pin map, if any.
    """
    wanted = [host for host in file.hosts if pinmap is None or host.pinmap == pinmap]
    described = [host for host in wanted if host.pinmap or host.card] or wanted
    return described[0] if described else HostSection(transport="", pinmap=pinmap or "")


def link_of_program(
    board: Board,
    file: BoardFile,
    host: HostSection,
    link: str,
    note: Path | None = None,
    limit: int = 0,
) -> tuple[LinkSpec, dict[str, str]]:
    """Return what serves a program, and the variables by which it finds that.

    Args:
        board: the board, of that file.
        file: the board file.
        host: what the program reaches: chips, card, pin map.
        link: address of the link.
        note: the file the library makes when the program ends by a fault of its own.
        limit: chip time after which the program tells the board that it goes on (ps); 0: never.

    Raises:
        VbusError: the library that traps a card's accesses cannot be built, or they are to take
            the time of a serial line.
    """
    card, pin_map = card_of(file, host), pin_map_of(file, host.pinmap)
    environment = {"VBUS_LINK": link}
    if card is not None and pin_map is None:  # firmware runs in a program that needs no library
        port = board.open_port("program", host.chips or None, host.cycle, card)
        environment |= preload.environment(port.info(), link, note, limit)
        port.close()
    elif limit:
        environment[LIMIT] = str(limit)
    if host.baud and (card is not None or pin_map is not None):
        raise VbusError(
            f"baud = {host.baud}: a program makes the accesses of a card or a pin map itself, not"
            " over a serial line; take baud out of that [[hosts]]"
        )
    spec = LinkSpec(link, "byte", list(host.chips), host.cycle, card, pin_map, line=host)
    return spec, environment


def run_on_board(
    file: BoardFile,
    source: Source,
    host: HostSection,
    command: Callable[[str], list[str]],
    transcript: str | None = None,
    summary: bool = True,
    limit: int | None = None,
    scope: str = "",
    control: bool = False,
) -> int:
    """Run a program on a board that lives as long as the program; return its exit code.

    The program's link is a socket of its own; it is in ``$VBUS_LINK``. The file's other hosts are
    served as well. What was broken is told at the end, on stderr; if the file asks for records, so
    is where they are and what became of each axis.

    Args:
        file: the board.
        source: the same as text, for mistakes found late.
        host: what the program reaches: chips, card, pin map.
        command: gives program and arguments, for the address of the link.
        transcript: file that takes the bus cycles.
        summary: whether what was broken is told.
        limit: chip time it may take (ps), and it may not poll in vain either; None: it may go on
            as it likes.
        scope: where the board is shown in a browser; else where its file says.
        control: whether who looks there may pause and step it.

    Raises:
        ConfigError: the board cannot be built.
        TransportError: a link cannot be opened.
        VbusError: the program cannot be started, or the transcript cannot be written.
    """
    files = _files(file, transcript)
    with ExitStack() as stack:
        written = None
        if transcript is not None:
            try:
                written = stack.enter_context(Path(transcript).open("w"))
            except OSError as error:
                raise VbusError(f"{transcript}: {error.strerror}") from error
        shown = recorded(file, {}, "", scope).scope
        if shown.listen:
            place_of(shown)
        ran = run_beside(
            file, source, host, command, written, limit=limit, scope=shown, control=control
        )
    for line in ran.hangs:
        complain(line)
    lines = ran.findings.lines()
    if _files(file, None):
        lines = [*(f"{what}: {path}" for what, path in files), *lines, *ran.outcome.lines()]
    for line in lines if summary else ():
        complain(line)
    return ran.code


@dataclass(frozen=True, slots=True)
class Ran:
    """What came of a program's run.

    Attributes:
        code: its exit code.
        findings: what was broken.
        outcome: what became of each axis.
        hangs: why it was ended, if it hung.
    """

    code: int
    findings: Findings
    outcome: Outcome
    hangs: list[str]


def run_beside(
    file: BoardFile,
    source: Source,
    host: HostSection,
    command: Callable[[str], list[str]],
    transcript: TextIO | None = None,
    ahead: int = 0,
    stdout: BinaryIO | None = None,
    limit: int | None = None,
    scope: ScopeSection = NO_SCOPE,
    control: bool = False,
) -> Ran:
    """Run a program on a board, as :func:`run_on_board` does, and say nothing of it.

    Args:
        file: the board.
        source: the same as text.
        host: what the program reaches.
        command: gives program and arguments, for the address of the link.
        transcript: takes the bus cycles.
        ahead: how long the board runs before the program begins (ps).
        stdout: takes what the program says; else it goes where this process's goes.
        limit: chip time that it may take (ps).
        scope: where the board is shown.
        control: whether who looks there may pause and step it.
    """
    address = metrics_of(file)
    board = build(file, source)
    findings, outcome = Findings(), Outcome(board)
    board.listen(findings)
    watched = stdout is not None or bool(_files(file, None))
    if watched:
        board.observe(outcome)
    with ExitStack() as stack:
        folder = stack.enter_context(private_runtime(unless_named=True))
        link = f"unix:{folder / 'host.sock'}"
        note = folder / "fault"
        written = Transcript(transcript) if transcript is not None else None
        if written is not None:
            board.observe(written)
        mine, environment = link_of_program(board, file, host, link, note, limit or 0)
        if mine.card is not None and mine.pin_map is None and not ahead:
            preload.warn_of(command(link)[0], file.board.time)
        served = zip(file.hosts, links_of(file), strict=True)
        others = [spec for section, spec in served if section is not host]
        recording = Recording(board, source.text, file.path, complain)
        stack.callback(recording.close)
        recording.open(file.record, file.waves)
        links, stall = [mine, *others], file.board.stall
        server = Server(board, links, stall, complain, address, settle=recording.settle)
        board.run_until(board.now + ahead)
        watch = None
        if limit is not None:
            until = min(board.now + limit, UNBOUNDED)
            watch = Watch(board, Limits(UNBOUNDED, until, IN_VAIN, POLLING))
        running = _run_beside(
            server, recording, command(link), environment, note, stdout, watch, scope, control
        )
        with asyncio.Runner(loop_factory=HostLoop) as runner:
            code = runner.run(running)
        if watched:
            outcome.look()
        if written is not None:
            written.flush()
    hangs = [f"the program hangs: {watch.stuck}", *watch.details] if watch and watch.stuck else []
    return Ran(code, findings, outcome, hangs)


def _files(file: BoardFile, transcript: str | None) -> list[tuple[str, str]]:
    """Return what a run leaves behind: what each file is, and where."""
    record = file.record
    named = [
        ("transcript", transcript or ""),
        ("journal", record.journal),
        ("report", record.report),
        ("coverage", record.coverage),
        *(("wave", wave.file) for wave in file.waves),
    ]
    return [(what, path) for what, path in named if path]


async def _run_beside(
    server: Server,
    recording: Recording,
    command: list[str],
    environment: dict[str, str],
    note: Path,
    stdout: BinaryIO | None,
    watch: Watch | None,
    scope: ScopeSection,
    control: bool,
) -> int:
    """Serve while ``command`` runs."""
    loop = asyncio.get_running_loop()
    server.start(loop)
    recording.start(loop)
    server.keep(recording)
    recording.others.append("what vbus exec tells at the end")
    counted = server.statistics()["metrics"]
    if counted:
        complain(f"metrics: {counted}")
    try:
        if scope.listen:
            await show_board(server.board.name, scope, control)
        code = await run_program(command, environment, note, True, stdout, watch)
        code = await _finish(server, watch, code)
        server.board.catch_up()
    finally:
        server.stop()
    return code


async def _finish(server: Server, watch: Watch | None, code: int) -> int:
    """Let the board carry out what the program has sent; return the exit code that remains.

    SIGINT and SIGTERM end that, and so does the bound of a program that hangs: what it has asked
    for last, and has not waited for, takes its time, too.
    """
    came: list[int] = []
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, came.append, number)
    if watch is None:
        await server.finish(lambda: bool(came))
    else:
        hung = watch.ended
        await server.finish(lambda: bool(came) or watch.ended)
        watch.close()
        if watch.ended and not hung:
            code = code or 128 + signal.SIGKILL
    return 128 + came[0] if came else code


async def run_program(
    command: list[str],
    environment: dict[str, str],
    note: Path,
    alone: bool = False,
    stdout: BinaryIO | None = None,
    watch: Watch | None = None,
) -> int:
    """Run ``command`` and return its exit code; if it died of a signal, 128 + its number.

    SIGINT and SIGTERM are passed on, and end it in any case, with all that comes from it. If this
    process dies, so does the program.

    Args:
        command: program and arguments.
        environment: variables on top of those of this process.
        note: the file the library makes when the program ends by a fault of its own.
        alone: whether the board ends with the program, and so what the program leaves behind.
        stdout: takes what the program says.
        watch: kills it when it passes a bound.

    Raises:
        VbusError: it cannot be started.
    """
    loop = asyncio.get_running_loop()
    running: list[int] = []
    came: list[int] = []
    asked: list[asyncio.TimerHandle] = []
    offspring = ending.Offspring()

    def pass_on(number: int) -> None:
        """Not by the process object, which would take the exit code from who waits for it."""
        came.append(number)
        for pid in running:
            with suppress(ProcessLookupError):
                os.kill(pid, number)
            if not asked:
                asked.append(loop.call_later(ending.PATIENCE, offspring.kill, number))

    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, pass_on, number)
    with closing(offspring), ExitStack() as at_end:
        try:
            process = await asyncio.create_subprocess_exec(
                *command,
                env={**os.environ, **environment},
                preexec_fn=offspring.die_with_parent,
                stdout=stdout,
            )
        except OSError as error:
            raise VbusError(f"{command[0]}: {error.strerror}") from error
        running.append(process.pid)
        if watch is not None:
            watch.over = lambda _: offspring.slay()
        loop.add_signal_handler(signal.SIGCHLD, offspring.bury, process.pid)
        # A loop that closes has no pipe for a child that dies then, and its handler still.
        at_end.callback(loop.remove_signal_handler, signal.SIGCHLD)
        for early in tuple(came):  # while it was being started
            pass_on(early)
        code = await process.wait()
        until = asked[0].when() if asked else loop.time() + ending.PATIENCE
        for handle in asked:
            handle.cancel()
        if watch is not None:
            watch.over = None
        left = offspring.there()
        if left and alone and not came:
            ending.say_left(left)
        if left and (alone or came):
            await offspring.end(until)
    if "VBUS_EXEC" in environment:
        ending.explain(code, note)
    return code if code >= 0 else 128 - code
