"""Running a program beside a board that lives as long as the program does."""

import asyncio
import os
import re
import signal
from collections.abc import Callable, Coroutine, Mapping
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field
from functools import partial
from math import inf
from pathlib import Path
from tempfile import TemporaryFile
from threading import current_thread, main_thread
from typing import IO, Any, Final, NamedTuple

from vbus.board.board import Board
from vbus.board.build import build
from vbus.board.card.cards import outputs_of
from vbus.board.strobe_watch import missed_byte
from vbus.boardfile.sections import BoardFile, HostSection
from vbus.boardfile.source import Source
from vbus.cli import child_processes
from vbus.cli.hosted import preload
from vbus.cli.hosted.at_rest import AtRest
from vbus.cli.look.scope_page import PageRequest
from vbus.cli.outcome import AxisOutcomes
from vbus.cli.output import complain
from vbus.cli.proc import what_hangs
from vbus.cli.transcript import FirstViolations, Transcript
from vbus.core import exit_codes
from vbus.core.errors import ProgramError, VbusError
from vbus.core.file_kinds import HEAD, looks_like
from vbus.core.runtime import private_runtime
from vbus.core.wall_clock import monotonic
from vbus.protocols.quantities import format_instant
from vbus.serve.host_limits import IN_VAIN, PATIENCE, POLLING, UNBOUNDED, HostWatch, Limits
from vbus.serve.loop import HostLoop
from vbus.serve.output_file import OutputFile
from vbus.serve.recording import Recording
from vbus.serve.registry import own_board
from vbus.serve.server import LinkSpec, Server
from vbus.serve.serving import link_of, links_of, metrics_of

Show = Callable[[str], Coroutine[Any, Any, None]]

LIMIT: Final = "VBUS_LIMIT_PS"
"""Variable that tells firmware's simulator after how much chip time the board must know of it."""


MISSED: Final = "VBUS_MISSED"
"""Variable that names the file in which a host with a pin map lists bytes that it has not taken."""
_MISSED_FILE: Final = "missed"


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
        simulated: whether it is firmware in a simulator, which computes while chip time passes.
    """

    file: BoardFile
    source: Source
    host: HostSection
    command: Callable[[str], list[str]]
    order: int = 0
    simulated: bool = False

    def beside(
        self, board: Board, folder: Path, limit: int, looked_at: int
    ) -> "tuple[ProgramRun, LinkSpec]":
        """Return what runs the program beside a board of its file, and what serves it there.

        Args:
            board: the board.
            folder: a private one, for the link and the library's notes.
            limit: chip time after which the program tells the board that it goes on (ps); 0: never.
            looked_at: what :attr:`ProgramRun.limit` is where time is virtual.

        Raises:
            VbusError: the library that traps a card's accesses cannot be built, or they are to
                take the time of a serial line.
        """
        host, link, note = self.host, f"unix:{folder / 'host.sock'}", folder / "fault"
        spec = link_of(self.file, host, link, "byte")
        card, pin_map = spec.card, spec.pin_map
        if host.baud and (card is not None or pin_map is not None):
            raise VbusError(
                f"baud = {host.baud}: a program makes the accesses of a card or a pin map itself,"
                " not over a serial line; take baud out of that [[hosts]]"
            )
        environment = {"VBUS_LINK": link}
        # Firmware runs in a program that needs no library, and ends by a clock of its own.
        if card is not None and pin_map is None:
            port = board.open_port("program", host.chips or None, host.cycle, card)
            environment |= preload.environment(port.info(), link, note, limit, self.order)
            port.close()
        elif limit:
            environment[LIMIT] = str(limit)
        if pin_map is not None:
            environment[MISSED] = str(note.with_name(_MISSED_FILE))
        run = ProgramRun(self.command(link), environment, note, board)
        run.reached = list(host.chips) or [chip.name for chip in board.chips]
        run.interrupt = card.interrupt if card is not None else ""
        # In real time a wait may end by itself.
        looks = pin_map is None or not self.simulated
        run.limit = looked_at if looks and self.file.board.time != "realtime" else 0
        return run, spec


def run_at_link(
    command: list[str], environment: Mapping[str, str] | None = None, note: Path | None = None
) -> int:
    """Run a program that reaches a board which runs already; return its exit code."""
    return asyncio.run(ProgramRun(command, environment or {}, note or Path()).run()).code


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
    elif ran.ended.code and not ran.hangs:
        lines += ran.outcome.brief()
    for line in lines if summary else ():
        complain(line)
    return ran.ended.code or (exit_codes.FAILURE if ran.lost else exit_codes.OK)


@dataclass(frozen=True, slots=True)
class Ran:
    """What came of a program's run.

    Attributes:
        ended: how it has ended.
        findings: what was broken.
        outcome: what became of each axis.
        hangs: why it was ended, if it hung.
        slow: whether that says nothing of it, because the machine was too slow.
        lost: why files have not all they should have; it has been said.
    """

    ended: "Ended"
    findings: FirstViolations
    outcome: AxisOutcomes
    hangs: list[str]
    slow: bool
    lost: list[str]


def run_beside(
    program: HostedProgram,
    transcript: str | None = None,
    limit: int | None = None,
    cycles: int = UNBOUNDED,
    prepare: Callable[[Board], None] | None = None,
    show: Show | None = None,
    taken: bool = False,
    watched: bool = False,
) -> Ran:
    """Run a program on a board, as :func:`run_on_board` does, and say nothing of it.

    Args:
        program: the program, and its board.
        transcript: name of a file that takes the bus cycles.
        limit: chip time that it may take (ps).
        cycles: bus cycles that it may make, if it has a limit.
        prepare: is called with the board before the program begins, and changes it.
        show: shows the board of this name, and is waited for before the program begins.
        taken: whether what it writes, and what is said of it meanwhile, is taken.
        watched: whether axes are looked at all the time; else only in a run that leaves files.
    """
    file, host = program.file, program.host
    address = metrics_of(file)
    board = build(file, program.source)
    findings, outcome = FirstViolations(), AxisOutcomes(board)
    board.listen(findings)
    outcome.look()
    if watched or _files(file, None):
        if board.policy == "realtime":
            board.observe(outcome)
        else:
            outcome.watch()
    with ExitStack() as stack:
        folder = stack.enter_context(private_runtime(unless_named=True))
        stack.enter_context(own_board(board.name))
        ran, mine = program.beside(board, folder, limit or 0, limit or 0)
        ran.taken = taken
        report = ran.sentences.append if taken else complain
        if mine.card is not None and mine.pin_map is None and prepare is None:
            preload.warn_of(ran.command[0], file.board.time)
        served = zip(file.hosts, links_of(file), strict=True)
        links = [mine, *(spec for section, spec in served if section is not host)]
        recording = Recording(board, program.source.text, file.path, report)
        stack.callback(recording.close)
        opened = None
        if transcript:
            opened = stack.enter_context(closing(OutputFile(transcript, whole=False)))
        recording.open(file.record, file.waves)
        written = None
        if opened is not None:
            # An earlier transcript goes only once every file of the run can be written.
            written = Transcript(opened.begin_text())
            board.observe(written)
        server = Server(board, links, file.board.stall, report, address, settle=recording.settle)
        if prepare is not None:
            # After the observers: what it changes is in the record.
            prepare(board)
        if limit is not None:
            until = min(board.now + limit, UNBOUNDED)
            polling = POLLING if board.policy == "realtime" else PATIENCE
            ran.watches.append(HostWatch(board, Limits(cycles, until, IN_VAIN, polling)))

        async def serve() -> Ended:
            loop = asyncio.get_running_loop()
            server.start(loop)
            recording.start(loop)
            server.keep(recording)
            recording.others.append("what vbus exec tells at the end")
            if counted := server.statistics()["metrics"]:
                report(f"metrics: {counted}")
            try:
                if show is not None:
                    await show(board.name)
                ended = await ran.beside(server)
                for watch in ran.watches:
                    watch.close()
                board.catch_up()
            finally:
                server.stop()
            return ended

        # Sessions are served inside the selector, as those of vbus run: a bus cycle is cheaper so.
        with asyncio.Runner(loop_factory=HostLoop) as runner:
            ended = runner.run(serve())
        for found in board.left_over():
            findings.violation(found)
        findings.hints = [*board.hints(findings.first.values()), *ran.missed()]
        outcome.look()
        if written is not None:
            written.end()
            if written.error:
                recording.fail(f"{transcript}: {written.error}")
    hangs = [line for one in ran.watches if one.stuck
             for line in (one.verdict("the program hangs"), *one.details)]  # fmt: skip
    slow = any(watch.slow for watch in ran.watches)
    return Ran(ended, findings, outcome, hangs, slow, recording.failures)


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
        # execve says "no such file" of the interpreter's, too.
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


class Ended(NamedTuple):
    """How a program has ended.

    Attributes:
        code: its exit code; 128 + N of one that died of signal N.
        output: what it wrote to standard output, if that was taken.
        errors: the same of standard error, and what was said of it meanwhile.
    """

    code: int
    output: str = ""
    errors: str = ""


@dataclass(eq=False, slots=True)
class ProgramRun:
    """One run of a program, with its bounds and its end.

    Attributes:
        command: program and arguments.
        environment: variables on top of those of this process.
        note: the file the library makes when the program ends by a fault of its own.
        board: the board, which ends with the program, as does what the program leaves behind;
            None: one of another process, which goes on.
        reached: names of the chips that the program reaches.
        interrupt: outputs that interrupt the program.
        watches: each ends it when it passes a bound; the first is of this run alone.
        limit: chip time it may take (ps), if time is virtual: it is ended too when it waits for
            what cannot come, or computes for as long; 0: it is not.
        wall: seconds of wall time that it may take, and what it has sent last, too.
        taken: whether what it writes is taken; it reads nothing then.
        sentences: what was said of it, where that is taken.
    """

    command: list[str]
    environment: Mapping[str, str]
    note: Path
    board: Board | None = None
    reached: list[str] = field(default_factory=list)
    interrupt: str = ""
    watches: list[HostWatch] = field(default_factory=list)
    limit: int = 0
    wall: float = inf
    taken: bool = False
    sentences: list[str] = field(default_factory=list)

    def missed(self) -> list[str]:
        """Return what a host that moves pins has read outside the strobes that gave it."""
        path = self.note.with_name(_MISSED_FILE)
        rows = path.read_text().splitlines() if path.exists() else []
        listed = [(self.reached[chip], rest) for chip, *rest in (map(int, r.split()) for r in rows)]
        # The board sees the strobes of chips behind glue.
        behind = self.board.missed.items() if self.board is not None else ()
        return [missed_byte(chip, *rest) for chip, rest in (*listed, *behind)]

    @property
    def _bounded(self) -> bool:
        """Whether a bound has been passed."""
        return any(watch.ended for watch in self.watches)

    async def beside(self, server: Server) -> Ended:
        """Run it on a board that is served here, which carries out what it has sent last.

        That takes its time, too: its bounds end it, and so do SIGINT and SIGTERM.

        Raises:
            VbusError: it cannot be started.
        """
        ended = await self.run()
        hung, came = self._bounded, _signals()
        last = monotonic() + self.wall

        def over() -> bool:
            if monotonic() > last:
                self.watches[0].pass_wall(
                    f"what it sent last was not done after {self.wall:g} s of wall time"
                )
            return bool(came) or self._bounded

        await server.finish(over)
        code = ended.code
        if self._bounded and not hung:
            code = code or 128 + signal.SIGKILL
        return ended._replace(code=128 + came[0] if came else code)

    async def run(self) -> Ended:
        """Run it, and end what it leaves behind.

        SIGINT and SIGTERM are passed on, and end it in any case, with all that comes from it. If
        this process dies, so does the program. In a thread other than the main one neither is so.

        Raises:
            VbusError: it cannot be started.
        """
        loop = asyncio.get_running_loop()
        running: list[int] = []
        asked: list[asyncio.Task[None]] = []
        report = self.sentences.append if self.taken else child_processes.say
        offspring = child_processes.ChildProcesses(report)
        dies_with_us = child_processes.end_with_parent(signal.SIGKILL)

        def pass_on(number: int) -> None:
            """Not by the process object, which would take the exit code from who waits for it."""
            for pid in running:
                with suppress(ProcessLookupError):
                    os.kill(pid, number)
                if not asked:
                    asked.append(loop.create_task(offspring.see_end(number, pid)))

        came = _signals(pass_on)
        with closing(offspring), ExitStack() as at_end:
            files: list[IO[str]] = []
            if self.taken:
                for _ in ("output", "errors"):
                    files.append(at_end.enter_context(TemporaryFile("w+", errors="replace")))
            try:
                process = await asyncio.create_subprocess_exec(
                    *self.command,
                    env={**os.environ, **self.environment},
                    stdin=asyncio.subprocess.DEVNULL if files else None,
                    stdout=files[0] if files else None,
                    stderr=files[1] if files else None,
                    preexec_fn=dies_with_us if _has_signals() else None,
                )
            except OSError as error:
                raise not_started(self.command[0], error) from error
            running.append(process.pid)

            def kill(_: str) -> None:
                # What it was doing is asked for first: of a process that is killed nothing is left.
                threads = what_hangs(offspring.there())
                for watch in self.watches:
                    watch.add_threads(threads)
                offspring.send(signal.SIGKILL)

            for watch in self.watches:
                watch.over = kill
                if watch.ended:  # while it was being started
                    kill("")
            if self.watches and self.limit:
                look = AtRest(offspring.there, self.watches[0], self.note, self.limit)
                at_end.callback(asyncio.ensure_future(look.go_on()).cancel)
            if self.wall < inf:
                sentence = f"it was not done after {self.wall:g} s of wall time"
                timer = loop.call_later(self.wall, self.watches[0].pass_wall, sentence)
                at_end.callback(timer.cancel)
            if _has_signals():
                loop.add_signal_handler(signal.SIGCHLD, offspring.reap, process.pid)
                # A loop that closes has no pipe for a child that dies then, and its handler still.
                at_end.callback(loop.remove_signal_handler, signal.SIGCHLD)
            for early in tuple(came):  # while it was being started
                pass_on(early)
            try:
                code = await process.wait()
            except BaseException:
                offspring.send(signal.SIGKILL)
                raise
            for seen in asked:
                seen.cancel()
            for watch in self.watches:
                watch.over = None
            left, alone = offspring.there(), self.board is not None
            if left and alone and not came and not self._bounded:
                offspring.say_left(left)
            if left and (alone or came):
                offspring.send(signal.SIGTERM)
                await offspring.see_end(signal.SIGTERM)
            if "VBUS_EXEC" in self.environment:
                found = re.search(r";signal=(\d+);", self.environment["VBUS_EXEC"])
                number = int(found[1]) if found else 0
                offspring.explain(code, self.note, number, self._interrupts())
            for file in files:
                file.seek(0)
            output, errors = [file.read() for file in files] or ("", "")
        errors += "".join(f"vbus: {sentence}\n" for sentence in self.sentences)
        return Ended(code if code >= 0 else 128 - code, output, errors)

    def _interrupts(self) -> str:
        """Name the outputs that interrupt the program, and when one of them moved last."""
        if self.board is None:
            return "see interrupt of the card"
        nets = [self.board.find_pin(output).net for output, _ in outputs_of(self.interrupt)]
        when = max((net.changed_at for net in nets), default=0)
        outputs = " or ".join(self.interrupt.split())
        return f"{outputs}, which moved last at {format_instant(when)} of chip time"


def _has_signals() -> bool:
    """Whether this thread gets signals; in another one a fork is not safe for Python's code."""
    return current_thread() is main_thread()


def _signals(then: Callable[[int], None] = lambda _: None) -> list[int]:
    """Return a list that SIGINT and SIGTERM come to from now on; ``then`` is called with each."""
    came: list[int] = []

    def take(number: int) -> None:
        came.append(number)
        then(number)

    if _has_signals():
        for number in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().add_signal_handler(number, take, number)
    return came
