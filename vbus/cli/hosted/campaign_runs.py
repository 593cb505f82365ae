"""Runs of a campaign: a program in one world after another, in several processes."""

import asyncio
import io
import os
import runpy
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from inspect import iscoroutinefunction, isfunction
from multiprocessing import get_context
from pathlib import Path
from traceback import extract_tb
from typing import Any, Final, Protocol

import click
import msgspec

from vbus.board.board import Board
from vbus.board.build import build
from vbus.boardfile.sections import BoardFile, RecordSection
from vbus.boardfile.source import Source
from vbus.campaign.account import Account, Witness
from vbus.campaign.plan import PlannedWorld
from vbus.campaign.verdict import Result, judge
from vbus.campaign.world import REFERENCE, World, begin, of_world
from vbus.cli.child_processes import end_with_parent
from vbus.cli.hosted.program import HostedProgram, run_beside
from vbus.client import aio
from vbus.client.bus import Bus
from vbus.core.errors import VbusError, value_errors
from vbus.core.kernel import SECOND
from vbus.core.runtime import private_runtime
from vbus.core.values.settings import among
from vbus.core.wall_clock import monotonic
from vbus.serve.host_limits import IN_VAIN, POLLING, HostStuck, HostWatch, Limits
from vbus.serve.in_process import InProcessFaults, InProcessLink

# A fault that makes a driver repeat a move takes twice as long; a hang takes for ever.
# Drivers give up by themselves after seconds of chip time: with 1 s, 24 of 57 faults of an MCP-1200
# counted as a hang of a driver that waits for 4 s, and says so. With 10 s none did.
_LONGER: Final = 4
"""A run may take so many times what the reference run takes, and :data:`_PATIENCE` more."""
_PATIENCE: Final = 10 * SECOND
# Some retries of a short program, whose reference run has few cycles to multiply.
_CYCLES: Final = 20_000
# Enough that no process waits for work; few enough that Ctrl-C ends soon.
_AHEAD: Final = 4
"""Runs for each process that are asked for before their turn."""


_PACKAGE: Final = str(Path(__file__).parents[2])


class Subject(Protocol):
    """What a campaign runs."""

    def run(self, world: World, reference: Account | None) -> Account:
        """Run it in a world; without a reference run, note every bus cycle.

        Raises:
            VbusError: it cannot be run, or the world cannot be.
        """


def limits_of(reference: Account | None) -> tuple[int, int]:
    """Return the chip time (ps) and the bus cycles that a run may take."""
    if reference is None:
        return 60 * SECOND, 10_000_000
    return _LONGER * reference.now + _PATIENCE, _LONGER * reference.cycles + _CYCLES


def takes_turns(program: HostedProgram) -> bool:
    """Tell whether threads of a program take turns: those of firmware in a simulator do not."""
    host, time = program.host, program.file.board.time
    return bool(host.card) and not host.pinmap and time != "realtime"


def in_world(program: HostedProgram, world: World) -> HostedProgram:
    """Return a program with the board, and the order of threads, that it has in a world."""
    fits = world.of_host and (takes_turns(program) or not world.order)
    of_board = REFERENCE if fits else world
    file, source = of_world(program.file, program.source, of_board)
    return replace(program, file=file, source=source, order=world.order)


def _begun(board: Board, world: World, notes: bool) -> Witness:
    """Begin a world on a board; return what sees the run, and ``notes`` every bus cycle.

    Raises:
        VbusError: the world does not fit the board.
    """
    witness = Witness(board, notes)  # before the world: it sees what the world changes
    with value_errors(VbusError, f"{world}: "):
        begin(board, world)
    return witness


@contextmanager
def _ended_without_bus(watch: HostWatch) -> Iterator[None]:
    """End a function that computes for so long without an access to the bus.

    Seconds are the processor's: a busy machine ends none sooner.
    """
    before = (-1, -1)

    def look(*_: object) -> None:
        nonlocal before
        if watch.progress == before:
            watch.pass_bound(f"it has computed for {POLLING:g} s without an access to the bus")
            watch.check()
        before = watch.progress

    earlier = signal.signal(signal.SIGVTALRM, look)
    signal.setitimer(signal.ITIMER_VIRTUAL, POLLING, POLLING)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, earlier)


@dataclass(frozen=True, slots=True)
class ProgramSubject:
    """A program on a board of its own.

    Args:
        program: the program.
        failed: what it prints when it has failed, if its exit code does not say so.
    """

    program: HostedProgram
    failed: str = ""

    def run(self, world: World, reference: Account | None) -> Account:
        """Run it in a world."""
        program = in_world(self.program, world)
        file = msgspec.structs.replace(program.file, record=RecordSection(), waves=())
        program = replace(program, file=file)
        limit, cycles = limits_of(reference)
        seen: list[Witness] = []

        def prepare(board: Board) -> None:
            seen.append(_begun(board, world, reference is None))

        with private_runtime():
            ran = run_beside(program, limit=limit, cycles=cycles, prepare=prepare, taken=True)
        ended, stuck = ran.ended, ran.hangs[0] if ran.hangs else ""
        # Firmware that has said so may wait for its reset from there on.
        if self.failed and self.failed in ended.output:
            ended, stuck = ended._replace(code=ended.code or 1), ""
        return seen[0].account(
            **ended._asdict(), stuck=stuck, slow=ran.slow and bool(stuck),
            turns=takes_turns(program),
        )  # fmt: skip


def _called(call: Callable[[Any], Any], link: InProcessLink) -> object:
    """Call a function with a bus on a link: one with ``async def`` has the bus to be awaited."""
    if not iscoroutinefunction(call):
        bus = Bus(link)
        bus.hello()
        return call(bus)

    async def run() -> object:
        bus = aio.Bus(link)
        await bus.hello()
        return await call(bus)

    return asyncio.run(run())


@dataclass(frozen=True, slots=True)
class FunctionSubject:
    """A function of Python that is given a client's bus, on a board in the same process.

    Attributes:
        file: the board.
        source: the same as text.
        call: the function.
    """

    file: BoardFile
    source: Source
    call: Callable[[Bus], object]

    def run(self, world: World, reference: Account | None) -> Account:
        """Run it in a world."""
        # A fault of the link is no part of the board.
        of_board = REFERENCE if world.of_host and not world.order else world
        board = build(*of_world(self.file, self.source, of_board))
        limit, cycles = limits_of(reference)
        witness = _begun(board, world, reference is None)
        watch = HostWatch(board, Limits(cycles, board.now + limit, IN_VAIN))
        code, output, errors = 0, io.StringIO(), io.StringIO()
        with redirect_stdout(output), redirect_stderr(errors):
            link = InProcessLink(board)
            board.serve_links(InProcessFaults(link))
            try:
                with _ended_without_bus(watch):
                    result = _called(self.call, link)
                if result is not None:
                    print(result)
            except HostStuck:
                pass
            except SystemExit as error:
                code = error.code if isinstance(error.code, int) else int(error.code is not None)
                errors.write(f"{error.code}\n" if code else "")
            except Exception as error:
                code = 1
                errors.write(f"{_with_line(error)}\n")
            finally:
                link.close()
        watch.close()
        return witness.account(
            code=code, stuck=watch.stuck, slow=watch.slow, output=output.getvalue(),
            errors=errors.getvalue(), links=True,
        )  # fmt: skip


def _with_line(error: Exception) -> str:
    """Return what a user's code has raised, and where."""
    said = f"{type(error).__name__}: {error}"
    if isinstance(error, SyntaxError):  # it names its line
        return said
    of_user = [
        f"{frame.filename}, line {frame.lineno}"
        for frame in extract_tb(error.__traceback__)
        if not frame.filename.startswith((_PACKAGE, "<frozen"))
    ]
    return f"{said} ({of_user[-1]})" if of_user else said


def function_of(text: str) -> Callable[[Bus], object]:
    """Return the function that ``FILE.py:NAME`` names.

    Raises:
        click.UsageError: there is no such file or function.
        VbusError: the file cannot be loaded; says its line.
    """
    path, _, name = text.rpartition(":")
    if not path:
        raise click.UsageError(f"--host {text}: it names no function; write FILE.py:FUNCTION")
    if not Path(path).is_file():
        raise click.UsageError(f"--host {text}: no file {path or text}; write FILE.py:FUNCTION")
    # As Python does for a script: modules beside it are found.
    sys.path.insert(0, str(Path(path).resolve().parent))
    try:
        found = runpy.run_path(path, run_name="campaign")
    except VbusError:
        raise
    except Exception as error:
        raise VbusError(f"--host {text}: {path} cannot be loaded: {_with_line(error)}") from None
    if not callable(found.get(name)):
        has = among(name, [name for name, one in found.items() if isfunction(one)], "it has")
        raise click.UsageError(f"--host {text}: {path} has no function {name}; {has}")
    call: Callable[[Bus], object] = found[name]
    return call


# -- processes ------------------------------------------------------------------------------------

_SUBJECT: list[tuple[Subject, Account]] = []
"""What this worker runs, and the reference run."""


def _start(subject: Subject, reference: Account, dies_with_us: Callable[[], None]) -> None:
    # A worker waits for work for ever: the pipe it waits at is its own, too.
    dies_with_us()
    _SUBJECT.append((subject, reference))
    null = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null, 0)
    os.close(null)


def _try(world: World) -> Result:
    subject, reference = _SUBJECT[-1]
    return judge(reference, subject.run(world, reference), world)


def run_all(
    subject: Subject,
    reference: Account,
    worlds: Iterable[PlannedWorld],
    jobs: int,
    until: float,
    take_result: Callable[[PlannedWorld, Result], None],
) -> None:
    """Run a subject in one world after another, until a time is over.

    Args:
        subject: what is run.
        reference: its reference run.
        worlds: in the order in which they are tried.
        jobs: number of processes.
        until: instant of the wall clock after which none is begun.
        take_result: called with each world and what came of it, in their order.

    Raises:
        VbusError: a run cannot be made.
    """
    # Of `fork` every worker has the board's tables, and the program's, without reading them again.
    bare = msgspec.structs.replace(reference, seen=[], edges=[])
    pool = ProcessPoolExecutor(
        jobs, mp_context=get_context("fork"), initializer=_start,
        initargs=(subject, bare, end_with_parent(signal.SIGKILL)),
    )  # fmt: skip
    waiting: list[tuple[PlannedWorld, Future[Result]]] = []

    def take(left: int) -> None:
        while len(waiting) > left:
            one, future = waiting.pop(0)
            take_result(one, future.result())

    try:
        for one in worlds:
            if monotonic() >= until:
                break
            waiting.append((one, pool.submit(_try, one.world)))
            take(jobs * _AHEAD)
        take(0)
    except BrokenProcessPool:
        raise VbusError("a process of the campaign has died; its world is not known") from None
    finally:
        pool.shutdown(cancel_futures=True)


def difference(reference: Account, again: Account) -> str:
    """Say in what two runs in the same world differ; "" if they do not."""
    result: Any = judge(reference, again)
    if reference.cycles != again.cycles and not result.reason:
        return f"{again.cycles} bus cycles, and not {reference.cycles}"
    return str(result.reason)
