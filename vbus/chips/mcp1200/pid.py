"""The PID filter with feed-forward (R61-R6A)."""

from vbus.bits import clamp
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.lead import MC_MAX, MC_MIN


class PidFilter:
    """MC = P/32 + I/8192 + D/8 + V/16 + A in R08 steps, in 1/16 of a step, one floor at the end.

    The integrator rests in a sample after a saturated one (MCP-FLT-3).
    """

    __slots__ = ("_errors", "_integral", "_next", "_saturated", "_velocity")

    def __init__(self) -> None:
        self._errors: list[int] = [0] * 8
        self._next: int = 0
        self._integral: int = 0
        self._velocity: int = 0
        self._saturated: bool = False

    @property
    def integral(self) -> int:
        """The integral accumulator IACC."""
        return self._integral

    def clear(self) -> None:
        """Forget old samples (MCP-FLT-5)."""
        for place in range(8):
            self._errors[place] = 0
        self._next = 0
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
        change = error - self._errors[(self._next - span) & 7]
        self._errors[self._next] = error
        self._next = (self._next + 1) & 7
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
        return (
            tuple(self._errors), self._next, self._integral, self._velocity, self._saturated,
        )  # fmt: skip

    def load(self, state: tuple[object, ...]) -> None:
        """Take back what :meth:`save` gave."""
        errors, self._next, self._integral, self._velocity, self._saturated = state  # type: ignore[assignment]
        self._errors[:] = errors  # type: ignore[call-overload]
