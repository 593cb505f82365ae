"""Running a program beside a board that lives as long as the program does."""

import asyncio
import os
import re
import signal
from collections.abc import Callable, Coroutine, Mapping, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final, TextIO

from vbus.board.board import Board
from vbus.board.build import build, card_of, pin_map_of
from vbus.board.card.cards import outputs_of
from vbus.boardfile.sections import BoardFile, HostSection
from vbus.boardfile.source import Source
from vbus.cli import child_processes
from vbus.cli.hosted import preload
from vbus.cli.hosted.at_rest import AtRest
from vbus.cli.look.scope_page import PageRequest
from vbus.cli.outcome import AxisOutcomes
from vbus.cli.output import complain
from vbus.cli.proc import what_hangs
from vbus.cli.transcript import Transcript
from vbus.core import exit_codes
from vbus.core.errors import ProgramError, VbusError
from vbus.core.file_kinds import HEAD, looks_like
from vbus.core.runtime import private_runtime
from vbus.core.signals import Observer, Violation
from vbus.protocols.quantities import format_instant
from vbus.serve.host_limits import IN_VAIN, PATIENCE, POLLING, UNBOUNDED, HostWatch, Limits
from vbus.serve.loop import HostLoop
from vbus.serve.output_file import OutputFile
from vbus.serve.recording import Recording
from vbus.serve.registry import own_board
from vbus.serve.server import LinkSpec, Server
from vbus.serve.serving import links_of, metrics_of

Show = Callable[[str], Coroutine[Any, Any, None]]

LIMIT: Final = "VBUS_LIMIT_PS"
"""Variable that tells firmware's simulator after how much chip time the board must know of it."""


MISSED: Final = "VBUS_MISSED"
"""Variable that names the file in which a host with a pin map lists bytes that it has not taken."""
_MISSED_FILE: Final = "missed"


def missed_bytes(note: Path, chips: Sequence[str]) -> list[str]:
    """Return what a host with a pin map has read outside the strobes that gave it.

    Args:
        note: the file that :func:`link_of_program` was given; a host's list stands beside it.
        chips: names of the chips that the host reaches.
    """
    try:
        rows = note.with_name(_MISSED_FILE).read_text().splitlines()
    except FileNotFoundError:
        return []
    lines = []
    for chip, count, saw, gave, when in (map(int, row.split()) for row in rows):
        times = f"; {count} bytes in all" if count > 1 else ""
        lines.append(
            f"{chips[chip]}: the host took {saw:02X}h where the chip gave {gave:02X}h at"
            f" {format_instant(when)}: it looked at D0-D7 before its read strobe was low, or after"
            f" that (t_AC, t_DF); look while the strobe is low{times}"
        )
    return lines


class FirstViolations(Observer):
    """Remembers the first violation of each rule by each chip, and counts the others."""

    def __init__(self) -> None:
        self.first: dict[tuple[str, str], Violation] = {}
        self.count: dict[tuple[str, str], int] = {}
        self.hints: list[str] = []
        """What is to be said of them at the end."""

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
        return [*lines, *self.hints]


def host_of(file: BoardFile, pinmap: str | None = None) -> HostSection:
    """Return the host of a board file that a program takes the place of.

    Args:
        file: the board file.
        pinmap: the pin map it must have; None: the first host with a card or pin map, if any.
    """
    wanted = [host for host in file.hosts if pinmap is None or host.pinmap == pinmap]
    described = [host for host in wanted if host.pinmap or host.card] or wanted
    return described[0] if described else HostSection(transport="", pinmap=pinmap or "")


@dataclass(frozen=True, slots=True)
class HostedProgram:
    """A program, and the board that it runs on in the place of one of its hosts.

    Attributes:
        file: the board.
        source: the same as text, for mistakes found late.
        host: what the program reaches: chips, card, pin map.
        command: gives program and arguments, for the address of the link.
        order: seed of the order in which its threads have their turns; 0: as they were created.
    """

    file: BoardFile
    source: Source
    host: HostSection
    command: Callable[[str], list[str]]
    order: int = 0


def link_of_program(
    board: Board,
    file: BoardFile,
    host: HostSection,
    link: str,
    note: Path | None = None,
    limit: int = 0,
    order: int = 0,
) -> tuple[LinkSpec, dict[str, str]]:
    """Return what serves a program, and the variables by which it finds that.

    Args:
        board: the board, of that file.
        file: the board file.
        host: what the program reaches: chips, card, pin map.
        link: address of the link.
        note: the file the library makes when the program ends by a fault of its own.
        limit: chip time after which the program tells the board that it goes on (ps); 0: never.
        order: seed of the order of its threads, as in :class:`HostedProgram`.

    Raises:
        VbusError: the library that traps a card's accesses cannot be built, or they are to take
            the time of a serial line.
    """
    card, pin_map = card_of(file, host), pin_map_of(file, host.pinmap)
    environment = {"VBUS_LINK": link}
    if card is not None and pin_map is None:  # firmware runs in a program that needs no library
        port = board.open_port("program", host.chips or None, host.cycle, card)
        environment |= preload.environment(port.info(), link, note, limit, order)
        port.close()
    elif limit:
        environment[LIMIT] = str(limit)
    if pin_map is not None and note is not None:
        environment[MISSED] = str(note.with_name(_MISSED_FILE))
    if host.baud and (card is not None or pin_map is not None):
        raise VbusError(
            f"baud = {host.baud}: a program makes the accesses of a card or a pin map itself, not"
            " over a serial line; take baud out of that [[hosts]]"
        )
    spec = LinkSpec(link, "byte", list(host.chips), host.cycle, card, pin_map, line=host)
    return spec, environment


def run_at_link(
    command: list[str], environment: Mapping[str, str] | None = None, note: Path | None = None
) -> int:
    """Run a program that reaches a board which runs already; return its exit code."""
    return asyncio.run(run_program(command, environment or {}, note or Path()))


def run_on_board(
    program: HostedProgram,
    transcript: str | None = None,
    summary: bool = True,
    limit: int | None = None,
    page: PageRequest = PageRequest(),  # noqa: B008
) -> int:
    """Run a program on a board that lives as long as the program; return its exit code.

    The program's link is a socket of its own; it is in ``$VBUS_LINK``. The file's other hosts are
    served as well. Violations are listed at the end, on stderr; if the file asks for records, so
    is where they are and what became of each axis.

    Args:
        program: the program, and its board.
        transcript: file that takes the bus cycles.
        summary: whether violations are listed.
        limit: chip time it may take (ps), and it may not poll in vain either; None: it may go on
            as it likes.
        page: what is asked of the board's page.

    Raises:
        ConfigError: the board cannot be built.
        TransportError: a link cannot be opened.
        VbusError: the program cannot be started, or the transcript cannot be written.
    """
    file = program.file
    files = _files(file, transcript)
    show = partial(page.show, section=page.of(file.scope))
    ran = run_beside(program, transcript, limit=limit, show=show)
    for line in ran.hangs:
        complain(line)
    lines = ran.findings.lines()
    if _files(file, None):
        lines = [*(f"{what}: {path}" for what, path in files), *lines, *ran.outcome.lines()]
    elif ran.code and not ran.hangs:
        lines += ran.outcome.brief()
    for line in lines if summary else ():
        complain(line)
    return ran.code or (exit_codes.FAILURE if ran.lost else exit_codes.OK)


@dataclass(frozen=True, slots=True)
class Ran:
    """What came of a program's run.

    Attributes:
        code: its exit code.
        findings: what was broken.
        outcome: what became of each axis.
        hangs: why it was ended, if it hung.
        slow: whether that says nothing of it, because the machine was too slow.
        lost: why files have not all they should have; it has been said.
    """

    code: int
    findings: FirstViolations
    outcome: AxisOutcomes
    hangs: list[str]
    slow: bool
    lost: list[str]


def run_beside(
    program: HostedProgram,
    transcript: str | TextIO | None = None,
    limit: int | None = None,
    cycles: int = UNBOUNDED,
    prepare: Callable[[Board], None] | None = None,
    show: Show | None = None,
) -> Ran:
    """Run a program on a board, as :func:`run_on_board` does, and say nothing of it.

    Args:
        program: the program, and its board.
        transcript: takes the bus cycles; a file, or the name of one.
        limit: chip time that it may take (ps).
        cycles: bus cycles that it may make, if it has a limit.
        prepare: is called with the board before the program begins, and changes it.
        show: shows the board of this name, and is waited for before the program begins.
    """
    file, host = program.file, program.host
    address = metrics_of(file)
    board = build(file, program.source)
    findings, outcome = FirstViolations(), AxisOutcomes(board)
    board.listen(findings)
    watched = bool(_files(file, None))
    outcome.look()
    if watched:
        board.observe(outcome)
    with ExitStack() as stack:
        folder = stack.enter_context(private_runtime(unless_named=True))
        link = f"unix:{folder / 'host.sock'}"
        note = folder / "fault"
        stack.enter_context(own_board(board.name))
        mine, environment = link_of_program(
            board, file, host, link, note, limit or 0, program.order
        )
        if mine.card is not None and mine.pin_map is None and prepare is None:
            preload.warn_of(program.command(link)[0], file.board.time)
        served = zip(file.hosts, links_of(file), strict=True)
        others = [spec for section, spec in served if section is not host]
        recording = Recording(board, program.source.text, file.path, complain)
        stack.callback(recording.close)
        name, into = (transcript, None) if isinstance(transcript, str) else ("", transcript)
        opened = stack.enter_context(closing(OutputFile(name, whole=False))) if name else None
        recording.open(file.record, file.waves)
        if opened is not None:
            # An earlier transcript goes only once every file of the run can be written.
            into = opened.begin_text()
        written = None if into is None else Transcript(into)
        if written is not None:
            board.observe(written)
        links, stall = [mine, *others], file.board.stall
        server = Server(board, links, stall, complain, address, settle=recording.settle)
        if prepare is not None:
            # After the observers: what it changes is in the record.
            prepare(board)
        watch = None
        if limit is not None:
            until = min(board.now + limit, UNBOUNDED)
            polling = POLLING if board.policy == "realtime" else PATIENCE
            watch = HostWatch(board, Limits(cycles, until, IN_VAIN, polling))
        # Firmware ends by its own clock (VBUS_LIMIT_PS); in real time a wait may end by itself.
        virtual = mine.pin_map is None and file.board.time != "realtime"
        interrupt = mine.card.interrupt if mine.card is not None else ""

        async def serve() -> int:
            loop = asyncio.get_running_loop()
            server.start(loop)
            recording.start(loop)
            server.keep(recording)
            recording.others.append("what vbus exec tells at the end")
            if counted := server.statistics()["metrics"]:
                complain(f"metrics: {counted}")
            try:
                if show is not None:
                    await show(board.name)
                code = await run_program(
                    program.command(link), environment, note, True, watch,
                    (limit or 0) if virtual else 0, partial(_interrupts, board, interrupt),
                )  # fmt: skip
                code = await _finish(server, watch, code)
                board.catch_up()
            finally:
                server.stop()
            return code

        # Sessions are served inside the selector, as those of vbus run: a bus cycle is cheaper so.
        with asyncio.Runner(loop_factory=HostLoop) as runner:
            code = runner.run(serve())
        for found in board.left_over():
            findings.violation(found)
        findings.hints = board.hints(findings.first.values())
        findings.hints += missed_bytes(note, host.chips or [chip.name for chip in board.chips])
        outcome.look()
        if written is not None:
            written.end()
            if written.error:
                recording.fail(f"{name}: {written.error}")
    hangs = []
    if watch and watch.stuck:
        hangs = [watch.verdict("the program hangs"), *watch.details]
    slow = watch is not None and watch.slow
    return Ran(code, findings, outcome, hangs, slow, recording.failures)


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


def not_started(program: str, error: OSError) -> ProgramError:
    """Return what to say about a program that cannot be started, and what to do."""
    path = Path(program)
    if isinstance(error, FileNotFoundError):
        if path.exists() and "/" in program:  # its interpreter is not there
            return ProgramError(
                f"{program}: what its first line names, or its loader, is not on this machine", True
            )
        if path.exists():
            return ProgramError(f"{program}: not in $PATH; write ./{program}", True)
        return ProgramError(
            f"{program}: there is no such program; build it, or name it as a shell finds it", True
        )
    if path.is_dir():
        return ProgramError(f"{program}: it is a directory; name a program in it", False)
    if path.is_file() and os.access(path, os.R_OK):
        with path.open("rb") as file:
            kind = looks_like(program, file.read(HEAD))
        hint = f"if it is a program: chmod +x {program}"
        if os.access(path, os.X_OK):
            hint = "a script begins with a line such as #!/bin/sh"
        return ProgramError(f"{program}: it cannot be run: {kind}; {hint}", False)
    return ProgramError(f"{program}: cannot be started: {error.strerror}", False)


def _interrupts(board: Board, outputs: str) -> str:
    """Name the outputs that interrupt a program, and when one of them moved last."""
    nets = [board.find_pin(output).net for output, _ in outputs_of(outputs)]
    when = max((net.changed_at for net in nets), default=0)
    return (
        f"{' or '.join(outputs.split())}, which moved last at {format_instant(when)} of chip time"
    )


async def _finish(server: Server, watch: HostWatch | None, code: int) -> int:
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
    environment: Mapping[str, str],
    note: Path,
    alone: bool = False,
    watch: HostWatch | None = None,
    limit: int = 0,
    interrupts: Callable[[], str] = lambda: "see interrupt of the card",
) -> int:
    """Run ``command`` and return its exit code; if it died of a signal, 128 + its number.

    SIGINT and SIGTERM are passed on, and end it in any case, with all that comes from it. If this
    process dies, so does the program.

    Args:
        command: program and arguments.
        environment: variables on top of those of this process.
        note: the file the library makes when the program ends by a fault of its own.
        alone: whether the board ends with the program, and so what the program leaves behind.
        watch: kills it when it passes a bound.
        limit: chip time it may take (ps), if time is virtual: it is ended too when it waits for
            what cannot come, or computes for as long; 0: it is not.
        interrupts: names the card's interrupt, and when it last came.

    Raises:
        VbusError: it cannot be started.
    """
    loop = asyncio.get_running_loop()
    running: list[int] = []
    came: list[int] = []
    asked: list[asyncio.TimerHandle] = []
    offspring = child_processes.ChildProcesses()

    def pass_on(number: int) -> None:
        """Not by the process object, which would take the exit code from who waits for it."""
        came.append(number)
        for pid in running:
            with suppress(ProcessLookupError):
                os.kill(pid, number)
            if not asked:
                asked.append(loop.call_later(child_processes.PATIENCE, offspring.overdue, number))

    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, pass_on, number)
    with closing(offspring), ExitStack() as at_end:
        try:
            process = await asyncio.create_subprocess_exec(
                *command,
                env={**os.environ, **environment},
                preexec_fn=offspring.die_with_parent,
            )
        except OSError as error:
            raise not_started(command[0], error) from error
        running.append(process.pid)
        if watch is not None:
            hung = watch

            def kill(_: str) -> None:
                # What it was doing is asked for first: of a process that is killed nothing is left.
                hung.add_threads(what_hangs(offspring.there()))
                offspring.kill()

            hung.over = kill
            if limit:
                look = AtRest(offspring.there, watch, note, limit)
                at_end.callback(asyncio.ensure_future(look.go_on()).cancel)
        loop.add_signal_handler(signal.SIGCHLD, offspring.reap, process.pid)
        # A loop that closes has no pipe for a child that dies then, and its handler still.
        at_end.callback(loop.remove_signal_handler, signal.SIGCHLD)
        for early in tuple(came):  # while it was being started
            pass_on(early)
        code = await process.wait()
        until = asked[0].when() if asked else loop.time() + child_processes.PATIENCE
        for handle in asked:
            handle.cancel()
        if watch is not None:
            watch.over = None
        left = offspring.there()
        if left and alone and not came and not (watch is not None and watch.ended):
            child_processes.say_left(left)
        if left and (alone or came):
            await offspring.end(until)
    if "VBUS_EXEC" in environment:
        found = re.search(r";signal=(\d+);", environment["VBUS_EXEC"])
        child_processes.explain(code, note, int(found[1]) if found else 0, interrupts())
    return code if code >= 0 else 128 - code
