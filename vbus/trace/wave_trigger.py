"""When a waveform begins: the text of a trigger, and the test of a change against it."""

import re
from typing import Final

from vbus.errors import VbusError
from vbus.trace.wave_signals import Signal, Value

FORMS: Final = (
    "violation", "violation RULE", "CHIP.PIN rises", "CHIP.PIN falls", "command MNEMONIC",
    "CHIP.VALUE > NUMBER", "CHIP.VALUE < NUMBER",
)  # fmt: skip
"""What a trigger may say."""

_VIOLATION: Final = re.compile(r"violation(?:\s+(\S+))?")
_EDGE: Final = re.compile(r"(\S+)\s+(rises|falls)")
_COMMAND: Final = re.compile(r"command\s+(\S.*)")
_LEVEL: Final = re.compile(r"(\S+)\s*([<>])\s*([-+]?\d+(?:\.\d+)?)")


class Trigger:
    """A condition on one change.

    Args:
        text: one of :data:`FORMS`.
        signals: what there is, for names.

    Raises:
        VbusError: the text is none of the forms, or names no signal.
    """

    def __init__(self, text: str, signals: list[Signal]) -> None:
        self.text: str = text
        self._kind: str = ""
        self._name: str = ""
        self._wanted: str = ""
        self._number: float = 0.0
        text = text.strip()
        if match := _VIOLATION.fullmatch(text):
            self._kind, self._wanted = "violation", match[1] or ""
        elif match := _COMMAND.fullmatch(text):
            self._kind, self._wanted = "command", match[1]
        elif match := _EDGE.fullmatch(text):
            self._kind, self._name, self._wanted = "net", match[1], match[2]
        elif match := _LEVEL.fullmatch(text):
            self._kind, self._name, self._wanted = "value", match[1], match[2]
            self._number = float(match[3])
        else:
            raise VbusError(f'trigger "{text}": write one of: {"; ".join(FORMS)}')
        known = [signal.name for signal in signals if signal.kind == self._kind]
        if self._name and self._name not in known:
            raise VbusError(f'trigger "{text}": no "{self._name}"; there are {", ".join(known)}')

    def fires(self, signal: Signal, before: Value | None, after: Value) -> bool:
        """Tell whether this change is the one waited for."""
        if signal.kind != self._kind or (self._name and signal.name != self._name):
            return False
        if self._kind == "violation":
            return (
                not self._wanted
                or str(after) in (self._wanted,)
                or (str(after).partition(".")[0] == self._wanted)
            )
        if self._kind == "command":
            return f"{after} ".startswith(f"{self._wanted} ")
        if isinstance(after, str) or isinstance(before, str):
            return False
        if self._kind == "net":
            return before is not None and (after > before) == (self._wanted == "rises")
        if self._wanted == ">":
            return after > self._number and (before is None or before <= self._number)
        return after < self._number and (before is None or before >= self._number)
