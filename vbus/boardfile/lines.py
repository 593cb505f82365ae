"""Where each key of a TOML text stands: the line numbers behind messages about a board file."""

import re
import tomllib
from typing import Final

Path = tuple[str | int, ...]
"""Keys and array places from the top of the file: ``("hosts", 0, "transport")``."""

_TOKEN: Final = re.compile(
    r'#[^\n]*|"""(?:\\.|[^\\])*?""""{0,2}|"(?:\\.|[^"\\])*"'
    r"|'''.*?''''{0,2}|'[^']*'"
    r"""|[^\s#"'\[\]{},=.]+|[\n\[\]{},=.]""",
    re.DOTALL,
)
"""A comment, a string (which may end in two quotes of its own), a word, or a mark."""


class TomlLines:
    """Line numbers (from 1) of every key and array element of a TOML text.

    The text must be one :mod:`tomllib` accepts: this index repeats none of its checks.

    Args:
        text: the whole file.
    """

    def __init__(self, text: str) -> None:
        self._tokens: list[tuple[str, int]] = []
        """What is still to be read, the next token last, each with its line."""
        self._lines: dict[Path, int] = {}
        line, behind = 1, 0
        for match in _TOKEN.finditer(text):
            line += text.count("\n", behind, match.start())
            behind = match.start()
            if match[0][0] != "#":
                self._tokens.append((match[0], line))
        # Taken from the end: to take the first of a list costs its length.
        self._tokens.reverse()
        table: Path = ()
        arrays: dict[Path, int] = {}
        while mark := self._next("\n"):
            if mark == "[":
                table = self._header(arrays)
            else:
                self._pair(table)

    def line(self, path: Path) -> int:
        """Return the line of ``path``, or of the nearest table above it that has one."""
        while path and path not in self._lines:
            path = path[:-1]
        return self._lines.get(path, 1)

    def _next(self, passed: str) -> str:
        """Pass some marks; return the token behind them, which is not taken; empty at the end."""
        while self._tokens and self._tokens[-1][0] in passed:
            self._tokens.pop()
        return self._tokens[-1][0] if self._tokens else ""

    def _keys(self) -> tuple[list[str], int]:
        """Take a key, dotted or not, and the mark behind it; return its parts and its line."""
        line, keys = self._tokens[-1][1], []
        while (token := self._tokens.pop()[0]) not in "=]":
            if token != ".":
                keys.append(str(tomllib.loads(f"k = {token}")["k"]) if token[0] in "\"'" else token)
        return keys, line

    def _header(self, arrays: dict[Path, int]) -> Path:
        array = self._tokens[-2][0] == "["
        self._next("[")
        keys, line = self._keys()
        self._next("]")
        path: Path = ()
        for depth, key in enumerate(keys):
            path += (key,)
            self._lines.setdefault(path, line)
            if array and depth == len(keys) - 1:
                arrays[path] = arrays.get(path, -1) + 1
            if path in arrays:
                path += (arrays[path],)
                self._lines.setdefault(path, line)
        return path

    def _pair(self, path: Path) -> None:
        keys, line = self._keys()
        for key in keys:
            path += (key,)
            self._lines.setdefault(path, line)
        self._value(path)

    def _value(self, path: Path) -> None:
        mark = self._tokens[-1][0]
        if mark not in "[{":
            while self._tokens and self._tokens[-1][0] not in ",]}\n":
                self._tokens.pop()
            return
        self._tokens.pop()
        place = 0
        while self._next(",\n") not in "]}":
            if mark == "[":
                self._lines.setdefault((*path, place), self._tokens[-1][1])
                self._value((*path, place))
                place += 1
            else:
                self._pair(path)
        self._tokens.pop()
