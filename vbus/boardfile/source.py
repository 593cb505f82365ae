"""Mistakes in a board file: collected with their lines, raised together."""

import re
import tomllib
from codecs import BOM_UTF8
from collections.abc import Iterable, Iterator
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any, Self

from msgspec import Struct

from vbus.boardfile.lines import Path, TomlLines
from vbus.core.errors import ConfigError
from vbus.core.file_kinds import foreign, no_text, unreadable
from vbus.core.values.settings import among

Mistakes = Iterator[tuple[Path, str]]
"""Where a mistake is, and what is wrong there."""
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_UNQUOTED = re.compile(r"""\s*([\w-]+)\s*=\s*(\w[^"'#]*?)\s*(?:#.*)?""")
"""A key whose value begins as a text without its quotes would: ``clock = 8 MHz``."""


class Problem(Struct, frozen=True):
    """One mistake.

    Attributes:
        file: path of the board file as it was given.
        line: line number from 1; 0 if it concerns the whole file.
        key: path of the key, such as ``chips.x.clock``; empty for the whole file.
        message: what was found and what is allowed.
    """

    file: str
    line: int
    key: str
    message: str

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}" if self.line else self.file
        return f"{place}: {self.key}: {self.message}" if self.key else f"{place}: {self.message}"


class BoardFileError(ConfigError):
    """A board file with mistakes in it; the text has one line for each.

    Attributes:
        problems: the mistakes, in the order of their lines.
    """

    def __init__(self, problems: list[Problem]) -> None:
        self.problems: list[Problem] = problems
        super().__init__("\n".join(str(problem) for problem in problems))


def key_text(path: Path) -> str:
    """Return a path as TOML writes it, rows counted from 1: ``nets."/SYNC"``, ``hosts[1].card``."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part + 1}]"
        else:
            name = part if _BARE.fullmatch(part) else '"' + part.replace('"', '\\"') + '"'
            text += f".{name}" if text else name
    return text


def absent(kind: str, name: str, names: Iterable[str]) -> str:
    """Return what to say of a name that is none of the ``names`` of a section."""
    return f"there is no [{kind}.{name}]; {among(name, names, 'this file has')}"


class Source:
    """A board file being read: its name, where its keys stand, and what is wrong so far."""

    def __init__(self, file: str, text: str) -> None:
        self.file: str = file
        self.text: str = text
        self._problems: list[Problem] = []

    @cached_property
    def _lines(self) -> TomlLines:
        """Where keys stand; only a file with mistakes needs it."""
        return TomlLines(self.text)

    @classmethod
    def of_file(cls, path: str | FilePath) -> Self:
        """Return the source in a file.

        Raises:
            BoardFileError: it cannot be read, or is no text.
        """
        name = str(path)
        try:
            # Editors of Windows put a mark of the byte order (BOM) before UTF-8.
            return cls(name, FilePath(path).read_bytes().removeprefix(BOM_UTF8).decode())
        except OSError as error:
            raise BoardFileError([Problem(name, 0, "", unreadable(path, error))]) from None
        except UnicodeDecodeError as error:
            line = error.object.count(b"\n", 0, error.start) + 1
            reason = no_text(path, error.object)
            raise BoardFileError([Problem(name, line, "", reason)]) from None

    def parsed(self, meant: str = "board file") -> dict[str, Any]:
        """Return its tables.

        Args:
            meant: what the file should be.

        Raises:
            BoardFileError: it is no TOML.
        """
        try:
            return tomllib.loads(self.text)
        except RecursionError:
            line, reason = 0, "nested too deeply"
        except ValueError as error:
            line, reason = self._no_toml(str(error), meant)
        raise BoardFileError([Problem(self.file, line, "", reason)])

    def _no_toml(self, reason: str, meant: str) -> tuple[int, str]:
        if other := foreign(self.file, self.text.encode()):
            return 0, f"this is no {meant}: {other}"
        # Before Python 3.14 an error of tomllib has its place in its text alone.
        match = re.fullmatch(r"(.*) \(at line (\d+), column (\d+)\)", reason, re.DOTALL)
        if match is not None:
            line = int(match[2])
            bare = _UNQUOTED.fullmatch(self.text.splitlines()[line - 1]) if match[3] else None
            hint = f'; a text stands in quotes: {bare[1]} = "{bare[2]}"' if bare else ""
            return line, f"no TOML: {match[1]} (column {match[3]}){hint}"
        begun, at_end, _ = reason.partition(" (at end of document)")
        return self.text.count("\n") + 1 if at_end else 0, f"no TOML: {begun}"

    def fail(self, path: Path, message: str) -> None:
        """Note a mistake at ``path``."""
        line = self._lines.line(path) if path else 0
        problem = Problem(self.file, line, key_text(path), message)
        if problem not in self._problems:
            self._problems.append(problem)

    def finish(self) -> None:
        """Raise what was noted.

        Raises:
            BoardFileError: there is at least one mistake.
        """
        if self._problems:
            raise BoardFileError(sorted(self._problems, key=_line))


def _line(problem: Problem) -> int:
    return problem.line
