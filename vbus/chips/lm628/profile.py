"""The trajectory generator and its primary buffers."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.lm628 import datasheet as ds
from vbus.chips.motion.trapezoid import arrived, stopping_distance, toward
from vbus.core.bits import clamp, sign_extend, wrap, wrap_word
from vbus.core.state import Names

ACCELERATION: Final = 0
VELOCITY: Final = 1
POSITION: Final = 2

_WRAPPED: Final = ds.POSITION_BITS + 16
_HALF: Final = (ds.POSITION_MAX + 1) << 16


def approach(way: i64, speed: i64, top: i64, accel: i64) -> i64:
    """Return the velocity of the coming sample of a position move (LM-TRJ-12).

    Every number fits a machine word: rates have 30 bits, a way 48, and a stopping distance is less
    than 2^61.

    Args:
        way: how far the target lies ahead (0 or more), in 1/65536 counts.
        speed: velocity of the last sample toward the target; negative moves away from it.
        top: velocity limit.
        accel: acceleration, not 0.

    Returns:
        The velocity toward the target.
    """
    if speed < 0:
        least = speed + accel
        if least <= 0:
            return least
        if least > top:
            least = top
        # Slower than one acceleration: one more sample is all the stopping there is.
        return least if least < way else way
    if way <= accel and speed <= accel and way <= top:
        return way
    slower = speed - accel
    faster = speed + accel
    # LM-TRJ-15: an A above V reaches V in one sample.
    if faster > top:
        faster = top
    if faster >= slower:
        ends = stopping_distance(faster, accel)
        if ends <= way:
            return faster
        if speed < top:
            # One step of A more is one sample more, at that velocity.
            if faster - speed == accel:
                ends -= faster
            else:
                ends = stopping_distance(speed, accel)
            if ends <= way:
                return speed
    if slower > 0:
        return slower
    return 0


class Trajectory:
    """Desired position and velocity, sample by sample.

    Positions are in 1/65536 counts, wrapped to 31 bits of counts; velocities in 1/65536 counts per
    sample, accelerations in 1/65536 counts per sample squared. The target is in counts.

    Attributes:
        position: desired position.
        velocity: desired velocity, signed.
        target: active target: where the position move under way or ended goes; the desired position
            in velocity mode, and in and after a smooth stop.
        top: active velocity limit.
        accel: active acceleration.
        velocity_mode: active mode.
        forward: active direction of velocity mode.
        stopping: a smooth stop is under way.
        done: the last STT is completed: signals bit 10.
        wrapped: the desired position has left its range since this was cleared.
        control: bits 12-8 of the last LTRJ control word; stop bits go when STT uses them.
        raw: 32-bit acceleration, velocity and position as written.
        relative: which of them are relative to the active values.
        accel_loaded: acceleration was written and not yet taken: signals bit 14.
        started: what an STT that waits for its sample has taken of :attr:`control`.
    """

    STATE: ClassVar[Names] = (
        "position", "velocity", "target", "top", "accel", "velocity_mode: bool", "forward: bool",
        "stopping: bool", "done: bool", "wrapped: bool", "control", "raw: list[i64]",
        "relative: list[bool]", "accel_loaded: bool", "started", "_sent_raw: list[i64]",
        "_sent_relative: list[bool]", "_newer: list[bool]", "_low_words: list[i64, ...]",
        "_before",
    )  # fmt: skip

    def __init__(self) -> None:
        self.position: i64 = 0
        self.velocity: i64 = 0
        self.target: i64 = 0
        self.top: i64 = 0
        self.accel: i64 = 0
        self.velocity_mode: bool = False
        self.forward: bool = False
        self.stopping: bool = False
        self.done: bool = False
        self.wrapped: bool = False
        self.control: i64 = 0
        self.raw: list[int] = [0, 0, 0]
        self.relative: list[bool] = [False, False, False]
        self.accel_loaded: bool = False
        self._low_words: list[int] = []
        """The last velocities, as long as every high word was 0."""
        self._before: int = -1
        """What a word that is loaded overwrites and no STT has taken, else -1."""
        self.start()

    # -- LTRJ ---------------------------------------------------------------------------------

    def load_word(self, number: int, low: bool, word: int, relative: bool) -> None:
        """Store half of a parameter in its buffer (LM-TRJ-1, LM-BUS-11).

        Args:
            number: :data:`ACCELERATION`, :data:`VELOCITY` or :data:`POSITION`.
            low: the less significant word.
            word: 16 bits.
            relative: the control word says the data is relative.
        """
        old = self.raw[number]
        if not low:
            self._before = old if self._newer[number] else -1
        self.raw[number] = (old & 0xFFFF0000 | word) if low else (word << 16 | old & 0xFFFF)
        self.relative[number] = relative
        self._newer[number] = True
        if number == ACCELERATION:
            self.accel_loaded = True  # LM-STA-8

    def in_range(self, number: int) -> bool:
        """Whether the buffered parameter lies within the manual's range."""
        if number == POSITION:
            value = sign_extend(self.raw[number], 32)
            return self.relative[number] or ds.POSITION_MIN <= value <= ds.POSITION_MAX
        # LM-TRJ-2, LM-AMB-14: velocity and acceleration have 30 bits, the fraction with them.
        return self.relative[number] or self.raw[number] <= ds.RATE_MAX

    def loaded(self) -> bool:
        """Whether LTRJ has loaded anything since the reset."""
        return bool(self.control or any(self._newer) or any(self.raw) or any(self._sent_raw))

    def newer(self, number: int) -> bool:
        """Whether LTRJ has loaded this parameter since the last STT."""
        return self._newer[number]

    def overwritten(self, number: int) -> bool:
        """Whether the datum just loaded has taken the place of another one before any STT."""
        return self._before not in (-1, self.raw[number])

    def waits(self) -> bool:
        """Whether LTRJ has loaded what no STT has taken: data, or another mode or stop alone."""
        return any(self._newer) or self.control != self.started & ~ds.STOPS

    def hasty(self) -> bool:
        """Whether an acceleration was loaded that is above the velocity (LM-TRJ-15)."""
        acceleration, velocity = (self.raw[n] & ds.RATE_MAX for n in (ACCELERATION, VELOCITY))
        absolute = not self.relative[ACCELERATION] and not self.relative[VELOCITY]
        return absolute and self._newer[ACCELERATION] and acceleration > velocity > 0

    def wraps(self) -> bool:
        """Tell whether the velocity just loaded goes on where 16 bits have ended (LM-TRJ-2).

        That is a third one that follows the two before it, by addition or by doubling, modulo
        65536, while each high word has been 0.
        """
        value, low = self.raw[VELOCITY], self._low_words
        # A host that writes a high word has 32 bits: nothing is suspected any more.
        if value >> 16 or self.relative[VELOCITY]:
            self._low_words = [-1]
            return False
        if low == [-1] or low[-1:] == [value]:
            return False
        first, second = low[-2:] if len(low) > 1 else (0, 0)
        self._low_words = [second, value] if len(low) > 1 else [*low, value]
        goes_on = (2 * second - first & 0xFFFF, 2 * second & 0xFFFF)
        return 0 < first < second > value and value in goes_on

    def stuck(self, here: i64) -> int:
        """Return which rate of 0 keeps an axis where it is that rests at ``here`` (counts).

        Returns:
            :data:`ACCELERATION`, :data:`VELOCITY`, or -1 if what STT has taken moves the axis, or
            need not.
        """
        if self.velocity:
            return -1
        velocity = self._sent_raw[VELOCITY] or int(self._sent_relative[VELOCITY])
        if self.started & ds.VELOCITY_MODE:
            moves = velocity != 0
        else:
            way = sign_extend(self._sent_raw[POSITION], 32)
            moves = way != (0 if self._sent_relative[POSITION] else here)
        if not moves:
            return -1
        if not self._sent_raw[ACCELERATION] and not self._sent_relative[ACCELERATION]:
            return ACCELERATION
        return -1 if velocity else VELOCITY

    def speed(self) -> str:
        """Return the desired velocity in words."""
        return f"{self.velocity / 65536:.3g} counts per sample"

    def start(self) -> None:
        """STT: the buffers as they are go with it; later data is for the next STT (NOTES 18)."""
        self.started: i64 = self.control
        # LM-TRJ-5: a stop bit acts once; the buffered data stays for the STT that resumes.
        self.control &= ~ds.STOPS
        self._sent_raw: list[int] = self.raw[:]
        self._sent_relative: list[bool] = self.relative[:]
        # Which buffers were written after it.
        self._newer: list[bool] = [False, False, False]

    def take_buffers(self) -> None:
        """Copy what STT took to the working set; relative data becomes absolute (LM-TRJ-3, -6).

        An STT that stops begins no move: the position stays in its buffer (LM-TRJ-5).
        """
        self.accel = self._rate(ACCELERATION, self.accel)
        self.top = self._rate(VELOCITY, self.top)
        self.velocity_mode = bool(self.started & ds.VELOCITY_MODE)
        self.forward = bool(self.started & ds.FORWARD)
        # LM-TRJ-5, LM-AMB-18: after a stop a bare STT goes on to what is buffered.
        if not self.started & ds.STOPS:
            value = sign_extend(self._sent_raw[POSITION], 32)
            # LM-TRJ-3, LM-AMB-5: relative positions count from the active target.
            if self._sent_relative[POSITION]:
                value += self.target
            self.target = wrap(value, ds.POSITION_BITS)
            self._resolve(POSITION, self.target & 0xFFFFFFFF)
        # LM-TRJ-13, LM-AMB-5: a relative position needs a base in velocity mode, too.
        if self.velocity_mode:
            self.target = self.position >> 16
        self.accel_loaded = self._newer[ACCELERATION]  # LM-STA-8

    def _rate(self, number: int, active: int) -> int:
        if self._sent_relative[number]:
            # LM-TRJ-3, LM-AMB-15: a relative rate is signed; what comes of it is cut to the range.
            value = clamp(active + sign_extend(self._sent_raw[number], 32), 0, ds.RATE_MAX)
        else:
            # LM-TRJ-2: an absolute rate keeps its lower 30 bits.
            value = self._sent_raw[number] & ds.RATE_MAX
        self._resolve(number, value)
        return value

    def _resolve(self, number: int, value: int) -> None:
        """The buffer holds the absolute result, unless it has been written since STT."""
        # LM-TRJ-3: a bare STT repeated does not add once more.
        if not self._newer[number]:
            self.raw[number] = value
            self.relative[number] = False

    @property
    def desired_position(self) -> int:
        """What RDDP reads: whole counts (LM-CMD-9)."""
        return self.position >> 16

    # -- motion -------------------------------------------------------------------------------

    def hold(self, counts: int) -> None:
        """Desired position := ``counts``, at rest."""
        self.position = counts << 16
        self.velocity = 0
        self.stopping = False

    def step(self) -> bool:
        """Run one sample; tell whether it completed the motion (LM-TRJ-12, -13)."""
        if self.done:
            return False
        # LM-TRJ-9: by A in every sample, and with A = 0 at once.
        if self.stopping:
            if self.accel:
                self.velocity = toward(self.velocity, 0, self.accel)
            else:
                self.velocity = 0
            self.target = self._move()
            if self.velocity:
                return False
            # LM-TRJ-9: the axis comes to rest on a whole count.
            self.position = self.target << 16
            self.stopping = False
            self.done = True  # LM-STA-5
            return True
        if self.velocity_mode:
            # LM-TRJ-13: toward +V with bit 12, else toward -V, by at most A in a sample.
            goal = self.top if self.forward else -self.top
            self.velocity = toward(self.velocity, goal, self.accel)
            self.target = self._move()  # LM-AMB-5
            return False
        target = self.target << 16
        way = target - self.position
        # LM-TRJ-12: with A = 0 the velocity stays as it is.
        if self.accel:
            # On the target, but too fast to stay: it lies behind.
            if way > 0 or (way == 0 and self.velocity < 0):
                self.velocity = approach(way, self.velocity, self.top, self.accel)
            else:
                self.velocity = -approach(-way, -self.velocity, self.top, self.accel)
        self._move()
        # LM-TRJ-12: exactly on the target, and slow enough.
        if arrived(target - self.position, self.velocity, self.accel):
            self.velocity = 0
            self.done = True  # LM-STA-5, LM-TRJ-16: also of a move of no length
            return True
        return False

    def _move(self) -> i64:
        """Go on by a sample's velocity; return the whole counts (LM-TRJ-11, LM-POS-2)."""
        position = self.position + self.velocity
        counts = position >> 16
        if counts < ds.POSITION_MIN or counts > ds.POSITION_MAX:
            position = wrap_word(position, _HALF)
            counts = position >> 16
            self.wrapped = True
        # LM-TRJ-14: whether the motor follows or not.
        self.position = position
        return counts

    def shift(self, counts: int) -> None:
        """Count positions from a home that lies ``counts`` further on (LM-POS-4)."""
        self.position = wrap(self.position - (counts << 16), _WRAPPED)
        self.target = wrap(self.target - counts, ds.POSITION_BITS)
