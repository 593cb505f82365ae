"""Captures as tables: a column for each channel, and one for the time or a constant rate."""

import re
from collections.abc import Iterable, Iterator
from itertools import chain
from typing import BinaryIO, Final

from vbus.core.errors import CaptureError
from vbus.core.kernel import MS, NS, SECOND, US
from vbus.views.silicon.capture import (
    LONGEST_TEXT,
    MOST_CHANNELS,
    UNKNOWN,
    Capture,
    Sample,
    frequency,
    ordered,
    period_of,
    unit_of,
)

_TIME: Final = re.compile(r"time\s*(?:[\[(]\s*([munp\u00b5\u03bc]?s)\s*[\])])?", re.IGNORECASE)
_UNITS: Final = {
    "s": SECOND, "ms": MS, "us": US, "\u00b5s": US, "\u03bcs": US, "ns": NS, "ps": 1,
    "seconds": SECOND, "milliseconds": MS, "microseconds": US, "nanoseconds": NS, "picoseconds": 1,
}  # fmt: skip
_CHANNELS: Final = re.compile(r"Channels(?:\s*\(\d+/\d+\))?:\s*(.+)")
_RATE: Final = re.compile(r"Samplerate:\s*(.+)", re.IGNORECASE)
_SEPARATORS: Final = ",;\t"
_BESIDE: Final = (";", "#", "META ", "FRAME-BEGIN", "FRAME-END")
"""How lines begin that sigrok-cli writes beside the table."""
# Programs write their settings above the table, and some the names of all channels.
_HEAD: Final = 1000
"""Lines before the table."""


def read_csv(file: BinaryIO, name: str, hertz: int = 0) -> Capture:
    """Read a table as sigrok-cli or Saleae's software export it, as it goes by.

    Args:
        file: the file.
        name: what messages call it.
        hertz: sample rate, for tables that say nothing of time.

    Raises:
        CaptureError: it is no such table.
    """
    lines = _text(file, name)
    names: list[str] = []
    head: list[str] = []
    separator = ","
    first, line = 0, ""
    while not head:
        first, line = next(lines, (0, ""))
        if not first:
            raise CaptureError(f"{name}: there are no samples in it")
        if first > _HEAD:
            raise CaptureError(f"{name}: no table begins in the first {_HEAD} lines")
        if not line:
            continue
        if line.startswith(_BESIDE):
            channels, rate = _CHANNELS.search(line), _RATE.search(line)
            if channels:
                names = [cell.strip() for cell in channels[1].split(",")]
            hertz = (frequency(rate[1], f"{name}: line {first}") if rate else 0) or hertz
            continue
        # Spreadsheets of some languages write semicolons.
        separator = max(_SEPARATORS, key=line.count)
        head = _cells(line, separator)
    if len(head) > MOST_CHANNELS:
        raise CaptureError(
            f"{name}: line {first}: {len(head)} columns; a capture has at most {MOST_CHANNELS}"
        )
    unit = unit_of_time(head[0], hertz)
    if all(_is_number(cell) for cell in head):
        if not names or len(names) != len(head):
            raise CaptureError(f"{name}: line {first}: the names of the channels are missing")
        body: Iterable[tuple[int, str]] = chain([(first, line)], lines)
    else:
        body = lines
        labels = head[1:] if unit else head
        if not names or not all(label in ("logic", "analog") for label in labels):
            names = labels
    if len(names) != len(head) - bool(unit):
        raise CaptureError(f"{name}: line {first}: {len(head)} columns, {len(names)} channels")
    if not unit and not hertz:
        raise CaptureError(
            f"{name}: neither a column of time nor a sample rate; give it with --samplerate"
        )
    samples = _samples(body, names, unit, hertz, separator, name)
    return Capture(names, period_of(hertz) if hertz else 0, ordered(samples, name))


def _text(file: BinaryIO, name: str) -> Iterator[tuple[int, str]]:
    """Give the lines with their numbers."""
    number = 0
    while line := file.readline(LONGEST_TEXT + 1):
        number += 1
        if len(line) > LONGEST_TEXT:
            raise CaptureError(f"{name}: line {number} is longer than {LONGEST_TEXT} bytes")
        try:
            # Windows puts a byte order mark first.
            yield number, line.decode("utf-8-sig" if number == 1 else "utf-8").strip()
        except UnicodeDecodeError:
            raise CaptureError(f"{name}: line {number}: this is no text") from None


def _cells(line: str, separator: str) -> list[str]:
    return [cell.strip().strip('"').strip() for cell in line.split(separator)]


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def unit_of_time(title: str, hertz: int) -> int:
    """Return the unit (ps) of a column of time; 0 if its title is another."""
    unit = _UNITS.get(title.lower(), 0)
    match = _TIME.fullmatch(title)
    if match is None:
        return unit
    if match[1]:
        return _UNITS[match[1].lower()]
    # sigrok-cli leaves the unit out; it follows from the rate.
    return unit_of(hertz) if hertz else SECOND


def _samples(
    lines: Iterable[tuple[int, str]], names: list[str], unit: int, hertz: int, separator: str,
    name: str,
) -> Iterator[Sample]:  # fmt: skip
    before = ""
    levels = 0
    place = 0
    for number, line in lines:
        if not line:
            continue
        if line.startswith(_BESIDE):
            rate = _RATE.search(line)
            if rate and frequency(rate[1], f"{name}: line {number}") not in (0, hertz):
                raise CaptureError(
                    f"{name}: line {number}: the sample rate changes to {rate[1]}; export one"
                    " acquisition at a time"
                )
            continue
        if unit:
            time, _, values = line.partition(separator)
            try:
                when = round(float(time.strip('" ')) * unit)
            except (ValueError, OverflowError):
                raise CaptureError(f'{name}: line {number}: "{time[:40]}" is no time') from None
        else:
            values = line
            when = place * SECOND // hertz
        place += 1
        # Most lines repeat the levels of the one before: those are not read again.
        if values != before:
            before = values
            levels = _levels(values, names, separator, f"{name}: line {number}", levels)
        yield when, levels


def _levels(values: str, names: list[str], separator: str, where: str, before: int) -> int:
    """Return the levels of a line; X and Z, also of channels that nothing is at, are unknown."""
    cells = values.split(separator)
    if len(cells) != len(names):
        raise CaptureError(f"{where}: {len(cells)} values for {len(names)} channels")
    levels = 0
    for bit, cell in enumerate(cells):
        value = cell.strip('" ')
        if value == "1":
            levels |= 1 << bit
        # The last known level stays in the bit below, for what cannot be unknown.
        elif value in ("X", "x", "Z", "z"):
            levels |= before & 1 << bit | 1 << bit + UNKNOWN
        elif value != "0":
            raise CaptureError(
                f'{where}: "{value[:40]}" in column "{names[bit][:40]}" is none of 0, 1, X and Z;'
                " export logic levels"
            )
    return levels
