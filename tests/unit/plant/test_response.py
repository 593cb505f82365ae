"""What a motor makes of a span of time, beside the matrix exponential in sixty digits."""

from decimal import Decimal, localcontext
from random import Random

import pytest

from vbus.plant.response import LEVELS, Motor, Span

Matrix = list[list[Decimal]]
Numbers = tuple[float, float, float, float, float, float, float]
"""R, L, Kt, Ke, J, b, counts."""

SMALL: Numbers = (2.5, 0.0005, 0.03, 0.03, 5e-6, 1e-6, 318.30988618379064)
OF = ("current", "speed", "volts", "torque")


def motors() -> list[Numbers]:
    """Return motors of every size, some without inductance, friction, or any coupling."""
    random = Random(7)
    found = [SMALL]
    for number in range(24):
        constant = 10 ** random.uniform(-3, 0) if number % 9 else 0.0
        found.append((
            10 ** random.uniform(-2, 2), 10 ** random.uniform(-6, -1) if number % 5 else 0.0,
            constant, constant * random.uniform(0.5, 2.0), 10 ** random.uniform(-8, -3),
            10 ** random.uniform(-8, -3) if number % 3 else 0.0, random.uniform(1.0, 3000.0),
        ))  # fmt: skip
    return found


def product(a: Matrix, b: Matrix) -> Matrix:
    columns = list(zip(*b, strict=True))
    return [[sum((x * y for x, y in zip(r, c, strict=True)), Decimal(0)) for c in columns]
            for r in a]  # fmt: skip


def exponential(rates: Matrix, span: float) -> Matrix:
    size = len(rates)
    part = Decimal(span) / 2**40
    small = [[entry * part for entry in row] for row in rates]
    total = term = [[Decimal(i == j) for j in range(size)] for i in range(size)]
    for order in range(1, 8):
        term = [[entry / order for entry in row] for row in product(term, small)]
        total = [[x + y for x, y in zip(*rows, strict=True)]
                 for rows in zip(total, term, strict=True)]  # fmt: skip
    for _ in range(40):
        total = product(total, total)
    return total


def true_change(numbers: Numbers, span: float) -> list[list[Decimal]]:
    """Return rows of current, speed and place; columns as in OF."""
    r, ind, kt, ke, j, b, c = map(Decimal, numbers)
    zero, one = Decimal(0), Decimal(1)
    if ind:
        rates = [
            [-r / ind, -ke / ind, zero, one / ind, zero],
            [kt / j, -b / j, zero, zero, one / j],
            [zero, c, zero, zero, zero], [zero] * 5, [zero] * 5,
        ]  # fmt: skip
    else:
        rates = [
            [zero] * 5, [zero, -(b + kt * ke / r) / j, zero, kt / r / j, one / j],
            [zero, c, zero, zero, zero], [zero] * 5, [zero] * 5,
        ]  # fmt: skip
    full = exponential(rates, span)
    rows = [[full[n][m] - (n == m) for m in (0, 1, 3, 4)] for n in range(3)]
    if not ind:
        # The current follows: what volts and speed make of it.
        rows[0] = [-ke / r * moved for moved in rows[1]]
        rows[0][1] -= ke / r
        rows[0][2] += one / r
        rows[0][0] -= 1
    return rows


def change(span: Span) -> list[list[float]]:
    return [
        [getattr(span, f"{what}_of_{of}") for of in OF] for what in ("current", "speed", "place")
    ]


@pytest.mark.parametrize("numbers", motors())
def test_a_span_changes_what_the_matrix_exponential_says(numbers: Numbers) -> None:
    period = 67.84e-6 if numbers[6] < 1000 else 2e-3
    response = Motor(*numbers).response(period)
    assert len(response.spans) == LEVELS + 1
    assert response.spans[0] is response.whole
    with localcontext(prec=60):
        spans = [response.spans[level] for level in (0, 1, 7, LEVELS)]
        true = [true_change(numbers, span.seconds) for span in spans]
        for level, span, rows in zip((0, 1, 7, LEVELS), spans, true, strict=True):
            assert span.seconds == period / 2**level
            for row, got in enumerate(change(span)):
                for column in range(4):
                    # What has faded is exact beside what it was.
                    most = float(max(abs(each[row][column]) for each in true))
                    expected = pytest.approx(float(rows[row][column]), rel=1e-12, abs=1e-13 * most)
                    assert got[column] == expected, (level, row, OF[column])
            decay = Decimal(-1)
            if numbers[1]:
                decay = (-Decimal(numbers[0] / numbers[1]) * Decimal(span.seconds)).exp() - 1
            assert span.blocked == pytest.approx(float(decay), rel=1e-12)


def test_a_motor_that_swings_is_followed_in_spans_of_less_than_half_a_swing() -> None:
    assert Motor(*SMALL).response(256e-6).coarsest == 0
    # 9e-4 / (1e-5 * 1.55e-8) is the square of 76,000 rad/s: half a swing takes 41 us.
    swinging = Motor(0.01, 1e-5, 0.03, 0.03, 1.55e-8, 0.0, 318.0)
    assert [swinging.response(period).coarsest for period in (30e-6, 60e-6, 256e-6)] == [0, 1, 3]


def test_a_current_that_is_over_in_a_billionth_of_a_period_is_worked_out() -> None:
    """The shortest span is many of its time constants, so Taylor's series takes a shorter one."""
    numbers = (100.0, 1e-10, 0.03, 0.03, 5e-6, 1e-6, 2000.0)
    response = Motor(*numbers).response(2e-3)
    assert not response.instant
    assert len(response.spans) == LEVELS + 1
    with localcontext(prec=60):
        for level in (0, 1, 7, LEVELS):
            span = response.spans[level]
            assert span.seconds == 2e-3 / 2**level
            for got, true in zip(change(span), true_change(numbers, span.seconds), strict=True):
                assert got == pytest.approx(list(map(float, true)), rel=1e-9)
