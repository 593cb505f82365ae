"""Fills the generated tables of documentation pages."""

import re
from collections.abc import Iterator
from pathlib import Path

from contrib.generate.marks import fill, filled
from vbus.cli.generate.layout import ROOT, table
from vbus.protocols.requests import FATAL, REFUSALS, REPLIES, REQUESTS, PayloadLayout, Request
from vbus.protocols.text import VERBS
from vbus.transports.states import CLOSED, SESSION, TERMINAL, States


def byte_protocol() -> str:
    """Return the byte protocol's page with its tables up to date."""
    requests = (
        (
            row.name,
            " ".join([_code(row), *_fields(row.layout)]),
            # Requests without a reply are most of a driver's traffic.
            f"`'{row.reply}'`" if row.reply else "none",
            row.title,
        )
        for row in REQUESTS
    )
    replies = (
        (f"`'{reply.tag}'`", " ".join(_fields(reply.layout)), reply.title)
        for reply in REPLIES.values()
    )
    refusals = (
        (f"{code:02x}", reason, "is over" if code in FATAL else "goes on")
        for code, (_, reason) in REFUSALS.items()
    )
    tables = {
        "requests": table(("request", "bytes", "reply", "meaning"), requests),
        "replies": table(("tag", "what follows", "meaning"), replies),
        "refusals": table(("code", "reason", "the session"), refusals),
    }
    return filled("byte-protocol", tables)


def text_protocol() -> str:
    """Return the text protocol's page with its table up to date."""
    rows = ((f"`{verb.usage}`", f"`{verb.answer}`", verb.title) for verb in VERBS.values())
    return filled("text-protocol", {"verbs": table(("line", "an answer", "meaning"), rows)})


def architecture() -> str:
    """Return the page about the architecture with the states of sessions and terminals drawn."""
    page = (ROOT / "ARCHITECTURE.md").read_text()
    figure = ["```mermaid", "stateDiagram-v2", *_drawn(SESSION), *_drawn(TERMINAL), "```"]
    return fill(page, "sessions", figure)


def _drawn(machine: States) -> Iterator[str]:
    """Yield the lines of a state diagram; the first row is of the first state."""
    yield f"    state {machine.name} {{"
    yield f"        [*] --> {machine.rows[0][0]}"
    # Mermaid has no end of its own name: [*] is both.
    for state, event, to in machine.rows:
        yield f"        {state} --> {'[*]' if to == CLOSED else to}: {event}"
    yield "    }"


def add_a_chip() -> str:
    """Return the page about chips of other packages with the files of its example."""
    page = (ROOT / "docs" / "add-a-chip.md").read_text()
    example = ROOT / "docs" / "examples" / "down_counter"
    for name in re.findall(r"<!-- begin ([\w./]+): ", page):
        # The example's files are run by a test; the page shows them as they are.
        language = {".py": "python", ".toml": "toml"}[Path(name).suffix]
        text = (example / name).read_text().rstrip("\n")
        page = fill(page, name, [f"```{language}", text, "```"])
    return page


def landing() -> str:
    """Return the first page of the site with what the README says, its links led from ``docs``."""
    first, *sections = re.split(r"^## ", (ROOT / "README.md").read_text(), flags=re.MULTILINE)
    # Words and picture; the drawing between them and the first section is for terminals.
    texts = {"what": first.partition("\n")[2].partition("```")[0]}
    # Later sections of the README have pages of their own here.
    for name, section in zip(("commands", "driver"), sections, strict=False):
        texts[name] = section.partition("\n")[2]
    return filled(
        "index",
        {
            name: [re.sub(r"\]\((?![a-z]+:)(docs/)?", _from_docs, text).strip("\n")]
            for name, text in texts.items()
        },
    )


def _from_docs(link: re.Match[str]) -> str:
    return "](" if link[1] else "](../"


def _code(row: Request) -> str:
    last = row.code + row.span - 1
    return f"`{row.code:02x}`" if row.span == 1 else f"`{row.code:02x}`+a (to `{last:02x}`)"


def _fields(layout: PayloadLayout) -> Iterator[str]:
    for part in layout.fields:
        if part.counted:
            yield from (f"n:{part.fixed}", f"n bytes {part.name}")
        else:
            yield f"{part.name}:{part.kind}"
