"""The PID filter with feed-forward (R61-R6A)."""

from typing import Final

from vbus.bits import clamp
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.lead import MC_MAX, MC_MIN

LONGEST_SPAN: Final = 8


class PidFilter:
    """MC = P/32 + I/8192 + D/8 + V/16 + A in R08 steps, in 1/16 of a step, one floor at the end.

    The integrator rests in a sample after a saturated one (MCP-FLT-3).
    """

    __slots__ = ("_errors", "_integral", "_saturated", "_velocity")

    def __init__(self) -> None:
        self._errors: list[int] = [0] * LONGEST_SPAN
        """Errors of the last samples, the latest first."""
        self._integral: int = 0
        self._velocity: int = 0
        self._saturated: bool = False

    @property
    def integral(self) -> int:
        """The integral accumulator IACC."""
        return self._integral

    def clear(self) -> None:
        """Forget old samples (MCP-FLT-5)."""
        self._errors[:] = [0] * LONGEST_SPAN
        self._integral = 0
        self._velocity = 0
        self._saturated = False

    def step(self, image: bytes, error: int, velocity: int) -> int:
        """Return the motor command, not limited.

        Args:
            image: the registers at the sample's start.
            error: position error after the deadband (16 bits).
            velocity: command velocity in 1/256 count per sample (MCP-FLT-4).
        """
        if not self._saturated:
            limit = (image[ds.INTEGRAL_LIMIT_MSB] & 0x7F) << 8 | image[ds.INTEGRAL_LIMIT_LSB]
            self._integral = clamp(self._integral + error, -limit, limit)
        span = image[ds.DERIVATIVE_SPAN]
        if span not in ds.DERIVATIVE_SPANS:
            span = 1
        change = error - self._errors[span - 1]
        self._errors.pop()
        self._errors.insert(0, error)
        acceleration = velocity - self._velocity
        self._velocity = velocity
        command = (
            256 * image[ds.KP] * error
            + image[ds.KI] * self._integral
            + 1024 * image[ds.KD] * change
            + 2 * image[ds.KV] * velocity
            + 32 * image[ds.KA] * acceleration
        ) >> 9
        self._saturated = command > MC_MAX or command < MC_MIN
        return command

    def save(self) -> tuple[object, ...]:
        """Return the state."""
        return (tuple(self._errors), self._integral, self._velocity, self._saturated)

    def load(self, state: tuple[object, ...]) -> None:
        """Take back what :meth:`save` gave."""
        errors, self._integral, self._velocity, self._saturated = state  # type: ignore[assignment]
        self._errors[:] = errors  # type: ignore[call-overload]
