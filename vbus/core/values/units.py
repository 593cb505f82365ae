"""Quantities of a board file: a number and its unit, to the plain numbers parts work with.

Times become picoseconds and frequencies hertz, both exact integers; everything else becomes a
float in SI units. A prefix is part of the unit's name here, so that a message can list exactly
what may be written.
"""

import re
from fractions import Fraction
from typing import Final

from msgspec import Struct

from vbus.core.kernel import END, SECOND

_NUMBER: Final = re.compile(r"([+-]?)(\d[\d_]*)(?:\.(\d+))?(?:[eE]([+-]?\d+))?")
# Fractions are exact: without these two bounds a short text could ask for a number of any size.
_LONGEST: Final = 40
_LARGEST_EXPONENT: Final = 30


class UnitError(ValueError):
    """Something that is not a quantity of the kind wanted; the message says what is allowed."""


class Dimension(Struct, frozen=True):
    """One kind of quantity.

    Attributes:
        kind: its name in :class:`~vbus.core.options.Option`.
        title: what a person calls it, with its article.
        example: a value as it is written.
        units: unit names and what one of them is in the unit of ``kind`` (times: in ps).
        whole: the result is an integer, and never negative.
    """

    kind: str
    title: str
    example: str
    units: dict[str, Fraction]
    whole: bool = False

    def names(self) -> str:
        """Return the units as a message lists them."""
        return ", ".join(unit for unit in self.units if unit.isascii())


def _scale(**units: str) -> dict[str, Fraction]:
    return {unit: Fraction(factor) for unit, factor in units.items()}


# Approximations good to the last bit of a double: SI results are floats.
_TURN: Final = Fraction("6.28318530717958647692528676655900577")

_TIME: Final = {
    "s": Fraction(10**12), "ms": Fraction(10**9), "us": Fraction(10**6), "ns": Fraction(10**3),
    "ps": Fraction(1), "µs": Fraction(10**6), "μs": Fraction(10**6),
}  # fmt: skip
_FRICTION: Final = {
    "N*m*s": Fraction(1), "mN*m*s": Fraction(1, 10**3), "uN*m*s": Fraction(1, 10**6),
    "N*m*s/rad": Fraction(1),
}  # fmt: skip

_ROWS: Final = (
    Dimension("s", "a time", "500 us", _TIME, whole=True),
    Dimension(
        "Hz", "a frequency", "8 MHz",
        _scale(Hz="1", kHz="1e3", MHz="1e6", GHz="1e9"), whole=True,
    ),
    Dimension("V", "a voltage", "24 V", _scale(V="1", mV="1e-3", kV="1e3")),
    Dimension("A", "a current", "2 A", _scale(A="1", mA="1e-3", uA="1e-6")),
    Dimension(
        "ohm", "a resistance", "12 ohm",
        _scale(ohm="1", mohm="1e-3", kohm="1e3", Ω="1", mΩ="1e-3", kΩ="1e3"),
    ),
    Dimension("H", "an inductance", "2 mH", _scale(H="1", mH="1e-3", uH="1e-6")),
    Dimension(
        "N*m", "a torque", "0.02 N*m",
        {"N*m": Fraction(1), "mN*m": Fraction(1, 10**3), "uN*m": Fraction(1, 10**6),
         "N*cm": Fraction(1, 100)},
    ),
    Dimension(
        "kg*m^2", "a moment of inertia", "2e-6 kg*m^2",
        {"kg*m^2": Fraction(1), "kg*cm^2": Fraction(1, 10**4), "g*m^2": Fraction(1, 10**3),
         "g*cm^2": Fraction(1, 10**7)},
    ),
    Dimension(
        "rad/s", "a speed", "300 rpm",
        {"rad/s": Fraction(1), "rpm": _TURN / 60, "rev/s": _TURN, "deg/s": _TURN / 360},
    ),
    Dimension(
        "rad", "an angle", "10 deg",
        {"rad": Fraction(1), "deg": _TURN / 360, "rev": _TURN},
    ),
    Dimension("N*m*s", "a viscous friction", "1e-6 N*m*s", _FRICTION),
    Dimension(
        "N*m/A", "a torque constant", "0.03 N*m/A",
        {"N*m/A": Fraction(1), "mN*m/A": Fraction(1, 10**3)},
    ),
    Dimension(
        "V*s", "a back-EMF constant", "0.03 V*s",
        {"V*s": Fraction(1), "mV*s": Fraction(1, 10**3), "V*s/rad": Fraction(1),
         "V/rpm": 60 / _TURN, "V/krpm": Fraction(60, 1000) / _TURN},
    ),
)  # fmt: skip

DIMENSIONS: Final[dict[str, Dimension]] = {row.kind: row for row in _ROWS}
"""Every kind of quantity a board file knows, by the kind's name."""


def describe(kind: str) -> str:
    """Return what may be written for a quantity of ``kind``, for messages."""
    row = DIMENSIONS[kind]
    return f'{row.title} with its unit, such as "{row.example}" (units: {row.names()})'


def parse(value: object, kind: str) -> int | float:
    """Return the number behind a quantity.

    Args:
        value: what the board file holds, meant to be a string such as ``"8 MHz"``.
        kind: a key of :data:`DIMENSIONS`.

    Returns:
        Picoseconds for ``"s"`` and hertz for ``"Hz"``, both integers; a float in SI else.

    Raises:
        UnitError: no number, no unit, another dimension's unit, or not a whole number of
            picoseconds or hertz.
    """
    row = DIMENSIONS[kind]
    if not isinstance(value, str):
        # The commonest slip: the number is right, and the unit is missing.
        if isinstance(value, int | float) and not isinstance(value, bool):
            raise UnitError(f"it has no unit; write {describe(kind)}")
        raise UnitError(f"expected {describe(kind)}")
    text = value.strip()
    match = _NUMBER.match(text)
    if match is None or len(text) > _LONGEST:
        raise UnitError(f"that is not a quantity; write {describe(kind)}")
    # A keyboard may have other signs for the product and the square.
    unit = text[match.end() :].strip().replace("·", "*").replace("²", "^2")
    if not unit:
        raise UnitError(f"it has no unit; write {describe(kind)}")
    factor = row.units.get(unit)
    if factor is None:
        raise UnitError(_wrong_unit(unit, row))
    sign, whole, decimals, exponent = match.groups()
    if abs(int(exponent or 0)) > _LARGEST_EXPONENT:
        raise UnitError(f"exponent {exponent} is out of reach; write {describe(kind)}")
    number = Fraction(f"{sign}{whole.replace('_', '')}.{decimals or 0}e{exponent or 0}")
    # Exact up to here: 0.1 us is 100000 ps, and no float on the way.
    amount = number * factor
    if not row.whole:
        return float(amount)
    if amount < 0:
        raise UnitError(f"{row.title} cannot be negative")
    # A time that is rounded would shift the instants of a whole run.
    if amount.denominator != 1:
        step = "a picosecond" if kind == "s" else "a hertz"
        raise UnitError(f"{row.title} is a whole multiple of {step}")
    if kind == "s" and amount > END:
        raise UnitError(f"time ends at {END // SECOND} s; nothing takes longer")
    return int(amount)


def _wrong_unit(unit: str, row: Dimension) -> str:
    # A unit of another quantity is a better hint than a unit that is unknown.
    for other in _ROWS:
        if unit in other.units:
            return f'"{unit}" is the unit of {other.title}; write {describe(row.kind)}'
    return f'unknown unit "{unit}"; write {describe(row.kind)}'


def show(value: int | float, kind: str) -> str:
    """Return ``value`` as a board file would have it, in its largest exact unit."""
    row = DIMENSIONS.get(kind)
    # A setting without a unit.
    if row is None:
        return str(value)
    if row.whole:
        best = next(iter(row.units))
        for unit, factor in row.units.items():
            # The largest unit in which it is a whole number.
            if unit.isascii() and value % factor == 0 and (
                value % row.units[best] or factor > row.units[best]
            ):  # fmt: skip
                best = unit
        return f"{Fraction(value) / row.units[best]} {best}"
    return f"{value:g} {kind}"
