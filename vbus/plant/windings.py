"""What the windings of a stepper motor make of step pulses and phase currents, and its torque."""

from typing import Final

from vbus.core.options import Option
from vbus.plant.angle import ELEVENTH, FIFTH, FIRST, LAST, NINTH, SEVENTH, THIRD, part

STEP_OPTIONS: Final = (
    Option("full_steps", "count", 200, "full steps a revolution, four for each electrical cycle"
           " of the phase currents", low=4, high=1 << 16),
    Option("steps_per_rev", "count", 200, "step pulses a revolution; more than the full steps if"
           " the driver makes microsteps", low=1, high=1 << 24),
)  # fmt: skip

_ROOT_THREE: Final = 1.7320508075688772


def field(a: float, b: float, c: float, three: bool) -> tuple[float, float, bool]:
    """Return the sine and cosine part of the field that phase currents make.

    With two phases A is the sine and B the cosine; with three, B leads A by 120 degrees and C
    lags it. A third current tells them apart; where A, B and C add up to 0 without it, ``three``,
    the last answer, still holds.

    Returns:
        ``(sine part, cosine part, three phases)``
    """
    if c != 0.0:
        three = True
    elif a + b != 0.0:
        three = False
    if three:
        return a, (b - c) / _ROOT_THREE, True
    return a, b, False


def torque(turns: float, across: float, along: float, holding: float) -> float:
    """Return the torque (N*m) of a field on a rotor.

    Args:
        turns: electrical angle of the rotor (1.0 is a full circle).
        across: sine part of the field.
        along: its cosine part.
        holding: torque of a field of 1.0 across the rotor (N*m).
    """
    ahead = turns + 0.25
    if not 0.0 <= turns < 1.0:
        turns, ahead = part(turns), part(ahead)
    # Two times sine(), side by side: a processor takes little longer for both than for one.
    if turns > 0.75:
        turns -= 1.0
    elif turns > 0.25:
        turns = 0.5 - turns
    if ahead > 0.75:
        ahead -= 1.0
    elif ahead > 0.25:
        ahead = 0.5 - ahead
    x, y = turns * turns, ahead * ahead
    sine = turns * (
        FIRST + x * (THIRD + x * (FIFTH + x * (
            SEVENTH + x * (NINTH + x * (ELEVENTH + x * LAST))
        )))
    )  # fmt: skip
    cosine = ahead * (
        FIRST + y * (THIRD + y * (FIFTH + y * (
            SEVENTH + y * (NINTH + y * (ELEVENTH + y * LAST))
        )))
    )  # fmt: skip
    return holding * (across * cosine - along * sine)
