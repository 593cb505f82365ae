"""What the pins of an MCP-1200 ask of the chip behind them."""

from collections.abc import Callable

from vbus.chips.base import Chip
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.strobes import AcTable
from vbus.kernel import Clock, Kernel
from vbus.options import Settings
from vbus.signals import Policy, Violation


class HostInterface(Chip):
    """Clock cycles, AC limits, and what a pin that moves does inside.

    Attributes:
        ac: the AC limits at this supply.
    """

    def __init__(
        self,
        name: str,
        part: str,
        kernel: Kernel,
        clock: Clock,
        settings: Settings | None,
        policy: Policy | None,
        file: Callable[[Violation], None] | None,
    ) -> None:
        super().__init__(name, part, kernel, clock, settings, policy, file)
        self.ac: AcTable = ds.AC[str(self.settings["supply"])]

    # -- what is behind the pins --------------------------------------------------------------

    def changed(self) -> None:
        """Something from outside has touched the chip: show it, and set the timer anew."""
        raise NotImplementedError

    def drop_read(self) -> None:
        """A read that was begun does not take place; the latch keeps what it had."""
        raise NotImplementedError

    def drop_write(self) -> None:
        """The byte just written does not count after all (strict policy)."""
        raise NotImplementedError

    def output(self) -> int:
        """What /OE puts on the bus now."""
        raise NotImplementedError

    def reset_pin(self, level: int) -> None:
        """/RESET has moved."""
        raise NotImplementedError

    # -- clock cycles -------------------------------------------------------------------------

    def cycle_now(self) -> int:
        """Clock cycle that is under way."""
        return self.clock.cycle_at(self.kernel.now)

    def next_cycle(self) -> int:
        """First clock cycle that starts now or later: when an edge now is taken in."""
        cycle = self.cycle_now()
        return cycle if self.clock.ps(cycle) == self.kernel.now else cycle + 1

    # -- AC limits ----------------------------------------------------------------------------

    def limit(self, symbol: str) -> int:
        """Smallest legal interval (ps) of an AC row at this clock and supply."""
        return self.ac.minimum(symbol, self.clock)

    def judge(self, symbol: str, measured: int) -> bool:
        """Report an interval below its minimum; tell whether the access is lost."""
        least = self.ac.minimum(symbol, self.clock)
        return measured < least and self.report(self.ac.rules[symbol], measured, least)

    def judge_latest(self, symbol: str, measured: int) -> None:
        """Report a host that takes an output before its longest delay is over."""
        most = self.ac[symbol].max_ps
        if measured < most:
            self.report(self.ac.rules[symbol], measured, most)

    def judge_filtered(self, symbol: str, measured: int, divider: int) -> None:
        """Report an encoder interval below its minimum, which counts filter clocks."""
        row = self.ac[symbol]
        least = row.min_ps + self.clock.span_up(int(row.min_clk) * divider)
        if measured < least:
            self.report(self.ac.rules[symbol], measured, least)
