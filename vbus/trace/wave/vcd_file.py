"""A VCD file in one of two profiles, written by pyvcd. Time scale 100 ps."""

from collections.abc import Mapping
from typing import Any, Final, TextIO

from vbus.trace.wave.signals import FULL, Signal, Value, bit_names
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
        self._variables: dict[int, list[Any]] = {}
        self._kinds: dict[int, str] = {}

    def begin(self, signals: list[Signal], values: Mapping[int, Value], first: int) -> None:
        """Write the head with the values at instant ``first`` (ps)."""
        from vcd import VCDWriter

        self._writer = VCDWriter(
            self._file,
            timescale="100 ps",
            date="",
            version=f"vbus {__version__}",
            init_timestamp=first // TICK,
        )
        used: set[str] = set()
        for signal in signals:
            self._kinds[signal.number] = signal.kind
            if not signal.shown:
                continue
            if signal.kind == "net":
                self._net(signal, int(values.get(signal.number, 0)), used)
            elif self._full:
                self._other(signal, values.get(signal.number), used)
        self._writer.flush()
        self._file.flush()

    def _net(self, signal: Signal, value: int, used: set[str]) -> None:
        if self._full:
            scope, name = _split(signal.name, used)
            variable = self._writer.register_var(scope, name, "wire", size=signal.width, init=value)
            self._variables[signal.number] = [variable]
            return
        variables = []
        for bit, name in enumerate(bit_names(signal.name, signal.width)):
            while name in used:
                name += "_"
            used.add(name)
            init = value >> bit & 1
            variables.append(self._writer.register_var("vbus", name, "wire", size=1, init=init))
        self._variables[signal.number] = variables

    def _other(self, signal: Signal, value: Value | None, used: set[str]) -> None:
        scope, name = _split(signal.name, used)
        if signal.kind == "value" and not isinstance(value, str):
            variable = self._writer.register_var(scope, name, "real", init=float(value or 0))
        else:
            variable = self._writer.register_var(scope, name, "string", init=str(value or ""))
        self._variables[signal.number] = [variable]

    def change(self, when: int, number: int, value: Value) -> None:
        """Write a change at ``when`` (ps)."""
        variables = self._variables.get(number)
        if variables is None:
            return
        tick = when // TICK
        if len(variables) > 1:
            for bit, variable in enumerate(variables):
                self._writer.change(variable, tick, int(value) >> bit & 1)
        elif self._kinds[number] == "value" and not isinstance(value, str):
            self._writer.change(variables[0], tick, float(value))
        else:
            self._writer.change(variables[0], tick, value)

    def flush(self) -> None:
        """Hand on what was written."""
        self._file.flush()

    def close(self, when: int) -> None:
        """End the text at ``when`` (ps)."""
        self._writer.close(when // TICK)
        self._file.flush()


def _split(name: str, used: set[str]) -> tuple[str, str]:
    """Return scope and name of a signal, unlike all others."""
    scope, dot, rest = name.partition(".")
    if not dot:
        scope, rest = "nets", name
    rest = "".join("_" if c.isspace() else c for c in rest)
    while f"{scope}.{rest}" in used:
        rest += "_"
    used.add(f"{scope}.{rest}")
    return scope.replace(" ", "_"), rest
