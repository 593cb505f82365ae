"""Captures as VCD files, by the reader of pyvcd."""

import io
import re
from collections import Counter
from collections.abc import Iterator
from fractions import Fraction
from typing import Any, BinaryIO, Final

from vbus.core.errors import CaptureError, import_errors
from vbus.views.silicon.capture import (
    LONGEST_TEXT,
    MOST_CHANNELS,
    UNKNOWN,
    Capture,
    Sample,
    frequency,
    ordered,
    period_of,
)
from vbus.views.wave.signals import bit_names

_UNITS: Final = {"s": 10**15, "ms": 10**12, "us": 10**9, "ns": 10**6, "ps": 10**3, "fs": 1}
_RATE: Final = re.compile(r"\bat (\d+(?:\.\d+)? ?[kMG]?Hz)")
"""What libsigrok says of the sample rate, in a comment."""
_SCALE: Final = re.compile(rb"(\$timescale\s+)(\d{1,15}\.\d{1,15})\s*([munpf]?s)\b")
"""A unit of time that is no whole number: other tools write 0.1ns."""
_HEAD: Final = 1 << 16
"""Bytes in which it is looked for."""
_HIGH: Final = frozenset("1hH")
_LOW: Final = frozenset("0lL")
"""Weak levels of VHDL, from a pull, are levels; all others are unknown."""


class _Text(io.RawIOBase):
    """The bytes of a file, for pyvcd: with a whole unit of time, and no endless word.

    Args:
        file: the file.
        name: what messages call it.
    """

    def __init__(self, file: BinaryIO, name: str) -> None:
        self._file: BinaryIO = file
        self._name: str = name
        self._head: bytes = _SCALE.sub(self._whole, file.read(_HEAD))
        self._since: int = 0
        """Bytes read since the latest word was whole."""

    def _whole(self, found: re.Match[bytes]) -> bytes:
        """Return a unit of time in femtoseconds."""
        scale = Fraction(found[2].decode()) * _UNITS[found[3].decode()]
        if scale.denominator != 1 or not scale:
            text = b" ".join(found.group(2, 3)).decode()
            raise CaptureError(f"{self._name}: its $timescale, {text}, is no whole femtoseconds")
        return found[1] + b"%d fs" % scale.numerator

    def readinto(self, buffer: Any) -> int:
        """Fill a buffer; return how many bytes there were."""
        if self._since > LONGEST_TEXT:
            raise CaptureError(
                f"{self._name}: a comment or word in it is longer than {LONGEST_TEXT} bytes"
            )
        data = self._head[: len(buffer)] or self._file.read(len(buffer))
        self._head = self._head[len(data) :]
        self._since += len(data)
        buffer[: len(data)] = data
        return len(data)

    def word(self) -> None:
        """A word is whole."""
        self._since = 0


def read_vcd(file: BinaryIO, name: str) -> Capture:
    """Read a VCD file as it goes by. Reals and strings are passed over.

    Args:
        file: the file.
        name: what messages call it.

    Raises:
        CaptureError: it is no VCD file, or has no wires.
        PluginError: pyvcd is not installed.
    """
    with import_errors("VCD captures need pyvcd", "pyvcd"):
        from vcd.reader import TokenKind, VCDParseError, tokenize
    text = _Text(file, name)
    tokens = tokenize(text)
    channels: list[tuple[str, str]] = []
    bits: dict[str, tuple[int, int]] = {}
    scopes: list[str] = []
    period = scale = 0
    try:
        for token in tokens:
            text.word()
            if token.kind is TokenKind.TIMESCALE:
                unit = token.timescale
                scale = int(unit.magnitude) * _UNITS[unit.unit.value]
            elif token.kind is TokenKind.COMMENT:
                rate = _RATE.search(token.comment)
                hertz = frequency(rate[1], name) if rate else 0
                period = period_of(hertz) if hertz else period
            elif token.kind is TokenKind.SCOPE:
                scopes.append(token.scope.ident)
            elif token.kind is TokenKind.UPSCOPE:
                del scopes[-1:]
            elif token.kind is TokenKind.VAR and token.var.id_code not in bits:
                _variable(token.var, scopes, channels, bits)
            elif token.kind is TokenKind.ENDDEFINITIONS:
                break
    except (VCDParseError, ValueError, AttributeError, LookupError) as error:
        raise CaptureError(f"{name}: this is no VCD file: {error}") from None
    if not channels:
        raise CaptureError(f"{name}: there are no wires in it")
    if not scale:
        raise CaptureError(f"{name}: it has no $timescale")
    samples = _samples(tokens, text, bits, scale, name)
    return Capture(_unlike(channels), period or -(-scale // 1000), ordered(samples, name))


def _unlike(channels: list[tuple[str, str]]) -> list[str]:
    """Return the names, with their scope where there are several of one name."""
    times = Counter(name for _, name in channels)
    return [f"{scope}.{name}" if times[name] > 1 else name for scope, name in channels]


def _variable(
    var: Any, scopes: list[str], channels: list[tuple[str, str]], bits: dict[str, tuple[int, int]]
) -> None:
    """Note the wires of a variable; another name for wires known already is passed over."""
    kind = var.type_.value
    if kind in ("real", "realtime", "string", "event", "time"):
        return
    width = var.size
    if len(channels) + width > MOST_CHANNELS:
        raise ValueError(f"more than {MOST_CHANNELS} wires")
    bits[var.id_code] = (len(channels), width)
    index = var.bit_index
    if width == 1:
        names = [f"{var.reference}{index if isinstance(index, int) else ''}"]
    elif isinstance(index, tuple):
        names = [f"{var.reference}{min(index) + n}" for n in range(width)]
    else:
        names = bit_names(var.reference, width)
    channels.extend((".".join(scopes), name) for name in names)


def _samples(
    tokens: Iterator[Any], text: _Text, bits: dict[str, tuple[int, int]], scale: int, name: str
) -> Iterator[Sample]:
    """Give the levels after all changes of an instant."""
    from vcd.reader import TokenKind, VCDParseError

    levels = 0
    when = 0
    begun = False
    try:
        for token in tokens:
            text.word()
            kind = token.kind
            if kind is TokenKind.CHANGE_TIME:
                if begun:
                    yield when, levels
                when = token.time_change * scale // 1000
                begun = False
            elif kind in (TokenKind.CHANGE_SCALAR, TokenKind.CHANGE_VECTOR):
                begun = True
                bit, width = bits.get(token.data.id_code, (0, 0))
                value = token.data.value
                known, unknown = _value(int(value) if value in ("0", "1") else value, width)
                mask = (1 << width) - 1
                change = (mask & ~unknown) << bit
                levels = levels & ~(change | mask << bit + UNKNOWN)
                levels |= known << bit | unknown << bit + UNKNOWN
    except (VCDParseError, ValueError, AttributeError, LookupError) as error:
        raise CaptureError(f"{name}: damaged after {when} ps: {error}") from None
    if begun:
        yield when, levels


def _value(value: int | str, width: int) -> tuple[int, int]:
    """Return which bits of a value are high, and which are unknown.

    A value with fewer digits than its variable goes on to the left as it begins, with 0 after a 1.
    """
    if isinstance(value, int):
        return value & (1 << width) - 1, 0
    known = unknown = 0
    first = "0" if value[0] in _HIGH else value[0]
    for bit, digit in enumerate(reversed(value.rjust(width, first)[-width:] if width else "")):
        known |= (digit in _HIGH) << bit
        unknown |= (digit not in _HIGH and digit not in _LOW) << bit
    return known, unknown
