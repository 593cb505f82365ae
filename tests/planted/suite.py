"""Runs one planted mistake: the right driver, a line of it changed, and the driver's own tests."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from vbus.serve.host_limits import HostStuck
from vbus.testing.bench import Bench
from vbus.testing.chips import chip_bench

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
    names: dict[str, Any] = {}
    exec(compile(text, str(path), "exec"), names)
    outcome = Outcome()
    for name, function in list(names.items()):
        if name.startswith("test_"):
            run_test(function, names.get("BOARD", ""), name, folder, outcome)
    return outcome


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


def _fixture(bench: Bench, name: str) -> Any:
    if name == "board":
        tested = bench.main()
        return SimpleNamespace(board=tested.board, clock=tested.clock, bench=bench)
    return chip_bench(bench, name.upper().replace("MCP1200", "MCP-1200"))
