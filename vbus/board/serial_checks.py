"""Hosts on a serial line: speeds and modem lines that their link and their board can have."""

from collections.abc import Iterator, Mapping
from typing import Final

from vbus.boardfile.lines import Path
from vbus.boardfile.sections import BoardFile, HostSection
from vbus.boardfile.source import Source
from vbus.chips.base import Chip
from vbus.protocols.serial_line import USUAL_FRAME
from vbus.values.settings import listed, quoted

MODEM_SCHEMES: Final = ("rfc2217",)
"""Schemes of links that carry modem lines and breaks."""
_TIMELESS: Final = {
    "serial": "a real line takes its own time: its speed stands in the address, ?baud=9600",
    "zenoh": "messages over the network are no serial line",
}
"""Links a line's speed means nothing to, and why."""


def check_serial(file: BoardFile, chips: Mapping[str, Chip], source: Source) -> None:
    """Check the lines of all hosts; mistakes go to ``source``.

    Args:
        file: the board file.
        chips: a specimen of each chip that could be read.
        source: takes the mistakes.
    """
    for place, host in enumerate(file.hosts):
        path: Path = ("hosts", place)
        scheme = host.transport.partition(":")[0]
        if host.baud:
            if scheme in _TIMELESS:
                source.fail((*path, "baud"), f"{_TIMELESS[scheme]}; take baud out")
            elif file.board.time == "slaved":
                source.fail(
                    (*path, "baud"),
                    "on a slaved board the host's own time stamps say when things happen; take baud"
                    " out",
                )
        elif host.frame != USUAL_FRAME:
            source.fail((*path, "frame"), "frames take no time without baud; write baud = 9600")
        for where, name in _pins(host):
            if scheme not in MODEM_SCHEMES:
                source.fail(
                    (*path, *where[:1]),
                    f"{scheme} carries no modem lines and no break; write a transport that does:"
                    f" {listed(MODEM_SCHEMES)}",
                )
            elif file.nodes:
                source.fail((*path, *where[:1]), "modem lines are for boards without nodes")
            else:
                _check_pin((*path, *where), where[0], name, host, chips, source)


def _pins(host: HostSection) -> Iterator[tuple[tuple[str, int] | tuple[str], str]]:
    """Give each pin of a modem line with the end of its path."""
    for key, names in host.driven.items():
        for number, name in enumerate(names):
            yield (key, number), name
    for key, name in host.sensed.items():
        if name:
            yield (key,), name


def _check_pin(
    path: Path, key: str, named: str, host: HostSection, chips: Mapping[str, Chip], source: Source
) -> None:
    reached = [chip for chip in host.chips or chips if chip in chips]
    wrong = "out" if key in host.driven else ""
    allowed = [
        f"{chip}.{row.name}"
        for chip in reached
        for row in chips[chip].pin_rows
        if row.direction != wrong and row.width == 1 and not (row.strobe or row.wave)
    ]
    if named not in allowed:
        source.fail(path, f"found {quoted(named)}; it may be {listed(allowed)}")
