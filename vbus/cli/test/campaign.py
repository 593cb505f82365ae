"""``vbus campaign``: a program again and again, each time with one thing broken around it."""

import hashlib
import os
import shlex
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from vbus.cli.output import complain, refuse_given
from vbus.core.errors import ConfigError, VbusError, value_errors

if TYPE_CHECKING:
    from vbus.board.board import Board
    from vbus.boardfile.sections import BoardFile
    from vbus.boardfile.source import Source
    from vbus.campaign.account import Account
    from vbus.campaign.plan import PlannedWorld
    from vbus.campaign.verdict import Result
    from vbus.campaign.world import World
    from vbus.cli.hosted.campaign_runs import FunctionSubject, ProgramSubject, Subject
    from vbus.serve.output_file import OutputFile

_OF_PROGRAM: Final = ("avr", "cpu", "pinmap", "failed")
"""Options that say what a PROGRAM is."""
_TOLD: Final = 20
"""Outcomes that are listed one by one; --all lists all of them."""
_OF_CAMPAIGN: Final = (
    "only", "phases", "longest", "worlds", "seed", "jobs", "json", "junit", "page", "baseline",
    "every",
)  # fmt: skip
"""Options that a single run has no use for."""


def _minutes(ctx: click.Context, param: click.Parameter, value: str | None) -> int | None:
    """Return a time of the wall clock, which may be in minutes and hours (ps)."""
    from vbus.protocols.quantities import WALL_UNITS, parse_duration

    with value_errors(click.BadParameter):
        length = value if value is None else parse_duration(value, WALL_UNITS)
    if length == 0:
        raise click.BadParameter("no run ends in no time; write one such as 30s, 5m or 2h")
    return length


@click.command("campaign", context_settings={"ignore_unknown_options": True})
@click.option("--board", metavar="FILE", help="The board file; with pytest, tests have theirs.")
@click.option("--host", metavar="FILE.py:NAME", help="A function that is given a bus, no PROGRAM.")
@click.option("--avr", metavar="SPEC", help="PROGRAM is AVR firmware, as in vbus exec.")
@click.option("--cpu", metavar="SPEC", help="PROGRAM is a firmware image, as in vbus exec.")
@click.option("--pinmap", metavar="NAME", help="Which pin map of the board file.")
@click.option("--failed", metavar="TEXT", help="PROGRAM fails if it prints this; firmware.")
@click.option("--only", metavar="DIMENSION,...", help="Try these dimensions alone.")
@click.option("--phases", type=click.IntRange(2, 4096), help="How many places in a sample (16).")
@click.option("--for", "longest", metavar="TIME", callback=_minutes, help="Stop after so long, 5m.")
@click.option("--worlds", type=click.IntRange(1), metavar="N", help="Stop after so many worlds.")
@click.option("--seed", type=click.IntRange(0), default=0, help="Which of a group come first.")
@click.option("-j", "--jobs", type=click.IntRange(1), help="Processes; all processors without it.")
@click.option("--json", metavar="FILE", help="Keep results in FILE, and go on from them.")
@click.option("--junit", metavar="FILE", help="Write them as JUnit does.")
@click.option("--page", metavar="FILE", help="Write a page for a browser.")
@click.option("--baseline", metavar="FILE", help="A file of --json: fail for what it has not.")
@click.option("--world", metavar="WORLD", help="Run once, in this world; --journal as in exec.")
@click.option("--journal", metavar="FILE", help="With --world: write every call of the host.")
@click.option("--all", "every", is_flag=True, help="List every outcome; else 20.")
@click.argument("program", nargs=-1, type=click.UNPROCESSED)
def command(
    board: str | None, host: str | None, avr: str | None, cpu: str | None,
    pinmap: str | None, failed: str | None, only: str | None,
    phases: int | None, longest: int | None, worlds: int | None, seed: int, jobs: int | None,
    json: str | None, junit: str | None, page: str | None, baseline: str | None,
    world: str | None, journal: str | None, every: bool, program: tuple[str, ...],
) -> int:  # fmt: skip
    """Run a program in many worlds, in each of which one thing is broken; tell what it notices.

    \b
    vbus campaign --board board.toml -- ./host
    vbus campaign --board board.toml --for 5m --json campaign.json -- ./host
    vbus campaign --board board.toml --host driver.py:move      a function, in this process
    vbus campaign --for 5m -- pytest tests                      pytest --vbus-campaign=5m tests
    vbus campaign --board board.toml --only phase --phases 64 -- ./host
    vbus campaign --board board.toml --world cycle:x.17:flip3 -- ./host    one run, in full

    Dimensions: cycle (a bit of a bus cycle inverted, its strobe lost or doubled, its answer late,
    busy as long as it may be), interrupt (an output one cycle early or late, or in another place
    of a loop that waits), phase (of the chips' sample), specimen (extremes of the manual), floating
    (data lines keep nothing), fault (each that "vbus fault list" has, once), threads (of a program
    with a card, in another order). The exit code is 1 if nothing was tried, or a silent outcome is
    not in the baseline; without a baseline pytest ends with that of the tests.
    """
    from vbus.campaign.report import check_files
    from vbus.campaign.world import PHASE, read_dimensions

    if world is not None:
        refuse_given(_OF_CAMPAIGN, "goes with a campaign, and --world is one run")
    tests = _tests(program)
    if board is None:
        if tests is None:
            raise click.UsageError("name a board with --board, or run: vbus campaign -- pytest ...")
        return _pytest(tests, longest, worlds)
    if tests is not None:
        raise click.UsageError("--board does not go with pytest: each test says its board")
    if (host is None) == (not program):
        raise click.UsageError("name either a PROGRAM or a function with --host")
    files = {"json": json, "junit": junit, "page": page}
    if world is None:
        refuse_given(("journal",), "goes with --world: a campaign is many runs")
    with value_errors(click.BadParameter, param_hint="--only"):
        chosen = read_dimensions(only)
    if phases is not None and PHASE not in chosen:
        raise click.UsageError("--phases is for the dimension phase, which --only leaves out")
    with value_errors(click.UsageError):
        named = (path for word in (board, host or "", *program) for path in _files_of(word))
        check_files(files.values(), [baseline, *named])

    def tried(subject: "Subject", file: "BoardFile", source: "Source") -> int:
        campaign = CampaignRun(
            subject, file, source, chosen, phases or 0, seed,
            jobs or os.cpu_count() or 1, longest, worlds, _words(board, host, program),
        )  # fmt: skip
        return campaign.run(files, baseline, every)

    if host is not None:
        from vbus.board.config import read_board_file
        from vbus.cli.hosted.campaign_runs import FunctionSubject, function_of

        refuse_given([*_OF_PROGRAM, "journal"], "goes with a PROGRAM")
        file, source = read_board_file(board)
        function = FunctionSubject(file, source, function_of(host))
        if world is not None:
            return _replay_function(world, function)
        return tried(function, file, source)
    from vbus.cli.hosted.campaign_runs import ProgramSubject
    from vbus.cli.run.exec import program_of

    hosted = program_of(board, program, pinmap, avr, cpu)
    subject = ProgramSubject(hosted, failed or "")
    if world is not None:
        return _replay(world, subject, journal)
    return tried(subject, hosted.file, hosted.source)


def _tests(program: tuple[str, ...]) -> tuple[str, ...] | None:
    """Return the words after pytest; None: the program is another one."""
    words = program[2:] if program[1:2] == ("-m",) else program
    if not words or Path(words[0]).name not in ("pytest", "py.test"):
        return None
    return words[1:]


def _pytest(tests: tuple[str, ...], longest: int | None, worlds: int | None) -> int:
    """Let pytest make the campaign."""
    from vbus.core.kernel import SECOND

    given = click.get_current_context().params
    refuse_given(["host", *_OF_PROGRAM, "journal"], "does not go with pytest; its tests say it")
    if longest is not None and worlds is not None:
        raise click.UsageError("with pytest write either --for or --worlds")
    words = [f"--vbus-world={given['world']}"] if given["world"] else []
    if not words:
        budget = f"={longest / SECOND:f}s" if longest else f"={worlds}" if worlds else ""
        words = [f"--vbus-campaign{budget}"]
    for name in ("only", "phases", "seed", "json", "junit", "page", "baseline"):
        words += [f"--vbus-campaign-{name}={given[name]}"] if given[name] else []
    words += ["--vbus-campaign-all"] if given["every"] else []
    if given["jobs"] is not None:
        if find_spec("xdist") is None:
            raise click.UsageError("-j with pytest needs pytest-xdist: pip install pytest-xdist")
        words += ["-n", str(given["jobs"])]
    return subprocess.run([sys.executable, "-m", "pytest", *words, *tests]).returncode


def _words(board: str, host: str | None, program: tuple[str, ...]) -> list[str]:
    """Return the words after ``vbus campaign`` by which one world is run, but for the world."""
    words = ["--board", board]
    if host:
        return [*words, "--host", host]
    given = click.get_current_context().params
    for name in _OF_PROGRAM:
        words += [f"--{name}", given[name]] if given[name] else []
    return [*words, "--", *program]


def _digest(text: str, words: list[str], reference: "Account") -> str:
    """Return what tells whether results are of this board and this program."""
    from msgspec.json import encode
    from msgspec.structs import replace

    import vbus

    # What it prints may have a number of a process in it, which says nothing of the program.
    seen = encode(replace(reference, output="", errors=""))
    whole = hashlib.sha256(f"{vbus.__version__}\0{text}\0{shlex.join(words)}\0".encode() + seen)
    for path in sorted({path for word in words for path in _files_of(word)}):
        whole.update(path.read_bytes())
    return whole.hexdigest()


def _files_of(word: str) -> Iterator[Path]:
    """Give the files that a word names, or a command in it: script, image or configuration.

    Files in Python beside a script are modules of it.
    """
    try:
        names = [word, word.rpartition(":")[0], *shlex.split(word)]
    except ValueError:  # a quote without another one
        names = [word]
    for path in map(Path, filter(os.path.isfile, names)):
        yield path
        if path.suffix == ".py":
            yield from path.parent.glob("*.py")


def _world(name: str) -> "World":
    """Return the world of a name."""
    from vbus.campaign.world import read_world

    with value_errors(click.BadParameter, param_hint="--world"):
        return read_world(name)


def _replay(name: str, subject: "ProgramSubject", journal: str | None) -> int:
    """Run a program in one world; say what it was and what came of it."""
    from vbus.campaign.world import REFERENCE, begin
    from vbus.cli.hosted.campaign_runs import in_world, limits_of
    from vbus.cli.hosted.program import run_beside
    from vbus.serve.serving import recorded

    world = _world(name)
    program = in_world(subject.program, world)
    file = recorded(program.file, {"journal": journal} if journal else {}, "")
    # With a link broken no two runs are alike, so it has no verdict.
    reference = None if world.of_host and not world.order else subject.run(REFERENCE, None)

    def prepare(board: "Board") -> None:
        with value_errors(click.BadParameter, param_hint="--world"):
            begin(board, world)
        boards.append(board)
        complain(f"world: {world.sentence()}")

    boards: list[Board] = []
    limit = limits_of(reference)[0]
    ran = run_beside(replace(program, file=file), limit=limit, prepare=prepare, watched=True)
    for line in (*ran.hangs, *ran.findings.lines(), *ran.outcome.lines()):
        complain(line)
    if reference is None:
        for fault in boards[0].faults.unfired():
            complain(f"nothing was broken: the run ended before {fault.when.text}")
        return ran.ended.code
    run = subject.run(world, reference)
    _tell(reference, run, world)
    return run.code


def _tell(reference: "Account", run: "Account", world: "World") -> None:
    """Say what a run in a world came to, as its campaign does."""
    from vbus.campaign.verdict import judge

    result = judge(reference, run, world)
    complain(f"{result.verdict}: {result.reason}" if result.reason else result.verdict)
    for finding in result.findings:
        complain(f"finding: {finding}")


def _right(reference: "Account") -> "Account":
    """Return a reference run that has not failed.

    Raises:
        VbusError: it has; what the host said is shown.
    """

    if not reference.stuck and not reference.code:
        return reference
    sys.stdout.write(reference.output)
    sys.stderr.write(reference.errors)
    why = reference.stuck or f"it ends with exit code {reference.code}"
    raise VbusError(f"the reference run, with nothing broken, fails: {why}")


def _replay_function(name: str, function: "FunctionSubject") -> int:
    """Call a function in one world; say what it was and what came of it."""
    from vbus.campaign.world import REFERENCE

    world = _world(name)
    reference = _right(function.run(REFERENCE, None))
    run = function.run(world, reference)
    sys.stdout.write(run.output)
    sys.stderr.write(run.errors)
    complain(f"world: {world.sentence()}")
    _tell(reference, run, world)
    return run.code


@dataclass(frozen=True)
class CampaignRun:
    """A campaign as the command line has it.

    Attributes:
        subject: what is run.
        file: its board.
        source: the same as text.
        only: dimensions.
        phases: how many phases; 0: as many as usual.
        seed: of the order.
        jobs: number of processes.
        longest: how long it may take (ps); None: until all is tried.
        most: how many worlds; None: all.
        words: what runs one world.
    """

    subject: "Subject"
    file: "BoardFile"
    source: "Source"
    only: tuple[str, ...]
    phases: int
    seed: int
    jobs: int
    longest: int | None
    most: int | None
    words: list[str]

    def line(self, one: "PlannedWorld") -> str:
        """Return the line that runs a world again."""
        return shlex.join(["vbus", "campaign", "--world", str(one.world), *self.words])

    def run(self, files: Mapping[str, str | None], baseline: str | None, every: bool) -> int:
        """Run it, and write what came of it into files that are its own from before the first run.

        Args:
            files: names of files, by what they are; None: there is no such file.
            baseline: a file whose silent outcomes are known.
            every: whether all outcomes are listed.

        Raises:
            VbusError: the reference run fails, or does not repeat; a file cannot be written.
        """
        from vbus.serve.output_file import OutputFile

        with ExitStack() as stack:
            claimed = {
                kind: stack.enter_context(closing(OutputFile(name)))
                for kind, name in files.items()
                if name
            }
            return self._run(claimed, baseline, every)

    def _run(self, files: "dict[str, OutputFile]", baseline: str | None, every: bool) -> int:
        from vbus.board.build import build
        from vbus.campaign import report
        from vbus.campaign.plan import PHASES, plan
        from vbus.campaign.verdict import Campaign, judge
        from vbus.campaign.world import REFERENCE
        from vbus.cli.hosted.campaign_runs import run_all
        from vbus.core.kernel import SECOND
        from vbus.core.wall_clock import monotonic

        if self.file.board.time == "realtime":
            raise ConfigError(
                f"{self.file.path}: in real time no two runs are alike; the board must be lockstep"
                " or slaved"
            )
        json = files.get("json")
        known = report.read_baseline(baseline) if baseline else None
        begun = monotonic()
        until = begun + self.longest / SECOND if self.longest else float("inf")
        reference = self._reference(self.subject.run(REFERENCE, None))
        board = build(self.file, self.source)
        planned = plan(reference, self.file, board, self.seed, self.only, self.phases or PHASES)
        saved = report.read_saved(json.path) if json else report.Saved()
        wanted = planned.worlds[: self.most]
        before = saved.of(_digest(self.source.text, self.words, reference))
        left = [one for one in wanted if one.name not in before]
        stored = len(saved.results)

        def take(one: "PlannedWorld", result: "Result") -> None:
            saved.take(one, result, json.write if json else None)

        def run(world: "World") -> "Result":
            return judge(reference, self.subject.run(world, reference), world)

        stopped = False
        try:
            # Ctrl-C ends the workers, too: what has come until then is printed and stored.
            run_all(self.subject, reference, left, self.jobs, until, take)
        except KeyboardInterrupt:
            stopped = True
        spent = monotonic() - begun
        names = [one.name for one in wanted]
        found = {name: saved.results[name] for name in names if name in saved.results}
        campaign = Campaign(planned, found)
        if not stopped and monotonic() < until:
            campaign = campaign.with_least(run, lambda: monotonic() < until)
            saved.results |= {one.planned.name: one.result for one in campaign.tried}
        new = campaign.new(known or ())
        into = {kind: file.write for kind, file in files.items()}
        subject = shlex.join(["vbus", "campaign", *self.words])
        report.write(campaign, saved, new, subject, self.line, into)
        for line in report.lines(campaign, known, self.line, None if every else _TOLD):
            click.echo(line)
        made = len(saved.results) - stored
        pace = f"{made / max(spent, 1e-9):.1f} runs/s, {self.jobs} processes"
        complain(f"{made} runs in {spent:.1f} s: {pace}")
        if stopped:
            again = f"; the same command goes on from {json.path}" if json else ""
            complain(f"stopped before the end{again}")
            return 130
        if not campaign.tried:
            late = monotonic() >= until
            why = "--for was over after the reference runs" if late else "the machine was too slow"
            raise VbusError(f"no world was tried: {why if planned.worlds else 'none applies here'}")
        return 1 if new else 0

    def _reference(self, reference: "Account") -> "Account":
        from vbus.campaign.world import REFERENCE
        from vbus.cli.hosted.campaign_runs import difference

        # With the bounds of a run in a world: bounds that end it would end every world.
        unlike = difference(_right(reference), self.subject.run(REFERENCE, reference))
        if unlike:
            raise VbusError(
                f"two runs with nothing broken differ: {unlike}; a campaign compares runs, so the"
                " program must do the same each time (no wall clock, no random numbers)"
            )
        return reference
