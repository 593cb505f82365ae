"""Source text for generated files."""

import subprocess
import sys
from collections.abc import Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Final

from vbus import plugins
from vbus.chips.family import Family
from vbus.core.errors import VbusError

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
    if not rest:
        return [f'{space}"""{summary}"""']
    lines = [f'{space}"""{summary}']
    for paragraph in rest:
        lines += ["", *(f"{space}{line}" for line in paragraph.splitlines())]
    return [*lines, f'{space}"""']


_BEGIN: Final = "<!-- begin {}: made by vbus.cli.generate -->"
_END: Final = "<!-- end {} -->"


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """Return the lines of a table; none if it has no rows."""
    head = tuple(head)
    lines = [
        "| " + " | ".join(cell.replace("|", "\\|") or "–" for cell in row) + " |" for row in rows
    ]
    return ["| " + " | ".join(head) + " |", "|" + "---|" * len(head), *lines] if lines else []


def filled(name: str, tables: Mapping[str, list[str]]) -> str:
    """Return the page of this name in ``docs`` with these tables up to date."""
    page = (ROOT / "docs" / f"{name}.md").read_text()
    for title, rows in tables.items():
        page = fill(page, title, rows)
    return page


def fill(page: str, name: str, rows: list[str]) -> str:
    """Return ``page`` with the lines between the marks of table ``name`` replaced.

    Raises:
        ValueError: the page has no such marks.
    """
    begin, end = _BEGIN.format(name), _END.format(name)
    head, found, rest = page.partition(begin)
    _, closed, tail = rest.partition(end)
    if not found or not closed:
        raise ValueError(f"the page has no table {name!r}: {begin} ... {end}")
    return f"{head}{begin}\n{chr(10).join(rows)}\n{end}{tail}"
