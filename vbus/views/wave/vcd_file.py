"""A VCD file in one of two profiles: its head by pyvcd, its changes many at a time.

Time scale 100 ps.
"""

import re
from collections.abc import Mapping
from typing import Any, Final, TextIO

from mypy_extensions import i64

from vbus.core.signals import Reading
from vbus.version import __version__
from vbus.views.wave.signals import FULL, Signal, bit_names

TICK: Final = 100
"""Picoseconds of the time scale: limits of the MCP-1200 have tenths of nanoseconds."""


Change = tuple[int, Signal, Reading]
"""Instant (ps), signal, value from then on."""

# All values of a byte, with the one before, would be 65,536: those in use are few.
MOST_TEXTS: Final = 4096
"""Texts of values that are cached of a signal: the next is as likely as not one of them."""


class _Written:
    """A signal in the file, and what is written when it changes.

    Args:
        variables: of pyvcd: one, or one for each bit.
        real: it is written as a real number.
        value: that the head has.
    """

    def __init__(self, variables: list[Any], real: bool, value: Any) -> None:
        self.variables: list[Any] = variables
        self.real: bool = real
        self.latest: Any = value
        self.texts: dict[Any, str] = {}
        """By value; or by the one before and the value, where only bits that differ are written."""

    def text(self, value: Any) -> str:
        """Return what stands in the file when it changes to ``value``."""
        if len(self.texts) >= MOST_TEXTS:
            self.texts.clear()
        if len(self.variables) == 1:
            shown = float(value) if self.real else value
            text = self.variables[0].format_value(shown, True)
            self.texts[value] = text
        else:
            differ = int(self.latest) ^ int(value)
            text = "\n".join(
                variable.format_value(int(value) >> bit & 1, True)
                for bit, variable in enumerate(self.variables) if differ >> bit & 1
            )  # fmt: skip
            self.texts[self.latest, value] = text
        return str(text)


class VcdFile:
    """Writes changes in order of time.

    Args:
        file: takes the text.
        profile: ``"full"`` or ``"sigrok"``.
    """

    def __init__(self, file: TextIO, profile: str) -> None:
        self._file: TextIO = file
        self._full: bool = profile == FULL
        self._writer: Any = None
        self._signals: dict[Signal, _Written] = {}
        self._tick: int = -1
        """The latest that stands in the file."""
        self._used: set[tuple[str, str]] = set()

    def begin(self, signals: list[Signal], values: Mapping[Signal, Reading], first: int) -> None:
        """Write the head with the values at instant ``first`` (ps)."""
        from vcd import VCDWriter

        self._writer = VCDWriter(
            self._file,
            timescale="100 ps",
            date="",  # equal runs give equal files
            version=f"vbus {__version__}",
            init_timestamp=first // TICK,
        )
        for signal in signals:
            # sigrok knows wires alone: values and texts are left out of its profile.
            if self._full or signal.net is not None:
                value = values.get(signal)
                real = signal.kind == "value" and not isinstance(value, str)
                variables = self._declared(signal, value)
                begun = variables[0].value if len(variables) == 1 else value
                self._signals[signal] = _Written(variables, real, begun)
        self._tick = first // TICK
        self._writer.flush()
        self._file.flush()

    def _declared(self, signal: Signal, value: Any) -> list[Any]:
        """Declare the variables of a signal: one, or where single bits are wanted one a wire."""
        register = self._writer.register_var
        if signal.net is not None and not self._full:
            bits = enumerate(bit_names(signal.name, signal.net.width))
            return [
                register("vbus", self._unlike("", name), "wire", size=1, init=value >> bit & 1)
                for bit, name in bits
            ]
        scope, dot, name = signal.name.partition(".")
        if not dot:
            scope, name = "nets", signal.name
        name = self._unlike(scope, re.sub(r"\s", "_", name))
        scope = scope.replace(" ", "_")
        if signal.net is not None:
            return [register(scope, name, "wire", size=signal.net.width, init=value)]
        if signal.kind == "value" and not isinstance(value, str):
            return [register(scope, name, "real", init=float(value or 0))]
        return [register(scope, name, "string", init=str(value or ""))]

    def _unlike(self, scope: str, name: str) -> str:
        """Return a name that no other variable of a scope has."""
        while (scope, name) in self._used:
            name += "_"
        self._used.add((scope, name))
        return name

    def write(self, changes: list[Change]) -> None:
        """Write changes in order of time."""
        signals = self._signals
        tick: i64 = self._tick
        lines: list[str] = []
        for when, signal, value in changes:
            written = signals.get(signal)
            if written is None or value == written.latest:
                continue
            key = value if len(written.variables) == 1 else (written.latest, value)
            text = written.texts.get(key) or written.text(value)
            written.latest = value
            instant: i64 = when
            # Several changes of one tick stand below one time.
            if instant // TICK != tick:
                tick = instant // TICK
                lines.append(f"#{tick}")
            lines.append(text)
        self._tick = tick
        if lines:
            lines.append("")
            self._file.write("\n".join(lines))

    def flush(self) -> None:
        """Hand on what was written."""
        self._file.flush()

    def close(self, when: int) -> None:
        """End the text at ``when`` (ps)."""
        if when // TICK > self._tick:
            self._file.write(f"#{when // TICK}\n")
        self._file.flush()
