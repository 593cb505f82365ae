"""The MCP-1200 once more, as plainly as the manual and the rulings can be written down.

One object, plain integers, one call for every sample and every register byte; nothing is put off,
nothing is shared and nothing is fast. It imports nothing of the project, and was written from the
manual, the list of clauses and NOTES.md, not from the chip beside it. Clause ids stand where the
behaviour does; ``NOTES n`` is an entry of vbus/chips/mcp1200/NOTES.md.

Time is the number of a clock cycle. Whoever uses the model tells it what happens in which order:
:meth:`start` when the sample timer reaches zero, :meth:`count` when the encoder counts,
:meth:`results` when BUSY falls, and the host's accesses in between, outside BUSY.
"""

from collections.abc import Callable
from math import isqrt

RESET, IDLE, HALTED, CONTROL = range(4)
POSITION, PROFILE, POSITION_INTERPOLATION, VELOCITY_INTERPOLATION, INTEGRAL_VELOCITY = range(5)

F0, F1, F2, F3, F4, F5 = 0x01, 0x02, 0x04, 0x08, 0x10, 0x20
MODE_FLAGS = F0 | F3 | F4 | F5
LIMIT, STOP, BREAKPOINT, ERROR, TIMER, IN_POSITION, REVERSE = 128, 64, 32, 16, 8, 4, 2
"""Bits of the Status Register."""

RESET_CLK = 320
READ_ONLY = {0x06, 0x12, 0x14, 0x19, *range(0x2C, 0x36), 0x39, 0x3A, 0x3B}
LISTED = {
    *range(0x1E), *range(0x20, 0x36), *range(0x39, 0x40), 0x44, 0x45, 0x46, 0x49, 0x4A,
    0x4B, 0x4C, 0x4D, 0x54, 0x55, 0x56, 0x57, *range(0x61, 0x67), 0x69, 0x6A,
}  # fmt: skip
HARD_DEFAULTS = {
    0x00: 0x02, 0x04: 0x09, 0x07: 0xF8, 0x08: 0x80, 0x0F: 0x40, 0x11: 0x3F, 0x1B: 0x0F,
    0x20: 0xE5, 0x21: 0x40, 0x22: 0x40, 0x3F: 0x80, 0x49: 0xFF, 0x4A: 0xFF, 0x4B: 0xF0,
    0x61: 0x40, 0x63: 0x40, 0x64: 0x01, 0x65: 0xFF, 0x66: 0x7F,
}  # fmt: skip
SOFT_DEFAULTS = {
    0x00: 0x02, 0x04: 0x09, 0x06: 0, 0x07: 0xF8, 0x08: 0x80, 0x09: 0, 0x4C: 0, 0x4D: 0, 0x0A: 0,
    0x0B: 0, 0x0F: 0x40, 0x20: 0xE5, 0x21: 0x40, 0x22: 0x40, 0x4B: 0xF0, 0x49: 0xFF, 0x4A: 0xFF,
}  # fmt: skip


def signed(value: int, bits: int) -> int:
    """Two's complement."""
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> (bits - 1) else value


def clamp(value: int, low: int, high: int) -> int:
    return min(max(value, low), high)


def toward_zero(velocity: int, acceleration: int) -> int:
    """A velocity one sample later, when it is brought to zero (NOTES 8)."""
    if acceleration == 0:
        return 0
    if velocity > 0:
        return max(velocity - acceleration, 0)
    return min(velocity + acceleration, 0)


def largest_speed(way: int, acceleration: int) -> int:
    """The largest speed from which a deceleration can end exactly after ``way`` (MCP-TRP-2)."""
    a = acceleration
    n = (isqrt(a * a + 8 * a * way) - a) // (2 * a)
    return (way + a * n * (n + 1) // 2) // (n + 1)


def smallest(enough: Callable[[int], bool]) -> int:
    """The smallest number from 0 on that is enough, where every larger one is."""
    high = 1
    while not enough(high):
        high *= 2
    low = -1
    while high - low > 1:
        middle = (low + high) // 2
        if enough(middle):
            high = middle
        else:
            low = middle
    return high


class SCurve:
    """A move planned from rest; lengths in 2**-16 counts (MCP-SCV-1 as amended).

    The peak velocity is the fraction ``peak / per``; nothing is rounded before the command.
    """

    def __init__(self, way: int, velocity: int, acceleration: int, jerk: int) -> None:
        d, v, a, j = way, velocity, acceleration, jerk
        if a * a >= v * j:
            m, t = smallest(lambda m: j * m * m >= v), 0
        else:
            m = -(-a // j)
            t = max(0, -(-v // a) - m)
        if d < v * (2 * m + t):
            m, t = smallest(lambda m: 2 * j * m**3 >= d), 0
            if d > 2 * a * m * m:
                m = -(-a // j)
                t = smallest(lambda t: a * (m + t) * (2 * m + t) >= d)
        self.ramp = 2 * m + t
        samples = max(self.ramp, -(-d // v))
        self.way = d
        self.peak, self.per = d, samples
        self.shape = m * (m + t)
        self.left = [m, t, m, samples - self.ramp, m, t, m]
        self.held = 0
        self.k = self.c = self.covered = 0
        self.rest = 0
        """What a new end leaves over, as a numerator over ``per``: one sample more (MCP-SCV-3)."""
        self.phase = 1
        self.velocity = 0
        """Of the last sample, and :attr:`sum` of all, as numerators over ``per * shape``."""
        self.sum = 0

    def distance(self, unit: int) -> int:
        """The way so far in ``unit`` 2**-16 counts, rounded down."""
        return self.sum // (self.per * self.shape * unit)

    def deceleration_point(self) -> int:
        """How far from its beginning, in counts, the move begins to slow down (MCP-SCV-5)."""
        return (2 * self.way * self.per - self.peak * (self.ramp - 2)) // (2 * self.per) >> 16

    def step(self) -> None:
        """One sample (MCP-SCV-2)."""
        self.phase = next(n for n in range(1, 8) if self.left[n - 1])
        dk = {1: 1, 3: -1, 5: 1, 7: -1}.get(self.phase, 0)
        k = self.k + dk
        c = self.c + (0 if self.phase == 4 else k if self.phase < 4 else -k)
        if self.phase > 4 and self.rest and self.peak * c <= self.rest * self.shape:
            self.velocity = self.rest * self.shape
            self.rest = 0
        else:
            self.k, self.c = k, c
            self.left[self.phase - 1] -= 1
            self.held += self.phase == 4
            self.velocity = self.peak * c
        self.sum += self.velocity

    def finished(self) -> bool:
        return self.sum == self.way * self.per * self.shape

    def new_end(self, way: int) -> bool:
        """Take another end in phases 1 to 4; tell whether it can be had (MCP-SCV-5)."""
        samples = way * self.per // self.peak
        if way < self.way and self.phase != 4:
            return False
        if samples < self.ramp + self.held:
            return False
        self.way = way
        self.left[3] = samples - self.ramp - self.held
        self.rest = way * self.per - samples * self.peak
        return True


class Reference:
    """The registers and what is behind them.

    Args:
        unipolar: ``"magnitude"`` or ``"clip"``: what becomes of a negative command (MCP-OUT-2).
    """

    def __init__(self, unipolar: str = "magnitude") -> None:
        self.unipolar = unipolar
        self.limit_low = self.stop_low = False
        self.trig_level = self.index_level = 1
        self.power_on()

    def power_on(self) -> None:
        """What a hard reset leaves (MCP-RST-3)."""
        self.r = [0] * 128
        for address, value in HARD_DEFAULTS.items():
            self.r[address] = value
        self.state = self.r[0x05] = IDLE
        self.order: int | None = None
        """What the host has written to R05 since the sample began."""
        self.actual = 0
        """Actual position, signed 24 bits."""
        self.command = 0
        """Command position, signed 24 bits."""
        self.limit_noted = self.stop_noted = self.break_noted = self.error_noted = False
        self.compare = -0x800000
        self.break_pending = False
        # What was captured when R29 or R25 was written (MCP-INT-2).
        self.point = self.speed = 0
        # Backlash (MCP-ERR-1).
        self.offset = 0
        self.direction = 0
        self.last_command = 0
        self.last_actual = 0
        self.ahead = 0
        """Steps from the last results to the next sample's start."""
        self.busy_until = 0
        self.computing = False
        # Steps of the last sample, how many of them are sent, when the first was, and over how
        # many clocks they are spread (MCP-STP-2).
        self.steps = self.sent = self.steps_from = self.steps_over = 0
        self.sign_of_steps = 1
        # Steps made and encoder counts since the last sample, and in the window of the stall check.
        self.made = self.encoder = 0
        self.window = (0, 0, 0)
        self.mode_ended = False
        """Whether the flag of the mode under way has been cleared since the last sample."""
        self.mode = POSITION
        self.clear_generator()
        self.clear_history()
        self.begin_period(0)

    # -- the sample timer ----------------------------------------------------------------------

    def begin_period(self, cycle: int) -> None:
        """The timer reloads; the pre-scaler is looked at as well (MCP-SMP-1, MCP-REG-49)."""
        self.started = cycle
        self.tick = (self.r[0x10] << 8 | self.r[0x11]) + 1
        self.reload = self.r[0x0F]
        self.period = self.tick * (self.reload + 1)

    @property
    def next_start(self) -> int:
        return self.started + self.period

    # -- host accesses -------------------------------------------------------------------------

    def write(self, address: int, data: int, cycle: int = 0) -> None:
        """A byte becomes visible inside; ``cycle`` matters for a reset alone."""
        self.run(cycle)
        if not self.r[0x02] & 1:
            address &= 0x3F  # MCP-BUS-9
        if address not in LISTED or address in READ_ONLY - {0x12}:
            return
        if address == 0x00:
            self.write_flag(data)
        elif address == 0x02:
            enabled = data & 0x10 and not self.r[0x02] & 0x10
            self.r[0x02] = data
            if enabled and self.actual == self.compare:
                self.match()  # MCP-BRK-4
        elif address == 0x03:
            latches = self.r[0x03] & data & 0x09  # MCP-CAP-2
            self.r[0x03] = self.r[0x03] & 0x80 | data & 0x76 | latches
        elif address == 0x05:
            if data == 0 and self.state == IDLE:
                self.soft_reset(cycle)
            else:
                self.order = min(data, 3)
                if self.state == IDLE and data == IDLE:
                    self.outputs_off()
        elif address == 0x07:
            self.clear_errors()
        elif address in (0x08, 0x09):
            self.r[address] = data
        elif address in (0x4C, 0x4D):
            self.r[address] = data & 0xF0
        elif address == 0x0E:
            self.command = signed(self.r[0x0C] << 16 | self.r[0x0D] << 8 | data, 24)
        elif address == 0x13:
            self.preset(0)
        elif address == 0x17:
            self.r[0x17] = data
            self.preset(self.r[0x15] << 16 | self.r[0x16] << 8 | data)
        elif address == 0x12:
            pass
        else:
            self.r[address] = data
        if address == 0x29:  # MCP-INT-2, NOTES 12
            self.point = self.final
            self.r[0x03] |= 0 if self.r[0x00] & F4 else 0x80
        if address == 0x25:
            self.speed = self.high_resolution_velocity
            self.r[0x03] |= 0 if self.r[0x00] & F3 else 0x80
        if self.state == IDLE and self.limit_low:
            self.outputs_off()  # MCP-MOD-4

    def read(self, address: int, cycle: int) -> int:
        """What the host reads."""
        self.run(cycle)
        if not self.r[0x02] & 1:
            address &= 0x3F
        if address in (0x0C, 0x0D, 0x0E):
            return self.command >> 8 * (0x0E - address) & 0xFF
        if address == 0x0F:
            return self.reload - (cycle - self.started) // self.tick
        if address == 0x14:
            self.r[0x12], self.r[0x13] = self.actual >> 16 & 0xFF, self.actual >> 8 & 0xFF
            return self.actual & 0xFF
        if address == 0x07:
            return self.r[0x07] | self.busy(cycle)
        return self.r[address] if address in LISTED else 0

    def busy(self, cycle: int) -> int:
        """The BUSY pin (MCP-SMP-3)."""
        return int(self.started <= cycle < self.busy_until)

    def write_flag(self, data: int) -> None:
        """MCP-FLG-1, MCP-FLG-2."""
        bit = 1 << (data & 7)
        if not bit & MODE_FLAGS:
            return
        if data & 8:
            self.r[0x00] |= bit
            if bit == F0 and self.state == CONTROL:
                self.r[0x00] |= F2  # NOTES 3
        else:
            self.r[0x00] &= ~bit
            if bit == {PROFILE: F0, POSITION_INTERPOLATION: F3, VELOCITY_INTERPOLATION: F4,
                       INTEGRAL_VELOCITY: F5}.get(self.mode):  # fmt: skip
                self.mode_ended = True

    def clear_errors(self) -> None:
        """MCP-STA-2."""
        self.r[0x07] |= 0xF8
        if self.limit_low:
            self.r[0x07] &= ~LIMIT
        if self.stop_low:
            self.r[0x07] &= ~STOP

    def preset(self, position: int) -> None:
        before = self.actual
        self.actual = signed(position, 24)
        if self.actual == self.compare and before != self.compare:
            self.match()

    def word(self, high: int, low: int) -> int:
        return self.r[high] << 8 | self.r[low]

    @property
    def final(self) -> int:
        return signed(self.r[0x2B] << 16 | self.word(0x2A, 0x29), 24)

    @property
    def high_resolution_velocity(self) -> int:
        return signed(self.r[0x23] << 16 | self.word(0x24, 0x25), 24)

    @property
    def top_velocity(self) -> int:
        """Of a profile, in 1/256 count (MCP-TRP-1)."""
        if self.r[0x01] & 0x20:
            return abs(self.high_resolution_velocity)
        return (self.r[0x28] & 0x7F) << 8

    @property
    def acceleration(self) -> int:
        return (self.r[0x27] & 0x7F) << 8 | self.r[0x26]

    @property
    def prof(self) -> bool:
        """The PROF pin (MCP-FLG-5)."""
        if self.r[0x03] & 0x40 and self.mode in (POSITION_INTERPOLATION, VELOCITY_INTERPOLATION):
            return bool(self.r[0x03] & 0x80)
        return bool(self.r[0x00] & F2)

    @property
    def trig(self) -> bool:
        """Whether the chip leaves TRIG alone (MCP-BRK-1, MCP-BRK-5)."""
        driven = self.r[0x02] & 0x10 and not self.r[0x03] & 0x04
        return not (driven and not self.r[0x07] & BREAKPOINT)

    # -- pins ----------------------------------------------------------------------------------

    def fault(self, bit: int) -> None:
        """An error flag goes low (MCP-STA-3)."""
        if self.r[0x07] & bit:
            self.r[0x07] &= ~bit
            self.r[0x07] &= ~REVERSE
            if self.r[0x35] & 0x80:
                self.r[0x07] |= REVERSE

    def pin(self, name: str, level: int, cycle: int) -> None:
        self.run(cycle)
        {"/LIMIT": self.limit, "/STOP": self.stop, "TRIG": self.trig_input}[name](level)

    def limit(self, level: int) -> None:
        """The /LIMIT pin (MCP-EXC-4, MCP-MOD-4)."""
        falling = not level and not self.limit_low
        self.limit_low = not level
        if falling:
            self.limit_noted = True
            self.fault(LIMIT)
            if self.state == IDLE:
                self.outputs_off()

    def stop(self, level: int) -> None:
        """The /STOP pin."""
        falling = not level and not self.stop_low
        self.stop_low = not level
        if falling:
            self.stop_noted = True
            self.fault(STOP)

    def trig_input(self, level: int) -> None:
        """TRIG driven from outside (MCP-CAP-2)."""
        if self.trig_level and not level and self.r[0x03] & 0x04:
            self.capture(0x01, 0x02)
        self.trig_level = level

    def index(self, level: int, cycle: int) -> None:
        """The INDEX pin, after its filter."""
        self.run(cycle)
        if level != self.index_level and level == self.r[0x03] >> 5 & 1:
            self.capture(0x08, 0x10)
        self.index_level = level

    def capture(self, latch: int, enable: int) -> None:
        """MCP-CAP-2, MCP-CAP-3."""
        if not self.r[0x03] & latch:
            self.r[0x03] |= latch
            if self.r[0x03] & enable:
                for n in range(3):
                    self.r[0x2E + n] = self.actual >> 8 * n & 0xFF

    def count(self, counts: int) -> None:
        """The encoder counts; in step mode that is looked at for stalls alone."""
        if self.r[0x1A] & 0x80:  # MCP-ENC-1
            counts = -counts
        if self.r[0x02] & 0x02:
            self.encoder += counts
        else:
            self.pass_by(counts)

    def pass_by(self, counts: int) -> None:
        """The position counts; every place on the way is compared (MCP-BRK-1)."""
        way = signed(self.compare - self.actual, 24)
        if counts < 0:
            way = -way
        if 0 < (way & 0xFFFFFF) <= abs(counts):
            self.match()
        self.actual = signed(self.actual + counts, 24)

    def match(self) -> None:
        if self.r[0x02] & 0x10:
            self.fault(BREAKPOINT)
            self.break_noted = True
            self.break_pending = bool(self.r[0x02] & 0x20)

    # -- a sample ------------------------------------------------------------------------------

    def start(self) -> int:
        """The timer has reached zero: return how long BUSY is high, in clocks (MCP-SMP-3)."""
        self.run(self.next_start)
        self.begin_period(self.next_start)
        self.made_before, self.made = self.made, 0
        self.encoder_before, self.encoder = self.encoder, 0
        order, self.order = self.order, None
        if self.computing:
            self.computing = False
            self.fault(TIMER)  # MCP-SMP-4
            self.enter_idle()
        if self.state == IDLE:
            if order != CONTROL:
                self.idle_sample()
                return 0
            self.state = self.r[0x05] = CONTROL
            self.r[0x00] &= ~F1
            self.limit_noted = self.stop_noted = False  # NOTES 28
            self.break_noted = self.error_noted = False
            self.stepped_to = self.actual
            self.made_before = self.encoder_before = 0
            self.last_command = self.actual if self.r[0x02] & 0x02 else self.command
        elif order == 0:
            self.soft_reset(self.started)
            return 0
        elif order == IDLE:
            self.enter_idle()
            self.idle_sample()
            return 0
        elif order == HALTED:
            self.state = HALTED
        elif order == CONTROL:
            self.state = CONTROL
        self.action = self.exception()
        if order == HALTED:
            self.action = 3 if self.action != 1 else 1
        if self.action == 1:
            self.enter_idle()
            self.idle_sample()
            return 0
        self.position = self.actual
        self.choose_mode()
        if self.action == 3 or (
            self.action == 2 and self.mode in (POSITION, POSITION_INTERPOLATION)
        ):
            self.steps = self.sent = 0
            self.stepped_to = self.position
            if self.r[0x02] & 0x02:
                self.last_command = self.position
        due = self.break_pending
        self.break_pending = False
        self.run(self.started + 67)
        self.breakpoint_routine(due)
        work = self.work()
        self.busy_until = self.started + work
        self.computing = True
        return work

    def work(self) -> int:
        """MCP-SMP-3."""
        clocks = 500
        if self.r[0x02] & 0x02:
            clocks += 700
        else:
            clocks += 800 if self.r[0x01] & 0x08 else 500
        clocks += {PROFILE: 900, INTEGRAL_VELOCITY: 400, POSITION: 0}.get(self.mode, 300)
        clocks += 100 * (self.r[0x44] != 0) + 100 * (self.r[0x45] != 0)
        return clocks

    def exception(self) -> int:
        """The action of all events since the last sample (MCP-EXC-1, MCP-EXC-5)."""
        actions = {self.r[0x46] & 3}
        if self.limit_low or self.limit_noted:
            actions.add(self.r[0x04] & 3)
        if self.stop_low or self.stop_noted:
            actions.add(self.r[0x04] >> 2 & 3)
        if self.break_noted:
            actions.add(self.r[0x04] >> 4 & 3)
        if self.error_noted:
            actions.add(self.r[0x04] >> 6 & 3)
        self.limit_noted = self.stop_noted = self.break_noted = self.error_noted = False
        return 1 if 1 in actions else max(actions)

    def stall_check(self) -> None:
        """MCP-STP-4, NOTES 21."""
        ratio = self.word(0x1C, 0x1D)
        if not ratio or not self.r[0x02] & 0x02:
            self.window = (0, 0, 0)
            return
        samples, expected, counted = self.window
        samples += 1
        expected += abs(self.made_before) * ratio
        counted += abs(self.encoder_before)
        if samples >= 4 and expected >= 256:
            if counted * 256 < expected:
                self.fault(ERROR)
                self.error_noted = True
            samples = expected = counted = 0
        self.window = samples, expected, counted

    def breakpoint_routine(self, due: bool) -> None:
        """MCP-BRK-2, MCP-BRK-3; ``due``: a match had come when the sample began (NOTES 14)."""
        step = signed(self.r[0x3F] << 16 | self.word(0x3E, 0x3D), 24)
        if not self.r[0x02] & 0x20:
            self.break_pending = False
            self.set_compare(step)
        elif due:
            self.r[0x07] |= BREAKPOINT
            self.set_compare(signed(self.compare + step, 24))

    def set_compare(self, value: int) -> None:
        entering = value != self.compare and value == self.actual
        self.compare = value
        if entering:
            self.match()

    def choose_mode(self) -> None:
        """MCP-MOD-8; what an exception leaves of it (MCP-EXC-2)."""
        flags = 0 if self.action == 3 else self.r[0x00]
        before, self.mode = self.mode, POSITION
        if self.state == CONTROL:
            if flags & F0:
                self.mode = PROFILE
            elif flags & F4:
                self.mode = VELOCITY_INTERPOLATION
            elif flags & F3:
                self.mode = POSITION_INTERPOLATION
            elif flags & F5:
                self.mode = INTEGRAL_VELOCITY
        self.entering = self.mode != before or self.mode_ended
        if before == POSITION or (self.mode == before and self.mode_ended):
            self.velocity = 0  # NOTES 7
            self.place &= ~0xFF
        self.mode_ended = False
        # NOTES 27.
        held = not self.r[0x07] & STOP and self.r[0x04] >> 2 & 3 == 2
        held = held or (not self.r[0x07] & LIMIT and self.r[0x04] & 3 == 2)
        if self.mode == INTEGRAL_VELOCITY and held:
            self.action = 2

    def results(self) -> None:
        """BUSY falls: everything computed appears, halts in R05 too (MCP-SMP-5, NOTES 4)."""
        self.computing = False
        self.r[0x05] = self.state
        self.run(self.busy_until)
        self.generate()
        self.measure()
        self.stall_check()
        error = self.compare_positions()
        if self.r[0x02] & 0x02:
            self.step()
            self.ahead = self.sign_of_steps * self.due(self.next_start)
            self.run(self.busy_until)
        else:
            self.drive(error)

    # -- idle ----------------------------------------------------------------------------------

    def enter_idle(self) -> None:
        """MCP-MOD-2."""
        self.state = self.r[0x05] = IDLE
        self.busy_until = self.started
        self.r[0x00] = self.r[0x00] & ~F2 | F1
        self.outputs_off()
        self.clear_history()
        self.clear_generator()

    def idle_sample(self) -> None:
        """Decision 37: In-position goes on; NOTES 14: so does the breakpoint routine."""
        if self.r[0x44] == 0:
            self.offset = 0
        error = signed(self.command + self.offset - self.actual, 24)
        self.in_position(error)
        due, self.break_pending = self.break_pending, False
        self.breakpoint_routine(due)
        self.last_actual = self.actual

    def outputs_off(self) -> None:
        self.r[0x08], self.r[0x4C] = 0x80, 0
        self.r[0x09], self.r[0x4D] = 0, 0

    def clear_history(self) -> None:
        """MCP-FLT-5."""
        self.lead_error = self.lead_motor = 0
        self.errors = [0] * 8
        self.was_saturated = False
        self.accumulator = 0
        self.last_velocity = 0

    def clear_generator(self) -> None:
        self.mode = POSITION
        self.velocity = 0
        self.place = 0
        """Where the generator is, in 1/256 count."""
        self.generated = 0
        """The command it gave, which the host may have overwritten since."""
        self.r[0x06] = 0
        self.r[0x19] = 0
        self.stopping = self.waiting = False
        self.s_curve_move = False
        self.steps = self.sent = 0
        self.window = (0, 0, 0)
        self.left = 0
        self.kept_from = None

    def hard_reset(self, cycle: int) -> None:
        """/RESET rises: everything is as after power-on, and a soft reset follows (MCP-RST-1)."""
        self.power_on()
        self.soft_reset(cycle)

    def soft_reset(self, cycle: int) -> None:
        """A reset begins (MCP-RST-4, MCP-RST-5, NOTES 18)."""
        self.state = self.r[0x05] = RESET
        self.r[0x00] = 0
        self.started = cycle + RESET_CLK

    def end_reset(self) -> None:
        """It is over, and the sample timer starts."""
        for address, value in SOFT_DEFAULTS.items():
            self.r[address] = value
        self.clear_errors()
        self.state = self.r[0x05] = IDLE
        self.order = None
        self.command = 0
        self.actual = self.last_actual = self.r[0x12] = self.r[0x13] = 0
        self.offset = self.direction = self.last_command = 0
        self.clear_history()
        self.clear_generator()
        self.begin_period(self.started)

    # -- generators ----------------------------------------------------------------------------

    def move(self, velocity: int) -> None:
        """The command goes on by a velocity in 1/256 count."""
        self.place = signed(self.place + velocity, 32)
        self.command = self.generated = self.place >> 8

    def stand(self, position: int) -> None:
        """The command is at a whole count."""
        self.place = position << 8
        self.command = self.generated = position

    def generate(self) -> None:
        if self.action == 3:
            self.r[0x00] &= ~MODE_FLAGS
            self.stand(self.position)
        if self.entering and self.command != self.generated:
            self.stand(self.command)
        elif self.mode != POSITION:
            self.command = self.generated
        if self.mode != PROFILE:
            self.r[0x06] = 0
        if self.mode not in (POSITION_INTERPOLATION, VELOCITY_INTERPOLATION):
            self.r[0x19] = 0
        self.r[0x00] &= ~F2
        if self.mode == PROFILE:
            self.profile()
        elif self.mode == VELOCITY_INTERPOLATION:
            self.velocity_interpolation()
        elif self.mode == POSITION_INTERPOLATION:
            self.position_interpolation()
        elif self.mode == INTEGRAL_VELOCITY:
            self.integral_velocity()
        else:
            self.position_control()

    def position_control(self) -> None:
        """MCP-POS-1."""
        self.stand(self.position if self.action == 2 else self.command)
        self.velocity = 0
        if self.action not in (2, 3):  # MCP-EXC-2, NOTES 37
            self.stand(signed(self.command + signed(self.r[0x0B], 8), 24))
            self.r[0x0B] = 0
        self.command_velocity = signed(self.word(0x57, 0x56), 16)

    def integral_velocity(self) -> None:
        """MCP-VEL, MCP-EXC-3, NOTES 27."""
        high = bool(self.r[0x01] & 0x20)
        if self.action == 2:
            if high:
                self.no_speed()
            else:
                self.r[0x3C] = 0
        goal = self.high_resolution_velocity if high else signed(self.r[0x3C], 8) << 8
        a = self.acceleration
        if self.action == 2:
            self.velocity = toward_zero(self.velocity, a)
        elif goal > self.velocity:
            self.velocity = min(self.velocity + a, goal)
        else:
            self.velocity = max(self.velocity - a, goal)
        self.move(self.velocity)
        self.command_velocity = self.velocity
        if self.velocity or goal:
            self.r[0x00] |= F2

    def end_profile(self) -> None:
        """MCP-TRP-3."""
        self.r[0x00] &= ~F0
        self.r[0x06] = 0
        self.velocity = 0
        self.stand(self.generated)
        self.mode = POSITION

    def profile(self) -> None:
        """MCP-TRP, MCP-SCV."""
        self.r[0x00] |= F2
        before, s_curve = self.s_curve_move, bool(self.r[0x01] & 0x10)
        self.s_curve_move = s_curve
        if self.entering or (before != s_curve and not self.stopping):
            self.stopping = self.waiting = False
            if s_curve:
                # It knows whole counts only.
                self.stand(self.place >> 8)
            if self.action != 2:
                self.begin_profile(s_curve)
        elif self.waiting:
            self.begin_profile(s_curve)
        if self.action == 2 and not self.stopping:
            self.slow_down()
        if self.stopping:
            self.stop_now()
        elif self.waiting:
            pass
        elif s_curve:
            self.s_curve()
        else:
            self.trapezoid()

    def begin_profile(self, s_curve: bool) -> None:
        """Start from the command as it stands, once everything has a value (NOTES 8)."""
        self.r[0x06] = 0
        self.target = self.final
        self.begun = self.place >> 8
        a, top, jerk = self.acceleration << 8, self.top_velocity << 8, self.word(0x55, 0x54)
        wanting = not (a and top and (jerk or not s_curve))
        if wanting or s_curve:
            self.velocity = self.command_velocity = 0
        self.rest = self.way_to_target()
        self.waiting = wanting and self.target != self.place >> 8
        if self.velocity == 0 and self.target == self.place >> 8:
            self.stand(self.place >> 8)
        elif s_curve and not self.waiting and self.rest:
            self.sign = 1 if self.rest > 0 else -1
            self.way = abs(self.rest) >> 8
            self.curve = SCurve(self.way << 16, top, a, jerk)
            self.origin = self.place >> 8

    def slow_down(self) -> None:
        """Decelerate from here to where the velocity is 0 (MCP-TRP-6, MCP-EXC-2)."""
        self.stopping = True
        self.deceleration_position(self.generated)

    def stop_now(self) -> None:
        self.r[0x06] = 6
        self.velocity = toward_zero(self.velocity, self.acceleration)
        self.command_velocity = self.velocity
        if self.velocity:
            self.move(self.velocity)
        else:
            self.end_profile()
            self.r[0x00] &= ~F2

    def deceleration_position(self, position: int) -> None:
        """R39-3B (MCP-TRP-8)."""
        for n in range(3):
            self.r[0x39 + n] = position >> 8 * n & 0xFF

    def acceleration_distance(self, counts: int) -> None:
        """R31-33."""
        for n in range(3):
            self.r[0x31 + n] = counts >> 8 * n & 0xFF

    def trapezoid(self) -> None:
        v, top, a = self.velocity, self.top_velocity, self.acceleration
        if self.final != self.target and self.r[0x06] < 5:
            self.target = self.final
            self.rest = self.way_to_target()
            if v and not self.reachable(v, a):
                self.slow_down()
                self.stop_now()
                return
        rest = self.rest = self.way_to_target()
        if rest == 0 and v == 0:
            self.command_velocity = 0
            self.end_profile()
            self.r[0x00] &= ~F2
            return
        if rest:
            d = 1 if rest > 0 else -1
        else:
            d = -1 if v > 0 else 1
        u, way = v * d, abs(rest)
        if a == 0:
            new = u
        elif u < 0:
            new = u + a
            if new > 0:
                new = min(new, top, largest_speed(way, a))
        else:
            most = largest_speed(way, a)
            new = max(min(top, most, u + a), u - a)
        self.velocity = new * d
        if self.r[0x06] != 6 and (new or u):
            if u < 0 and rest:
                self.r[0x06] = 2
            elif abs(u) > top and abs(new) >= top:
                self.r[0x06] = 4
            elif new < u or not rest:
                self.deceleration_position(self.generated)
                self.r[0x06] = 6
            elif new == u < top:
                self.r[0x06] = self.r[0x06] or 2  # NOTES 9
            else:
                self.r[0x06] = 4 if new == u else 2
        self.move(self.velocity)
        self.rest -= self.velocity
        self.command_velocity = self.velocity
        if self.r[0x06] == 2:
            self.acceleration_distance(abs(signed((self.place >> 8) - self.begun, 24)))
        if self.rest == 0 and abs(self.velocity) <= a:
            self.end_profile()
            self.r[0x00] &= ~F2

    def way_to_target(self) -> int:
        """In 1/256 count; a target lies within 2**23 counts of the command (MCP-TRP-7)."""
        return (signed(self.target - (self.place >> 8), 24) << 8) - (self.place & 0xFF)

    def reachable(self, v: int, a: int) -> bool:
        """Whether the new end is at least one stopping distance ahead (MCP-TRP-6)."""
        ahead = self.rest if v > 0 else -self.rest
        if ahead < 0 or a == 0:
            return ahead >= 0
        return largest_speed(ahead, a) >= abs(v) - a

    def s_curve(self) -> None:
        if self.rest == 0:
            self.command_velocity = 0
            self.end_profile()
            self.r[0x00] &= ~F2
            return
        curve = self.curve
        if self.final != self.target and self.r[0x06] < 5:
            before = self.way_to_target()
            self.target = self.final
            self.way += (self.way_to_target() - before >> 8) * self.sign
            if self.way < 0 or not curve.new_end(self.way << 16):
                self.slow_down()
                self.stop_now()
                return
        before = curve.phase
        way = curve.distance(1)
        curve.step()
        if curve.phase > 4 and before < 5:
            self.deceleration_position(self.origin + self.sign * curve.deceleration_point())
        self.stand(signed(self.origin + self.sign * curve.distance(1 << 16), 24))
        self.r[0x06] = curve.phase
        if curve.phase < 4:
            self.acceleration_distance(curve.distance(1 << 16))
        self.velocity = self.sign * (curve.distance(1) - way >> 8)
        self.command_velocity = self.velocity
        if curve.finished():
            self.end_profile()
            self.r[0x00] &= ~F2

    def position_interpolation(self) -> None:
        """MCP-INT, NOTES 33."""
        if self.entering or self.action == 2:
            self.left = 0
            self.kept_from: int | None = None
        if self.action == 2:
            self.stand(self.position)
            self.kept_from = self.final
        else:
            self.stand(self.place >> 8)
            if self.final != self.kept_from:
                self.kept_from = None
            loaded = bool(self.r[0x03] & 0x80)
            changed = self.final != self.place >> 8 and self.kept_from is None
            if self.left == 0 and (self.entering or loaded or changed):
                self.first = self.place >> 8
                point = self.point if loaded and not self.entering else self.final
                self.way = signed(point - self.first, 24)
                self.kept_from = None
                self.begin_segment()
                self.r[0x03] &= 0x7F
        self.command_velocity = self.velocity = 0
        if self.left:
            self.passed += 1
            self.stand(signed(self.first + (self.way * self.passed >> self.shift), 24))
            self.command_velocity = self.velocity = self.way * 256 >> self.shift
            self.r[0x00] |= F2
            self.r[0x19] = self.left & 0xFF
            self.left -= 1
        else:
            self.r[0x19] = 0

    def no_speed(self) -> None:
        self.r[0x23] = self.r[0x24] = self.r[0x25] = 0
        self.speed = 0

    def begin_segment(self) -> None:
        self.shift = (self.r[0x18] & 7) + 1
        self.left = 1 << self.shift
        self.passed = 0

    def velocity_interpolation(self) -> None:
        """MCP-INT, NOTES 13, 26, 33."""
        loaded = bool(self.r[0x03] & 0x80) and not self.entering
        if self.entering:
            self.left = 0
        if self.action == 2:
            self.no_speed()
            if self.velocity if self.left == 0 else self.last:
                self.begin_segment()
                self.first, self.last = self.velocity, 0
        elif self.left == 0:
            goal = self.speed if loaded else self.high_resolution_velocity
            if self.entering or loaded or goal != self.velocity:
                self.begin_segment()
                self.r[0x03] &= 0x7F
                self.first, self.last = self.velocity, goal
        if self.left:
            self.passed += 1
            self.velocity = self.first + ((self.last - self.first) * self.passed >> self.shift)
            self.r[0x19] = self.left & 0xFF
            self.left -= 1
            self.r[0x00] |= F2
        else:
            self.r[0x19] = 0
        if self.velocity:
            self.r[0x00] |= F2
        self.move(self.velocity)
        self.command_velocity = self.velocity

    # -- errors --------------------------------------------------------------------------------

    def measure(self) -> None:
        """MCP-SMP-6."""
        velocity = signed(self.position - self.last_actual, 24)
        self.last_actual = self.position
        self.r[0x34], self.r[0x35] = velocity & 0xFF, velocity >> 8 & 0xFF

    def compare_positions(self) -> int:
        """MCP-ERR-1 to 4, MCP-STA-4; return the error the filter gets."""
        change = signed(self.command - self.last_command, 24)
        self.last_command = self.command
        if change:
            direction = 1 if change > 0 else -1
            if self.direction == -direction:
                self.offset += direction * self.r[0x44]
            self.direction = direction
        if self.r[0x44] == 0:
            self.offset = 0
        error = signed(self.command + self.offset - self.position, 24)
        stepping = self.r[0x02] & 0x02
        if not stepping and min(abs(error), 0xFFFF) > self.word(0x4A, 0x49):
            self.fault(ERROR)
            self.error_noted = True
        self.in_position(error)
        if abs(error) <= self.r[0x45]:
            error = 0
        error = clamp(error, -0x8000, 0x7FFF)
        self.r[0x2C], self.r[0x2D] = error & 0xFF, error >> 8 & 0xFF
        return error

    def in_position(self, error: int) -> None:
        self.r[0x07] &= ~IN_POSITION
        if abs(error) <= self.r[0x45] + 1:
            self.r[0x07] |= IN_POSITION

    # -- filters and outputs -------------------------------------------------------------------

    def drive(self, error: int) -> None:
        """Filter and outputs of a servo."""
        motor = self.pid(error) if self.r[0x01] & 0x08 else self.lead(error)
        shown = clamp(error * 16, -2048, 2047)
        code = 0x800 + shown if self.r[0x01] & 0x80 else self.dac(motor)
        code = clamp(code + signed(self.r[0x0A], 8), 0, 0xFFF)
        self.r[0x08], self.r[0x4C] = code >> 4, code << 4 & 0xF0
        pwm = shown if self.r[0x01] & 0x40 else clamp(motor, -2048, 2047)
        self.r[0x09], self.r[0x4D] = pwm >> 4 & 0xFF, pwm << 4 & 0xF0

    def lead(self, error: int) -> int:
        """MCP-FLT-2."""
        a, b, k = self.r[0x20], self.r[0x21], self.r[0x22]
        motor = 4 * k * error - ((4 * a * k * self.lead_error + b * self.lead_motor) >> 8)
        self.lead_error = error
        self.lead_motor = clamp(motor, -2048, 2047)
        return motor

    def pid(self, error: int) -> int:
        """MCP-FLT-3, MCP-FLT-4, decision 27."""
        if not self.was_saturated:
            self.accumulator += error
        most = (self.r[0x66] & 0x7F) << 8 | self.r[0x65]
        self.accumulator = clamp(self.accumulator, -most, most)
        span = self.r[0x64] if self.r[0x64] in (1, 2, 3, 4, 8) else 1
        acceleration = self.command_velocity - self.last_velocity
        kp, ki, kd, ka, kv = (self.r[n] for n in (0x61, 0x62, 0x63, 0x69, 0x6A))
        motor = (
            256 * kp * error
            + ki * self.accumulator
            + 1024 * kd * (error - self.errors[span - 1])
            + 2 * kv * self.command_velocity
            + 32 * ka * acceleration
        ) >> 9
        self.errors = [error, *self.errors[:7]]
        self.last_velocity = self.command_velocity
        self.was_saturated = not -2048 <= motor <= 2047
        return motor

    def dac(self, motor: int) -> int:
        """The DAC code before the offset (MCP-OUT-1, MCP-OUT-2, decision 26)."""
        limit = self.r[0x4B] if self.r[0x4B] >= 0x80 else ~self.r[0x4B] & 0xFF
        if self.r[0x01] & 0x04:
            if motor < 0 and self.unipolar == "clip":
                return 0x800
            if not -2048 <= motor <= 2047:
                return limit << 4
            return min(0x800 + abs(motor), 0xFFF)
        if motor > 2047:
            return limit << 4
        if motor < -2048:
            return (~limit & 0xFF) << 4
        return 0x800 + motor

    def step(self) -> None:
        """Step mode: a new sample's steps begin now (MCP-STP-1, MCP-STP-2, NOTES 20)."""
        goal = self.command  # Without the backlash offset (NOTES 41).
        steps = self.sign_of_steps * (self.steps - self.sent) + signed(goal - self.stepped_to, 24)
        self.stepped_to = goal
        self.steps, self.sent = abs(steps), 0
        self.steps_from, self.steps_over = self.busy_until, self.period
        if steps:
            sign = 1 if steps > 0 else -1
            if sign != self.sign_of_steps:
                self.steps_from += 1080
                self.steps_over -= 1080
            self.sign_of_steps = sign

    def due(self, cycle: int) -> int:
        """How many of the sample's steps have begun by the end of clock ``cycle``.

        Step j of n begins at j / n of the time, rounded down.
        """
        if not self.steps:
            return 0
        due = -(-(cycle - self.steps_from + 1) * self.steps // self.steps_over)
        return min(max(due, 0), self.steps)

    def run(self, cycle: int) -> None:
        """Send the steps that are due; they count the position."""
        if self.sent == self.steps:
            return
        due = max(self.due(cycle), self.sent)
        self.pass_by(self.sign_of_steps * (due - self.sent))
        self.made += self.sign_of_steps * (due - self.sent)
        self.sent = due
