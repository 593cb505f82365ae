"""``vbus campaign``: a program again and again, each time with one thing broken around it."""

import hashlib
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from vbus.cli.output import complain, duration

if TYPE_CHECKING:
    from vbus.boardfile.sections import BoardFile
    from vbus.boardfile.source import Source
    from vbus.campaign.account import Account
    from vbus.campaign.plan import PlannedWorld
    from vbus.campaign.verdict import Result
    from vbus.campaign.world import World
    from vbus.cli.hosted.campaign_runs import FunctionSubject, Subject
    from vbus.cli.hosted.program import HostedProgram
    from vbus.serve.output_file import OutputFile

_MINUTES: Final = re.compile(r"\s*(\d+)\s*(m|min|h)\s*")
_TOLD: Final = 20
"""Outcomes that are listed one by one; --all lists all of them."""


def _minutes(ctx: click.Context, param: click.Parameter, value: str | None) -> int | None:
    """Return a time of the wall clock, which may be in minutes and hours (ps)."""
    from vbus.core.kernel import SECOND

    found = _MINUTES.fullmatch(value or "")
    if found:
        return int(found[1]) * (3600 if found[2] == "h" else 60) * SECOND
    length: int | None = duration(ctx, param, value)
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
@click.option("--all", "every", is_flag=True, help="Tell every outcome, not 20.")
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
    busy as long as it may be), interrupt (an output one cycle early or late), phase (of the chips'
    sample), specimen (extremes of the manual), floating (data lines keep nothing), fault (each
    that "vbus fault list" has, once), threads (of a program with a card, in another order). The
    exit code is 1 if a silent outcome is not in the baseline; without one that of pytest is that
    of the tests.
    """
    from vbus.campaign.world import read_dimensions

    if board is None:
        return _pytest(program, longest, worlds)
    if (host is None) == (not program):
        raise click.UsageError("name either a PROGRAM or a function with --host")
    if journal is not None and world is None:
        raise click.UsageError("--journal goes with --world: a campaign is many runs")
    files = {"json": json, "junit": junit, "page": page}
    for name, value in files.items():
        if value is not None and world is not None:
            raise click.UsageError(f"--{name} goes with a campaign, and --world is one run")
    try:
        chosen = read_dimensions(only)
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint="--only") from None

    def tried(subject: "Subject", file: "BoardFile", source: "Source") -> int:
        campaign = CampaignRun(
            subject, file, source, chosen, phases or 0, seed,
            jobs or os.cpu_count() or 1, longest, worlds, _words(board, host, program),
            _digest(source.text, (*program, failed or "", (host or "").rpartition(":")[0])),
        )  # fmt: skip
        return campaign.run(files, baseline, every)

    if host is not None:
        from vbus.board.config import read_board_file
        from vbus.cli.hosted.campaign_runs import FunctionSubject, function_of

        for option, value in (
            ("--avr", avr),
            ("--cpu", cpu),
            ("--pinmap", pinmap),
            ("--failed", failed),
            ("--journal", journal),
        ):
            if value is not None:
                raise click.UsageError(f"{option} goes with a PROGRAM")
        file, source = read_board_file(board)
        function = FunctionSubject(file, source, function_of(host))
        if world is not None:
            return _replay_function(world, function)
        return tried(function, file, source)
    from vbus.cli.hosted.campaign_runs import ProgramSubject
    from vbus.cli.run.exec import program_of

    hosted = program_of(board, program, pinmap, avr, cpu)
    if world is not None:
        return _replay(world, hosted, journal)
    return tried(ProgramSubject(hosted, failed or ""), hosted.file, hosted.source)


def _pytest(program: tuple[str, ...], longest: int | None, worlds: int | None) -> int:
    """Let pytest make the campaign."""
    from vbus.core.kernel import SECOND

    if program[:1] != ("pytest",):
        raise click.UsageError("name a board with --board, or run: vbus campaign -- pytest ...")
    given = click.get_current_context().params
    for name in ("host", "avr", "cpu", "pinmap", "failed", "journal"):
        if given[name] is not None:
            raise click.UsageError(f"--{name} does not go with pytest; its tests say it")
    if longest is not None and worlds is not None:
        raise click.UsageError("with pytest write either --for or --worlds")
    words = [f"--vbus-world={given['world']}"] if given["world"] else []
    if not words:
        budget = f"={longest / SECOND:g}s" if longest else f"={worlds}" if worlds else ""
        words = [f"--vbus-campaign{budget}"]
    for name in ("only", "phases", "seed", "json", "junit", "page", "baseline"):
        words += [f"--vbus-campaign-{name}={given[name]}"] if given[name] else []
    words += ["--vbus-campaign-all"] if given["every"] else []
    if given["jobs"] is not None:
        if find_spec("xdist") is None:
            raise click.UsageError("-j with pytest needs pytest-xdist: pip install pytest-xdist")
        words += ["-n", str(given["jobs"])]
    return subprocess.run([sys.executable, "-m", "pytest", *words, *program[1:]]).returncode


def _words(board: str, host: str | None, program: tuple[str, ...]) -> list[str]:
    """Return the words after ``vbus campaign`` by which one world is run, but for the world."""
    words = ["--board", board]
    if host:
        return [*words, "--host", host]
    given = click.get_current_context().params
    for name in ("avr", "cpu", "pinmap", "failed"):
        words += [f"--{name}", given[name]] if given[name] else []
    return [*words, "--", *program]


def _digest(text: str, program: tuple[str, ...]) -> str:
    """Return what tells whether results are of this board and this program."""
    whole = hashlib.sha256(text.encode())
    # A word that names a file is a part of the program: its script, image or configuration.
    for word in program:
        whole.update(word.encode() + b"\0")
        if Path(word).is_file():
            whole.update(Path(word).read_bytes())
    return whole.hexdigest()


def _world(name: str) -> "World":
    """Return the world of a name."""
    from vbus.campaign.world import read_world

    try:
        return read_world(name)
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint="--world") from None


def _replay(name: str, program: "HostedProgram", journal: str | None) -> int:
    """Run a program in one world; say what it was and what came of it."""
    from vbus.board.board import Board
    from vbus.campaign.world import begin
    from vbus.cli.hosted.campaign_runs import in_world, limits_of
    from vbus.cli.hosted.program import run_beside
    from vbus.cli.outcome import AxisOutcomes
    from vbus.serve.serving import recorded

    world = _world(name)
    program = in_world(program, world)
    file = recorded(program.file, {"journal": journal} if journal else {}, "")

    def prepare(board: Board) -> None:
        outcomes.append(AxisOutcomes(board))
        outcomes[0].watch()
        try:
            begin(board, world)
        except ValueError as error:
            raise click.BadParameter(str(error), param_hint="--world") from None

    outcomes: list[AxisOutcomes] = []
    complain(f"world: {world.sentence()}")
    ran = run_beside(replace(program, file=file), limit=limits_of(None)[0], prepare=prepare)
    outcomes[0].look()
    for line in (*ran.hangs, *ran.findings.lines(), *outcomes[0].lines()):
        complain(line)
    return ran.ended.code


def _replay_function(name: str, function: "FunctionSubject") -> int:
    """Call a function in one world; say what it was and what came of it."""
    from vbus.campaign.verdict import judge
    from vbus.campaign.world import REFERENCE

    world = _world(name)
    reference = function.run(REFERENCE, None)
    run = function.run(world, reference)
    result = judge(reference, run, world)
    sys.stdout.write(run.output)
    sys.stderr.write(run.errors)
    complain(f"world: {world.sentence()}")
    complain(f"{result.verdict}: {result.reason}" if result.reason else result.verdict)
    for finding in result.findings:
        complain(f"finding: {finding}")
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
        digest: of board and program.
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
    digest: str

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
        from vbus.campaign.verdict import Campaign
        from vbus.campaign.world import REFERENCE
        from vbus.cli.hosted.campaign_runs import run_all
        from vbus.core.errors import ConfigError
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
        before = saved.of(self.digest)
        left = [one for one in wanted if one.name not in before]
        stored = len(saved.results)

        def take(world: "World", result: "Result") -> None:
            saved.take(str(world), result, json.write if json else None)

        stopped = False
        try:
            # Ctrl-C ends the workers, too: what has come until then is told and stored.
            run_all(self.subject, reference, left, self.jobs, until, take)
        except KeyboardInterrupt:
            stopped = True
        spent = monotonic() - begun
        names = [one.name for one in wanted]
        found = {name: saved.results[name] for name in names if name in saved.results}
        campaign = Campaign(planned, found)
        new = campaign.new(known or ())
        into = {kind: file.write for kind, file in files.items()}
        report.write(campaign, saved, new, shlex.join(self.words), self.line, into)
        for line in report.lines(campaign, known, self.line, None if every else _TOLD):
            click.echo(line)
        made = len(saved.results) - stored
        pace = f"{made / max(spent, 1e-9):.1f} runs/s, {self.jobs} processes"
        complain(f"{made} runs in {spent:.1f} s: {pace}")
        if stopped:
            again = f"; the same command goes on from {json.path}" if json else ""
            complain(f"stopped before the end{again}")
            return 130
        return 1 if new else 0

    def _reference(self, reference: "Account") -> "Account":
        from vbus.campaign.world import REFERENCE
        from vbus.cli.hosted.campaign_runs import difference
        from vbus.core.errors import VbusError

        if reference.stuck or reference.code:
            sys.stdout.write(reference.output)
            sys.stderr.write(reference.errors)
            why = reference.stuck or f"it ends with exit code {reference.code}"
            raise VbusError(f"the reference run, with nothing broken, fails: {why}")
        # With the bounds of a run in a world: bounds that end it would end every world.
        unlike = difference(reference, self.subject.run(REFERENCE, reference))
        if unlike:
            raise VbusError(
                f"two runs with nothing broken differ: {unlike}; a campaign compares runs, so the"
                " program must do the same each time (no wall clock, no random numbers)"
            )
        return reference
