"""What the plug-in keeps for one test: its boards, what they saw, and what to tell if it fails."""

import io
import re
import shlex
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, TextIO, TypeVar

from vbus.board.board import Board
from vbus.board.build import build, card_of, pin_map_of
from vbus.board.sections import BoardFile, HostSection
from vbus.board.source import Source
from vbus.errors import ConfigError, VbusError
from vbus.kernel import NEVER
from vbus.protocols.quantities import format_instant
from vbus.server.server import LinkSpec
from vbus.testing.boards import board_text, default_part, for_test
from vbus.testing.clock import BoardClock
from vbus.testing.limits import Limits, Watch
from vbus.testing.serving import ServedBoard, private_runtime
from vbus.trace.journal.journal import Journal

_T = TypeVar("_T")
WISHES: Final = ("board", "plant", "clock", "seed", "rate", "strict")
"""What may be said of a board: keywords of the marker, and of :meth:`Bench.make`."""
_BOUNDLESS: Final = Limits(cycles=1 << 62, chip_time=NEVER)


@dataclass(slots=True)
class Told:
    """What a failing test tells of its boards.

    Attributes:
        lines: for the report.
        properties: for JUnit.
    """

    lines: list[str] = field(default_factory=list)
    properties: list[tuple[str, str]] = field(default_factory=list)


class Fitted:
    """One board of a test with what observes it.

    Args:
        board: the board.
        file: its board file as it runs here.
        source: the same as text.
        strict: whether a breach of a datasheet fails the test.
    """

    def __init__(self, board: Board, file: BoardFile, source: Source, strict: bool) -> None:
        self.board = board
        self.file = file
        self.source = source
        self.strict = strict
        self._bytes = io.BytesIO()
        self._journal = Journal(board, self._bytes, source.text, file.path)
        self.watch = Watch(board, _BOUNDLESS, times=True)
        self.served: ServedBoard | None = None
        self.address: str = ""
        self._wave: Any = None
        self._wave_text: TextIO = io.StringIO()
        self.clock = BoardClock(board, self.call)

    def call(self, what: Callable[[], _T]) -> _T:
        """Do something to the board while no host does."""
        return what() if self.served is None else self.served.call(what)

    def record_wave(self) -> None:
        """Record a waveform from now on."""
        from vbus.trace.wave.wave import Wave

        self._wave = Wave(self.board, self._wave_text)
        self._wave.start()

    def journal(self) -> bytes:
        """End the journal and return it."""
        self.call(self._journal.close)
        return self._bytes.getvalue()

    def wave(self) -> str:
        """End the waveform and return it; "" if there is none."""
        if self._wave is None:
            return ""
        self.call(self._wave.stop)
        text = self._wave_text.getvalue()  # type: ignore[attr-defined]
        self._wave = None
        return str(text)

    def faults(self) -> list[Any]:
        """Return every fault that was armed on the board."""
        # A board that never had one is not given any: that would be part of its state.
        return self.call(self.board.faults.all) if self.board.broken else []


class Bench:
    """The boards of one test.

    Args:
        name: the test's id, as pytest takes it.
        wishes: keywords of the test's markers.
        near: folders that board files, programs and sources are looked for in.
        folder: makes the folder for files that stay.
        seed: for boards that say nothing else; None keeps the board file's.
        strict: whether a breach of a datasheet fails a test that says nothing else.
        waves: ``"never"``, ``"on-failure"`` or ``"always"``.

    Raises:
        VbusError: a keyword is unknown.
    """

    def __init__(
        self,
        name: str,
        wishes: dict[str, Any],
        near: Iterable[Path],
        folder: Callable[[], Path],
        seed: int | None = None,
        strict: bool = False,
        waves: str = "never",
    ) -> None:
        _check_keywords(wishes)
        self.name = name
        self.near = list(near)
        self.folder = folder
        self.fitted: list[Fitted] = []
        self._wishes = wishes
        self._seed = seed
        self._strict = strict
        self._waves = waves
        self._stack = ExitStack()
        self._told: Told | None = None
        self._main: Fitted | None = None

    # -- boards -------------------------------------------------------------------------------

    def make(self, board: str | Path = "", **keywords: Any) -> Fitted:
        """Build one more board.

        Args:
            board: path of a board file, text of one, or a part number; "" for the marker's.
            keywords: :data:`WISHES`, in place of the marker's.

        Raises:
            VbusError: the board, or a keyword, makes no sense.
        """
        _check_keywords(keywords)
        wishes = {**self._wishes, **keywords}
        asked = board or wishes.get("board") or default_part()
        text, name = board_text(asked, self.near, wishes.get("plant", ""), wishes.get("clock", ""))
        rate = wishes.get("rate")
        if rate is not None and not (isinstance(rate, int | float) and rate > 0):
            raise VbusError(f"rate={rate!r}: it is chip seconds per second, more than 0")
        strict = bool(wishes.get("strict", self._strict))
        file, source = for_test(text, name, wishes.get("seed", self._seed), rate, strict)
        made = Fitted(build(file, source), file, source, strict)
        if self._waves != "never":
            made.record_wave()
        self.fitted.append(made)
        return made

    def main(self, otherwise: str = "") -> Fitted:
        """Return the test's board, built when first asked for.

        ``otherwise`` is its part if the test's marker names no board.
        """
        if self._main is None:
            self._main = self.make(self._wishes.get("board") or otherwise)
        return self._main

    def of(self, board: Board) -> Fitted:
        """Return what belongs to a board of this test.

        Raises:
            VbusError: it was not made here.
        """
        for fitted in self.fitted:
            if fitted.board is board:
                return fitted
        raise VbusError(f'board "{board.name}" was not made by a vbus fixture of this test')

    def find(self, name: str | Path) -> Path:
        """Return the path of a file beside the test, or relative to where pytest runs."""
        for folder in self.near:
            if (folder / name).exists():
                return folder / name
        return Path(name)

    def terminal(self) -> str:
        """Serve the test's board on a terminal of its own; return the terminal's path.

        Raises:
            VbusError: a host of this process is on the board already.
        """
        fitted = self.main()
        if fitted.served is None:
            if fitted.board.ports:
                raise VbusError(
                    "vbus_pty: this test has a host on its board already (a chip's fixture, or a"
                    " bus); take vbus_board in its place, or attach that host to the terminal"
                )
            runtime = self._stack.enter_context(private_runtime())
            host = next(iter(fitted.file.hosts), HostSection(transport=""))
            fitted.address = str(runtime / "host")
            link = LinkSpec(
                f"pty:{fitted.address}",
                host.protocol,
                list(host.chips),
                host.cycle,
                card_of(fitted.file, host),
                pin_map_of(fitted.file, host.pinmap),
            )
            served = ServedBoard(fitted.board, [link], fitted.file.board.stall)
            self._stack.enter_context(served)
            fitted.served = served
        return fitted.address

    def close(self) -> None:
        """Stop what runs; write the waveforms that are wanted of every test."""
        self._stack.close()
        for fitted in self.fitted:
            fitted.served = None
            if self._waves == "always" and self._told is None:
                self._keep(fitted, "vcd", fitted.wave().encode())

    # -- verdict ------------------------------------------------------------------------------

    def complaints(self) -> list[str]:
        """Return why a test fails that had nothing to complain about itself."""
        lines = []
        for fitted in self.fitted:
            name = fitted.board.name
            lines += [
                f'fault {armed} of board "{name}" never fired: the test did not test it;'
                " look at its trigger, or clear() it"
                for armed in fitted.faults()
                if not armed.fired and not armed.cleared
            ]
            if fitted.strict:
                lines += [
                    f"{format_instant(v.when)} {v.chip} broke {v.rule}: {v.detail}  [{v.clause}]"
                    for v in fitted.watch.violations
                    if v.severity != "note"
                ]
        return lines

    def tell(self) -> Told:
        """Keep the recordings of a failing test and return what to tell; the same when repeated."""
        if self._told is None:
            self._told = Told()
            for fitted in self.fitted:
                self._tell(fitted, self._told)
            again = f"pytest {shlex.quote(self.name)}"
            again += "" if self._seed is None else f" --vbus-seed={self._seed}"
            again += " --vbus-strict" if self._strict else ""
            self._told.lines.append(f"again:   {again}")
            self._told.properties.append(("vbus.again", again))
        return self._told

    def _tell(self, fitted: Fitted, told: Told) -> None:
        board = fitted.board
        faults = fitted.faults()
        lines = fitted.call(lambda: list(fitted.watch.lines))
        journal = self._keep(fitted, "vbj", fitted.journal())
        replay = f"vbus replay {shlex.quote(str(journal))}"
        told.lines.append(
            f'board "{board.name}" at {format_instant(board.now)}, seed {board.seed},'
            f" {board.policy}; {fitted.watch.cycles} bus cycles"
        )
        told.lines += [f"    {line}" for line in lines]
        told.lines.append(f"violations: {len(fitted.watch.violations) or 'none'}")
        told.lines += [
            f"    {format_instant(v.when)} {v.chip} {v.rule}: {v.detail}  [{v.clause}]"
            for v in fitted.watch.violations[-20:]
        ]
        if faults:
            told.lines.append("faults:")
            told.lines += [f"    {armed}" for armed in faults]
        told.lines.append(f"journal: {journal}")
        told.lines.append(f"replay:  {replay}")
        told.properties += [
            ("vbus.board", board.name),
            ("vbus.seed", str(board.seed)),
            ("vbus.journal", str(journal)),
            ("vbus.replay", replay),
            ("vbus.transcript", "\n".join(lines)),
            ("vbus.violations", "\n".join(f"{v.rule} {v.detail}" for v in fitted.watch.violations)),
            ("vbus.faults", "\n".join(str(armed) for armed in faults)),
        ]
        wave = fitted.wave()
        if wave:
            path = self._keep(fitted, "vcd", wave.encode())
            told.lines.append(f"wave:    {path}")
            told.properties.append(("vbus.wave", str(path)))

    def _keep(self, fitted: Fitted, suffix: str, content: bytes) -> Path:
        number = self.fitted.index(fitted)
        test = re.sub(r"[^\w.-]+", "_", self.name.rpartition("/")[2])[-100:]
        path = self.folder() / f"{test}{f'-{number + 1}' if number else ''}.{suffix}"
        path.write_bytes(content)
        return path


def _check_keywords(keywords: Iterable[str]) -> None:
    for key in keywords:
        if key not in WISHES:
            raise ConfigError(f"vbus: unknown keyword {key!r}; allowed are {', '.join(WISHES)}")
