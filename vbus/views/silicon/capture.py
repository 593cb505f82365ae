"""Captures of a logic analyser: what every file format comes down to, and errors in them."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from vbus.core.errors import CaptureError
from vbus.core.kernel import END, MS, NS, SECOND, US

Sample = tuple[int, int]
"""An instant (ps), and the channels from then on: bit n is channel n. While a channel is unknown
(x or z in the file) bit n + :data:`UNKNOWN` is set, and bit n is the last level that was known, 0
before there is one."""

MOST_CHANNELS: Final = 4096
"""Channels of a capture, each bit of a vector counted."""
UNKNOWN: Final = MOST_CHANNELS
"""How far above a channel the bit stands that says it is unknown."""
# Nearly three hours at 1 MHz without a change left out: more is no capture of one test.
MOST_LINES: Final = 10**10
"""Samples read of a capture."""
LONGEST_TEXT: Final = 1 << 20
"""Bytes of a line, a word or a comment."""
FASTEST: Final = SECOND
"""Hertz at most: time has nothing finer than a picosecond."""
_FREQUENCY: Final = re.compile(r"(\d+(?:\.\d+)?)\s*([kMG]?)(?:Hz)?", re.IGNORECASE | re.ASCII)
_PREFIXES: Final = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9}


@dataclass
class Capture:
    """A capture that is read as it goes by.

    Attributes:
        channels: names, least significant bit first.
        period: how finely it was sampled (ps); 0 if it does not say.
        samples: the first levels, and then those after each change, in order of time. They can be
            read once.
    """

    channels: list[str]
    period: int
    samples: Iterator[Sample]


def frequency(text: str, where: str) -> int:
    """Return hertz of ``"24 MHz"`` or ``"24000000"``; 0 if it is neither.

    Args:
        text: the frequency.
        where: what an error calls the place it stands at.

    Raises:
        CaptureError: it is more than :data:`FASTEST`.
    """
    match = _FREQUENCY.fullmatch(text.strip())
    if match is None:
        return 0
    # "m" stands for mega here: no analyser samples at millihertz.
    hertz = float(match[1]) * _PREFIXES[match[2].lower()]
    if hertz > FASTEST:
        raise CaptureError(f"{where}: a sample rate of {match[0][:40]} is above 1 THz")
    return round(hertz)


def period_of(hertz: int) -> int:
    """Return the time between two samples (ps), rounded up."""
    return -(-SECOND // hertz)


def unit_of(hertz: int) -> int:
    """Return the unit (ps) in which sigrok-cli writes times at a sample rate."""
    for limit, unit in ((10**3, MS), (10**6, US), (10**9, NS)):
        if hertz <= limit:
            return unit
    return 1


def ordered(samples: Iterable[Sample], name: str) -> Iterator[Sample]:
    """Pass samples on from instant 0 at the earliest; leave out what changes nothing.

    Raises:
        CaptureError: time runs backwards or does not end, or there are no samples.
    """
    shift = 0
    last = -1
    levels = -1
    for number, (when, value) in enumerate(samples):
        if number >= MOST_LINES:
            raise CaptureError(f"{name}: more than {MOST_LINES} samples; cut the capture")
        if levels < 0:
            # Instants before a trigger are negative; a board begins at 0.
            shift = max(0, -when)
        elif when + shift < last:
            raise CaptureError(f"{name}: time runs backwards at {when} ps, after {last - shift} ps")
        last = when + shift
        if last > END:
            text = f"{when} ps" if when < 1 << 128 else "an instant"
            raise CaptureError(
                f"{name}: {text} is beyond the end of time, {END // SECOND} s after the capture's"
                " beginning; cut the capture, or look at its unit of time"
            )
        if value != levels:
            levels = value
            yield last, value
    if levels < 0:
        raise CaptureError(f"{name}: there are no samples in it")
