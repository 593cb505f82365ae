"""What a waveform can show of a board: nets, values of the chips, commands, violations."""

import fnmatch
import re
from collections.abc import Iterable
from typing import Final

from vbus.board.board import Board
from vbus.errors import VbusError
from vbus.signals import Net

FULL: Final = "full"
SIGROK: Final = "sigrok"
PROFILES: Final = (FULL, SIGROK)

_RANGE: Final = re.compile(r"(.*?)(\d+)-\D*(\d+)")

Value = int | float | str


class Signal:
    """One thing that changes.

    Attributes:
        name: ``"x./CS"``, ``"x.real"``, ``"x.packet"``.
        kind: ``"net"``, ``"value"``, ``"command"`` or ``"violation"``.
        width: wires of a net; else 0.
        shown: whether it is in the file; a trigger may look at any.
        number: place in the list of signals.
    """

    __slots__ = ("kind", "name", "number", "shown", "width")

    def __init__(self, name: str, kind: str, width: int = 0, shown: bool = True) -> None:
        self.name: str = name
        self.kind: str = kind
        self.width: int = width
        self.shown: bool = shown
        self.number: int = -1


def net_names(board: Board) -> dict[str, Net]:
    """Return the nets by the name of each pin on them, and by their own."""
    names = {
        f"{chip.name}.{row.name}": chip.pins[row.name].net
        for chip in board.chips
        for row in chip.pin_rows
    }
    return names | {net.name: net for net in names.values()}


def signals_of(
    board: Board, patterns: Iterable[str], watched: Net | None = None
) -> tuple[list[Net], list[Signal]]:
    """Return everything that is looked at: the nets, and the signals, those of the nets first.

    Args:
        board: the board.
        patterns: what is shown; see :func:`nets_of`.
        watched: a net that a trigger looks at, shown or not.

    Raises:
        VbusError: a pattern matches nothing; says what there is.
    """
    patterns = list(patterns)
    nets = nets_of(board, patterns)
    signals = [Signal(net.name, "net", net.width) for net in nets]
    if watched is not None and watched not in nets:
        nets.append(watched)
        signals.append(Signal(watched.name, "net", watched.width, shown=False))
    for name in values_of(board):
        signals.append(Signal(name, "value", shown=chosen(name, patterns)))
    for name in texts_of(board):
        kind = "command" if name.endswith(".packet") else "violation"
        signals.append(Signal(name, kind, shown=chosen(name, patterns)))
    for number, signal in enumerate(signals):
        signal.number = number
    return nets, signals


def nets_of(board: Board, patterns: Iterable[str]) -> list[Net]:
    """Return the nets whose own name, or that of a pin on them, matches a pattern.

    Without patterns: the host buses and every pin but those that carry fast waveforms.

    Raises:
        VbusError: a pattern matches nothing; says what there is.
    """
    patterns = list(patterns)
    names = net_names(board)
    if not patterns:
        usual: list[Net] = []
        for chip in board.chips:
            for row in chip.pin_rows:
                net = chip.pins[row.name].net
                if not row.wave and net not in usual:
                    usual.append(net)
        return usual
    found: list[Net] = []
    for pattern in patterns:
        matched = [names[name] for name in names if fnmatch.fnmatchcase(name, pattern)]
        others = [*values_of(board), *texts_of(board)]
        if not matched and not any(fnmatch.fnmatchcase(name, pattern) for name in others):
            known = ", ".join([*sorted(names), *others])
            raise VbusError(f'no signal matches "{pattern}"; there are {known}')
        found += [net for net in matched if net not in found]
    return found


def values_of(board: Board) -> list[str]:
    """Return the names of what chips tell of themselves, ``"chip.name"``."""
    return [
        f"{chip.name}.{name.replace(' ', '_')}" for chip in board.chips for name in chip.telemetry()
    ]


def texts_of(board: Board) -> list[str]:
    """Return the names of what is told in words, ``"chip.packet"`` and ``"chip.violation"``."""
    return [f"{chip.name}.{what}" for chip in board.chips for what in ("packet", "violation")]


def chosen(name: str, patterns: Iterable[str]) -> bool:
    """Tell whether something is asked for; without patterns everything is."""
    patterns = list(patterns)
    return not patterns or any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)


def bit_names(name: str, width: int) -> list[str]:
    """Return plain names for the wires of a net, least significant first.

    ``"x.D0-D7"`` becomes ``x_D0`` to ``x_D7``, ``"x./CS"`` becomes ``x_CS``.
    """
    match = _RANGE.fullmatch(name) if width > 1 else None
    if match is not None:
        first, last = int(match[2]), int(match[3])
        if last - first + 1 == width:
            return [plain(f"{match[1]}{number}") for number in range(first, last + 1)]
    if width == 1:
        return [plain(name)]
    return [f"{plain(name)}_{number}" for number in range(width)]


def plain(name: str) -> str:
    """Return a name of ASCII letters, digits and underscores."""
    return re.sub(r"[^A-Za-z0-9]+", "_", name.replace("/", "").replace("~", "")).strip("_")
