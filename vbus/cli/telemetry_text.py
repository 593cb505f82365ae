"""What a chip tells of itself, as people read it: units, names of words, and bits as lamps."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from vbus.chips.family import Family
from vbus.chips.packets import Decoder
from vbus.chips.tables import Bit
from vbus.core.signals.values import Value

LIT: Final = "●"
UNLIT: Final = "○"


@dataclass(frozen=True, slots=True)
class BitValue:
    """A value of bits.

    Attributes:
        name: what the chip calls it.
        text: the value, and what of it is no single bit.
        bits: its bits, the highest first, each with whether it is set.
    """

    name: str
    text: str
    bits: tuple[tuple[str, bool], ...]


@dataclass(frozen=True, slots=True)
class TelemetryValue:
    """A value with a unit, or a text; by the name that conditions know it by."""

    name: str
    text: str
    unit: str


def words_and_numbers(
    family: Family, decoder: Decoder | None, values: Mapping[str, Any]
) -> tuple[list[TelemetryValue], list[BitValue]]:
    """Return what the telemetry of a chip means.

    Args:
        family: the chip's.
        decoder: reads its words; None: they are not read.
        values: the telemetry.
    """
    numbers: list[TelemetryValue] = []
    words: list[BitValue] = []
    for key, value in values.items():
        row = family.values.named(key)
        if row is not None and row.fields and isinstance(value, int):
            words.append(_word(key, key.partition(" ")[0], value, row.fields, decoder))
        else:
            numbers.append(_number(key, value, row))
    known = {bit for word in words for bit, _ in word.bits}
    return [one for one in numbers if not _says_bits(one, known)], words


def _says_bits(number: TelemetryValue, known: set[str]) -> bool:
    """Whether a text is a list of bits that are shown as lamps."""
    names = number.text.split()
    return bool(names) and set(names) <= known


def _number(name: str, value: Any, row: Value | None) -> TelemetryValue:
    """Return a number, or a text; a share of full scale in per cent."""
    if isinstance(value, str):
        return TelemetryValue(name, value, "")
    if row is not None and row.step and not row.unit:
        return TelemetryValue(name, rounded(100 * value), "%")
    return TelemetryValue(name, rounded(value), row.plain_unit if row is not None else "")


def rounded(value: float) -> str:
    """Return a number with as many digits as people read: two decimals, or four that tell."""
    if isinstance(value, int):
        return str(value)
    # Currents and speeds near 0 would be 0.00 with two decimals.
    text = f"{value:.4f}" if abs(value) < 1 else f"{value:.2f}"
    if not float(text):
        return f"{value:.1e}" if value else "0"
    return text.rstrip("0").rstrip(".")


def _word(
    key: str, name: str, value: int, rows: tuple[Bit, ...], decoder: Decoder | None
) -> BitValue:
    # Words are bytes or 16 bits wide in every family; their highest bit says which.
    digits = 2 if max(row.number for row in rows) < 8 else 4
    text = f"{value:0{digits}X}H"
    if decoder is not None and name in decoder.WORDS:
        said, colon, _ = decoder.show_word(name, value).partition(": ")
        text = said if colon else text
    # A name with a comma is one of several bits that make a number, which the decoder shows.
    single = sorted((row for row in rows if "," not in row.name), key=_place, reverse=True)
    return BitValue(key, text, tuple((row.name, bool(value & row.mask)) for row in single))


def _place(row: Bit) -> int:
    return row.number
