"""Faults of what stands between hosts and chips: a wire that is shorted, a part that is slow."""

from typing import Protocol

from vbus.circuit.circuit import Circuit
from vbus.core.kernel import Kernel
from vbus.core.options import Value
from vbus.core.signals import Net
from vbus.protocols.quantities import format_instant


class Placed(Protocol):
    """A fault of one wire or one part, while it acts."""

    def begin(self, again: bool = False) -> str:
        """Let it act; return what is changed. ``again``: a saved state has it already."""

    def end(self) -> None:
        """Let it act no more."""

    def leave(self) -> None:
        """Leave its place as it is: another state is being loaded."""


class ShortedNet:
    """A wire that is shorted to ground or to the supply.

    Args:
        net: the wire.
        kernel: the board's time.
        values: the fault's parameters.
    """

    def __init__(self, net: Net, kernel: Kernel, values: dict[str, Value]) -> None:
        self._net: Net = net
        self._kernel: Kernel = kernel
        self._level: int = int(values["level"])

    def begin(self, again: bool = False) -> str:
        """Short it."""
        self._net.bend(self._bend)
        if not again:
            self._resolve()
        return f"{self._net.name} is {'high' if self._level else 'low'}, whatever drives it"

    def end(self) -> None:
        """Let it have the level that is driven."""
        self.leave()
        self._resolve()

    def leave(self) -> None:
        """Bend it no more."""
        self._net.unbend(self._bend)

    def _bend(self, level: int) -> int:
        return self._level

    def _resolve(self) -> None:
        self._net.resolve()
        self._kernel.settle()


class SlowPart:
    """A part of glue that takes longer.

    Args:
        board: the board.
        name: the part's name.
        values: the fault's parameters.
    """

    def __init__(self, board: Circuit, name: str, values: dict[str, Value]) -> None:
        self._part = next(part for part in board.glue.parts if part.name == name)
        self._by: int = int(values["by"])

    def begin(self, again: bool = False) -> str:
        """Make it slow."""
        for block in self._part.blocks:
            block.slow(self._by)
        return f"outputs of {self._part.name} follow {format_instant(self._by)} later"

    def end(self) -> None:
        """Make it as fast as it was; what is on its way comes when it was to come."""
        self.leave()

    def leave(self) -> None:
        """Make it as fast as it was."""
        for block in self._part.blocks:
            block.slow(-self._by)


def glue_fault(board: Circuit, name: str, target: str, values: dict[str, Value]) -> Placed:
    """Return the fault ``name`` of a wire or part."""
    if name == "part_slow":
        return SlowPart(board, target, values)
    return ShortedNet(net_of(board, target), board.kernel, values)


def net_of(board: Circuit, name: str) -> Net:
    """Return a wire by its own name, or by that of a pin on it.

    Raises:
        ValueError: there is none.
    """
    net = board.nets.get(name)
    return net if net is not None else board.find_pin(name).net
