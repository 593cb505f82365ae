"""A virtual hardware bus server: motion-control chips, bit for bit, for unmodified drivers."""

from importlib import import_module

from vbus import compiled
from vbus.version import __version__ as __version__

# Importing typing would be most of the time before ``vbus`` can answer Ctrl-C: 7 of 8 ms.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from vbus.board.board import Board as Board
    from vbus.board.build import load_board as load_board
    from vbus.client.bus import connect as connect
    from vbus.core.errors import VbusError as VbusError
    from vbus.core.signals.violation import Violation as Violation
    from vbus.serve.serving import serve as serve

if compiled.pure_wanted():
    compiled.interpret()

_HOMES = {
    "Board": "vbus.board.board",
    "VbusError": "vbus.core.errors",
    "Violation": "vbus.core.signals.violation",
    "connect": "vbus.client.bus",
    "load_board": "vbus.board.build",
    "serve": "vbus.serve.serving",
}
"""The public names and where they live: imported when first used, so ``import vbus`` is cheap."""

__all__ = ["Board", "VbusError", "Violation", "connect", "load_board", "serve"]


def __getattr__(name: str) -> object:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'vbus' has no attribute {name!r}")
    return getattr(import_module(home), name)


def __dir__() -> list[str]:
    return [*globals(), *_HOMES]
