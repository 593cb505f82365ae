"""Tables in pages of the source tree, between marks."""

from collections.abc import Mapping
from typing import Final

from vbus.cli.generate.layout import ROOT

_BEGIN: Final = "<!-- begin {}: made by contrib.generate -->"
_END: Final = "<!-- end {} -->"


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
