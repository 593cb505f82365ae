"""What holds of an LM628 whatever its host does."""

from itertools import pairwise
from random import Random

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.conformance.lm628.bench import Bench, Follower, Log
from tests.probe import probe
from vbus.chips.base import OUTPUT
from vbus.chips.lm628.datasheet import COMMANDS, RATE_MAX
from vbus.chips.lm628.profile import ACCELERATION, POSITION, VELOCITY, Trajectory, approach
from vbus.core import state
from vbus.core.kernel import NS, US
from vbus.core.state import checkpoint, save

Operation = tuple[str, int, int]
ONE = 1 << 16


class Restless(Follower):
    """Never admits to be at rest, so that every sample is run."""

    def resting(self) -> bool:
        return False


def do(bench: Bench, operations: list[Operation]) -> list[int]:
    """Carry out operations; return what was read."""
    got = []
    for name, first, second in operations:
        if name == "write":
            bench.write(first, second)
        elif name == "read":
            got.append(bench.read(first))
        elif name == "run":
            bench.run(first)
        elif name == "ready":
            bench.chip.advance()
            bench.at(max(bench.now, min(bench.chip.ready_at(), bench.now + 2000 * US)))
        elif name == "packet":
            bench.write(0, first & 0xFF)
            bench.run(16 * US)
            for shift in range((first >> 8) * 16 - 16, -1, -16):
                bench.write(1, second >> shift + 8 & 0xFF)
                bench.write(1, second >> shift & 0xFF)
                bench.run(16 * US)
        elif name == "encoder":
            bench.set(A=first >> 1, B=first & 1, **{"/IN": second})
        else:
            bench.set(**{"/RST": first})
    return got


byte = st.integers(0, 255)
code = st.sampled_from([row.code for row in COMMANDS])
noise = st.one_of(
    st.tuples(st.just("write"), st.just(0), st.one_of(code, byte)),
    st.tuples(st.just("write"), st.just(1), byte),
    st.tuples(st.just("read"), st.integers(0, 1), st.just(0)),
    st.tuples(st.just("run"), st.integers(0, 3000 * US), st.just(0)),
    st.tuples(st.just("ready"), st.just(0), st.just(0)),
    st.tuples(st.just("reset"), st.integers(0, 1), st.just(0)),
    st.tuples(st.just("encoder"), st.integers(0, 3), st.integers(0, 1)),
)


def packet(name: str, *words: int) -> Operation:
    """A command with its words: number of words and code in one number, words in the other."""
    value = 0
    for word in words:
        value = value << 16 | word & 0xFFFF
    return ("packet", len(words) << 8 | COMMANDS[name].code, value)


def long(value: int) -> tuple[int, int]:
    return value >> 16 & 0xFFFF, value & 0xFFFF


rate = st.integers(1, 20 * ONE)
moves = st.one_of(
    st.builds(lambda a, v, p: packet("LTRJ", 0x2A, *long(a), *long(v), *long(p)),
              rate, rate, st.integers(-2000, 2000)),
    st.builds(lambda v, c: packet("LTRJ", c | 0x08, *long(v)),
              rate, st.sampled_from([0x0000, 0x0800, 0x1800])),
    st.sampled_from([packet("LTRJ", control) for control in (0x0100, 0x0200, 0x0400, 0x1C00)]),
    st.builds(lambda p, c: packet("LTRJ", c | 0x02, *long(p)), st.integers(-500, 500),
              st.sampled_from([0x0001, 0x0101, 0x0201, 0x0401, 0x1C01, 0x0400])),
    st.sampled_from([packet(name) for name in ("STT", "STT", "STT", "SIP", "DFH", "UDF")]),
    st.builds(lambda *gains: packet("LFIL", gains[4] << 8 | 0x0F, *gains[:4]),
              *[st.integers(0, 300)] * 4, st.integers(0, 5)),
    st.builds(lambda error: packet("LPES", error), st.integers(1, 500)),
    st.builds(lambda name, bp: packet(name, *long(bp)),
              st.sampled_from(["SBPA", "SBPR"]), st.integers(-500, 500)),
    st.just(packet("RSTI", 0)),
    st.just(packet("PORT12")),
    st.tuples(st.just("run"), st.integers(0, 60_000 * US), st.just(0)),
)  # fmt: skip

some = st.lists(st.one_of(moves, noise), max_size=12)


@st.composite
def servo_sessions(draw: st.DrawFn) -> list[Operation]:
    """A tuned loop that moves and comes to rest, and then anything."""
    gains = [draw(st.integers(0, 300)) for _ in range(4)]
    session = [
        packet("LFIL", draw(st.integers(0, 9)) << 8 | 0x0F, *gains),
        packet("UDF"),
        packet("LTRJ", 0x2A, *long(draw(rate)), *long(draw(rate)),
               *long(draw(st.integers(-200, 200)))),
        packet("STT"),
        ("run", draw(st.integers(0, 60_000 * US)), 0),
    ]  # fmt: skip
    return session + draw(st.lists(moves, max_size=15))


servo = servo_sessions()


@pytest.mark.spec("LM-BUS-1", "LM-BUS-2", "LM-BUS-3")
@given(some)
def test_both_ways_in_are_one_implementation(operations):
    results = []
    for mode in ("cycle", "strobe"):
        bench = Bench(mode, plant=Follower(turn=37), busy_jitter_clk=30)
        bench.chip.timing_checked = False
        got = do(bench, operations)
        results.append((got, bench.now, bench.violations, checkpoint(bench.chip)))

    assert results[0] == results[1]


@given(some, some, st.booleans())
def test_a_chip_restored_from_a_snapshot_goes_on_as_if_nothing_had_happened(
    first, second, with_plant
):
    def fresh() -> Bench:
        plant = Follower(turn=37) if with_plant else None
        return Bench("strobe", part="LM629N-8", plant=plant, busy_jitter_clk=30, reset_fail=1)

    whole = fresh()
    do(whole, first)
    expected = do(whole, second), save(whole.chip)

    one = fresh()
    do(one, first)
    kept = save(one.chip)
    other = fresh()
    state.load(other.kernel, save(one.kernel))
    for name, pin in one.host.items():
        other.host[name].level = pin.level
    for name, pin in one.chip.pins.items():
        other.chip.pins[name].level = pin.level
        net, old = other.chip.pins[name].net, pin.net
        net.value, net.previous, net.changed_at = old.value, old.previous, old.changed_at
    state.load(other.chip, kept)

    assert (do(other, second), save(other.chip)) == expected


def registers(bench: Bench) -> tuple[object, ...]:
    chip = bench.chip
    chip.advance()
    saved = save(chip)
    parts = [saved[name] for name in ("axis", "host", "output", "encoder", "_cycle")]
    return *parts, chip.pins["HI"].value


@settings(max_examples=60)
@given(servo)
def test_skipping_samples_at_rest_is_the_same_as_running_them(operations):
    skipping, running = Bench(plant=Follower(turn=37)), Bench(plant=Restless(turn=37))
    for operation in operations:
        do(skipping, [operation])
        do(running, [operation])
        assert registers(skipping) == registers(running)


@pytest.mark.parametrize("ds", [0, 1, 7, 255])
def test_a_derivative_that_is_still_held_is_not_skipped(ds):
    states = []
    for plant in (Follower(), Restless()):
        bench = Bench(plant=plant)
        bench.filter(kp=100, kd=100, ds=ds)
        bench.move(0, accel=ONE, velocity=4 * ONE, position=20)
        bench.run(200_000 * US)
        assert bench.probe.derivative == 0
        states.append(registers(bench))
    assert states[0] == states[1]


def test_a_resting_axis_really_is_skipped():
    class Counting(Follower):
        def drive(self, command: float, error: int) -> int:
            self.periods = getattr(self, "periods", 0) + 1
            return super().drive(command, error)

    bench = Bench(plant=Counting())
    bench.filter(kp=100, ki=10, kd=50, il=100, ds=3)
    bench.move(0, accel=ONE, velocity=ONE, position=10)
    bench.run(10**12)
    bench.chip.advance()

    assert bench.plant.periods < 60
    assert bench.probe.real_position == 10


@settings(max_examples=60)
@given(servo)
def test_being_listened_to_and_being_looked_at_change_nothing(operations):
    """Edges of HI are at the same instants whether the chip is eager or looked at ever so often."""
    states, logs = [], []
    for eager in (True, False):
        bench = Bench(plant=Follower(turn=37))
        log = Log()
        if eager:
            bench.chip.pins["HI"].net.observe(log)
            bench.chip.pins["DAC0"].net.observe(Log())
            do(bench, operations)
        else:
            for operation in operations:
                do(bench, [operation])
                bench.chip.telemetry()
                assert bench.chip.due(OUTPUT) > bench.now
        states.append(registers(bench))
        logs.append(log.edges)
    assert states[0] == states[1]

    # The lazy chip, looked at just before and at each edge of the eager one.
    bench = Bench(plant=Follower(turn=37))
    edges = list(logs[0])

    def watch(until: int) -> None:
        while edges and edges[0][0] <= until:
            when, _, level = edges.pop(0)
            if when > bench.now:
                bench.at(when - 1)
                assert bench.pin("HI") == 1 - level
                bench.at(when)
                assert bench.pin("HI") == level

    for operation in operations:
        if operation[0] == "run":
            end = bench.now + operation[1]
            watch(end)
            bench.at(end)
        else:
            do(bench, [operation])


def load(profile: Trajectory, accel: int, top: int, target: int) -> None:
    for number, value in ((ACCELERATION, accel), (VELOCITY, top), (POSITION, target)):
        profile.load_word(number, False, value >> 16 & 0xFFFF, False)
        profile.load_word(number, True, value & 0xFFFF, False)
    profile.start()
    profile.take_buffers()


@pytest.mark.spec("LM-TRJ-12", "LM-TRJ-11")
@given(
    st.integers(1, RATE_MAX),
    st.lists(
        st.tuples(st.integers(1, RATE_MAX), st.integers(-100_000, 100_000), st.integers(0, 40)),
        min_size=1, max_size=5,
    ),
)  # fmt: skip
@example(accel=65536, legs=[(65536, 1, 1), (1, 0, 0)])
def test_a_profile_lands_exactly_however_often_it_is_sent_elsewhere(accel, legs):
    profile = Trajectory()

    def step() -> bool:
        # A landing ends at velocity 0, so the next leg counts from there.
        position, velocity = profile.position, profile.velocity
        landed = profile.step()
        assert landed or not profile.done
        assert abs(profile.position - position - velocity) <= accel
        return landed

    for top, target, samples in legs:
        load(profile, accel, max(top, accel // 4 + 1), target)
        profile.done = False
        for _ in range(samples):
            if step():
                break
    profile.done = False
    for _ in range(3000):
        if step():
            break
    else:
        # A crawling move: it must still be on its way, at its velocity.
        assert abs(profile.velocity) <= max(profile.top, accel)
        return

    assert profile.position == legs[-1][1] << 16
    assert profile.velocity == 0


def literal(r: int, u: int, v: int, a: int) -> int:
    """LM-TRJ-12 as it stands: the next velocity toward a target that lies ``r`` ahead."""
    if u < 0:
        return min(u + a, v, r) if u + a > 0 else u + a
    if r <= a and u <= a and r <= v:
        return r
    for wanted in (min(v, u + a), min(u, v), u - a):
        n = wanted // a
        if wanted >= 0 and abs(wanted - u) <= a and (n + 1) * wanted - a * n * (n + 1) // 2 <= r:
            return wanted
    return max(u - a, 0)


small = st.integers(0, 40)
wide = st.one_of(small, rate, st.just(RATE_MAX))


@pytest.mark.spec("LM-TRJ-12")
@given(
    st.one_of(small, st.integers(0, 1 << 47), st.integers(0, 5000)),
    st.one_of(st.integers(-60, 60), wide, wide.map(lambda u: -u)),
    wide, wide.map(lambda a: max(a, 1)), st.integers(-3, 3),
)  # fmt: skip
def test_the_step_of_a_position_move_is_the_rule(way, speed, top, accel, nudge):
    assert approach(way, speed, top, accel) == literal(way, speed, top, accel)
    # And where braking has to begin.
    for from_speed in (abs(speed), abs(speed) + accel):
        near = max(0, sum_until_rest(from_speed, accel) + nudge)
        assert approach(near, abs(speed), top, accel) == literal(near, abs(speed), top, accel)


def sum_until_rest(speed: int, accel: int) -> int:
    n = speed // accel
    return (n + 1) * speed - accel * n * (n + 1) // 2


@pytest.mark.spec("LM-TRJ-12")
@given(st.integers(0, 3000), st.integers(1, 4000))
def test_the_way_of_braking_is_the_sum_of_its_samples(speed, accel):
    assert sum_until_rest(speed, accel) == sum(range(speed, 0, -accel))


@pytest.mark.spec("LM-TRJ-12")
def test_3000_random_moves_land_exactly_within_velocity_and_acceleration():
    random = Random(39)
    for _ in range(3000):
        accel = int(2 ** random.uniform(8, 17))
        top = int(2 ** random.uniform(8, 20))
        way = random.randrange(-1, 2, 2) * random.randrange(1 + min(400, top * 1000 >> 16))
        profile = Trajectory()
        load(profile, accel, top, way)
        velocities = [0]
        while not profile.done:
            before = profile.position
            profile.step()
            velocities.append(profile.position - before)
            assert len(velocities) < 3000, "the move does not end"
        assert profile.position == way << 16
        assert profile.velocity == 0
        assert max(map(abs, velocities)) <= top
        assert max(abs(b - a) for a, b in pairwise(velocities)) <= accel
        # The last sample covers what is left, and rests.
        assert abs(velocities[-1]) <= accel
        sign = 1 if way >= 0 else -1
        assert all(sign * velocity >= 0 for velocity in velocities)
        # But for that rest, braking goes in whole steps of A.
        peak = velocities.index(max(velocities, key=abs))
        assert {abs(a) - abs(b) for a, b in pairwise(velocities[peak:-1])} <= {0, accel}


@pytest.mark.spec("LM-TRJ-13", "LM-TRJ-9")
@given(rate, st.lists(st.tuples(rate, st.booleans(), st.integers(1, 30)), max_size=6))
def test_velocity_mode_never_changes_faster_than_its_acceleration_and_stops_on_a_count(accel, legs):
    profile = Trajectory()
    profile.done = False
    profile.control = 0x0800
    before = 0
    for top, forward, samples in legs:
        profile.control = 0x1800 if forward else 0x0800
        load(profile, accel, top, 0)
        for _ in range(samples):
            profile.step()
            assert abs(profile.velocity - before) <= accel
            before = profile.velocity
    profile.stopping = True
    steps = 0
    while not profile.step():
        assert abs(profile.velocity) == abs(before) - accel
        assert profile.target == profile.position >> 16
        before = profile.velocity
        steps += 1
    assert steps <= 20 * ONE // accel + 1
    assert profile.position & 0xFFFF == 0
    assert profile.target == profile.position >> 16


@pytest.mark.spec("LM-BUS-8")
@given(st.integers(0, 800), st.integers(1, 800), st.integers(0, 0xFFFFFFFF))
def test_busy_is_never_longer_than_100_us_nor_shorter_than_a_clock(jitter, nominal, seed):
    bench = Bench(busy_clk=nominal, busy_jitter_clk=jitter, seed=seed)
    for _ in range(5):
        bench.write(0, COMMANDS["UDF"].code)
        assert 125 * NS <= probe(bench.chip).busy_end - bench.edge <= 100 * US
        bench.ready()
