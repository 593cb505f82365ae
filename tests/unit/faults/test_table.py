"""What a parameter of a fault may be: default and bounds, row by row."""

from vbus.faults.table import faults

NUMBERS = {
    ("wire_late", "by"): (10**9, 1, 10**12),
    ("wire_doubled", "gap"): (10**7, 1, 10**12),
    ("wire_reordered", "gap"): (10**7, 1, 10**12),
    ("slip", "share"): (0.5, 0.0, 1.0),
    ("load_step", "torque"): (0.02, None, None),
    ("friction", "coulomb"): (0.01, 0.0, None),
    ("friction", "viscous"): (0.0, 0.0, None),
    ("backlash", "gap"): (20, 1, 1 << 30),
    ("end_stop", "ahead"): (100, -(1 << 30), 1 << 30),
    ("supply_sag", "supply"): (6.0, 0.0, None),
    ("overheated", "torque"): (0.5, 0.0, 1.0),
    ("lost_steps", "every"): (10, 1, 1 << 30),
    ("a_stuck", "level"): (1, 0, 1),
    ("b_stuck", "level"): (1, 0, 1),
    ("glitch", "width"): (50_000, 1, 1_000_000_000_000),
    ("index_double", "distance"): (40, 4, 1 << 30),
    ("offset_jump", "counts"): (100, -(1 << 30), 1 << 30),
    ("limit_bouncing", "period"): (1_000_000_000, 2_000_000, None),
    ("busy_longest", "extra"): (500_000_000, 0, 10**15),
    ("reset_fails", "times"): (1, 1, 1000),
    ("clock_off", "ppm"): (100, -100_000, 100_000),
    ("bit_stuck", "bit"): (0, 0, 7),
    ("bit_stuck", "level"): (1, 0, 1),
    ("byte_flipped", "mask"): (255, 1, 255),
    ("strobe_doubled", "at"): (30_000, 1000, 1_000_000_000),
    ("strobe_doubled", "gap"): (20_000, 1000, 1_000_000_000),
    ("bus_pulled", "level"): (1, 0, 1),
    ("contention", "data"): (0, 0, 255),
    ("net_stuck", "level"): (1, 0, 1),
    ("message_lost", "every"): (1, 1, 1 << 30),
    ("message_doubled", "every"): (1, 1, 1 << 30),
    ("part_slow", "by"): (100_000, 1, 1_000_000_000_000),
}
"""Of every number: default, least and most."""


def test_every_number_of_a_fault_has_its_default_and_its_bounds() -> None:
    assert {
        (fault.name, one.name): (one.default, one.low, one.high)
        for fault in faults().values()
        for one in fault.parameters
        if one.kind != "choice"
    } == NUMBERS
