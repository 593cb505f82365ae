"""Kernel: virtual time and what is due."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.core.errors import SnapshotError
from vbus.core.kernel import NEVER, Kernel
from vbus.core.kernel.kernel import Task
from vbus.core.state import load, save


def test_a_timer_fires_at_its_instant_and_not_before() -> None:
    kernel = Kernel()
    fired: list[int] = []
    kernel.timer(lambda: fired.append(kernel.now)).at(1_000)

    kernel.run_until(999)
    assert fired == []

    kernel.run_until(1_000)
    assert fired == [1_000]


def test_timers_of_one_instant_run_in_the_order_they_were_made() -> None:
    kernel = Kernel()
    order: list[str] = []
    first = kernel.timer(lambda: order.append("first"))
    second = kernel.timer(lambda: order.append("second"))

    second.at(10)
    first.at(10)
    kernel.run_until(10)

    assert order == ["first", "second"]


def test_what_is_asked_for_soon_runs_after_its_cause_and_at_the_same_instant() -> None:
    kernel = Kernel()
    order: list[tuple[str, int]] = []

    class Effect(Task):
        def run(self) -> None:
            order.append(("effect", kernel.now))

    def cause() -> None:
        kernel.soon(Effect())
        order.append(("cause", kernel.now))

    kernel.timer(cause).at(5)
    kernel.run_until(20)

    assert order == [("cause", 5), ("effect", 5)]


def test_the_last_that_is_asked_for_at_an_instant_knows_it() -> None:
    kernel = Kernel()
    found: list[bool] = []

    class Asking(Task):
        def run(self) -> None:
            found.append(kernel.last)

    for _ in range(3):
        kernel.soon(Asking())
    kernel.settle()
    assert found == [False, False, True]


def test_setting_a_timer_again_forgets_the_earlier_setting() -> None:
    kernel = Kernel()
    fired: list[int] = []
    timer = kernel.timer(lambda: fired.append(kernel.now))

    timer.at(10)
    timer.at(30)
    timer.at(20)
    kernel.run_until(100)

    assert fired == [20]


def test_a_cancelled_timer_does_not_fire() -> None:
    kernel = Kernel()
    fired: list[int] = []
    timer = kernel.timer(lambda: fired.append(kernel.now))

    timer.at(10)
    timer.cancel()
    kernel.run_until(100)

    assert fired == []
    assert timer.due == NEVER


def test_time_does_not_run_backwards() -> None:
    kernel = Kernel()
    kernel.run_until(10)

    with pytest.raises(ValueError, match=r"^time does not run backwards: now 10 ps, asked 9 ps$"):
        kernel.run_until(9)


@pytest.mark.parametrize("saved", [True, False])
def test_a_timer_cancelled_and_set_to_the_same_instant_fires_once(saved: bool) -> None:
    kernel = Kernel()
    fired: list[int] = []
    timer = kernel.timer(lambda: fired.append(kernel.now), saved)
    for _ in range(3):
        timer.at(50)
        timer.at(70)
        timer.cancel()
    timer.at(70)
    kernel.run_until(60)
    assert fired == []
    kernel.run_until(100)
    assert fired == [70]


@pytest.mark.parametrize("saved", [True, False])
def test_a_timer_cancelled_before_a_state_is_loaded_can_be_set_to_the_same_instant(
    saved: bool,
) -> None:
    kernel = Kernel()
    fired: list[int] = []
    timer = kernel.timer(lambda: fired.append(kernel.now), saved)
    timer.at(50)
    timer.cancel()
    kernel.dues = kernel.dues
    timer.at(50)
    kernel.run_until(100)
    assert fired == [50]


def test_a_timer_cannot_be_set_to_the_past() -> None:
    kernel = Kernel()
    timer = kernel.timer(lambda: None)
    kernel.run_until(10)

    with pytest.raises(ValueError, match=r"^instant 9 ps is past; it is 10 ps now$"):
        timer.at(9)


class Ticker:
    """A counter that rearms its own timer; what a chip does."""

    def __init__(self, kernel: Kernel, period: int) -> None:
        self.kernel = kernel
        self.period = period
        self.seen: list[int] = []
        self.timer = kernel.timer(self.tick)
        self.timer.at(period)

    def tick(self) -> None:
        self.seen.append(self.kernel.now)
        self.timer.at(self.kernel.now + self.period)


@given(
    st.lists(st.integers(1, 50), min_size=1, max_size=4),
    st.integers(0, 300),
    st.integers(0, 300),
)
def test_running_in_two_parts_with_a_snapshot_between_is_running_at_once(
    periods: list[int], first: int, second: int
) -> None:
    whole = Kernel()
    expected = [Ticker(whole, period) for period in periods]
    whole.run_until(first + second)

    before = Kernel()
    before_tickers = [Ticker(before, period) for period in periods]
    before.run_until(first)
    after = Kernel()
    after_tickers = [Ticker(after, period) for period in periods]
    load(after, save(before))
    after.run_until(first + second)

    for one, two, three in zip(expected, before_tickers, after_tickers, strict=True):
        assert one.seen == two.seen + three.seen


def test_every_timer_has_one_due_and_no_more() -> None:
    kernel = Kernel()
    with pytest.raises(ValueError, match="zip"):
        kernel.dues = [7]


def test_a_state_of_another_board_is_refused() -> None:
    other = {"now": 0, "dues": (NEVER, NEVER)}
    with pytest.raises(SnapshotError, match=r"^kernel.dues: wants 0 values, not 2$"):
        load(Kernel(), other, "kernel")
