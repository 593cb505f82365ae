"""Random hosts on random boards: everything a run shows, as one line of digests per stretch.

Run as a program, on the core that the environment chooses:

    drive.py FAMILY SEED OPERATIONS

The first line says which core ran. Each further one is the seed of a board, the operations done on
it, and digests of all replies, of all violations, of the whole state, of the trace and of the
journal; every other board has one.
"""

import hashlib
import io
import sys
from collections.abc import Callable, Iterator
from random import Random

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.chips.lm628.datasheet import COMMANDS as LM_COMMANDS
from vbus.chips.mc1241a.datasheet import COMMANDS as PMD_COMMANDS
from vbus.chips.mcp1200.datasheet import REGISTERS
from vbus.chips.tables import Command
from vbus.compiled import core
from vbus.core.kernel import MS, NS
from vbus.protocols.port import PortError
from vbus.record.journal import Journal

BOARD_OPERATIONS = 4000
"""Operations on one board, before the next is drawn."""
STRETCH = 1000
"""Operations on one line."""


# -- boards -----------------------------------------------------------------------------------


def servo_motor(random: Random) -> str:
    inertia = 10 ** random.uniform(-7, -4)
    dry = random.choice((0.0, 10 ** random.uniform(-4, -1.5)))
    rows = [
        'model = "dc_motor"',
        f'inertia = "{inertia:.3g} kg*m^2"',
        f'viscous_friction = "{10 ** random.uniform(-8, -4):.3g} N*m*s"',
        f'coulomb_friction = "{dry:.6f} N*m"',
        f'static_friction = "{dry * random.uniform(1, 2):.6f} N*m"',
        f'load_torque = "{random.choice((0.0, random.uniform(-0.02, 0.02))):.5f} N*m"',
        f'inductance = "{random.choice((0.0, 0.0005, 0.01))} H"',
        f"encoder_lines = {random.choice((25, 500, 512, 5000))}",
        f"index = {random.choice(('true', 'false'))}",
    ]
    if random.random() < 0.3:
        rows += [
            f"stop_low = {-random.randrange(1, 5000)}",
            f"stop_high = {random.randrange(5000)}",
        ]
    return "\n".join(rows)


def step_motor(random: Random) -> str:
    dry = 10 ** random.uniform(-4, -1.5)
    return "\n".join(
        (
            'model = "stepper"',
            f'inertia = "{10 ** random.uniform(-6, -4):.3g} kg*m^2"',
            f'viscous_friction = "{10 ** random.uniform(-4, -2):.3g} N*m*s"',
            f'coulomb_friction = "{dry:.6f} N*m"',
            f'static_friction = "{dry * 1.3:.6f} N*m"',
            f'holding_torque = "{random.uniform(0.05, 1):.4f} N*m"',
            f"steps_per_rev = {random.choice((200, 400, 3200))}",
        )
    )


def plant(random: Random, *models: Callable[[Random], str]) -> str:
    return random.choice((*models, *models, lambda _: 'model = "ideal"'))(random)


def lm628(random: Random) -> str:
    part, hz = random.choice((("LM629N-8", 8), ("LM629N-6", 6), ("LM628N-8", 8), ("LM628N-6", 5)))
    return f"""
[chips.x]
part = "{part}"
clock = "{random.choice((f"{hz} MHz", "3333333 Hz"))}"
plant = "m"
busy_clk = {random.choice((120, 200))}
busy_jitter_clk = {random.choice((0, 40))}
pid_overflow = "{random.choice(("saturate", "wrap"))}"
integral_limit = "{random.choice(("term", "sum"))}"
pwm_frame_clk = {random.choice((512, 128, 2048))}
[plants.m]
{plant(random, servo_motor)}
"""


def mc1241a(random: Random) -> str:
    return f"""
[chips.x]
part = "MC1241A"
clock = "{random.choice(("25 MHz", "20 MHz", "24999999 Hz"))}"
plants = ["m", "n"]
host_busy = "{random.choice(("fixed", "slot"))}"
phase_b = "{random.choice(("leads", "lags"))}"
[plants.m]
{plant(random, step_motor)}
[plants.n]
{plant(random, step_motor)}
"""


def mcp1200(random: Random) -> str:
    return f"""
[chips.x]
part = "MCP-1200"
clock = "{random.choice(("8 MHz", "20 MHz", "19999999 Hz"))}"
plant = "m"
drive = "{random.choice(("pwm", "dac"))}"
io_stall_clk = {random.choice((0, 0, 3))}
unipolar = "{random.choice(("magnitude", "clip"))}"
[plants.m]
{plant(random, servo_motor, step_motor)}
"""


BOARDS: dict[str, Callable[[Random], str]] = {
    "lm628": lm628,
    "mc1241a": mc1241a,
    "mcp1200": mcp1200,
}


MOTION = {
    "lm628": ("LFIL", "UDF", "LTRJ", "STT"),
    "mc1241a": ("SET_POS", "SET_VEL", "SET_ACC", "SET_MAX_ACC", "SET_JERK", "UPDATE", "UPDATE",
                "SET_PRFL_TRAP", "SET_PRFL_VEL", "SET_PRFL_S_CRV", "MTR_ON", "SET_MTR_CMD"),
}  # fmt: skip
"""What makes an axis move, told more often than the rest."""


# -- hosts ------------------------------------------------------------------------------------


def word(random: Random) -> int:
    kind = random.randrange(6)
    if kind == 0:
        return random.choice((0, 1, 0x7FFF, 0x8000, 0xFFFF))
    return random.randrange(1 << (1, 4, 8, 12, 16)[kind - 1])


class Host:
    """One random host on one random board."""

    def __init__(self, family: str, seed: int) -> None:
        self.random = Random(seed)
        self.family = family
        random = self.random
        policy = random.choice(("off", "warn", "warn", "strict"))
        self.board: Board = load_board_text(
            f'[board]\nname = "b"\ntime = "{random.choice(("lockstep", "slaved"))}"\n'
            f"seed = {seed & 0xFFFF}\n"
            f'power_on = "{random.choice(("reset", "done", "done"))}"\n'
            f'[violations]\ndefault = "{policy}"\n{BOARDS[family](random)}'
        )
        self.traced = random.random() < 0.5
        if self.traced:
            self.board.start_trace()
        self.journal = io.BytesIO()
        self.recorder = Journal(self.board, self.journal) if seed % 2 else None
        self.port = self.board.open_port("h")
        info = self.port.info()
        self.lines = len(info.lines)
        self.pins = len(info.pins)
        self.address_bits = info.chips[0].address_bits
        self.replies = hashlib.sha256()
        # A host that moves strobes leaves the bus in a state in which whole cycles make no sense.
        self.strobes = 0.02 if random.random() < 0.3 else 0.0
        self.actions: tuple[Callable[[], object], ...] = (
            self.packet, self.packet, self.packet, self.poll, self.poll, self.poll,
            self.any_read, self.any_write, self.delay, self.delay, self.wait, self.wait, self.side,
            self.look,
        )  # fmt: skip

    def operation(self) -> None:
        random = self.random
        if random.random() < self.strobes:
            action: Callable[[], object] = self.strobe
        else:
            action = random.choice(self.actions)
        try:
            answer = repr(action())
        except PortError as error:
            answer = f"X{error.code}"
        self.replies.update(answer.encode())

    def poll(self) -> object:
        return self.port.read({"lm628": 0, "mc1241a": 1, "mcp1200": 7}[self.family])

    def any_read(self) -> object:
        return self.port.read(self.random.randrange(1 << self.address_bits))

    def any_write(self) -> object:
        random = self.random
        return self.port.write(random.randrange(1 << self.address_bits), random.randrange(256))

    def delay(self) -> object:
        return self.port.delay(int(10 ** self.random.uniform(3, 9.3)))

    def wait(self) -> object:
        return self.port.wait(self.random.choice((NS, MS, 5 * MS)))

    def side(self) -> object:
        random = self.random
        number = random.randrange(self.pins)
        if random.random() < 0.02:
            self.port.pin(number, random.randrange(3))
        return self.port.getpin(number)

    def look(self) -> object:
        random = self.random
        kind = random.randrange(6)
        if kind == 0 and random.random() < 0.1:
            state = self.board.save()
            self.board.load(state)
            return self.board.save() == state
        if kind == 1:
            return self.port.lease(random.randrange(1 << self.address_bits))
        if kind == 2:
            return self.port.polled(random.randrange(1 << self.address_bits), random.randrange(9))
        if kind == 3:
            return self.port.sample()
        if kind == 4:
            return sorted(self.board.chips[0].telemetry().items())
        return self.port.sync()

    def strobe(self) -> object:
        random = self.random
        kind = random.randrange(5)
        if kind < 3:
            all_lines = 1 << self.lines
            self.port.lines(random.randrange(all_lines), random.randrange(all_lines))
            return self.port.delay(random.randrange(200 * NS))
        if kind == 3:
            return self.port.drive(random.randrange(256))
        return self.port.release()

    def packet(self) -> object:
        """Tell the chip something it may understand."""
        if self.family == "mcp1200":
            return self.registers()
        random = self.random
        table = LM_COMMANDS if self.family == "lm628" else PMD_COMMANDS
        commands = list(table)
        name = random.choice(MOTION[self.family]) if random.random() < 0.4 else ""
        command = table[name] if name else random.choice(commands)
        if command.name == "RESET" and random.random() < 0.9:
            command = random.choice(commands)
        words = self.words(command)
        command_port, data_port = (0, 1) if self.family == "lm628" else (1, 0)
        patient = random.random() < 0.97
        answer = []
        if patient:
            self.port.wait(5 * MS)
        self.port.write(command_port, command.code)
        for value in words:
            if patient:
                self.port.wait(5 * MS)
            self.port.write(data_port, value >> 8)
            self.port.write(data_port, value & 0xFF)
        for _ in range(command.read):
            if patient:
                self.port.wait(5 * MS)
            answer += [self.port.read(data_port), self.port.read(data_port)]
        return answer

    def words(self, command: Command) -> Iterator[int]:
        random = self.random
        if command.name == "LTRJ":
            yield 0x002A | random.choice((0, 0, 0x800, 0x1800, 0x0015, 0x0401, 0x1C00))
            for value in (1 << random.randrange(24), 1 << random.randrange(26), word(random)):
                high = value >> 16 if value > 1 else random.choice((0, 0xFFFF))
                yield high
                yield value & 0xFFFF
            return
        if command.name == "LFIL":
            yield 0x000F | random.randrange(16) << 8
            for _ in range(4):
                yield random.randrange(1 << random.randrange(1, 15))
            return
        for _ in range(command.write):
            yield word(random)

    def registers(self) -> object:
        random = self.random
        if random.random() < 0.25:
            register, value = random.choice(
                ((0x05, 3), (0x05, 3), (0x05, 1), (0x05, 2), (0x00, 8 + random.randrange(8)),
                 (0x00, random.randrange(8)), (0x0F, random.randrange(60)))
            )  # fmt: skip
        else:
            row = random.choice(list(REGISTERS))
            if row.name == "MODE":
                return None
            for address in row.addresses:
                self.port.write(address, random.randrange(1 << random.randrange(1, 9)))
            if random.random() < 0.5:
                return [self.port.read(address) for address in row.addresses]
            return None
        return self.port.write(register, value)

    def line(self) -> str:
        """Return the digests of everything so far."""
        board = self.board
        findings = hashlib.sha256(repr(list(board.violations)).encode()).hexdigest()
        trace = board.trace_hash() if self.traced else "-"
        if self.recorder is not None:
            self.recorder.flush()
        journal = hashlib.sha256(self.journal.getvalue()).hexdigest()
        return " ".join(
            (
                self.replies.hexdigest()[:16],
                f"{board.counters['violations']}:{findings[:16]}",
                board.state_hash()[:16],
                trace[:16],
                journal[:16],
                f"{board.now}:{','.join(str(plant.count) for plant in board.plants)}",
            )
        )


def lines(family: str, seed: int, operations: int) -> Iterator[str]:
    done = 0
    while done < operations:
        host = Host(family, seed)
        for number in range(1, min(BOARD_OPERATIONS, operations - done) + 1):
            host.operation()
            if number % STRETCH == 0:
                yield f"{family} seed {seed} after {number}: {host.line()}"
        done += BOARD_OPERATIONS
        seed += 1


def main() -> None:
    family, seed, operations = sys.argv[1:]
    print(core())
    for line in lines(family, int(seed), int(operations)):
        print(line, flush=True)


if __name__ == "__main__":
    main()
