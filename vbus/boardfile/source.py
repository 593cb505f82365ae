"""Mistakes in a board file: collected with their lines, raised together."""

import re
from functools import cached_property

from msgspec import Struct

from vbus.boardfile.lines import Path, TomlLines
from vbus.errors import ConfigError

_BARE = re.compile(r"[A-Za-z0-9_-]+")


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


class Source:
    """A board file being read: its name, where its keys stand, and what is wrong so far."""

    def __init__(self, file: str, text: str) -> None:
        self.file: str = file
        self.text: str = text
        self._problems: list[Problem] = []

    @cached_property
    def _lines(self) -> TomlLines:
        """Where keys stand: nobody asks about a file without mistakes."""
        return TomlLines(self.text)

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
