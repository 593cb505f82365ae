"""The filter: kp, limited ki and sampled kd terms at the chip's word widths (Eq. 1)."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.lm628.datasheet import COEFFICIENT_MAX
from vbus.core.bits import wrap_word
from vbus.core.state import Names

# LM-PID-4, LM-AMB-19: the integral has 24 bits, and saturates at the same size on both sides.
_SUM_MAX: Final = 0x7FFFFF
_HALF: Final = 0x8000


def _sat16(value: i64) -> i64:
    if value > 32767:
        return 32767
    if value < -32768:
        return -32768
    return value


class Pid:
    """Filter coefficients, doubly buffered, and the state of the filter.

    Args:
        wraps: products and their sum keep their low 16 bits instead of saturating (LM-PID-6).
        limits_sum: il limits the scaled summation instead of the integral term (LM-PID-5).

    Attributes:
        kp: proportional coefficient in use, 0..7FFFh.
        ki: integral coefficient in use.
        kd: derivative coefficient in use.
        il: integration limit in use.
        ds: derivative sampling code in use; the interval is ``ds + 1`` samples.
        loaded: what LFIL has written: ds, kp, ki, kd, il.
        sent: what a UDF that waits for its sample has taken of it.
        sum: the 24-bit integral of the error.
        limited: il has limited the summation in the last sample.
        term: what RDSUM reads: the scaled summation, or the integral term, as limited; a summation
            in the sample in which it passes its limit is read before it is limited.
        derivative: derivative term, held from one derivative sample to the next.
        last_error: error at the last derivative sample.
        phase: samples since the last derivative sample began, 0..ds.
    """

    STATE: ClassVar[Names] = (
        "kp", "ki", "kd", "il", "ds", "loaded: list[i64]", "sent: list[i64]", "sum", "term",
        "derivative", "last_error", "phase", "limited: bool",
    )  # fmt: skip

    def __init__(self, wraps: bool, limits_sum: bool) -> None:
        self._wraps: bool = wraps
        self._limits_sum: bool = limits_sum
        self.kp: i64 = 0
        self.ki: i64 = 0
        self.kd: i64 = 0
        self.il: i64 = 0
        self.ds: i64 = 0
        self.loaded: list[int] = [0, 0, 0, 0, 0]
        self.sent: list[int] = [0, 0, 0, 0, 0]
        self.sum: i64 = 0
        self.term: i64 = 0
        self.derivative: i64 = 0
        self.last_error: i64 = 0
        self.phase: i64 = 0
        self.limited: bool = False

    def store(self, number: int, word: int) -> None:
        """Store one datum of LFIL: 0 is ds, then kp, ki, kd, il (LM-PID-1)."""
        self.loaded[number] = word & COEFFICIENT_MAX

    def send(self) -> None:
        """UDF: what is loaded goes with it; later data is for the next UDF (NOTES 18)."""
        self.sent = self.loaded[:]

    def update(self) -> None:
        """Use what UDF has taken; the coming sample is a derivative sample (LM-PID-3)."""
        self.ds, self.kp, self.ki, self.kd, self.il = self.sent
        # LM-PID-3: the sample that takes UDF begins an interval.
        self.phase = 0

    def waits(self) -> bool:
        """Whether LFIL has loaded a coefficient that UDF has not taken (LM-CMD-5)."""
        return self.loaded[1:] != self.sent[1:]

    def lacking(self) -> str:
        """Return why all terms are 0: until UDF, LFIL changes nothing (LM-CMD-5). "" if none is."""
        if self.kp or self.kd or (self.ki and self.il):
            return ""
        if self.ki and self.loaded == self.sent:
            return "its integral term, the only one, is 0: il is 0"
        if self.loaded[1] or self.loaded[2] or self.loaded[3]:
            return "its filter has not taken effect: UDF has not followed LFIL"
        return "it has no filter: all coefficients are 0 until LFIL and UDF"

    def unlimited(self) -> str:
        """Return which of ki and il UDF has taken as 0, where the other one is not; "" if none."""
        ki, il = self.sent[2], self.sent[4]
        if bool(ki) == bool(il):
            return ""
        return "ki above 0 and il 0" if ki else "il above 0 and ki 0"

    def clear(self) -> None:
        """Forget integral and derivative history (LM-TRJ-7, LM-TRJ-10)."""
        self.sum = 0
        self.term = 0
        self.derivative = 0
        self.last_error = 0
        self.limited = False

    def step(self, error: i64) -> i64:
        """Run one sample; return the 16-bit motor command.

        Args:
            error: desired minus real position, saturated to 16 bits.
        """
        wraps, limits_sum = self._wraps, self._limits_sum
        phase = self.phase
        # LM-PID-3: the term is computed where an interval begins, and added in every sample.
        if phase == 0:
            change = self.kd * (error - self.last_error)
            self.derivative = wrap_word(change, _HALF) if wraps else _sat16(change)
            self.last_error = error
        phase += 1
        # LM-PID-3: an interval has one sample more than its code says.
        if phase > self.ds:
            phase = 0
        self.phase = phase

        # LM-PID-4, LM-PID-5: a sum that has reached its limit may only come back.
        before = self.sum
        total = before + error
        if total > _SUM_MAX:
            total = _SUM_MAX
        elif total < -_SUM_MAX:
            total = -_SUM_MAX
        # LM-PID-4: the upper 16 of 24 bits, rounded down; multiplied before or after il limits.
        term = total >> 8
        if not limits_sum:
            term = self.ki * term
            term = wrap_word(term, _HALF) if wraps else _sat16(term)
        limit = self.il
        if term > limit or term < -limit:
            if term < 0:
                limit = -limit
            # A summation is added first, and limited afterwards.
            # LM-PID-5, LM-AMB-9: RDSUM reads what il limits.
            self.term = term if limits_sum and not self.limited else limit
            self.limited = limits_sum
            term = limit
            # Nearer to zero.
            if -before <= total <= before or before <= total <= -before:
                self.sum = total
        else:
            self.sum = total
            self.term = term
            self.limited = False
        if limits_sum:
            term = self.ki * term
            term = wrap_word(term, _HALF) if wraps else _sat16(term)

        product = self.kp * error
        # LM-PID-6: the manual's sentence to the letter keeps the lower 16 bits.
        if wraps:
            # LM-PID-6, LM-PID-7: of each product, and of their sum.
            return wrap_word(wrap_word(product, _HALF) + term + self.derivative, _HALF)
        # LM-PID-7, LM-AMB-1, LM-AMB-19: what leaves 16 bits saturates: two real parts show that no
        # product turns its sign.
        return _sat16(_sat16(product) + term + self.derivative)

    def steady(self, error: i64) -> bool:
        """Whether derivative samples at this same error change nothing any more."""
        return self.last_error == error and self.derivative == 0

    def skip(self, samples: int) -> None:
        """Let samples pass that change nothing but the place in the derivative interval."""
        self.phase = (self.phase + samples) % (self.ds + 1)
