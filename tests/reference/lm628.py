"""The LM628 and the LM629 once more, as plainly as their manual reads.

Whole numbers, one call for each byte of a packet and one for each servo sample, every sample
computed. It is written from the manual and the rulings, knows nothing of the emulator and is there
to be compared with it: ``test_lm628.py`` does so.

What a byte does, it does when the busy time it starts has ended (LM-BUS-9): the caller makes the
call then. Between two calls of :meth:`LM628.sample` lie the bytes whose busy times end there.
"""

MOTOR_OFF, BREAKPOINT, POSITION_ERROR, WRAPAROUND = 0x80, 0x40, 0x20, 0x10
INDEX, TRAJECTORY_COMPLETE, COMMAND_ERROR = 0x08, 0x04, 0x02
INTERRUPTS = 0x7E

FORWARD, VELOCITY_MODE = 0x1000, 0x0800
STOP_SMOOTHLY, STOP_ABRUPTLY, TURN_OFF = 0x0400, 0x0200, 0x0100
STOPS = STOP_SMOOTHLY | STOP_ABRUPTLY | TURN_OFF

HIGHEST_RATE = 0x3FFFFFFF

WRITTEN = {
    0x1A: ["LPES"],
    0x1B: ["LPEI"],
    0x1C: ["MSKI"],
    0x1D: ["RSTI"],
    0x1E: ["LFIL"],
    0x1F: ["LTRJ"],
    0x20: ["high", "SBPA"],
    0x21: ["high", "SBPR"],
}
"""The words of the commands that write: what is done when each is complete."""


def signed(value: int, bits: int) -> int:
    """Read the lowest ``bits`` bits as two's complement."""
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> (bits - 1) else value


def clamp(value: int, low: int, high: int) -> int:
    return max(low, min(high, value))


def saturate16(value: int) -> int:
    return clamp(value, -0x8000, 0x7FFF)


def wrapped(position: int) -> int:
    """Bring a position into its range, -2^30 to 2^30 - 1 (LM-POS-2)."""
    return signed(position, 31)


def braking_way(speed: int, a: int) -> int:
    """F(u) of LM-TRJ-12: the way of this sample and all that follow, each slower by ``a``."""
    n = speed // a
    return (n + 1) * speed - a * n * (n + 1) // 2


class Parameter:
    """Acceleration, velocity or position as LTRJ loaded it, until an STT has made it absolute."""

    def __init__(self, bits: int = 0, relative: bool = False) -> None:
        self.bits = bits
        self.relative = relative

    def resolve_rate(self, active: int) -> int:
        """Return the acceleration or velocity meant, and keep it (LM-TRJ-2, LM-TRJ-3)."""
        if self.relative:
            self.bits = clamp(active + signed(self.bits, 32), 0, HIGHEST_RATE)
            self.relative = False
        return self.bits & HIGHEST_RATE

    def resolve_position(self, target: int) -> int:
        """Return the position meant, and keep it."""
        if self.relative:
            self.bits = wrapped(target + signed(self.bits, 32)) & 0xFFFFFFFF
            self.relative = False
        return wrapped(self.bits)


class Start:
    """What an accepted STT found in the buffers, for the sample that carries it out."""

    def __init__(self, control: int, loaded: dict[str, Parameter] | None) -> None:
        self.control = control
        self.loaded = loaded
        """None if nothing but the stop is to be done."""


class LM628:
    """One chip that has just been reset, with its encoder standing at ``count``."""

    def __init__(
        self,
        part: str = "LM628",
        pid_overflow: str = "saturate",
        integral_limit: str = "sum",
        reset_status: str = "84",
        count: int = 0,
    ) -> None:
        self.lm629 = part.startswith("LM629")
        self.wrap_products = pid_overflow == "wrap"
        self.limit_sum = integral_limit == "sum"
        self.reset_flags = int(reset_status, 16) & INTERRUPTS
        self.reset_done(count)

    # -- reset --------------------------------------------------------------------------------

    def reset(self) -> None:
        """A reset begins (LM-RST-2): nothing but :meth:`reset_done` matters until then."""
        self.reset_done(0)
        self.in_reset = True
        self.motor_off = False
        self.flags = 0

    def reset_done(self, count: int) -> None:
        """It is over; home is where the encoder stands now (NOTES 2)."""
        self.in_reset = False
        # Status: 84h or C4h (LM-RST-5).
        self.motor_off = True
        self.flags = self.reset_flags
        self.breakpoint_stuck = bool(self.reset_flags & BREAKPOINT)
        self.mask = 0x3E
        self.acceleration_loaded = False
        self.udf_executed = False
        self.forward = False
        self.velocity_mode = False
        self.on_target = False
        self.stop_on_error = False
        self.port8 = True
        self.sip = False
        # Encoder.
        self.count = count
        self.real = 0
        self.real_velocity = 0
        self.index_register = 0
        self.threshold = 0x7FFF
        self.breakpoint: int | None = None
        # Profile: position and velocity in 1/65536 counts, the target in counts (LM-TRJ-11).
        self.desired = 0
        self.velocity = 0
        self.target = 0
        self.v = 0
        self.a = 0
        self.stopping = False
        self.control = 0
        self.buffers = {name: Parameter() for name in ("a", "v", "position")}
        self.start: Start | None = None
        # Filter.
        self.loaded = {"kp": 0, "ki": 0, "kd": 0, "il": 0, "ds": 0}
        self.working = dict(self.loaded)
        self.update: dict[str, int] | None = None
        self.sum = 0
        self.summation = 0
        self.beyond_limit = False
        self.last_error = 0
        self.derivative = 0
        self.until_derivative = 0
        # Output.
        self.put_out(0)
        # Host port.
        self.to_write: list[str] = []
        self.to_read: list[int] = []
        self.first_byte: int | None = None
        self.high_word = 0
        self.last_byte = 0

    # -- what can be seen at any time ---------------------------------------------------------

    def status(self) -> int:
        """The status byte but for its busy bit, which is the caller's (LM-STA-1)."""
        return self.flags | (MOTOR_OFF if self.motor_off else 0)

    def signals(self) -> int:
        """The signals register (LM-STA-2)."""
        high = 0
        for bit, value in (
            (15, self.hi()),
            (14, self.acceleration_loaded),
            (13, self.udf_executed),
            (12, self.forward),
            (11, self.velocity_mode),
            (10, self.on_target),
            (9, self.stop_on_error),
            (8, self.port8),
        ):
            high |= value << bit
        return high | self.status() | self.sip

    def hi(self) -> bool:
        """The host interrupt output (LM-STA-7)."""
        return self.flags & self.mask != 0

    # -- the host port ------------------------------------------------------------------------

    def command(self, code: int) -> None:
        """A command byte; what is left of the packet before it is forgotten (LM-BUS-11)."""
        self.to_write = list(WRITTEN.get(code, ()))
        self.to_read = []
        self.first_byte = None
        match code:
            case 0x00:
                self.reset()
            case 0x01:
                self.stt()
            case 0x02:
                self.dfh()
            case 0x03:
                self.sip = True
            case 0x04:
                self.udf_executed = True
                self.update = dict(self.loaded)
            case 0x05:
                self.port8 = True
            case 0x06:
                self.port8 = False
            case 0x07:
                self.report(self.velocity, 4)
            case 0x08:
                self.report(self.desired >> 16, 4)
            case 0x09:
                self.report(self.index_register, 4)
            case 0x0A:
                self.report(self.real, 4)
            case 0x0B:
                self.report(self.real_velocity, 2)
            case 0x0C:
                self.report(self.signals(), 2)
            case 0x0D:
                self.report(self.summation, 2)
            case _ if code not in WRITTEN:
                self.flags |= COMMAND_ERROR

    def report(self, value: int, length: int) -> None:
        """Hold a value for the reads to come, high byte first (LM-CMD-24)."""
        self.to_read = list((value & (1 << 8 * length) - 1).to_bytes(length, "big"))

    def write(self, byte: int) -> bool:
        """A data byte; tell whether it makes the chip busy, as the second of a word does."""
        if not self.to_write:
            self.flags |= COMMAND_ERROR
            return False
        if self.first_byte is None:
            self.first_byte = byte
            return False
        word = self.first_byte << 8 | byte
        self.first_byte = None
        self.take(self.to_write.pop(0), word)
        return True

    def read(self) -> tuple[int, bool]:
        """Read a data byte; tell too whether that makes the chip busy."""
        if not self.to_read:
            self.flags |= COMMAND_ERROR
            return self.last_byte, False
        self.last_byte = self.to_read.pop(0)
        return self.last_byte, len(self.to_read) % 2 == 0

    def take(self, name: str, word: int) -> None:
        """A word of a packet is complete."""
        match name:
            case "LPES" | "LPEI":
                self.threshold = word & 0x7FFF
                self.stop_on_error = name == "LPES"
            case "MSKI":
                self.mask = word & INTERRUPTS
            case "RSTI":
                self.flags &= word
                if self.breakpoint_stuck:
                    self.flags |= BREAKPOINT
            case "high":
                self.high_word = word
            case "SBPA" | "SBPR":
                value = signed(self.high_word << 16 | word, 32)
                self.breakpoint = wrapped(value + (self.target if name == "SBPR" else 0))
                self.breakpoint_stuck = False
            case "LFIL":
                self.loaded["ds"] = word >> 8
                for bit, coefficient in ((8, "kp"), (4, "ki"), (2, "kd"), (1, "il")):
                    if word & bit:
                        self.to_write.append(coefficient)
            case "kp" | "ki" | "kd" | "il":
                self.loaded[name] = word & 0x7FFF
            case "LTRJ":
                self.control = word
                for bit, parameter in ((0x20, "a"), (0x08, "v"), (0x02, "position")):
                    if word & bit:
                        self.to_write += [f"{parameter} high", f"{parameter} low"]
            case _:
                self.load(*name.split(), word)

    def load(self, name: str, half: str, word: int) -> None:
        """Half of a trajectory parameter (LM-TRJ-1, NOTES 7)."""
        bits = self.buffers[name].bits
        if half == "high":
            bits = word << 16 | bits & 0xFFFF
        else:
            bits = bits & 0xFFFF0000 | word
        relative = {"a": 0x10, "v": 0x04, "position": 0x01}[name]
        self.buffers[name] = Parameter(bits, self.control & relative != 0)
        if name == "a":
            self.acceleration_loaded = True

    def dfh(self) -> None:
        """Home is here; loop and stopping place stay where they are (LM-POS-4)."""
        off = self.real
        self.real = 0
        self.desired = signed(self.desired - (off << 16), 47)
        self.target = wrapped(self.target - off)

    def stt(self) -> None:
        """Refuse to start, or take what the buffers hold now (LM-TRJ-4, NOTES 18)."""
        in_motion = not self.motor_off and not self.on_target
        refused = self.acceleration_loaded and in_motion
        if refused and not self.control & STOPS:
            self.flags |= COMMAND_ERROR
            return
        if not refused:
            self.start = Start(self.control, dict(self.buffers))
        elif self.start is None:
            self.start = Start(self.control & STOPS, None)
        else:
            self.start.control |= self.control & STOPS
        self.control &= ~STOPS

    # -- events -------------------------------------------------------------------------------

    def index(self, count: int) -> None:
        """The encoder enters the state A = B = /IN = low at ``count`` (LM-POS-3)."""
        if self.sip:
            self.sip = False
            self.index_register = wrapped(self.real + count - self.count)
            self.flags |= INDEX

    def sample(self, count: int) -> None:
        """One servo sample, the encoder standing at ``count`` (LM-TRJ-17)."""
        if self.in_reset:
            return
        # (1) Position.
        before = self.real
        moved = count - self.count
        self.count = count
        self.real = wrapped(before + moved)
        if self.real != before + moved:
            self.flags |= WRAPAROUND
        self.real_velocity = clamp(moved, -0x4000, 0x3FFF)
        # (2), (3) What STT and UDF have asked for.
        if self.start is not None:
            self.begin(self.start)
            self.start = None
        if self.update is not None:
            self.working = self.update
            self.update = None
            self.until_derivative = 0
        # (4), (5) Profile and filter.
        if not self.motor_off:
            if not self.on_target:
                self.generate()
            self.control_motor()
        else:
            self.put_out(0)
        # (6) Breakpoint: reached, or passed on the way, from either side (LM-POS-5).
        if self.breakpoint is not None:
            low, high = min(before, before + moved), max(before, before + moved)
            if (self.breakpoint - low) % (1 << 31) <= high - low:
                self.flags |= BREAKPOINT
                self.breakpoint = None
        # (7)
        self.udf_executed = False

    # -- profile ------------------------------------------------------------------------------

    def begin(self, start: Start) -> None:
        """Carry out an STT (LM-TRJ-3 to LM-TRJ-10)."""
        control, loaded = start.control, start.loaded
        if loaded is not None:
            self.a = loaded["a"].resolve_rate(self.a)
            self.v = loaded["v"].resolve_rate(self.v)
            self.velocity_mode = bool(control & VELOCITY_MODE)
            self.forward = bool(control & FORWARD)
            if loaded["a"] is self.buffers["a"]:
                self.acceleration_loaded = False
        if control & TURN_OFF:
            self.turn_off()
            if self.velocity_mode:
                self.target = self.desired >> 16
            return
        if self.motor_off:
            self.motor_off = False
            self.desired = self.real << 16
            self.velocity = 0
            self.sum = 0
            self.last_error = 0
            self.derivative = 0
        self.on_target = False
        self.stopping = False
        if control & STOP_ABRUPTLY:
            self.desired = self.real << 16
            self.target = self.real
            self.velocity = 0
            self.reach_target()
        elif control & STOP_SMOOTHLY:
            self.stopping = True
        elif loaded is not None:
            self.target = loaded["position"].resolve_position(self.target)

    def turn_off(self) -> None:
        """Motor off, by STT or by an excessive error (LM-TRJ-10, LM-STA-4)."""
        if not self.motor_off and not self.on_target:
            self.flags |= TRAJECTORY_COMPLETE
        self.motor_off = True
        self.velocity = 0
        self.sum = 0
        self.summation = 0
        self.beyond_limit = False

    def reach_target(self) -> None:
        """On target, and before neither that nor off: trajectory-complete rises (LM-STA-4)."""
        self.flags |= TRAJECTORY_COMPLETE
        self.on_target = True

    def generate(self) -> None:
        """Advance the desired position by one sample."""
        if self.stopping:
            self.stop_step()
        elif self.velocity_mode:
            self.velocity_step()
        else:
            self.position_step()

    def move_desired(self) -> None:
        """Add the velocity; numbers that come round are told (LM-POS-2)."""
        after = self.desired + self.velocity
        self.desired = signed(after, 47)
        if self.desired != after:
            self.flags |= WRAPAROUND

    def stop_step(self) -> None:
        """LM-TRJ-9."""
        speed = max(abs(self.velocity) - self.a, 0) if self.a else 0
        self.velocity = speed if self.velocity > 0 else -speed
        self.move_desired()
        self.target = self.desired >> 16
        if speed == 0:
            self.desired = self.target << 16
            self.reach_target()

    def velocity_step(self) -> None:
        """LM-TRJ-13."""
        goal = self.v if self.forward else -self.v
        self.velocity += clamp(goal - self.velocity, -self.a, self.a)
        self.move_desired()
        self.target = self.desired >> 16

    def position_step(self) -> None:
        """LM-TRJ-12."""
        to_go = (self.target << 16) - self.desired
        if to_go:
            d = 1 if to_go > 0 else -1
        else:
            d = -1 if self.velocity > 0 else 1
        if self.a:
            u = self.approach(abs(to_go), self.velocity * d)
            self.velocity = u * d
        self.move_desired()
        if self.desired == self.target << 16 and abs(self.velocity) <= self.a:
            self.velocity = 0
            self.reach_target()

    def approach(self, r: int, u: int) -> int:
        """Return the next velocity toward a target that lies ``r`` ahead (LM-TRJ-12)."""
        if u < 0:
            u += self.a
            return min(u, self.v, r) if u > 0 else u
        if max(r, u) <= self.a and r <= self.v:
            return r
        for wanted in (min(self.v, u + self.a), min(u, self.v), u - self.a):
            reachable = wanted >= 0 and abs(wanted - u) <= self.a
            if reachable and braking_way(wanted, self.a) <= r:
                return wanted
        return max(u - self.a, 0)

    # -- filter -------------------------------------------------------------------------------

    def control_motor(self) -> None:
        """Error, threshold, filter and output of a sample with the motor on."""
        error = saturate16(wrapped((self.desired >> 16) - self.real))
        if min(abs(error), 0x7FFF) > self.threshold:
            self.flags |= POSITION_ERROR
            if self.stop_on_error:
                self.turn_off()
                self.put_out(0)
                return
        self.put_out(self.filter(error))

    def product(self, value: int) -> int:
        """What is kept of a product or of the sum (LM-PID-6, LM-PID-7)."""
        return signed(value, 16) if self.wrap_products else saturate16(value)

    def filter(self, error: int) -> int:
        """LM-PID-3 to LM-PID-7."""
        working = self.working
        if self.until_derivative == 0:
            self.derivative = self.product(working["kd"] * (error - self.last_error))
            self.last_error = error
            self.until_derivative = working["ds"] + 1
        self.until_derivative -= 1
        proportional = self.product(working["kp"] * error)
        return self.product(proportional + self.integrate(error) + self.derivative)

    def integrate(self, error: int) -> int:
        """Return the contribution of the integral (LM-PID-4, LM-PID-5)."""
        ki, il = self.working["ki"], self.working["il"]
        after = clamp(self.sum + error, -0x7FFFFF, 0x7FFFFF)
        integral = after >> 8 if self.limit_sum else self.product(ki * (after >> 8))
        limited = clamp(integral, -il, il)
        self.summation = limited
        if limited == integral:
            self.sum = after
            self.beyond_limit = False
            return self.product(ki * limited) if self.limit_sum else limited
        if abs(after) <= abs(self.sum):
            self.sum = after
        # Where it passes its limit it is read as it was added.
        if self.limit_sum and not self.beyond_limit:
            self.summation = integral
        self.beyond_limit = True
        return self.product(ki * limited) if self.limit_sum else limited

    def put_out(self, u: int) -> None:
        """Give the 16 bits of the motor command to the output (LM-PID-8, LM-PID-10)."""
        self.motor_command = u
        self.sign = u < 0
        self.magnitude = min(abs(u >> 8), 127)
        self.code_bits = 8 if self.port8 or self.lm629 else 12
        self.code = (u >> (16 - self.code_bits)) + (1 << self.code_bits - 1)
