"""The words of texts about a board: names of pins, numbers and signs.

A minus with no blank before it belongs to a name, as in ``x.D0-D7``, and so does a slash; quotes
make a name, or a part of one, of anything.
"""

import re
from collections.abc import Callable
from typing import Final, TypeVar

from msgspec import Struct

from vbus.core.errors import VbusError

# Conditions are typed by people, some tens of characters: more, or deeper, is a file by mistake or
# malice.
LONGEST: Final = 1000
DEEPEST: Final = 30

NAME: Final = "name"
NUMBER: Final = "number"
END: Final = "the end"

PLAIN: Final = r"[^\W\d][\w/~-]*|[/~][\w/~-]*"
PART: Final = r"[\w/~-]+"
QUOTED: Final = r"\"[^\"]*\"|'[^']*'"
T = TypeVar("T")
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

    Attributes:
        text: the text.
        here: the word that is looked at.
    """

    def __init__(self, text: str, what: str, words: re.Pattern[str]) -> None:
        self.text = text
        self._what = what
        self._words = words
        self._depth = 0
        if len(text) > LONGEST:
            raise ConditionError(
                what, text[:20] + "...", 0, f"more than {LONGEST} characters, beginning"
            )
        self.here = Token(END, "", 0)
        self.step(0)

    def step(self, at: int) -> None:
        """Look at the word that begins at ``at``, or after the blanks there."""
        text = self.text
        match = self._words.match(text, at)
        # One step of blanks at most: the pattern takes all of them.
        if match is not None and match.lastgroup == "blank":
            at = match.end()
            match = self._words.match(text, at)
        if match is not None:
            self.here = Token(match.lastgroup or "", match.group(), at)
        elif at == len(text):
            self.here = Token(END, "", at)
        elif text[at] in "\"'":
            raise self.error(at, "the quote is not closed that begins")
        else:
            raise self.error(at, f'"{text[at]}" has no meaning')

    def take(self) -> Token:
        """Return the word, and go on to the next."""
        token = self.here
        self.step(token.at + len(token.text))
        return token

    def at_word(self, *words: str) -> bool:
        """Whether the word is one of these."""
        return self.here.text in words

    def error(self, at: int, problem: str, more: str = "") -> ConditionError:
        """Return the error of a mistake that begins at character ``at``."""
        return ConditionError(self._what, self.text, at, problem, more)

    def expected(self, what: str) -> ConditionError:
        """Return the error that something else stands here."""
        found = f'not "{self.here.text}"' if self.here.text else "there is none"
        return self.error(self.here.at, f"{what} is expected, {found},")

    def need(self, word: str) -> None:
        """Go on behind a word that must stand here."""
        if not self.at_word(word):
            raise self.expected(f'"{word}"')
        self.take()

    def nested(self, part: Callable[[], T]) -> T:
        """Read a part that may have parts of its kind in it."""
        self._depth += 1
        if self._depth > DEEPEST:
            raise self.error(self.here.at, f"more than {DEEPEST} levels of nesting")
        read = part()
        self._depth -= 1
        return read
