"""What a DC motor makes of a span of time, exactly: the solution of its linear equations.

While the shaft turns one way, current i, speed w and place p follow

    L di/dt = V - R i - Ke w        J dw/dt = Kt i - b w + Q        dp/dt = c w

with the volts V and the torque Q of load and dry friction held. So a span changes each of them by a
sum of products, whose factors are those of the matrix exponential less the unit matrix. They are
worked out for a very short span by Taylor's series, and doubled from there: what is kept being the
*change*, nothing is lost beside a 1, and the halves of a period come with the period.
"""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.core.state import Names

LEVELS: Final = 34
"""Halvings of a period: an instant is found to 2^-34 of it, where floats end too."""
TICKS: Final = 1 << 34
"""Parts of a period after so many halvings."""
_SHORT: Final = 1 / 65536.0
"""Square of the span, in time constants, from which Taylor's series is taken."""
_TERMS: Final = 9
"""Its terms: those left out are below 1e-22."""
_MOST_HALVINGS: Final = 1000
_COARSEST: Final = 12
"""Halvings of a period, at most, for a motor that swings in it. One that swings more than 2,000
times in a period, which none does that is built, has its events at the ends of such spans: a span
for each half of a swing would be 2^34 of them, and a board file could hold a server for ever."""
_SHORT_LIVED: Final = 1e-12
"""Periods below which a current's time constant is none."""


class Span:
    """The changes of current, speed and place in a span of time, for what they are made of.

    ``current_of_speed`` is the change of current for each rad/s at the beginning, and so on.
    """

    DERIVED: ClassVar[Names] = ("*",)

    def __init__(self) -> None:
        self.current_of_current: float = 0.0
        self.current_of_speed: float = 0.0
        self.current_of_volts: float = 0.0
        self.current_of_torque: float = 0.0
        self.speed_of_current: float = 0.0
        self.speed_of_speed: float = 0.0
        self.speed_of_volts: float = 0.0
        self.speed_of_torque: float = 0.0
        self.place_of_current: float = 0.0
        self.place_of_speed: float = 0.0
        self.place_of_volts: float = 0.0
        self.place_of_torque: float = 0.0
        self.blocked: float = 0.0
        """Change of a current for each ampere it is away from V / R, while the shaft stands."""
        self.seconds: float = 0.0
        """How long it is."""

    def twice(self) -> "Span":
        """Return what two of it make, one after the other."""
        two = Span()
        ii, iw = self.current_of_current, self.current_of_speed
        wi, ww = self.speed_of_current, self.speed_of_speed
        pi, pw = self.place_of_current, self.place_of_speed
        iv, iq = self.current_of_volts, self.current_of_torque
        wv, wq = self.speed_of_volts, self.speed_of_torque
        two.current_of_current = 2.0 * ii + (ii * ii + iw * wi)
        two.current_of_speed = 2.0 * iw + (ii * iw + iw * ww)
        two.current_of_volts = 2.0 * iv + (ii * iv + iw * wv)
        two.current_of_torque = 2.0 * iq + (ii * iq + iw * wq)
        two.speed_of_current = 2.0 * wi + (wi * ii + ww * wi)
        two.speed_of_speed = 2.0 * ww + (wi * iw + ww * ww)
        two.speed_of_volts = 2.0 * wv + (wi * iv + ww * wv)
        two.speed_of_torque = 2.0 * wq + (wi * iq + ww * wq)
        two.place_of_current = 2.0 * pi + (pi * ii + pw * wi)
        two.place_of_speed = 2.0 * pw + (pi * iw + pw * ww)
        two.place_of_volts = 2.0 * self.place_of_volts + (pi * iv + pw * wv)
        two.place_of_torque = 2.0 * self.place_of_torque + (pi * iq + pw * wq)
        two.blocked = 2.0 * self.blocked + self.blocked * self.blocked
        two.seconds = 2.0 * self.seconds
        return two


class Motor:
    """The numbers a response follows from.

    Attributes:
        resistance: R, of armature and amplifier (ohm).
        inductance: L, of the armature (H).
        torque_constant: Kt (N*m/A).
        back_emf: Ke (V*s).
        inertia: J (kg*m^2).
        viscous: b (N*m*s).
        counts: c, counts of place for each radian.
    """

    DERIVED: ClassVar[Names] = ("*",)

    def __init__(
        self, resistance: float, inductance: float, torque_constant: float, back_emf: float,
        inertia: float, viscous: float, counts: float,
    ) -> None:  # fmt: skip
        self.resistance: float = resistance
        self.inductance: float = inductance
        self.torque_constant: float = torque_constant
        self.back_emf: float = back_emf
        self.inertia: float = inertia
        self.viscous: float = viscous
        self.counts: float = counts

    def response(self, period: float) -> "Response":
        """Return what the motor makes of a period and its halves."""
        found = Response()
        found.instant = self.inductance <= _SHORT_LIVED * self.resistance * period
        damping, swing = self._rates(found.instant)
        span = period
        halvings: i64 = 0
        while halvings < LEVELS or (
            (damping * damping + swing) * span * span > _SHORT and halvings < _MOST_HALVINGS
        ):
            span *= 0.5
            halvings += 1
        step = self._first_order(span) if found.instant else self._second_order(span)
        spans = [step]
        while halvings > 0:
            halvings -= 1
            step = step.twice()
            if halvings <= LEVELS:
                spans.append(step)
        spans = spans[-1 - LEVELS :]
        spans.reverse()
        found.spans = spans
        found.whole = spans[0]
        # A current and a speed that swing: within half a swing each turns back once at most.
        apart = 0.0
        if not found.instant:
            apart = self.resistance / self.inductance - self.viscous / self.inertia
        squared = swing - 0.25 * apart * apart
        span = period
        while squared * span * span > 9.0 and found.coarsest < _COARSEST:
            span *= 0.5
            found.coarsest += 1
        return found

    def _rates(self, instant: bool) -> tuple[float, float]:
        """Return a sum of decays (1/s), and the square of the rate of a swing."""
        coupling = self.torque_constant * self.back_emf / self.inertia
        if instant:
            return coupling / self.resistance + self.viscous / self.inertia, 0.0
        electrical = self.resistance / self.inductance
        return electrical + self.viscous / self.inertia, coupling / self.inductance

    def _first_order(self, h: float) -> Span:
        """Return a short span of a motor without inductance."""
        resistance = self.resistance
        rate = -self._rates(True)[0] * h
        # Integrals of the exponential: once, and twice.
        once = twice = 1.0
        term: i64 = _TERMS
        while term > 1:
            once = 1.0 + once * rate / float(term)
            twice = 1.0 + twice * rate / float(term + 1)
            term -= 1
        once *= h
        twice *= 0.5 * h * h
        of_volts = self.torque_constant / (resistance * self.inertia)
        span = Span()
        span.seconds = h
        span.speed_of_speed = rate / h * once
        span.speed_of_volts = once * of_volts
        span.speed_of_torque = once / self.inertia
        span.place_of_speed = self.counts * once
        span.place_of_volts = self.counts * twice * of_volts
        span.place_of_torque = self.counts * twice / self.inertia
        # The current is what volts and speed make it, whatever it was.
        taken = self.back_emf / resistance
        span.current_of_current = -1.0
        span.current_of_speed = -taken * (1.0 + span.speed_of_speed)
        span.current_of_volts = 1.0 / resistance - taken * span.speed_of_volts
        span.current_of_torque = -taken * span.speed_of_torque
        span.blocked = -1.0
        return span

    def _second_order(self, h: float) -> Span:
        """Return a short span of a motor with inductance."""
        a = -self.resistance / self.inductance * h
        b = -self.back_emf / self.inductance * h
        c = self.torque_constant / self.inertia * h
        d = -self.viscous / self.inertia * h
        # I + M/2 (I + M/3 (...)) for M = A h, and the same from M/3 on: integrals of the
        # exponential, once and twice.
        pp, pq, qp, qq = 1.0, 0.0, 0.0, 1.0
        rr, rs, sr, ss = 1.0, 0.0, 0.0, 1.0
        blocked = 1.0
        term: i64 = _TERMS
        while term > 1:
            part = 1.0 / float(term)
            pp, pq, qp, qq = (
                1.0 + part * (a * pp + b * qp), part * (a * pq + b * qq),
                part * (c * pp + d * qp), 1.0 + part * (c * pq + d * qq),
            )  # fmt: skip
            blocked = 1.0 + part * a * blocked
            part = 1.0 / float(term + 1)
            rr, rs, sr, ss = (
                1.0 + part * (a * rr + b * sr), part * (a * rs + b * ss),
                part * (c * rr + d * sr), 1.0 + part * (c * rs + d * ss),
            )  # fmt: skip
            term -= 1
        span = Span()
        span.seconds = h
        span.current_of_current = a * pp + b * qp
        span.current_of_speed = a * pq + b * qq
        span.speed_of_current = c * pp + d * qp
        span.speed_of_speed = c * pq + d * qq
        span.current_of_volts = h * pp / self.inductance
        span.current_of_torque = h * pq / self.inertia
        span.speed_of_volts = h * qp / self.inductance
        span.speed_of_torque = h * qq / self.inertia
        span.place_of_current = self.counts * h * qp
        span.place_of_speed = self.counts * h * qq
        twice = 0.5 * self.counts * h * h
        span.place_of_volts = twice * sr / self.inductance
        span.place_of_torque = twice * ss / self.inertia
        span.blocked = a * blocked
        return span


class Response:
    """What a motor makes of a period: as a whole, and of each of its halves."""

    DERIVED: ClassVar[Names] = ("*",)

    def __init__(self) -> None:
        self.whole: Span = Span()
        self.spans: list[Span] = []
        """The period, its half, and so on."""
        self.coarsest: i64 = 0
        """The first of the spans in which speed has one extremum at most."""
        self.instant: bool = False
        """The current follows volts and speed at once."""


NONE: Final = Response()
"""Of a motor whose numbers are not known yet."""

_KNOWN: Final[dict[tuple[float, ...], Response]] = {}
_MOST_KNOWN: Final = 256
"""Responses remembered at once; a board has few motors that differ. Not measured."""


def response_of(motor: Motor, period: float) -> Response:
    """Return the response of a motor; motors of a kind share it."""
    key = (
        motor.resistance, motor.inductance, motor.torque_constant, motor.back_emf, motor.inertia,
        motor.viscous, motor.counts, period,
    )  # fmt: skip
    found = _KNOWN.get(key)
    if found is None:
        if len(_KNOWN) >= _MOST_KNOWN:
            _KNOWN.clear()
        found = _KNOWN[key] = motor.response(period)
    return found
