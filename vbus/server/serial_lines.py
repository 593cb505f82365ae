"""Hosts at the end of a serial line: its time, and the pins that follow its modem lines."""

from collections.abc import Iterable

from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.board.sections import HostSection
from vbus.protocols.base import Protocol
from vbus.protocols.serial_line import BREAK, DTR, RTS, ModemPins, SerialLine, frame_ps


def on_line(host: HostSection, board: Board, port: HostBus, wire: Protocol) -> SerialLine | None:
    """Return a wire format at the end of the line a host entry describes; None without a line.

    Args:
        host: the entry.
        board: the board.
        port: the session's port.
        wire: the wire format, on that port.
    """
    modem = None
    if any(host.driven.values()):
        lines = ((DTR, host.dtr), (RTS, host.rts), (BREAK, host.breaks))
        modem = ModemPins(
            tuple((bit, number) for bit, pins in lines for number in _numbers(board, port, pins)),
            tuple(_numbers(board, port, host.reset)),
            host.change_time,
        )
    elif not host.baud:
        return None
    port.promises = not host.baud
    return SerialLine(port, wire, frame_ps(host.baud, host.frame) if host.baud else 0, modem)


def _numbers(board: Board, port: HostBus, pins: Iterable[str]) -> Iterable[int]:
    """Return the numbers of the session's side pins that are on the nets of these, each once."""
    nets = [board.find_pin(name).net for name in pins]
    return [number for number, side in enumerate(port.pins.sides) if side.net in nets]
