"""The language of conditions: texts to trees, and back.

::

    condition   = both {"or" both}
    both        = lasting {"and" lasting}
    lasting     = negation ["stable" "for" TIME]
    negation    = "not" negation | comparison
    comparison  = event | sum [SIGN sum] | NAME ("rises" | "falls")
    sum         = operand {("+" | "-") operand}
    operand     = ["-" | "+"] NUMBER [UNIT] | NAME | [FUNCTION] "(" condition ")"
    event       = "violation" [NAME] | "command" WORDS

The words of a command go on to ``and``, ``or``, ``stable``, a parenthesis or the end. A minus with
no blank before it belongs to a name, as in ``x.D0-D7``; quotes make a name, or a part of one, of
anything.
"""

import re
from collections.abc import Callable, Iterator
from typing import Any, Final

from msgspec import Struct
from msgspec.structs import astuple

from vbus.core.values.lexer import (
    END,
    NAME,
    NUMBER,
    PART,
    PLAIN,
    QUOTED,
    Token,
    Words,
    name_parts,
    words,
)
from vbus.core.values.units import UnitError, parse, show

FUNCTIONS: Final = ("rising", "falling", "changed", "previous", "abs")
SIGNS: Final = ("<=", ">=", "==", "!=", "<", ">", "=")
KEYWORDS: Final = frozenset({
    "and", "or", "not", "stable", "for", "rises", "falls", "violation", "command", *FUNCTIONS,
})  # fmt: skip
LONGEST_NUMBER: Final = 40
_WORDS: Final = words(r"<=|>=|==|!=|[<>=+()-]")
_UNIT: Final = re.compile(r"[^\W\d_]+(?:/[^\W\d_]+)?")
_COMMAND: Final = re.compile(
    rf"\s*(?:(?P<quoted>{QUOTED})|(?P<words>(?:[^()\"']|\([^()\"']*\))+?))"
    r"\s*(?=\b(?:and|or|stable)\b|\)|$)"
)


class Form(Struct, frozen=True, eq=False, kw_only=True):
    """A piece of a condition.

    Attributes:
        at: where it begins in the text.
    """

    at: int = 0

    def __eq__(self, other: object) -> bool:
        """Whether both say the same, wherever that stands."""
        return isinstance(other, Form) and self._said() == other._said()

    def __ne__(self, other: object) -> bool:
        # Not by itself the opposite: a Struct has an inequality of its own, which is of identity.
        return not self == other

    def __hash__(self) -> int:
        return hash(self._said())

    def _said(self) -> tuple[Any, ...]:
        return type(self), *astuple(self)[:-1]  # ``at`` comes last, as all that has a name only


class Number(Form, frozen=True, eq=False):
    """A number, perhaps with its unit.

    Attributes:
        value: as it is written.
        unit: "" for none.
    """

    value: int | float
    unit: str = ""


class Name(Form, frozen=True, eq=False):
    """The name of a pin, a net, a value, a register, a flag or a rule.

    Attributes:
        parts: what stands between its dots.
    """

    parts: tuple[str, ...]

    @property
    def text(self) -> str:
        """The parts with their dots."""
        return ".".join(self.parts)


class Function(Form, frozen=True, eq=False):
    """One of :data:`FUNCTIONS` of a value."""

    name: str
    of: Form


class Sum(Form, frozen=True, eq=False):
    """Values that are added, or taken away where the first of a pair says so."""

    terms: tuple[tuple[bool, Form], ...]


class Compare(Form, frozen=True, eq=False):
    """Two values and one of :data:`SIGNS`."""

    sign: str
    left: Form
    right: Form


class Not(Form, frozen=True, eq=False):
    """What holds where ``of`` does not."""

    of: Form


class Several(Form, frozen=True, eq=False):
    """Conditions joined by ``word``, ``"and"`` or ``"or"``."""

    word: str
    parts: tuple[Form, ...]


class Stable(Form, frozen=True, eq=False):
    """What has held for ``span`` ps."""

    of: Form
    span: int


class EventForm(Form, frozen=True, eq=False):
    """Something that happens: ``kind`` is ``"violation"`` or ``"command"``, ``text`` which one."""

    kind: str
    text: str


def read(text: str, what: str = "condition") -> Form:
    """Return the tree of a condition.

    Args:
        text: the condition.
        what: what it is called in messages: ``"trigger"``.

    Raises:
        ConditionError: it is none.
    """
    return _ConditionReader(text, what).whole()


def is_word(node: Form) -> bool:
    """Whether a name may be a text or a mnemonic: it has no dot."""
    return isinstance(node, Name) and len(node.parts) == 1


class _ConditionReader(Words):
    """Reads one text, from left to right."""

    def __init__(self, text: str, what: str) -> None:
        super().__init__(text, what, _WORDS)

    def whole(self) -> Form:
        """Return the tree of the whole text."""
        node = self._condition()
        if self._here.kind != END:
            raise self._expected('"and", "or", a comparison or the end')
        return node

    # -- the grammar ----------------------------------------------------------------------------

    def _condition(self) -> Form:
        return self._joined("or", lambda: self._joined("and", self._lasting))

    def _joined(self, word: str, part: Callable[[], Form]) -> Form:
        at = self._here.at
        parts = [part()]
        while self._is(word):
            self._take()
            parts.append(part())
        return parts[0] if len(parts) == 1 else Several(word, tuple(parts), at=at)

    def _lasting(self) -> Form:
        at = self._here.at
        node = self._negation()
        if self._is("stable"):
            self._take()
            self._need("for")
            node = Stable(node, self._span(), at=at)
        return node

    def _span(self) -> int:
        token = self._here
        if token.kind != NUMBER:
            raise self._expected('a time with its unit, such as "2 ms",')
        number = self._number()
        try:
            return int(parse(f"{token.text} {number.unit}", "s"))
        except UnitError as error:
            raise self._error(token.at, "there is no time", str(error)) from None

    def _negation(self) -> Form:
        if not self._is("not"):
            return self._comparison()
        at = self._take().at
        self._deeper()
        node = Not(self._negation(), at=at)
        self._depth -= 1
        return node

    def _comparison(self) -> Form:
        token = self._here
        if token.text == "violation":
            self._take()
            name = ""
            if self._here.kind == NAME and self._here.text not in KEYWORDS:
                name = _name(self._take()).text
            return EventForm("violation", name, at=token.at)
        if token.text == "command":
            return self._command()
        node = self._sum()
        if self._is("rises", "falls"):
            word = self._take().text
            return Function("rising" if word == "rises" else "falling", node, at=token.at)
        if self._here.text in SIGNS:
            sign = self._take().text
            return Compare("==" if sign == "=" else sign, node, self._sum(), at=token.at)
        return node

    def _command(self) -> Form:
        at = self._here.at
        begin = at + len("command")
        match = _COMMAND.match(self._text, begin)
        words = (match["quoted"] or "")[1:-1] or (match["words"] or "").strip() if match else ""
        if match is None or not words:
            raise self._error(begin, 'the name of a command is expected, as in "command STT",')
        self._step(match.end())
        return EventForm("command", words, at=at)

    def _sum(self) -> Form:
        at = self._here.at
        terms = [(False, self._operand())]
        while self._is("+", "-"):
            minus = self._take().text == "-"
            terms.append((minus, self._operand()))
        return terms[0][1] if len(terms) == 1 else Sum(tuple(terms), at=at)

    def _operand(self) -> Form:
        token = self._here
        if token.kind == NUMBER:
            return self._number()
        if token.text in ("-", "+"):
            self._take()
            if self._here.kind != NUMBER:
                raise self._expected("a number")
            number = self._number()
            value = -number.value if token.text == "-" else number.value
            return Number(value, number.unit, at=token.at)
        if token.text in FUNCTIONS or token.text == "(":
            function = self._take().text
            if function != "(":
                self._need("(")
            self._deeper()
            inner = self._condition()
            self._depth -= 1
            self._need(")")
            return inner if function == "(" else Function(function, inner, at=token.at)
        if token.kind != NAME or token.text in KEYWORDS:
            raise self._expected("a name or a number")
        return _name(self._take())

    def _number(self) -> Number:
        token = self._take()
        text = token.text
        if len(text) > LONGEST_NUMBER:
            raise self._error(token.at, "the number is too long that begins")
        value: int | float
        try:
            if text.endswith("H"):
                value = int(text[:-1], 16)
            elif text[1:2].lower() in ("x", "b", "o"):
                value = int(text, 0)
            else:
                value = int(text) if text.replace("_", "").isdecimal() else float(text)
        except ValueError:
            raise self._error(token.at, f'"{text}" is no number') from None
        unit = ""
        if _UNIT.fullmatch(self._here.text) and self._here.text not in KEYWORDS:
            unit = self._take().text
        if value == float("inf"):
            raise self._error(token.at, "the number is too large that begins")
        return Number(value, unit, at=token.at)


def _name(token: Token) -> Name:
    return Name(name_parts(token), at=token.at)


# -- trees to texts -----------------------------------------------------------------------------

_RANKS: Final = {"or": 0, "and": 1}


def text_of(node: Form) -> str:
    """Return a text that reads as this tree."""
    return _text(node, 0)


def _text(node: Form, rank: int) -> str:
    """Return the text of a part; ``rank`` 0 is a condition, 5 an operand."""
    match node:
        case Number(value, unit):
            own, text = 5, f"{value} {unit}".rstrip()
        case Name(parts):
            own, text = 5, _named(parts)
        case Function(name, of):
            own, text = 5, f"{name}({_text(of, 0)})"
        case Sum(terms):
            own, text = 4, "".join(_terms(terms))
        case Compare(sign, left, right):
            own, text = 3, f"{_text(left, 4)} {sign} {_text(right, 4)}"
        case EventForm(kind, words):
            own, text = 3, f"{kind} {_named((words,))}" if words else kind
        case Not(of):
            own, text = 3, f"not {_text(of, 3)}"
        case Stable(of, span):
            own, text = 2, f"{_text(of, 3)} stable for {show(span, 's')}"
        case Several(word, parts):
            own = _RANKS[word]
            text = f" {word} ".join(_text(part, own + 1) for part in parts)
        case _:
            raise TypeError(f"{node!r} is no part of a condition")
    return text if own >= rank else f"({text})"


def _terms(terms: tuple[tuple[bool, Form], ...]) -> Iterator[str]:
    for place, (minus, term) in enumerate(terms):
        yield ("" if place == 0 else " - " if minus else " + ") + _text(term, 5)


def _named(parts: tuple[str, ...]) -> str:
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
