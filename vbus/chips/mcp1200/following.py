"""From command and actual position to the error the filters see: backlash, deadband, limits."""

from vbus.bits import saturate, wrap
from vbus.chips.mcp1200 import datasheet as ds


class Following:
    """Position error of one sample, and the backlash offset hidden in it.

    Attributes:
        offset: counts added to the command by backlash compensation (MCP-ERR-1).
        error: PE, 16 bits, after the deadband (MCP-ERR-4).
        in_position: the error before the deadband is at most R45 + 1 (MCP-STA-4).
        too_large: it exceeds R4A:R49 (MCP-ERR-2).
    """

    __slots__ = ("_command", "_direction", "error", "in_position", "offset", "too_large")

    def __init__(self) -> None:
        self._command: int = 0
        self._direction: int = 0
        self.offset: int = 0
        self.error: int = 0
        self.in_position: bool = False
        self.too_large: bool = False

    def clear(self) -> None:
        """Forget the compensation: a reset."""
        self._command = 0
        self._direction = 0
        self.offset = 0
        self.error = 0

    def begin(self, command: int) -> None:
        """Control starts with this command position: no change so far."""
        self._command = command

    def aim(self) -> int:
        """Where the loop pulls the axis to: command and backlash offset."""
        return self._command + self.offset

    def step(self, image: bytes, command: int, actual: int) -> int:
        """Compute one sample; return by how much the command has changed (24 bits)."""
        change = wrap(command - self._command, 24)
        self._command = command
        backlash = image[ds.BACKLASH]
        if backlash == 0:
            self.offset = 0
            self._direction = 0
        elif change != 0:
            direction = 1 if change > 0 else -1
            if self._direction == -direction:
                self.offset += direction * backlash
            self._direction = direction
        error = wrap(command + self.offset - actual, 24)
        size = abs(error)
        self.too_large = min(size, 0xFFFF) > (
            image[ds.MAX_ERROR_MSB] << 8 | image[ds.MAX_ERROR_LSB]
        )
        deadband = image[ds.DEADBAND]
        self.in_position = size <= deadband + 1
        self.error = 0 if size <= deadband else saturate(error, 16)
        return change

    def save(self) -> tuple[int, ...]:
        """Return the state."""
        return (
            self._command, self._direction, self.offset, self.error, int(self.in_position),
            int(self.too_large),
        )  # fmt: skip

    def load(self, state: tuple[int, ...]) -> None:
        """Take back what :meth:`save` gave."""
        (
            self._command, self._direction, self.offset, self.error, in_position, too_large,
        ) = state  # fmt: skip
        self.in_position = bool(in_position)
        self.too_large = bool(too_large)
