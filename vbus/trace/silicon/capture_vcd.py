"""Captures as VCD files, by the reader of pyvcd."""

import re
from collections import Counter
from collections.abc import Iterator
from typing import Any, BinaryIO, Final, cast

from vbus.errors import CaptureError, PluginError
from vbus.trace.names import bit_names
from vbus.trace.silicon.capture import Capture, Sample, frequency, ordered, period_of

MOST_WIRES: Final = 4096
"""Wires of a capture, each bit of a vector counted."""
_UNITS: Final = {"s": 10**15, "ms": 10**12, "us": 10**9, "ns": 10**6, "ps": 10**3, "fs": 1}
_RATE: Final = re.compile(r"\bat (\d+(?:\.\d+)? ?[kMG]?Hz)")
"""What libsigrok says of the sample rate, in a comment."""


def read_vcd(file: BinaryIO, name: str) -> Capture:
    """Read a VCD file as it goes by. Reals and strings are passed over; x and z change nothing.

    Args:
        file: the file.
        name: what messages call it.

    Raises:
        CaptureError: it is no VCD file, or has no wires.
        PluginError: pyvcd is not installed.
    """
    try:
        from vcd.reader import TokenKind, VCDParseError, tokenize
    except ImportError:
        raise PluginError("VCD captures need pyvcd; install it with: pip install pyvcd") from None
    tokens = tokenize(cast(Any, file))
    channels: list[tuple[str, str]] = []
    bits: dict[str, tuple[int, int]] = {}
    scopes: list[str] = []
    period = scale = 0
    try:
        for token in tokens:
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
    samples = _samples(tokens, bits, scale, name)
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
    if len(channels) + width > MOST_WIRES:
        raise ValueError(f"more than {MOST_WIRES} wires")
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
    tokens: Iterator[Any], bits: dict[str, tuple[int, int]], scale: int, name: str
) -> Iterator[Sample]:
    """Give the levels after all changes of an instant."""
    from vcd.reader import TokenKind, VCDParseError

    levels = 0
    when = 0
    begun = False
    try:
        for token in tokens:
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
                number = int(value) if value in ("0", "1") else value
                if isinstance(number, int):
                    mask = (1 << width) - 1
                    levels = levels & ~(mask << bit) | (number & mask) << bit
    except (VCDParseError, ValueError, AttributeError, LookupError) as error:
        raise CaptureError(f"{name}: damaged after {when} ps: {error}") from None
    if begun:
        yield when, levels
