"""The tables, and the settings with their defaults."""

import pytest

from tests.conformance.lm628.bench import Bench
from vbus.chips.lm628 import datasheet as ds
from vbus.chips.lm628.chip import LM628


@pytest.mark.spec("LM-CFG-1")
def test_settings_have_the_documented_defaults():
    assert {option.name: option.default for option in ds.OPTIONS} == {
        "busy_clk": 120,
        "busy_jitter_clk": 0,
        "seed": 0,
        "busy": "typical",
        "reset_time": 10**9,
        "reset_status": "84",
        "reset_fail": 0,
        "pid_overflow": "saturate",
        "integral_limit": "sum",
        "pwm_frame_clk": 512,
        "counts_per_turn": 2000,
        "clk_duty": 0.5,
    }


@pytest.mark.spec("LM-CFG-1")
@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"busy_clk": 0}, r"^busy_clk = 0: at least 1$"),
        ({"reset_time": 1_500_000_000}, r"^reset_time = 1500000000: at most 1499999999$"),
        ({"reset_status": "80"}, r"^reset_status = '80': allowed are 84, C4$"),
        ({"pid_overflow": "clip"}, r"^pid_overflow = 'clip': allowed are saturate, wrap$"),
        ({"frequency": 1}, r"^unknown setting 'frequency'; known are: busy_clk, "),
    ],
)
def test_settings_that_cannot_be_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        Bench(**settings)


@pytest.mark.spec("LM-STA-1", "LM-STA-2", "LM-TRJ-1", "LM-CMD-23")
def test_the_bit_tables_are_complete():
    assert [bit.number for bit in ds.STATUS] == list(range(7, -1, -1))
    assert [bit.number for bit in ds.SIGNALS] == list(range(15, -1, -1))
    assert sum(bit.mask for bit in ds.TRAJECTORY) == 0x1F3F
    assert sum(bit.mask for bit in ds.FILTER) == 0x000F


@pytest.mark.spec("LM-TIM-4", "LM-TIM-5")
def test_limits_of_the_clock_are_those_of_the_faster_grade():
    assert (ds.AC["T4"].min_ps, ds.AC["T5"].min_ps, ds.AC["T5"].max_ps) == (57_000, 125_000, 10**6)


def test_every_rule_has_its_own_name_and_a_clause_of_this_chip():
    names = [rule.name for rule in LM628.RULES]
    assert len(names) == len(set(names))
    assert all(name.startswith("lm628.") for name in names)
    assert all(rule.clause.startswith("LM-") for rule in LM628.RULES)


PRINTED = {
    "RESET": "0", "PORT8": "0", "PORT12": "0", "DFH": "0", "SIP": "0", "LPEI": "2", "LPES": "2",
    "SBPA": "4", "SBPR": "4", "MSKI": "2", "RSTI": "2", "LFIL": "2 to 10", "UDF": "0",
    "LTRJ": "2 to 14", "STT": "0", "RDSIGS": "2", "RDIP": "4", "RDDP": "4", "RDRP": "4",
    "RDDV": "4", "RDRV": "2", "RDSUM": "2",
}  # fmt: skip
"""Data bytes of each command."""
SIGNED = {"SBPA", "SBPR", "RDIP", "RDDP", "RDRP", "RDDV", "RDRV", "RDSUM"}


@pytest.mark.parametrize(
    "row",
    [pytest.param(row, id=row.name, marks=pytest.mark.spec(row.clause)) for row in ds.COMMANDS],
)
def test_a_row_of_the_table_counts_data_bytes_as_the_manual_prints_them(row):
    words = row.write + row.read
    assert (f"{2 * words} to {2 * row.up_to}" if row.up_to else str(2 * words)) == PRINTED[row.name]
    assert row.signed == (row.name in SIGNED)


def test_the_table_has_the_manual_s_commands():
    assert [row.name for row in ds.COMMANDS] == list(dict.fromkeys(row.name for row in ds.COMMANDS))
    assert {row.name for row in ds.COMMANDS} == PRINTED.keys()


def test_the_shortest_whole_cycle_holds_every_limit_when_played_as_strobes():
    bench = Bench("strobe", part="LM629N-8")
    chip = bench.chip
    edges: list[tuple[int, str, int]] = []
    latch = 1_000_000
    for write, address, data in [(True, 0, 0x1A), (False, 0, 0), (True, 0, 0x03)]:
        latch += chip.cycle_ps
        edges += [(latch + offset, name, level)
                  for offset, name, level in chip.strobes(write, address, data)]  # fmt: skip
    for when, name, level in sorted(edges, key=lambda edge: edge[0]):
        bench.at(when)
        bench.set(**{name: level})
    bench.run(10**9)

    assert bench.rules() == ["busy-write"]


def test_the_title_of_a_converter_pin_names_its_bit():
    titles = {row.name: row.title for row in ds.PINS if row.name.startswith("DAC")}
    assert titles == {f"DAC{bit}": f"Pin {25 - bit}: converter, bit {bit}" for bit in range(8)}
