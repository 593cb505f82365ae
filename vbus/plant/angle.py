"""Sine and angle by arithmetic alone: the same bits on every machine, unlike a C library's."""

from typing import Final

NEAR: Final = 6.0
"""Turns up to which taking away one after the other is quicker than rounding."""

FIRST: Final = 6.283185307179586
"""Of Taylor's series of sin(2 pi x), up to the 13th power."""
THIRD: Final = -41.341702240399755
FIFTH: Final = 81.60524927607504
SEVENTH: Final = -76.70585975306136
NINTH: Final = 42.058693944897634
ELEVENTH: Final = -15.094642576822984
LAST: Final = 3.8199525848482803


def sine(turns: float) -> float:
    """Return the sine of an angle given in turns (1.0 is a full circle), to about 1e-9."""
    turns = part(turns)
    if turns > 0.75:
        turns -= 1.0
    elif turns > 0.25:
        turns = 0.5 - turns
    x = turns * turns
    return turns * (
        FIRST + x * (THIRD + x * (FIFTH + x * (
            SEVENTH + x * (NINTH + x * (ELEVENTH + x * LAST))
        )))
    )  # fmt: skip


def part(turns: float) -> float:
    """Return an angle without its whole turns: 0.0 to 1.0."""
    if 0.0 <= turns < NEAR:
        # Exact, as every difference here is: the same as without whole turns.
        while turns >= 1.0:
            turns -= 1.0
        return turns
    if -1.0 < turns < 0.0:
        return turns + 1.0
    turns -= int(turns)
    return turns + 1.0 if turns < 0.0 else turns


def turns_of(sine_part: float, cosine_part: float) -> float:
    """Return the angle (0.0 to 1.0 turn) of a vector, to about 2e-6 turn; 0.0 for no vector."""
    across = sine_part if sine_part >= 0.0 else -sine_part
    along = cosine_part if cosine_part >= 0.0 else -cosine_part
    if across == 0.0 and along == 0.0:
        return 0.0
    steep = across > along
    slope = along / across if steep else across / along
    square = slope * slope
    # A polynomial for arctan on 0..1, in turns.
    turns = slope * (
        0.15913361
        + square * (-0.05256880
        + square * (0.02867033
        + square * (-0.01354934
        + square * 0.00331601)))
    )  # fmt: skip
    if steep:
        turns = 0.25 - turns
    if cosine_part < 0.0:
        turns = 0.5 - turns
    if sine_part < 0.0:
        turns = 1.0 - turns
    return turns
