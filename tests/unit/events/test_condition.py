"""Whatever is written on a board makes sense or is refused where it stands; nothing else comes."""

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.faults.bench import LM, build
from vbus.core.kernel import MS, NEVER
from vbus.core.values.lexer import ConditionError
from vbus.events.condition import Condition, Course
from vbus.events.grammar import FUNCTIONS

BOARD = build(LM)
LEAVES = st.sampled_from([
    "x.real", "x.HI", "x.D0-D7", "x./RST", "x.signal_names", "x.status.BUSY", "x.velocity", "time",
    "lm628.busy-write", "command STT", "violation", "idle", "3", "-2.5", "1e300", "4 counts",
    "2 ms", "9 counts/s", "9999999999999999999999", "x.nothing", "x.command",
])  # fmt: skip


def larger(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    words = st.sampled_from(["and", "or", "<", "==", "!=", ">=", "+", "-"])
    return st.one_of(
        st.tuples(inner, words, inner).map(" ".join),
        st.tuples(st.sampled_from(FUNCTIONS), inner).map(lambda pair: f"{pair[0]}({pair[1]})"),
        inner.map(lambda text: f"({text})"),
        inner.map(lambda text: f"not {text}"),
        inner.map(lambda text: f"{text} stable for 2 ms"),
    )


@given(st.recursive(LEAVES, larger, max_leaves=6), st.lists(st.integers(-5, 255), max_size=4))
@settings(max_examples=300, deadline=None)
def test_what_makes_sense_holds_or_does_not(text: str, values: list[int]) -> None:
    refused = None
    try:
        condition = Condition(text, BOARD)
    except ConditionError as error:
        refused = error
    if refused is not None:
        assert 0 <= refused.at <= len(text)
        return
    course = Course()
    condition.look(course)
    found = [condition.holds(course, 0)]
    for now, value in enumerate(values, 1):
        for key, before in course.values.items():
            course.change(key, str(value) if isinstance(before, str) else value)
        course.happen("command", "x", "STT")
        found.append(condition.holds(course, now * MS))
        assert now * MS < course.due <= NEVER
    assert set(found) <= {False, True}


def test_edges_within_one_look_are_both_seen() -> None:
    course = Course()
    both = Condition("rising(x.HI) and falling(x.HI)", BOARD)
    both.look(course)
    assert not both.holds(course, 0)
    course.change("x.HI", 1 - int(course.values["x.HI"]))
    assert not both.holds(course, 1)
    for _ in range(2):
        course.change("x.HI", 1 - int(course.values["x.HI"]))
    assert both.holds(course, 2)
    assert not both.holds(course, 3)


def test_what_is_asked_of_a_part_does_not_depend_on_the_others() -> None:
    """``previous`` and ``stable`` go on where ``and`` has no need of them."""
    condition = Condition("x.A == 1 and x.real - previous(x.real) == 4", BOARD)
    course = Course()
    condition.look(course)
    for real, level in ((0, 0), (3, 0), (7, 1)):
        course.change("x.real", real)
        course.change("x.A", level)
        assert condition.holds(course, real) == bool(level)


def test_a_text_rises_and_falls_when_it_becomes_another_and_not_otherwise() -> None:
    course = Course()
    course.change("x.mode", "idle")
    course.change("x.mode", "idle")
    assert (course.rose, course.fell) == (set(), set())
    course.change("x.mode", "profile")
    assert (course.rose, course.fell) == ({"x.mode"}, {"x.mode"})
