"""The language of conditions: every tree has a text, every mistake a place."""

import re
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.core.kernel import MS
from vbus.core.values.lexer import PART, PLAIN, ConditionError
from vbus.core.values.units import show
from vbus.events.grammar import (
    FUNCTIONS,
    KEYWORDS,
    Compare,
    EventForm,
    Form,
    Function,
    Name,
    Not,
    Number,
    Several,
    Stable,
    Sum,
    read,
)

RANKS = {"or": 0, "and": 1}


def text_of(node: Form, rank: int = 0) -> str:
    """Return a text that reads as this tree; ``rank`` 0 is a condition, 5 an operand."""
    match node:
        case Number(value, unit):
            own, text = 5, f"{value} {unit}".rstrip()
        case Name(parts):
            own, text = 5, named(parts)
        case Function(name, of):
            own, text = 5, f"{name}({text_of(of)})"
        case Sum(terms):
            own, text = 4, "".join(text_of_terms(terms))
        case Compare(sign, left, right):
            own, text = 3, f"{text_of(left, 4)} {sign} {text_of(right, 4)}"
        case EventForm(kind, words):
            own, text = 3, f"{kind} {named((words,))}" if words else kind
        case Not(of):
            own, text = 3, f"not {text_of(of, 3)}"
        case Stable(of, span):
            own, text = 2, f"{text_of(of, 3)} stable for {show(span, 's')}"
        case Several(word, parts):
            own = RANKS[word]
            text = f" {word} ".join(text_of(part, own + 1) for part in parts)
        case _:
            raise TypeError(node)
    return text if own >= rank else f"({text})"


def text_of_terms(terms: tuple[tuple[bool, Form], ...]) -> Iterator[str]:
    for place, (minus, term) in enumerate(terms):
        yield ("" if place == 0 else " - " if minus else " + ") + text_of(term, 5)


def said(node: object) -> object:
    """Return what a tree says, wherever that stands in a text."""
    if isinstance(node, Form):
        return type(node), *(
            said(getattr(node, name)) for name in node.__struct_fields__ if name != "at"
        )
    return tuple(map(said, node)) if isinstance(node, tuple) else node


def named(parts: tuple[str, ...]) -> str:
    shown = [
        part if re.fullmatch(PART if place else PLAIN, part) else f'"{part}"'
        for place, part in enumerate(parts)
    ]
    if len(parts) == 1 and parts[0] in KEYWORDS:
        return f'"{parts[0]}"'
    if any('"' in part for part in parts):
        shown = [
            f"'{part}'" if '"' in part else text for part, text in zip(parts, shown, strict=True)
        ]
    return ".".join(shown)


PARTS = st.one_of(
    st.sampled_from(
        ["x", "HI", "/RST", "~HostIntrpt", "R/W", "D0-D7", "real", "and", "not", "time"]
    ),
    st.text('abz/~-_. 1"(', max_size=6),
)
NUMBERS = st.one_of(st.integers(0, 10**12), st.floats(0, 1e30, allow_nan=False)).map(
    lambda value: Number(value if isinstance(value, int) else abs(value))
)
OPERANDS = st.one_of(
    NUMBERS,
    NUMBERS.map(lambda number: Number(-number.value) if number.value else number),
    st.builds(Number, st.integers(0, 99), st.sampled_from(["ms", "counts/s", ""])),
    st.lists(PARTS, min_size=1, max_size=3).map(lambda parts: Name(tuple(parts))),
)


def larger(inner: st.SearchStrategy[Form]) -> st.SearchStrategy[Form]:
    terms = st.lists(st.tuples(st.booleans(), inner), min_size=2, max_size=3)
    return st.one_of(
        st.builds(Function, st.sampled_from(FUNCTIONS), inner),
        terms.map(lambda found: Sum(((False, found[0][1]), *found[1:]))),
        st.builds(Compare, st.sampled_from(["<", "<=", "==", "!=", ">=", ">"]), inner, inner),
        st.builds(Not, inner),
        st.builds(Stable, inner, st.integers(0, 10**13)),
        st.builds(
            Several,
            st.sampled_from(["and", "or"]),
            st.lists(inner, min_size=2, max_size=3).map(tuple),
        ),
        st.builds(
            EventForm, st.just("command"), st.sampled_from(["STT", "write KP", "LPES and 5"])
        ),
        st.builds(EventForm, st.just("violation"), st.sampled_from(["", "lm628", "lm628.T5"])),
    )


TREES = st.recursive(OPERANDS, larger, max_leaves=8)


@given(TREES)
def test_a_tree_has_a_text_that_reads_as_this_tree(tree: Form) -> None:
    assert said(read(text_of(tree))) == said(tree)


WORDS = st.sampled_from([
    "x.real", "x./CS", '"a b"', "'", '"', "(", ")", ">", "==", "-", "+", "400", "84H", "2 ms",
    "or", "not", "stable", "for", "rises", "rising(", "previous(", "command", "violation", "é", "#",
    "1e999", "0x", "9" * 50, " ", "and",
])  # fmt: skip


@given(st.one_of(st.text(max_size=60), st.lists(WORDS, max_size=12).map(" ".join)))
def test_a_text_is_read_or_refused_with_a_place_in_it(text: str) -> None:
    refused = None
    try:
        tree = read(text)
    except ConditionError as error:
        refused = error
    if refused is None:
        assert said(read(text_of(tree))) == said(tree)
    else:
        assert 0 <= refused.at <= len(text)
        assert str(refused).startswith(f'condition "{text}": ')


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("x.HI=1", "x.HI == 1"),
        ("x.HI rises", "rising(x.HI)"),
        ("x.HI falls", "falling(x.HI)"),
        ("x.a>1 or x.b>2 and x.c>3", "x.a > 1 or (x.b > 2 and x.c > 3)"),
        ("not x.HI stable for 2ms", "(not x.HI) stable for 2 ms"),
        ("x.HI and x.A stable for 2 ms", "x.HI and (x.A stable for 2 ms)"),
        ("x.status = 84H", "x.status == 0x84"),
        ("x.real - previous(x.real) > -5", "(x.real - previous(x.real)) > -5"),
        ("command  write KP and x.HI", 'command "write KP" and x.HI'),
        ("command write KP 84H (132)", 'command "write KP 84H (132)"'),
        ('"x"."D0-D7"=5', "x.D0-D7 == 5"),
        ("x.real<=-1.5e3", "x.real <= -1500.0"),
        ("x.real>+1_000", "x.real > 1000"),
        ("x.status=0b101", "x.status == 5"),
        ("violation lm628.busy-write", "violation 'lm628.busy-write'"),
    ],
)  # fmt: skip
def test_what_means_the_same_is_the_same(text: str, same: str) -> None:
    assert text_of(read(text)) == text_of(read(same))


def test_a_time_is_exact() -> None:
    assert said(read("x.HI stable for 1.5 ms")) == said(Stable(Name(("x", "HI")), MS * 3 // 2))


@pytest.mark.parametrize(
    ("text", "message", "at"),
    [
        ("", "a name or a number is expected, there is none, at the end", 0),
        ("x.real > > 4", 'a name or a number is expected, not ">", at character 10', 9),
        ("x.real >", "expected, there is none, at the end", 8),
        ("x.real > 4 x.HI", 'comparison or the end is expected, not "x.HI", at character 12', 11),
        ("x.HI ; x.A", '";" has no meaning at character 6', 5),
        ('x.HI and "x.A', "the quote is not closed that begins at character 10", 9),
        ("rising x.HI", '"(" is expected, not "x.HI", at character 8', 7),
        ("(x.HI", '")" is expected, there is none, at the end', 5),
        ("x.HI stable 2 ms", '"for" is expected, not "2", at character 13', 12),
        ("x.HI stable for 2", "there is no time at character 17; it has no unit; write", 16),
        ("x.HI stable for x", 'such as "2 ms", is expected, not "x", at character 17', 16),
        ("command", "the name of a command is expected", 7),
        ("x.HI and and", 'a name or a number is expected, not "and", at character 10', 9),
        ("1e999 > x.real", "the number is too large that begins at character 1", 0),
        ("x.real > 0b12", '"0b12" is no number at character 10', 9),
        ("x.real > 1__0", '"1__0" is no number at character 10', 9),
        ("9" * 41, "the number is too long that begins at character 1", 0),
        ("(" * 32, "more than 30 levels of nesting at character 32", 31),
        ("x" * 1001, "more than 1000 characters, beginning at character 1", 0),
    ],
)  # fmt: skip
def test_a_mistake_is_shown_where_it_is(text: str, message: str, at: int) -> None:
    with pytest.raises(ConditionError) as caught:
        read(text)
    assert message in str(caught.value)
    assert caught.value.at == at
