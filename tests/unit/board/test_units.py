"""Quantities: exact numbers out of texts, and messages that say what may be written."""

import contextlib
import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.core.kernel import END
from vbus.core.values.units import DIMENSIONS, UnitError, parse, show


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("500 us", "s", 500_000_000),
        ("1s", "s", 10**12),
        ("2.1 ns", "s", 2_100),
        ("1 ps", "s", 1),
        ("1e-3 ms", "s", 1_000_000),
        ("3 µs", "s", 3_000_000),
        ("0 s", "s", 0),
        ("8 MHz", "Hz", 8_000_000),
        ("8.333333 MHz", "Hz", 8_333_333),
        ("20 kHz", "Hz", 20_000),
        ("1_000 Hz", "Hz", 1_000),
        ("24 V", "V", 24.0),
        ("-12 mV", "V", -0.012),
        ("12 ohm", "ohm", 12.0),
        ("1.2 kΩ", "ohm", 1200.0),
        ("2 mH", "H", 0.002),
        ("350 mA", "A", 0.35),
        ("0.02 N*m", "N*m", 0.02),
        ("20 mN·m", "N*m", 0.02),
        ("2e-6 kg*m^2", "kg*m^2", 2e-6),
        ("20 g*cm²", "kg*m^2", 2e-6),
        ("60 rpm", "rad/s", 2 * math.pi),
        ("1 rev/s", "rad/s", 2 * math.pi),
        ("180 deg", "rad", math.pi),
        ("1e-6 N*m*s", "N*m*s", 1e-6),
        ("30 mN*m/A", "N*m/A", 0.03),
        ("0.03 V*s", "V*s", 0.03),
    ],
)
def test_a_quantity_becomes_an_exact_number(text: str, kind: str, value: float) -> None:
    result = parse(text, kind)
    assert result == value
    assert type(result) is type(value)


def test_every_unit_is_worth_what_its_name_says() -> None:
    turn = 2 * math.pi
    worth = {
        "s": {"s": 10**12, "ms": 10**9, "us": 10**6, "ns": 10**3, "ps": 1}
        | dict.fromkeys(("µs", "μs"), 10**6),
        "Hz": {"Hz": 1, "kHz": 10**3, "MHz": 10**6, "GHz": 10**9},
        "V": {"V": 1, "mV": 1e-3, "kV": 1e3},
        "A": {"A": 1, "mA": 1e-3, "uA": 1e-6},
        "ohm": {"ohm": 1, "mohm": 1e-3, "kohm": 1e3, "Ω": 1, "mΩ": 1e-3, "kΩ": 1e3},
        "H": {"H": 1, "mH": 1e-3, "uH": 1e-6},
        "N*m": {"N*m": 1, "mN*m": 1e-3, "uN*m": 1e-6, "N*cm": 1e-2},
        "kg*m^2": {"kg*m^2": 1, "kg*cm^2": 1e-4, "g*m^2": 1e-3, "g*cm^2": 1e-7},
        "rad/s": {"rad/s": 1, "rpm": turn / 60, "rev/s": turn, "deg/s": turn / 360},
        "rad": {"rad": 1, "deg": turn / 360, "rev": turn},
        "N*m*s": {"N*m*s": 1, "mN*m*s": 1e-3, "uN*m*s": 1e-6, "N*m*s/rad": 1},
        "N*m/A": {"N*m/A": 1, "mN*m/A": 1e-3},
        "V*s": {"V*s": 1, "mV*s": 1e-3, "V*s/rad": 1, "V/rpm": 60 / turn, "V/krpm": 0.06 / turn},
    }
    assert {
        kind: {unit: parse(f"1 {unit}", kind) for unit in row.units}
        for kind, row in DIMENSIONS.items()
    } == {kind: pytest.approx(units, rel=1e-15) for kind, units in worth.items()}


TIME = 'write a time with its unit, such as "500 us" (units: s, ms, us, ns, ps)'
CLOCK = 'write a frequency with its unit, such as "8 MHz" (units: Hz, kHz, MHz, GHz)'


@pytest.mark.parametrize(
    ("value", "kind", "message"),
    [
        (8_000_000, "Hz", f"it has no unit; {CLOCK}"),
        (0.5, "s", f"it has no unit; {TIME}"),
        ("8", "Hz", f"it has no unit; {CLOCK}"),
        ("8 V", "Hz", f'"V" is the unit of a voltage; {CLOCK}'),
        ("8 Mhz", "Hz", f'unknown unit "Mhz"; {CLOCK}'),
        ("MHz", "Hz", f"that is not a quantity; {CLOCK}"),
        ("", "s", f"that is not a quantity; {TIME}"),
        ("inf s", "s", f"that is not a quantity; {TIME}"),
        ("1" * 50 + " s", "s", f"that is not a quantity; {TIME}"),
        ("1e999999999 s", "s", f"exponent 999999999 is out of reach; {TIME}"),
        (True, "s", f"expected {TIME[6:]}"),
        ([], "s", f"expected {TIME[6:]}"),
        ("-1 us", "s", "a time cannot be negative"),
        ("-1 ps", "s", "a time cannot be negative"),
        ("0.5 ps", "s", "a time is a whole multiple of a picosecond"),
        ("9151315 s", "s", "time ends at 9151314 s; nothing takes longer"),
        (f"{END + 1} ps", "s", "time ends at 9151314 s; nothing takes longer"),
        ("0.3 Hz", "Hz", "a frequency is a whole multiple of a hertz"),
        (
            "3 N*m/A",
            "V*s",
            '"N*m/A" is the unit of a torque constant; write a back-EMF constant with its unit,'
            ' such as "0.03 V*s" (units: V*s, mV*s, V*s/rad, V/rpm, V/krpm)',
        ),
    ],
)
def test_what_is_no_quantity_is_refused_with_what_may_be_written(
    value: object, kind: str, message: str
) -> None:
    with pytest.raises(UnitError, match=f"^{re.escape(message)}$"):
        parse(value, kind)


@given(st.integers(0, END))
def test_a_time_shown_reads_back_as_itself(ps: int) -> None:
    assert parse(show(ps, "s"), "s") == ps


@given(st.sampled_from(sorted(DIMENSIONS)), st.text(max_size=20))
def test_any_text_is_a_quantity_or_refused(kind: str, text: str) -> None:
    with contextlib.suppress(UnitError):
        assert math.isfinite(parse(text, kind))


@pytest.mark.parametrize(
    ("value", "kind", "text"),
    [
        (0, "s", "0 s"),
        (1_000_000, "s", "1 us"),
        (1_500_000, "s", "1500 ns"),
        (8_000_000, "Hz", "8 MHz"),
        (8_333_333, "Hz", "8333333 Hz"),
        (2e-06, "kg*m^2", "2e-06 kg*m^2"),
        (7, "count", "7"),
    ],
)
def test_a_value_is_shown_in_its_largest_exact_unit(value: float, kind: str, text: str) -> None:
    assert show(value, kind) == text


def test_the_example_of_every_dimension_is_one() -> None:
    for row in DIMENSIONS.values():
        assert parse(row.example, row.kind) > 0
