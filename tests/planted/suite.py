"""Runs one planted mistake: the right driver, a line of it changed, and the driver's own tests."""

import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Any, Final, NamedTuple

from vbus.campaign.world import REFERENCE, World
from vbus.serve.host_limits import HostStuck
from vbus.serve.in_process import connect_in_process
from vbus.testing.bench import Bench
from vbus.testing.boards import Variant
from vbus.testing.execute import Execute

HERE: Final = Path(__file__).parent
DRIVERS: Final = HERE / "drivers"
MISTAKES: Final[dict[str, list[dict[str, str]]]] = tomllib.loads(
    (HERE / "mistakes.toml").read_text()
)
UNUSUAL: Final = re.findall(r"^def (test_\w+)", (DRIVERS / "unusual.py").read_text(), re.M)
RED: Final = "red"
SILENT: Final = "silent"
BOARDS: Final = {
    "lm629": ("LM629N-8", -3000),
    "mcp1200": ("MCP-1200", -4000),
    "mc1241a": ("MC1241A", -312),
}
"""Of each chip of drivers.c: its part, and where its motor rests in the end."""


@dataclass
class Outcome:
    """What came of the driver's own tests.

    Attributes:
        red: why they fail, test by test.
        rules: what was broken or noted, in tests that pass, too.
    """

    red: list[str] = field(default_factory=list)
    rules: set[str] = field(default_factory=set)


class DriverTest(NamedTuple):
    """One of a driver's own tests: its name, what it calls, and the text of its board."""

    name: str
    function: Callable[..., None]
    board: str = ""

    def run(
        self, folder: Path, world: World | None = None, limits: tuple[int, ...] = ()
    ) -> tuple[Bench, str]:
        """Run it as the plug-in does; return its boards, and why it fails.

        Args:
            folder: where programs are compiled to.
            world: the world of a campaign, which has a witness; None outside a campaign.
            limits: chip time (ps) and bus cycles that it may take.
        """
        code = self.function.__code__
        keywords = {"board": self.board} if self.board else {}
        bench = Bench(
            self.name, keywords, [DRIVERS], lambda: folder, scope=False,
            variant=Variant(world=world or REFERENCE), witnessed=world is not None,
        )  # fmt: skip
        if limits:
            bench.limit(*limits)
        why = ""
        try:
            self.function(*(_fixture(bench, chip) for chip in code.co_varnames[: code.co_argcount]))
        except (Exception, HostStuck) as error:
            why = f"{type(error).__name__}: {str(error).partition(chr(10))[0]}"
        finally:
            bench.relent()
        return bench, why or next(iter(bench.complaints()), "")


def driver_tests(driver: str, number: int) -> list[DriverTest]:
    """Return the tests of a driver with one of its mistakes, numbered from 1; 0: the right one."""
    program, _, chip = driver.partition(" ")
    if chip:
        part, rest = BOARDS[chip]

        def test_the_program_moves_its_axis(board: Any) -> None:
            words = DRIVERS / program, chip, str(number)
            done = board.execute(*words, flags="-O0", timeout=inf)
            assert done.code == 0, done.errors
            plant = next(iter(board.board.axes.values()))
            assert abs(plant.count - rest) <= 6

        return [DriverTest("test_c", test_the_program_moves_its_axis, part)]
    text = (DRIVERS / f"{driver}.py").read_text()
    if number:
        row = MISTAKES[driver][number - 1]
        count = text.count(row["before"])
        assert count == 1, f"{driver}: {row['before']!r} stands there {count} times"
        text = text.replace(row["before"], row["after"])
    names = _module(text, driver)
    return [
        DriverTest(name, function, names.get("BOARD", ""))
        for name, function in names.items()
        if name.startswith("test_")
    ]


def run(tests: list[DriverTest], folder: Path) -> Outcome:
    """Run tests with nothing broken around them."""
    outcome = Outcome()
    for test in tests:
        bench, why = test.run(folder)
        if why:
            outcome.red.append(f"{test.name}: {why}")
        for tested in bench.boards:
            judged = bench.judged(tested)
            found = [*judged.failing, *judged.notes, *tested.board.left_over()]
            outcome.rules |= {one.rule for one in found}
        bench.close()
    return outcome


def unusual(name: str, folder: Path) -> tuple[Outcome, set[str]]:
    """Run one of the unusual things that right drivers do; return its outcome and what is noted."""
    module = _module((DRIVERS / "unusual.py").read_text(), "unusual")
    return run([DriverTest(name, module[name])], folder), module["NOTED"].get(name, set())


def _module(text: str, name: str) -> dict[str, Any]:
    names: dict[str, Any] = {}
    exec(compile(text, str(DRIVERS / f"{name}.py"), "exec"), names)
    return names


class _Fixtures:
    """What a test has that takes no fixture of a chip."""

    def __init__(self, bench: Bench) -> None:
        self.board = bench.main().board
        self.execute = Execute(bench)

    @property
    def bus(self) -> Any:
        """A client's bus on the board, whose chips have come out of their reset."""
        self.board.run_until(max(chip.ready_at() for chip in self.board.chips))
        return connect_in_process(self.board)


def _fixture(bench: Bench, name: str) -> Any:
    if name == "board":
        return _Fixtures(bench)
    return bench.chip(name.upper().replace("MCP1200", "MCP-1200"))
