"""Word widths: the one place that knows how numbers wrap, stop, round and change sign."""

from mypy_extensions import i64


def sign_extend(value: int, bits: int) -> int:
    """Read the low ``bits`` bits of ``value`` as a two's complement number."""
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> (bits - 1) else value


def wrap(value: int, bits: int) -> int:
    """Wrap ``value`` into the signed range of ``bits`` bits, as a hardware counter does."""
    half = 1 << (bits - 1)
    return ((value + half) & ((1 << bits) - 1)) - half


def wrap_word(value: i64, half: i64) -> i64:
    """Wrap ``value`` into ``-half..half - 1``, in machine words; ``half`` is a power of two.

    Good for values from -2^62 to 2^62 and for ``half`` up to 2^60. Not the number of bits: a
    compiled core would shift a literal 1 in 32 bits.
    """
    # One addition and one mask: a machine word needs no branch.
    return ((value + half) & (half + half - 1)) - half


def clamp(value: int, low: int, high: int) -> int:
    """Limit ``value`` to ``low..high``."""
    if value < low:
        return low
    return high if value > high else value


def nearest(steps: float) -> int:
    """Return the whole number of steps nearest to a value; halfway lies the one farther from 0."""
    return int(steps + 0.5) if steps >= 0.0 else -int(0.5 - steps)
