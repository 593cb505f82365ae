"""Timers of those who look on are no part of the board."""

from vbus import state
from vbus.kernel import Kernel


def test_a_timer_that_is_not_saved_runs_and_is_in_no_state() -> None:
    kernel = Kernel()
    calls: list[int] = []
    mine = kernel.timer(lambda: calls.append(1))
    other = kernel.timer(lambda: calls.append(2), saved=False)
    mine.at(10)
    other.at(5)
    kept = state.save(kernel)
    assert kept == {"now": 0, "dues": (10,)}
    kernel.run_until(20)
    assert calls == [2, 1]
    other.at(30)
    state.load(kernel, kept)
    kernel.run_until(40)
    assert calls == [2, 1, 1, 2]
