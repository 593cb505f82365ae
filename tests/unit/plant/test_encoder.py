"""The encoder: levels, index, and the course of a shaft through a period."""

from itertools import pairwise

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from vbus.core.state import load, save
from vbus.plant.dc_motor import DcMotor
from vbus.plant.encoder import MOST_TURNED, EncodedPlant, Encoder
from vbus.plant.ideal import IdealPlant
from vbus.plant.stepper import StepperMotor


def test_counting_up_a_leads_b():
    encoder = Encoder(500)
    assert [encoder.levels(count)[:2] for count in range(-4, 5)] == [
        (0, 0), (1, 0), (1, 1), (0, 1), (0, 0), (1, 0), (1, 1), (0, 1), (0, 0),
    ]  # fmt: skip


def test_the_index_is_low_once_a_revolution_where_a_and_b_are_low():
    encoder = Encoder(25, index_offset=-60)
    low = [count for count in range(-200, 200) if encoder.levels(count)[2] == 0]
    assert low == [-160, -60, 40, 140]
    assert {encoder.levels(count)[:2] for count in low} == {(0, 0)}


def test_an_encoder_without_index_never_has_it_low():
    encoder = Encoder(25, index=False)
    assert {encoder.levels(count)[2] for count in range(200)} == {1}
    assert encoder.index_between(-1000, 1000) == (False, 0)


def test_an_index_where_a_and_b_are_not_low_is_refused():
    with pytest.raises(ValueError, match=r"index_offset = 102: .* multiples of 4, such as 100"):
        Encoder(25, index_offset=102)


@pytest.mark.parametrize(
    ("start", "end", "found"),
    [
        (0, 39, (False, 0)),
        (0, 40, (True, 40)),
        (40, 139, (False, 0)),
        (40, 140, (True, 140)),
        (39, 500, (True, 40)),
        (41, 40, (True, 40)),
        (40, -59, (False, 0)),
        (40, -60, (True, -60)),
        (139, -500, (True, 40)),
        (40, 40, (False, 0)),
    ],
)
def test_the_first_index_on_the_way_is_told_and_the_start_does_not_count(start, end, found):
    assert Encoder(25, index_offset=40).index_between(start, end) == found


@example([5, 24, 30, 24, 4, -30])
@given(st.lists(st.integers(-60, 60), min_size=2))
def test_an_index_is_found_wherever_it_was_looked_for_before(places):
    asked = Encoder(5, index_offset=4)
    for start, end in pairwise(places):
        fresh = Encoder(5, index_offset=4)
        way = range(start + 1, end + 1) if start < end else range(start - 1, end - 1, -1)
        found = [count for count in way if fresh.levels(count)[2] == 0]
        assert asked.index_between(start, end) == ((True, found[0]) if found else (False, 0))


@given(
    start=st.integers(-(10**6), 10**6),
    way=st.integers(-300, 300),
    lines=st.integers(1, 40),
    place=st.integers(-50, 50),
)
def test_an_index_is_told_exactly_where_the_level_says_so(start, way, lines, place):
    encoder = Encoder(lines, index_offset=4 * place)
    step = 1 if way > 0 else -1
    low = [
        count
        for count in range(start + step, start + way + step, step)
        if encoder.levels(count)[2] == 0
    ]
    told = encoder.index_between(start, start + way)
    assert told == ((True, low[0]) if way and low else (False, 0))


def lead(rail: EncodedPlant, *points: float) -> int:
    """Lead a shaft through these positions at equal distances of one period."""
    rail.begin(len(points))
    rail.points[1:] = points
    return rail.end()


def test_a_shaft_starts_in_the_middle_of_count_0():
    rail = EncodedPlant()
    assert (rail.count, rail.count_at(0.0), rail.count_at(1.0)) == (0, 0, 0)
    assert (rail.fraction_at(0), rail.fraction_at(1)) == (0.0, 1.0)


def test_counts_are_placed_on_straight_pieces_between_sub_steps():
    rail = EncodedPlant()
    assert lead(rail, 2.5, 2.5, 10.5, 0.5) == 0
    assert [rail.count_at(fraction / 8) for fraction in range(9)] == [0, 1, 2, 2, 2, 6, 10, 5, 0]
    assert rail.fraction_at(1) == pytest.approx(0.25 * 0.25)
    assert rail.fraction_at(2) == pytest.approx(0.25 * 0.75)
    assert rail.fraction_at(3) == pytest.approx(0.5 + 0.25 / 16)
    assert rail.fraction_at(10) == pytest.approx(0.75 - 0.25 / 16)
    assert rail.fraction_at(11) == 1.0


def test_going_down_a_count_is_reached_when_the_one_above_it_is_left():
    rail = EncodedPlant()
    assert lead(rail, -3.5) == -4
    assert rail.fraction_at(-1) == pytest.approx(0.5 / 4)
    assert rail.fraction_at(-4) == pytest.approx(3.5 / 4)
    assert rail.count_at(0.5 / 4) == 0


def courses(points: st.SearchStrategy[float]) -> st.SearchStrategy[list[list[float]]]:
    """Several periods, each given by where the pieces of its course end."""
    return st.lists(st.lists(points, min_size=1, max_size=5), min_size=1, max_size=3)


@given(periods=courses(st.floats(-300, 300)))
def test_at_the_fraction_told_for_a_count_that_count_is_reached(periods):
    rail = EncodedPlant()
    for points in periods:
        start = rail.count
        end = lead(rail, *points)
        assert rail.count_at(0.0) == start
        assert rail.count_at(1.0) == end
        for count in range(min(start, end), max(start, end) + 1):
            reached = rail.count_at(rail.fraction_at(count))
            assert reached >= count if count > start else reached <= count


@given(periods=courses(st.integers(-19_200, 19_200).map(lambda place: place / 64)))
def test_before_the_fraction_told_for_a_count_it_is_not_reached(periods):
    rail = EncodedPlant()
    for points in periods:
        start = rail.count
        lead(rail, *points)
        places = [rail.count_at(i / len(points)) for i in range(1, len(points) + 1)]
        for count in range(min(start, *places), max(start, *places) + 1):
            fraction = rail.fraction_at(count)
            if fraction > 1e-6:
                before = {rail.count_at((fraction - 1e-9) * part / 7) for part in range(8)}
                assert count not in before
                assert max(before) < count or min(before) > count


@given(points=st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=8))
def test_a_period_begins_where_the_last_one_ended(points):
    rail = EncodedPlant()
    last = 0
    for point in points:
        count = lead(rail, point)
        assert rail.count_at(0.0) == last
        last = count


def test_a_shaft_a_hair_below_a_count_stays_below_it():
    rail = EncodedPlant()
    assert lead(rail, -1e-20) == -1
    rail.begin(1)
    assert 0.0 < rail.points[0] < 1.0
    rail.points[1] = rail.points[0]
    assert rail.end() == -1


FREE = {"viscous_friction": 0.0, "coulomb_friction": 0.0, "static_friction": 0.0}


def full_ahead(plant: EncodedPlant, period: int) -> int:
    return plant.drive(1.0, 1 << 31)


def many_steps(plant: EncodedPlant, period: int) -> int:
    """As many as an MCP-1200 can ask for in a sample, in one of three."""
    return plant.pulses(-(1 << 23) if period % 3 == 0 else 0)


@pytest.mark.parametrize(
    ("make", "period"),
    [
        (lambda: IdealPlant(), many_steps),
        (lambda: IdealPlant({"encoder_lines": 1_000_000, "steps_per_rev": 1}), many_steps),
        (lambda: IdealPlant(), full_ahead),
        (lambda: DcMotor({"supply": 48.0, "gain": 48.0, "encoder_lines": 1_000_000}), full_ahead),
        (lambda: DcMotor({**FREE, "back_emf": 0.0, "inertia": 1e-12}), full_ahead),
        (lambda: DcMotor({**FREE, "back_emf": 0.0, "inertia": 1e-12, "torque_constant": 1e9}),
         full_ahead),
        (lambda: DcMotor({"load_torque": 20.0, "stop_low": -9000, "stop_high": 9000}), full_ahead),
        (lambda: DcMotor({"supply": 0.0, "load_torque": 20.0, "inertia": 1e-9, "stop_low": -9000,
                          "stop_high": 9000, "inductance": 1.0}), full_ahead),
        (lambda: StepperMotor({**FREE, "load_torque": 1e6, "inertia": 1e-12}), many_steps),
    ],
)  # fmt: skip
def test_whatever_a_shaft_does_in_a_period_is_saved_and_loaded(make, period):
    plant, twin = make(), make()
    for number in range(300):
        before = plant.count
        period(plant, number)
        assert abs(plant.count - before) <= MOST_TURNED
        state = save(plant)
        load(twin, state)
        assert save(twin) == state
        assert [twin.count_at(part / 4) for part in range(5)] == [
            plant.count_at(part / 4) for part in range(5)
        ]


def test_a_plant_that_has_far_to_go_gets_there_in_several_periods():
    plant = IdealPlant()
    counts = [plant.pulses(1 << 23)]
    while not plant.resting():
        counts.append(plant.pulses(0))
    assert counts == [1 << 26, 10 << 23, 10 << 23]
