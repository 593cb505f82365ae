"""Runs one planted mistake: the right driver, a line of it changed, and the driver's own tests."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vbus.serve.host_limits import HostStuck
from vbus.serve.in_process import connect_in_process
from vbus.testing.bench import Bench
from vbus.testing.execute import Execute

HERE = Path(__file__).parent
DRIVERS = HERE / "drivers"


@dataclass
class Outcome:
    """What came of the driver's own tests.

    Attributes:
        red: why they fail, test by test.
        rules: what was broken or noted, in tests that pass, too.
        lines: what a report would say of it.
    """

    red: list[str] = field(default_factory=list)
    rules: set[str] = field(default_factory=set)
    lines: list[str] = field(default_factory=list)


def run_python(driver: str, change: tuple[str, str] | None, folder: Path) -> Outcome:
    """Run the tests in a driver's file, once each, with a line of the driver changed."""
    path = DRIVERS / f"{driver}.py"
    text = path.read_text()
    if change is not None:
        before, after = change
        assert text.count(before) == 1, (
            f"{driver}: {before!r} stands there {text.count(before)} times"
        )
        text = text.replace(before, after)
    names = _module(text, driver)
    outcome = Outcome()
    for name, function in list(names.items()):
        if name.startswith("test_"):
            run_test(function, names.get("BOARD", ""), name, folder, outcome)
    return outcome


def run_c(chip: str, number: int, folder: Path) -> Outcome:
    """Run the C driver of a chip with a mistake, as ``vbus_exec`` does, and look at its motor."""
    part, rest = BOARDS[chip]

    def test_the_program_moves_its_axis(board: Any) -> None:
        done = board.execute(DRIVERS / "drivers.c", chip, str(number), flags="-O0")
        assert done.code == 0, done.errors
        plant = next(iter(board.board.axes.values()))
        assert abs(plant.count - rest) <= 6

    outcome = Outcome()
    run_test(test_the_program_moves_its_axis, part, "test_c", folder, outcome)
    return outcome


BOARDS = {
    "lm629": ("LM629N-8", -3000),
    "mcp1200": ("MCP-1200", -4000),
    "mc1241a": ("MC1241A", -312),
}


def unusual(name: str, folder: Path) -> tuple[Outcome, set[str]]:
    """Run one of the unusual things that right drivers do; return its outcome and what is noted."""
    module = _module((DRIVERS / "unusual.py").read_text(), "unusual")
    outcome = Outcome()
    run_test(module[name], "", name, folder, outcome)
    return outcome, module["NOTED"].get(name, set())


def run_test(
    function: Callable[..., None], board: str, name: str, folder: Path, outcome: Outcome
) -> None:
    """Run one test as the plug-in does: its fixtures, the test, its verdict."""
    chips = function.__code__.co_varnames[: function.__code__.co_argcount]
    bench = Bench(name, {"board": board} if board else {}, [DRIVERS], lambda: folder, scope=False)
    why = ""
    try:
        given = [_fixture(bench, chip) for chip in chips]
        function(*given)
    except (Exception, HostStuck) as error:
        why = f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}"
    finally:
        bench.relent()
    complaints = [] if why else bench.complaints()
    if why or complaints:
        outcome.red.append(f"{name}: {why or complaints[0]}")
        if not why:
            outcome.lines += complaints
    for tested in bench.boards:
        judged = bench.judged(tested)
        found = [*judged.failing, *judged.notes, *tested.board.left_over()]
        outcome.rules |= {one.rule for one in found}
    bench.close()


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
