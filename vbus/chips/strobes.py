"""AC limits: the manual's timing table, and the check of measured intervals."""

from collections.abc import Iterator, Mapping
from typing import ClassVar, Final

from vbus.chips.base import Chip
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


class AcLimits:
    """The AC limits of one chip, and the check of measured intervals against them.

    Args:
        chip: whose limits they are; its clock decides those that count clock periods.
        table: the table of its supply.

    Attributes:
        table: the table.
        least: what an interval must last at least (ps), by symbol.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, chip: Chip, table: AcTable) -> None:
        self._chip: Final[Chip] = chip
        self.table: Final[AcTable] = table
        self.least: Final[dict[str, int]] = table.limits(chip.clock)

    def short(self, symbol: str, measured: int, detail: str = "", when: int = -1) -> bool:
        """File an interval below its limit; tell whether what it belongs to is lost (strict).

        Args:
            symbol: the row.
            measured: the interval (ps).
            detail: a sentence for people, if the row's title does not say enough.
            when: instant at which the interval ended (ps), if that is not now.
        """
        limit = self.least[symbol]
        return measured < limit and self._chip.report(
            self.table.rules[symbol], measured, limit, detail, when
        )

    def outside(self, symbol: str, shortest: int, longest: int) -> None:
        """File a duration below the row's minimum or above its maximum.

        Args:
            symbol: the row.
            shortest: the duration, rounded down (ps); it is what is filed.
            longest: the same, rounded up.
        """
        row = self.table[symbol]
        if shortest < row.min_ps or longest > row.max_ps:
            limit = row.min_ps if shortest < row.min_ps else row.max_ps
            self._chip.report(self.table.rules[symbol], shortest, limit)
