"""Boards with one chip and its mechanics, and the host's side of them."""

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.core.kernel import MS, US

LM = '[chips.x]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "m"\n'
MCP = '[chips.x]\npart = "MCP-1200"\nclock = "20 MHz"\nplant = "m"\nhome_switch = "/STOP"\n'
MC = '[chips.x]\npart = "MC1241A"\nclock = "25 MHz"\nplants = ["m"]\n'
DC = '[plants.m]\nmodel = "dc_motor"\n'
IDEAL = '[plants.m]\nmodel = "ideal"\n'
STEPPER = '[plants.m]\nmodel = "stepper"\n'
LIMIT = '[plants.m.switches."limit+"]\nfirst = 500\nlast = 100000\n'

SAMPLE = 256 * US


def build(
    chip: str = LM,
    plant: str = DC,
    extra: str = "",
    power_on: str = "done",
    policy: str = "lockstep",
) -> Board:
    """Return a board."""
    return load_board_text(
        f'[board]\nname = "bench"\ntime = "{policy}"\npower_on = "{power_on}"\n{chip}{plant}{extra}'
    )


class Lm:
    """A host of an LM629: plain bus cycles, with the busy bit polled."""

    def __init__(self, board: Board, polls: int = 200) -> None:
        self.board: Board = board
        self.port: HostBus = board.open_port("host0")
        self._polls: int = polls

    def ready(self) -> None:
        for _ in range(self._polls):
            if not self.port.read(0) & 1:
                return
        raise TimeoutError("busy for ever")

    def command(self, code: int, *words: int) -> None:
        self.ready()
        self.port.write(0, code)
        for word in words:
            self.ready()
            self.port.write(1, word >> 8)
            self.port.write(1, word & 0xFF)
        self.ready()

    def ask(self, code: int, words: int) -> int:
        self.command(code)
        value = 0
        for _ in range(words):
            self.ready()
            value = value << 16 | self.port.read(1) << 8 | self.port.read(1)
        return value

    def status(self) -> int:
        return self.port.read(0)

    def position(self) -> int:
        value = self.ask(0x0A, 2)
        return value - (1 << 32) if value >> 31 else value

    def tune(self) -> None:
        self.command(0x1E, 0x000A, 60, 600)
        self.command(0x04)

    def spin(self, counts_per_sample: int = 4) -> None:
        """Velocity mode."""
        self.tune()
        self.command(0x1F, 0x1828, 0, 2000, counts_per_sample, 0)
        self.command(0x01)

    def move(self, target: int) -> None:
        self.tune()
        self.command(0x1F, 0x002A, 0, 2000, 8, 0, target >> 16 & 0xFFFF, target & 0xFFFF)
        self.command(0x01)

    def stop_on_error(self, limit: int) -> None:
        """LPES: bit 5 and motor off beyond ``limit`` counts."""
        self.command(0x1A, limit)


def telemetry(board: Board) -> dict[str, int | float | str]:
    return board.chips[0].telemetry()


def settle(board: Board, ms: int) -> None:
    board.run_for(ms * MS)
    board.catch_up()


class Mc:
    """A host of an MC1241A on a card with an adapter's status byte."""

    def __init__(self, board: Board, polls: int = 2000) -> None:
        self.board: Board = board
        self.port: HostBus = board.open_port("host0")
        self._polls: int = polls

    def ready(self) -> None:
        for _ in range(self._polls):
            if self.port.read(1) & 0x80:
                return
        raise TimeoutError("HostRdy stays low")

    def command(self, code: int, *words: int) -> None:
        self.ready()
        self.port.write(1, code)
        for word in words:
            self.ready()
            self.port.write(0, word >> 8)
            self.port.write(0, word & 0xFF)
        self.ready()

    def ask(self, code: int, words: int = 1) -> int:
        self.command(code)
        value = 0
        for _ in range(words):
            self.ready()
            value = value << 16 | self.port.read(0) << 8 | self.port.read(0)
        return value

    def status(self) -> int:
        return self.ask(0x31)

    def spin(self) -> None:
        """Velocity mode, slowly."""
        self.command(0x62, 24000)
        self.command(0x0A)
        self.command(0x12, 0, 0x2000)
        self.command(0x11, 0x0004, 0)
        self.command(0x1A)
        self.command(0x62, 24000)


class Mcp:
    """A host of an MCP-1200 in integral velocity mode."""

    def __init__(self, board: Board) -> None:
        self.board: Board = board
        self.port: HostBus = board.open_port("host0")

    def write(self, register: int, value: int) -> None:
        self.port.write(register, value)

    def read(self, register: int) -> int:
        return self.port.read(register)

    def spin(self) -> None:
        for register, value in ((0x01, 0x08), (0x26, 0x10), (0x3C, 2), (0x05, 3), (0x00, 0x0D)):
            self.write(register, value)
