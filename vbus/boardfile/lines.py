"""Where each key of a TOML text stands: the line numbers behind messages about a board file."""

import tomllib
from bisect import bisect_left

Path = tuple[str | int, ...]
"""Keys and array places from the top of the file: ``("hosts", 0, "transport")``."""


class TomlLines:
    """Line numbers (from 1) of every key and array element of a TOML text.

    The text must be one :mod:`tomllib` accepts: this index repeats none of its checks.

    Args:
        text: the whole file.
    """

    def __init__(self, text: str) -> None:
        self._text: str = text.replace("\r\n", "\n")
        self._ends: list[int] = [n for n, char in enumerate(self._text) if char == "\n"]
        self._at: int = 0
        self._lines: dict[Path, int] = {}
        self._arrays: dict[Path, int] = {}
        self._read()

    def line(self, path: Path) -> int:
        """Return the line of ``path``, or of the nearest table above it that has one."""
        while path:
            if path in self._lines:
                return self._lines[path]
            path = path[:-1]
        return 1

    # -- reading ------------------------------------------------------------------------------

    def _read(self) -> None:
        table: Path = ()
        while self._skip(" \t\n"):
            if self._text.startswith("[[", self._at):
                self._at += 2
                table = self._header(array=True)
                self._at += 2
            elif self._text[self._at] == "[":
                self._at += 1
                table = self._header(array=False)
                self._at += 1
            else:
                self._pair(table)

    def _skip(self, blanks: str) -> bool:
        """Pass blanks and comments; tell whether anything is left."""
        text = self._text
        while self._at < len(text):
            if text[self._at] == "#":
                end = text.find("\n", self._at)
                self._at = len(text) if end < 0 else end
            elif text[self._at] in blanks:
                self._at += 1
            else:
                return True
        return False

    def _note(self, path: Path) -> None:
        if path not in self._lines:
            self._lines[path] = bisect_left(self._ends, self._at) + 1

    def _header(self, array: bool) -> Path:
        keys = self._keys()
        path: Path = ()
        for depth, key in enumerate(keys):
            path += (key,)
            last = depth == len(keys) - 1
            self._note(path)
            if last and array:
                self._arrays[path] = self._arrays.get(path, -1) + 1
            if path in self._arrays:
                path += (self._arrays[path],)
                self._note(path)
        return path

    def _keys(self) -> list[str]:
        """Read a key, dotted or not; stop behind it."""
        keys = []
        while True:
            self._skip(" \t")
            start = self._at
            if self._text[start] in "\"'":
                self._string()
                keys.append(_unquote(self._text[start : self._at]))
            else:
                while self._text[self._at] not in " \t.=]":
                    self._at += 1
                keys.append(self._text[start : self._at])
            self._skip(" \t")
            if self._text[self._at] != ".":
                return keys
            self._at += 1

    def _pair(self, table: Path) -> None:
        start = self._at
        keys = self._keys()
        behind, self._at = self._at, start
        path = table
        for key in keys:
            path += (key,)
            self._note(path)
        self._at = behind + 1  # the "="
        self._skip(" \t")
        self._value(path)

    def _value(self, path: Path) -> None:
        first = self._text[self._at]
        if first in "\"'":
            self._string()
        elif first == "[":
            self._array(path)
        elif first == "{":
            self._inline(path)
        else:
            while self._at < len(self._text) and self._text[self._at] not in ",]}\n#":
                self._at += 1

    def _string(self) -> None:
        quote = self._text[self._at]
        fence = quote * 3 if self._text.startswith(quote * 3, self._at) else quote
        self._at += len(fence)
        while not self._text.startswith(fence, self._at):
            escaped = quote == '"' and self._text[self._at] == "\\"
            self._at += 2 if escaped else 1
        self._at += len(fence)
        # A multi-line string may end in one or two quotes of its own.
        while len(fence) == 3 and self._text.startswith(quote, self._at):
            self._at += 1

    def _array(self, path: Path) -> None:
        self._at += 1
        place = 0
        while self._skip(" \t\n,") and self._text[self._at] != "]":
            self._note((*path, place))
            self._value((*path, place))
            place += 1
        self._at += 1

    def _inline(self, path: Path) -> None:
        self._at += 1
        while self._skip(" \t\n,") and self._text[self._at] != "}":
            self._pair(path)
        self._at += 1


def _unquote(text: str) -> str:
    return str(tomllib.loads(f"k = {text}")["k"])
