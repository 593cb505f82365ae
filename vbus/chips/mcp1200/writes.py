"""Bytes the host has written that are not yet visible inside."""

from typing import ClassVar

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.timer import FAR
from vbus.state import Names


class Writes:
    """Written bytes on their way in, in order (MCP-BUS-5).

    Attributes:
        due: cycle at which the first of them becomes visible, :data:`FAR` if there is none.
    """

    STATE: ClassVar[Names] = ("_waiting: list[(i64, i64, i64), ...]",)
    DERIVED: ClassVar[Names] = ("due",)

    def __init__(self) -> None:
        self._waiting: list[tuple[int, int, int]] = []
        self.due: i64 = FAR

    def add(self, cycle: int, address: int, data: int) -> None:
        """A byte has been written in ``cycle``."""
        self._waiting.append((cycle + ds.WRITE_CLK, address, data))
        self.after_load()

    def take(self) -> tuple[int, int]:
        """Return address and data of the first byte, which is visible now."""
        _, address, data = self._waiting.pop(0)
        self.after_load()
        return address, data

    def waits_for(self, registers: tuple[int, ...]) -> bool:
        """Tell whether a byte is on its way to one of some registers."""
        return any(address & 0x3F in registers for _, address, _ in self._waiting)

    def lose(self) -> None:
        """Forget the byte written last, if it is not yet visible."""
        del self._waiting[-1:]
        self.after_load()

    def clear(self) -> None:
        """Forget all of them."""
        self._waiting.clear()
        self.after_load()

    def after_load(self) -> None:
        """Find out when the first of them becomes visible."""
        self.due = self._waiting[0][0] if self._waiting else FAR
