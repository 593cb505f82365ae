"""AC limits: the manual's timing table, and the check of measured intervals."""

from collections.abc import Iterator
from typing import ClassVar

from vbus.chips.tables import AcLimit
from vbus.core.kernel.clock import Clock
from vbus.core.signals.tables import Rule
from vbus.core.state import Names


class AcTable:
    """The AC rows of one family, each with its rule (``FAMILY.SYMBOL``)."""

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
