"""A VCD file in one of two profiles, written by pyvcd. Time scale 100 ps."""

import re
from collections.abc import Mapping
from typing import Any, Final, TextIO

from vbus.conditions.names import Value
from vbus.trace.names import bit_names
from vbus.trace.wave.signals import FULL, Signal
from vbus.version import __version__

TICK: Final = 100
"""Picoseconds of the time scale: limits of the MCP-1200 have tenths of nanoseconds."""


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
        self._variables: dict[Signal, list[Any]] = {}
        self._used: set[tuple[str, str]] = set()

    def begin(self, signals: list[Signal], values: Mapping[Signal, Value], first: int) -> None:
        """Write the head with the values at instant ``first`` (ps)."""
        from vcd import VCDWriter

        self._writer = VCDWriter(
            self._file,
            timescale="100 ps",
            date="",
            version=f"vbus {__version__}",
            init_timestamp=first // TICK,
        )
        for signal in signals:
            if signal.shown and (self._full or signal.net is not None):
                self._variables[signal] = self._declared(signal, values.get(signal))
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

    def change(self, when: int, signal: Signal, value: Value) -> None:
        """Write a change at ``when`` (ps)."""
        variables = self._variables.get(signal, [])
        tick = when // TICK
        if len(variables) > 1:
            for bit, variable in enumerate(variables):
                self._writer.change(variable, tick, int(value) >> bit & 1)
        elif variables:
            real = signal.kind == "value" and not isinstance(value, str)
            self._writer.change(variables[0], tick, float(value) if real else value)

    def flush(self) -> None:
        """Hand on what was written."""
        self._file.flush()

    def close(self, when: int) -> None:
        """End the text at ``when`` (ps)."""
        self._writer.close(when // TICK)
        self._file.flush()
