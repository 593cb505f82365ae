"""Timers of those who look on are no part of the board."""

from vbus.core import state
from vbus.core.kernel import Kernel


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


def test_an_onlooker_looks_when_all_has_happened_and_nobody_is_told_of_it() -> None:
    kernel = Kernel()
    calls: list[tuple[str, int]] = []
    looks = kernel.onlooker(lambda: calls.append(("look", kernel.now)))
    board = kernel.timer(lambda: calls.append(("board", kernel.now)))
    looks.at(10)
    board.at(10)
    assert (kernel.next_due, kernel.next_stop) == (10, 10)
    kernel.run_until(10)
    assert calls == [("board", 10), ("look", 10)]
    looks.at(15)
    board.at(20)
    assert (kernel.next_due, kernel.next_stop) == (20, 15)
    kernel.run_until(14)
    assert len(calls) == 2
    kernel.run_until(15)
    assert calls[2:] == [("look", 15)]
    assert (kernel.next_due, kernel.next_stop) == (20, 20)
    assert state.save(kernel) == {"now": 15, "dues": (20,)}
    looks.at(18)
    state.load(kernel, {"now": 15, "dues": (16,)})
    kernel.run_until(30)
    assert calls[3:] == [("board", 16), ("look", 18)]
