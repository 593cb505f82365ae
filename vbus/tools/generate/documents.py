"""Fills the generated tables of documentation pages."""

import re
from pathlib import Path
from typing import Final

from vbus.protocols.requests import FATAL, REFUSALS, REPLIES, REQUESTS, Layout, Request
from vbus.protocols.text import VERBS
from vbus.tools.generate.layout import ROOT

_BEGIN: Final = "<!-- begin {}: made by vbus.tools.generate -->"
_END: Final = "<!-- end {} -->"


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


def byte_protocol() -> str:
    """Return the byte protocol's page with its tables up to date."""
    page = (ROOT / "docs" / "byte-protocol.md").read_text()
    page = fill(page, "requests", _requests())
    page = fill(page, "replies", _replies())
    return fill(page, "refusals", _refusals())


def text_protocol() -> str:
    """Return the text protocol's page with its table up to date."""
    page = (ROOT / "docs" / "text-protocol.md").read_text()
    return fill(page, "verbs", _verbs())


def add_a_chip() -> str:
    """Return the page about chips of other packages with the files of its example."""
    page = (ROOT / "docs" / "add-a-chip.md").read_text()
    example = ROOT / "examples" / "down_counter"
    for name in re.findall(r"<!-- begin ([\w./]+): ", page):
        language = {".py": "python", ".toml": "toml"}[Path(name).suffix]
        text = (example / name).read_text().rstrip("\n")
        page = fill(page, name, [f"```{language}", text, "```"])
    return page


def _requests() -> list[str]:
    rows = ["| request | bytes | reply | meaning |", "|---|---|---|---|"]
    for row in REQUESTS:
        reply = f"`'{row.reply}'`" if row.reply else "none"
        rows.append(f"| {row.name} | {_bytes(row)} | {reply} | {row.title} |")
    return rows


def _bytes(row: Request) -> str:
    last = row.code + row.span - 1
    code = f"`{row.code:02x}`" if row.span == 1 else f"`{row.code:02x}`+a (to `{last:02x}`)"
    return " ".join([code, *_fields(row.layout)])


def _fields(layout: Layout) -> list[str]:
    texts = []
    for part in layout.fields:
        if part.counted:
            texts += [f"n:{part.fixed}", f"n bytes {part.name}"]
        else:
            texts.append(f"{part.name}:{part.kind}")
    return texts


def _replies() -> list[str]:
    rows = ["| tag | what follows | meaning |", "|---|---|---|"]
    for reply in REPLIES.values():
        rows.append(f"| `'{reply.tag}'` | {' '.join(_fields(reply.layout))} | {reply.title} |")
    return rows


def _refusals() -> list[str]:
    rows = ["| code | reason | the session |", "|---|---|---|"]
    for code, (_, reason) in REFUSALS.items():
        rows.append(f"| {code:02x} | {reason} | {'is over' if code in FATAL else 'goes on'} |")
    return rows


def _verbs() -> list[str]:
    rows = ["| line | an answer | meaning |", "|---|---|---|"]
    for verb in VERBS.values():
        usage = verb.usage.replace("|", "\\|")
        title = verb.title.replace("|", "\\|")
        rows.append(f"| `{usage}` | `{verb.answer}` | {title} |")
    return rows
