"""Rows of AC characteristics, and the rules that follow from them.

Apart from the other rows of a datasheet, which a sigrok decoder takes along where no vbus is.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from vbus.core.signals import Rule

if TYPE_CHECKING:
    from vbus.core.kernel.clock import Clock
    from vbus.core.state import Names


class AcLimit(NamedTuple):
    """One row of an AC characteristics table.

    A limit is ``clocks`` clock periods plus ``ps`` picoseconds.

    Attributes:
        symbol: the manual's number, e.g. ``"T14"``.
        clause: clause id of the specification.
        title: the interval in the manual's words.
        min_ps: constant part of the minimum.
        min_clk: clock periods in the minimum.
        max_ps: maximum, or 0 for none.
        output: the chip's own promise; broken by a host that looks too early.
    """

    symbol: str
    clause: str
    title: str
    min_ps: int = 0
    min_clk: float = 0
    max_ps: int = 0
    output: bool = False


class AcTable:
    """The AC rows of one family, each with its rule (``FAMILY.SYMBOL``)."""

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, family: str, *rows: AcLimit) -> None:
        self.family: str = family
        self._rows: dict[str, AcLimit] = {}
        self.rules: dict[str, Rule] = {}
        self._limits: dict[int, dict[str, int]] = {}
        for row in rows:
            if row.symbol in self._rows:
                raise ValueError(f"{row.symbol} stands in the {family} AC table twice")
            self._rows[row.symbol] = row
            self.rules[row.symbol] = Rule(f"{family}.{row.symbol}", row.clause, row.title)

    def __iter__(self) -> Iterator[AcLimit]:
        return iter(self._rows.values())

    def __getitem__(self, symbol: str) -> AcLimit:
        return self._rows[symbol]

    def minimum(self, symbol: str, clock: Clock) -> int:
        """Return the smallest legal interval (ps) of the row at this clock."""
        row = self._rows[symbol]
        # Tenths of a clock: the finest formula in the manuals is 0.3 clk.
        return row.min_ps - (-round(row.min_clk * 10) * 10**11 // clock.hz)

    def limits(self, clock: Clock) -> dict[str, int]:
        """Return what an interval must last at least (ps), by symbol, at this clock.

        Of an output whose longest delay the chip promises, that is this delay: a host that looks
        earlier may see anything.
        """
        limits = self._limits.get(clock.hz)
        if limits is None:
            # Chips with one clock share them: a rack of a thousand has one dictionary.
            limits = self._limits[clock.hz] = {
                row.symbol: row.max_ps if row.output and row.max_ps else self.minimum(symbol, clock)
                for symbol, row in self._rows.items()
            }
        return limits


def rules_in(names: Mapping[str, object]) -> tuple[Rule, ...]:
    """Return the rules among the names of a module, in the order in which it states them."""
    return tuple([rule for rule in names.values() if isinstance(rule, Rule)])
