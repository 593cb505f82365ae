"""What the plug-in keeps for one test: its boards, what they saw, and what to tell if it fails."""

import re
import shlex
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from vbus import plugins
from vbus.board.board import Board
from vbus.board.build import build
from vbus.board.strobe_watch import missed_byte
from vbus.boardfile.sections import BoardFile, HostSection
from vbus.boardfile.source import Source
from vbus.campaign.account import Account, Witness
from vbus.campaign.world import REFERENCE, arm
from vbus.core.errors import ConfigError, VbusError
from vbus.core.runtime import private_runtime
from vbus.core.signals import Violation
from vbus.core.values.settings import among
from vbus.protocols.quantities import format_instant
from vbus.serve.in_process import connect_in_process
from vbus.serve.output_file import write_file
from vbus.serve.serving import link_of
from vbus.testing.boards import Variant, board_text, default_part, for_test, of_parts, typical_part
from vbus.testing.checks.around_chip import ChipBench, out_of_reset
from vbus.testing.interrupt import Interrupt
from vbus.testing.judge import CHOICES, FAIL, Judge, Judged, by_rule
from vbus.testing.limits import BUDGET, POLLING, UNBOUNDED, Limits
from vbus.testing.serving import ServedBoard
from vbus.testing.tested_board import TestedBoard

if TYPE_CHECKING:
    from vbus.testing.machine import TestedMachine
    from vbus.views.coverage.coverage import CoverageObserver

KEYWORDS: Final = ("board", "plant", "clock", "seed", "rate", "strict")
"""What may be said of a board: keywords of the marker, and of :meth:`Bench.make`."""
_NO_VARIANT: Final = Variant()
_USUAL: Final = Judge()


@dataclass(slots=True)
class FailureReport:
    """What a failing test tells of its boards.

    Attributes:
        lines: for the report.
        properties: for JUnit.
    """

    lines: list[str] = field(default_factory=list)
    properties: list[tuple[str, str]] = field(default_factory=list)

    def tell(self, name: str, value: object) -> None:
        """Tell something in a line that begins with its name, and as a property of that name."""
        self.lines.append(f"{name + ':':<8} {value}")
        self.properties.append((f"vbus.{name}", str(value)))


@dataclass(eq=False)
class Bench:
    """The boards of one test.

    Attributes:
        name: the test's id, as pytest takes it.
        keywords: keywords of the test's markers.
        folders: those that board files, programs and sources are looked for in.
        folder: makes the folder for files that stay.
        seed: for boards that say nothing else; None keeps the board file's.
        strict: whether a cycle that breaks a datasheet is lost, where a test says nothing else.
        waves: ``"never"``, ``"on-failure"`` or ``"always"``.
        judge: what a test is judged by that says nothing else.
        covered: whether what its hosts exercise is counted.
        variant: which one of a matrix the test is.
        scope: whether a test that fails leaves a page for a browser.
        chips: how the part numbers begin whose fixtures the test takes: they are on its board if
            it names none.
        witnessed: whether what becomes of its board is wanted; see :meth:`account`.

    Raises:
        VbusError: a keyword is unknown, or makes no sense.
    """

    name: str
    keywords: dict[str, Any]
    folders: Iterable[Path]
    folder: Callable[[], Path]
    seed: int | None = None
    strict: bool = False
    waves: str = "never"
    judge: Judge = _USUAL
    covered: bool = False
    variant: Variant = _NO_VARIANT
    scope: bool = True
    chips: Sequence[str] = ()
    witnessed: bool = False

    def __post_init__(self) -> None:
        keywords = self.keywords
        self.judge = self.judge.configured("vbus", keywords)
        of_test = ("budget", "golden", *CHOICES)
        self.keywords = {key: value for key, value in keywords.items() if key not in of_test}
        _check_keywords(self.keywords, ("accept", *of_test))
        self.folders = list(self.folders)
        self.named: list[Path] = []
        """Files that the test has named: programs, sources."""
        self.boards: list[TestedBoard] = []
        self._stack = ExitStack()
        self._failure: FailureReport | None = None
        self._main: TestedBoard | None = None
        self._machine: TestedMachine | None = None
        self._interrupt: Interrupt | None = None

    def limit(self, chip_time: int, cycles: int) -> None:
        """Let the test take no more chip time (ps) and bus cycles than this."""
        budget = self.judge.budget
        budget = replace(
            budget,
            chip_time=min(budget.chip_time, chip_time),
            cycles=min(budget.cycles, cycles),
            # In a campaign a hang is judged by chip time: no verdict may depend on wall time.
            polling=float("inf"),
        )
        self.judge = replace(self.judge, budget=budget)

    # -- boards -------------------------------------------------------------------------------

    def make(self, board: str | Path = "", **keywords: Any) -> TestedBoard:
        """Build one more board.

        Args:
            board: path of a board file, text of one, or a part number; "" for the marker's.
            keywords: :data:`KEYWORDS`, in place of the marker's.

        Raises:
            VbusError: the board, or a keyword, makes no sense.
        """
        _check_keywords(keywords)
        return self._make(board, {**self.keywords, **keywords}, _NO_VARIANT)

    def _make(self, board: str | Path, given: dict[str, Any], variant: Variant) -> TestedBoard:
        file, source, strict, budget = self._read(board, given, variant)
        if file.nodes:
            raise VbusError(
                f'{file.path}: this board has nodes: take the fixture "vbus_machine", which has all'
                " of them"
            )
        built = build(file, source)
        built.run_for(variant.world.ahead)
        made = TestedBoard(
            built, file, source, strict, budget, self.covered, recorded=not self.witnessed
        )
        if self.witnessed and self._main is None:
            made.witness = Witness(built, variant.world == REFERENCE)
        try:
            arm(built, variant.world)
        except ValueError as error:
            raise VbusError(f"{variant.world}: {error}") from None
        return self._take(made)

    def _take(self, made: TestedBoard) -> TestedBoard:
        if self.waves != "never":
            made.record_wave()
        self.boards.append(made)
        return made

    def _read(
        self, board: str | Path, given: dict[str, Any], variant: Variant
    ) -> tuple[BoardFile, Source, bool, Limits]:
        """Return a board file as this test runs it, its text, whether it is strict, its budget."""
        asked = board or given.get("board") or default_part()
        text, name = board_text(asked, self.folders, given.get("plant", ""), given.get("clock", ""))
        text = variant.of_board(text, name)
        rate = given.get("rate")
        if rate is not None and not (isinstance(rate, int | float) and rate > 0):
            raise VbusError(f"rate={rate!r}: it is chip seconds per second, more than 0")
        strict = bool(given.get("strict", self.strict))
        seed = given.get("seed", self.seed) if variant.seed is None else variant.seed
        file, source = variant.in_world(*for_test(text, name, seed, rate, strict))
        budget = self.judge.budget
        if rate is not None:  # chip time passes by itself
            chip_time = UNBOUNDED if budget.chip_time == BUDGET.chip_time else budget.chip_time
            polling = POLLING if budget.polling == BUDGET.polling else budget.polling
            budget = replace(budget, chip_time=chip_time, polling=polling)
        return file, source, strict, budget

    def machine(self) -> "TestedMachine":
        """Return the machine of the test's marker, built when first asked for.

        Raises:
            VbusError: the board has no nodes, is in real time, or makes no sense.
        """
        from vbus.testing.machine import TestedMachine

        if self._machine is None:
            read = self._read("", self.keywords, self.variant)
            self._machine = TestedMachine(*read, self.covered)
            self._stack.callback(self._machine.close)
            for tested in self._machine.tested:
                self._take(tested)
            self._machine.advance(self.variant.world.ahead)
        return self._machine

    def main(self, otherwise: str = "") -> TestedBoard:
        """Return the test's board, built when first asked for.

        ``otherwise`` is its part if the test's marker names no board.
        """
        if self._main is None:
            board = self.keywords.get("board") or self.variant.part
            if not board and self.of_chips:
                parts = [typical_part(plugins.family_of(start), start) for start in self.chips]
                look = self.keywords.get
                board = of_parts(parts, look("plant", ""), look("clock", ""))
            board = board or otherwise
            self._main = self._make(board, self.keywords, self.variant)
        return self._main

    @property
    def of_chips(self) -> bool:
        """Whether the test's board has the chips of several fixtures, because nothing is said."""
        named = self.keywords.get("board") or self.variant.part
        return len(self.chips) > 1 and not named

    def chip(self, start: str) -> ChipBench:
        """Return the first chip of a family on the test's board, out of its reset.

        A test that names no board gets one with a part of the family.

        Args:
            start: how a part number of the family begins.

        Raises:
            VbusError: the test's board has no such chip.
        """
        family = plugins.family_of(start)
        part = typical_part(family, start)
        tested = self.main(part)
        if tested.served is not None:
            raise VbusError(
                f"the board is served on {tested.address}, by vbus_pty: attach to that terminal,"
                " and take vbus_board to look at chips and plants"
            )
        board = tested.board
        cls = plugins.chip_of(family)
        kin = [chip for chip in board.chips if isinstance(chip, cls)]
        chip = next((chip for chip in kin if chip.part.startswith(start)), kin[0] if kin else None)
        if chip is None:
            have = ", ".join(f"{chip.name} = {chip.part}" for chip in board.chips)
            raise VbusError(
                f'board "{board.name}" has no {part} or kin; it has {have}. A test that names no'
                " board gets one with the chips of all fixtures among its arguments"
            )
        board.run_until(max(board.now, out_of_reset(chip, tested.file) + self.variant.world.ahead))
        bus = connect_in_process(board, chips=(chip.name,) if self.of_chips else ())
        return ChipBench.of(board, chip, bus, tested.clock)

    @property
    def begun(self) -> TestedBoard | None:
        """The test's board, if it has been asked for."""
        return self._main

    def of(self, board: Board) -> TestedBoard:
        """Return what belongs to a board of this test.

        Raises:
            VbusError: it was not made here.
        """
        found = next((tested for tested in self.boards if tested.board is board), None)
        if found is None:
            raise VbusError(f'board "{board.name}" was not made by a vbus fixture of this test')
        return found

    def find(self, name: str | Path) -> Path:
        """Return the path of a file beside the test, or relative to where pytest runs."""
        paths = (path for folder in self.folders if (path := folder / name).exists())
        self.named.append(next(paths, Path(name)))
        return self.named[-1]

    def find_file(self, name: str | Path) -> Path:
        """Return the path of a file that must be there.

        Raises:
            VbusError: it is not.
        """
        path = self.find(name)
        if not path.is_file():
            what = "is no file" if path.exists() else "is not there"
            raise VbusError(f"{name} {what}; looked for it in {', '.join(map(str, self.folders))}")
        return path

    def terminal(self) -> str:
        """Serve the test's board on a terminal of its own; return the terminal's path.

        Raises:
            VbusError: a host of this process is on the board already.
        """
        tested = self.main()
        if tested.served is None:
            if tested.board.ports:
                raise VbusError(
                    "vbus_pty: this test has a host on its board already (a chip's fixture, or a"
                    " bus); take vbus_board in its place, or attach that host to the terminal"
                )
            runtime = self._stack.enter_context(private_runtime())
            host = next(iter(tested.file.hosts), HostSection(transport=""))
            tested.address = str(runtime / "host")
            link = link_of(tested.file, host, f"pty:{tested.address}", host.protocol)
            served = ServedBoard(tested.board, [link], tested.file.board.stall)
            self._interrupt = self._stack.enter_context(Interrupt(tested.watch))
            self._stack.enter_context(served)
            tested.served = served
        return tested.address

    def let_interrupt(self, allowed: bool) -> None:
        """Say whether a host that hangs on a terminal may be interrupted: while a test runs."""
        if self._interrupt is not None:
            self._interrupt.allowed = allowed

    def relent(self) -> None:
        """The test is over: let its hosts put their machines in order."""
        for tested in self.boards:
            judged = self.judged(tested)
            tested.before_end = (len(judged.failing), len(judged.after_fault))
            tested.call(tested.watch.relent)

    def close(self) -> None:
        """Stop what runs; write the waveforms that are wanted of every test.

        Raises:
            VbusError: a thread that hung on a terminal goes on.
        """
        self._stack.close()
        for tested in self.boards:
            tested.served = None
            if self.waves == "always" and self._failure is None:
                self._keep(tested, "vcd", tested.wave().encode())
        if self._interrupt is not None:
            self._interrupt.check_threads()

    def account(self) -> Account | None:
        """Return what became of the test's board, when the test is over; None: it has none."""
        tested = self._main
        if tested is None or tested.witness is None:
            return None
        # Motors come to rest in time that is not the host's.
        with tested.watch.excused():
            return tested.witness.account(
                stuck=tested.slow or tested.watch.stuck, slow=tested.watch.slow or bool(tested.slow)
            )

    def coverages(self) -> "list[CoverageObserver]":
        """Return what has counted what the hosts of this test exercise."""
        return [tested.coverage for tested in self.boards if tested.coverage is not None]

    # -- verdict ------------------------------------------------------------------------------

    def complaints(self) -> list[str]:
        """Return why a test fails that had nothing to complain about itself."""
        lines = []
        for tested in self.boards:
            name = tested.board.name
            if tested.watch.stuck:
                lines += [tested.watch.verdict("the host hung"), *tested.watch.details]
            lines += [
                f'fault {armed} of board "{name}" never fired: the test did not test it;'
                " look at its trigger, or clear() it"
                for armed in tested.faults()[self.variant.world.arming() is not None :]
                if not armed.fired and not armed.cleared
            ]
            lines += self._broken(tested, (0, 0))
        return lines

    def late_complaints(self, passed: bool) -> list[str]:
        """Return which violations there were since :meth:`relent`.

        Of a test that has passed, what its hosts have left counts, too.
        """
        lines = []
        for tested in self.boards:
            lines += self._broken(tested, tested.before_end)
            if passed and (tested.strict or self.judge.violations == FAIL):
                lines += by_rule(self._left(tested).failing)
        return lines

    def _broken(self, tested: TestedBoard, before: tuple[int, int]) -> list[str]:
        """Return the violations that fail a test, but for as many as were there before."""
        failing, after_fault = before
        lines = []
        judged = self.judged(tested)
        if tested.strict or self.judge.violations == FAIL:
            lines += by_rule(judged.failing[failing:])
            lines += tested.board.hints(judged.failing[failing:])
        if self.judge.after_fault == FAIL:
            lines += by_rule(judged.after_fault[after_fault:], ", after a fault")
        return lines

    def judged(self, tested: TestedBoard) -> Judged:
        """Return the violations of a board up to now, sorted; each is counted once as accepted."""
        tested.call(tested.board.catch_up)
        watch = tested.watch
        new = watch.violations[tested.sorted :]
        tested.sorted += len(new)
        self.judge.sort(new, watch.faulted, tested.judged)
        return tested.judged

    @property
    def reported(self) -> bool:
        """Whether a failure has been reported."""
        return self._failure is not None

    def failure_report(self) -> FailureReport:
        """Keep the recordings of a failing test and return what to tell; the same when repeated."""
        if self._failure is None:
            self._failure = FailureReport()
            for tested in self.boards:
                self._report(tested, self._failure)
            again = f"pytest {shlex.quote(self.name)}"
            again += "" if self.seed is None else f" --vbus-seed={self.seed}"
            again += " --vbus-strict" if self.strict else ""
            self._failure.tell("again", again)
        return self._failure

    def _report(self, tested: TestedBoard, report: FailureReport) -> None:
        board = tested.board
        faults = tested.faults()
        lines = tested.call(lambda: tested.watch.lines)
        journal = self._keep(tested, "vbj", tested.journal())
        if self.variant.world != REFERENCE and tested is self._main:
            report.tell("under", self.variant.world.sentence())
        report.lines += [
            f'board "{board.name}" at {format_instant(board.now)}, seed {board.seed},'
            f" {board.policy}; {tested.watch.cycles} bus cycles",
            *(f"    {line}" for line in lines),
            *self._violations(tested),
            *_axes(tested),
        ]
        report.lines += ["faults:", *(f"    {armed}" for armed in faults)] if faults else []
        report.properties += [("vbus.board", board.name), ("vbus.seed", str(board.seed))]
        report.tell("journal", journal)
        report.tell("replay", f"vbus replay {shlex.quote(str(journal))}")
        report.properties += [
            ("vbus.transcript", "\n".join(lines)),
            ("vbus.violations", "\n".join(f"{v.rule} {v.detail}" for v in tested.watch.violations)),
            ("vbus.faults", "\n".join(str(armed) for armed in faults)),
        ]
        if self.scope:
            self._keep_page(tested, report)
        wave = tested.wave()
        if wave:
            report.tell("wave", self._keep(tested, "vcd", wave.encode()))

    def _keep_page(self, tested: TestedBoard, report: FailureReport) -> None:
        try:
            report.tell("scope", self._keep(tested, "html", tested.page()))
        except Exception as error:  # the journal tells more than what stops it from being played
            report.lines.append(f"scope:   no page: {type(error).__name__}: {error}")

    def _violations(self, tested: TestedBoard) -> Iterator[str]:
        judged = self.judged(tested)
        failing = [*judged.failing, *self._left(tested).failing]
        yield f"violations: {len(failing) or 'none'}"
        yield from (f"    {line}" for line in by_rule(failing))
        yield from (f"    {line}" for line in tested.board.hints(judged.failing))
        by_strobe = [missed_byte(chip, *rest) for chip, rest in tested.board.missed.items()]
        yield from (f"missed: {line}" for line in dict.fromkeys([*tested.missed, *by_strobe]))
        if judged.after_fault:
            yield f"violations after a fault: {len(judged.after_fault)}"
            yield from (f"    {line}" for line in by_rule(judged.after_fault))
        reasons = Counter((v.chip, v.rule, reason) for v, reason in judged.accepted)
        for (chip, rule, reason), count in reasons.items():
            yield f"accepted:  {chip} broke {rule} {count} times: {reason}"
        notes = self._notes(tested)
        if notes:
            yield f"notes: {len(notes)}"
            yield from (f"    {line}" for line in by_rule(notes, verb="notes"))
        if tested.watch.no_effect.counts:
            yield f"without effect: {tested.watch.no_effect.text()}"

    def _left(self, tested: TestedBoard) -> Judged:
        judged = Judged()
        self.judge.sort(tested.call(tested.board.left_over), tested.watch.faulted, judged)
        return judged

    def _notes(self, tested: TestedBoard) -> list[Violation]:
        return [*self.judged(tested).notes, *self._left(tested).notes]

    def notes(self) -> list[tuple[str, str]]:
        """Return each rule that is noted, and what it says first: of a test that has passed."""
        found = [note for tested in self.boards for note in self._notes(tested)]
        return [(note.rule, f"{note.chip}: {note.detail}") for note in found]

    def _keep(self, tested: TestedBoard, suffix: str, content: bytes) -> Path:
        number = self.boards.index(tested)
        test = re.sub(r"[^\w.-]+", "_", self.name.rpartition("/")[2])[-100:]
        path = self.folder() / f"{test}{f'-{number + 1}' if number else ''}.{suffix}"
        write_file(path, content)
        return path


def _axes(tested: TestedBoard) -> list[str]:
    try:
        return [f"axis {line}" for line in tested.axes()]
    except Exception as error:  # the journal tells more than what stops it from being played
        return [f"axes:    not known: {type(error).__name__}: {error}"]


def _check_keywords(keywords: Iterable[str], also: Iterable[str] = ()) -> None:
    for key in keywords:
        if key not in KEYWORDS:
            allowed = among(key, (*KEYWORDS, *also), "allowed are")
            raise ConfigError(f"vbus: unknown keyword {key!r}; {allowed}")
