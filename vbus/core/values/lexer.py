"""The words of texts about a board: names of pins, numbers and signs.

A minus with no blank before it belongs to a name, as in ``x.D0-D7``, and so does a slash; quotes
make a name, or a part of one, of anything.
"""

import re
from typing import Final

from msgspec import Struct

from vbus.core.errors import VbusError

# Conditions are typed by people, some tens of characters: more, or deeper, is a file by mistake or
# malice.
LONGEST: Final = 1000
DEEPEST: Final = 30

NAME: Final = "name"
NUMBER: Final = "number"
SIGN: Final = "sign"
END: Final = "the end"

PLAIN: Final = r"[^\W\d][\w/~-]*|[/~][\w/~-]*"
PART: Final = r"[\w/~-]+"
QUOTED: Final = r"\"[^\"]*\"|'[^']*'"
_PIECE: Final = re.compile(rf"{PART}|{QUOTED}")


def words(signs: str) -> re.Pattern[str]:
    """Return what matches one word of a language with these signs, a regular expression."""
    return re.compile(
        r"(?P<blank>\s+)|(?P<number>0[xXbBoO][0-9a-fA-F_]+|[0-9][0-9A-F]*H(?!\w)"
        r"|[0-9][0-9_]*(?:\.[0-9]+)?(?:[eE][+-]?[0-9]{1,3})?)"
        rf"|(?P<name>(?:{PLAIN}|{QUOTED})(?:\.(?:{PART}|{QUOTED}))*)"
        rf"|(?P<sign>{signs})"
    )


class ConditionError(VbusError):
    """A condition that is none, or names what the board does not have.

    Attributes:
        at: where in the text the mistake is; its length if something is missing at the end.
    """

    def __init__(self, what: str, text: str, at: int, problem: str, more: str = "") -> None:
        place = f"at character {at + 1}" if at < len(text) else "at the end"
        rest = f"; {more}" if more else ""
        super().__init__(f'{what} "{text}": {problem} {place}{rest}')
        self.at: int = at


class Token(Struct, frozen=True):
    """A word of a text."""

    kind: str
    text: str
    at: int


def name_parts(token: Token) -> tuple[str, ...]:
    """Return what stands between the dots of a name, without quotes."""
    pieces = _PIECE.findall(token.text)
    return tuple(piece[1:-1] if piece[0] in "\"'" else piece for piece in pieces)


class Words:
    """Reads one text, word by word, from left to right.

    Args:
        text: the text.
        what: what it is called in messages: ``"trigger"``.
        words: matches a word: see :func:`words`.
    """

    def __init__(self, text: str, what: str, words: re.Pattern[str]) -> None:
        self._text = text
        self._what = what
        self._words = words
        self._depth = 0
        if len(text) > LONGEST:
            raise ConditionError(
                what, text[:20] + "...", 0, f"more than {LONGEST} characters, beginning"
            )
        self._here = Token(END, "", 0)
        self._step(0)

    def _step(self, at: int) -> None:
        """Look at the word that begins at ``at``, or after the blanks there."""
        text = self._text
        match = self._words.match(text, at)
        # One step of blanks at most: the pattern takes all of them.
        if match is not None and match.lastgroup == "blank":
            at = match.end()
            match = self._words.match(text, at)
        if match is not None:
            self._here = Token(match.lastgroup or "", match.group(), at)
        elif at == len(text):
            self._here = Token(END, "", at)
        elif text[at] in "\"'":
            raise self._error(at, "the quote is not closed that begins")
        else:
            raise self._error(at, f'"{text[at]}" has no meaning')

    def _take(self) -> Token:
        token = self._here
        self._step(token.at + len(token.text))
        return token

    def _is(self, *words: str) -> bool:
        return self._here.text in words

    def _error(self, at: int, problem: str, more: str = "") -> ConditionError:
        return ConditionError(self._what, self._text, at, problem, more)

    def _expected(self, what: str) -> ConditionError:
        found = f'not "{self._here.text}"' if self._here.text else "there is none"
        return self._error(self._here.at, f"{what} is expected, {found},")

    def _need(self, word: str) -> None:
        if not self._is(word):
            raise self._expected(f'"{word}"')
        self._take()

    def _deeper(self) -> None:
        self._depth += 1
        if self._depth > DEEPEST:
            raise self._error(self._here.at, f"more than {DEEPEST} levels of nesting")
