"""Reference model of the MC1241A and the MC1141A: the manual and the rulings, as plain integers.

One call per cycle (:meth:`MC1241A.cycle`), one per microstep look-up (:meth:`MC1241A.look_up`) and
one per word on the host port. Nothing is left for later and nothing is made quick. It knows nothing
of the emulator it is compared with.

Positions and velocities are integers of 2^-32 microsteps (per cycle). Trapezoid and velocity
contouring work with 2^-16: what an S-curve, or its end, has left of finer fractions they drop.
"""

from collections.abc import Callable
from math import isqrt, pi, sin

COMMANDS = {
    # code: (mnemonic, words written, words read)
    0x01: ("SET_1", 0, 1),
    0x02: ("SET_2", 0, 1),
    0x05: ("GET_HOME", 0, 1),
    0x08: ("SET_I", 0, 1),
    0x09: ("SET_PRFL_TRAP", 0, 0),
    0x0A: ("SET_PRFL_VEL", 0, 0),
    0x0B: ("SET_PRFL_S_CRV", 0, 0),
    0x0C: ("SET_PRFL_GEAR", 0, 0),
    0x10: ("SET_POS", 2, 0),
    0x11: ("SET_VEL", 2, 0),
    0x12: ("SET_ACC", 2, 0),
    0x13: ("SET_JERK", 2, 0),
    0x14: ("SET_RATIO", 2, 0),
    0x15: ("SET_MAX_ACC", 1, 0),
    0x16: ("SET_BRK_PNT", 2, 0),
    0x17: ("SET_TIME_BRK", 0, 0),
    0x18: ("SET_POS_BRK", 0, 0),
    0x19: ("SET_NEG_BRK", 0, 0),
    0x1A: ("UPDATE", 0, 0),
    0x1B: ("SET_ACTL_POS_BRK", 0, 0),
    0x1C: ("SET_ACTL_NEG_BRK", 0, 0),
    0x1D: ("GET_TRGT_POS", 0, 2),
    0x1E: ("GET_TRGT_VEL", 0, 2),
    0x29: ("SET_POS_ERR", 1, 0),
    0x2F: ("SET_INTRPT_MASK", 1, 0),
    0x30: ("GET_INTRPT", 0, 1),
    0x31: ("GET_STATUS", 0, 1),
    0x32: ("RST_INTRPT", 1, 0),
    0x33: ("CLR_STATUS", 0, 0),
    0x34: ("RST_STATUS", 1, 0),
    0x35: ("SET_MTN_CMPLT_BRK", 0, 0),
    0x36: ("GET_CAPT", 0, 2),
    0x37: ("GET_ACTL_POS", 0, 2),
    0x39: ("RESET", 0, 0),
    0x3A: ("GET_MTR_CMD", 0, 1),
    0x3B: ("SET_OUTPUT_DAC16", 0, 0),
    0x3C: ("SET_OUTPUT_PWM", 0, 0),
    0x3E: ("GET_TIME", 0, 2),
    0x42: ("MTR_OFF", 0, 0),
    0x43: ("MTR_ON", 0, 0),
    0x44: ("SET_AUTO_STOP_OFF", 0, 0),
    0x45: ("SET_AUTO_STOP_ON", 0, 0),
    0x46: ("STOP", 0, 0),
    0x47: ("SYNCH_PRFL", 0, 0),
    0x48: ("GET_MODE", 0, 1),
    0x4A: ("GET_POS", 0, 2),
    0x4B: ("GET_VEL", 0, 2),
    0x4C: ("GET_ACC", 0, 2),
    0x4D: ("SET_ACTL_POS", 2, 0),
    0x4E: ("SMOOTH_STOP", 0, 0),
    0x4F: ("GET_MAX_ACC", 0, 1),
    0x55: ("GET_POS_ERR", 0, 1),
    0x56: ("GET_INTRPT_MASK", 0, 1),
    0x57: ("GET_BRK_PNT", 0, 2),
    0x58: ("GET_JERK", 0, 2),
    0x59: ("GET_RATIO", 0, 2),
    0x5B: ("MULTI_UPDATE", 1, 0),
    0x5C: ("SET_AUTO_UPDATE_ON", 0, 0),
    0x5D: ("SET_AUTO_UPDATE_OFF", 0, 0),
    0x5E: ("SET_EXT_BRK", 0, 0),
    0x60: ("GET_ACTL_POS_ERR", 0, 1),
    0x62: ("SET_MTR_CMD", 1, 0),
    0x64: ("SET_CAPT_INDEX", 0, 0),
    0x65: ("SET_CAPT_HOME", 0, 0),
    0x66: ("SET_LMT_SENSE", 1, 0),
    0x67: ("GET_LMT_SWTCH", 0, 1),
    0x68: ("SET_STEP_RATIO", 1, 0),
    0x69: ("GET_BUF_MTR_CMD", 0, 1),
    0x6A: ("SET_START_VEL", 2, 0),
    0x6B: ("GET_START_VEL", 0, 2),
    0x6C: ("GET_VRSN", 0, 1),
    0x6D: ("SET_BRK_OFF", 0, 0),
    0x6E: ("GET_OUTPUT_MODE", 0, 1),
    0x6F: ("GET_STEP_RATIO", 0, 1),
    0x70: ("LMTS_ON", 0, 0),
    0x71: ("LMTS_OFF", 0, 0),
    0x73: ("SET_PHASE_3", 0, 0),
    0x74: ("SET_PHASE_2", 0, 0),
    0x77: ("SET_BUF_MTR_CMD", 1, 0),
    0x7F: ("GET_PHASE_INFO", 0, 1),
}
RESERVED = 0x49

COMPLETE, WRAP, BREAKPOINT, CAPTURE, ERROR, POSITIVE, NEGATIVE, REFUSED = (1 << n for n in range(8))
EVENTS = 0xFF

TRAPEZOIDAL, VELOCITY, S_CURVE, GEAR = range(4)

ONE = 1 << 32
"""A microstep."""
RANGE = 1 << 31
"""Positions wrap after so many."""


def signed(value: int, bits: int) -> int:
    """Return the low ``bits`` of ``value`` as two's complement."""
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> (bits - 1) else value


def up(value: int, divisor: int) -> int:
    """Return the quotient rounded up."""
    return -(-value // divisor)


def least(fits: Callable[[int], bool]) -> int:
    """Return the least whole number, from 0 on, that fits; all greater ones fit as well."""
    low, high = -1, 1
    while not fits(high):
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if fits(middle) else (middle, high)
    return high


def half_away(value: float) -> int:
    """Round; halves away from zero. What is within 1e-6 of a half is one (NOTES 17)."""
    return int(value + 0.500001) if value >= 0 else -int(-value + 0.500001)


SINE = [half_away(32767 * sin(2 * pi * i / 256)) for i in range(256)]
SINE_120 = [half_away(32767 * sin(2 * pi * (i / 256 + 1 / 3))) for i in range(256)]


def scaled(command: int, table: int) -> int:
    """Return command * table / 32767, rounded, halves away from zero (PMD-USTP-4)."""
    product = command * table
    size = (2 * abs(product) + 32767) // (2 * 32767)
    return size if product >= 0 else -size


def dac_word(out: int) -> int:
    """Return the word for a DAC (PMD-USTP-5)."""
    return 32768 + out


def pwm(out: int) -> tuple[int, int]:
    """Return of how many of 256 counts the pulse is, and the level of the sign (PMD-USTP-6)."""
    return (abs(out) + 64) >> 7, int(out < 0)


# -- trapezoid ------------------------------------------------------------------------------------


def last_speed(r: int, acc: int, start: int) -> int:
    """Return S(r): the greatest speed from which way ``r`` still suffices (PMD-TRJ-2)."""
    if r < start:
        return r
    b = acc + 2 * start
    n = (isqrt(b * b + 8 * acc * (r - start)) - b) // (2 * acc)
    speed = (r + acc * n * (n + 1) // 2) // (n + 1)
    return min(speed, start + (n + 1) * acc - 1) if start else speed


def trapezoid(u: int, r: int, vel: int, acc: int, start: int) -> int:
    """Return the velocity toward the destination after ``u``, ``r`` before it (PMD-TRJ-2)."""
    if acc == 0:
        return u
    if u < 0:
        new = u + acc
        if start:
            return 0 if new > -start else new
        return min(new, vel, last_speed(r, acc, start)) if new > 0 else new
    rise = start if u == 0 and start else u + acc
    floor = u - acc
    if start and floor < start:
        floor = 0
    return max(min(vel, last_speed(r, acc, start), rise), floor)


# -- velocity contouring --------------------------------------------------------------------------


def contour(u: int, vel: int, acc: int, start: int) -> int:
    """Return the velocity in the direction of the acceleration after ``u`` (PMD-TRJ-6)."""
    if acc == 0:
        return u
    if u < 0:
        new = u + acc
        if start:
            return 0 if new > -start else new
        return min(new, vel)
    if u > vel:
        new = max(u - acc, vel)
        return 0 if vel == 0 and new < start else new
    if u == 0 and start:
        return min(start, vel)
    return min(u + acc, vel)


def slower(u: int, acc: int, start: int) -> int:
    """Return the speed after ``u`` on the way to a smooth stop (PMD-TRJ-10, NOTES 8)."""
    new = u - acc if acc else 0
    return new if new > 0 and new >= start else 0


# -- S-curve --------------------------------------------------------------------------------------


class SCurve:
    """One move along an S-curve: MCP-SCV-1 to -5 as amended, in units of 2^-32 microsteps.

    The velocity of a sample is peak * c / (m * (m + t)), the peak is the fraction way / samples.
    """

    def __init__(self, start: int, end: int, vel: int, acc: int, jerk: int) -> None:
        self.start, self.end = start, end
        self.sign = 1 if end > start else -1
        self.way = way = abs(end - start)
        if acc * acc >= vel * jerk:
            m, t = least(lambda m: jerk * m * m >= vel), 0
        else:
            m = up(acc, jerk)
            t = max(0, up(vel, acc) - m)
        if way < vel * (2 * m + t):
            m, t = least(lambda m: 2 * jerk * m**3 >= way), 0
            if way > 2 * acc * m * m:
                m = n = up(acc, jerk)
                t = least(lambda t: acc * (n + t) * (2 * n + t) >= way)
        self.m, self.t = m, t
        self.samples = max(2 * m + t, up(way, vel))
        # How many samples each phase has, and in which we are, with how many done.
        self.length = [0, m, t, m, self.samples - 2 * m - t, m, t, m]
        self.phase = 0
        self.done = 0
        self.k = self.c = 0
        # The sum of all c; and the extra sample, its velocity times `samples`.
        self.area = 0
        self.extra = self.inserted = 0
        self.stopping = False

    @property
    def whole(self) -> int:
        """What c is divided by."""
        return self.m * (self.m + self.t)

    def travelled(self) -> int:
        """Return the way made so far."""
        sums = self.way * self.area + self.inserted * self.whole
        return sums // (self.samples * self.whole)

    def following(self) -> tuple[int, int, int, int]:
        """Return phase, samples done in it, k and c after the next ordinary sample."""
        phase, done = max(self.phase, 1), self.done
        while phase < 8 and done >= self.length[phase]:
            phase, done = phase + 1, 0
        if phase == 8:
            return 7, done, 0, 0
        k = self.k + (0, 1, 0, -1, 0, 1, 0, -1)[phase]
        return phase, done + 1, k, self.c + (0, 1, 1, 1, 0, -1, -1, -1)[phase] * k

    def extra_is_next(self) -> bool:
        """Tell whether the extra sample comes before the next ordinary one (MCP-SCV-3)."""
        phase, _, _, c = self.following()
        return self.extra > 0 and phase >= 5 and self.way * c <= self.extra * self.whole

    def step(self) -> int:
        """Make one sample; return its velocity."""
        if self.extra_is_next():
            self.phase_shown = self.following()[0]
            self.inserted, self.extra = self.extra, 0
            return self.sign * (self.inserted // self.samples)
        self.phase, self.done, self.k, self.c = self.following()
        self.phase_shown = self.phase
        self.area += self.c
        return self.sign * (self.way * self.c // (self.samples * self.whole))

    def over(self) -> bool:
        """Tell whether all samples to come have no velocity (MCP-SCV-4)."""
        return self.phase > 0 and not self.extra_is_next() and self.following()[3] == 0

    def aim(self, end: int) -> None:
        """Take another end, if it can be reached with another hold time (PMD-TRJ-5)."""
        if self.stopping or self.phase > 4:
            return
        way = (end - self.start) * self.sign
        samples = way * self.samples // self.way
        hold = samples - 2 * self.m - self.t
        if way > 0 and hold >= (self.done if self.phase == 4 else 0):
            self.end = end
            self.length[4] = hold
            self.extra = way * self.samples - samples * self.way

    def move(self, place: int) -> None:
        """Be somewhere else, and still have the same end if that can be (NOTES 14)."""
        self.start = place - self.sign * self.travelled()
        self.aim(self.end)

    def stop(self) -> None:
        """Stop smoothly (PMD-TRJ-10)."""
        self.stopping = True
        if self.phase > 4:
            return
        self.extra = 0
        if self.phase <= 2:
            reached = self.done if self.phase == 1 else self.m
            held = self.done if self.phase == 2 else 0
            self.length = [0, 0, 0, reached, 0, reached, held, reached]
            self.phase, self.done = 3, 0
        elif self.phase == 3:
            self.length[4] = 0
        else:
            self.phase, self.done = 5, 0


# -- an axis --------------------------------------------------------------------------------------


class Axis:
    """One axis, as it is after a reset (PMD-RST-2)."""

    def __init__(self, number: int) -> None:
        self.number = number
        names = ("POS", "VEL", "ACC", "MAX_ACC", "JERK", "RATIO", "MTR_CMD")
        self.buffered = dict.fromkeys(names, 0)
        self.active = dict.fromkeys(names, 0)
        self.start_vel = 0
        # What has been told since the last update: SET_POS, SET_BUF_MTR_CMD and the actions.
        self.told: set[str] = set()
        self.pending: tuple[dict[str, int], set[str]] | None = None
        self.mode = TRAPEZOIDAL
        self.target = 0
        self.target_turns = 0
        self.velocity = 0
        self.running = False
        self.smooth = False
        self.halted = False
        self.curve: SCurve | None = None
        self.motor_on = True
        # Where the windings are, and where they began and end this cycle (NOTES 25).
        self.angle = 0
        self.course = (0, 0)
        self.two_phase = False
        # The encoder: its count, the one the last cycle saw, the one that `actual` stands for.
        self.count = 0
        self.seen = 0
        self.counted = 0
        self.actual = 0
        self.actual_turns = 0
        self.home = 1
        self.positive = self.negative = 0
        self.capture_home = False
        self.captured = 0
        self.capture_armed = True
        self.capture_new = False
        self.step_ratio = 0
        self.error_offset = 0
        self.error = 0
        self.error_limit = 32767
        self.auto_stop = True
        self.break_mode = ""
        self.break_value = 0
        self.auto_update = True
        self.limit_hit = 0
        self.events = 0
        self.mask = 0

    # -- what a host reads ------------------------------------------------------------------------

    def in_motion(self) -> bool:
        if self.mode == GEAR:
            return False
        return self.velocity != 0 or (self.mode != VELOCITY and self.running)

    def status(self) -> int:
        live = self.motor_on << 8 | 1 << 9 | self.in_motion() << 10
        return self.events | live | (self.number - 1) << 12

    def mode_word(self) -> int:
        phase = self.curve.phase_shown if self.curve and self.curve.phase else 0
        return self.auto_stop << 7 | (not self.auto_update) << 10 | self.mode << 11 | phase << 13

    # -- positions --------------------------------------------------------------------------------

    def advance(self, way: int) -> None:
        """Generate motion (PMD-TRJ-1, PMD-USTP-1)."""
        self.angle += way
        self.target += way
        while self.target >= RANGE // 2 * ONE:
            self.come_round(1)
        while self.target < -RANGE // 2 * ONE:
            self.come_round(-1)

    def come_round(self, way: int) -> None:
        self.target -= way * RANGE * ONE
        self.target_turns += way
        if self.curve:
            self.curve.start -= way * RANGE * ONE
        self.events |= WRAP

    def put_target(self, value: int) -> None:
        self.target = value * ONE
        self.target_turns = 0
        if self.curve:
            self.curve.move(self.target)

    def difference(self) -> int:
        """Return target less actual in counts, the offset left out (PMD-STL-1, NOTES 16)."""
        target = (self.target >> 32) + self.target_turns * RANGE
        return (target * self.step_ratio >> 8) - self.actual - self.actual_turns * RANGE

    def no_error(self) -> None:
        self.error_offset = self.difference()
        self.error = 0

    def exceeded(self) -> bool:
        return self.step_ratio != 0 and abs(self.error) > self.error_limit

    def clear(self, keep: int) -> None:
        """Reset events (PMD-STA-2, PMD-STA-4)."""
        if self.exceeded():
            keep |= ERROR
        self.events &= keep

    # -- stopping ---------------------------------------------------------------------------------

    def rest(self) -> None:
        self.velocity = 0
        self.running = self.smooth = False
        self.curve = None

    def halt(self) -> None:
        """Rest until the next update (NOTES 10)."""
        self.rest()
        self.halted = True

    def turn_off(self) -> None:
        """PMD-MTR-2."""
        if self.in_motion():
            self.events |= COMPLETE
        self.halt()
        self.motor_on = False

    def turn_on(self) -> None:
        """PMD-MTR-1, NOTES 12."""
        if self.in_motion():
            self.events |= COMPLETE
        self.halt()
        self.motor_on = True
        self.no_error()

    def choose(self, mode: int) -> None:
        """PMD-TRJ-13, NOTES 10."""
        if mode == self.mode:
            return
        moving = self.velocity != 0 or self.in_motion()
        if mode == S_CURVE or not moving:
            self.rest()
        elif self.curve:
            # A smooth stop under way goes on, in the manner of the other mode; in gear mode, where
            # it does not function, it waits.
            self.smooth = self.curve.stopping
            self.curve = None
        if mode == GEAR:
            self.running = False
        elif moving and mode != S_CURVE:
            self.running = True
        self.mode = mode

    # -- updates ----------------------------------------------------------------------------------

    def ask_update(self) -> None:
        """UPDATE takes what is loaded now; two before a cycle are one (NOTES 5)."""
        told = self.told | (self.pending[1] if self.pending else set())
        self.pending = (dict(self.buffered), told)
        self.told = set()

    def update(self, loaded: dict[str, int], told: set[str], limits_on: bool, sense: int) -> None:
        """PMD-UPD-1."""
        moving = self.in_motion()
        keep: tuple[str, ...] = ()
        active = self.active
        before = active["POS"]
        if moving and self.mode == TRAPEZOIDAL and loaded["ACC"] != active["ACC"]:
            self.events |= REFUSED
            keep += ("ACC", "VEL")
        if moving and self.mode == S_CURVE:
            three = ("VEL", "MAX_ACC", "JERK")
            if any(loaded[name] != active[name] for name in three):
                self.events |= REFUSED
                keep += three
        if "BUF_MTR_CMD" not in told:
            keep += ("MTR_CMD",)
        for name in loaded:
            if name not in keep:
                active[name] = loaded[name]
        if "SYNCH" in told:
            self.put_target(self.actual)
            self.actual_turns = 0
            self.no_error()
        if "STOP" in told:
            self.halt()
            self.events |= COMPLETE
            return
        if "SMOOTH_STOP" in told and self.mode != GEAR:
            self.halted = False
            self.smooth_stop()
            return
        if not self.motor_on:
            return
        if self.mode in (TRAPEZOIDAL, S_CURVE):
            way = loaded["POS"] * ONE - self.target
            if limits_on and (
                (way > 0 and self.positive != sense & 1)
                or (way < 0 and self.negative != sense >> 1)
            ):
                # Refused, it sets nothing free either.
                self.events |= REFUSED
                active["POS"] = before
                return
        self.halted = False
        self.smooth = False
        if self.mode == VELOCITY:
            self.running = True
        elif self.mode == S_CURVE and self.curve:
            self.curve.aim(active["POS"] * ONE)
        elif self.mode in (TRAPEZOIDAL, S_CURVE) and not moving:
            # The trapezoid has no finer fractions than its velocity (NOTES 15).
            fine = 0 if self.mode == S_CURVE else 16
            if self.target >> fine == active["POS"] * ONE >> fine:
                if "POS" in told:
                    self.events |= COMPLETE
            elif self.mode == TRAPEZOIDAL:
                self.running = bool(active["VEL"] and active["ACC"] & 0x3FFFFFFF)
            elif active["VEL"] and active["MAX_ACC"] and active["JERK"]:
                vel, acc = active["VEL"] << 16, active["MAX_ACC"] << 16
                end = active["POS"] * ONE
                self.curve = SCurve(self.target, end, vel, acc, active["JERK"])
                self.running = True

    def smooth_stop(self) -> None:
        """PMD-TRJ-10, NOTES 8."""
        if not self.in_motion() or (self.curve and self.curve.phase == 0):
            self.rest()
            self.events |= COMPLETE
        elif self.curve:
            self.curve.stop()
        else:
            self.smooth = True

    # -- one cycle --------------------------------------------------------------------------------

    def read_encoder(self) -> int:
        """Return the counts since the last cycle (PMD-CYC-1, 2)."""
        moved = self.count - self.seen
        self.actual += self.count - self.counted
        self.seen = self.counted = self.count
        while self.actual >= RANGE // 2:
            self.actual -= RANGE
            self.actual_turns += 1
            self.events |= WRAP
        while self.actual < -RANGE // 2:
            self.actual += RANGE
            self.actual_turns -= 1
            self.events |= WRAP
        if self.capture_new:
            self.capture_new = False
            self.events |= CAPTURE
        return moved

    def reached(self, time: int) -> bool:
        """Tell whether the breakpoint's condition is met (PMD-UPD-2, NOTES 19)."""
        value, target = self.break_value, self.target >> 32
        return {
            "": False,
            "TIME": value & 0xFFFFFFFF == time,
            "POS": target >= value,
            "NEG": target <= value,
            "ACTL_POS": self.actual >= value,
            "ACTL_NEG": self.actual <= value,
            "MTN_CMPLT": bool(self.events & COMPLETE),
            "EXT": self.home == 0,
        }[self.break_mode]

    def watch_limits(self, limits_on: bool, sense: int) -> None:
        """PMD-LIM-1, PMD-LIM-2, PMD-LIM-4, NOTES 9."""
        active = (self.positive != sense & 1) * POSITIVE | (self.negative != sense >> 1) * NEGATIVE
        if self.limit_hit and not (active | self.events) & self.limit_hit:
            self.limit_hit = 0
        if limits_on and not self.limit_hit and active:
            self.limit_hit = POSITIVE if active & POSITIVE else NEGATIVE
            self.halt()
            self.events |= self.limit_hit | COMPLETE

    def profile(self, moved: int) -> None:
        """Generate the motion of one cycle."""
        before = self.angle
        self.generate(moved)
        self.course = (before, self.angle)

    def generate(self, moved: int) -> None:
        active, start = self.active, self.start_vel
        if self.mode == GEAR:
            follow = self.motor_on and not self.halted
            self.velocity = moved * active["RATIO"] << 16 if follow else 0
            self.advance(self.velocity)
        elif self.mode == S_CURVE:
            if self.curve:
                curve = self.curve
                before = curve.travelled()
                self.velocity = curve.step()
                self.advance((curve.travelled() - before) * curve.sign)
                if curve.over():
                    self.rest()
                    self.events |= COMPLETE
        elif self.running:
            # NOTES 15.
            finer = self.target & 0xFFFF
            self.target -= finer
            self.angle -= finer
            vel = active["VEL"]
            if self.mode == TRAPEZOIDAL:
                acc = active["ACC"] & 0x3FFFFFFF
                way = active["POS"] * 65536 - (self.target >> 16)
                sign = 1 if way >= 0 else -1
                u = (self.velocity >> 16) * sign
                if not self.smooth:
                    u = trapezoid(u, abs(way), vel, acc, start)
            else:
                acc = signed(active["ACC"], 31)
                sign = 1 if acc >= 0 else -1
                acc = abs(acc)
                u = (self.velocity >> 16) * sign
                if not self.smooth:
                    u = contour(u, vel, acc, start)
            if self.smooth:
                u = slower(u, acc, start) if u > 0 else -slower(-u, acc, start)
            before = self.velocity
            self.velocity = u * sign << 16
            self.advance(self.velocity)
            if self.smooth:
                over = u == 0
            elif self.mode == TRAPEZOIDAL:
                there = self.target == active["POS"] * ONE
                over = (there and abs(u) <= start + acc) or (u == 0 and not (vel and acc))
            else:
                over = before != 0 and u == 0 and vel == 0
            if over:
                self.rest()
                self.events |= COMPLETE

    def watch_error(self) -> None:
        """PMD-STL-1."""
        error = self.difference() - self.error_offset
        self.error = max(-32768, min(32767, error)) if self.step_ratio else 0
        if self.exceeded():
            self.events |= ERROR
            if self.auto_stop:
                self.turn_off()

    def look_up(self, slot: int) -> tuple[int, int]:
        """Return phase A and B of microstep slot 1 to 8 (PMD-USTP-2, -3, -4)."""
        start, end = self.course
        place = (8 * start + (end - start) * slot) // (8 * ONE) % 256
        b = SINE[(place + 64) % 256] if self.two_phase else SINE_120[place]
        command = self.active["MTR_CMD"]
        return scaled(command, SINE[place]), scaled(command, b)


# -- the chip set ---------------------------------------------------------------------------------


class MC1241A:
    """The chip set: packets, commands, cycles.

    Args:
        axes: 2 for the MC1241A, 1 for the MC1141A.
    """

    def __init__(self, axes: int = 2) -> None:
        self.axes = [Axis(number + 1) for number in range(axes)]
        self.current = self.axes[0]
        self.interrupting: Axis | None = None
        self.line_rests = False
        self.time = 0
        self.limits_on = True
        self.sense = 0
        self.output_mode = 0
        self.code = -1
        self.name = ""
        self.written: list[int] = []
        self.due_write = 0
        self.due_read: list[int] = []
        self.sum = 0

    # -- packets (PMD-PKT) ------------------------------------------------------------------------

    def command(self, code: int) -> None:
        """A command byte has been processed."""
        self.name, self.due_write, _ = COMMANDS.get(code, ("", 0, 0))
        self.code = code
        self.written, self.due_read = [], []
        self.sum = code
        if self.name and not self.due_write:
            self.execute()

    def write(self, word: int) -> None:
        """A data word has been processed."""
        if self.due_write:
            self.written.append(word)
            self.sum += word
            self.due_write -= 1
            if not self.due_write:
                self.execute()

    def word(self) -> int:
        """Return the word that the host reads next: data, or the checksum again and again."""
        if self.due_write or not (self.name or self.code == RESERVED):
            return 0
        return self.due_read[0] if self.due_read else self.sum & 0xFFFF

    def read(self) -> int:
        """The host has read a word; return it."""
        word = self.word()
        if self.due_read and not self.due_write:
            self.sum += self.due_read.pop(0)
        return word

    def execute(self) -> None:
        value = 0
        for word in self.written:
            value = value << 16 | word
        words = COMMANDS[self.code][2]
        answer = self.carry_out(self.name, value)
        self.due_read = [answer >> 16 * n & 0xFFFF for n in reversed(range(words))]

    # -- commands (PMD-CMD) -----------------------------------------------------------------------

    def carry_out(self, name: str, value: int) -> int:
        """Carry out one command; return what it reads."""
        axis = self.current
        if name in ("SET_1", "SET_2", "SET_I"):
            if name == "SET_1":
                self.current = self.axes[0]
            elif name == "SET_2":
                self.current = self.axes[-1]
            elif self.interrupting:
                self.current = self.interrupting
            return self.current.status()
        answer = 0
        if name.startswith("SET_PRFL_"):
            axis.choose(("TRAP", "VEL", "S_CRV", "GEAR").index(name[9:]))
        elif name == "SET_POS":
            axis.buffered["POS"] = signed(value, 31)
            axis.told.add("POS")
        elif name == "SET_VEL":
            axis.buffered["VEL"] = value & 0x3FFFFFFF
        elif name == "SET_ACC":
            axis.buffered["ACC"] = signed(value, 32)
        elif name == "SET_MAX_ACC":
            axis.buffered["MAX_ACC"] = value & 0x7FFF
        elif name == "SET_JERK":
            axis.buffered["JERK"] = value & 0x7FFFFFFF
        elif name == "SET_RATIO":
            axis.buffered["RATIO"] = signed(value, 32)
        elif name == "SET_START_VEL":
            if axis.in_motion():
                axis.events |= REFUSED
            else:
                axis.start_vel = value & 0x3FFFFFFF
        elif name in ("STOP", "SMOOTH_STOP", "SYNCH_PRFL"):
            axis.told.add(name.removesuffix("_PRFL"))
        elif name in ("GET_POS", "GET_VEL", "GET_ACC", "GET_MAX_ACC", "GET_JERK", "GET_RATIO"):
            answer = axis.buffered[name[4:]]
        elif name == "GET_START_VEL":
            answer = axis.start_vel
        elif name == "GET_TRGT_POS":
            answer = axis.target >> 32
        elif name == "GET_TRGT_VEL":
            answer = axis.velocity >> 16
        elif name == "SET_BRK_PNT":
            axis.break_value = signed(value, 32)
        elif name == "GET_BRK_PNT":
            answer = axis.break_value
        elif name == "SET_BRK_OFF":
            axis.break_mode = ""
        elif name.endswith("_BRK"):
            axis.break_mode = name[4:-4]
        elif name == "UPDATE":
            axis.ask_update()
        elif name == "MULTI_UPDATE":
            for each in self.axes:
                if value >> (each.number - 1) & 1:
                    each.ask_update()
        elif name.startswith("SET_AUTO_UPDATE_"):
            axis.auto_update = name.endswith("ON")
        elif name.startswith("SET_AUTO_STOP_"):
            axis.auto_stop = name.endswith("ON")
        elif name == "SET_INTRPT_MASK":
            axis.mask = value & EVENTS
        elif name == "GET_INTRPT_MASK":
            answer = axis.mask
        elif name == "GET_INTRPT":
            answer = (self.interrupting or axis).status()
        elif name == "RST_INTRPT":
            if self.interrupting:
                self.interrupting.clear(value)
                self.interrupting = None
                self.line_rests = True
        elif name == "CLR_STATUS":
            axis.clear(0)
        elif name == "RST_STATUS":
            axis.clear(value)
        elif name == "GET_STATUS":
            answer = axis.status()
        elif name == "GET_MODE":
            answer = axis.mode_word()
        elif name == "GET_ACTL_POS":
            answer = axis.actual
        elif name in ("SET_CAPT_INDEX", "SET_CAPT_HOME"):
            axis.capture_home = name.endswith("HOME")
            axis.capture_armed = True
        elif name == "GET_CAPT":
            answer = axis.captured
            axis.capture_armed = True
        elif name == "SET_STEP_RATIO":
            axis.step_ratio = value & 0x7FFF
            axis.no_error()
        elif name == "GET_STEP_RATIO":
            answer = axis.step_ratio
        elif name == "SET_POS_ERR":
            axis.error_limit = value & 0x7FFF
        elif name == "GET_POS_ERR":
            answer = axis.error_limit
        elif name == "GET_ACTL_POS_ERR":
            answer = axis.error
        elif name == "SET_OUTPUT_PWM":
            self.output_mode = 0
        elif name == "SET_OUTPUT_DAC16":
            self.output_mode = 2
        elif name == "GET_OUTPUT_MODE":
            answer = self.output_mode
        elif name == "MTR_ON":
            axis.turn_on()
        elif name == "MTR_OFF":
            axis.turn_off()
        elif name == "SET_MTR_CMD":
            axis.active["MTR_CMD"] = max(-32767, signed(value, 16))
        elif name == "GET_MTR_CMD":
            answer = axis.active["MTR_CMD"]
        elif name == "SET_BUF_MTR_CMD":
            axis.buffered["MTR_CMD"] = max(-32767, signed(value, 16))
            axis.told.add("BUF_MTR_CMD")
        elif name == "GET_BUF_MTR_CMD":
            answer = axis.buffered["MTR_CMD"]
        elif name == "SET_ACTL_POS":
            axis.actual, axis.actual_turns = signed(value, 31), 0
            axis.counted = axis.count
            axis.put_target(axis.actual)
            axis.no_error()
        elif name == "SET_LMT_SENSE":
            self.sense = value & 0xF
        elif name == "GET_LMT_SWTCH":
            for each in self.axes:
                answer |= (each.positive | each.negative << 1) << 2 * (each.number - 1)
        elif name in ("LMTS_ON", "LMTS_OFF"):
            self.limits_on = name == "LMTS_ON"
        elif name == "GET_HOME":
            for each in self.axes:
                answer |= each.home << (each.number - 1)
        elif name == "RESET":
            self.reset()
        elif name == "GET_VRSN":
            # Generation 1, part 31, major version 2: an "A" part (NOTES 22).
            answer = 1 << 14 | (len(self.axes) - 1) << 11 | 2 << 8 | 2 << 3
        elif name == "GET_TIME":
            answer = self.time
        elif name in ("SET_PHASE_2", "SET_PHASE_3"):
            axis.two_phase = name == "SET_PHASE_2"
        elif name == "GET_PHASE_INFO":
            answer = axis.two_phase << 3
        else:
            raise ValueError(name)
        self.interrupt()
        return answer

    def reset(self) -> None:
        """PMD-RST-2; levels at the pins are as they are."""
        levels = [(a.count, a.home, a.positive, a.negative) for a in self.axes]
        self.__init__(len(self.axes))  # type: ignore[misc]
        for axis, (count, home, positive, negative) in zip(self.axes, levels, strict=True):
            axis.count = axis.seen = axis.counted = count
            axis.home, axis.positive, axis.negative = home, positive, negative

    # -- inputs -----------------------------------------------------------------------------------

    def trigger(self, number: int, home: bool, place: int) -> None:
        """Index (or home) of an axis has come, at encoder count ``place`` (PMD-CAP-1)."""
        axis = self.axes[number - 1]
        if axis.capture_armed and axis.capture_home == home:
            axis.captured = signed(axis.actual + place - axis.counted, 31)
            axis.capture_armed = False
            axis.capture_new = True

    # -- time -------------------------------------------------------------------------------------

    def cycle(self) -> None:
        """Run one cycle (PMD-CYC-1)."""
        self.time = (self.time + 1) % (1 << 32)
        for axis in self.axes:
            sense = self.sense >> 2 * (axis.number - 1) & 3
            moved = axis.read_encoder()
            met = axis.reached(self.time)
            if axis.pending:
                loaded, told = axis.pending
                axis.pending = None
                axis.update(loaded, told, self.limits_on, sense)
            if met:
                axis.events |= BREAKPOINT
                axis.break_mode = ""
                if axis.auto_update:
                    told, axis.told = axis.told, set()
                    axis.update(axis.buffered, told, self.limits_on, sense)
            axis.watch_limits(self.limits_on, sense)
            axis.profile(moved)
            axis.watch_error()
        self.interrupt()

    def line_has_rested(self) -> None:
        """A clock has passed since RST_INTRPT (PMD-INT-3)."""
        self.line_rests = False
        self.interrupt()

    def interrupt(self) -> None:
        """PMD-INT-1, PMD-INT-2."""
        for axis in self.axes:
            if not self.interrupting and not self.line_rests and axis.events & axis.mask:
                self.interrupting = axis

    def look_up(self, slot: int) -> list[tuple[int, int]]:
        """Return the outputs of all axes in microstep slot 1 to 8 of the cycle."""
        return [axis.look_up(slot) for axis in self.axes]
