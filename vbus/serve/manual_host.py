"""The manual host: bus cycles and pins by hand on a running board, in a session like any other."""

from typing import Any

from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.faults.table import faults
from vbus.protocols.port import PIN_LEVELS, PortError
from vbus.serve.local_socket import Order
from vbus.serve.time.steps import Steps


class ManualHost:
    """A session for bus cycles and pins by hand: its cycles obey CLAIM, and are journalled.

    Args:
        board: the board.
        steps: what lets its time stand still, and may pass it in this session.
    """

    LABEL = "scope"

    def __init__(self, board: Board, steps: Steps) -> None:
        self._board: Board = board
        self._steps: Steps = steps
        self.attach()

    def attach(self) -> None:
        """Open the session: at first, and when the board has gone back."""
        self.port: HostBus = self._board.open_port(self.LABEL)
        if self._steps.own is None:
            self._steps.own = self.port

    def orders(self) -> dict[str, Order]:
        """Return the orders by name."""
        return {"cycle": self._cycle, "pin": self._pin}

    def described(self) -> dict[str, Any]:
        """Return what there is to take in hand."""
        pins = self.port.pins
        return {
            "chips": [
                {"name": chip.name, "addresses": 1 << chip.ADDRESS_BITS}
                for chip in self._board.chips
            ],
            "pins": pins.side_names(),
            "edges": [*pins.side_names(), *pins.line_names()],
            "faults": [
                {"name": row.name, "family": row.family, "title": row.title, "target": row.target,
                 "parameters": [parameter.name for parameter in row.parameters]}
                for row in faults().values()
            ],
        }  # fmt: skip

    def _cycle(self, request: dict[str, Any]) -> dict[str, Any]:
        chip, address = self._board.chip(str(request["chip"])), int(request["address"])
        data = request.get("data")
        if not 0 <= address < 1 << chip.ADDRESS_BITS:
            raise ValueError(f"{chip.name} has addresses 0 to {(1 << chip.ADDRESS_BITS) - 1}")
        if data is not None and not 0 <= int(data) <= 0xFF:
            raise ValueError(f"{data} is no byte; allowed are 0 to 255")
        port = self.port
        try:
            port.select(1 << port.chip_number(chip.name))
            if not port.claim():
                raise ValueError(f"another session has claimed {chip.name}; try again")
            try:
                if data is None:
                    data = port.read(address)
                else:
                    port.write(address, int(data))
            finally:
                port.unclaim()
        except PortError as error:
            raise ValueError(str(error)) from None
        finally:
            port.held = False
            self._steps.still()
        return {"data": int(data), "when_ps": str(self._board.now)}

    def _pin(self, request: dict[str, Any]) -> dict[str, Any]:
        name, level = str(request["pin"]), str(request["level"])
        if level not in PIN_LEVELS:
            raise ValueError(f'"{level}" is no level; write 0, 1 or z, which lets go')
        try:
            self.port.pin(self.port.pin_number(name), PIN_LEVELS[level])
        except PortError as error:
            raise ValueError(str(error)) from None
        return {"pin": name, "level": level}

    def end(self, go_on: bool = True) -> None:
        """Let go of everything; a board that stands still goes on, if that is meant."""
        if self._steps.own is self.port:
            self._steps.own = None
            if go_on:
                self._steps.go()
        self.port.close()
