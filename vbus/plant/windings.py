"""What the windings of a stepper motor make of step pulses and phase currents."""

from typing import Final

from vbus.options import Option

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
