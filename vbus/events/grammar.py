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
from collections.abc import Callable
from typing import Final

from msgspec import Struct

from vbus.core.values.lexer import (
    END,
    NAME,
    NUMBER,
    QUOTED,
    Token,
    Words,
    name_parts,
    words,
)
from vbus.core.values.units import UnitError, parse

FUNCTIONS: Final = ("rising", "falling", "changed", "previous", "abs")
SIGNS: Final = ("<=", ">=", "==", "!=", "<", ">", "=")
KEYWORDS: Final = frozenset({
    "and", "or", "not", "stable", "for", "rises", "falls", "violation", "command", *FUNCTIONS,
})  # fmt: skip
LONGEST_NUMBER: Final = 40
"""Characters; no number with a meaning on a board is as long."""
_WORDS: Final = words(r"<=|>=|==|!=|[<>=+()-]")
_UNIT: Final = re.compile(r"[^\W\d_]+(?:/[^\W\d_]+)?")
_COMMAND: Final = re.compile(
    rf"\s*(?:(?P<quoted>{QUOTED})|(?P<words>(?:[^()\"']|\([^()\"']*\))+?))"
    r"\s*(?=\b(?:and|or|stable)\b|\)|$)"
)


class Form(Struct, frozen=True, kw_only=True):
    """A piece of a condition.

    Attributes:
        at: where it begins in the text.
    """

    at: int = 0


class Number(Form, frozen=True):
    """A number, perhaps with its unit.

    Attributes:
        value: as it is written.
        unit: "" for none.
    """

    value: int | float
    unit: str = ""


class Name(Form, frozen=True):
    """The name of a pin, a net, a value, a register, a flag or a rule.

    Attributes:
        parts: what stands between its dots.
    """

    parts: tuple[str, ...]

    @property
    def text(self) -> str:
        """The parts with their dots."""
        return ".".join(self.parts)


class Function(Form, frozen=True):
    """One of :data:`FUNCTIONS` of a value."""

    name: str
    of: Form


class Sum(Form, frozen=True):
    """Values that are added, or taken away where the first of a pair says so."""

    terms: tuple[tuple[bool, Form], ...]


class Compare(Form, frozen=True):
    """Two values and one of :data:`SIGNS`."""

    sign: str
    left: Form
    right: Form


class Not(Form, frozen=True):
    """What holds where ``of`` does not."""

    of: Form


class Several(Form, frozen=True):
    """Conditions joined by ``word``, ``"and"`` or ``"or"``."""

    word: str
    parts: tuple[Form, ...]


class Stable(Form, frozen=True):
    """What has held for ``span`` ps."""

    of: Form
    span: int


class EventForm(Form, frozen=True):
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
        if self.here.kind != END:
            raise self.expected('"and", "or", a comparison or the end')
        return node

    # -- the grammar ----------------------------------------------------------------------------

    def _condition(self) -> Form:
        return self._joined("or", lambda: self._joined("and", self._lasting))

    def _joined(self, word: str, part: Callable[[], Form]) -> Form:
        at = self.here.at
        parts = [part()]
        while self.at_word(word):
            self.take()
            parts.append(part())
        return parts[0] if len(parts) == 1 else Several(word, tuple(parts), at=at)

    def _lasting(self) -> Form:
        at = self.here.at
        node = self._negation()
        if self.at_word("stable"):
            self.take()
            self.need("for")
            node = Stable(node, self._span(), at=at)
        return node

    def _span(self) -> int:
        token = self.here
        if token.kind != NUMBER:
            raise self.expected('a time with its unit, such as "2 ms",')
        number = self._number()
        try:
            return int(parse(f"{token.text} {number.unit}", "s"))
        except UnitError as error:
            raise self.error(token.at, "there is no time", str(error)) from None

    def _negation(self) -> Form:
        if not self.at_word("not"):
            return self._comparison()
        at = self.take().at
        return Not(self.nested(self._negation), at=at)

    def _comparison(self) -> Form:
        token = self.here
        if token.text == "violation":
            self.take()
            name = ""
            if self.here.kind == NAME and self.here.text not in KEYWORDS:
                name = _name(self.take()).text
            return EventForm("violation", name, at=token.at)
        if token.text == "command":
            return self._command()
        node = self._sum()
        if self.at_word("rises", "falls"):
            word = self.take().text
            return Function("rising" if word == "rises" else "falling", node, at=token.at)
        if self.here.text in SIGNS:
            sign = self.take().text
            return Compare("==" if sign == "=" else sign, node, self._sum(), at=token.at)
        return node

    def _command(self) -> Form:
        at = self.here.at
        begin = at + len("command")
        match = _COMMAND.match(self.text, begin)
        words = (match["quoted"] or "")[1:-1] or (match["words"] or "").strip() if match else ""
        if match is None or not words:
            raise self.error(begin, 'the name of a command is expected, as in "command STT",')
        self.step(match.end())
        return EventForm("command", words, at=at)

    def _sum(self) -> Form:
        at = self.here.at
        terms = [(False, self._operand())]
        while self.at_word("+", "-"):
            minus = self.take().text == "-"
            terms.append((minus, self._operand()))
        return terms[0][1] if len(terms) == 1 else Sum(tuple(terms), at=at)

    def _operand(self) -> Form:
        token = self.here
        if token.kind == NUMBER:
            return self._number()
        if token.text in ("-", "+"):
            self.take()
            if self.here.kind != NUMBER:
                raise self.expected("a number")
            number = self._number()
            value = -number.value if token.text == "-" else number.value
            return Number(value, number.unit, at=token.at)
        if token.text in FUNCTIONS or token.text == "(":
            function = self.take().text
            if function != "(":
                self.need("(")
            inner = self.nested(self._condition)
            self.need(")")
            return inner if function == "(" else Function(function, inner, at=token.at)
        if token.kind != NAME or token.text in KEYWORDS:
            raise self.expected("a name or a number")
        return _name(self.take())

    def _number(self) -> Number:
        token = self.take()
        text = token.text
        if len(text) > LONGEST_NUMBER:
            raise self.error(token.at, "the number is too long that begins")
        value: int | float
        try:
            if text.endswith("H"):
                value = int(text[:-1], 16)
            elif text[1:2].lower() in ("x", "b", "o"):
                value = int(text, 0)
            else:
                value = int(text) if text.replace("_", "").isdecimal() else float(text)
        except ValueError:
            raise self.error(token.at, f'"{text}" is no number') from None
        unit = ""
        if _UNIT.fullmatch(self.here.text) and self.here.text not in KEYWORDS:
            unit = self.take().text
        if value == float("inf"):
            raise self.error(token.at, "the number is too large that begins")
        return Number(value, unit, at=token.at)


def _name(token: Token) -> Name:
    return Name(name_parts(token), at=token.at)
