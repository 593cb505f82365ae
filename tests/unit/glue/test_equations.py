"""Equations of programmable logic: what they are worth, and what is wrong with them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.board.equations import read
from vbus.core.errors import VbusError
from vbus.core.values.lexer import ConditionError

NAMES = ("A", "B", "/IORQ", "x.HI")
texts = st.recursive(
    st.sampled_from([*((name, name) for name in NAMES), ("0", "0"), ("1", "1")]),
    lambda inner: st.one_of(
        inner.map(lambda one: (f"!({one[0]})", f"(1 - ({one[1]}))")),
        st.tuples(
            inner,
            st.sampled_from(
                [("&", "&"), ("*", "&"), ("|", "|"), ("#", "|"), ("+", "|"), ("^", "^"), ("$", "^"),
                 ("and", "&"), ("or", "|"), ("xor", "^")]
            ),
            inner,
        ).map(lambda three: (
            f"({three[0][0]}) {three[1][0]} ({three[2][0]})",
            f"(({three[0][1]}) {three[1][1]} ({three[2][1]}))",
        )),
    ),
    max_leaves=12,
)  # fmt: skip


@given(texts, st.integers(0, 15))
def test_an_equation_is_worth_what_its_operators_give(pair: tuple[str, str], word: int) -> None:
    text, python = pair
    levels = {name: word >> place & 1 for place, name in enumerate(NAMES)}
    for name in sorted(NAMES, key=len, reverse=True):
        python = python.replace(name, f"L[{NAMES.index(name)}]")
    wanted = eval(python, {"L": list(levels.values())})
    for output, inverted in (("Y", 0), ("!Y", 1)):
        equation = read(output, text)
        value = equation.value(tuple(levels[name] for name in equation.names))
        assert (equation.output, value) == ("Y", wanted ^ inverted)


@pytest.mark.parametrize(
    ("text", "levels", "value"),
    [
        ("A | B & C", (1, 0, 0), 1),
        ("A & B ^ C", (1, 1, 1), 0),
        ("!A & B", (0, 1), 1),
        ("not A or B", (1, 1), 1),
    ],
)
def test_xor_binds_closer_than_and_and_that_than_or(
    text: str, levels: tuple[int, ...], value: int
) -> None:
    assert read("Y", text).value(levels) == value


@pytest.mark.parametrize(
    ("output", "text", "message"),
    [
        ("Y", "A &", 'equation "A &": a name, "!", a parenthesis, 0 or 1 is expected, there is'
                     " none, at the end"),
        ("Y", "A B", 'equation "A B": "&", "|", "^" or the end is expected, not "B", at'
                     " character 3"),
        ("Y", "(A", 'equation "(A": ")" is expected, there is none, at the end'),
        ("Y", "A ? B", 'equation "A ? B": "?" has no meaning at character 3'),
        ("!", "A", 'output "": a name, perhaps with "!" in front, is expected, there is none, at'
                   " the end"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_that_says_where(output: str, text: str, message: str) -> None:
    with pytest.raises(ConditionError) as told:
        read(output, text)
    assert str(told.value) == message


@given(st.text(alphabet="AB01!&|^()#$*+/~.\"' x-", max_size=40))
def test_any_text_is_an_equation_or_a_mistake(text: str) -> None:
    try:
        equation = read("Y", text)
    except VbusError as error:
        lines = str(error).count("\n")
        assert not lines
    else:
        assert equation.value((0,) * len(equation.names)) in (0, 1)
