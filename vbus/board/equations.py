"""Equations of programmable logic, as in a GAL listing: ``"!CS0" = "A15 & !A14 & (A13 | AEN)"``.

::

    sum      = product {("|" | "#" | "+" | "or") product}
    product  = factor {("&" | "*" | "and") factor}
    factor   = unit {("^" | "$" | "xor") unit}
    unit     = ("!" | "not") unit | "(" sum ")" | "0" | "1" | NAME

A name stands for the level of a wire: a slash is part of it, as on the drawing, and inverts
nothing. With ``!`` in front of the output the wire is low while the equation holds.
"""

from collections.abc import Callable
from functools import reduce
from operator import and_, itemgetter, or_, xor
from typing import Final

from msgspec import Struct

from vbus.core.values.lexer import END, NAME, Words, name_parts, words
from vbus.glue import logic
from vbus.glue.logic import Levels
from vbus.glue.table import Block

_WORDS: Final = words(r"[&|#^$!()*+]")
_JOINED: Final = (
    (("|", "#", "+", "or"), or_), (("&", "*", "and"), and_), (("^", "$", "xor"), xor),
)  # fmt: skip
_KEYWORDS: Final = ("and", "or", "xor", "not")

Value = Callable[[Levels], int]


class Equation(Struct, frozen=True):
    """An equation that has been read.

    Attributes:
        output: the wire it drives.
        names: the wires it looks at.
        value: the level of the output, from theirs.
    """

    output: str
    names: tuple[str, ...]
    value: Value

    @property
    def block(self) -> Block:
        """It as a block of a part."""
        return Block(self.names, (self.output,), logic.gate(self.value))


def read(output: str, text: str) -> Equation:
    """Return what an equation says.

    Raises:
        ConditionError: it is none.
    """
    name = _EquationReader(output.removeprefix("!").strip(), "output").name()
    reader = _EquationReader(text, "equation")
    value = reader.whole()
    if output.startswith("!"):
        value = _inverted(value)
    return Equation(name, tuple(reader.names), value)


class _EquationReader(Words):
    """Reads one side of an equation."""

    def __init__(self, text: str, what: str) -> None:
        self.names: list[str] = []
        super().__init__(text, what, _WORDS)

    def name(self) -> str:
        """Return the one name of which the text is made."""
        if self.here.kind != NAME or self.here.text in _KEYWORDS:
            raise self.expected('a name, perhaps with "!" in front,')
        name = ".".join(name_parts(self.take()))
        self._end()
        return name

    def whole(self) -> Value:
        """Return what the whole text is worth."""
        value = self._level(0)
        self._end()
        return value

    def _end(self) -> None:
        if self.here.kind != END:
            raise self.expected('"&", "|", "^" or the end')

    def _level(self, rank: int) -> Value:
        if rank == len(_JOINED):
            return self._unit()
        signs, operate = _JOINED[rank]
        parts = [self._level(rank + 1)]
        while self.at_word(*signs):
            self.take()
            parts.append(self._level(rank + 1))
        return parts[0] if len(parts) == 1 else _joined(operate, parts)

    def _unit(self) -> Value:
        token = self.here
        if self.at_word("!", "not", "("):
            self.take()
            if token.text != "(":
                return _inverted(self.nested(self._unit))
            value = self.nested(lambda: self._level(0))
            self.need(")")
            return value
        if self.at_word("0", "1"):
            level = int(self.take().text)
            return lambda levels: level
        if token.kind != NAME or token.text in _KEYWORDS:
            raise self.expected('a name, "!", a parenthesis, 0 or 1')
        name = ".".join(name_parts(self.take()))
        if name not in self.names:
            self.names.append(name)
        return itemgetter(self.names.index(name))


def _inverted(value: Value) -> Value:
    return lambda levels: 1 - value(levels)


def _joined(operate: Callable[[int, int], int], parts: list[Value]) -> Value:
    return lambda levels: reduce(operate, [part(levels) for part in parts])
