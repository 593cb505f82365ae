"""The way of a motor's shaft through a period: turning, standing, and what it meets between.

While the shaft turns one way, or stands, its :class:`~vbus.plant.response.Response` gives the end
of a span from its beginning. A span in which something happens is halved until it is a tick, 2^-34
of the period, at whose end it has happened:

* The speed passes zero. Its sign at the end of a span does not tell: it may come down to zero and
  rise again between. Within the spans used it has one extremum at most, so where it falls at the
  beginning and rises at the end, and could reach zero, the span is halved too; an extremum found in
  a tick is no crossing.
* A standing shaft breaks away. Its current goes one way, so the end of a span does tell.
* An end stop is met, or a border that the caller has set. The shaft goes one way, so the end tells.

Whether it turns is stored apart from its speed: a shaft that breaks away has none yet.
"""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.core.state import Names
from vbus.plant.response import LEVELS, NONE, TICKS, Motor, Response

MOST_EVENTS: Final = 64
"""Events in a period; a shaft that stops and starts more often is held for what is left of it."""
NOWHERE: Final = 1e300
"""Place of an end stop or a border that is not there; a torque that nothing reaches."""


class Travel:
    """A motor between stops, from the beginning of a period to an instant that the caller asks for.

    Set :attr:`current`, :attr:`speed`, :attr:`place` and :attr:`volts`, then :meth:`go`.
    """

    DERIVED: ClassVar[Names] = ("*",)

    def __init__(self, motor: Motor) -> None:
        self.motor: Final[Motor] = motor
        self.response: Response = NONE
        self.load: float = 0.0
        self.coulomb: float = 0.0
        self.static: float = 0.0
        self.volts: float = 0.0
        self.current: float = 0.0
        self.speed: float = 0.0
        self.place: float = 0.0
        self.low: float = -NOWHERE
        """Where the lower end stop is, beside :attr:`place`."""
        self.high: float = NOWHERE
        """Where the upper one is."""
        self.tick: i64 = 0
        """How far it has gone."""
        # The speed at which it settles, and the square of that which an ampere can turn into.
        per_ohm = motor.torque_constant / motor.resistance
        damping = motor.viscous + motor.torque_constant * motor.back_emf / motor.resistance
        self._speed_of_torque: float = 1.0 / damping if damping > 0.0 else 0.0
        self._speed_of_volts: float = per_ohm * self._speed_of_torque
        self._swing: float = 0.0
        if motor.back_emf > 0.0:
            self._swing = (
                motor.inductance * motor.torque_constant / (motor.inertia * motor.back_emf)
            )
        else:
            self._speed_of_volts = self._speed_of_torque = 0.0

    def clear(
        self, way: float, current: float, speed: float, torque: float, seconds: float
    ) -> bool:
        """Whether a speed that falls, and rises again within a span, stays above zero.

        Args:
            way: 1.0 or -1.0, the direction it turns in.
            current: at the beginning.
            speed: at the beginning.
            torque: of load and dry friction.
            seconds: how long the span is.
        """
        if self.response.instant:
            # Speed has no extremum: what seemed one is rounding.
            return True
        motor = self.motor
        # It settles at a speed, and swings about that no further than it was from it, in energy.
        goal = self._speed_of_volts * self.volts + self._speed_of_torque * torque
        if way * goal > 0.0:
            off = speed - goal
            astray = current - (self.volts - motor.back_emf * goal) / motor.resistance
            if goal * goal > off * off + self._swing * astray * astray:
                return True
        # It falls less and less, if it does so at the beginning.
        pull = motor.torque_constant * current - motor.viscous * speed + torque
        if way * (motor.inertia * speed + pull * seconds) <= 0.0:
            return False
        driving = self.volts - motor.resistance * current - motor.back_emf * speed
        drag = motor.viscous * motor.inductance * pull / motor.inertia
        eases = motor.torque_constant * driving - drag
        return way * eases >= 0.0

    def go(self, until: i64, border: float, way: float) -> bool:
        """Go on from the beginning of the period to tick ``until``.

        Args:
            until: from 0 to TICKS.
            border: a place to end at; one that lies back is reached when the shaft is below it.
            way: 1.0 or -1.0, the direction in which the border lies; 0.0: there is none.

        Returns:
            Whether it was reached.
        """
        response = self.response
        spans = response.spans
        coarsest = response.coarsest
        constant, viscous, load = self.motor.torque_constant, self.motor.viscous, self.load
        volts, low, high = self.volts, self.low, self.high
        settled = volts / self.motor.resistance
        current, speed, place = self.current, self.speed, self.place
        if response.instant:
            current = (volts - self.motor.back_emf * speed) / self.motor.resistance
        if place <= low:
            place = low
            if speed < 0.0:
                speed = 0.0
        elif place >= high:
            place = high
            if speed > 0.0:
                speed = 0.0
        turning = 0.0
        if speed > 0.0:
            turning = 1.0
        elif speed < 0.0:
            turning = -1.0
        standing = turning == 0.0
        decided = not standing
        held = False
        reached = False
        sure = False
        # The end of a span that has shown an event; which, if the shaft turned.
        due: i64 = -1
        stopped = hit = met = False
        most = least = 0.0
        events: i64 = 0
        tick: i64 = 0
        size: i64 = TICKS
        level: i64 = 0
        while level < coarsest:
            size = size >> 1
            level += 1
        while tick < until:
            if not decided:
                # What the shaft stands against, and whether that holds it.
                decided = True
                most = NOWHERE if place >= high or held else self.static
                least = -NOWHERE if place <= low or held else -self.static
                torque = constant * current - load
                standing = least <= torque <= most
                turning = 1.0 if torque > 0.0 else -1.0
            while size > until - tick:
                size = size >> 1
                level += 1
            span = spans[level]
            if standing:
                after = current + (current - settled) * span.blocked
                torque = constant * after - load
                # What a tick adds may be lost by rounding, and with it an event that the whole span
                # has shown: then it is at the last tick, or ticks without end would be tried.
                if not least <= torque <= most or tick + size == due:
                    if level < LEVELS:
                        sure = True
                        due = tick + size
                        size = size >> 1
                        level += 1
                        continue
                    sure = False
                    due = -1
                    decided = False
                    events += 1
                current = after
            else:
                torque = -load - turning * self.coulomb
                after = current + (
                    span.current_of_current * current + span.current_of_speed * speed
                    + (span.current_of_volts * volts + span.current_of_torque * torque)
                )  # fmt: skip
                faster = speed + (
                    span.speed_of_current * current + span.speed_of_speed * speed
                    + (span.speed_of_volts * volts + span.speed_of_torque * torque)
                )  # fmt: skip
                there = place + (
                    span.place_of_current * current + span.place_of_speed * speed
                    + (span.place_of_volts * volts + span.place_of_torque * torque)
                )  # fmt: skip
                stops = turning * faster <= 0.0
                hits = there >= high if turning > 0.0 else there <= low
                if way == turning:
                    reached = there >= border if way > 0.0 else there < border
                if tick + size == due and not (stops or hits or reached):
                    stops, hits, reached = stopped, hit, met
                if stops or hits or reached:
                    if level < LEVELS:
                        stopped, hit, met = stops, hits, reached
                        due = tick + size
                        reached = False
                        sure = True
                        size = size >> 1
                        level += 1
                        continue
                    sure = False
                    due = -1
                    if hits:
                        there = high if turning > 0.0 else low
                    if hits or stops:
                        faster = 0.0
                        decided = False
                    events += 1
                elif (
                    level < LEVELS
                    and turning * (constant * current - viscous * speed + torque) < 0.0
                    and turning * (constant * after - viscous * faster + torque) > 0.0
                    and not self.clear(turning, current, speed, torque, span.seconds)
                ):
                    sure = False
                    size = size >> 1
                    level += 1
                    continue
                current, speed, place = after, faster, there
            tick += size
            if reached:
                break
            held = events >= MOST_EVENTS
            if sure:
                # It was not in this half, so it is in the other one.
                if level < LEVELS:
                    size = size >> 1
                    level += 1
                    continue
                sure = False
            while level > coarsest and tick & size == 0:
                size = size << 1
                level -= 1
        self.current = current
        self.speed = speed
        self.place = place
        self.tick = tick
        return reached
