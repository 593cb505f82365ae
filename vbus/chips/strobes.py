"""AC limits: the manual's timing table, and the check of measured intervals."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from vbus.kernel.clock import Clock
from vbus.signals.violation import Rule
from vbus.state import Names


@dataclass(frozen=True, slots=True)
class AcLimit:
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

    __slots__ = ("_rows", "family", "rules")
    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, family: str, *rows: AcLimit) -> None:
        self.family: str = family
        self._rows: dict[str, AcLimit] = {}
        self.rules: dict[str, Rule] = {}
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
