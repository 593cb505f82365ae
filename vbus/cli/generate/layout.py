"""Source text for generated files."""

import subprocess
import sys
from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from typing import Final

import click

from vbus import plugins
from vbus.boardfile.key import NAMES
from vbus.chips.family import Family
from vbus.core.errors import VbusError
from vbus.core.options import Option
from vbus.core.values import units
from vbus.core.values.settings import allowed, quoted

ROOT: Final = Path(__file__).resolve().parents[3]
"""The source tree."""

WIDTH: Final = 100
"""Longest line."""


def own_families() -> list[Family]:
    """Return the chip families that come with vbus."""
    return [one for one in plugins.families() if one.home.startswith(f"{plugins.CHIPS}.")]


def folder_of(family: Family) -> Path:
    """Return the folder a chip family lies in."""
    return Path(next(iter(import_module(family.home).__path__))).resolve()


def formatted(text: str, name: str) -> str:
    """Return Python source as ``ruff format`` lays it out, its imports sorted.

    A stub (``.pyi``) imports only what it uses, and names what stands later without quotes.

    Raises:
        VbusError: ruff is missing, or the text is not Python.
    """
    ruff = [sys.executable, "-m", "ruff"]
    plain = ["--quiet", "--isolated", f"--config=line-length={WIDTH}", "--config=src=['.']"]
    rules = "I,F401,UP037" if name.endswith(".pyi") else "I"
    # Imports first: their order changes how lines are laid out after them.
    for command in (
        [*ruff, "check", *plain, "--select", rules, "--fix-only", "--stdin-filename", name, "-"],
        [*ruff, "format", *plain, "--stdin-filename", name, "-"],
    ):
        done = subprocess.run(command, input=text, capture_output=True, text=True, cwd=ROOT)
        if done.returncode:
            raise VbusError(f"{name} cannot be formatted: {done.stderr.strip()}")
        text = done.stdout
    return text


def docstring(summary: str, paragraphs: Iterable[str] = (), indent: int = 8) -> list[str]:
    """Return the lines of a docstring, quotes included, indented.

    Paragraphs are separated by empty lines and may have several lines; empty ones are left out.
    """
    space = " " * indent
    rest = [paragraph for paragraph in paragraphs if paragraph]
    # The layout of ruff's pydocstyle rules: one line, or quotes on lines of their own.
    if not rest:
        return [f'{space}"""{summary}"""']
    lines = [f'{space}"""{summary}']
    for paragraph in rest:
        lines += ["", *(f"{space}{line}" for line in paragraph.splitlines())]
    return [*lines, f'{space}"""']


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """Return the lines of a table; none if it has no rows."""
    head = tuple(head)
    lines = [
        "| " + " | ".join(cell.replace("|", "\\|") or "–" for cell in row) + " |" for row in rows
    ]
    return ["| " + " | ".join(head) + " |", "|" + "---|" * len(head), *lines] if lines else []


def option_table(options: Iterable[Option]) -> list[str]:
    """Return a table of settings: key, value, default and meaning."""
    rows = (
        (
            f"`{option.name}`",
            _value(option),
            _default(option),
            f"{option.title} ({option.clause})" if option.clause else option.title,
        )
        for option in options
    )
    return table(("key", "value", "default", "meaning"), rows) or ["No keys of its own."]


def _value(option: Option) -> str:
    if option.kind == NAMES:
        return "a list of names"
    text = allowed(option).removeprefix("write ")
    if option.kind == "choice":
        return " or ".join(f"`{quoted(choice)}`" for choice in option.choices)
    # The message's list of units is for people who made a mistake; a table has the limits alone.
    if option.kind in units.DIMENSIONS:
        title = units.DIMENSIONS[option.kind].title
        _, _, limits = text.partition("), ")
        return f"{title}, {limits}" if limits else title
    return text.replace(" without unit", "")


def _default(option: Option) -> str:
    if option.default is None:
        return "required"
    if option.default == "":
        return "–"
    if isinstance(option.default, str | bool):
        return f"`{quoted(option.default)}`"
    shown = units.show(option.default, option.kind)
    return f'`"{shown}"`' if option.kind in units.DIMENSIONS else f"`{shown}`"


Target = tuple[str, Callable[[], str]]
"""A file's path in the source tree, and what makes its text."""


def stale(targets: list[Target]) -> list[str]:
    """Return the paths whose file is not what would be made now."""
    return [path for path, make in targets if not _is(ROOT / path, make())]


def _is(path: Path, text: str) -> bool:
    return path.exists() and path.read_text() == text


def make(makers: Iterable[Callable[[], list[Target]]], check: bool) -> None:
    """Make what is stale, and name it; with ``check`` only name it, and end with exit code 1."""
    found = False
    for targets in makers:  # what stands later may be made from what stands earlier
        for path, text_of in targets():
            file, text = ROOT / path, text_of()
            # A file that is as it should be keeps its time stamp: builds look at that.
            if _is(file, text):
                continue
            found = True
            if not check:
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(text)
            click.echo(f"{'out of date' if check else 'written'}: {path}")
    if check and found:
        sys.exit(1)
