"""A stepper motor: step pulses or phase currents to torque, and steps lost under overload."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.core.options import Option, Settings
from vbus.core.state import Names
from vbus.plant.angle import sine
from vbus.plant.encoder import bounded
from vbus.plant.response import TICKS
from vbus.plant.shaft import SHAFT_OPTIONS, TWO_PI, Mechanics, Shaft, mass_options
from vbus.plant.travel import MOST_EVENTS, NOWHERE

STEP_OPTIONS: Final = (
    Option("full_steps", "count", 200, "full steps a revolution, four for each electrical cycle"
           " of the phase currents", low=4, high=1 << 16),
    Option("steps_per_rev", "count", 200, "step pulses a revolution; more than the full steps if"
           " the driver makes microsteps", low=1, high=1 << 24),
)  # fmt: skip

MOST_PIECES: Final = 4096
"""Steps a period is cut into at most; pulses that come faster move the field in leaps."""
SIXTH: Final = 1.0 / 6.0
_ROOT_THREE: Final = 1.7320508075688772


def field(a: float, b: float, c: float, three: bool) -> tuple[float, float, bool]:
    """Return the sine and cosine part of the field that phase currents make.

    With two phases A is the sine and B the cosine; with three, B leads A by 120 degrees and C
    lags it. A third current tells them apart; where A, B and C add up to 0 without it, ``three``,
    the last answer, still holds.

    Returns:
        ``(sine part, cosine part, three phases)``
    """
    if c != 0.0:
        three = True
    elif a + b != 0.0:
        three = False
    if three:
        return a, (b - c) / _ROOT_THREE, True
    return a, b, False


class StepperMotor(Shaft):
    """Field and rotor of a stepper motor; the defaults are a motor of frame size 17.

    The field pulls the rotor with the holding torque times the sine of the electrical angle
    between them. Asked for more than that, the rotor falls behind by a whole electrical cycle (four
    full steps) or stalls, and the encoder shows it.

    It is integrated by Runge and Kutta's method of fourth order, eight steps
    or more to a radian of its swing, and stops and changes of direction are found by halving: in a
    swing of a step and back its place is exact to some 1e-4 of a step. A rotor that would take more
    than 4096 steps a period, being all friction, is followed in 4096 implicit ones.

    Step pulses go to a driver with constant current; pulse j of n comes at j/n of the period.
    Phase currents make a field as strong as they are, so that full scale gives the holding torque.
    """

    TAKES: ClassVar[tuple[str, ...]] = ("pulses", "phases")
    OPTIONS: ClassVar[tuple[Option, ...]] = (
        *SHAFT_OPTIONS,
        *STEP_OPTIONS,
        Option("holding_torque", "N*m", 0.4, "torque against which the motor holds at full"
               " current", low=0.0),
        Option("detent_torque", "N*m", 0.01, "torque against which it holds without current",
               low=0.0),
        *mass_options(inertia=1e-5, viscous=0.003, coulomb=0.005, static=0.007),
    )  # fmt: skip

    STATE: ClassVar[Names] = ("_steps", "_three: bool", *Shaft.STATE)
    WIRING: ClassVar[Names] = ("_holding",)
    DERIVED: ClassVar[Names] = (
        "_gain", "_turn_counts", "_finest", "_divided", "_ran", "_across", "_along", "_pulsed",
        "_issued", "_issued_from", "_due", "_explicit", "_whole", "_whole_of",
    )  # fmt: skip

    def __init__(self, settings: Settings | None = None) -> None:
        super().__init__(settings)
        full_steps = int(self.settings["full_steps"])
        if full_steps % 4:
            raise ValueError(
                f"full_steps = {full_steps}: four full steps make an electrical cycle,"
                " so it must be a multiple of 4"
            )
        self._cycles: i64 = full_steps // 4
        self._steps_per_rev: i64 = int(self.settings["steps_per_rev"])
        self._holding: float = float(self.settings["holding_torque"])
        self._detent: float = float(self.settings["detent_torque"])
        # The pulses so far, within one revolution of the field.
        self._steps: i64 = 0
        self._three: bool = False
        # Of a step: speed gained by 1 N*m, counts turned by 1 rad/s.
        self._gain: float = 0.0
        self._turn_counts: float = 0.0
        # Steps in a period that the rotor's natural frequency asks for; those prepared for.
        self._finest: i64 = 1
        self._divided: i64 = 0
        self._turns: float = float(self._cycles)
        self._whole_turn: i64 = self.encoder.counts
        # What made the last period's course: its pieces, the field, and the pulses, if it was
        # they: how many, after how many, and the last that was due.
        self._ran: i64 = 1
        self._across: float = 0.0
        self._along: float = 0.0
        self._pulsed: bool = False
        self._issued: i64 = 0
        self._issued_from: i64 = 0
        self._due: i64 = 0
        # By steps of fourth order, where they are stable.
        self._explicit: bool = False
        # The electrical place of a count, and of which.
        self._whole: float = 0.0
        self._whole_of: i64 = 0
        # What it is built for; a motor that has become weaker is followed as finely.
        self._stiffness: float = (self._holding + 4.0 * self._detent) * self._turns
        self.prepare(256e-6)

    def prepare(self, period: float) -> None:
        """Set the length of a period in seconds."""
        super().prepare(period)
        self._cut()

    def _cut(self) -> None:
        """Find how many steps a period takes."""
        period = self.seconds
        # Eight steps to a radian of the rotor's swing at its natural frequency, and as many to
        # what friction leaves of its speed.
        stiffness = self._stiffness
        pieces: i64 = 1
        while pieces < MOST_PIECES and 8.0 * self.viscous * period > self.inertia * float(pieces):
            pieces *= 2
        while pieces < MOST_PIECES and 64.0 * stiffness * period * period > self.inertia * float(
            pieces
        ) * float(pieces):
            pieces = 2 * pieces if 2 * pieces < MOST_PIECES else MOST_PIECES
        self._finest = pieces
        self._explicit = pieces < MOST_PIECES
        self._divided = 0

    def mechanics(self) -> Mechanics:
        """Return the numbers as they are now; change them and give them to :meth:`refit`."""
        return super().mechanics()._replace(torque=self._holding)

    def refit(self, mechanics: Mechanics) -> None:
        """Turn with other numbers from the next period on; the one under way keeps its course."""
        super().refit(mechanics)
        self._holding = mechanics.torque
        self._cut()

    def pulses(self, steps: i64) -> i64:
        """Run one period with ``steps`` signed step pulses spread evenly over it."""
        total = steps if steps >= 0 else -steps
        pieces = self._finest
        if total > 0:
            # Every pulse at the beginning of a step.
            pieces = total * -(-pieces // total)
            if pieces > MOST_PIECES:
                pieces = MOST_PIECES
        self._issued = steps
        self._issued_from = self._steps
        self._pulsed = True
        here = self._run(pieces)
        self._steps = (self._steps + steps) % self._steps_per_rev
        self.rests = steps == 0 and self.departed == self.velocity and here == self.first
        return self.arrive(here)

    def phases(self, a: float, b: float, c: float) -> i64:
        """Run one period with phase currents, each -1.0 to 1.0 (``c`` is 0 with two phases)."""
        self._across, self._along, self._three = field(a, b, c, self._three)
        self._pulsed = False
        here = self._run(self._finest)
        self.rests = self.departed == self.velocity and here == self.first
        return self.arrive(here)

    def _run(self, pieces: i64) -> float:
        """Run a period in so many pieces; return where it leads."""
        if pieces != self._divided:
            self._divided = pieces
            step = self.seconds / float(pieces)
            self._gain = step / self.inertia
            self._turn_counts = step * self.revolution / TWO_PI
        self._ran = pieces
        self.departed = self.velocity
        self.depart()
        self.untraced = True
        return self.settled(self._spin(None))

    def trace(self) -> None:
        """Write the pieces of the last period down: run it once more."""
        points = self.write_pieces(self._ran, self.first)
        speed = self.velocity
        self._spin(points)
        self.velocity = speed
        points[:] = map(bounded, points)

    def _spin(self, points: list[float] | None) -> float:
        """Run the period from its beginning; return where it leads, and note its pieces."""
        if self.base != self._whole_of:
            self._whole_of = self.base
            self._whole = float(self.base * self._cycles % self._whole_turn)
        return self._integrate(points) if self._explicit else self._follow(points)

    def _borders(self) -> tuple[float, float]:
        """Return where the end stops are, beside the place."""
        if not self.has_stops:
            return -NOWHERE, NOWHERE
        return float(self.low - self.base) + 0.5, float(self.high - self.base) + 0.5

    def _follow(self, points: list[float] | None) -> float:
        """Run it by implicit steps of first order, which no friction makes unstable."""
        low, high = self._borders()
        gain, turn = self._gain, self._turn_counts
        # What viscous friction leaves of a speed in a step, and what dry friction takes of it.
        ease = 1.0 / (1.0 + gain * self.viscous)
        loss = gain * self.coulomb * ease
        speed = self.departed
        here = self.first
        piece: i64 = 0
        while piece < self._ran:
            if self._pulsed:
                self._see_pulse(piece)
            # The middle of count 0 is angle 0.
            pull = self._pull(self._whole + (here - 0.5) * self._turns) - self.load
            if speed != 0.0 or pull < -self.static or pull > self.static:
                speed = (speed + gain * pull) * ease
                if speed > loss:
                    speed -= loss
                elif speed < -loss:
                    speed += loss
                else:
                    speed = 0.0
            here += speed * turn
            if here <= low:
                here, speed = low, 0.0
            elif here >= high:
                here, speed = high, 0.0
            piece += 1
            if points is not None:
                points[piece] = here
        self.velocity = speed
        return here

    def _integrate(self, points: list[float] | None) -> float:
        """Run it by steps of fourth order: Runge and Kutta's, as Nyström has them."""
        low, high = self._borders()
        # What an N*m adds to the speed in a step, and what a rad/s to the place.
        gain, turn = self._gain, self._turn_counts
        holding, detent, damping = self._holding, self._detent, self.viscous
        # The electrical angle of a place: the middle of count 0 is angle 0.
        rate = self._turns / self.revolution
        start = self._whole / self.revolution - 0.5 * rate
        arc = TWO_PI * rate
        speed = self.departed
        here = self.first
        piece: i64 = 0
        while piece < self._ran:
            if self._pulsed:
                self._see_pulse(piece)
            across, along = self._across, self._along
            if here <= low:
                here = low
                speed = speed if speed > 0.0 else 0.0
            elif here >= high:
                here = high
                speed = speed if speed < 0.0 else 0.0
            size: i64 = TICKS
            tick: i64 = 0
            part = 1.0
            way = 0.0
            events: i64 = 0
            while tick < TICKS:
                if speed == 0.0 and way == 0.0:
                    pull = self._pull(self._whole + (here - 0.5) * self._turns) - self.load
                    most = NOWHERE if here >= high else self.static
                    least = -NOWHERE if here <= low else -self.static
                    if least <= pull <= most or events >= MOST_EVENTS:
                        break
                    way = 1.0 if pull > 0.0 else -1.0
                elif way == 0.0:
                    way = 1.0 if speed > 0.0 else -1.0
                against = -self.load - way * self.coulomb
                # Of the part of a step: half of it, and all.
                half, full = 0.5 * part * turn, part * turn
                gained = part * gain
                # Torque of the field and of the detents, and how much of it a radian takes away.
                angle = start + rate * here
                sin, cos = sine(angle), sine(angle + 0.25)
                sin_2, cos_2 = 2.0 * sin * cos, 1.0 - 2.0 * sin * sin
                sin_4, cos_4 = 2.0 * sin_2 * cos_2, 1.0 - 2.0 * sin_2 * sin_2
                pull = holding * (across * cos - along * sin)
                grip = holding * (across * sin + along * cos)
                notch, catch = detent * sin_4, detent * cos_4
                first = gained * (pull - notch + against - damping * speed)
                # The same half a step on, and a whole one, as far as it would go unaccelerated.
                angle = rate * half * speed
                sin, cos = sine(angle), sine(angle + 0.25)
                sin_2, cos_2 = 2.0 * sin * cos, 1.0 - 2.0 * sin * sin
                sin_4, cos_4 = 2.0 * sin_2 * cos_2, 1.0 - 2.0 * sin_2 * sin_2
                pull, grip = pull * cos - grip * sin, grip * cos + pull * sin
                notch, catch = notch * cos_4 + catch * sin_4, catch * cos_4 - notch * sin_4
                # From there to where it is, a hundredth of a radian, a straight line does.
                off = arc * half * 0.25 * first
                pulled = pull - notch - off * (grip + 4.0 * catch) + against
                second = gained * (pulled - damping * (speed + 0.5 * first))
                third = gained * (pulled - damping * (speed + 0.5 * second))
                pull, grip = pull * cos - grip * sin, grip * cos + pull * sin
                notch, catch = notch * cos_4 + catch * sin_4, catch * cos_4 - notch * sin_4
                off = arc * full * 0.5 * third
                pulled = pull - notch - off * (grip + 4.0 * catch) + against
                fourth = gained * (pulled - damping * (speed + third))
                after = speed + SIXTH * (first + 2.0 * (second + third) + fourth)
                there = here + full * (speed + SIXTH * (first + second + third))
                stops = way * after <= 0.0
                hits = there >= high if way > 0.0 else there <= low
                # It falls at the beginning and rises at the end, and might be zero between.
                dips = way * first < 0.0 and way * fourth > 0.0 and way * (speed + first) <= 0.0
                if size > 1 and (stops or hits or dips):
                    size = size >> 1
                    part *= 0.5
                    continue
                here, speed = there, after
                if hits:
                    here = high if way > 0.0 else low
                if hits or stops:
                    speed = way = 0.0
                    events += 1
                tick += size
                while size < TICKS and tick & size == 0:
                    size = size << 1
                    part *= 2.0
            piece += 1
            if points is not None:
                points[piece] = here
        self.velocity = speed
        return here

    def _see_pulse(self, piece: i64) -> None:
        """Turn the field to where step pulses have brought it by the start of a step."""
        steps = self._issued
        total = steps if steps >= 0 else -steps
        due = piece * total // self._ran + 1 if total > 0 else 0
        if piece > 0 and due == self._due:
            return
        self._due = due
        place = (self._issued_from + (due if steps >= 0 else -due)) * self._cycles
        turns = float(place % self._steps_per_rev) / float(self._steps_per_rev)
        self._across = sine(turns)
        self._along = sine(turns + 0.25)

    def _pull(self, place: float) -> float:
        """Return the torque of the field on a rotor at ``place`` (cycles, times encoder counts)."""
        turns = place / self.revolution
        pull = self._holding * (self._across * sine(turns + 0.25) - self._along * sine(turns))
        if self._detent > 0.0:
            pull -= self._detent * sine(4.0 * turns)
        return pull
