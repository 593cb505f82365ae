"""Rows of AC tables as cases: on the limit nothing is reported, one step inside this row is."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import pytest

from vbus.chips.ac_table import AcTable
from vbus.core.kernel.clock import Clock
from vbus.core.signals import Violation

Play = Callable[[int], list[Violation]]
"""Runs one fresh bench with an interval (ps); returns what was reported."""


@dataclass(frozen=True)
class Case:
    """One way to break one row.

    Attributes:
        symbol: the row.
        limit: what the manual says (ps), written here by hand.
        play: what puts the interval on the pins.
        name: which edge, grade, supply or pin.
        step: from the limit to the nearest interval that breaks it (ps).
        beside: rules that no sequence can keep while it breaks this one.
        output: the manual gives the interval for the chip's output, not for an input.
    """

    symbol: str
    limit: int
    play: Play
    name: str = ""
    step: int = -1
    beside: frozenset[str] = frozenset()
    output: bool = False


@dataclass(frozen=True)
class Promise:
    """A row that only the chip can break.

    Attributes:
        symbol: the row.
        least: what the manual says at least (ps), written here by hand; 0: nothing.
        most: what it says at most (ps).
        why: what shows that the chip keeps the row.
    """

    symbol: str
    least: int
    most: int
    why: str


def parameters(table: AcTable, cases: Iterable[Case | Promise]) -> list[object]:
    """Return the cases for ``pytest.mark.parametrize``, each marked with the clause of its row."""
    return [
        pytest.param(
            case,
            id=f"{case.symbol} {case.name}".rstrip() if isinstance(case, Case) else case.symbol,
            marks=pytest.mark.spec(table[case.symbol].clause),
        )
        for case in cases
    ]


def check(table: AcTable, case: Case) -> None:
    """Assert that the row is kept on its limit and reported one step inside it."""
    assert table[case.symbol].output == case.output
    rule = f"{table.family}.{case.symbol}"
    kept = {violation.rule for violation in case.play(case.limit)}
    assert rule not in kept, "on the limit"
    assert kept <= {f"{table.family}.{other}" for other in case.beside}

    broken = case.play(case.limit + case.step)
    of_row = [violation for violation in broken if violation.rule == rule]
    assert [(v.clause, v.measured, v.limit) for v in of_row] == [
        (table[case.symbol].clause, case.limit + case.step, case.limit)
    ]
    others = {violation.rule for violation in broken} - {rule}
    assert others <= {f"{table.family}.{other}" for other in case.beside}


def check_promise(table: AcTable, promise: Promise, hz: int) -> None:
    """Assert that the row is the chip's own, with the manual's numbers at a clock."""
    row = table[promise.symbol]
    assert row.output, "only the chip's own outputs"
    assert table.minimum(row.symbol, Clock(hz)) == promise.least
    assert row.max_ps == promise.most


def check_complete(table: AcTable, cases: Iterable[Case], promises: Iterable[Promise] = ()) -> None:
    """Assert that each row has a case, or stands among the chip's own promises; none in both."""
    tried = {case.symbol for case in cases}
    promised = {promise.symbol for promise in promises}
    assert tried | promised == {row.symbol for row in table}
    assert not tried & promised
