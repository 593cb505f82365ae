"""The clock input: is it one the part can run from (T4, T5)?"""

from vbus.chips.base import Chip
from vbus.chips.lm628 import datasheet as ds
from vbus.core.kernel.clock import PS_PER_SECOND


def check_clock(part: str, hz: int) -> None:
    """Refuse a clock that is a slip of the pen.

    Raises:
        ValueError: no such part could be meant to run at ``hz``.
    """
    slowest, fastest = ds.CLOCK_ABSURD
    if not slowest <= hz <= fastest:
        raise ValueError(f"a clock of {hz} Hz: a {part} runs at 1 MHz to {part[-1]} MHz")


def judge_clock(chip: Chip, duty: float) -> None:
    """File a violation for a clock outside the limits of the part's grade.

    Args:
        chip: whose clock it is.
        duty: part of the period during which CLK is high.
    """
    hz = chip.clock.hz
    period = PS_PER_SECOND // hz
    pulse = int(PS_PER_SECOND * min(duty, 1 - duty)) // hz
    shortest_pulse, shortest = ds.CLOCK_LIMITS[chip.part[-1]]
    longest = ds.AC["T5"].max_ps
    t4, t5 = ds.AC.rules["T4"], ds.AC.rules["T5"]
    if pulse < shortest_pulse:
        chip.report(t4, pulse, shortest_pulse, f"CLK high or low for {pulse} ps only")
    if period < shortest:
        chip.report(t5, period, shortest, f"{hz} Hz is above the grade of a {chip.part}")
    elif longest * hz < PS_PER_SECOND:
        chip.report(t5, period, longest, f"{hz} Hz is below 1 MHz")
