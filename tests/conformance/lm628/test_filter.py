"""The filter: error, products, integrator, derivative (manual: PID Compensation Filter)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.conformance.lm628.bench import Bench, Course
from vbus.chips.lm628.pid import Pid

ERRORS = (0, 10, 20, 30, 30, -5, -400)


def pid(wraps: bool = False, ds: int = 0, limits_sum: bool = False, **gains: int) -> Pid:
    filter_ = Pid(wraps, limits_sum)
    for number, name in enumerate(("kp", "ki", "kd", "il"), 1):
        filter_.store(number, gains.get(name, 0))
    filter_.store(0, ds)
    filter_.send()
    filter_.update()
    return filter_


def held(make, errors, **settings) -> Bench:
    """A bench whose motor was just turned on, and whose next samples see these errors."""
    gains = {
        name: settings.pop(name) for name in ("kp", "ki", "kd", "il", "ds") if name in settings
    }
    plant = Course()
    bench = make(plant=plant, **settings)
    bench.filter(**gains)
    bench.next_sample()
    bench.move(0)
    plant.counts = [-error for error in errors]
    return bench


@pytest.mark.spec("LM-PID-1", "LM-CMD-19")
@pytest.mark.parametrize("bits", range(16))
def test_lfil_loads_the_coefficients_its_bits_name_in_the_order_kp_ki_kd_il(bench, bits):
    bench.command("LFIL", 0xABF0 | bits)
    assert bench.probe.words_due == bits.bit_count()
    for word in range(bits.bit_count()):
        bench.word(word + 1)

    loaded, word = [0xAB], 0
    for bit in (8, 4, 2, 1):
        word += bool(bits & bit)
        loaded.append(word if bits & bit else 0)
    assert bench.probe.filter_loaded == loaded
    assert bench.rules() == ["idle-bits"]


@pytest.mark.spec("LM-PID-1")
@pytest.mark.parametrize("name", ["kp", "ki", "kd", "il"])
@pytest.mark.parametrize("bit", range(15))
def test_each_bit_of_a_coefficient_counts(bench, name, bit):
    for value in (1 << bit, 0x7FFF ^ 1 << bit):
        bench.command("LFIL", {"kp": 8, "ki": 4, "kd": 2, "il": 1}[name], value)
        bench.command("UDF")
        bench.next_sample()
        assert getattr(bench.probe, name) == value
    assert bench.rules() == []


@pytest.mark.spec("LM-PID-1")
def test_every_lfil_stores_the_derivative_interval_and_udf_uses_it(bench):
    bench.command("LFIL", 0x0300)
    assert (bench.probe.ds_loaded, bench.probe.ds) == (3, 0)
    bench.command("UDF")
    bench.next_sample()
    assert bench.probe.ds == 3


@pytest.mark.spec("LM-PID-1", "LM-TRJ-2")
def test_bit_15_of_a_coefficient_is_masked_and_reported(bench):
    bench.command("LFIL", 0x0008, 0x8007)
    assert bench.probe.kp_loaded == 7
    assert bench.rules() == ["range"]


@pytest.mark.spec("LM-T-8", "LM-PID-3", "LM-PID-7", "LM-PID-8")
@pytest.mark.parametrize(
    ("port", "codes"),
    [
        ("PORT8", [0x80, 0x85, 0x88, 0x8C, 0x8B, 0x79, 0x00]),
        ("PORT12", [0x800, 0x851, 0x88F, 0x8CE, 0x8BB, 0x79F, 0x000]),
    ],
)
def test_the_printed_seven_samples(make, port, codes):
    bench = held(make, ERRORS[1:], kp=100, ki=50, kd=30, il=2000, ds=0)
    bench.probe.port8 = port == "PORT8"
    seen = []
    for _ in ERRORS:
        bench.next_sample()
        seen.append(
            (bench.probe.position_error, bench.probe.motor_command, bench.probe.output_code())
        )

    assert [error for error, _, _ in seen] == list(ERRORS)
    assert [command for _, command, _ in seen] == [0, 1300, 2300, 3300, 3000, -1550, -32768]
    assert [code for _, _, code in seen] == codes


@pytest.mark.spec("LM-T-9", "LM-PID-4", "LM-PID-5")
def test_the_printed_integration_limit(make):
    bench = held(make, [300] * 6, ki=20, il=50, integral_limit="term")
    bench.next_sample()
    course = []
    for _ in range(4):
        bench.next_sample()
        course.append((bench.probe.integration_sum, bench.probe.error_sum))

    assert course == [(20, 300), (40, 600), (50, 600), (50, 600)]
    assert bench.probe.motor_command == 50
    assert bench.report("RDSUM") == 50


@pytest.mark.spec("LM-T-13")
def test_the_application_notes_lfil_leaves_the_derivative_interval_at_one_sample(bench):
    bench.command("LFIL", 0x0008, 0x000A)
    bench.command("UDF")
    bench.next_sample()
    assert (bench.probe.kp, bench.probe.ds) == (10, 0)


@pytest.mark.spec("LM-PID-2")
@pytest.mark.parametrize(
    ("desired", "real", "error"),
    [
        (0, 40_000, -32768),
        (40_000, 0, 32767),
        (5, -7, 12),
        ((1 << 30) - 1, -(1 << 30), -1),
        (-(1 << 30), (1 << 30) - 1, 1),
    ],
)
def test_the_error_is_a_31_bit_difference_saturated_to_16_bits(make, desired, real, error):
    bench = held(make, [], kp=1)
    bench.next_sample()
    axis = bench.probe
    axis.desired_position = desired << 16
    axis.real_position = real
    bench.chip.input_changed()
    bench.next_sample()

    assert axis.position_error == error
    assert axis.motor_command == error


@pytest.mark.spec("LM-PID-2", "LM-POS-6", "LM-TRJ-17")
def test_the_largest_threshold_never_fires_even_at_the_most_negative_error(make):
    bench = held(make, [-40_000, -40_000])
    bench.command("RSTI", 0)
    for _ in range(3):
        bench.next_sample()
    assert bench.probe.position_error == -32768
    assert not bench.probe.flags & 0x20

    bench.command("LPEI", 0x7FFE)
    bench.next_sample()
    assert bench.probe.flags & 0x20


@pytest.mark.spec("LM-PID-3", "LM-T-10", "LM-AMB-7")
@pytest.mark.parametrize(("ds", "interval_us"), [(0, 256), (3, 1024), (255, 65_536)])
def test_the_derivative_is_taken_every_ds_plus_one_samples_and_added_in_each(ds, interval_us):
    filter_ = pid(kd=2, ds=ds)
    outputs = [filter_.step(error) for error in range(1, 3 * (ds + 1) + 1)]

    interval = interval_us // 256
    assert outputs == [2] * interval + [2 * interval] * (2 * interval)


@pytest.mark.spec("LM-PID-3")
def test_udf_begins_a_derivative_interval_with_its_own_sample():
    filter_ = pid(kd=1, ds=3)
    assert [filter_.step(error) for error in (10, 11)] == [10, 10]
    filter_.send()
    filter_.update()
    assert [filter_.step(error) for error in (14, 15, 16, 17, 18)] == [4, 4, 4, 4, 4]


@pytest.mark.spec("LM-PID-4", "LM-AMB-19")
@pytest.mark.parametrize("sign", [1, -1])
def test_the_integral_uses_the_upper_16_of_24_bits_and_saturates(sign):
    filter_ = pid(ki=0)
    for _ in range(300):
        filter_.step(sign * 32767)
    assert filter_.sum == sign * 0x7FFFFF

    other = pid(ki=1, il=0x7FFF)
    assert [other.step(sign * 255), other.step(sign)] == ([0, 1] if sign > 0 else [-1, -1])


@pytest.mark.spec("LM-PID-5")
def test_at_the_limit_the_sum_only_comes_back():
    filter_ = pid(ki=10, il=20)
    for _ in range(10):
        filter_.step(256)
    assert (filter_.sum, filter_.term) == (512, 20)
    filter_.step(-100)
    assert (filter_.sum, filter_.term) == (412, 10)
    for _ in range(9):
        filter_.step(-256)
    assert (filter_.sum, filter_.term) == (-356, -20)


@pytest.mark.spec("LM-PID-5")
def test_a_limit_lowered_below_the_term_lets_the_sum_fall_but_not_rise():
    filter_ = pid(ki=10, il=1000)
    for _ in range(20):
        filter_.step(256)
    filter_.store(4, 50)
    filter_.send()
    filter_.update()
    filter_.step(256)
    assert (filter_.sum, filter_.term) == (5120, 50)
    filter_.step(-256)
    assert (filter_.sum, filter_.term) == (4864, 50)


@pytest.mark.spec("LM-PID-5")
@pytest.mark.parametrize("limits_sum", [False, True])
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("beyond", "taken"), [(0, True), (1, False)])
def test_a_limited_sum_may_change_sides_if_it_comes_no_further_from_zero(
    limits_sum, sign, beyond, taken
):
    filter_ = pid(ki=1, il=0x7FFF, limits_sum=limits_sum)
    filter_.step(sign * 1024)
    filter_.store(4, 1)
    filter_.send()
    filter_.update()
    filter_.step(sign * (-2048 - beyond))
    assert filter_.sum == sign * (-1024 if taken else 1024)
    # The summation is read as it was added where it passes its limit.
    added = sign * (-1024 - beyond) >> 8
    assert filter_.term == (added if limits_sum else -sign)


@pytest.mark.spec("LM-PID-5", "LM-AMB-9")
@pytest.mark.parametrize(
    ("errors", "sums", "terms"),
    [
        # What passes the limit is read as it was added, once.
        ([300, 700, 300, 300], [300, 300, 600, 600], [1, 3, 2, 3]),
        ([1100, 1, 300, -512], [0, 1, 301, -211], [4, 0, 1, -1]),
        ([-900, -1, -900, -900], [0, -1, -1, -1], [-4, -1, -4, -2]),
        ([767, 1, -1, -512], [767, 767, 766, 254], [2, 3, 2, 0]),
        ([-512, -1, -1, 1], [-512, -512, -512, -511], [-2, -3, -2, -2]),
        ([-100] * 7, [-100, -200, -300, -400, -500, -500, -500], [-1, -1, -2, -2, -2, -3, -2]),
    ],
)
def test_the_limit_holds_for_the_scaled_summation_by_default(make, errors, sums, terms):
    bench = held(make, errors, ki=10, il=2)
    bench.next_sample()
    course = []
    for _ in errors:
        bench.next_sample()
        course.append(
            (bench.probe.error_sum, bench.probe.integration_sum, bench.probe.motor_command)
        )

    assert course == [
        (total, term, 10 * max(-2, min(2, term))) for total, term in zip(sums, terms, strict=True)
    ]


@pytest.mark.spec("LM-PID-5", "LM-PID-6", "LM-AMB-9")
@pytest.mark.parametrize("sign", [1, -1])
def test_with_a_limited_summation_its_product_with_ki_overflows_like_the_others(sign):
    saturating = pid(limits_sum=True, ki=5000, il=1000)
    wrapping = pid(True, limits_sum=True, ki=5000, il=1000)
    for filter_, output in ((saturating, 32767 if sign > 0 else -32768), (wrapping, sign * -7328)):
        filter_.step(sign * 25_600), filter_.step(sign * 25_600)
        assert filter_.step(sign * 25_600) == output
        assert filter_.term == sign * 300


@pytest.mark.spec("LM-PID-6", "LM-AMB-1", "LM-CFG-1")
def test_products_over_16_bits_saturate_by_default_and_wrap_on_request(make):
    for settings, expected in (({}, 32767), ({"pid_overflow": "wrap"}, -25536)):
        bench = held(make, [40], kp=1000, **settings)
        bench.next_sample()
        bench.next_sample()
        assert bench.probe.motor_command == expected


@pytest.mark.spec("LM-PID-6", "LM-PID-7")
def test_each_product_and_the_sum_overflow_on_their_own():
    # P = 40000 -> 32767, D = -40000 -> -32768: together -1, not 0.
    saturating = pid(kp=400, kd=400)
    saturating.last_error = 200
    assert saturating.step(100) == -1
    wrapping = pid(True, kp=400, kd=400)
    wrapping.last_error = 200
    assert wrapping.step(100) == 0

    assert pid(kp=300, kd=300).step(100) == 32767
    assert pid(True, kp=300, kd=300).step(100) == 60_000 - 65_536
    assert pid(kp=300, kd=300).step(-100) == -32768


@pytest.mark.spec("LM-PID-6")
def test_the_integral_product_overflows_before_it_is_compared_with_the_limit():
    saturating, wrapping = pid(ki=0x7FFF, il=0x7FFF), pid(True, ki=0x7FFF, il=0x7FFF)
    for _ in range(2):
        saturating.step(512), wrapping.step(512)
    assert saturating.term == 0x7FFF
    assert wrapping.term == -4


def reference(
    errors: list[int], kp: int, ki: int, kd: int, il: int, ds: int, limits_sum: bool
) -> list[int]:
    """The manual's Eq. 1 with its word widths, written straight down."""

    def sat(value: int) -> int:
        return max(-32768, min(32767, value))

    total = derivative = last = 0
    result = []
    for n, error in enumerate(errors):
        if n % (ds + 1) == 0:
            derivative, last = sat(kd * (error - last)), error
        grown = max(-0x7FFFFF, min(0x7FFFFF, total + error))
        integral = grown >> 8 if limits_sum else sat(ki * (grown >> 8))
        limited = max(-il, min(il, integral))
        if limited == integral or abs(grown) <= abs(total):
            total = grown
        term = sat(ki * limited) if limits_sum else limited
        result.append(sat(sat(kp * error) + term + derivative))
    return result


gain = st.integers(0, 0x7FFF)


@pytest.mark.spec("LM-PID-3", "LM-PID-4", "LM-PID-5", "LM-PID-6", "LM-PID-7")
@given(
    st.lists(st.integers(-32768, 32767), max_size=60),
    gain, gain, gain, gain, st.integers(0, 7), st.booleans(),
)  # fmt: skip
def test_the_filter_is_the_equation(errors, kp, ki, kd, il, ds, limits_sum):
    filter_ = pid(kp=kp, ki=ki, kd=kd, il=il, ds=ds, limits_sum=limits_sum)
    expected = reference(errors, kp, ki, kd, il, ds, limits_sum)

    assert [filter_.step(error) for error in errors] == expected
