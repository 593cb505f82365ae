"""A switch on the way of an axis: where it is closed, and where its level changes."""

from hypothesis import given
from hypothesis import strategies as st

from vbus.core.signals import Switch

COUNTS = st.integers(-30, 30)


def walked(switch: Switch, start: int, end: int) -> tuple[bool, int]:
    """Look at each count on the way."""
    step = 1 if end > start else -1
    for count in range(start + step, end + step, step) if end != start else ():
        if switch.level(count) != switch.level(start):
            return True, count
    return False, 0


def test_a_switch_is_closed_from_its_first_count_to_before_the_end() -> None:
    levels = [Switch(2, 4).level(count) for count in range(6)]
    assert levels == [1, 1, 0, 0, 1, 1]
    assert [Switch(2, 4, active=1).level(count) for count in range(6)] == [0, 0, 1, 1, 0, 0]


@given(low=COUNTS, width=st.integers(1, 20), start=COUNTS, end=COUNTS, active=st.integers(0, 1))
def test_the_first_change_on_the_way_is_the_one_that_a_walk_finds(
    low: int, width: int, start: int, end: int, active: int
) -> None:
    switch = Switch(low, low + width, active)
    assert switch.change_between(start, end) == walked(switch, start, end)
