"""The hosts whose runs were frozen: one function for what each run shows.

They are written against the calls of a port, so that the same host can be a host of any time
policy, and one that moves strobes.
"""

from collections.abc import Callable
from dataclasses import dataclass
from random import Random

from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.chips.lm628.datasheet import COMMANDS as LM_COMMANDS
from vbus.chips.mc1241a.datasheet import COMMANDS as PMD_COMMANDS
from vbus.chips.mcp1200.datasheet import REGISTERS
from vbus.core.kernel import MS, NS, US

Play = Callable[[Board], None]


@dataclass(frozen=True)
class Frozen:
    """A run to be frozen.

    Attributes:
        name: of its files.
        text: its board file.
        covers: what it shows.
        play: its hosts.
        watch: pins whose edges belong to its trace.
        going_on: entries played on from its snapshot.
    """

    name: str
    text: str
    covers: str
    play: Play
    watch: tuple[str, ...] = ()
    going_on: int = 400


ALL: list[Frozen] = []


def freeze(
    name: str, text: str, covers: str, watch: tuple[str, ...] = (), going_on: int = 400
) -> Callable[[Play], Play]:
    """Add a run that the decorated function plays."""

    def add(play: Play) -> Play:
        ALL.append(Frozen(name, text, covers, play, watch, going_on))
        return play

    return add


# -- hosts --------------------------------------------------------------------------------------


class Host:
    """A session that keeps to its board's time policy.

    Args:
        board: the board.
        label: its name.
        chips: what it reaches; all if None.
        cycle: what a whole bus cycle costs (ps); 0 is the default.
    """

    def __init__(
        self,
        board: Board,
        label: str = "host",
        chips: tuple[str, ...] | None = None,
        cycle: int = 0,
    ) -> None:
        self.board = board
        self.port: HostBus = board.open_port(label, chips, cycle)
        self.random = Random(label)
        self.stamp = 0

    def run(self, duration: int) -> None:
        """In real time, let the wall clock bring the board on by itself."""
        if self.board.policy == "realtime":
            self.board.run_until(self.board.now + duration)
            self.board.limit = self.board.now + 2 * MS

    def come(self) -> None:
        if self.board.policy == "slaved":
            self.stamp = max(self.stamp, self.board.now) + self.random.randrange(1, 3 * US)
            self.port.at(self.stamp)
        else:
            self.run(self.random.randrange(1, 20 * US))

    def read(self, address: int) -> int:
        self.come()
        return self.port.read(address)

    def write(self, address: int, data: int) -> None:
        self.come()
        self.port.write(address, data)

    def delay(self, duration: int) -> None:
        if self.board.policy == "slaved":
            self.stamp = max(self.stamp, self.board.now) + duration
            return
        while not self.port.delay(duration):
            self.run(MS)

    def ready(self) -> None:
        if self.board.policy == "slaved":
            self.delay(130 * US)
            return
        while self.port.wait(5 * MS) is None:
            self.run(MS // 3)

    def pin(self, name: str, level: int) -> None:
        self.port.pin(self.port.pin_number(name), level)

    def pulse(self, name: str, level: int, width: int = 10 * US) -> None:
        self.pin(name, level)
        self.delay(width)
        self.pin(name, 2)

    def getpin(self, name: str) -> int:
        return self.port.getpin(self.port.pin_number(name))

    def close(self) -> None:
        self.port.close()


class Lm(Host):
    """A host of an LM628 or LM629."""

    def ready(self) -> None:
        if self.board.policy == "lockstep":
            while self.read(0) & 1:
                pass
        else:
            super().ready()

    def do(self, name: str, *words: int) -> int:
        command = LM_COMMANDS[name]
        self.ready()
        self.write(0, command.code)
        for word in words:
            self.ready()
            self.write(1, word >> 8 & 0xFF)
            self.write(1, word & 0xFF)
        value = 0
        for _ in range(command.read):
            self.ready()
            value = value << 16 | self.read(1) << 8
            value |= self.read(1)
        return value

    def filter(self, kp: int = 300, ki: int = 0, kd: int = 2000, il: int = 0, ds: int = 0) -> None:
        self.do("LFIL", ds << 8 | 0x0F, kp, ki, kd, il)
        self.do("UDF")

    def load(self, control: int, *values: int) -> None:
        words: list[int] = []
        for value in values:
            words += [value >> 16 & 0xFFFF, value & 0xFFFF]
        self.do("LTRJ", control, *words)

    def go(self, acc: int, vel: int, pos: int) -> None:
        self.load(0x2A, acc, vel, pos)
        self.do("STT")

    def look(self, times: int, every: int = 8 * MS) -> None:
        """Read now and then all that can be read."""
        for number in range(times):
            self.ready()
            self.read(0)
            for name in ("RDRP", "RDDP"):
                self.do(name)
            self.do(("RDDV", "RDRV", "RDSUM", "RDSIGS")[number % 4])
            self.delay(every)


class Pmd(Host):
    """A host of an MC1241A or MC1141A."""

    def do(self, name: str, value: int = 0) -> int:
        command = PMD_COMMANDS[name]
        return self.send(command.code, value, command.write, command.read)

    def send(self, code: int, value: int = 0, write: int = 0, read: int = 0) -> int:
        self.ready()
        self.write(1, code)
        for place in range(write - 1, -1, -1):
            self.ready()
            self.write(0, value >> 16 * place + 8 & 0xFF)
            self.write(0, value >> 16 * place & 0xFF)
        answer = 0
        for _ in range(read):
            self.ready()
            answer = answer << 16 | self.read(0) << 8
            answer |= self.read(0)
        return answer

    def set(self, **values: int) -> None:
        for name, value in values.items():
            self.do(f"SET_{name.upper()}", value)

    def begin(self, amplitude: int = 0x4000) -> None:
        """Give the phases current and let encoder counts be steps."""
        self.do("SET_1")
        self.set(step_ratio=0x0100, buf_mtr_cmd=amplitude)
        self.do("UPDATE")

    def look(self, times: int, every: int = 3 * MS) -> None:
        for _ in range(times):
            for name in ("GET_STATUS", "GET_TRGT_POS", "GET_TRGT_VEL", "GET_ACTL_POS"):
                self.do(name)
            self.do("GET_MODE")
            self.read(1)
            self.delay(every)


class Mcp(Host):
    """A host of an MCP-1200."""

    def set(self, **values: int) -> None:
        for name, value in values.items():
            addresses = REGISTERS[name.upper()].addresses
            for place, address in enumerate(addresses, 1):
                self.write(address, value >> 8 * (len(addresses) - place) & 0xFF)

    def get(self, name: str) -> int:
        value = 0
        for place, address in enumerate(reversed(REGISTERS[name].addresses)):
            value |= self.read(address) << 8 * place
        return value

    def begin(self, pid: bool = True, features: int = 0) -> None:
        """Extended addressing, samples of about half a millisecond, a filter, closed loop."""
        self.set(config=0x01, exception=0x00, feature=(0x08 if pid else 0) | features)
        if pid:
            self.set(kp=80, ki=0, kd=200, derivative_span=1)
        self.set(mode=3)
        self.delay(2 * MS)

    def flag(self, number: int, on: bool = True) -> None:
        self.set(flag=8 | number if on else number)

    def look(self, times: int, every: int = 2 * MS) -> None:
        for number in range(times):
            self.read(0x07)
            self.read(0x00)
            self.get("COMMAND_POSITION")
            self.get("ACTUAL_POSITION")
            self.get(("POSITION_ERROR", "ACTUAL_VELOCITY", "PHASE", "CAPTURE_CONTROL")[number % 4])
            self.get(("MOTOR_COMMAND", "PWM_COMMAND")[number % 2])
            self.delay(every)


# -- hosts that move the strobes themselves -----------------------------------------------------


class Strobes:
    """Moves lines of one port; every step takes ``step`` ps."""

    def __init__(self, port: HostBus, step: int = 200 * NS) -> None:
        self.port = port
        self.step = step

    def put(self, **levels: int) -> None:
        mask = word = 0
        for name, level in levels.items():
            number = self.port.line_number(_LINES[name])
            mask |= 1 << number
            word |= level << number
        self.port.lines(mask, word)
        self.port.delay(self.step)

    def drive(self, data: int) -> None:
        self.port.drive(data)
        self.port.delay(self.step)

    def release(self) -> None:
        self.port.release()
        self.port.delay(self.step)


_LINES = {
    "cs": "/CS", "ps": "/PS", "rd": "/RD", "wr": "/WR", "ale": "/ALE", "oe": "/OE", "rw": "R/W",
    "slct": "~HostSlct", "write": "~HostWrite", "read": "~HostRead", "cmd": "HostCmd",
}  # fmt: skip


class StrobedLm(Lm):
    """An LM629's host of port pins."""

    def read(self, address: int) -> int:
        strobes = Strobes(self.port)
        strobes.put(ps=address, cs=0)
        strobes.put(rd=0)
        data, _ = self.port.sample()
        strobes.put(rd=1)
        strobes.put(cs=1)
        return data

    def write(self, address: int, data: int) -> None:
        strobes = Strobes(self.port)
        strobes.put(ps=address, cs=0)
        strobes.drive(data)
        strobes.put(wr=0)
        strobes.put(wr=1)
        strobes.release()
        strobes.put(cs=1)


class StrobedPmd(Pmd):
    """An MC1241A's host of port pins: it has HostRdy on a line, and no adapter's status."""

    def ready(self) -> None:
        self.port.sample()
        self.delay(130 * US)

    def read(self, address: int) -> int:
        strobes = Strobes(self.port)
        strobes.put(slct=0, cmd=0)
        strobes.put(read=0)
        data, _ = self.port.sample()
        strobes.put(read=1)
        strobes.put(slct=1)
        return data

    def write(self, address: int, data: int) -> None:
        strobes = Strobes(self.port)
        strobes.put(slct=0, cmd=address & 1)
        strobes.drive(data)
        strobes.put(write=0)
        strobes.put(write=1)
        strobes.release()
        strobes.put(slct=1, cmd=0)


class StrobedMcp(Mcp):
    """An MCP-1200's host of port pins."""

    def begin_cycle(self, address: int, rw: int) -> Strobes:
        strobes = Strobes(self.port, 150 * NS)
        strobes.put(rw=rw)
        strobes.drive(address)
        strobes.put(ale=0)
        strobes.put(ale=1)
        strobes.put(cs=0)
        return strobes

    def read(self, address: int) -> int:
        strobes = self.begin_cycle(address, 1)
        strobes.release()
        strobes.put(cs=1)
        strobes.put(oe=0)
        data, _ = self.port.sample()
        strobes.put(oe=1)
        return data

    def write(self, address: int, data: int) -> None:
        strobes = self.begin_cycle(address, 0)
        strobes.drive(data)
        strobes.put(cs=1)
        strobes.release()
        self.port.delay(2 * US)


# -- boards -------------------------------------------------------------------------------------

DC = 'model = "dc_motor"'
FAST_DC = 'model = "dc_motor"\nencoder_lines = 50\nindex_offset = 40'
LOADED = """\
model = "dc_motor"
load_torque = "0.01 N*m"
coulomb_friction = "0.004 N*m"
static_friction = "0.005 N*m"
"""
STEPPER = 'model = "stepper"\nsteps_per_rev = 3200\nencoder_lines = 800'
IDEAL = 'model = "ideal"'
MICROSTEPPER = 'model = "stepper"\nencoder_lines = 3200'
"""An encoder with a count for each microstep."""
MICROSTEPS = 'model = "ideal"\nencoder_lines = 3200'
OVERLOADED = """\
model = "stepper"
holding_torque = "0.02 N*m"
load_torque = "0.06 N*m"
"""
COARSE = 'model = "stepper"\nencoder_lines = 50\nindex_offset = 20'
WITH_SWITCHES = """\
model = "ideal"
encoder_lines = 3200
[plants.m.switches.home]
first = 40
last = 55
[plants.m.switches."limit+"]
first = 200
last = 100000
closed = "high"
[plants.m.switches."limit-"]
first = -100000
last = -150
closed = "high"
"""


def head(time: str = "lockstep", power_on: str = "done", rules: str = "warn", seed: int = 0) -> str:
    return (
        f'[board]\nname = "frozen"\ntime = "{time}"\npower_on = "{power_on}"\nseed = {seed}\n'
        f'[violations]\ndefault = "{rules}"\n'
    )


def lm(part: str = "LM629N-8", plant: str = DC, extra: str = "", clock: str = "8 MHz",
       **board: object) -> str:  # fmt: skip
    return (
        f'{head(**board)}[chips.x]\npart = "{part}"\nclock = "{clock}"\n'  # type: ignore[arg-type]
        + (
            f'plant = "m"\n{extra}\n[plants.m]\n{plant}\n'
            if plant
            else f'plant = "none"\n{extra}\n'
        )
    )


def pmd(part: str = "MC1241A", plant: str = MICROSTEPS, extra: str = "", **board: object) -> str:
    axes = 'plant = "m"' if part == "MC1141A" else 'plants = ["m", "n"]'
    if not plant:
        axes = 'plants = ["none", "none"]'
    text = (
        f'{head(**board)}[chips.x]\npart = "{part}"\nclock = "25 MHz"\n'  # type: ignore[arg-type]
        f"{axes}\n{extra}\n"
    )
    if plant:
        text += f"[plants.m]\n{plant}\n"
        if part == "MC1241A":
            text += f"[plants.n]\n{MICROSTEPS}\n"
    return text


def mcp(plant: str = IDEAL, extra: str = "", clock: str = "8 MHz", **board: object) -> str:
    return (
        f'{head(**board)}[chips.x]\npart = "MCP-1200"\nclock = "{clock}"\n'  # type: ignore[arg-type]
        + (
            f'plant = "m"\n{extra}\n[plants.m]\n{plant}\n'
            if plant
            else f'plant = "none"\n{extra}\n'
        )
    )
