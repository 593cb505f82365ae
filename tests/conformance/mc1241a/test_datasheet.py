"""The tables, number by number as the manual prints them."""

import pytest

from tests.reference.mc1241a import COMMANDS as MANUAL
from vbus.chips.mc1241a import datasheet as ds
from vbus.chips.mc1241a.chip import MC1241A
from vbus.chips.tables import Command

spec = pytest.mark.spec


@spec("PMD-CMD-81")
def test_codes_and_words_of_all_commands() -> None:
    assert {row.code: (row.name, row.write, row.read) for row in ds.COMMANDS} == MANUAL


FRACTIONS = {
    "VEL": 16, "ACC": 16, "MAX_ACC": 16, "JERK": 32, "RATIO": 16, "START_VEL": 16, "TRGT_VEL": 16,
    "STEP_RATIO": 8,
}  # fmt: skip


@pytest.mark.parametrize(
    "row",
    [pytest.param(row, marks=spec(row.clause), id=row.name)
     for row in ds.COMMANDS if row.write or row.read],
)  # fmt: skip
def test_fraction_bits_of_what_commands_carry(row: Command) -> None:
    assert row.fraction == FRACTIONS.get(row.name[4:], 0)


BUFFERED = {
    *(f"{verb}_{name}" for verb in ("SET", "GET")
      for name in ("POS", "VEL", "ACC", "MAX_ACC", "JERK", "RATIO", "BUF_MTR_CMD")),
    "STOP", "SMOOTH_STOP", "SYNCH_PRFL",
}  # fmt: skip


@spec("PMD-UPD-1")
@pytest.mark.parametrize(
    "row", [pytest.param(row, marks=spec(row.clause), id=row.name) for row in ds.COMMANDS]
)
def test_which_commands_are_double_buffered(row: Command) -> None:
    assert row.buffered == (row.name in BUFFERED)


@spec("PMD-STA-1", "PMD-STA-5")
def test_bits_of_the_status_and_mode_words() -> None:
    assert [bit.number for bit in ds.STATUS_BITS] == [*range(11), 12]
    assert [bit.number for bit in ds.MODE_BITS] == [7, *range(10, 16)]


@spec("PMD-TIM-13", "PMD-TIM-21")
def test_limits_that_the_chip_set_promises() -> None:
    """Shortest and longest in ps; those of the host are broken one by one in test_ac_rows.py."""
    promised = {
        "T11": (10_000, 0), "T19": (35_000, 0), "T20": (56_000, 95_000), "T21": (17_000, 0),
        "T22": (10_000, 40_000), "T23": (75_000, 92_000), "T24": (0, 92_000),
        "T26": (0, 66_000), "T27": (0, 44_500),
    }  # fmt: skip
    assert {symbol: (ds.AC[symbol].min_ps, ds.AC[symbol].max_ps) for symbol in promised} == promised
    assert ds.AC["T25"].min_clk == 4


@spec("PMD-BUS-1")
def test_what_is_joined_on_a_bus_and_how_wide_it_is() -> None:
    pins = {row.name: row for row in MC1241A.PINS}
    assert {name for name, row in pins.items() if row.strobe} == {
        "~HostSlct", "~HostWrite", "~HostRead", "HostCmd",
    }  # fmt: skip
    assert {name for name, row in pins.items() if row.shared} == {
        "~HostWrite", "~HostRead", "HostCmd", "D0-D7",
    }  # fmt: skip
    assert {name: row.width for name, row in pins.items() if row.width != 1} == {
        "D0-D7": 8, "DAC16Addr0-1": 2, "Data0-11": 12, "DACLow0-3": 4, "I/OAddr0-3": 4,
    }  # fmt: skip
