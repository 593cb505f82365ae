"""What a waveform can show of a board: nets, values of the chips, commands, violations."""

import fnmatch
import re
from collections.abc import Sequence
from pathlib import PurePath
from typing import Final

from msgspec import Struct

from vbus.board.board import Board
from vbus.core.errors import VbusError
from vbus.core.signals import Net, Reading
from vbus.events.names import net_names

FULL: Final = "full"
SIGROK: Final = "sigrok"
PROFILES: Final = (FULL, SIGROK)


def vcd_name(path: str) -> None:
    """Refuse a name of a waveform that promises another format, such as FST.

    Raises:
        VbusError: it ends otherwise; a name without an ending, such as that of a pipe, may be.
    """
    if PurePath(path).suffix.lower() not in ("", ".vcd"):
        raise VbusError(f"{path}: a waveform is a VCD file; its name ends in .vcd")


class Signal(Struct, eq=False):
    """One thing that changes.

    Attributes:
        name: ``"x./CS"``, ``"x.real"``, ``"x.packet"``.
        kind: ``"net"``, ``"value"`` or ``"text"``.
        net: the net, if it is one.
    """

    name: str
    kind: str
    net: Net | None = None


def signals_of(board: Board, patterns: Sequence[str]) -> list[Signal]:
    """Return everything that is shown, nets first.

    Args:
        board: the board.
        patterns: what is shown; see :func:`nets_of`.

    Raises:
        VbusError: a pattern matches nothing; says what there is.
    """
    signals = [Signal(net.name, "net", net) for net in nets_of(board, patterns)]
    signals += [Signal(name, "value") for name in values_of(board) if _chosen(name, patterns)]
    signals += [Signal(name, "text") for name in texts_of(board) if _chosen(name, patterns)]
    return signals


def nets_of(board: Board, patterns: Sequence[str]) -> list[Net]:
    """Return the nets whose own name, or that of a pin on them, matches a pattern.

    Without patterns: the host buses and every pin but those that carry fast waveforms.

    Raises:
        VbusError: a pattern matches nothing; says what there is.
    """
    names = net_names(board)
    found: list[Net] = []
    if not patterns:
        for chip in board.chips:
            # A clock or PWM of megahertz would be nearly all of the file.
            found += [chip.pins[row.name].net for row in chip.pin_rows if not row.wave]
    for pattern in patterns:
        matched = [names[name] for name in names if fnmatch.fnmatchcase(name, pattern)]
        others = [*values_of(board), *texts_of(board)]
        if not matched and not fnmatch.filter(others, pattern):
            known = ", ".join([*sorted(names), *others])
            raise VbusError(f'no signal matches "{pattern}"; there are {known}')
        found += matched
    return list(dict.fromkeys(found))


def values_of(board: Board) -> dict[str, Reading]:
    """Return what chips tell of themselves, by ``"chip.name"``; they are up to date after that."""
    return {
        f"{chip.name}.{name.replace(' ', '_')}": value
        for chip in board.chips
        for name, value in chip.telemetry().items()
    }


def texts_of(board: Board) -> list[str]:
    """Return the names of signals that are words, ``"chip.packet"`` and ``"chip.violation"``."""
    return [f"{chip.name}.{what}" for chip in board.chips for what in ("packet", "violation")]


def _chosen(name: str, patterns: Sequence[str]) -> bool:
    """Tell whether something is asked for; without patterns everything is."""
    return not patterns or any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)


_RANGE: Final = re.compile(r"(.*?)(\d+)-\D*(\d+)")


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
    # A leading slash or tilde is dropped, not replaced: sigrok's decoders know CS, not _CS.
    return re.sub(r"[^A-Za-z0-9]+", "_", name.replace("/", "").replace("~", "")).strip("_")
